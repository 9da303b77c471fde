r"""Pairing of rulings: which point of one rail a ruling joins with which of the other, for a developable strip.

A ruling from C1(s) to C2(t) lies in one tangent plane if

.. math:: f(s, t) = \det(C_1'(s),\; C_2'(t),\; C_2(t) - C_1(s)) = 0

Points (s, t) with f = 0 that increase in both parameters pair the rails of a developable strip. Such a path seldom
runs from corner to corner: it begins somewhere on an edge of the square of parameters, s = s0 or t = t0. From the
corner to there one parameter is fixed, and the rail's point there is the apex of a fan, a piece of a cone, that joins
the rest smoothly, because its last ruling is one of the path's; likewise at the other end. Both rails keep their shape,
at another speed. How far the new strip is from the surface is for the caller to measure. Depends on splines only.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cqblend.errors import GeometryError, InputError
from cqblend.patterns.strips.developability import RailPair, bound_twist, check_rails, classify_strip
from cqblend.patterns.strips.tolerances import RULING_TOLERANCES
from cqblend.splines import Curve, hermite
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide

_ROW_COUNT = 64
"""Number of intervals of r = (x + y) / 2 in which the path is traced."""

_COLUMN_COUNT = 129
"""Number of samples of q = y - x in each row."""

_MAX_PIECES = 256
"""Largest number of Hermite pieces that the path is fitted with."""


@dataclass(frozen=True, slots=True, eq=False)
class RulingPairing:
    """How two rails are paired, or why they cannot be.

    Attributes
    ----------
    rails
        C1(s(r)) and C2(t(r)) over one domain, with the same breaks; None if there is no pairing.
    parameters
        s(r) and t(r), which never decrease; None likewise.
    fan_lengths
        Lengths of the parts of the domain, at its start and at its end, that are fans about a point of one rail.
    twist
        Bound of the twist that is left, see :func:`cqblend.patterns.strips.developability.bound_twist`; nan without
        rails.
    deviation
        What the caller's function returned for the new rails; nan without one.
    reason
        Why there is no pairing; empty if there is.
    """

    rails: RailPair | None
    parameters: tuple[Curve, Curve] | None
    fan_lengths: tuple[float, float] = (0.0, 0.0)
    twist: float = np.nan
    deviation: float = np.nan
    reason: str = ""


def pair_rulings(
    rails: RailPair, tolerance: float = np.inf, deviation: Callable[[RailPair], float] | None = None
) -> RulingPairing:
    """Pair two rails so that the strip between them is developable, if that can be done.

    Parameters
    ----------
    rails
        C1 and C2 of dim 3 over one domain. A strip that is developable already keeps its pairing.
    tolerance
        Largest deviation.
    deviation
        Measures how far the strip between new rails is from what it stands for; None to accept any.

    Returns
    -------
    RulingPairing
        Without rails, and with a reason, if f = 0 has no path through the strip that increases in both parameters, or
        the deviation exceeds the tolerance.

    Raises
    ------
    InputError
        If the rails are not two curves of dim 3, or the tolerance is not positive.
    GeometryError
        If there is no surface between them.

    Examples
    --------
    >>> lower = Curve.bezier([[0.0, 0, 0], [1, 0, 1], [2, 0, 0]])
    >>> upper = Curve.bezier([[0.2, 1, 0], [1, 1, 0.9], [2, 1, 0.1]])
    >>> pairing = pair_rulings((lower, upper))
    >>> bound_twist((lower, upper)) > 0.1, pairing.twist < 1e-9
    (True, True)
    """
    rails = check_rails(rails)
    if not tolerance > 0:
        raise InputError(f"tolerance {tolerance}: it must be positive")
    if classify_strip(rails) != "twisted":
        start, end = rails[0].domain
        same = Curve.bezier([[start], [end]], None, (start, end))
        return _check_deviation(RulingPairing(rails, (same, same), twist=bound_twist(rails)), tolerance, deviation)
    corner = _find_corner(rails)
    if corner is not None:
        return _refuse_pairing(f"a rail has a corner at t = {corner:.6g}")
    condition = _TangentPlaneCondition(rails)
    path = _trace_path(condition)
    if isinstance(path, str):
        return _refuse_pairing(path)
    return _check_deviation(_compose_pairing(condition, path), tolerance, deviation)


def _refuse_pairing(reason: str) -> RulingPairing:
    return RulingPairing(None, None, reason=reason)


def _check_deviation(
    pairing: RulingPairing, tolerance: float, deviation: Callable[[RailPair], float] | None
) -> RulingPairing:
    """Return the pairing with its deviation, or none if that exceeds the tolerance."""
    if deviation is None or pairing.rails is None:
        return pairing
    found = float(deviation(pairing.rails))
    if not found <= tolerance:
        return RulingPairing(
            None, None, deviation=found, reason=f"the strip would deviate by {found:.3g}, more than {tolerance:.3g}"
        )
    return replace(pairing, deviation=found)


def _find_corner(rails: RailPair) -> float | None:
    """Return a break at which a rail has a corner, None if there is none."""
    for rail in rails:
        inner = rail.breaks[1:-1]
        before, after = (rail(inner, 1, side=side) for side in ("left", "right"))
        size = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
        has_corner = np.linalg.norm(np.cross(before, after), axis=1) > RULING_TOLERANCES.corner_sine * size
        if has_corner.any():
            return float(inner[has_corner][0])
    return None


class _TangentPlaneCondition:
    """f and its derivatives, in the parameters x, y of the two rails, mapped to [0, 1].

    Paths f = 0 are followed in r = (x + y) / 2, q = y - x, in which increasing paths are functions q(r) with
    abs(q') <= 2.
    """

    def __init__(self, rails: RailPair) -> None:
        self.rails = rails
        self.start, end = rails[0].domain
        self.length = end - self.start

    def __call__(self, x: Array, y: Array) -> Array:
        """Return f."""
        return self.jet(x, y, 1)[0]

    def jet(self, x: Array, y: Array, order: int, side: BreakSide = "right") -> list[Array]:
        """Return f; up to order 2 also f_x, f_y; up to order 3 also f_xx, f_xy, f_yy."""
        a = self.rails[0].jet(self.start + self.length * x, order, side=side)
        b = self.rails[1].jet(self.start + self.length * y, order, side=side)
        d = b[0] - a[0]
        out = [_triple_product(a[1], b[1], d)]
        if order > 1:
            out += [_triple_product(a[2], b[1], d), _triple_product(a[1], b[2], d)]
        if order > 2:
            out += [
                _triple_product(a[3], b[1], d) - _triple_product(a[2], b[1], a[1]),
                _triple_product(a[2], b[2], d),
                _triple_product(a[1], b[3], d) + _triple_product(a[1], b[2], b[1]),
            ]
        scale = [self.length] * 2 + [self.length**2] * 3
        return out[:1] + [f * k for f, k in zip(out[1:], scale, strict=False)]

    def evaluate_rotated(self, r: Array, q: Array) -> Array:
        """Return f at x = r - q / 2, y = r + q / 2."""
        return self(r - q / 2, r + q / 2)

    def differentiate_path(self, r: Array, q: Array, side: BreakSide) -> tuple[Array, Array]:
        """Return q' and q'' along a path f = 0, as limits from one side of breaks."""
        x, y = self._snap_to_breaks(self.rails[0], r - q / 2), self._snap_to_breaks(self.rails[1], r + q / 2)
        _, fx, fy, fxx, fxy, fyy = self.jet(x, y, 3, side)
        fq = (fy - fx) / 2
        first = -(fx + fy) / fq
        second = -(fxx + 2 * fxy + fyy + (fyy - fxx) * first + (fxx - 2 * fxy + fyy) / 4 * first**2) / fq
        return first, second

    def _snap_to_breaks(self, rail: Curve, x: Array) -> Array:
        """Return parameters, those that differ from a break by rounding only moved to it."""
        breaks = (rail.breaks - self.start) / self.length
        nearest = breaks[np.abs(x[:, None] - breaks).argmin(axis=1)]
        return np.where(np.abs(nearest - x) < RULING_TOLERANCES.parameter_snap, nearest, x)

    def solve_roots(self, r: Array, q: Array) -> Array:
        """Return the roots q of f at r next to given q, by Newton's method, until steps are rounding."""
        before = np.inf
        for _ in range(30):
            f, fx, fy = self.jet(r - q / 2, r + q / 2, 2)
            slope = (fy - fx) / 2
            step = np.divide(f, slope, out=np.zeros_like(f), where=slope != 0)
            q = q - step
            longest = float(np.abs(step).max(initial=0.0))
            if longest <= 1e-15 or before / 2 < longest <= RULING_TOLERANCES.settled_step:
                break
            before = longest
        return q


def _triple_product(a: Array, b: Array, c: Array) -> Array:
    return np.asarray((np.cross(a, b) * c).sum(axis=-1))


@dataclass(frozen=True, slots=True)
class _PathEnd:
    """A point in which a path meets an edge of the square of parameters.

    Attributes
    ----------
    fixed
        The parameter that is constant on that edge, and in the fan up to the corner.
    edge
        Its value: 0 or 1.
    free
        The other parameter at the point.
    """

    fixed: Literal["x", "y"]
    edge: float
    free: float

    @property
    def r(self) -> float:
        """Mean of x and y."""
        return (self.edge + self.free) / 2

    @property
    def q(self) -> float:
        """Difference y - x."""
        return self.free - self.edge if self.fixed == "x" else self.edge - self.free


@dataclass(frozen=True, slots=True, eq=False)
class _Path:
    """A path f = 0 through the square of parameters: its points, r and q (n,), and its ends, which are among them."""

    r: Array
    q: Array
    ends: tuple[_PathEnd, _PathEnd]


def _trace_path(condition: _TangentPlaneCondition) -> _Path | str:
    """Trace f = 0 from edge to edge of the square, through the rows of a grid in (r, q); or say why that fails.

    It starts at the sign change closest to q = 0 in the middle, and goes on from row to row, in both directions, at the
    sign change closest to the extrapolated one.
    """
    r = np.arange(1, _ROW_COUNT) / _ROW_COUNT
    half_width = 2 * np.minimum(r, 1 - r)
    q = half_width[:, None] * np.linspace(-1, 1, _COLUMN_COUNT)
    f = condition.evaluate_rotated(np.broadcast_to(r[:, None], q.shape), q)
    row, column = np.nonzero((f[:, :-1] < 0) != (f[:, 1:] < 0))
    if not len(row):
        return "no ruling between the rails lies in one tangent plane"
    before, after = f[row, column], f[row, column + 1]
    roots = q[row, column] + before / (before - after) * (q[row, column + 1] - q[row, column])
    first = int((np.abs(roots) + 0.1 * np.abs(row - _ROW_COUNT // 2) / _ROW_COUNT).argmin())
    chain = {int(row[first]): float(roots[first])}
    ends: list[_PathEnd] = []
    for step in (-1, 1):
        k, last, before_last = int(row[first]), float(roots[first]), None
        while True:
            guess = last if before_last is None else 2 * last - before_last
            candidates = roots[row == k + step]
            candidates = candidates[np.abs(candidates - last) <= 2.02 / _ROW_COUNT]
            if not len(candidates):
                break
            before_last, last, k = last, float(candidates[np.abs(candidates - guess).argmin()]), k + step
            chain[k] = last
        end = _find_exit(condition, r[k], last, step)
        if end is None:
            return _describe_turning_back(condition, float(r[k]))
        ends.append(end)
    rows = np.array(sorted(chain))
    path = condition.solve_roots(r[rows], np.array([chain[int(k)] for k in rows]))
    low, high = ends
    is_inside = (r[rows] > low.r + 1e-9) & (r[rows] < high.r - 1e-9)
    r = np.concatenate([[low.r], r[rows][is_inside], [high.r]])
    path = np.concatenate([[low.q], path[is_inside], [high.q]])
    turns_back = np.abs(np.diff(path)) > 2 * np.diff(r) * (1 + RULING_TOLERANCES.turning_back)
    if turns_back.any():
        return _describe_turning_back(condition, float(r[:-1][turns_back][0]))
    return _Path(r, path, (low, high))


def _describe_turning_back(condition: _TangentPlaneCondition, r: float) -> str:
    return f"the pairing turns back near t = {condition.start + condition.length * r:.6g}"


def _find_exit(condition: _TangentPlaneCondition, r: float, q: float, step: int) -> _PathEnd | None:
    """Find where the path near (r, q) leaves the square: on the edge x or y = 0 (step -1) or 1 (step 1)."""
    edge = 0.0 if step < 0 else 1.0
    x, y = r - q / 2, r + q / 2
    found: list[tuple[float, str, float, _PathEnd]] = []
    choices: tuple[tuple[Literal["x", "y"], float, float], ...] = (("x", x, y), ("y", y, x))
    for fixed, fixed_value, near in choices:
        samples = np.clip(near + np.linspace(-4, 4, 257) / _ROW_COUNT, 0.0, 1.0)
        f = _evaluate_on_edge(condition, fixed, edge, samples)
        for i in np.flatnonzero((f[:-1] < 0) != (f[1:] < 0)):
            free = _bisect_on_edge(condition, fixed, edge, float(samples[i]), float(samples[i + 1]))
            distance = abs(free - near) + abs(fixed_value - edge)
            found.append((distance, fixed, free, _PathEnd(fixed, edge, free)))
    near_ends = [one for one in found if one[0] <= 6 / _ROW_COUNT]
    return min(near_ends, key=lambda one: one[:3])[3] if near_ends else None


def _evaluate_on_edge(condition: _TangentPlaneCondition, fixed: str, edge: float, free: Array) -> Array:
    """Return f on an edge of the square, where x or y is 0 or 1."""
    constant = np.full(len(free), edge)
    return condition(constant, free) if fixed == "x" else condition(free, constant)


def _bisect_on_edge(condition: _TangentPlaneCondition, fixed: str, edge: float, low: float, high: float) -> float:
    """Find the sign change of f on an edge of the square."""
    for _ in range(9):  # each time the interval shrinks to a 64th
        samples = np.linspace(low, high, 65)
        f = _evaluate_on_edge(condition, fixed, edge, samples)
        i = int(((f[:-1] < 0) != (f[1:] < 0)).argmax())
        low, high = float(samples[i]), float(samples[i + 1])
    value = (low + high) / 2
    return float(np.round(value)) if abs(value - np.round(value)) < RULING_TOLERANCES.parameter_snap else value


def _compose_pairing(condition: _TangentPlaneCondition, path: _Path) -> RulingPairing:
    """Fit the path by quintic Hermite pieces, add the fans, and compose the rails with it."""
    rails, r, q = condition.rails, path.r, path.q
    crossings = _find_break_crossings(condition, path)
    count = 8
    while True:
        nodes = np.linspace(r[0], r[-1], count + 1)
        is_apart = (np.abs(nodes[1:-1, None] - crossings) > 1e-3 / count).all(axis=1)
        nodes = np.unique(np.concatenate([nodes[[0, -1]], nodes[1:-1][is_apart], crossings]))
        node_values = condition.solve_roots(nodes, np.interp(nodes, r, q))
        node_values[[0, -1]] = q[[0, -1]]
        fit = _interpolate_path(condition, nodes, node_values)
        tested = (nodes[:-1, None] + np.diff(nodes)[:, None] * np.array([0.25, 0.5, 0.75])).ravel()
        wanted = condition.solve_roots(tested, np.interp(tested, r, q))
        error = float(np.abs(fit(tested)[:, 0] - wanted).max())
        if error <= RULING_TOLERANCES.path_error or count >= _MAX_PIECES:
            break
        count *= 2
    turns_back = np.abs(fit(tested, 1)[:, 0]) > 2 * (1 + RULING_TOLERANCES.turning_back)
    if turns_back.any():
        return _refuse_pairing(_describe_turning_back(condition, float(tested[turns_back][0])))
    line = Curve.bezier([[r[0]], [r[-1]]], None, (r[0], r[-1]))
    start, length = condition.start, condition.length
    s, t = (
        (_add_fans(curve, path.ends, name) * length + start).reparametrized(*rails[0].domain)
        for curve, name in ((line - fit / 2, "x"), (line + fit / 2, "y"))
    )
    first, second = rails[0].compose(s), rails[1].compose(t)
    paired = first.cut(second.breaks), second.cut(first.breaks)
    try:
        twist = bound_twist(paired)
    except GeometryError as error:
        if error.kind != "degree":
            raise
        return _refuse_pairing(f"the degree of its rails would be {paired[0].degree}, too high to bound its twist")
    return RulingPairing(paired, (s, t), (float(r[0]), float(1 - r[-1])), twist)


def _add_fans(curve: Curve, ends: tuple[_PathEnd, _PathEnd], name: str) -> Curve:
    """Extend x(r) or y(r) to the corners of the square: in a fan it is constant, or changes twice as fast as r."""
    low, high = curve.domain
    if low > 0:
        is_fixed = ends[0].fixed == name
        curve = Curve.bezier([[0.0], [0.0 if is_fixed else 2 * low]], None, (0.0, low)).join(curve)
    if high < 1:
        is_fixed = ends[1].fixed == name
        curve = curve.join(Curve.bezier([[1.0 if is_fixed else 2 * high - 1], [1.0]], None, (high, 1.0)))
    return curve


def _interpolate_path(condition: _TangentPlaneCondition, r: Array, q: Array) -> Curve:
    """Interpolate q(r) with its first two derivatives, as limits from inside every piece."""
    jets = np.empty((3, len(r) - 1, 2, 1))
    sides: tuple[tuple[slice, BreakSide], ...] = ((slice(None, -1), "right"), (slice(1, None), "left"))
    for end, (part, side) in enumerate(sides):
        jets[:, :, end, 0] = q[part], *condition.differentiate_path(r[part], q[part], side)
    return hermite(r, jets)


def _find_break_crossings(condition: _TangentPlaneCondition, path: _Path) -> Array:
    """Return r at which the path crosses a break of a rail, where its second derivatives may jump."""
    r, q = path.r, path.q
    found = []
    for rail, sign in zip(condition.rails, (-1, 1), strict=True):
        breaks = (rail.breaks[1:-1] - condition.start) / condition.length
        on_path = r + sign * q / 2
        for x in breaks[(breaks > on_path[0]) & (breaks < on_path[-1])]:
            at = float(np.interp(x, on_path, r))
            for _ in range(60):  # r + sign q(r) / 2 = x
                root = float(condition.solve_roots(np.array([at]), np.array([np.interp(at, r, q)]))[0])
                new = x - sign * root / 2
                if abs(new - at) <= 1e-15:
                    break
                at = new
            found.append(at)
    return np.array(found)
