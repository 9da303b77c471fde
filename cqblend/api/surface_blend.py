"""Blends between surfaces: the front door for those who have surfaces and rails rather than a solid and an edge.

Two rails, each a curve in the parameter plane of a surface, need not touch nor belong to one body. Thin: checks what it
is given, and hands rails, fields and sections to :mod:`cqblend.blends`; OCCT is needed only for faces and measurements.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from cqblend.blend_options import (
    BLEND_DEFAULTS,
    CONTINUITIES,
    EXACT_FORM_IS_EXACT,
    FORMS,
    G0_HAS_NO_CROSS_FIELD,
)
from cqblend.blends.quality.creases import CreaseLimit, check_creases
from cqblend.blends.rails.direction_fit import DirectionFit, fit_ribbons_on_rails
from cqblend.blends.rails.rail import FIELDS, FieldName, Rail
from cqblend.blends.rails.regularity import sample_stations
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.sections import blend_surface
from cqblend.certificate import Certificate
from cqblend.checks import (
    call_user_function,
    check_angle,
    check_choice,
    check_integer,
    check_pair,
    check_positive,
    refuse_ignored_options,
    to_float_array,
)
from cqblend.errors import GeometryError, InputError, shown
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Face

Amount: TypeAlias = float | Curve | Callable[[Array], Any]
"""A number, or one that varies along the rail: a curve of dim 1, or a function of arrays of its parameter t."""

CrossLength: TypeAlias = Amount | Literal["field"] | None


@dataclass(frozen=True)
class Guide:
    """Kim and Elber's T4: the cross direction is the projection of a guiding curve K(t) on the tangent plane.

    For both sides at once, a second curve may be given; without it, K2 = -K1. Curves have dim 3, run over the rail's
    domain, and point into the blend.
    """

    first: Curve
    second: Curve | None = None

    def operands(self, side: int) -> tuple[Curve, ...]:
        """Return the guiding curve of side 0 or 1."""
        side = _check_side_index(self, side)
        return (self.first if side == 0 else -self.first if self.second is None else self.second,)


@dataclass(frozen=True)
class Combination:
    """Kim and Elber's T5: the cross direction r Su + s Sv, with a plane curve (r, s)(t), or the difference of two."""

    first: Curve
    second: Curve | None = None

    def operands(self, side: int) -> tuple[Curve, ...]:
        """Return the one curve or the two, the same on side 0 and 1."""
        _check_side_index(self, side)
        return (self.first,) if self.second is None else (self.first, self.second)


def _check_side_index(field: Guide | Combination, side: object) -> int:
    """Return side 0 or 1 of a field of cross directions that is made of one or two curves."""
    for curve in (field.first, field.second):
        if curve is not None and not isinstance(curve, Curve):
            raise InputError(f"a {type(field).__name__} is made of Curves, not {shown(curve)}")
    if field.first is None:
        raise InputError(f"a {type(field).__name__} takes a Curve")
    return check_integer("side", side, 0, 1)


Tangents: TypeAlias = FieldName | Guide | Combination


@dataclass(frozen=True)
class Blend(blend_surface.BlendSurface):
    """A blend surface H(t, v) between two rails, v = 0 on the first and 1 on the second.

    Attributes
    ----------
    surface : Surface
        H, over the domain of the first rail times [0, 1].
    ribbons : tuple of Ribbon
        What it is made from: rail and directions in the parameter planes.
    form : {"exact", "compact"}
    rails : tuple of Rail
        With the sides on which the blend lies.
    """

    rails: tuple[Rail, ...]

    @cached_property
    def certificate(self) -> Certificate:
        """How exact it is, measured by OCCT on the surfaces, and proven from their coefficients."""
        from cqblend.brep.verification.certify import certify_surfaces

        return certify_surfaces(self, self.traces)

    @property
    def traces(self) -> list[tuple[Surface, Curve]]:
        """What it meets: for each side a surface and a curve in its parameter plane."""
        return [(rail.surface, rail.curve) for rail in self.rails]

    def face(self) -> TopoDS_Face:
        """Return the face that covers it, of the same parameters. Wrap it with ``cadquery.Face(...)``."""
        from cqblend.brep.read.spline_conversion import to_face

        return to_face(self.surface)


def hermite_blend(
    rail1: Rail,
    rail2: Rail,
    *,
    tangents: Tangents | tuple[Tangents, Tangents] = "perpendicular",
    continuity: str | tuple[str, str] = "G1",
    bulge: Amount | tuple[Amount, Amount] = 1.0,
    length: CrossLength | tuple[CrossLength, CrossLength] = None,
    form: str = "auto",
    tolerance: float = BLEND_DEFAULTS.tolerance,
    angular_tolerance: float = BLEND_DEFAULTS.angular_tolerance,
    steer: float = BLEND_DEFAULTS.steer,
    crease: float | None = None,
) -> Blend:
    r"""Blend two surfaces along given rails.

    In homogeneous coordinates, with the ribbons' jets C, T, K, .. of both sides (T into the blend), the Hermite
    interpolant across; for G1 on both sides Kim and Elber's eq. (4),

    .. math:: H(t, v) = h_{00}(v) C_1(t) + h_{01}(v) C_2(t) + h_{10}(v) T_1(t) - h_{11}(v) T_2(t).

    Parameters
    ----------
    rail1, rail2
        The surfaces may be the same, touch or be apart. If the rails' domains differ, the second one's is changed to
        the first one's. A rail without a side has its blend towards the other rail.
    tangents
        Cross directions, for both sides or a pair: "perpendicular" (T2), "parametric" (T1), "chord" (T3),
        :class:`Guide` (T4) or :class:`Combination` (T5).
    continuity
        "G0", "G1", "G2" or "G3", for both sides or a pair.
    bulge
        Factor on the length of the cross derivative, for both sides or a pair: a number, a curve of dim 1 or a
        function of t.
    length
        Of the cross derivative before `bulge`, mm: None for the distance of the rails, "field" for that of the paper's
        unnormalised field, or as `bulge`.
    form
        "exact", "compact" or "auto", as in `cqblend.blend_edges`.
    tolerance, angular_tolerance
        Of the compact form, mm and rad.
    steer
        Largest angle by which directions are turned next to a knot line that the rail crosses, so that the blend has no
        crease inside, rad.
    crease
        How sharp a crease inside may be that steering leaves, rad. None for no sharper than `angular_tolerance`, or
        than what the surface itself has there.

    Raises
    ------
    InputError
        An argument is of the wrong type, out of range or unknown.
    GeometryError
        A cross direction vanishes or runs along its rail, G3 is asked of a surface that is not G3 or G2 of one whose
        curvature jumps, or the blend has a crease inside; messages name the parameter t.
    DegreeError
        The exact form would need a degree above 25.

    Notes
    -----
    Rails, directions and lengths are the caller's, and may make a surface that folds over itself:
    ``blend.certificate.valid`` tells.

    Examples
    --------
    >>> import cqblend
    >>> corners = [[[0, 0, 0], [0, 9, 0]], [[9, 0, 0], [9, 9, 0]]]
    >>> plane = cqblend.Surface.from_bspline((1, 1), ([0, 0, 9, 9], [0, 0, 9, 9]), corners)
    >>> rails = [cqblend.Rail(s, cqblend.Curve.bezier([[1, 1], [8, 1]])) for s in (plane, plane + [0, -3, 4])]
    >>> blend = cqblend.hermite_blend(*rails, continuity="G2")
    >>> blend.surface.degree, blend.form
    ((1, 5), 'exact')
    """
    orders = check_pair("continuity", continuity, partial(check_choice, built=CONTINUITIES))
    if orders == ("G0", "G0"):
        refuse_derivative_options(G0_HAS_NO_CROSS_FIELD, tangents, bulge, length, steer)
    rails, ribbons = prepare_rails(
        (rail1, rail2), (int(orders[0][1]), int(orders[1][1])), tangents, bulge, length, steer
    )
    form = check_choice("form", form, FORMS)
    if form == "exact":
        refuse_ignored_options(EXACT_FORM_IS_EXACT, tolerance=(tolerance, BLEND_DEFAULTS.tolerance))
    tolerance, angular_tolerance = (
        check_positive("tolerance", tolerance),
        check_positive("angular_tolerance", angular_tolerance),
    )
    allowed = CreaseLimit(angular_tolerance, None if crease is None else check_angle("crease", crease))
    made = blend_surface.blend_ribbons(ribbons, form, tolerance, angular_tolerance)
    check_creases(made, allowed)
    return Blend(made.surface, made.ribbons, made.form, rails)


def prepare_rails(
    given: tuple[Rail, Rail], orders: tuple[int, int], tangents: object, bulge: object, length: object, steer: object
) -> tuple[tuple[Rail, Rail], tuple[Ribbon, Ribbon]]:
    """Check two rails and what is wanted along them; return them, with sides and one domain, and their ribbons.

    Raises
    ------
    CqblendError
        As :func:`hermite_blend`.
    """
    for rail in given:
        if not isinstance(rail, Rail):
            raise InputError(f"a blend of surfaces takes two cqblend.Rail, not {shown(rail)}")
    rail1, rail2 = given
    if rail2.domain != rail1.domain:
        rail2 = rail2.reparametrized(*rail1.domain)
    _check_senses(rail1, rail2)
    rails = (
        rail1 if rail1.side is not None else rail1.towards(rail2),
        rail2 if rail2.side is not None else rail2.towards(rail1),
    )
    if orders == (0, 0):
        refuse_ignored_options(G0_HAS_NO_CROSS_FIELD, bulge=(bulge, 1.0), steer=(steer, BLEND_DEFAULTS.steer))
    kinds = check_pair("tangents", tangents, _check_tangents)
    for kind in kinds:
        if isinstance(kind, Guide) and kind.second is not None and kinds[0] is not kinds[1]:
            raise InputError("the second curve of a Guide has no effect unless the Guide is that of both sides")
    bulges = check_pair("bulge", bulge, _check_amount)
    lengths = check_pair("length", length, _check_length)
    steer = check_angle("steer", steer)
    closed = rail1.closed and rail2.closed
    aims = []
    for i in (0, 1):
        side = _BlendSide(rails[i], rails[1 - i], kinds[i], i, lengths[i], bulges[i])
        side.check_inputs()
        if orders[i] and given[i].side is not None:
            side.check_side()
        aims.append(
            DirectionFit(
                rails[i], side.cross_derivatives, orders[i], closed and side.has_closed_field(), side.exact_direction
            )
        )
    return rails, fit_ribbons_on_rails((aims[0], aims[1]), steer)


def refuse_derivative_options(why: str, tangents: object, bulge: object, length: object, steer: object) -> None:
    """Raise InputError if an option of cross derivatives along rails was given where there are none."""
    refuse_ignored_options(
        why,
        tangents=(tangents, "perpendicular"),
        bulge=(bulge, 1.0),
        length=(length, None),
        steer=(steer, BLEND_DEFAULTS.steer),
    )


def curve_on(face: Any, edge: Any) -> Curve:
    """Return an edge of a face as a curve in the parameter plane of ``cqblend.to_surface(face)``.

    Parameters
    ----------
    face, edge : cadquery, build123d or TopoDS face and edge
        The edge as it is oriented in the face, if it is a seam.

    Raises
    ------
    SelectionError
        The edge is not one of the face.
    GeometryError
        Its curve in the parameter plane cannot be followed.
    """
    from cqblend.api.host_shapes import to_topods_edge, to_topods_face
    from cqblend.brep.read import pcurves

    return pcurves.read_edge_pcurve(to_topods_face(face, "face"), to_topods_edge(edge))


def projected(surface: Any, curve: Any, *, tolerance: float = 1e-7) -> Curve:
    """Project a curve in space onto a surface: return the curve of the foot points in the parameter plane.

    Parameters
    ----------
    surface : Surface or a face
    curve : Curve of dim 3 or an edge
    tolerance : float
        Largest distance between the surface's curve and the foot points, mm.

    Raises
    ------
    GeometryError
        A point of the curve has no foot inside the surface; the message names t.
    """
    from cqblend.api.host_shapes import to_topods_edge, to_topods_face
    from cqblend.brep.read import pcurves, spline_conversion

    if not isinstance(surface, Surface):
        surface = spline_conversion.to_surface(to_topods_face(surface, "surface"))
    if not isinstance(curve, Curve):
        curve = to_topods_edge(curve)
    return pcurves.project_to_parameters(surface, curve, check_positive("tolerance", tolerance))


@dataclass(frozen=True)
class _BlendSide:
    """What the cross derivatives along one rail are to be."""

    rail: Rail
    other: Rail
    tangents: Tangents
    number: int
    length: CrossLength
    bulge: Amount

    @property
    def _field_name(self) -> FieldName:
        if isinstance(self.tangents, Guide):
            return "guide"
        return "combination" if isinstance(self.tangents, Combination) else self.tangents

    @property
    def _field_operands(self) -> tuple[Any, ...]:
        if isinstance(self.tangents, Guide | Combination):
            return self.tangents.operands(self.number)
        return (self.other,) if self.tangents == "chord" else ()

    def field_coordinates(self, t: Array) -> Array:
        """Return the field's own (r, s), (n, 2), at t."""
        return self.rail.coordinates(self._field_name, t, *self._field_operands)

    def cross_derivatives(self, t: Array) -> Array:
        """Return the wanted cross derivatives (n, 3) at t."""
        rs, uv = self.field_coordinates(t), self.rail.curve(t)
        jet = self.rail.surface.jet(uv[:, 0], uv[:, 1], 1)
        vectors = rs[:, :1] * jet[1, 0] + rs[:, 1:] * jet[0, 1]
        size = np.linalg.norm(vectors, axis=1)
        if self.length is None:
            size = np.linalg.norm(self.other.curve3d()(t) - jet[0, 0], axis=1) / size
        elif isinstance(self.length, str):  # "field"
            size = np.ones_like(size)
        else:
            size = _evaluate_amount(self.length, t) / size
        return vectors * (size * _evaluate_amount(self.bulge, t))[:, None]

    def check_inputs(self) -> None:
        """Check what is given along the rail, and the field at stations, before it is divided by its length."""
        for name, curve in (("length", self.length), ("bulge", self.bulge)):
            if isinstance(curve, Curve) and curve.domain != self.rail.domain:
                (a, b), (c, d) = self.rail.domain, curve.domain
                raise InputError(
                    f"the {name} of rail {self.number + 1} runs over [{c:.9g}, {d:.9g}], its rail over [{a:.9g}, "
                    f"{b:.9g}]; use .reparametrized({a:.9g}, {b:.9g})"
                )
        t = sample_stations(self.rail.curve3d().breaks)
        self.rail.check_direction(self.field_coordinates(t), t)
        size = np.linalg.norm(self.cross_derivatives(t), axis=1)
        if not np.all(size > 0):
            raise GeometryError(
                f"the cross derivative at t = {t[size.argmin()]:.9g} of rail {self.number + 1} has no length: do the "
                "rails meet there? give a length"
            )
        self._check_jumps()

    def check_side(self) -> None:
        """Raise InputError if the direction, which has an own side, is on the other side of the rail than asked."""
        t = np.array([sum(self.rail.domain) / 2])
        (rate,), ((r, s),) = self.rail.curve(t, 1), self.field_coordinates(t)
        side = "left" if rate[0] * s - rate[1] * r > 0 else "right"
        if side != self.rail.side:
            raise InputError(
                f'side="{self.rail.side}" of rail {self.number + 1} has no effect: the {self._field_name} points '
                f"to its {side}; leave the side out, or turn the direction"
            )

    def _check_jumps(self) -> None:
        """Raise InputError where a curve that the field is made of jumps."""
        if not isinstance(self.tangents, Guide | Combination):
            return
        for curve in self.tangents.operands(self.number):
            t = curve.breaks[1:-1]
            jump = np.linalg.norm(curve(t) - curve(t, side="left"), axis=1)
            if len(t) and jump.max() > 1e-9 * np.abs(curve(t)).max():
                raise InputError(
                    f"the {type(self.tangents).__name__} of rail {self.number + 1} jumps at t = "
                    f"{t[jump.argmax()]:.6g}: a cross direction must be continuous"
                )

    def has_closed_field(self) -> bool:
        """Whether the cross derivative ends as it starts."""
        first, last = self.cross_derivatives(np.array(self.rail.domain))
        return bool(np.linalg.norm(first - last) <= 1e-9 * np.linalg.norm(first))

    @property
    def exact_direction(self) -> Curve | None:
        """The direction (r, s) as a curve, if it is the field's own, scaled by a number, of low degree, and C1.

        One that is less than C1, such as T1 of a rail that is no more than C1, would leave a crease in the blend: it is
        fitted.
        """
        if not isinstance(self.length, str) or not isinstance(self.bulge, float) or self.rail.curve.rational:
            return None
        rs = self.rail.symbolic_coordinates(self._field_name, *self._field_operands)
        return None if rs is None or rs.rational or (rs.continuity < 1).any() else rs * self.bulge


def _check_senses(rail1: Rail, rail2: Rail) -> None:
    """Raise GeometryError if two rails run in opposite senses, so that all sections would cross."""
    t = np.linspace(*rail1.domain, 65)
    one, two = rail1.curve3d()(t), rail2.curve3d()(t)
    if (np.diff(one, axis=0) * np.diff(two, axis=0)).sum() < 0:
        distances = [np.linalg.norm(one - other, axis=1).sum() for other in (two, two[::-1])]
        if distances[1] < distances[0]:
            raise GeometryError("the rails run in opposite senses, and the sections between them cross: .reverse() one")


def _evaluate_amount(amount: Amount, t: Array) -> Array:
    """Return what may vary along the rail at t (n,), above zero."""
    rule = "a length or bulge that is a function takes an array of parameters and returns as many numbers"
    given = to_float_array(
        f"{rule}, which", call_user_function(rule, amount, t) if callable(amount) else amount
    ).squeeze()
    if given.shape not in ((), t.shape):
        raise InputError(
            f"a length or bulge that is a function takes an array of parameters, here {len(t)}, and returns as many "
            f"numbers, or one, not an array of shape {given.shape}"
        )
    values = np.broadcast_to(given, t.shape)
    if not np.all(values > 0) or not np.all(np.isfinite(values)):
        worst = int(np.argmin(np.where(np.isfinite(values), values, -np.inf)))
        raise InputError(f"a length or bulge is {values[worst]:.4g} at t = {t[worst]:.6g}: it must be above 0")
    return values


def _check_tangents(name: str, value: object) -> Tangents:
    if isinstance(value, Guide | Combination):
        return value
    for known in FIELDS[:3]:
        if isinstance(value, str) and value == known:
            return known
    raise InputError(f"{name} must be one of {', '.join(FIELDS[:3])}, a Guide or a Combination, not {shown(value)}")


def _check_amount(name: str, value: object) -> Amount:
    if isinstance(value, Curve) and value.dim != 1:
        raise InputError(f"{name} must be a curve of dim 1, not {value.dim}")
    return value if callable(value) else check_positive(name, value)


def _check_length(name: str, value: object) -> CrossLength:
    if isinstance(value, str):
        if value != "field":
            raise InputError(f"{name} must be 'field', None, a number, a Curve or a function of t, not {shown(value)}")
        return "field"
    return None if value is None else _check_amount(name, value)
