r"""What the coefficients of a finished blend prove: bounds that hold along the whole rail, not at samples of it.

They hold for the surface that is returned, the doubles in it, as OCCT evaluates them. Along one of its two boundaries a
blend H(t, v) has the rows of poles X, V, W: the homogeneous H, H_v and H_vv there. The primary gives, for the same t,
the jets P(c), DP d, .. of the ribbon and a normal N of its tangent plane, recomputed independently of the blend
(:mod:`cqblend.blends.quality.rail_reevaluation`). All quantities below are made of polynomials in t on every piece
between knots of the blend and places where the rail crosses knot lines
(:mod:`cqblend.blends.quality.blend_boundary`). They are formed by products of coefficients with known errors and
bounded by the hull of these (:mod:`cqblend.blends.quality.bounded_polynomials`). With a = H_t and b = H_v in space, n =
N/|N|, theta the angle between a and b, A = |n.a|/|a| and B = |n.b|/|b|:

*Gap.* D = H(t, 0) - S(c(t)) = (X w_S - P w_H)/(w_H w_S): the hull of the numerator over the least weights.

*Angle.* The blend's normal m = a x b has the part n x m = a (n.b) - b (n.a) in the primary's plane, so the angle phi
between the tangent planes of H at (t, 0) and of S at c(t) satisfies

.. math:: \sin^2 \varphi = \frac{|a\,(n \cdot b) - b\,(n \cdot a)|^2}{|a \times b|^2}
          \le \frac{A^2 + B^2 + 2 A B\, |\cos\theta|}{\sin^2\theta}

B is the determinant det[P, Pu, Pv, Hv] of Kim and Elber (section 2) over the lengths of its columns. A comes from the
rail: S(c)' is tangent, so n.a = n.D'. In an exact blend D is the rounding of poles, and D' is that rounding over the
length of a piece, up to 2 p |D|/h: on short pieces it dominates. Where breaks of the blend that nearly coincide have
been merged, D and D' between the original breaks are the error of a polynomial that is continued past its end: these
intervals are pieces like all others here.

*Jump of the normal curvature.* The ribbon's map G(t, v) = S(c + v d + v^2/2 e) parametrises the primary. Its jets give
the primary's second fundamental form, II(G_i, G_j) = n.G_ij for i, j in {t, v}, as quotients of splines, and those of H
give the blend's. With H_i = G_i + q_i, q_i = x_i G_t + y_i G_v + z_i n and H_ij = alpha a + beta b + gamma n, where

.. math:: x_i = \frac{N \cdot (q_i \times G_v)}{N \cdot (G_t \times G_v)},
          \quad y_i = \frac{N \cdot (G_t \times q_i)}{N \cdot (G_t \times G_v)},
          \quad \alpha = \frac{N \cdot (H_{ij} \times b)}{N \cdot (a \times b)},
          \quad \beta = \frac{N \cdot (a \times H_{ij})}{N \cdot (a \times b)},

the blend's unit normal m/|m|, which is orthogonal to a and b, gives

.. math:: m \cdot H_{ij} / |m| = \cos\varphi\, (n \cdot H_{ij} - \alpha\, n \cdot a - \beta\, n \cdot b)

and the primary's form takes the projections of H_i and H_j on its plane to II(G_i + q_i, G_j + q_j). Up to the factor
cos(phi) the two forms differ by at most

.. math:: \Delta_{ij} = |n \cdot (H_{ij} - G_{ij})| + |\alpha|\,|n \cdot a| + |\beta|\,|n \cdot b|
          + |II(G_i, q_j)| + |II(q_i, G_j)| + |II(q_i, q_j)|

From these three, |a|, |b| and theta follows the largest difference on unit vectors, in all directions of the plane; the
factor cos(phi), and projected unit vectors being shorter by up to that much, cost a share sin^2(phi) of the curvatures.
The weight of rational blends drops out: what its derivatives add to H_ij is a combination of a and b. D'' is in it, up
to 4 p^2 |D|/h^2. G_ij needs no quotients of differences: II(G_t, G_t) and II(G_t + x G_v, G_t + x G_v) come from second
derivatives along c' and c' + x d, whatever c', d and x are.

*Poles.* Where a rail is one point, a vanishes, and the blend has no tangent plane but that of its sections: phi is then
the largest angle between b and the primary's plane, B. Jumps of curvature are not bounded there.

*Evaluation.* Where derivatives are evaluated with errors of up to E_a, E_b, E_ij
(:mod:`cqblend.blends.quality.evaluation_rounding`), the plane of a and b turns by at most

.. math:: \psi = \frac{1}{\sin\theta} \Big(\frac{E_a}{|a|} + \frac{E_b}{|b|}\Big),

the form n.H_ij changes by E_ij + psi |H_ij|, and coordinates of unit vectors by a share psi. The same holds for S_u,
S_v and S_ij of the primary. What is measured differs by no more than that.

The bounds themselves are in :mod:`cqblend.blends.quality.rail_bounds`. Rounding of the computation is bounded with
the coefficients, product by product; P, its jets and N enter with an error of ``PROOF_TOLERANCES.composition``.
Positions are relative to a point of each piece (x - x_0 w), which limits cancellation far from the origin. The proof
uses only the finished surface and the ribbons, not how the blend was made.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from cqblend.blends.quality.blend_boundary import RibbonSide
from cqblend.blends.quality.bounded_polynomials import bound_largest
from cqblend.blends.quality.rail_bounds import bound_angle, bound_curvature_jump, bound_gap, bound_pole_angle
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.errors import InputError
from cqblend.splines import Surface
from cqblend.splines.bernstein import EPSILON

if TYPE_CHECKING:
    from cqblend.blends.sections.blend_surface import BlendSurface


@dataclass(frozen=True, slots=True)
class Proof:
    """Proven bounds of how far a blend is from meeting its surfaces, for every point of the rails.

    Attributes
    ----------
    gap : float
        Distance between H(t, 0) and S(c(t)), at most, mm.
    angle : float
        Angle between the normals there, at most, rad; pi where nothing is proven.
    curvature_jump : float or None
        Difference of the normal curvatures in any direction, at most, 1/mm; None as soon as it is not proven for one of
        the rails, as below G2.
    sides : tuple of Proof
        The same for each rail alone, in the order of the certificate's rails.

    Examples
    --------
    >>> first, second = Proof(2e-16, 3.1e-15, 4e-13), Proof(1e-16, 7.2e-15)
    >>> print(first)
    proven for the whole rail: gap <= 2.0e-16 mm, angle <= 3.1e-15 rad, curvature jump <= 4.0e-13 1/mm
    >>> print(first | second)
    proven for the whole rail: gap <= 2.0e-16 mm, angle <= 7.2e-15 rad
    >>> [side.curvature_jump for side in (first | second).sides]
    [4e-13, None]
    """

    gap: float
    angle: float
    curvature_jump: float | None = None
    sides: tuple[Proof, ...] = field(default=(), repr=False, compare=False)

    def __or__(self, other: Proof) -> Proof:
        """Return what is proven of the rails of both: the larger bounds."""
        sides = tuple(side for proof in (self, other) for side in proof.sides or (proof,))
        first, second = self.curvature_jump, other.curvature_jump
        jump = None if first is None or second is None else max(first, second)
        return Proof(max(self.gap, other.gap), max(self.angle, other.angle), jump, sides)

    def __str__(self) -> str:
        jump = "" if self.curvature_jump is None else f", curvature jump <= {self.curvature_jump:.1e} 1/mm"
        return f"proven for the whole rail: gap <= {self.gap:.1e} mm, angle <= {self.angle:.1e} rad{jump}"


def prove_blend(blend: BlendSurface, parameter_errors: tuple[float, float] = (0.0, 0.0)) -> Proof:
    """Prove how a blend meets both of its surfaces: the larger bounds of the two rails.

    The proof is about the B-spline that is exported, with its knots; ``parameter_errors`` are those of
    :func:`prove_side` for both rails.

    Raises
    ------
    InputError
        If the surface and a ribbon have different domains.
    """
    surface = Surface.from_bspline(*blend.surface.to_bspline())
    first, second = blend.ribbons
    return prove_side(surface, 0, first, parameter_error=parameter_errors[0]) | prove_side(
        surface, 1, second, parameter_error=parameter_errors[1]
    )


def prove_side(
    surface: Surface, end: Literal[0, 1], ribbon: Ribbon, order: int | None = None, parameter_error: float = 0.0
) -> Proof:
    """Prove how a surface meets the primary of a ribbon along its boundary v = first (``end`` 0) or last (1).

    Parameters
    ----------
    surface
        H(t, v), with the domain of the ribbon in t.
    end
        Which boundary.
    ribbon
        The ribbon that it is to meet; its directions matter from order 2 on.
    order
        0 for the gap and the angle alone, 2 for the jump of curvature as well; by default that of the ribbon.
    parameter_error
        By how much the native parameters at which the primary is evaluated may be off the rail's, where they are
        angles.

    Raises
    ------
    InputError
        If the surface and the ribbon have different domains.
    """
    order = ribbon.order if order is None else order
    (a, b), (c, d) = surface.domain[0], ribbon.c.domain
    if max(abs(a - c), abs(b - d)) > 8 * EPSILON * max(abs(a), abs(b)):
        raise InputError(f"the surface runs over t = [{a:.9g}, {b:.9g}], its ribbon over [{c:.9g}, {d:.9g}]: clip one")
    side = RibbonSide(surface, end, ribbon, 2 if order >= 2 else 1, parameter_error)
    gap = bound_largest(side.collect_gap_polynomials(), bound_gap) + side.parameter_shift
    if ribbon.is_point:
        angle = bound_largest(side.polynomials, bound_pole_angle)
        return Proof(gap, angle if angle < np.pi / 2 else np.pi)
    angle = bound_largest(side.polynomials, bound_angle)
    if not angle < np.pi / 2:
        return Proof(gap, np.pi)
    if order < 2:
        return Proof(gap, angle)
    sine = np.sin(angle)
    jump = bound_largest(side.collect_curvature_polynomials(), lambda low, high: bound_curvature_jump(low, high, sine))
    return Proof(gap, angle, jump if np.isfinite(jump) else None)
