r"""Normal curvature in the ruled direction: what makes strips narrow, and where a surface asks to be divided.

.. math:: \kappa_n^v = \frac{\langle n, S_{vv} \rangle}{\|S_v\|^2}, \quad n = \frac{S_u \times S_v}{\|S_u \times S_v\|}

The root in n is no spline, so its square is formed, which has the same maxima of \|kappa\|. In homogeneous coordinates
P = (x, W), with a = x_v W - x W_v and N = W x_u x x_v + W_u x_v x x + W_v x x x_u (so that S_v = a / W^2 and
S_u x S_v = N / W^3),

.. math:: (\kappa_n^v)^2 = \frac{\det(P, P_u, P_v, P_{vv})^2\, W^6}{\|N\|^2\, \|a\|^4}

Must not know strips.

References
----------
G. Elber: Model fabrication using surface layout projection (1995), equations (5) to (7) and figure 5.
"""

import numpy as np

from cqblend.errors import GeometryError
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array

_EPS = float(np.finfo(float).eps)


def squared_curvature(surface: Surface) -> Surface:
    r"""Return (kappa_n^v)^2 as a rational scalar surface, in 1/mm^2.

    Its degrees are (14 p - 2, 14 q - 4) for a rational surface, of which nothing is lost, and (8 p - 2, 8 q - 6) for a
    polynomial one. Across knot lines at which the surface is C1 only it jumps: evaluate it with ``side=``. At a pole,
    where the normal vanishes, it is 0 / 0.

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
        return _rational(surface)
    su, sv, svv = (surface.derivative(*order) for order in ((1, 0), (0, 1), (0, 2)))
    normal = su.cross(sv)
    bend = normal.dot(svv)
    square, speed = normal.dot(normal), sv.dot(sv)
    return _quotient(bend * bend, square * (speed * speed))


def _rational(surface: Surface) -> Surface:
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
    return _quotient(bend * bend * (w2 * w2 * w2), square * (speed * speed))


def _quotient(numerator: Surface, denominator: Surface) -> Surface:
    """Form the rational surface of two scalar ones."""
    scale = float(np.abs(denominator.coefs).max())
    if not scale > 0:
        raise GeometryError("the surface has no normal curvature in v: it is degenerate")
    p, q = (max(a, b) for a, b in zip(numerator.degree, denominator.degree, strict=True))
    parts = [part.elevate(p - part.degree[0], q - part.degree[1]).coefs / scale for part in (numerator, denominator)]
    return Surface(numerator.breaks, np.concatenate(parts, axis=2), rational=True, continuity=numerator.continuity)


def maxima(surface: Surface) -> Array:
    r"""Return the isolated interior maxima of \|kappa_n^v\| in v, as parameters (n,), increasing.

    Each patch of (kappa_n^v)^2 is searched on a grid that is finer than its degree lets it oscillate, up to and
    including its borders, where it takes the limit from its own side; what is larger than its neighbours in v, and not
    smaller than those in u, is refined by parabolas. A ridge that runs along u, as on a surface of revolution, counts
    as one place; a plateau in v, and maxima on the borders of the surface, do not count. On a knot line across which
    the curvature jumps the place is the knot line.
    """
    curvature = squared_curvature(surface)
    u = _stations(curvature.breaks[0], curvature.degree[0])
    v = _stations(curvature.breaks[1], curvature.degree[1])
    rows = [_row(curvature, u, v, side) for side in ("left", "right")]
    values = np.maximum(*rows)  # at a knot line the larger limit
    top = float(values.max(initial=0.0))
    if top <= 0:
        return np.empty(0)
    noise = 1e-9 * top
    here = values[:, 1:-1]
    peak = (here > values[:, :-2] + noise) & (here > values[:, 2:] + noise)
    for step in (1, -1):
        beside = np.roll(values, step, axis=0)
        beside[0 if step == 1 else -1] = -np.inf
        peak &= here >= beside[:, 1:-1] - noise
    places = [_refined(curvature, float(u[i]), v, j + 1) for i, j in zip(*np.nonzero(peak), strict=True)]
    found = np.unique(np.array(places))
    return found[np.diff(found, prepend=-np.inf) > 1e-4 * (v[-1] - v[0])]


def _row(curvature: Surface, u: Array, v: Array, side: str) -> Array:
    """Values on a grid, limits from one side at knot lines; 0 where the curvature is not defined."""
    with np.errstate(divide="ignore", invalid="ignore"):
        values = curvature(u[:, None], v, side="left" if side == "left" else "right")[..., 0]
    return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)


def _stations(breaks: Array, degree: int) -> Array:
    """Return parameters of a grid: all breaks, and between them more places than the degree has turns."""
    count = max(2 * degree, 8)
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * (np.arange(count) / count)
    return np.append(inner.ravel(), breaks[-1])


def _refined(curvature: Surface, u: float, v: Array, j: int) -> float:
    """Refine a maximum in v between the neighbours of v_j by parabolas; a knot line with a jump stays."""
    low, here, high = v[j - 1 : j + 2]
    if here in curvature.breaks[1]:
        slopes = []
        for side, other in (("left", low), ("right", high)):
            near = here + 1e-3 * (other - here)
            pair = _row(curvature, np.array([u]), np.array([here, near]), side)[0]
            slopes.append(pair[0] - pair[1])
        if min(slopes) >= 0:
            return float(here)
    for _ in range(30):
        x = np.array([low, here, high])
        f = _row(curvature, np.array([u]), x, "right")[0]
        a, b = (f[1] - f[0]) / (x[1] - x[0]), (f[2] - f[1]) / (x[2] - x[1])
        bend = (b - a) / (x[2] - x[0])
        if not bend < 0:
            break
        peak = (x[0] + x[1]) / 2 - a / (2 * bend)
        width = (high - low) / 8
        peak = min(max(peak, low), high)
        low, here, high = max(low, peak - width), peak, min(high, peak + width)
        if width < 1e-9 * (v[-1] - v[0]) or not low < here < high:
            break
    return float(here)
