r"""Rulings paired anew along two rails, so that the strip between them is developable.

A ruling from C1(s) to C2(t) lies in one tangent plane if

.. math:: f(s, t) = \det(C_1'(s),\; C_2'(t),\; C_2(t) - C_1(s)) = 0

Points (s, t) with f = 0 that increase in both parameters pair the rails of a developable strip. Such a path seldom
runs from corner to corner: it begins somewhere on an edge of the square of parameters, s = s0 or t = t0. From the
corner to there one rail stands still, and its point is the apex of a fan, a piece of a cone, that joins the rest
smoothly, because its last ruling is one of the path's; likewise at the other end. Both rails stay the curves they are,
at another speed. Must not know which surface the strip stands for: whether it still is close enough is for the caller
to measure.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from cqblend.errors import InputError
from cqblend.patterns.strips.developability import RailPair, bound_rail_twist, check_rails, classify_strip
from cqblend.splines import Curve, hermite
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide

_ROW_COUNT = 64
_COLUMN_COUNT = 129
_PATH_TOLERANCE = 1e-11
_SNAP_DISTANCE = 1e-12
_MAX_PIECES = 256


@dataclass(frozen=True, slots=True, eq=False)
class RulingPairing:
    """How two rails are paired, or why they cannot be.

    Attributes
    ----------
    rails
        C1(s(r)) and C2(t(r)) over one domain, with the same breaks; None if there is no pairing.
    parameters
        s(r) and t(r), which never decrease; None likewise.
    fans
        Which parts of the domain, at its start and at its end, are fans about a point of one rail.
    twist
        Bound of the twist that is left, see :func:`cqblend.patterns.strips.developability.bound_twist`; nan without
        rails.
    deviation
        What the caller's function found for the new rails; nan where there was none to ask.
    reason
        Why there is no pairing; empty if there is.
    """

    rails: RailPair | None
    parameters: tuple[Curve, Curve] | None
    fans: tuple[float, float] = (0.0, 0.0)
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
        What the deviation may be.
    deviation
        Measures how far the strip between new rails is from what it stands for.

    Returns
    -------
    Pairing
        Without rails, and with a reason, if f = 0 has no path through the strip that increases in both parameters, or
        the deviation exceeds the tolerance.

    Raises
    ------
    InputError
        If these are no rails, or the tolerance is not positive.
    GeometryError
        If there is no surface between them.

    Examples
    --------
    >>> lower = Curve.bezier([[0.0, 0, 0], [1, 0, 1], [2, 0, 0]])
    >>> upper = Curve.bezier([[0.2, 1, 0], [1, 1, 0.9], [2, 1, 0.1]])
    >>> pairing = pair((lower, upper))
    >>> twist_between((lower, upper)) > 0.1, pairing.twist < 1e-9
    (True, True)
    """
    rails = check_rails(rails)
    if not tolerance > 0:
        raise InputError(f"tolerance {tolerance}: it must be positive")
    if classify_strip(rails) != "twisted":
        start, end = rails[0].domain
        same = Curve.bezier([[start], [end]], None, (start, end))
        return _check_deviation(RulingPairing(rails, (same, same), twist=bound_rail_twist(rails)), tolerance, deviation)
    corner = _find_corner(rails)
    if corner is not None:
        return _refuse_pairing(f"a rail has a corner at t = {corner:.6g}")
    condition = _TangentPlaneCondition(rails)
    path = _trace_path(condition)
    if isinstance(path, str):
        return _refuse_pairing(path)
    r, q, ends = path
    return _check_deviation(_compose_pairing(rails, condition, r, q, ends), tolerance, deviation)


def _refuse_pairing(reason: str) -> RulingPairing:
    return RulingPairing(None, None, reason=reason)


def _check_deviation(
    pairing: RulingPairing, tolerance: float, deviation: Callable[[RailPair], float] | None
) -> RulingPairing:
    """Ask the caller whether the strip is close enough."""
    if deviation is None or pairing.rails is None:
        return pairing
    found = float(deviation(pairing.rails))
    if not found <= tolerance:
        return RulingPairing(
            None, None, deviation=found, reason=f"the strip would deviate by {found:.3g}, more than {tolerance:.3g}"
        )
    return RulingPairing(pairing.rails, pairing.parameters, pairing.fans, pairing.twist, found)


def _find_corner(rails: RailPair) -> float | None:
    """Return a break at which a rail changes its direction."""
    for rail in rails:
        inner = rail.breaks[1:-1]
        before, after = (rail(inner, 1, side=side) for side in ("left", "right"))
        size = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
        turned = np.linalg.norm(np.cross(before, after), axis=1) > 1e-9 * size
        if turned.any():
            return float(inner[turned][0])
    return None


class _TangentPlaneCondition:
    """f and its derivatives, in parameters x, y from 0 to 1 of the two rails."""

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
        """Return q' and q'' along a path f = 0, next to it on a side."""
        x, y = (self._snap_to_breaks(rail, at) for rail, at in zip(self.rails, (r - q / 2, r + q / 2), strict=True))
        _, fx, fy, fxx, fxy, fyy = self.jet(x, y, 3, side)
        fq = (fy - fx) / 2
        first = -(fx + fy) / fq
        second = -(fxx + 2 * fxy + fyy + (fyy - fxx) * first + (fxx - 2 * fxy + fyy) / 4 * first**2) / fq
        return first, second

    def _snap_to_breaks(self, rail: Curve, x: Array) -> Array:
        """Move parameters that are breaks but for rounding to those."""
        breaks = (rail.breaks - self.start) / self.length
        nearest = breaks[np.abs(x[:, None] - breaks).argmin(axis=1)]
        return np.where(np.abs(nearest - x) < _SNAP_DISTANCE, nearest, x)

    def solve_roots(self, r: Array, q: Array) -> Array:
        """Return the roots q at r next to given ones, by Newton's method."""
        for _ in range(30):
            f, fx, fy = self.jet(r - q / 2, r + q / 2, 2)
            slope = (fy - fx) / 2
            step = np.divide(f, slope, out=np.zeros_like(f), where=slope != 0)
            q = q - step
            if (np.abs(step) <= 1e-15).all():
                break
        return q


def _triple_product(a: Array, b: Array, c: Array) -> Array:
    return np.asarray((np.cross(a, b) * c).sum(axis=-1))


PathEnd = tuple[Literal["x", "y"], float]
"""The parameter that stands still in a fan, and where the other one is when the fan meets the path."""


def _trace_path(condition: _TangentPlaneCondition) -> tuple[Array, Array, tuple[PathEnd, PathEnd]] | str:
    """Trace f = 0 in (r, q) = ((x + y) / 2, y - x), from edge to edge of the square; or say why that fails."""
    r = np.arange(1, _ROW_COUNT) / _ROW_COUNT
    reach = 2 * np.minimum(r, 1 - r)
    q = reach[:, None] * np.linspace(-1, 1, _COLUMN_COUNT)
    f = condition.evaluate_rotated(np.broadcast_to(r[:, None], q.shape), q)
    row, column = np.nonzero((f[:, :-1] < 0) != (f[:, 1:] < 0))
    if not len(row):
        return "no ruling between the rails lies in one tangent plane"
    before, after = f[row, column], f[row, column + 1]
    roots = q[row, column] + before / (before - after) * (q[row, column + 1] - q[row, column])
    first = int((np.abs(roots) + 0.1 * np.abs(row - _ROW_COUNT // 2) / _ROW_COUNT).argmin())
    chain = {int(row[first]): float(roots[first])}
    ends: list[PathEnd] = []
    for way in (-1, 1):
        k, last, before_last = int(row[first]), float(roots[first]), None
        while True:
            guess = last if before_last is None else 2 * last - before_last
            here = roots[row == k + way]
            allowed = here[np.abs(here - last) <= 2.02 / _ROW_COUNT]
            if not len(allowed):
                break
            before_last, last, k = last, float(allowed[np.abs(allowed - guess).argmin()]), k + way
            chain[k] = last
        end = _find_exit(condition, r[k], last, way)
        if end is None:
            return f"the pairing turns back near t = {condition.start + condition.length * float(r[k]):.6g}"
        ends.append(end)
    rows = np.array(sorted(chain))
    path = condition.solve_roots(r[rows], np.array([chain[int(k)] for k in rows]))
    (low, q_low), (high, q_high) = (_locate_path_end(end, way) for end, way in zip(ends, (-1, 1), strict=True))
    inside = (r[rows] > low + 1e-9) & (r[rows] < high - 1e-9)
    r = np.concatenate([[low], r[rows][inside], [high]])
    path = np.concatenate([[q_low], path[inside], [q_high]])
    back = np.abs(np.diff(path)) > 2 * np.diff(r) * (1 + 1e-9)
    if back.any():
        at = condition.start + condition.length * float(r[:-1][back][0])
        return f"the pairing turns back near t = {at:.6g}"
    return r, path, (ends[0], ends[1])


def _find_exit(condition: _TangentPlaneCondition, r: float, q: float, way: int) -> PathEnd | None:
    """Find where the path next to (r, q) leaves the square: on the edge x or y = 0 (way -1) or 1 (way 1)."""
    edge = 0.0 if way < 0 else 1.0
    x, y = r - q / 2, r + q / 2
    found: list[tuple[float, PathEnd]] = []
    choices: tuple[tuple[Literal["x", "y"], float, float], ...] = (("x", x, y), ("y", y, x))
    for still, there, near in choices:
        span = np.clip(near + np.linspace(-4, 4, 257) / _ROW_COUNT, 0.0, 1.0)
        f = _evaluate_on_edge(condition, still, edge, span)
        for i in np.flatnonzero((f[:-1] < 0) != (f[1:] < 0)):
            value = _bisect_on_edge(condition, still, edge, float(span[i]), float(span[i + 1]))
            found.append((abs(value - near) + abs(there - edge), (still, value)))
    allowed = [end for end in found if end[0] <= 6 / _ROW_COUNT]
    return min(allowed)[1] if allowed else None


def _evaluate_on_edge(condition: _TangentPlaneCondition, still: str, edge: float, span: Array) -> Array:
    """Return f on an edge of the square, where x or y is 0 or 1."""
    fixed = np.full(len(span), edge)
    return condition(fixed, span) if still == "x" else condition(span, fixed)


def _bisect_on_edge(condition: _TangentPlaneCondition, still: str, edge: float, low: float, high: float) -> float:
    """Find the sign change of f on an edge of the square."""
    for _ in range(9):  # each time the interval shrinks to a 64th
        span = np.linspace(low, high, 65)
        f = _evaluate_on_edge(condition, still, edge, span)
        i = int(((f[:-1] < 0) != (f[1:] < 0)).argmax())
        low, high = float(span[i]), float(span[i + 1])
    value = (low + high) / 2
    return float(np.round(value)) if abs(value - np.round(value)) < _SNAP_DISTANCE else value


def _locate_path_end(end: PathEnd, way: int) -> tuple[float, float]:
    """Return (r, q) of the point at which a path meets an edge."""
    still, value = end
    edge = 0.0 if way < 0 else 1.0
    x, y = (edge, value) if still == "x" else (value, edge)
    return (x + y) / 2, y - x


def _compose_pairing(
    rails: RailPair, condition: _TangentPlaneCondition, r: Array, q: Array, ends: tuple[PathEnd, PathEnd]
) -> RulingPairing:
    """Fit the path by quintic Hermite pieces, add the fans, and compose."""
    kinks = _find_break_crossings(rails, condition, r, q)
    count = 8
    while True:
        nodes = np.linspace(r[0], r[-1], count + 1)
        apart = (np.abs(nodes[1:-1, None] - kinks) > 1e-3 / count).all(axis=1)
        nodes = np.unique(np.concatenate([nodes[[0, -1]], nodes[1:-1][apart], kinks]))
        middle = condition.solve_roots(nodes, np.interp(nodes, r, q))
        middle[[0, -1]] = q[[0, -1]]
        fit = _interpolate_path(condition, nodes, middle)
        test = (nodes[:-1, None] + np.diff(nodes)[:, None] * np.array([0.25, 0.5, 0.75])).ravel()
        wanted = condition.solve_roots(test, np.interp(test, r, q))
        off = float(np.abs(fit(test)[:, 0] - wanted).max())
        if off <= _PATH_TOLERANCE or count >= _MAX_PIECES:
            break
        count *= 2
    turned = np.abs(fit(test, 1)[:, 0]) > 2 * (1 + 1e-9)
    if turned.any():
        at = condition.start + condition.length * float(test[turned][0])
        return _refuse_pairing(f"the pairing turns back near t = {at:.6g}")
    line = Curve.bezier([[r[0]], [r[-1]]], None, (r[0], r[-1]))
    both = [line - fit / 2, line + fit / 2]
    start, length = condition.start, condition.length
    s, t = (
        (_add_fans(curve, ends, name) * length + start).reparametrized(*rails[0].domain)
        for curve, name in zip(both, "xy", strict=True)
    )
    first, second = rails[0].compose(s), rails[1].compose(t)
    first, second = first.cut(second.breaks), second.cut(first.breaks)
    paired = first, second
    fans = float(r[0]), float(1 - r[-1])
    return RulingPairing(paired, (s, t), fans, bound_rail_twist(paired))


def _add_fans(curve: Curve, ends: tuple[PathEnd, PathEnd], name: str) -> Curve:
    """Extend x(r) or y(r) to the corners of the square: in a fan it stands still, or does all of the change."""
    low, high = curve.domain
    if low > 0:
        still = ends[0][0] == name
        curve = Curve.bezier([[0.0], [0.0 if still else 2 * low]], None, (0.0, low)).join(curve)
    if high < 1:
        still = ends[1][0] == name
        curve = curve.join(Curve.bezier([[1.0 if still else 2 * high - 1], [1.0]], None, (high, 1.0)))
    return curve


def _interpolate_path(condition: _TangentPlaneCondition, r: Array, q: Array) -> Curve:
    """Interpolate q(r) with two derivatives, those on the inner side of every piece."""
    jets = np.empty((3, len(r) - 1, 2, 1))
    sides: tuple[tuple[slice, BreakSide], ...] = ((slice(None, -1), "right"), (slice(1, None), "left"))
    for end, (part, side) in enumerate(sides):
        jets[:, :, end, 0] = q[part], *condition.differentiate_path(r[part], q[part], side)
    return hermite(r, jets)


def _find_break_crossings(rails: RailPair, condition: _TangentPlaneCondition, r: Array, q: Array) -> Array:
    """Return r at which the path crosses a break of a rail, where its second derivatives may jump."""
    found = []
    for rail, sign in zip(rails, (-1, 1), strict=True):
        place = (rail.breaks[1:-1] - condition.start) / condition.length
        on_path = r + sign * q / 2
        for x in place[(place > on_path[0]) & (place < on_path[-1])]:
            at = float(np.interp(x, on_path, r))
            for _ in range(60):  # r + sign q(r) / 2 = x
                root = float(condition.solve_roots(np.array([at]), np.array([np.interp(at, r, q)]))[0])
                new = x - sign * root / 2
                if abs(new - at) <= 1e-15:
                    break
                at = new
            found.append(at)
    return np.array(found)
