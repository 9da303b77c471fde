"""Projects space curves onto a surface: the curve of nearest points, as a curve in the parameter plane.

Edges and curves that have no curve in the parameters of the surface become rails that way. The foot points of all
stations are found at once by a damped Newton method; a C2 cubic through them is refined until it is within a tolerance
of them. The result is approximate in the parameter plane, but whatever runs there lies on the surface exactly. Depends
on splines only.
"""

from __future__ import annotations

import numpy as np

from cqblend.blends.rails.tolerances import PROJECTION_TOLERANCES
from cqblend.errors import GeometryError, InputError
from cqblend.splines import Curve, Surface, interpolate
from cqblend.splines.bernstein import Array

TEST_POINTS_OF_SPAN = (np.arange(1, 4) / 4)[:, None]


def project_curve(surface: Surface, curve: Curve, tolerance: float = 1e-7) -> Curve:
    """Return the projection of a curve onto a surface, as a C2 cubic in the parameter plane.

    Parameters
    ----------
    surface
        S(u, v) of dim 3.
    curve
        X(t) of dim 3, without kinks, and on the surface where that is only C1: the foot points of a curve beside it
        have a kink there. Where X has several nearest points, the projection stays on the sheet it is on.
    tolerance
        Largest distance (in the surface's unit) between S(c(t)) and the foot point of X(t), the nearest point of S.

    Returns
    -------
    Curve
        c(t) of dim 2, over the domain of ``curve``; periodic if that closes smoothly in the parameter plane.

    Raises
    ------
    InputError
        If dims are not 3, or the tolerance is not positive.
    GeometryError
        If a point has no foot inside the surface's domain, foot points jump, or the tolerance cannot be reached. The
        message names t.

    Examples
    --------
    >>> corners = [[[0, 0, 0], [0, 2, 0]], [[4, 0, 0], [4, 2, 0]]]
    >>> plane = Surface.from_bspline((1, 1), ([0, 0, 4, 4], [0, 0, 2, 2]), corners)
    >>> project_curve(plane, Curve.bezier([[1.0, 1.0, 5.0], [3.0, 1.5, 7.0]]))([0.0, 0.5, 1.0]).round(9)
    array([[1.  , 1.  ],
           [2.  , 1.25],
           [3.  , 1.5 ]])
    """
    if surface.dim != 3 or curve.dim != 3:
        raise InputError(f"projection takes a surface and a curve of dim 3, not of dim {surface.dim} and {curve.dim}")
    if not tolerance > 0:
        raise InputError(f"the tolerance of a projection is a positive length, not {tolerance!r}")
    feet = _FootPoints(surface, curve, tolerance)
    t = np.union1d(np.linspace(*curve.domain, 5), curve.breaks)
    for _ in range(PROJECTION_TOLERANCES.refinements):
        fitted, error, between = feet.interpolate_feet(t, feet(t))
        if error.max() <= tolerance:
            snapped, error, _ = feet.interpolate_feet(*_snap_to_crossings(surface, fitted, t, feet(t)))
            return (snapped if error.max() <= tolerance else fitted).reduce()
        if len(t) > PROJECTION_TOLERANCES.most_stations:
            break
        # with a margin, since refining a span moves the spline in its neighbours
        t = np.sort(np.concatenate([t, between[1][error > tolerance / 2]]))
    raise GeometryError(
        f"the projection onto the surface misses its foot points by {error.max():.3g} still, with {len(fitted.breaks)} "
        f"stations, at t = {fitted.breaks[error.argmax()]:.9g}, where they have a kink: the curve has one, or is "
        f"off the surface where that is only C1; split the curve there, or allow more than {tolerance:g}"
    )


def _snap_to_crossings(surface: Surface, curve: Curve, t: Array, values: Array) -> tuple[Array, Array]:
    """Return stations and foot points, with stations where a curve through these crosses knot lines, not next to there.

    Its composition with the surface has a break at every crossing: two breaks nearly at one place would leave a piece
    between them whose derivatives are rounding.
    """
    for axis in (0, 1):
        lines = surface.breaks[axis]
        for at in surface.crossings(curve, axis).tolist():
            foot = curve(at)
            foot[axis] = lines[np.abs(lines - foot[axis]).argmin()]
            i = int(np.abs(t - at).argmin())
            if 0 < i < len(t) - 1 and abs(t[i] - at) < np.diff(t)[i - 1 : i + 1].min() / 3:
                t, values = np.delete(t, i), np.delete(values, i, axis=0)
            i = int(np.searchsorted(t, at))
            if 0 < i < len(t) and min(at - t[i - 1], t[i] - at) > PROJECTION_TOLERANCES.least_station_gap * (
                t[-1] - t[0]
            ):
                t, values = np.insert(t, i, at), np.insert(values, i, foot, axis=0)
    return t, values


class _FootPoints:
    """The foot points (u, v)(t) of a curve, continuous along it."""

    def __init__(self, surface: Surface, curve: Curve, tolerance: float) -> None:
        self._surface, self._curve, self._tolerance = surface, curve, tolerance
        self._low, self._high = (np.array(bound) for bound in np.transpose(surface.domain))
        self._t = np.union1d(np.linspace(*curve.domain, PROJECTION_TOLERANCES.guide_stations), curve.breaks)
        points = curve(self._t)
        self._uv = self._connect_feet(points, self._find_nearest(points))
        self._check_feet(self._t, points, self._uv)
        ends = curve.jet(curve.domain, 1)
        same = np.abs(ends[:, 1] - ends[:, 0]).max(axis=-1) <= PROJECTION_TOLERANCES.closing_share * np.abs(ends).max(
            axis=(1, 2)
        )
        apart = np.abs(self._uv[-1] - self._uv[0]) / (self._high - self._low)
        self.closed = bool(same.all() and apart.max() <= PROJECTION_TOLERANCES.closing_share)

    def __call__(self, t: Array) -> Array:
        """Return the foot points' parameters (n, 2)."""
        points = self._curve(t)
        start = np.stack([np.interp(t, self._t, column) for column in self._uv.T], axis=-1)
        return self._check_feet(t, points, self._solve_feet(points, start))

    def interpolate_feet(self, t: Array, values: Array) -> tuple[Curve, Array, Array]:
        """Interpolate foot points; also return the largest error in each span, and where it was looked for, (3, n)."""
        if self.closed:
            values[-1] = values[0]
        curve = interpolate(t, values, periodic=self.closed)
        between = t[:-1] + TEST_POINTS_OF_SPAN * np.diff(t)
        return curve, self.measure_error(curve, between.ravel()).reshape(between.shape).max(axis=0), between

    def measure_error(self, c: Curve, t: Array) -> Array:
        """Return how far S(c(t)) is from the foot points, (n,)."""
        on_curve, foot = (self._surface(uv[:, 0], uv[:, 1]) for uv in (c(t), self(t)))
        return np.asarray(np.linalg.norm(on_curve - foot, axis=-1))

    def _find_nearest(self, points: Array) -> Array:
        """Return the foot points (n, 2) of points: for each the nearer of the results of iterations from two starts.

        One start is the nearest point of a grid, the other the nearest of those far from it in the parameter plane. At
        a seam these are its two sides, and only one may lead to a foot inside the domain.
        """
        inner = (
            np.arange(PROJECTION_TOLERANCES.seeds_per_patch) + 0.5
        ) / PROJECTION_TOLERANCES.seeds_per_patch  # off the borders, which may be poles
        lines = [(b[:-1, None] + np.diff(b)[:, None] * inner).ravel() for b in self._surface.breaks]
        u, v = (
            x[np.linspace(0, len(x) - 1, min(len(x), PROJECTION_TOLERANCES.most_grid_lines)).round().astype(int)]
            for x in lines
        )
        nodes = self._surface.grid(u, v).reshape(-1, 3)
        uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        centre = nodes.mean(axis=0)
        squares = ((nodes - centre) ** 2).sum(axis=1) - 2 * (points - centre) @ (nodes - centre).T
        first = uv[squares.argmin(axis=1)]
        far = (np.abs(uv - first[:, None]) > PROJECTION_TOLERANCES.jump_share * (self._high - self._low)).any(axis=-1)
        second = uv[np.where(far, squares, np.inf).argmin(axis=1)]
        first, second = self._solve_feet(points, first), self._solve_feet(points, second)
        better = self._measure_distances(points, second) < self._measure_distances(points, first) - self._tolerance
        return np.where(better[:, None], second, first)

    def _solve_feet(self, points: Array, uv: Array) -> Array:
        """Minimise the distances by Newton's method, halving steps that increase them, all points at once.

        Iterations may leave the domain by a little; the results are clipped to it.
        """
        width = self._high - self._low
        low, high = (
            self._low - PROJECTION_TOLERANCES.domain_margin * width,
            self._high + PROJECTION_TOLERANCES.domain_margin * width,
        )
        uv = np.clip(uv, low, high)
        for _ in range(PROJECTION_TOLERANCES.foot_newton_steps):
            step = np.clip(
                self._compute_newton_step(points, uv),
                -PROJECTION_TOLERANCES.jump_share * width,
                PROJECTION_TOLERANCES.jump_share * width,
            )
            before, scale = self._measure_distances(points, uv), np.ones((len(uv), 1))
            for _ in range(PROJECTION_TOLERANCES.damping_steps):
                after = np.clip(uv + scale * step, low, high)
                worse = self._measure_distances(points, after) > before * (1 + 1e-12) + 1e-15 * np.abs(points).max()
                if not worse.any():
                    break
                scale[worse] /= 2
            moved = np.abs(after - uv) / width
            uv = after
            if moved.max() <= PROJECTION_TOLERANCES.converged_step:
                break
        return np.clip(uv, self._low, self._high)

    def _measure_distances(self, points: Array, uv: Array) -> Array:
        """Return the distances (n,) between points and S(u, v)."""
        return np.asarray(np.linalg.norm(self._surface(uv[:, 0], uv[:, 1]) - points, axis=-1))

    def _compute_newton_step(self, points: Array, uv: Array) -> Array:
        """Return Newton's step (n, 2) for (S - X).Su = (S - X).Sv = 0; Gauss's where that is no minimum."""
        jet = self._surface.jet(uv[:, 0], uv[:, 1], 2)
        su, sv, away = jet[1, 0], jet[0, 1], jet[0, 0] - points
        a, b, c = ((x * y).sum(axis=-1) for x, y in ((su, su), (su, sv), (sv, sv)))
        p, q, r = ((away * x).sum(axis=-1) for x in (jet[2, 0], jet[1, 1], jet[0, 2]))
        bowl = ((a + p) * (c + r) - (b + q) ** 2 > 1e-3 * (a * c - b * b)) & (a + p > 0)
        a, b, c = (x + np.where(bowl, y, 0) for x, y in ((a, p), (b, q), (c, r)))
        f, g = (away * su).sum(axis=-1), (away * sv).sum(axis=-1)
        det = a * c - b * b
        regular = det > 1e-14 * a * c
        det, a, c = np.where(regular, det, 1), np.where(a > 0, a, np.inf), np.where(c > 0, c, np.inf)
        single = np.stack([-f / a, -g / c], axis=-1)  # at a pole, where one of the partials vanishes
        return np.where(regular[:, None], np.stack([b * g - c * f, b * f - a * g], axis=-1) / det[:, None], single)

    def _connect_feet(self, points: Array, uv: Array) -> Array:
        """Return foot points with jumps removed, if an iteration from a neighbour leads to a foot that is as near.

        Jumps are those between the two sides of a seam, mostly.
        """
        width = self._high - self._low
        for order in (range(1, len(uv)), range(len(uv) - 2, -1, -1)):
            for i in order:
                neighbour, here = uv[i - order.step], slice(i, i + 1)
                if (np.abs(uv[i] - neighbour) > PROJECTION_TOLERANCES.jump_share * width).any():
                    again = self._solve_feet(points[here], neighbour[None])
                    if (
                        self._measure_distances(points[here], again)
                        <= self._measure_distances(points[here], uv[here]) + self._tolerance
                    ):
                        uv[i] = again[0]
        jump = (np.abs(np.diff(uv, axis=0)) > PROJECTION_TOLERANCES.jump_share * width).any(axis=1)
        if jump.any():
            i = int(jump.argmax())
            raise GeometryError(
                f"the foot points on the surface jump, from {uv[i]} at t = {self._t[i]:.9g} to {uv[i + 1]} at t = "
                f"{self._t[i + 1]:.9g}: the curve crosses a seam, or has two nearest points there; split it"
            )
        return uv

    def _check_feet(self, t: Array, points: Array, uv: Array) -> Array:
        """Return the parameters, after a check that all are of foot points: no step along the surface leads nearer."""
        jet, step = self._surface.jet(uv[:, 0], uv[:, 1], 1), self._compute_newton_step(points, uv)
        outside = np.linalg.norm(step[:, :1] * jet[1, 0] + step[:, 1:] * jet[0, 1], axis=-1) > self._tolerance
        if outside.any():
            i = int(outside.argmax())
            x, y, z = points[i]
            raise GeometryError(
                f"the point of the curve at t = {t[i]:.9g}, ({x:.9g}, {y:.9g}, {z:.9g}), has no foot on the surface "
                f"inside its domain; clip the curve, or extend the surface"
            )
        return uv
