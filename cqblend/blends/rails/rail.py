"""Rails that the caller gives: curves in the parameter plane of a surface, and Kim and Elber's cross directions there.

A blend leaves its surface S(u, v) along a rail c(t) = (u, v)(t) in a direction r Su + s Sv, which lies in the tangent
plane whatever (r, s) is. The paper ("A symbolic approach to freeform parametric surface blends", 1999, section 2.2)
chooses it in five ways; :class:`Rail` gives each as the paper's own vector field, an exact spline, and as the pair
(r, s) at parameters, which is cheap and what ribbons are fitted to. Depends on splines only.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cqblend.argument_checks import to_finite_array, to_point
from cqblend.blends.rails import regularity
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.errors import GeometryError, InputError, shown
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.self_intersection import is_closed
from cqblend.surfaces.vectors import cross_product, to_tangent_coordinates

RailSide: TypeAlias = Literal["left", "right"]
FieldName: TypeAlias = Literal["parametric", "perpendicular", "chord", "guide", "combination"]
FIELDS: tuple[FieldName, ...] = ("parametric", "perpendicular", "chord", "guide", "combination")


@dataclass(frozen=True)
class Rail:
    r"""A curve on a surface, along which a blend leaves it.

    Parameters
    ----------
    surface
        S(u, v) of dim 3, polynomial or rational.
    curve
        c(t) = (u, v)(t) of dim 2 in the domain of S, polynomial or rational, of any degree and any number of pieces, as
        long as its direction is continuous.
    side
        On which side of c, in the parameter plane, the blend lies: "left" is +90 degrees from c'. None leaves it open
        until :meth:`towards` decides.

    Raises
    ------
    InputError
        If the surface or curve has the wrong dim, side is none of these, or the curve leaves the surface's domain.
    GeometryError
        If the curve has no length, stands still, jumps, has a kink, meets itself (ends that meet are fine), or crosses
        a crease or a singular point of the surface. Messages name the parameter t.

    Examples
    --------
    >>> x, y = np.meshgrid([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], indexing="ij")
    >>> bowl = Surface.from_bspline((2, 2), ([0, 0, 0, 1, 1, 1],) * 2, np.stack([x, y, x * y * (2 - y)], -1))
    >>> rail = Rail(bowl, Curve.bezier([[0.1, 0.2], [0.5, 0.9], [0.9, 0.3]]), "left")
    >>> rail.curve3d().degree, rail.normal().degree, rail.field("perpendicular").degree
    (8, 12, 19)
    >>> t = np.array([0.25, 0.75])
    >>> (r, s), jet = rail.coordinates("perpendicular", t).T[..., None], bowl.jet(*rail.curve(t).T, order=1)
    >>> bool(np.allclose(rail.field("perpendicular")(t), r * jet[1, 0] + s * jet[0, 1], rtol=1e-14))
    True
    """

    surface: Surface
    curve: Curve
    side: RailSide | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.surface, Surface) or self.surface.dim != 3:
            raise InputError(f"a rail needs a Surface of dim 3, not {shown(self.surface)}; see cqblend.to_surface")
        if not isinstance(self.curve, Curve) or self.curve.dim != 2:
            given = f"one of dim {self.curve.dim}" if isinstance(self.curve, Curve) else shown(self.curve)
            raise InputError(f"a rail is a Curve of dim 2 in the surface's parameter plane, not {given}")
        if self.side is not None and not (isinstance(self.side, str) and self.side in ("left", "right")):
            raise InputError(f'the side of a rail is "left", "right" or None, not {shown(self.side)}')
        regularity.check_rail(self.surface, self.curve, self._space_curve)

    @cached_property
    def _space_curve(self) -> Curve:
        return self.surface.compose(self.curve)

    @property
    def domain(self) -> tuple[float, float]:
        """First and last parameter t."""
        return self.curve.domain

    @property
    def closed(self) -> bool:
        """Whether the rail ends in space where it starts."""
        return is_closed(self._space_curve)

    def curve3d(self) -> Curve:
        """Return C(t) = S(c(t)), exact, of degree m (p + q) for a rail of degree m on a surface of degrees (p, q)."""
        return self._space_curve

    def normal(self) -> Curve:
        """Return n(t) = (Su x Sv)(c(t)), not normalised, exact; of degree 2 m (p + q - 1) if all is polynomial."""
        return self._normal_curve

    @cached_property
    def _normal_curve(self) -> Curve:
        if not self.surface.rational:
            return self._compose_partial(1, 0).cross(self._compose_partial(0, 1))
        across, weight = self._homogeneous_normal
        scale = _extract_weight(self.curve)
        return _make_quotient(across if scale is None else across * (scale * scale), weight * weight * weight)

    @cached_property
    def _homogeneous_normal(self) -> tuple[Curve, Curve]:
        """Return (m, w) of a rational surface S = X / w: w^3 Su x Sv = m = w Xu x Xv + wv X x Xu + wu Xv x X.

        Numerators only, if the rail is itself rational with weight W: then m has lost two factors of W.
        """
        surface = self.surface
        homogeneous = Surface(surface.breaks, surface.coefs, continuity=surface.continuity)
        p, pu, pv = (
            _extract_numerator(homogeneous.derivative(*order).compose(self.curve)) for order in ((0, 0), (1, 0), (0, 1))
        )
        x, xu, xv = p[:3], pu[:3], pv[:3]
        return xu.cross(xv) * p[3] + x.cross(xu) * pv[3] + xv.cross(x) * pu[3], p[3]

    def _compose_partial(self, ku: int, kv: int) -> Curve:
        return self.surface.derivative(ku, kv).compose(self.curve)

    def _combine_partials(self, rs: Curve) -> Curve:
        """Return r Su + s Sv. For (u', v') that is C', more precise than the derivative of C on short pieces."""
        return self._compose_partial(1, 0) * rs[0] + self._compose_partial(0, 1) * rs[1]

    def field(self, name: FieldName, *operands: Rail | Curve) -> Curve:
        r"""Return one of the paper's cross-boundary tangent fields T(t), exact, of whatever degree that takes.

        ===============  ==========  ==========================================  =======================================
        name             paper       T                                           operands
        ===============  ==========  ==========================================  =======================================
        "parametric"     T1          :math:`\pm (v' S_u - u' S_v)`
        "perpendicular"  T2, eq. 5   :math:`\pm C' \times n`
        "chord"          T3, eq. 6   :math:`K - n \langle K, n \rangle /         the other rail
                                     \langle n, n \rangle,\; K = C_2 - C_1`
        "guide"          T4, eq. 6   the same                                    the guiding curve K(t), of dim 3
        "combination"    T5, eq. 7   :math:`r S_u + s S_v`                       the curve (r, s)(t), or two whose
                                                                                 difference it is
        ===============  ==========  ==========================================  =======================================

        Returns
        -------
        Curve
            Of dim 3, not normalised. T1 and T2 point to the rail's side, T3 towards the other rail; T4 and T5 are the
            caller's, sign included. T3 and T4 are rational.

        Raises
        ------
        InputError
            If the field needs a side and the rail has none, there is no field of that name, or the operands are not
            what it takes, on the rail's own domain.
        """
        rs = self.symbolic_coordinates(name, *operands)
        if rs is not None:
            return self._combine_partials(rs)
        if name == "perpendicular":
            return self._combine_partials(self.curve.derivative()).cross(self.normal()) * self._determine_sign()
        guide = self._make_guide_curve(name, operands)
        n = self._homogeneous_normal[0] if self.surface.rational else _extract_numerator(self.normal())
        weight = _extract_weight(guide)
        return _make_quotient(
            n.cross(_extract_numerator(guide).cross(n)), n.dot(n) if weight is None else n.dot(n) * weight
        )

    def symbolic_coordinates(self, name: FieldName, *operands: Rail | Curve) -> Curve | None:
        """Return the exact (r, s)(t) of a field, a curve of dim 2, where it does not depend on the surface.

        That is +-(v', -u') of "parametric" and the operand of "combination"; None for the other fields.

        Raises
        ------
        InputError
            As :meth:`field`.
        """
        counts = {"parametric": (0,), "perpendicular": (0,), "chord": (1,), "guide": (1,), "combination": (1, 2)}
        if not isinstance(name, str) or name not in counts:
            raise InputError(f"no field is named {shown(name)}: choose one of {', '.join(FIELDS)}")
        if len(operands) not in counts[name]:
            raise InputError(
                f'the field "{name}" takes {" or ".join(map(str, counts[name]))} operands, not {len(operands)}'
            )
        if name == "parametric":
            turn, rate = self._determine_sign(), self.curve.derivative()
            return Curve.stack([rate[1] * turn, rate[0] * -turn])
        if name == "combination":
            first, *rest = (self._check_operand(name, operand, 2) for operand in operands)
            return first - rest[0] if rest else first
        return None

    def coordinates(self, name: FieldName, t: ArrayLike, *operands: Rail | Curve) -> Array:
        """Return numbers (r, s), shape (n, 2), with r Su + s Sv the value of :meth:`field` at t (n,).

        From the first partial derivatives alone: with E, F, G the coefficients of the first fundamental form, T2 is
        +-(C'.Sv, -C'.Su), and T3 and T4 are (G K.Su - F K.Sv, E K.Sv - F K.Su) / (E G - F^2).

        Raises
        ------
        InputError
            As :meth:`field`.
        """
        t = _check_parameters(t)
        rs = self.symbolic_coordinates(name, *operands)
        if rs is not None:
            return rs(t)
        jet, rate = self._evaluate_jet(t)
        if name == "perpendicular":
            return self._determine_sign() * np.stack([(rate * jet[2]).sum(-1), -(rate * jet[1]).sum(-1)], axis=-1)
        return to_tangent_coordinates(jet, self._make_guide_curve(name, operands)(t))

    def _evaluate_jet(self, t: Array) -> tuple[Array, Array]:
        """Return (S, Su, Sv), (3, n, 3), and C' (n, 3) at t."""
        c, rate = self.curve.jet(t, 1)
        jet = self.surface.jet(c[:, 0], c[:, 1], 1)
        return np.stack([jet[0, 0], jet[1, 0], jet[0, 1]]), rate[:, :1] * jet[1, 0] + rate[:, 1:] * jet[0, 1]

    def _determine_sign(self) -> int:
        """Return +1 for the right side, on which (v', -u') and C' x n are, -1 for the left."""
        if self.side is None:
            raise InputError(
                'this field points to one side of the rail, and the rail has none: give side="left" or "right", or '
                "choose it with rail.towards(other)"
            )
        return 1 if self.side == "right" else -1

    def _make_guide_curve(self, name: FieldName, operands: tuple[Rail | Curve, ...]) -> Curve:
        """Return K(t) of T3 and T4."""
        (operand,) = operands
        if name == "guide":
            return self._check_operand(name, operand, 3)
        if not isinstance(operand, Rail):
            raise InputError(f'the field "chord" takes the other Rail, not {shown(operand)}')
        return self._check_operand(name, operand.curve3d(), 3) - self._space_curve

    def _check_operand(self, name: str, operand: object, dim: int) -> Curve:
        if not isinstance(operand, Curve) or operand.dim != dim:
            given = f"one of dim {operand.dim}" if isinstance(operand, Curve) else shown(operand)
            raise InputError(f'the field "{name}" takes a Curve of dim {dim}, not {given}')
        (a, b), (c, d) = self.domain, operand.domain
        if max(abs(a - c), abs(b - d)) > RAIL_TOLERANCES.operand_domain_slack * max(abs(a), abs(b)):
            raise InputError(
                f'the field "{name}" takes what runs over the rail\'s domain, [{a:.9g}, {b:.9g}], not over '
                f"[{c:.9g}, {d:.9g}]; use .reparametrized({a:.9g}, {b:.9g})"
            )
        return operand

    def towards(self, target: Rail | ArrayLike) -> Rail:
        """Return the rail with the side on which another one, or a point (3,), lies.

        That is told by the whole rail: with a = C' x n, which points to its right, and K from it to the other rail at
        the same t, or to the point, by the cosine <a, K> / (|a| |K|) along its length. Two thirds of it must agree.

        Raises
        ------
        InputError
            If the target is neither, or runs over another domain.
        GeometryError
            If the two sides are too even, or the target lies on the rail: give a side instead. The message says how
            even, and at which t the sign changes first, or is none.
        """
        t = regularity.sample_stations(self._space_curve.breaks)
        if isinstance(target, Rail):
            other = self._check_operand("chord", target.curve3d(), 3)
            t = np.union1d(t, regularity.sample_stations(np.clip(other.breaks, *self.domain)))
            there = other(t)
        else:
            found = to_point(target)
            if found is None:
                raise InputError(f"a rail turns towards another Rail or a point of three numbers, not {shown(target)}")
            there = found
        jet, rate = self._evaluate_jet(t)
        across, chord = cross_product(rate, cross_product(jet[1], jet[2])), there - jet[0]
        size = np.linalg.norm(across, axis=-1) * np.linalg.norm(chord, axis=-1)
        cosine = (across * chord).sum(axis=-1) / np.maximum(size, np.finfo(float).tiny)
        cosine[np.abs(cosine) <= RAIL_TOLERANCES.undecided_cosine] = 0
        weight = np.gradient(t) * np.linalg.norm(rate, axis=-1)
        right, left = float(weight @ np.maximum(cosine, 0)), float(weight @ np.maximum(-cosine, 0))
        share = right / (right + left) if right + left > 0 else 0.5
        lengths = np.linalg.norm(chord, axis=-1)
        meeting = lengths <= RAIL_TOLERANCES.undecided_cosine * lengths.max()
        if meeting.any() or not max(share, 1 - share) >= RAIL_TOLERANCES.decisive_share:
            at = float(t[meeting.argmax()]) if meeting.any() else _find_sign_change(t, cosine, np.zeros_like(cosine))
            raise GeometryError(
                f"the side of the rail cannot be told: at t = {at:.9g}, what it should point to is neither to its left "
                f"nor to its right, and along the whole rail {1 - share:.0%} speak for the left, {share:.0%} for the "
                'right; give side="left" or "right"'
            )
        return self._with_side("right" if share > 0.5 else "left")

    def _with_side(self, side: RailSide) -> Rail:
        """Return the same rail, which needs no second check, with a side."""
        rail = copy.copy(self)
        object.__setattr__(rail, "side", side)
        return rail

    def check_direction(self, rs: ArrayLike, t: ArrayLike) -> None:
        """Check that directions r Su + s Sv, (n, 2), at increasing t (n,) stay on one side of the rail.

        Raises
        ------
        GeometryError
            If one is zero or parallel to the rail, or passes from one side to the other between two of the parameters:
            det(c', (r, s)) = 0 there, and the blend would have no tangent plane. The message names t.
        """
        t, rs = _check_parameters(t), to_finite_array("directions (r, s)", rs)
        if rs.shape != (len(t), 2) or not len(t):
            raise InputError(f"directions (r, s) at {len(t)} parameters have shape {(len(t), 2)}, not {rs.shape}")
        jet, rate = self._evaluate_jet(t)
        vectors = rs[:, :1] * jet[1] + rs[:, 1:] * jet[2]
        across = cross_product(vectors, rate)
        size = np.linalg.norm(vectors, axis=-1) * np.linalg.norm(rate, axis=-1)
        normal = cross_product(jet[1], jet[2])
        at = _find_sign_change(
            t, (across * normal).sum(axis=-1), RAIL_TOLERANCES.parallel_sine * size * np.linalg.norm(normal, axis=-1)
        )
        if at is not None:
            raise GeometryError(
                f"the direction of the blend is zero or parallel to the rail at t = {at:.9g}, so that the two "
                f"span no tangent plane; choose other tangents there"
            )

    def reverse(self) -> Rail:
        """Return the rail run backwards over the same domain; its side stays where it is in space."""
        opposite: dict[RailSide | None, RailSide | None] = {"left": "right", "right": "left", None: None}
        return Rail(self.surface, self.curve.reverse(), opposite[self.side])

    def reparametrized(self, t0: float, t1: float) -> Rail:
        """Return the rail with its parameter changed affinely, so that the domain becomes [t0, t1]."""
        return Rail(self.surface, self.curve.reparametrized(t0, t1), self.side)


def _check_parameters(t: object) -> Array:
    """Return parameters (n,)."""
    given = to_finite_array("t", t)
    if given.ndim != 1:
        raise InputError(f"t is an array of parameters of shape (n,), not {given.shape}")
    return given


def _find_sign_change(t: Array, values: Array, least: Array) -> float | None:
    """Return the first t at which a sampled function is zero up to ``least`` or changes its sign, else None."""
    if (zero := np.abs(values) <= least).any():
        return float(t[zero.argmax()])
    if not (changed := values * values[0] < 0).any():
        return None
    i = int(changed.argmax())
    before, after = values[i - 1], values[i]
    return float(t[i - 1] + (t[i] - t[i - 1]) * before / (before - after))


def _extract_numerator(curve: Curve) -> Curve:
    """Return w f of a rational curve f with weight w; f itself if it is polynomial."""
    return Curve(curve.breaks, curve.coefs[:, : curve.dim], continuity=curve.continuity)


def _extract_weight(curve: Curve) -> Curve | None:
    """Return w of a rational curve, of dim 1; None if it is polynomial."""
    return Curve(curve.breaks, curve.coefs[:, -1:], continuity=curve.continuity) if curve.rational else None


def _make_quotient(numerator: Curve, denominator: Curve) -> Curve:
    """Return the rational curve of a polynomial numerator and a polynomial denominator of dim 1."""
    both = Curve.stack([numerator, denominator])
    return Curve(both.breaks, both.coefs, rational=True, continuity=both.continuity)
