"""The curve of a mitre, in which two strips meet that touch one face where their rails on it cross.

H1(s, v) and H2(s', v') are tangent to each other at the crossing, where the equations H1 = H2 are singular; everywhere
else on the curve they cross. It is solved point by point across the *shallower* strip, which it crosses as a whole,
from its rail on the common face to that on its wall; and in closed form where it lies in a plane that cuts both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.network.strip_surface import StripSurface
from cqblend.brep.shell_editing.end_curve import fit_solved_curve
from cqblend.brep.shell_editing.strip_end import StripsTooShortError
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.errors import TopologyError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.circle import Circle
from cqblend.surfaces.ellipse import Ellipse
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import LocalFrame, measure_lengths, normalise_vectors


@dataclass(frozen=True)
class MitredSurface:
    """The surface of a strip that ends in a mitre.

    ``end`` is the end (0 or 1) that does, ``common`` the side (0 or 1) on the common face, and ``start`` the s about
    where the edge ends.
    """

    strip: StripSurface
    end: int
    common: int
    start: float

    @property
    def width(self) -> float:
        """The straight distance (mm) from rail to rail there."""
        first, last = self.strip(np.full(2, self.start), np.array([0.0, 1.0]))
        return float(np.linalg.norm(last - first))

    def evaluate_rail(self, s: Array) -> tuple[Array, Array]:
        """Return points (n, 3) of the rail on the common face, and their derivatives by s."""
        jet = self.strip.jet(s, np.full(len(s), float(self.common)), 1)
        return jet[0, 0], jet[1, 0]

    def trace_rail(self, share: float, overrun: float) -> tuple[Array, Array]:
        """Return s (n,) and points (n, 3) of the rail on the common face on a last share of the strip, and beyond.

        The last point is by ``overrun`` (mm) beyond the end, in the direction of the rail there.
        """
        inner, outer = self.strip.domain[:: 1 if self.end else -1]
        s = np.linspace(outer + share * (inner - outer), outer, SHELL_EDIT_TOLERANCES.rail_chords + 1)
        points, rates = self.evaluate_rail(s)
        step = (1.0 if self.end else -1.0) * overrun / float(np.linalg.norm(rates[-1]))
        return np.append(s, s[-1] + step), np.append(points, [points[-1] + step * rates[-1]], axis=0)

    def direct_beyond(self) -> Array:
        """Return the direction (3,) of the rail past the end of the edge."""
        rate = self.evaluate_rail(np.array([self.start]))[1][0]
        return rate if self.end else -rate

    def direct_inward(self) -> Array:
        """Return the direction (3,) on the common face away from the edge."""
        across = self.strip.jet(np.array([self.start]), np.array([float(self.common)]), 1)[0, 1, 0]
        return across if self.common else -across

    def measure_beyond(self, s: Array) -> Array:
        """Return how far (mm) parameters (n,) are past the end of the edge, negative before it, by the speed there."""
        speed = float(np.linalg.norm(self.evaluate_rail(np.array([self.start]))[1]))
        return (s - self.start) * (speed if self.end else -speed)

    def locate_across(self, share: Array) -> Array:
        """Return v at shares (n,) of the way from the rail on the common face to that on the wall."""
        return share if self.common == 0 else 1 - share


class RailsApartError(TopologyError):
    """The rails of two strips do not cross on the face that both run on, or only far past the ends of their edges."""


@dataclass(frozen=True)
class MitreCurve:
    """A mitre over a span of its parameter, and in the parameters (s, v) of the shallower and the deeper strip.

    It starts at the crossing on the common face if it ``starts_at_common``, else it stops there.
    """

    curve: Curve | Circle | Ellipse
    span: tuple[float, float]
    on_strips: tuple[Curve, Curve]
    starts_at_common: bool

    def evaluate_end(self, *, at_common: bool) -> tuple[Array, Array, Array]:
        """Return the point (3,) of one end, and its parameters (2,) on both strips."""
        at = np.array([self.span[0 if at_common == self.starts_at_common else 1]])
        first, second = self.on_strips
        return self.curve(at)[0], first(at)[0], second(at)[0]


def solve_mitre_curve(
    shallower: MitredSurface, deeper: MitredSurface, crossing: Array, near: tuple[float, float]
) -> MitreCurve:
    """Return the mitre of two strips, whose rails on the common face cross at ``crossing`` (2,).

    Those on their walls arrive at the other wall at s ``near``.

    Raises
    ------
    TopologyError
        If they do not meet all across the shallower one.
    """
    solution = _MitreSolution(shallower, deeper, crossing, near)
    return solution.cut_by_plane() or solution.fit()


class _MitreSolution:
    """The solution of H1(s, v) = H2(s', v') by the share of the way across H1 from common face to wall: (s, s', v')."""

    def __init__(
        self, shallower: MitredSurface, deeper: MitredSurface, crossing: Array, near: tuple[float, float]
    ) -> None:
        self.surfaces = shallower, deeper
        self._size = min(shallower.width, deeper.width)
        self._at_common = np.append(crossing, float(deeper.common))
        v = deeper.locate_across(np.linspace(0.0, 1.0, SHELL_EDIT_TOLERANCES.mitre_start_samples))
        target = shallower.strip(np.array([near[0]]), shallower.locate_across(np.ones(1)))
        apart = measure_lengths(deeper.strip(np.full(len(v), near[1]), v) - target)
        self._near_wall = np.array([*near, v[int(apart.argmin())]])

    def _solve(self, share: Array, near: Array) -> Array:
        """Return the solution (n, 3) at shares (n,), from values nearby.

        Raises
        ------
        TopologyError
            If there is none.
        """
        (one, other), v = self.surfaces, self.surfaces[0].locate_across(share)

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            first, second = one.strip.jet(x[:, 0], v, 1), other.strip.jet(x[:, 1], x[:, 2], 1)
            jacobian = np.stack([first[1, 0], -second[1, 0], -second[0, 1]], axis=2)
            return first[0, 0] - second[0, 0], jacobian, np.linalg.norm(jacobian, axis=1)

        x, good = solve_damped_newton(evaluate_system, near, self._size, self._size)
        x[share == 0], good[share == 0] = self._at_common, True  # where the equations are singular
        if not good.all():
            raise TopologyError("the two blends do not meet there all across: the size is too large for their edges")
        return x

    def _solve_from_wall(self, share: Array) -> Array:
        """Return the solution (n, 3) at ascending shares (n,), found one after the other from the wall on."""
        found = [self._solve(share[-1:], self._near_wall[None])[0]]
        rate = found[0] - self._at_common
        for k in range(len(share) - 2, -1, -1):
            step = share[k] - share[k + 1]
            found.append(self._solve(share[k : k + 1], (found[-1] + step * rate)[None])[0])
            rate = (found[-1] - found[-2]) / step
        return np.array(found[::-1])

    def fit(self) -> MitreCurve:
        """Return the fitted curve."""
        one, other = self.surfaces

        def solve_curve_points(share: Array, near: Array | None) -> Array:
            """Return the curve's values (n, 7) at shares (n,): parameters on both strips, and the point."""
            x = self._solve_from_wall(share) if near is None else self._solve(share, near[:, [0, 2, 3]])
            v = one.locate_across(share)
            return np.column_stack([x[:, 0], v, x[:, 1:], one.strip(x[:, 0], v)])

        def measure_error(values: Array, _: Array) -> float:
            """Return how far (mm) points are from their images on both strips."""
            images = one.strip(values[:, 0], values[:, 1]), other.strip(values[:, 2], values[:, 3])
            return float(max(np.abs(image - values[:, 4:]).max() for image in images))

        fitted = fit_solved_curve(solve_curve_points, measure_error)
        first, second, points = (
            Curve(fitted.breaks, fitted.coefs[:, part], continuity=fitted.continuity)
            for part in (slice(0, 2), slice(2, 4), slice(4, 7))
        )
        return MitreCurve(points, fitted.domain, (first, second), starts_at_common=True)

    def cut_by_plane(self) -> MitreCurve | None:
        """Return the curve in closed form; None if it is not in a plane, or if that does not cut both strips so."""
        shares = np.array([0.0, 0.5, 1.0])
        x = self._solve_from_wall(shares)
        v = self.surfaces[0].locate_across(shares)
        points = self.surfaces[0].strip(x[:, 0], v)
        along, arm = normalise_vectors(points[2] - points[0]), points[1] - points[0]
        across = arm - (arm @ along) * along
        if np.linalg.norm(across) <= SHELL_EDIT_TOLERANCES.curve_fit:
            return None
        axes = np.array([along, normalise_vectors(across)])
        plane = Plane(LocalFrame(points[0], np.array([*axes, np.cross(*axes)])))
        parts = []
        for surface, s, ends in zip(self.surfaces, (x[1, 0], x[1, 1]), (v[[0, 2]], x[[0, 2], 2]), strict=True):
            cut = surface.strip.cut_with_plane(plane, float(s))
            if cut is None:
                return None
            parts.append(cut.restrict(*np.clip(np.sort(ends), 0.0, 1.0).tolist()))
        first, second = parts
        is_opposite = self.surfaces[0].common != self.surfaces[1].common
        on_second = (second.on_strip.reverse() if is_opposite else second.on_strip).reparametrized(*first.span)
        share = np.linspace(0.0, 1.0, SHELL_EDIT_TOLERANCES.shared_rail_samples)
        low, high = np.array([first.span, second.span]).T[:, :, None]
        at_first, at_second = low + share * (high - low)
        images = second.curve(at_second[::-1] if is_opposite else at_second)
        if np.abs(first.curve(at_first) - images).max() > SHELL_EDIT_TOLERANCES.curve_fit:
            return None
        return MitreCurve(first.curve, first.span, (first.on_strip, on_second), self.surfaces[0].common == 0)


def cross_rails(one: MitredSurface, other: MitredSurface) -> Array:
    """Return the parameters (2,) at which the rails of two strips cross on their common face.

    Raises
    ------
    StripsTooShortError
        If they do so, as far as can be told, beyond the strips.
    RailsApartError
        If they do not.
    """
    at_end = one.strip.jet(np.array([one.start]), np.array([float(one.common)]), 1)
    x = normalise_vectors(at_end[1, 0, 0])
    y = normalise_vectors(at_end[0, 1, 0] - (at_end[0, 1, 0] @ x) * x)
    plane, size = np.array([x, y]).T, max(one.width, other.width)

    def evaluate_system(s: Array) -> tuple[Array, Array, Array]:
        (first, rate), (second, other_rate) = one.evaluate_rail(s[:, 0]), other.evaluate_rail(s[:, 1])
        rates = np.stack([rate, -other_rate], axis=2)
        return (first - second) @ plane, np.einsum("nij,ik->nkj", rates, plane), np.linalg.norm(rates, axis=1)

    s, good = solve_damped_newton(evaluate_system, _guess_crossing(one, other, plane)[None], size, size)
    apart = one.evaluate_rail(s[:, 0])[0] - other.evaluate_rail(s[:, 1])[0]
    if not good[0] or np.linalg.norm(apart) > SHELL_EDIT_TOLERANCES.at_mitre:
        raise _make_crossing_error()
    return s[0]


def _guess_crossing(one: MitredSurface, other: MitredSurface, plane: Array) -> Array:
    """Return about where the rails of two strips cross on their common face (2,): where their polygons do.

    They are looked at in a plane, by two axes (3, 2), from the middle of the strips on, or, if they do not cross then,
    from their other ends, and go on straight beyond their ends. Where the angle of the common face at the vertex is
    reflex, it is the crossing nearest to the ends of the edges, where it is convex, the first. Of several, one counts
    that is past the ends of both edges, or before both, as crossings of strips of one size are.

    Raises
    ------
    StripsTooShortError, RailsApartError
        As :func:`cross_rails`.
    """
    is_reflex = bool(other.direct_beyond() @ one.direct_inward() > 0)
    overrun = SHELL_EDIT_TOLERANCES.longest_overrun * max(one.width, other.width)
    for share in (0.5, 1.0):
        chords = [surface.trace_rail(share, overrun) for surface in (one, other)]
        found = _cross_polygons(*(points @ plane for _, points in chords))
        if not len(found):
            continue
        count = len(chords[0][0])
        s = np.stack([np.interp(at, np.arange(count), own) for at, (own, _) in zip(found.T, chords, strict=True)])
        beyond = np.array([surface.measure_beyond(own) for surface, own in zip((one, other), s, strict=True)])
        agrees = (beyond > 0).all(axis=0) if is_reflex else (beyond < 0).all(axis=0)
        rank = np.abs(beyond).sum(axis=0) if is_reflex else beyond.sum(axis=0)
        best = int(np.lexsort((rank, ~agrees))[0])
        if found[best].max() > count - 2:  # on what goes on straight
            raise StripsTooShortError(s[:, best].tolist())
        return s[:, best]
    raise _make_crossing_error()


def _cross_polygons(first: Array, second: Array) -> Array:
    """Return where two polygons (n, 2) and (m, 2) cross (k, 2): by each, index of a point and share of its chord."""
    first_step, second_step = np.diff(first, axis=0), np.diff(second, axis=0)
    turn = first_step[:, None, 0] * second_step[:, 1] - first_step[:, None, 1] * second_step[:, 0]
    gap = second[:-1] - first[:-1, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (gap[..., 0] * second_step[:, 1] - gap[..., 1] * second_step[:, 0]) / turn
        along_other = (gap[..., 0] * first_step[:, None, 1] - gap[..., 1] * first_step[:, None, 0]) / turn
    i, j = np.nonzero((along >= 0) & (along <= 1) & (along_other >= 0) & (along_other <= 1))
    return np.stack([i + along[i, j], j + along_other[i, j]], axis=1)


def _make_crossing_error() -> RailsApartError:
    return RailsApartError("the rails of the two blends do not cross on the face between them, or far from their edges")
