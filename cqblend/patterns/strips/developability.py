r"""Developability of ruled surfaces: the paper's sigma, a bound of it that has no scale, and what kind a strip is.

Between rails C1, C2, with rulings D = C2 - C1, the tangent plane turns along a ruling unless C1', C2' and D are
linearly dependent. Everything here follows from that determinant and its coefficients. Must not know how strips are
laid flat.

References
----------
G. Elber: Model fabrication using surface layout projection (1995), lemma 1 and equations (1), (2).
"""

from functools import lru_cache
from typing import Literal

import numpy as np

from cqblend.errors import GeometryError, InputError, shown
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array, elevate_degree, multiply_polynomials, restrict_pieces

StripKind = Literal["plane", "cylinder", "cone", "tangent", "twisted"]
"""Plane; rulings parallel; rulings through one point; any other developable; not developable."""

RailPair = tuple[Curve, Curve]

DEVELOPABLE_TOLERANCE = 1e-9
"""Relative tolerance at which a strip counts as developable, planar, cylindrical or conical."""

_EPS = float(np.finfo(float).eps)


def compute_sigma(ruled: Surface) -> Surface:
    r"""Return sigma(t, v) of a ruled surface, which is zero exactly where the surface is developable.

    .. math:: \sigma = \langle R_t \times R_v,\; R_{tv} \rangle

    The normal is not normalised. Of a polynomial surface, sigma does not depend on v, and is returned of degree 0 in v.
    Of a rational one it is -det(P, P_t, P_v, P_tv) / W^4 with P = (W R, W), and that determinant does not depend on v.

    Parameters
    ----------
    ruled
        R(t, v), of degree 1 in v, one piece in v, dim 3.

    Returns
    -------
    Surface
        Of dim 1, over the domain of R.

    Raises
    ------
    InputError
        If the surface is not of that form.

    References
    ----------
    Elber, lemma 1.

    Examples
    --------
    >>> saddle = Surface.from_rows([Curve.bezier([[0.0, 0, 0], [1, 0, 0]]), Curve.bezier([[0.0, 1, 0], [1, 1, 2]])])
    >>> sigma(saddle)(0.3, 0.7)
    array([2.])
    >>> sigma(saddle).degree
    (0, 0)
    """
    _check_ruled(ruled)
    v0, v1 = ruled.domain[1]
    (t_breaks, v_breaks), (t_order, v_order) = ruled.breaks, ruled.continuity
    first, second = (Curve(t_breaks, ruled.coefs[:, i, :, :, 0], continuity=t_order) for i in (0, 1))
    if not ruled.rational:
        value = first.derivative().cross(second - first).dot(second.derivative()) / (v1 - v0) ** 2
        return Surface.from_rows([value.reduce()], (v0, v1))
    p, q = (_tangent_plucker_coordinates(row) for row in (first, second))
    meeting = p[0] * q[5] - p[1] * q[4] + p[2] * q[3] + p[3] * q[2] - p[4] * q[1] + p[5] * q[0]
    numerator = Surface.from_rows([(meeting / -((v1 - v0) ** 2)).reduce()], (v0, v1))
    weight = Surface(ruled.breaks, ruled.coefs[:, :, 3:], continuity=ruled.continuity)
    square = weight * weight
    denominator = (square * square).reduce()
    degrees = np.maximum(numerator.degree, denominator.degree)
    parts = [part.elevate(*(degrees - part.degree)).coefs for part in (numerator, denominator)]
    return Surface(
        (t_breaks, v_breaks),
        np.concatenate(parts, axis=2),
        rational=True,
        continuity=(numerator.continuity[0], v_order),
    )


def _tangent_plucker_coordinates(point: Curve) -> list[Curve]:
    """Pluecker coordinates 01, 02, 03, 12, 13, 23 of the tangent of a homogeneous curve of dim 4."""
    rate = point.derivative()
    pairs = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
    return [point[i] * rate[j] - point[j] * rate[i] for i, j in pairs]


def bound_twist(ruled: Surface) -> float:
    r"""Bound how fast the normal turns along a ruling, times the ruling's length (rad).

    .. math:: \frac{\|D\|\, |\sigma|}{\|N\|^2} = \|D\| \sqrt{-K}, \qquad N = R_t \times D

    in the middle of the ruling, where K is the Gaussian curvature there. As long as it is small, it is the angle
    between the normals at the two ends of the ruling. It does not depend on size or parametrisation, and is zero for
    developables. Rails that are a point, or stop at an end, and rulings that shrink to a point at an end, do no harm.

    Parameters
    ----------
    ruled
        As for :func:`compute_sigma`.

    Returns
    -------
    float
        At most a tenth above the largest value, from coefficients; infinite if the normal vanishes in the middle of a
        ruling on which the surface is not developable.

    Raises
    ------
    InputError
        If the surface is not of that form.

    Examples
    --------
    >>> saddle = Surface.from_rows([Curve.bezier([[0.0, 0, 0], [1, 0, 0]]), Curve.bezier([[0.0, 1, 0], [1, 1, 0.2]])])
    >>> 0.198 < twist(saddle) < 0.22  # in the middle of the ruling t = 0, tan(0.198 / 2) = 0.1
    True
    """
    _check_ruled(ruled)
    v0, v1 = ruled.domain[1]
    return bound_rail_twist((ruled.isoparametric(v=v0), ruled.isoparametric(v=v1)))


def bound_rail_twist(rails: RailPair) -> float:
    """Bound the twist of the ruled surface between two rails, as :func:`bound_twist`; InputError for no such rails."""
    size, points, rulings, _ = _extract_numerators(check_rails(rails))
    # velocities times the square of the common weight, which then cancels
    first, second = points, points + rulings
    h1, h2 = (_velocity_numerator(row[:, :3], row[:, 3:]) for row in (first, second))
    line = rulings[:, :3]
    normal = _cross_product(h1 + h2, line) / 2
    turning = (multiply_polynomials(_cross_product(h1, line), h2)).sum(axis=1, keepdims=True)
    square = _dot_product(normal, normal)
    above, below = (
        multiply_polynomials(_dot_product(line, line), multiply_polynomials(turning, turning)),
        multiply_polynomials(square, square),
    )
    degree = max(len(above), len(below))
    above, below = (elevate_degree(f, degree - len(f))[:, 0] for f in (above, below))
    # products of derivatives that are zero but for rounding
    reach = [float(np.abs(f).max()) for f in (h1, line, h2)]
    noise = float(64 * _EPS * size * reach[0] * reach[1] * reach[2]) ** 2
    return float(np.sqrt(_bound_ratio(above, below, noise)))


def bound_normal_turn(rails: RailPair) -> float:
    r"""Bound the angle between the normals at the two ends of a ruling (rad), for all rulings of a strip.

    .. math:: \tan \varphi = \frac{|D| \, \det(C_1', C_2', D)}{\langle C_1' \times D,\; C_2' \times D \rangle}

    Unlike :func:`bound_twist`, it is the angle itself however large that is, and where the rails differ in speed. A
    rail that stands still has no normal, and counts as developable there.

    Returns
    -------
    float
        At most a hundredth above the largest value, from coefficients; infinite from a right angle on: then rulings
        meet inside the strip, or nearly so. Where both sides of the quotient are zero on a ruling in the middle of a
        piece, the bound leaves out a neighbourhood of 1e-9 of that piece.

    Raises
    ------
    InputError
        If these are no rails.

    Examples
    --------
    >>> rails = Curve.bezier([[0.0, 0, 0], [1, 0, 0]]), Curve.bezier([[0.0, 1, 0], [1, 1, 0.2]])
    >>> 0.19739 < turn_between(rails) < 0.1994  # atan(0.2) = 0.197396
    True
    """
    size, points, rulings, _ = _extract_numerators(check_rails(rails))
    h1, h2 = (_velocity_numerator(row[:, :3], row[:, 3:]) for row in (points, points + rulings))
    line = rulings[:, :3]
    speeds = np.array([np.abs(h).max(axis=(0, 1)) for h in (h1, h2)])
    moves = speeds.min(axis=0) > 1e-9 * speeds.max()
    if not moves.any():
        return 0.0
    h1, h2, line = h1[..., moves], h2[..., moves], line[..., moves]
    meeting = multiply_polynomials(_cross_product(h1, line), h2).sum(axis=1, keepdims=True)
    above = _dot_product(line, line)
    above, below = (
        multiply_polynomials(above, multiply_polynomials(meeting, meeting))[:, 0],
        _dot_product(_cross_product(h1, line), _cross_product(h2, line))[:, 0],
    )
    reach = [float(np.abs(f).max()) for f in (h1, line, h2)]
    noise = float(64 * _EPS * size * reach[0] * reach[1] * reach[2]) ** 2
    square = _bound_squared_ratio(above, below, noise)
    return float(np.arctan(np.sqrt(square))) if np.isfinite(square) else np.inf


def _bound_squared_ratio(above: Array, below: Array, noise: float) -> float:
    """Bound above / below^2, (p+1, n) and (q+1, n), above not negative; infinite where below is not positive."""
    small = 64 * _EPS * np.abs(below).max(axis=0)
    for _ in range(len(below) - 1):
        for end in (0, -1):
            zero = (np.abs(below[end]) <= small) & (small > 0)
            if not zero.any():
                continue
            if (above[end, zero] > noise).any():
                return np.inf
            below[:, zero] = _divide_out_zero(below[:, zero], end)
            above[:, zero] = _divide_out_zero(_divide_out_zero(above[:, zero], end), end)
    above, below = above[:, small > 0], below[:, small > 0]
    bound, taken = 0.0, 1e-24
    for _ in range(30):
        low, high = below.min(axis=0), np.maximum(above.max(axis=0), 0.0)
        if (below.max(axis=0) <= 0).any():
            return np.inf
        upper = np.divide(high, low**2, out=np.full(len(high), np.inf), where=low > 0)
        for end in (0, -1):
            here = np.divide(above[end], below[end] ** 2, out=np.zeros(len(high)), where=below[end] > 0)
            taken = max(taken, float(here.max(initial=0.0)))
        open_ = upper > 1.02 * taken
        bound = max(bound, float(upper[~open_].max(initial=0.0)))
        if not open_.any():
            return bound
        count = int(open_.sum())
        ends = np.repeat([0.0, 0.5], count), np.repeat([0.5, 1.0], count)
        above, below = (restrict_pieces(np.tile(f[:, open_], 2), *ends) for f in (above, below))
    return max(bound, 1.02 * taken)


def _bound_ratio(above: Array, below: Array, noise: float) -> float:
    """Bound the ratio of polynomials that are not negative, (p+1, n) each; common zeros at the ends are divided out."""
    for _ in range(len(below) - 1):
        for end in (0, -1):
            zero = (np.abs(below[end]) <= 64 * _EPS * np.abs(below).max(axis=0)) & (below.max(axis=0) > 0)
            if not zero.any():
                continue
            if (above[end, zero] > noise).any():
                return np.inf
            above[:, zero], below[:, zero] = (_divide_out_zero(f[:, zero], end) for f in (above, below))
    above = above[:, below.max(axis=0) > 0]
    below = below[:, below.max(axis=0) > 0]
    bound, taken = 0.0, (DEVELOPABLE_TOLERANCE / 1e3) ** 2
    for _ in range(40):
        if not above.size:
            return bound
        high, low = above.max(axis=0), below.min(axis=0)
        upper = np.divide(high, low, out=np.full(len(high), np.inf), where=low > 0)
        for end in (0, -1):
            here = np.divide(above[end], below[end], out=np.zeros(len(high)), where=below[end] > 0)
            taken = max(taken, float(here.max()))
        open_ = upper > 1.2 * taken
        bound = max(bound, float(upper[~open_].max(initial=0.0)))
        count = int(open_.sum())
        ends = np.repeat([0.0, 0.5], count), np.repeat([0.5, 1.0], count)
        above, below = (restrict_pieces(np.tile(f[:, open_], 2), *ends) for f in (above, below))
    return np.inf


def _divide_out_zero(f: Array, end: int) -> Array:
    """Divide polynomials with a zero at x = 0 by x (end 0), or at x = 1 by 1 - x (end -1); the formal degree stays."""
    f = f if end == 0 else f[::-1]
    p = len(f) - 1
    lower = elevate_degree(f[1:] * (p / np.arange(1.0, p + 1))[:, None], 1)
    return lower if end == 0 else lower[::-1]


def classify_strip(rails: RailPair) -> StripKind:
    """Say what kind of ruled surface two rails span, to a relative tolerance of 1e-9.

    Parameters
    ----------
    rails
        C1 and C2 of dim 3 over one domain, polynomial or rational; one may be a point.

    Raises
    ------
    InputError
        If these are no rails.
    GeometryError
        If there is no surface between them: they are the same curve, or both points.

    Examples
    --------
    >>> arc = Curve.bezier([[1.0, 0, 0], [1, 1, 0], [0, 1, 0]], [1.0, np.sqrt(0.5), 1.0])
    >>> classify((arc, arc + [0, 0, 1])), classify((arc, arc * 2 + [0, 0, 1])), classify((arc, arc * 2))
    ('cylinder', 'cone', 'plane')
    """
    if _is_clearly_twisted(rails):
        return "twisted"
    if find_plane_normal(rails) is not None:
        return "plane"
    if find_ruling_direction(rails) is not None:
        return "cylinder"
    if find_apex(rails) is not None:
        return "cone"
    return "tangent" if bound_rail_twist(rails) <= DEVELOPABLE_TOLERANCE else "twisted"


def _is_clearly_twisted(rails: RailPair) -> bool:
    """Tell most twisted strips by samples, which is cheaper than to prove that a strip is developable."""
    _extract_numerators(check_rails(rails))
    both = stack_rail_and_ruling(rails)
    t = (both.breaks[:-1] + np.array([0.2, 0.5, 0.8])[:, None] * np.diff(both.breaks)).ravel()
    value, rate = both.jet(t, 1)
    ruling = value[:, 3:]
    normal = np.cross(rate[:, :3] + rate[:, 3:] / 2, ruling)
    turning = np.abs((np.cross(rate[:, :3], ruling) * rate[:, 3:]).sum(axis=1)) * np.linalg.norm(ruling, axis=1)
    return bool((turning > 1e-4 * (normal * normal).sum(axis=1)).any())


def find_plane_normal(rails: RailPair) -> Array | None:
    """Return a unit normal of the plane that both rails lie in, (3,), or None."""
    size, points, rulings, _ = _extract_numerators(check_rails(rails))
    poles = _to_poles(np.concatenate([points, points + rulings], axis=2))
    normal = np.linalg.svd(poles - poles.mean(axis=0), full_matrices=False)[2][2]
    return normal if np.ptp(poles @ normal) <= DEVELOPABLE_TOLERANCE * size else None


def find_ruling_direction(rails: RailPair) -> Array | None:
    """Return the unit vector that all rulings are parallel to, from the first rail to the second, (3,), or None."""
    size, _, rulings, _ = _extract_numerators(check_rails(rails))
    vectors = np.moveaxis(rulings[:, :3], 1, -1).reshape(-1, 3)
    longest = vectors[np.linalg.norm(vectors, axis=1).argmax()]
    length = float(np.linalg.norm(longest))
    mean = vectors.sum(axis=0) if vectors.sum(axis=0) @ longest > length**2 / 2 else longest
    direction = mean / np.linalg.norm(mean)
    miss = np.abs(np.cross(vectors, direction)).max()
    return np.asarray(direction) if miss <= DEVELOPABLE_TOLERANCE * length + 16 * _EPS * size else None


def find_apex(rails: RailPair) -> Array | None:
    """Return the point that all rulings pass through, (3,), or None; a far one (1e4 sizes) is none."""
    size, points, rulings, centre = _extract_numerators(check_rails(rails))
    both = stack_rail_and_ruling(rails)
    t = both.breaks[:-1] + np.linspace(0.05, 0.95, 2 * len(points))[:, None] * np.diff(both.breaks)
    samples = both(t.ravel())
    p, d = samples[:, :3] - centre, samples[:, 3:] / np.abs(samples[:, 3:]).max()
    # |D x (V - P)|^2 is least: sum of (D.D I - D D^T) (V - P) = 0
    projectors = (d**2).sum(axis=1)[:, None, None] * np.eye(3) - d[:, :, None] * d[:, None, :]
    matrix, right = projectors.sum(axis=0), np.einsum("nij,nj->i", projectors, p)
    if np.linalg.cond(matrix) > 1e12:
        return None
    point = np.linalg.solve(matrix, right)
    if np.linalg.norm(point) > 1e4 * size:
        return None
    to_first = points[:, :3] - points[:, 3:] * point[:, None]
    miss = np.abs(_cross_product(to_first, rulings[:, :3])).max()
    scale = size * np.abs(rulings[:, :3]).max()
    return (
        np.asarray(point + centre)
        if miss <= DEVELOPABLE_TOLERANCE * scale + 64 * _EPS * size * np.abs(to_first).max()
        else None
    )


# -- rails as bare coefficients


def _check_ruled(ruled: Surface) -> None:
    if not isinstance(ruled, Surface) or ruled.dim != 3 or ruled.degree[1] != 1 or len(ruled.breaks[1]) != 2:
        raise InputError(f"a ruled surface is a Surface of dim 3, of degree 1 and one piece in v, not {shown(ruled)}")


def check_rails(rails: RailPair) -> RailPair:
    """Return two rails, refusing what is none with an InputError."""
    if len(rails) != 2 or not all(isinstance(rail, Curve) for rail in rails):
        raise InputError(f"rails are two Curves, not {shown(rails)}")
    for rail in rails:
        if rail.dim != 3:
            raise InputError(f"a rail is a curve in space, of dim 3, not {rail.dim}")
        weight = rail.coefs[:, 3] if rail.rational else None
        if weight is not None and weight.min() <= 0:
            raise InputError(f"a rail has the weight coefficient {weight.min():.3g}: they must be positive")
    first, second = rails
    return rails if isinstance(rails, tuple) else (first, second)


@lru_cache(maxsize=1)
def stack_rail_and_ruling(rails: RailPair) -> Curve:
    """Return (C1, C2 - C1) as one curve of dim 6, with the cancellation in the coefficients."""
    both = Curve.stack(rails)
    coefs = both.coefs.copy()
    coefs[:, 3:6] -= coefs[:, :3]
    small = np.abs(coefs[:, 3:6]) <= 4 * _EPS * float(np.abs(coefs[:, :3]).max())
    coefs[:, 3:6][small] = 0.0
    return Curve(both.breaks, coefs, rational=both.rational, continuity=both.continuity)


@lru_cache(maxsize=1)
def _extract_numerators(rails: RailPair) -> tuple[float, Array, Array, Array]:
    """Size; homogeneous C1 and C2 - C1, (p+1, 4, n) each, about the centre of all poles; that centre.

    The second has the weight zero, so that C1 + (C2 - C1) has that of both. Derivatives are by local parameters.
    """
    both = stack_rail_and_ruling(rails)
    coefs = both.coefs
    weight = coefs[:, 6:] if both.rational else np.ones((len(coefs), 1, coefs.shape[2]))
    ends = np.concatenate([coefs[:, :3] / weight, (coefs[:, :3] + coefs[:, 3:6]) / weight], axis=2)
    low, high = ends.min(axis=(0, 2)), ends.max(axis=(0, 2))
    centre = (low + high) / 2
    points = np.concatenate([coefs[:, :3] - weight * centre[:, None], weight], axis=1)
    rulings = np.concatenate([coefs[:, 3:6], np.zeros_like(weight)], axis=1)
    size = float(np.linalg.norm(high - low))
    if np.abs(rulings).max() <= 16 * _EPS * np.abs(ends).max():
        raise GeometryError("the rails are the same curve: there is no strip between them")
    if max(float(np.ptp(rail, axis=(0, 2)).max()) for rail in np.split(ends, 2, axis=2)) <= 16 * _EPS * size:
        raise GeometryError("both rails are points: there is no strip between them")
    return size, points, rulings, centre


def _to_poles(homogeneous: Array) -> Array:
    return np.moveaxis(homogeneous[:, :3] / homogeneous[:, 3:], 1, -1).reshape(-1, 3)


def _velocity_numerator(numerator: Array, weight: Array) -> Array:
    """N' W - N W', of formal degree 2 p - 1: the velocity by the local parameter, times W^2."""
    p = len(weight) - 1
    if (weight == 1).all():
        return p * np.diff(numerator, axis=0)
    rate, change = p * np.diff(numerator, axis=0), p * np.diff(weight, axis=0)
    return multiply_polynomials(rate, weight) - multiply_polynomials(numerator, change)


def _cross_product(a: Array, b: Array) -> Array:
    i, j = [1, 2, 0], [2, 0, 1]
    return multiply_polynomials(a[:, i], b[:, j]) - multiply_polynomials(a[:, j], b[:, i])


def _dot_product(a: Array, b: Array) -> Array:
    return multiply_polynomials(a, b).sum(axis=1, keepdims=True)
