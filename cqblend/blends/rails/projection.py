"""Curves of space projected onto a surface: the curve of nearest points, in the parameter plane.

The foot points of all stations are found at once by a damped Newton iteration; a C2 cubic through them is refined until
it stays with them. This is how a rail is made of an edge or curve that has none in the surface's parameters. The result
is approximate, and a rail all the same: whatever runs in the parameter plane lies on the surface exactly. Knows splines
only.
"""

from __future__ import annotations

import numpy as np

from cqblend.errors import GeometryError, InputError
from cqblend.splines import Curve, Surface, interpolate
from cqblend.splines.bernstein import Array

_GUIDE_STATIONS = 129  # stations that the others start from
_SEEDS_PER_PATCH = (
    3  # grid points per patch and direction, at most _GRID in a direction, among which the nearest are looked for
)
_MOST_GRID_LINES = 96
_NEWTON_STEPS = 60
_CONVERGED_STEP = 1e-12  # relative to the domain: Newton's next step would be its square
_DAMPING_STEPS = 12
_DOMAIN_MARGIN = 0.125  # how far beyond the domain iterations may go, relative to its width
_JUMP_SHARE = (
    0.25  # step of the foot point between neighbouring stations, relative to the domain, that needs an explanation
)
_REFINEMENTS = 17  # from a quarter of the domain to 2e-6: what is sharper than that is a kink
_MOST_STATIONS = 4000
_TEST_SHARES = (np.arange(1, 4) / 4)[:, None]


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
    >>> projected(plane, Curve.bezier([[1.0, 1.0, 5.0], [3.0, 1.5, 7.0]]))([0.0, 0.5, 1.0]).round(9)
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
    for _ in range(_REFINEMENTS):
        found, error, between = feet.interpolate_feet(t, feet(t))
        if error.max() <= tolerance:
            crossing, error, _ = feet.interpolate_feet(*_snap_to_crossings(surface, found, t, feet(t)))
            return (crossing if error.max() <= tolerance else found).reduce()
        if len(t) > _MOST_STATIONS:
            break
        # with a margin, since refining a span moves the spline in its neighbours
        t = np.sort(np.concatenate([t, between[1][error > tolerance / 2]]))
    raise GeometryError(
        f"the projection onto the surface misses its foot points by {error.max():.3g} still, with {len(found.breaks)} "
        f"stations, at t = {found.breaks[error.argmax()]:.9g}, where they have a kink: the curve has one, or is "
        f"off the surface where that is only C1; split the curve there, or allow more than {tolerance:g}"
    )


def _snap_to_crossings(surface: Surface, found: Curve, t: Array, values: Array) -> tuple[Array, Array]:
    """Let stations be where the curve crosses knot lines, instead of next to there.

    Its composition with the surface has a break at every crossing: two breaks nearly at one place would leave a piece
    between them whose derivatives are rounding.
    """
    for axis in (0, 1):
        lines = surface.breaks[axis]
        for at in surface.crossings(found, axis).tolist():
            foot = found(at)
            foot[axis] = lines[np.abs(lines - foot[axis]).argmin()]
            i = int(np.abs(t - at).argmin())
            if 0 < i < len(t) - 1 and abs(t[i] - at) < np.diff(t)[i - 1 : i + 1].min() / 3:
                t, values = np.delete(t, i), np.delete(values, i, axis=0)
            i = int(np.searchsorted(t, at))
            if 0 < i < len(t) and min(at - t[i - 1], t[i] - at) > 1e-9 * (t[-1] - t[0]):
                t, values = np.insert(t, i, at), np.insert(values, i, foot, axis=0)
    return t, values


class _FootPoints:
    """The foot points (u, v)(t) of a curve, continuous along it."""

    def __init__(self, surface: Surface, curve: Curve, tolerance: float) -> None:
        self._surface, self._curve, self._tolerance = surface, curve, tolerance
        self._low, self._high = (np.array(bound) for bound in np.transpose(surface.domain))
        self._t = np.union1d(np.linspace(*curve.domain, _GUIDE_STATIONS), curve.breaks)
        points = curve(self._t)
        self._uv = self._connect_feet(points, self._find_nearest(points))
        self._check_feet(self._t, points, self._uv)
        ends = curve.jet(curve.domain, 1)
        same = np.abs(ends[:, 1] - ends[:, 0]).max(axis=-1) <= 1e-9 * np.abs(ends).max(axis=(1, 2))
        apart = np.abs(self._uv[-1] - self._uv[0]) / (self._high - self._low)
        self.closed = bool(same.all() and apart.max() <= 1e-9)

    def __call__(self, t: Array) -> Array:
        """Return the foot points' parameters (n, 2)."""
        points = self._curve(t)
        start = np.stack([np.interp(t, self._t, column) for column in self._uv.T], axis=-1)
        return self._check_feet(t, points, self._solve_feet(points, start))

    def interpolate_feet(self, t: Array, values: Array) -> tuple[Curve, Array, Array]:
        """Interpolate foot points; also return the largest error in each span, and where it was looked for, (3, n)."""
        if self.closed:
            values[-1] = values[0]
        found = interpolate(t, values, periodic=self.closed)
        between = t[:-1] + _TEST_SHARES * np.diff(t)
        return found, self.measure_error(found, between.ravel()).reshape(between.shape).max(axis=0), between

    def measure_error(self, c: Curve, t: Array) -> Array:
        """Return how far S(c(t)) is from the foot points, (n,)."""
        found, foot = (self._surface(uv[:, 0], uv[:, 1]) for uv in (c(t), self(t)))
        return np.asarray(np.linalg.norm(found - foot, axis=-1))

    def _find_nearest(self, points: Array) -> Array:
        """Return the nearest of the points that two starts lead to: the nearest of a grid, and the nearest far from it.

        At a seam those are its two sides, and only one may lead to a foot inside the domain.
        """
        inner = (np.arange(_SEEDS_PER_PATCH) + 0.5) / _SEEDS_PER_PATCH  # off the borders, which may be poles
        lines = [(b[:-1, None] + np.diff(b)[:, None] * inner).ravel() for b in self._surface.breaks]
        u, v = (x[np.linspace(0, len(x) - 1, min(len(x), _MOST_GRID_LINES)).round().astype(int)] for x in lines)
        nodes = self._surface.grid(u, v).reshape(-1, 3)
        uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        centre = nodes.mean(axis=0)
        squares = ((nodes - centre) ** 2).sum(axis=1) - 2 * (points - centre) @ (nodes - centre).T
        first = uv[squares.argmin(axis=1)]
        far = (np.abs(uv - first[:, None]) > _JUMP_SHARE * (self._high - self._low)).any(axis=-1)
        second = uv[np.where(far, squares, np.inf).argmin(axis=1)]
        first, second = self._solve_feet(points, first), self._solve_feet(points, second)
        better = self._measure_distances(points, second) < self._measure_distances(points, first) - self._tolerance
        return np.where(better[:, None], second, first)

    def _solve_feet(self, points: Array, uv: Array) -> Array:
        """Minimise the distances by Newton's method, halving steps that do not, all points at once.

        Iterations may leave the domain by a little; what comes back is inside.
        """
        width = self._high - self._low
        low, high = self._low - _DOMAIN_MARGIN * width, self._high + _DOMAIN_MARGIN * width
        uv = np.clip(uv, low, high)
        for _ in range(_NEWTON_STEPS):
            step = np.clip(self._compute_newton_step(points, uv), -_JUMP_SHARE * width, _JUMP_SHARE * width)
            before, scale = self._measure_distances(points, uv), np.ones((len(uv), 1))
            for _ in range(_DAMPING_STEPS):
                after = np.clip(uv + scale * step, low, high)
                worse = self._measure_distances(points, after) > before * (1 + 1e-12) + 1e-15 * np.abs(points).max()
                if not worse.any():
                    break
                scale[worse] /= 2
            moved = np.abs(after - uv) / width
            uv = after
            if moved.max() <= _CONVERGED_STEP:
                break
        return np.clip(uv, self._low, self._high)

    def _measure_distances(self, points: Array, uv: Array) -> Array:
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
        """Where neighbours are far apart, as on both sides of a seam, start anew from the one before, or after."""
        width = self._high - self._low
        for order in (range(1, len(uv)), range(len(uv) - 2, -1, -1)):
            for i in order:
                beside, here = uv[i - order.step], slice(i, i + 1)
                if (np.abs(uv[i] - beside) > _JUMP_SHARE * width).any():
                    again = self._solve_feet(points[here], beside[None])
                    if (
                        self._measure_distances(points[here], again)
                        <= self._measure_distances(points[here], uv[here]) + self._tolerance
                    ):
                        uv[i] = again[0]
        jump = (np.abs(np.diff(uv, axis=0)) > _JUMP_SHARE * width).any(axis=1)
        if jump.any():
            i = int(jump.argmax())
            raise GeometryError(
                f"the foot points on the surface jump, from {uv[i]} at t = {self._t[i]:.9g} to {uv[i + 1]} at t = "
                f"{self._t[i + 1]:.9g}: the curve crosses a seam, or has two nearest points there; split it"
            )
        return uv

    def _check_feet(self, t: Array, points: Array, uv: Array) -> Array:
        """Return the parameters, all of which must be of foot points: no step along the surface leads nearer."""
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
