r"""Strips: ruled surfaces that stand for parts of a surface, with a proven bound on their distance from it.

A strip is bounded by two isoparametric curves of a surface, its rails, and consists of the straight segments between
points of the same parameter, its rulings. Every point S(u, v) has its place on the ruling at u, at a fraction w(u, v)
that grows from 0 at the first rail to 1 at the second; so curves on the surface are mapped to the strip. Depends on
splines only.

References
----------
G. Elber: Model fabrication using surface layout projection (1995), section 2.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import InputError
from cqblend.patterns.strips.developability import bound_normal_turn
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import EPSILON, Array, multiply_polynomials


@dataclass(frozen=True, eq=False)
class RuledStrip:
    r"""A ruled surface R(u, w) = (1 - w) C1(u) + w C2(u) that stands for S(u, v), v0 <= v <= v1.

    Attributes
    ----------
    rails
        C1 = S(., v0) and C2 = S(., v1), of dim 3 (mm), over the same domain with the same breaks. One of them may be a
        single point, a pole of the surface.
    surface
        S, with the rulings in v.
    span
        (v0, v1).
    bound
        Proven: \|S(u, v) - R(u, w(u, v))\| <= bound, mm, for all u and v.
    transposed
        Whether ``surface`` is the surface that was divided with its parameters u and v exchanged.
    fraction_surface
        w as a scalar surface over the span; None for the foot of the perpendicular from S(u, v) on the ruling.

    Raises
    ------
    InputError
        If rails, surface or span are not of this form.

    Examples
    --------
    >>> parabola = np.array([[[0.0, 0, 0], [1, 0, 1], [2, 0, 0]], [[0, 3, 0], [1, 3, 1], [2, 3, 0]]])
    >>> surface = Surface.from_bspline((1, 2), ([0, 0, 1, 1], [0, 0, 0, 1, 1, 1]), parabola)
    >>> rails = surface.isoparametric(v=0.0), surface.isoparametric(v=1.0)
    >>> strip = RuledStrip(rails, surface, (0.0, 1.0), 0.5)
    >>> strip.find_fractions(0.3, [0.0, 0.25, 1.0])
    array([0.  , 0.25, 1.  ])
    """

    rails: tuple[Curve, Curve]
    surface: Surface
    span: tuple[float, float]
    bound: float
    transposed: bool = False
    fraction_surface: Surface | None = None

    def __post_init__(self) -> None:
        first, second = self.rails
        if (first.dim, second.dim, self.surface.dim) != (3, 3, 3):
            raise InputError(
                f"the rails and the surface of a strip have dim 3, not {first.dim}, {second.dim} and {self.surface.dim}"
            )
        if not np.array_equal(first.breaks, second.breaks):
            raise InputError("the rails of a strip need the same breaks: cut each at those of the other")
        start, end = self.surface.domain[1]
        if not start <= self.span[0] < self.span[1] <= end:
            raise InputError(f"the span {self.span} of a strip is not within v = {start:.9g} .. {end:.9g}")

    @property
    def ruling_parameter(self) -> str:
        """The parameter of the face, "u" or "v", that the rulings run along."""
        return "u" if self.transposed else "v"

    @cached_property
    def normal_turn(self) -> float:
        """Bound of the angle between the normals at the two ends of a ruling, rad."""
        return bound_normal_turn(self.rails)

    def find_fractions(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return the fractions w of points S(u, v), of the shape that u and v broadcast to.

        v is clamped to the span. Where a ruling is a single point (at a pole that both rails run into), fractions are
        those of v within the span.
        """
        u_at, v_at = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
        start, end = self.span
        v_at = np.clip(v_at, start, end)
        if self.fraction_surface is not None:
            found = self.fraction_surface(u_at, v_at)[..., 0]
        else:
            first, second = (rail(u_at) for rail in self.rails)
            chord = second - first
            square = (chord * chord).sum(axis=-1)
            dots = ((self.surface(u_at, v_at) - first) * chord).sum(axis=-1)
            shortest = 64 * EPSILON * max(float(np.abs(points).max(initial=0.0)) for points in (first, second))
            by_parameter = (v_at - start) / (end - start)
            found = np.divide(dots, square, out=by_parameter, where=square > shortest**2)
        found = np.where(v_at == start, 0.0, np.where(v_at == end, 1.0, found))
        return np.asarray(np.clip(found, 0.0, 1.0))

    def locate_points(self, u: Array, v: Array) -> Array:
        """Return the points (n, 3) of the strip that stand for S(u, v); u and v are clamped to its parameters."""
        u = np.clip(u, *self.rails[0].domain)
        first, second = (rail(u) for rail in self.rails)
        return np.asarray(first + self.find_fractions(u, v)[:, None] * (second - first))

    def to_ruled_surface(self) -> Surface:
        """Return R as a surface (u, w), of degree (p, 1), over w in [0, 1].

        The weights of rational rails are brought to a common one, so that w is the fraction along the ruling in space;
        that doubles the degree p unless they are proportional.
        """
        is_rational = any(rail.rational for rail in self.rails)
        first, second = (rail._to_rational() if is_rational else rail for rail in self.rails)
        degree = max(first.degree, second.degree)
        first, second = first.elevate(degree - first.degree), second.elevate(degree - second.degree)
        if not is_rational:
            return Surface.from_rows([first, second])
        w1, w2 = first.coefs[:, -1:], second.coefs[:, -1:]
        ratio = w2 / w1
        row1, row2 = first.coefs, second.coefs
        if np.ptp(ratio) <= 32 * EPSILON * ratio.max():
            row2 = row2 / ratio
        else:
            row1, row2 = multiply_polynomials(row1, w2), multiply_polynomials(row2, w1)
        row2 = np.concatenate([row2[:, :-1], row1[:, -1:]], axis=1)  # one and the same weight, to the last digit
        order = np.minimum(first.continuity, second.continuity)
        rows = [Curve(first.breaks, row, rational=True, continuity=order) for row in (row1, row2)]
        return Surface.from_rows(rows)
