r"""Normal curvature in the ruled direction, which makes strips narrow, and its ridges, along which strips may end.

.. math:: \kappa_n^v = \frac{\langle n, S_{vv} \rangle}{\|S_v\|^2}, \quad n = \frac{S_u \times S_v}{\|S_u \times S_v\|}

The root in n is no spline, so kappa^2 is formed, which has the same maxima as \|kappa\|. In homogeneous coordinates
P = (x, W), with a = x_v W - x W_v and N = W x_u x x_v + W_u x_v x x + W_v x x x_u (so that S_v = a / W^2 and
S_u x S_v = N / W^3),

.. math:: (\kappa_n^v)^2 = \frac{\det(P, P_u, P_v, P_{vv})^2\, W^6}{\|N\|^2\, \|a\|^4}

Depends on splines only.

References
----------
G. Elber: Model fabrication using surface layout projection (1995), equations (5) to (7) and figure 5.
"""

import numpy as np

from cqblend.errors import GeometryError
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide

_SIDES: tuple[BreakSide, BreakSide] = ("left", "right")


def squared_curvature(surface: Surface) -> Surface:
    r"""Return (kappa_n^v)^2 as a rational scalar surface, in 1/mm^2.

    Its degrees are (14 p - 2, 14 q - 4) for a rational surface, and (8 p - 2, 8 q - 6) for a polynomial one. Across
    knot lines at which the surface is C1 only it jumps: evaluate it with ``side=``. At a pole, where the normal
    vanishes, it is 0 / 0.

    Raises
    ------
    GeometryError
        If the surface has a v-derivative that is zero everywhere, or no normal.

    Examples
    --------
    >>> bow = Surface.from_bspline(
    ...     (1, 2), ([0, 0, 1, 1], [0, 0, 0, 1, 1, 1]),
    ...     [[[0, 0, 0], [0, 1, 0], [0, 2, 2]], [[1, 0, 0], [1, 1, 0], [1, 2, 2]]])
    >>> squared_curvature(bow)([0.2, 0.7], 0.0)  # z = y^2 / 2
    array([[1.],
           [1.]])
    """
    if surface.rational:
        return _square_rational_curvature(surface)
    su, sv, svv = (surface.derivative(*order) for order in ((1, 0), (0, 1), (0, 2)))
    normal = su.cross(sv)
    bend = normal.dot(svv)
    square, speed = normal.dot(normal), sv.dot(sv)
    return _make_quotient(bend * bend, square * (speed * speed))


def _square_rational_curvature(surface: Surface) -> Surface:
    coefs = surface.coefs
    space = Surface(surface.breaks, coefs, continuity=surface.continuity)  # homogeneous coordinates as a map to R^4
    x, w = space[:3], space[3]
    (xu, wu), (xv, wv), (xvv, wvv) = (
        (x.derivative(*order), w.derivative(*order)) for order in ((1, 0), (0, 1), (0, 2))
    )
    minors = [xu.cross(xv), xv.cross(x), x.cross(xu)]
    normal = minors[0] * w + minors[1] * wu + minors[2] * wv
    # expansion of det(P, Pu, Pv, Pvv) by its last column: N is the cofactor of x_vv
    bend = normal.dot(xvv) - minors[0].dot(x) * wvv
    along = xv * w - x * wv
    square, speed = normal.dot(normal), along.dot(along)
    w2 = w * w
    return _make_quotient(bend * bend * (w2 * w2 * w2), square * (speed * speed))


def _make_quotient(numerator: Surface, denominator: Surface) -> Surface:
    """Form the rational surface of two scalar ones."""
    scale = float(np.abs(denominator.coefs).max())
    if not scale > 0:
        raise GeometryError("the surface has no normal curvature in v: it is degenerate")
    p, q = (max(a, b) for a, b in zip(numerator.degree, denominator.degree, strict=True))
    parts = [part.elevate(p - part.degree[0], q - part.degree[1]).coefs / scale for part in (numerator, denominator)]
    return Surface(numerator.breaks, np.concatenate(parts, axis=2), rational=True, continuity=numerator.continuity)


def find_curvature_maxima(surface: Surface) -> Array:
    r"""Return where \|kappa_n^v\| has isolated maxima, as parameters v (n,), increasing.

    (kappa_n^v)^2 is evaluated on a grid that is as fine as its degree; from every grid point with a larger value than
    its neighbours the next maximum is searched for. A ridge that runs along u, as on a surface of revolution, is one
    maximum; a plateau in v is none, and neither is a maximum on a border v = const (on u = const it is one: ridges end
    there). On a knot line across which the curvature jumps, the larger limit counts, and the maximum may lie on it.

    Examples
    --------
    >>> bow = Surface.from_bspline(
    ...     (1, 2), ([0, 0, 1, 1], [0, 0, 0, 1, 1, 1]),
    ...     [[[0, 0, 0], [0, 1, 1], [0, 2, 0]], [[1, 0, 0], [1, 1, 1], [1, 2, 0]]])
    >>> find_curvature_maxima(bow).round(9)
    array([0.5])
    """
    curvature = squared_curvature(surface)
    v0, v1 = curvature.domain[1]
    u, v = (
        _make_grid_parameters(breaks, degree) for breaks, degree in zip(curvature.breaks, curvature.degree, strict=True)
    )
    knots = curvature.breaks[1][1:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = _zero_nonfinite(curvature.grid(u, v)[..., 0])
    values = np.concatenate([inside, _evaluate_larger_limit(curvature, u[:, None], knots)], axis=1)
    v = np.concatenate([v, knots])
    order = np.argsort(v)
    values, v = values[:, order], v[order]
    noise = STRIP_TOLERANCES.peak_excess * float(values.max())
    padded = np.pad(values, ((1, 1), (0, 0)), constant_values=-np.inf)
    is_peak = np.ones((len(u), len(v) - 2), dtype=bool)
    for i in (0, 1, 2):
        for j in (0, 2):
            is_peak &= values[:, 1:-1] > padded[i : i + len(u), j : j + len(v) - 2] + noise
        is_peak &= values[:, 1:-1] >= padded[i : i + len(u), 1:-1] - noise
    row, column = np.nonzero(_keep_ridge_peaks(is_peak, values[:, 1:-1]))
    if not len(row):
        return np.empty(0)
    steps = np.array([np.diff(u).max(), np.diff(v).max()])
    found = _climb_to_maxima(curvature, np.stack([u[row], v[column + 1]]), steps)
    margin = 2 * STRIP_TOLERANCES.border_margin * (v1 - v0)
    found = np.sort(found[(found > v0 + margin) & (found < v1 - margin)])
    for knot in knots:
        found[np.abs(found - knot) < STRIP_TOLERANCES.maxima_merge * (v1 - v0)] = knot
    return found[np.diff(found, prepend=-np.inf) > STRIP_TOLERANCES.maxima_merge * (v1 - v0)]


def _keep_ridge_peaks(is_peak: Array, values: Array) -> Array:
    """Keep only the largest of peaks that are neighbours along u (axis 0), because they lie on one ridge."""
    ridge = np.cumsum(np.diff(is_peak, axis=0, prepend=False) & is_peak, axis=0)  # numbered within each column
    is_kept = np.zeros_like(is_peak)
    for j in np.flatnonzero(is_peak.any(axis=0)):
        for k in range(1, int(ridge[-1, j]) + 1):
            members = np.flatnonzero(is_peak[:, j] & (ridge[:, j] == k))
            is_kept[members[values[members, j].argmax()], j] = True
    return is_kept


def _evaluate_larger_limit(curvature: Surface, u: Array, v: Array) -> Array:
    """Evaluate the squared curvature; at knot lines the larger of its two limits."""
    with np.errstate(divide="ignore", invalid="ignore"):
        left, right = (curvature(u, v, side=side)[..., 0] for side in _SIDES)
    return np.maximum(_zero_nonfinite(left), _zero_nonfinite(right))


def _zero_nonfinite(values: Array) -> Array:
    return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)


def _make_grid_parameters(breaks: Array, degree: int) -> Array:
    """Return the parameters of a grid inside the pieces, about as many in each as the degree."""
    count = max(degree, 12) // 2 * 2 + 1
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * ((np.arange(count) + 0.5) / count)
    return np.asarray(inner.ravel())


def _climb_to_maxima(curvature: Surface, points: Array, steps: Array) -> Array:
    """Search from points (u, v), (2, n), for the maxima nearby and return their v, (n,).

    Compass search: go to the largest of the point and its eight neighbours at a distance of `steps` times a size, and
    halve the size where that is the point itself.
    """
    domain = np.array(curvature.domain)
    margin = STRIP_TOLERANCES.border_margin * np.diff(domain)[:, 0]  # at a pole the curvature is 0 / 0
    low, high = (domain[:, 0] + margin)[:, None, None], (domain[:, 1] - margin)[:, None, None]
    compass = np.array([(0, 0), (0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)]).T
    size = np.full(points.shape[1], 0.5)
    for _ in range(200):
        around = np.clip(points[:, None] + compass[:, :, None] * steps[:, None, None] * size, low, high)
        values = _evaluate_larger_limit(curvature, *around)
        best = values.argmax(axis=0)
        best[values.max(axis=0) <= values[0] * (1 + 1e-13)] = 0
        points = around[:, best, np.arange(len(best))]
        size = np.where(best == 0, size / 2, size)
        if size.max() < 1e-7:
            break
    return np.asarray(points[1])
