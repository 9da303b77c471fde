"""Follow the curve in which a blend meets a face, point by point, and fit the parts of it that become edges.

Points are x = (s, v, a, b) with H(s, v) = N(a, b): H the blend surface, N the surface of the face. Along the way the
blend is on the side of the curve where the edge is blended: that, and nothing else, gives the curve its sense.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.network.strip_surface import StripCut, StripSurface
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.shell_editing.end_curve import fit_solved_curve
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.errors import GeometryError, TopologyError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import normalise_vectors, to_tangent_coordinates


@dataclass(frozen=True)
class MeetingPoint:
    """A point x (4,) of the curve, and its rates dx (4,) per mm along it; ``touches`` if the surfaces do so there."""

    x: Array
    rates: Array
    touches: bool = False

    def reverse(self) -> MeetingPoint:
        """Return the point with the curve in the opposite sense."""
        return replace(self, rates=-self.rates)


@dataclass(frozen=True)
class Meeting:
    """A blend surface H and the surface N of a face that it meets.

    ``sense`` is 1 or -1, so that the curve runs along sense (-n.H_v, n.H_s) in (s, v), n the normal of N.
    """

    blend: StripSurface
    target: Primary
    sense: float
    size: float  # mm: of the blend across

    @classmethod
    def at_end(cls, placement: StripPlacement, end: int, side: SupportFace) -> Meeting:
        """Return the meeting of a blend with a face at one end (0 or 1) of its edge."""
        at_end = np.full(2, placement.locate_edge_parameter(float(end)))
        first, last = placement.strip(at_end, np.array([0.0, 1.0]))
        sense = side.outward * (1.0 if placement.joint.is_convex else -1.0) * (1.0 if end else -1.0)
        return cls(placement.strip, side.face_primary, sense, float(np.linalg.norm(last - first)))

    def solve_points(self, near: Array, rows: Array, values: Array) -> tuple[Array, Array]:
        """Solve for points x (n, 4) with rows (n, 2) . (s, v) = values (n,), and tell which were found."""

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            h, n = self.blend.jet(x[:, 0], x[:, 1], 1), self.target.jet(x[:, 2:])
            rates = np.stack([h[1, 0], h[0, 1], -n[1], -n[2]], axis=2)
            residual = np.column_stack([h[0, 0] - n[0], (rows * x[:, :2]).sum(axis=1) - values])
            last = np.concatenate([rows, np.zeros_like(rows)], axis=1)
            jacobian = np.concatenate([rates, last[:, None]], axis=1)
            return residual, jacobian, np.linalg.norm(rates, axis=1)

        return solve_damped_newton(evaluate_system, near, self.size, self.size)

    def measure_scales(self, x: Array) -> Array:
        """Return the lengths (mm) of unit steps in s and in v at a point x."""
        h = self.blend.jet(x[:1], x[1:2], 1)
        return np.linalg.norm([h[1, 0, 0], h[0, 1, 0]], axis=1)

    def evaluate_rates(self, x: Array) -> Array:
        """Return dx (4,) per mm along the curve at a point x of it.

        Raises
        ------
        GeometryError
            If the surfaces touch there.
        """
        h, n = self.blend.jet(x[:1], x[1:2], 1)[:, :, 0], self.target.jet(x[None, 2:])
        normal = normalise_vectors(np.cross(n[1, 0], n[2, 0]))
        along = self.sense * np.array([-(normal @ h[0, 1]), normal @ h[1, 0]])
        scales = np.linalg.norm([h[1, 0], h[0, 1]], axis=1)
        if np.abs(along / scales[::-1]).max() < SHELL_EDIT_TOLERANCES.tangent_faces:
            raise GeometryError("the blend touches the face at its end and does not cross it")
        return self._complete_rates(h, n, along)

    def direct_rates(self, x: Array, along: Array) -> Array:
        """Return dx (4,) per mm at a point x where the surfaces touch, in a direction (2,) in (s, v)."""
        return self._complete_rates(self.blend.jet(x[:1], x[1:2], 1)[:, :, 0], self.target.jet(x[None, 2:]), along)

    def _complete_rates(self, h: Array, n: Array, along: Array) -> Array:
        """Return dx (4,) per mm for a direction (2,) in (s, v), from the jets of both surfaces."""
        tangent = h[1, 0] * along[0] + h[0, 1] * along[1]
        length = float(np.linalg.norm(tangent))
        return np.concatenate([along, to_tangent_coordinates(n, tangent[None])[0]]) / length

    def advance(self, point: MeetingPoint, length: float) -> MeetingPoint:
        """Return the point of the curve about a length (mm) further.

        Raises
        ------
        TopologyError
            If there is none.
        """
        predicted = point.x + length * point.rates
        row = self.measure_scales(point.x) ** 2 * point.rates[:2]
        x, good = self.solve_points(predicted[None], row[None], np.array([row @ predicted[:2]]))
        if not good[0]:
            raise TopologyError("the blend cannot be followed: it is too large for what lies there")
        return MeetingPoint(x[0], self.evaluate_rates(x[0]))

    def fit_through(self, points: Sequence[MeetingPoint]) -> StripCut:
        """Return the curve from the first to the last of its points.

        In closed form where the blend has one with the plane that it ends on, else solved across a polynomial near the
        points.

        Raises
        ------
        TopologyError
            If it cannot be followed.
        """
        first, last = points[0], points[-1]
        if isinstance(self.target, Plane) and not (first.touches or last.touches) and first.x[1] < last.x[1]:
            section = self.blend.cut_with_plane(self.target, float(first.x[0]))
            if section is not None:
                return section.restrict(float(first.x[1]), float(last.x[1]))
        scales = self.measure_scales((first.x + last.x) / 2)
        guide = _fit_guide(points, scales)
        length = float(np.linalg.norm(scales * (last.x - first.x)[:2]))

        def solve_curve_points(share: Array, near: Array | None) -> Array:
            """Return the curve's values (n, 7) at shares (n,) of the guide."""
            at, along = (np.stack([one(share) for one in row], axis=1) for row in guide)
            rows = along[:, :2] * scales**2 / length
            x, good = self.solve_points(at if near is None else near[:, :4], rows, (rows * at[:, :2]).sum(axis=1))
            for end, point in ((0.0, first), (1.0, last)):
                if point.touches:  # where the equations are singular, and the solution is known
                    x[share == end], good[share == end] = point.x, True
            if not good.all():
                raise TopologyError("the blend cannot be followed on the faces at its end: it is too large for them")
            return np.column_stack([x, self.target.jet(x[:, 2:])[0]])

        def measure_error(values: Array, _: Array) -> float:
            """Return how far (mm) points are from their images on both surfaces."""
            on_blend, on_target = self.blend(values[:, 0], values[:, 1]), self.target.jet(values[:, 2:4])[0]
            return float(max(np.abs(p - values[:, 4:]).max() for p in (on_blend, on_target)))

        return StripCut.from_solution(fit_solved_curve(solve_curve_points, measure_error))


def _fit_guide(points: Sequence[MeetingPoint], scales: Array) -> tuple[list[Polynomial], list[Polynomial]]:
    """Return polynomials x (4) over [0, 1] near points of a curve, with its ends and directions there, and their rates.

    They are the cubic with these, and x^2 (1 - x)^2 times what brings it near to the points between. ``scales`` are the
    lengths (mm) of unit steps in the first two coordinates.
    """
    values = np.stack([point.x for point in points])
    lengths = np.linalg.norm(np.diff(values[:, :2], axis=0) * scales, axis=1)
    share = np.append(0.0, np.cumsum(lengths)) / lengths.sum()
    rates = [
        point.rates / np.linalg.norm(scales * point.rates[:2]) * lengths.sum() for point in (points[0], points[-1])
    ]
    count = min(len(points) - 2, SHELL_EDIT_TOLERANCES.guide_terms)
    window = Polynomial([0, 0, 1, -2, 1])
    basis = window(share[1:-1, None]) * share[1:-1, None] ** np.arange(count)
    guide = []
    for start, stop, slope, last_slope, column in zip(values[0], values[-1], *rates, values[1:-1].T, strict=True):
        rise = stop - start
        cubic = Polynomial([start, slope, 3 * rise - 2 * slope - last_slope, slope + last_slope - 2 * rise])
        terms = np.linalg.lstsq(basis, column - cubic(share[1:-1]))[0] if count else [0.0]
        guide.append(cubic + window * Polynomial(terms))
    return guide, [one.deriv() for one in guide]
