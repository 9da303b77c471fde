r"""Developability of ruled surfaces: Elber's sigma, bounds that do not depend on scale, and the kind of a strip.

Between rails C1, C2, with rulings D = C2 - C1, the tangent plane turns along a ruling unless C1', C2' and D are
linearly dependent. Everything here follows from that determinant and its coefficients. Depends on splines only.

References
----------
G. Elber: Model fabrication using surface layout projection (1995), lemma 1 and equations (1), (2).
"""

from functools import lru_cache
from typing import Literal

import numpy as np

from cqblend.errors import GeometryError, InputError, shown
from cqblend.patterns.strips.tolerances import RULING_TOLERANCES
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import EPSILON, Array, elevate_degree, multiply_polynomials, restrict_pieces

StripKind = Literal["plane", "cylinder", "cone", "tangent", "twisted"]
"""Plane; rulings parallel; rulings through one point; any other developable (tangent surface); not developable."""

RailPair = tuple[Curve, Curve]


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
    >>> compute_sigma(saddle)(0.3, 0.7)
    array([2.])
    >>> compute_sigma(saddle).degree
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
    determinant = p[0] * q[5] - p[1] * q[4] + p[2] * q[3] + p[3] * q[2] - p[4] * q[1] + p[5] * q[0]
    numerator = Surface.from_rows([(determinant / -((v1 - v0) ** 2)).reduce()], (v0, v1))
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


def bound_twist(rails: RailPair) -> float:
    r"""Bound how fast the normal turns along a ruling, times the ruling's length (rad).

    .. math:: \frac{\|D\|\, |\sigma|}{\|N\|^2} = \|D\| \sqrt{-K}, \qquad N = R_t \times D

    in the middle of the ruling, where K is the Gaussian curvature there. As long as it is small, it is the angle
    between the normals at the two ends of the ruling. It does not depend on size or parametrisation, and is zero for
    developables. Rails may be points, or stop at an end, and rulings may shrink to a point at an end.

    Parameters
    ----------
    rails
        C1 and C2 of dim 3 over one domain, polynomial or rational; one may be a point.

    Returns
    -------
    float
        At most a tenth above the largest value, from coefficients; infinite if the normal vanishes in the middle of a
        ruling on which the surface is not developable.

    Raises
    ------
    InputError
        If the rails are not two curves of dim 3 with positive weights.

    Examples
    --------
    >>> saddle = Curve.bezier([[0.0, 0, 0], [1, 0, 0]]), Curve.bezier([[0.0, 1, 0], [1, 1, 0.2]])
    >>> 0.198 < bound_twist(saddle) < 0.22  # in the middle of the ruling t = 0, tan(0.198 / 2) = 0.1
    True
    """
    size, points, rulings, _ = _extract_numerators(check_rails(rails))
    # velocities times the square of the common weight, which then cancels
    first, second = points, points + rulings
    h1, h2 = (_velocity_numerator(row[:, :3], row[:, 3:]) for row in (first, second))
    line = rulings[:, :3]
    normal = _cross_product(h1 + h2, line) / 2
    square = _dot_product(normal, normal)
    numerator, noise = _multiply_determinant(h1, line, h2, size)
    denominator = multiply_polynomials(square, square)
    degree = max(len(numerator), len(denominator))
    numerator, denominator = (elevate_degree(f, degree - len(f))[:, 0] for f in (numerator, denominator))
    return float(np.sqrt(_bound_ratio(numerator, denominator, noise)))


def bound_normal_turn(rails: RailPair) -> float:
    r"""Bound the angle between the normals at the two ends of a ruling (rad), for all rulings of a strip.

    .. math:: \tan \varphi = \frac{|D| \, \det(C_1', C_2', D)}{\langle C_1' \times D,\; C_2' \times D \rangle}

    Unlike :func:`bound_twist`, it is the angle itself, also if that is large or the rails differ in speed. Where a rail
    does not move it has no normal, and the strip counts as developable.

    Returns
    -------
    float
        At most a hundredth above the largest value, from coefficients; infinite from a right angle on: then rulings
        meet inside the strip, or nearly so. Where both sides of the quotient are zero on a ruling in the middle of a
        piece, the bound leaves out a neighbourhood of 1e-9 of that piece.

    Raises
    ------
    InputError
        If the rails are not two curves of dim 3 with positive weights.

    Examples
    --------
    >>> rails = Curve.bezier([[0.0, 0, 0], [1, 0, 0]]), Curve.bezier([[0.0, 1, 0], [1, 1, 0.2]])
    >>> 0.19739 < bound_normal_turn(rails) < 0.1994  # atan(0.2) = 0.197396
    True
    """
    size, points, rulings, _ = _extract_numerators(check_rails(rails))
    h1, h2 = (_velocity_numerator(row[:, :3], row[:, 3:]) for row in (points, points + rulings))
    line = rulings[:, :3]
    speeds = np.array([np.abs(h).max(axis=(0, 1)) for h in (h1, h2)])
    moves = speeds.min(axis=0) > RULING_TOLERANCES.stationary_rail * speeds.max()
    if not moves.any():
        return 0.0
    h1, h2, line = h1[..., moves], h2[..., moves], line[..., moves]
    numerator, noise = _multiply_determinant(h1, line, h2, size)
    denominator = _dot_product(_cross_product(h1, line), _cross_product(h2, line))
    square = _bound_squared_ratio(numerator[:, 0], denominator[:, 0], noise)
    return float(np.arctan(np.sqrt(square))) if np.isfinite(square) else np.inf


def _multiply_determinant(h1: Array, line: Array, h2: Array, size: float) -> tuple[Array, float]:
    r"""Return :math:`|D|^2 \det(C_1', D, C_2')^2`, and its rounding error where it is zero but for rounding.

    Numerators (p + 1, 3, n) of the velocities C_1' and C_2' and of the rulings D, and the ``size`` of the strip; the
    product is (q + 1, 1, n).
    """
    determinant = multiply_polynomials(_cross_product(h1, line), h2).sum(axis=1, keepdims=True)
    magnitudes = [float(np.abs(f).max()) for f in (h1, line, h2)]
    noise = float(64 * EPSILON * size * magnitudes[0] * magnitudes[1] * magnitudes[2]) ** 2
    return multiply_polynomials(_dot_product(line, line), multiply_polynomials(determinant, determinant)), noise


def _bound_squared_ratio(numerator: Array, denominator: Array, noise: float) -> float:
    """Bound f / g^2 for polynomials f (p+1, n), not negative, and g (q+1, n); infinite where g is not positive.

    Zeros of g at the ends of pieces are divided out if f has them, too, up to the rounding error `noise` of f.
    """
    small = 64 * EPSILON * np.abs(denominator).max(axis=0)
    for _ in range(len(denominator) - 1):
        has_zero = False
        for end in (0, -1):
            zero = (np.abs(denominator[end]) <= small) & (small > 0)
            if not zero.any():
                continue
            has_zero = True
            if (numerator[end, zero] > noise).any():
                return np.inf
            denominator[:, zero] = _divide_out_zero(denominator[:, zero], end)
            numerator[:, zero] = _divide_out_zero(_divide_out_zero(numerator[:, zero], end), end)
        if not has_zero:
            break
    numerator, denominator = numerator[:, small > 0], denominator[:, small > 0]
    bound, attained = 0.0, RULING_TOLERANCES.least_squared_turn
    for _ in range(30):
        low, high = denominator.min(axis=0), np.maximum(numerator.max(axis=0), 0.0)
        if (denominator.max(axis=0) <= 0).any():
            return np.inf
        upper = np.divide(high, low**2, out=np.full(len(high), np.inf), where=low > 0)
        for end in (0, -1):
            here = np.divide(numerator[end], denominator[end] ** 2, out=np.zeros(len(high)), where=denominator[end] > 0)
            attained = max(attained, float(here.max(initial=0.0)))
        is_open = upper > RULING_TOLERANCES.turn_bound_ratio * attained
        bound = max(bound, float(upper[~is_open].max(initial=0.0)))
        if not is_open.any():
            return bound
        count = int(is_open.sum())
        ends = np.repeat([0.0, 0.5], count), np.repeat([0.5, 1.0], count)
        numerator, denominator = (restrict_pieces(np.tile(f[:, is_open], 2), *ends) for f in (numerator, denominator))
    return max(bound, RULING_TOLERANCES.turn_bound_ratio * attained)


def _bound_ratio(numerator: Array, denominator: Array, noise: float) -> float:
    """Bound f / g for polynomials that are not negative, (p+1, n) each.

    Zeros of g at the ends of pieces are divided out if f has them, too, up to the rounding error `noise` of f.
    """
    for _ in range(len(denominator) - 1):
        has_zero = False
        for end in (0, -1):
            small = 64 * EPSILON * np.abs(denominator).max(axis=0)
            zero = (np.abs(denominator[end]) <= small) & (denominator.max(axis=0) > 0)
            if not zero.any():
                continue
            has_zero = True
            if (numerator[end, zero] > noise).any():
                return np.inf
            numerator[:, zero] = _divide_out_zero(numerator[:, zero], end)
            denominator[:, zero] = _divide_out_zero(denominator[:, zero], end)
        if not has_zero:
            break
    numerator = numerator[:, denominator.max(axis=0) > 0]
    denominator = denominator[:, denominator.max(axis=0) > 0]
    bound, attained = 0.0, RULING_TOLERANCES.least_twist**2
    for _ in range(40):
        if not numerator.size:
            return bound
        high, low = numerator.max(axis=0), denominator.min(axis=0)
        upper = np.divide(high, low, out=np.full(len(high), np.inf), where=low > 0)
        for end in (0, -1):
            here = np.divide(numerator[end], denominator[end], out=np.zeros(len(high)), where=denominator[end] > 0)
            attained = max(attained, float(here.max()))
        is_open = upper > RULING_TOLERANCES.twist_bound_ratio * attained
        bound = max(bound, float(upper[~is_open].max(initial=0.0)))
        count = int(is_open.sum())
        ends = np.repeat([0.0, 0.5], count), np.repeat([0.5, 1.0], count)
        numerator, denominator = (restrict_pieces(np.tile(f[:, is_open], 2), *ends) for f in (numerator, denominator))
    return np.inf


def _divide_out_zero(f: Array, end: int) -> Array:
    """Divide polynomials with a zero at x = 0 by x (end 0), or at x = 1 by 1 - x (end -1); the formal degree stays."""
    f = f if end == 0 else f[::-1]
    p = len(f) - 1
    lower = elevate_degree(f[1:] * (p / np.arange(1.0, p + 1))[:, None], 1)
    return lower if end == 0 else lower[::-1]


def classify_strip(rails: RailPair, twist: float | None = None) -> StripKind:
    """Tell what kind of ruled surface two rails span, to a relative tolerance of 1e-9.

    Parameters
    ----------
    rails
        C1 and C2 of dim 3 over one domain, polynomial or rational; one may be a point.
    twist
        What :func:`bound_twist` returns for them, where it is known.

    Raises
    ------
    InputError
        If the rails are not of that form.
    GeometryError
        If there is no surface between them: they are the same curve, or both points.

    Examples
    --------
    >>> arc = Curve.bezier([[1.0, 0, 0], [1, 1, 0], [0, 1, 0]], [1.0, np.sqrt(0.5), 1.0])
    >>> [classify_strip((arc, other)) for other in (arc + [0, 0, 1], arc * 2 + [0, 0, 1], arc * 2)]
    ['cylinder', 'cone', 'plane']
    """
    if _is_clearly_twisted(rails):
        return "twisted"
    if find_plane_normal(rails) is not None:
        return "plane"
    if find_ruling_direction(rails) is not None:
        return "cylinder"
    if find_apex(rails) is not None:
        return "cone"
    if twist is None:
        twist = bound_twist(rails)
    return "tangent" if twist <= RULING_TOLERANCES.developable else "twisted"


def _is_clearly_twisted(rails: RailPair) -> bool:
    """Tell most twisted strips by samples, which is cheaper than to prove that a strip is developable."""
    _extract_numerators(check_rails(rails))
    rail_and_ruling = stack_rail_and_ruling(rails)
    t = (rail_and_ruling.breaks[:-1] + np.array([0.2, 0.5, 0.8])[:, None] * np.diff(rail_and_ruling.breaks)).ravel()
    value, rate = rail_and_ruling.jet(t, 1)
    ruling = value[:, 3:]
    normal = np.cross(rate[:, :3] + rate[:, 3:] / 2, ruling)
    turning = np.abs((np.cross(rate[:, :3], ruling) * rate[:, 3:]).sum(axis=1)) * np.linalg.norm(ruling, axis=1)
    return bool((turning > RULING_TOLERANCES.clearly_twisted * (normal * normal).sum(axis=1)).any())


def find_plane_normal(rails: RailPair) -> Array | None:
    """Return a unit normal of the plane that both rails lie in, (3,), or None."""
    size, points, rulings, _ = _extract_numerators(check_rails(rails))
    poles = _to_poles(np.concatenate([points, points + rulings], axis=2))
    normal = np.linalg.svd(poles - poles.mean(axis=0), full_matrices=False)[2][2]
    return normal if np.ptp(poles @ normal) <= RULING_TOLERANCES.developable * size else None


def find_ruling_direction(rails: RailPair) -> Array | None:
    """Return the unit vector that all rulings are parallel to, from the first rail to the second, (3,), or None."""
    size, _, rulings, _ = _extract_numerators(check_rails(rails))
    vectors = np.moveaxis(rulings[:, :3], 1, -1).reshape(-1, 3)
    longest = vectors[np.linalg.norm(vectors, axis=1).argmax()]
    length = float(np.linalg.norm(longest))
    mean = vectors.sum(axis=0) if vectors.sum(axis=0) @ longest > length**2 / 2 else longest
    direction = mean / np.linalg.norm(mean)
    miss = np.abs(np.cross(vectors, direction)).max()
    return np.asarray(direction) if miss <= RULING_TOLERANCES.developable * length + 16 * EPSILON * size else None


def find_apex(rails: RailPair) -> Array | None:
    """Return the point that all rulings pass through, (3,), or None; None also if it is farther away than 1e4 sizes."""
    size, points, rulings, centre = _extract_numerators(check_rails(rails))
    rail_and_ruling = stack_rail_and_ruling(rails)
    steps = np.linspace(0.05, 0.95, 2 * len(points))[:, None] * np.diff(rail_and_ruling.breaks)
    samples = rail_and_ruling((rail_and_ruling.breaks[:-1] + steps).ravel())
    p, d = samples[:, :3] - centre, samples[:, 3:] / np.abs(samples[:, 3:]).max()
    # the apex V minimises the sum of |D x (V - P)|^2: sum of (D.D I - D D^T) (V - P) = 0
    projectors = (d**2).sum(axis=1)[:, None, None] * np.eye(3) - d[:, :, None] * d[:, None, :]
    matrix, right = projectors.sum(axis=0), np.einsum("nij,nj->i", projectors, p)
    if np.linalg.cond(matrix) > RULING_TOLERANCES.worst_condition:
        return None
    point = np.linalg.solve(matrix, right)
    if np.linalg.norm(point) > RULING_TOLERANCES.farthest_apex * size:
        return None
    to_first = points[:, :3] - points[:, 3:] * point[:, None]
    miss = np.abs(_cross_product(to_first, rulings[:, :3])).max()
    scale = size * np.abs(rulings[:, :3]).max()
    return (
        np.asarray(point + centre)
        if miss <= RULING_TOLERANCES.developable * scale + 64 * EPSILON * size * np.abs(to_first).max()
        else None
    )


# -- coefficients of rails


def _check_ruled(ruled: Surface) -> None:
    if not isinstance(ruled, Surface) or ruled.dim != 3 or ruled.degree[1] != 1 or len(ruled.breaks[1]) != 2:
        raise InputError(f"a ruled surface is a Surface of dim 3, of degree 1 and one piece in v, not {shown(ruled)}")


def check_rails(rails: RailPair) -> RailPair:
    """Return two rails; an InputError unless they are curves of dim 3 with positive weights."""
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
    """Return (C1, C2 - C1) as one curve of dim 6; coefficients of C2 - C1 that are rounding only are zero."""
    both_rails = Curve.stack(rails)
    coefs = both_rails.coefs.copy()
    coefs[:, 3:6] -= coefs[:, :3]
    small = np.abs(coefs[:, 3:6]) <= 4 * EPSILON * float(np.abs(coefs[:, :3]).max())
    coefs[:, 3:6][small] = 0.0
    return Curve(both_rails.breaks, coefs, rational=both_rails.rational, continuity=both_rails.continuity)


@lru_cache(maxsize=1)
def _extract_numerators(rails: RailPair) -> tuple[float, Array, Array, Array]:
    """Return the size; homogeneous C1 and C2 - C1, (p+1, 4, n) each, about the centre of all poles; and that centre.

    The rails have a common weight; the weight of C2 - C1 is set to zero, so that the sum is C2.
    """
    rail_and_ruling = stack_rail_and_ruling(rails)
    coefs = rail_and_ruling.coefs
    weight = coefs[:, 6:] if rail_and_ruling.rational else np.ones((len(coefs), 1, coefs.shape[2]))
    ends = np.concatenate([coefs[:, :3] / weight, (coefs[:, :3] + coefs[:, 3:6]) / weight], axis=2)
    low, high = ends.min(axis=(0, 2)), ends.max(axis=(0, 2))
    centre = (low + high) / 2
    points = np.concatenate([coefs[:, :3] - weight * centre[:, None], weight], axis=1)
    rulings = np.concatenate([coefs[:, 3:6], np.zeros_like(weight)], axis=1)
    size = float(np.linalg.norm(high - low))
    if np.abs(rulings).max() <= 16 * EPSILON * np.abs(ends).max():
        raise GeometryError("the rails are the same curve: there is no strip between them")
    if max(float(np.ptp(rail, axis=(0, 2)).max()) for rail in np.split(ends, 2, axis=2)) <= 16 * EPSILON * size:
        raise GeometryError("both rails are points: there is no strip between them")
    return size, points, rulings, centre


def _to_poles(homogeneous: Array) -> Array:
    """Return the control points (m, 3) of homogeneous coefficients (p+1, 4, n)."""
    return np.moveaxis(homogeneous[:, :3] / homogeneous[:, 3:], 1, -1).reshape(-1, 3)


def _velocity_numerator(numerator: Array, weight: Array) -> Array:
    """Return N' W - N W', of formal degree 2 p - 1: the velocity of N / W by the local parameter, times W^2."""
    p = len(weight) - 1
    if (weight == 1).all():
        return p * np.diff(numerator, axis=0)
    rate, change = p * np.diff(numerator, axis=0), p * np.diff(weight, axis=0)
    return multiply_polynomials(rate, weight) - multiply_polynomials(numerator, change)


def _cross_product(a: Array, b: Array) -> Array:
    """Return the cross product of polynomials (p+1, 3, n) and (q+1, 3, n)."""
    i, j = [1, 2, 0], [2, 0, 1]
    return multiply_polynomials(a[:, i], b[:, j]) - multiply_polynomials(a[:, j], b[:, i])


def _dot_product(a: Array, b: Array) -> Array:
    """Return the dot product (p+q+1, 1, n) of polynomials (p+1, k, n) and (q+1, k, n)."""
    return multiply_polynomials(a, b).sum(axis=1, keepdims=True)
