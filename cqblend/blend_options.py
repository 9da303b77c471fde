"""What a caller asks of a blend, checked once.

Holds `BlendRequest`, the options of `cqblend.blend_edges` as a frozen value in which every field makes sense on its
own. It exists so that the core never meets a string for a radius, and so that an option that is not built yet raises
instead of being ignored. It must not know the shape: whether a radius fits is the core's business.
"""

import math
from dataclasses import dataclass, replace
from functools import partial
from numbers import Integral
from typing import TYPE_CHECKING, Any, Literal

from cqblend.checks import (
    check_angle,
    check_choice,
    check_count_or_auto,
    check_pair,
    check_positive,
    is_auto,
    is_default,
    refuse_ignored_options,
)
from cqblend.errors import InputError, SizeError, UnsupportedError, shown

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Face

    from cqblend.blends.potential.relations import Conic

ContinuityName = Literal["G0", "G1", "G2", "G3"]
TangentsName = Literal["parametric", "perpendicular", "chord"]
SectionName = Literal["hermite", "pde", "potential"]
FormWanted = Literal["auto", "exact", "compact"]
EndWanted = Literal["auto", "natural", "flat"]

# What is built, and what is part of the interface but not built yet.
CONTINUITIES: tuple[ContinuityName, ...] = ("G0", "G1", "G2", "G3")
_TANGENTS: tuple[TangentsName, ...] = ("parametric", "perpendicular", "chord")
_TANGENTS_LATER = ("guide", "combination")
_SECTIONS: tuple[SectionName, ...] = ("hermite", "pde", "potential")
FORMS: tuple[FormWanted, ...] = ("auto", "exact", "compact")
_ENDS: tuple[EndWanted, ...] = ("auto", "natural", "flat")

PDE_ORDERS = (2, 4, 6)  # of partial differential equations
MAX_TERMS, MAX_MODES = 100, 500  # across and along: far more than any blend takes
MAX_COLLOCATION_POINTS = 500  # of collocation, in either direction

DEFAULT_TOLERANCE, DEFAULT_ANGULAR_TOLERANCE = 1e-7, 1e-5
"""Of the compact form, mm and rad."""

G0_HAS_NO_CROSS_FIELD = "on a blend that is G0 on both sides, which has no cross derivatives"
EXACT_FORM_IS_EXACT = 'on form="exact", which keeps rails and tangent planes to rounding'

DEFAULT_STEER = math.radians(20)
"""rad. More than that, a turn would show in the shape of the blend."""

MIN_SIZE = 1e-6
"""Ten times OCCT's default tolerance, mm: below it an edge cannot be told from its blend."""

MAX_SIZE = 1e9
"""mm. Above it neighbouring doubles lie further apart than OCCT's default tolerance of 1e-7."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BlendRequest:
    """The options of `cqblend.blend_edges`, in one form. Make it with `BlendRequest.checked`.

    Attributes
    ----------
    radius : float or None
        Radius of the rolling ball, mm. Exactly one of radius and width is given, but for the potential section.
    width : tuple of float or None
        Distance of the rails from the edge on side 1 and on side 2, mm.
    continuity : tuple of {"G0", "G1", "G2", "G3"}
        Order to which the blend meets its neighbours, on side 1 and on side 2.
    tangents : tuple of {"parametric", "perpendicular", "chord"}
        The fields of cross directions.
    bulge : tuple of float
        Factors on the length of the cross derivatives.
    steer : float
        Largest angle by which directions are turned so that the blend has no crease inside, rad.
    crease : float or None
        How sharp creases inside may be, rad; None for the angular tolerance, or what the faces themselves have.
    section : {"hermite", "pde", "potential"}
        How the interior is filled.
    relation : Conic or None
        How far side 1 and side 2 are moved together (mm), for the potential section; None for others.
    order : tuple of int or None
        Of the partial differential equations of x, y and z; None for other sections.
    parameters
        Their shape parameters, None for those that count in lengths.
    terms : int or None
        Number of their terms across, None for as many as it takes.
    form : {"auto", "exact", "compact"}
        Which form of the blend is wanted; see `cqblend.Certificate`.
    tolerance, angular_tolerance : float
        Of the compact form, mm and rad.
    ends : tuple of {"auto", "natural", "flat"}
        How the blend ends at the start and at the end of an open edge.
    first : TopoDS_Face or None
        The face that counts as side 1.
    """

    radius: float | None
    width: tuple[float, float] | None
    continuity: tuple[ContinuityName, ContinuityName]
    tangents: tuple[TangentsName, TangentsName]
    bulge: tuple[float, float]
    steer: float
    crease: float | None
    section: SectionName
    relation: "Conic | None"
    order: tuple[int, int, int] | None
    parameters: Any
    terms: int | None
    form: FormWanted
    tolerance: float
    angular_tolerance: float
    ends: tuple[EndWanted, EndWanted]
    first: "TopoDS_Face | None"

    @classmethod
    def from_options(
        cls,
        radius: object = None,
        *,
        width: object = None,
        continuity: object = None,
        tangents: object = "perpendicular",
        bulge: object = 1.0,
        steer: object = DEFAULT_STEER,
        crease: object = None,
        section: object = "hermite",
        a: object = None,
        b: object = None,
        lam: Any = None,
        order: object = None,
        parameters: Any = None,
        terms: object = "auto",
        form: object = "auto",
        tolerance: object = DEFAULT_TOLERANCE,
        angular_tolerance: object = DEFAULT_ANGULAR_TOLERANCE,
        ends: object = "auto",
        first: "TopoDS_Face | None" = None,
    ) -> "BlendRequest":
        """Check the options of `cqblend.blend_edges` and bring them to one form.

        Raises
        ------
        InputError
            An option is of the wrong type, not finite, out of range or unknown, or not exactly one of radius and width
            is given.
        SizeError
            The radius or a width is below `SMALLEST`.
        UnsupportedError
            The option is part of the interface but not built yet.

        Examples
        --------
        >>> BlendRequest.checked(width=3).width
        (3.0, 3.0)
        >>> BlendRequest.checked(-1)
        Traceback (most recent call last):
        ...
        cqblend.errors.InputError: radius must be above 0, not -1
        """
        section = check_choice("section", section, _SECTIONS)
        relation = None
        if section == "potential":
            _refuse_options(section, radius=radius, width=width)
            _refuse_options(
                section,
                tangents=not is_default(tangents, "perpendicular"),
                bulge=not is_default(bulge, 1.0),
                steer=not is_default(steer, DEFAULT_STEER),
            )
            relation = _build_relation(a, b, lam)
        else:
            _refuse_options(section, a=a, b=b, lam=lam)
            if (radius is None) == (width is None):
                given = "neither" if radius is None else "both"
                raise InputError(f"give exactly one of radius and width, not {given}")
        continuity, orders = _check_continuity(continuity, section, order, parameters, terms)
        if continuity == ("G0", "G0"):
            refuse_ignored_options(
                G0_HAS_NO_CROSS_FIELD,
                tangents=(tangents, "perpendicular"),
                bulge=(bulge, 1.0),
                steer=(steer, DEFAULT_STEER),
            )
        return cls(
            radius=None if radius is None else _check_size("radius", radius),
            width=None if width is None else check_pair("width", width, _check_size),
            continuity=continuity,
            tangents=check_pair("tangents", tangents, partial(check_choice, built=_TANGENTS, later=_TANGENTS_LATER)),
            bulge=check_pair("bulge", bulge, check_positive),
            steer=check_angle("steer", steer),
            crease=None if crease is None else check_angle("crease", crease),
            section=section,
            relation=relation,
            order=orders,
            parameters=parameters,
            terms=check_count_or_auto("terms", terms, MAX_TERMS),
            form=check_choice("form", form, FORMS),
            tolerance=check_positive("tolerance", tolerance),
            angular_tolerance=check_positive("angular_tolerance", angular_tolerance),
            ends=check_pair("ends", ends, partial(check_choice, built=_ENDS), each="end of the edge"),
            first=first,
        )

    @property
    def lengths(self) -> tuple[float, ...]:
        """The lengths (mm) that set how large a blend is."""
        if self.relation is not None:
            return self.relation.a, self.relation.b
        return (self.radius,) if self.radius is not None else self.width or (0.0,)

    def with_scaled_lengths(self, factor: float) -> "BlendRequest":
        """Return the same request for another size: all lengths that set it, times a factor."""
        conic = self.relation
        return replace(
            self,
            radius=None if self.radius is None else self.radius * factor,
            width=None if self.width is None else (self.width[0] * factor, self.width[1] * factor),
            relation=None if conic is None else type(conic)(conic.a * factor, conic.b * factor, conic.lam * factor**2),
        )


def _check_continuity(
    continuity: object, section: SectionName, order: object, parameters: object, terms: object
) -> tuple[tuple[ContinuityName, ContinuityName], tuple[int, int, int] | None]:
    """Return the continuity on both sides, and the orders of the equations that give it."""
    if section != "pde":
        _refuse_options(section, order=order, parameters=parameters, terms=None if is_auto(terms) else terms)
        wanted = check_pair(
            "continuity", "G1" if continuity is None else continuity, partial(check_choice, built=CONTINUITIES)
        )
        if section == "potential" and wanted != ("G1", "G1"):
            raise InputError(f"a potential blend is G1 on both sides, not {shown(continuity)}: leave continuity out")
        return wanted, None
    made = check_pde_orders(4 if order is None else order)
    follows: ContinuityName = CONTINUITIES[min(made) // 2 - 1]
    if continuity is not None:
        for asked in check_pair("continuity", continuity, partial(check_choice, built=CONTINUITIES)):
            if asked != follows:
                raise InputError(
                    f"continuity {asked} contradicts equations of order {_format_orders(made)}, which are {follows} "
                    "on both "
                    "sides: leave continuity out, or take order 2 for G0, 4 for G1, 6 for G2"
                )
    return (follows, follows), made


OPTIONS_OF_SECTION = {"pde": ("order", "parameters", "terms"), "potential": ("a", "b", "lam")}


def _refuse_options(section: SectionName, **given: object) -> None:
    """Raise InputError if an option was given that the section does not have."""
    for name, value in given.items():
        if value is not None and value is not False:
            owner = next((other for other, names in OPTIONS_OF_SECTION.items() if name in names), None)
            if owner is not None:
                raise InputError(f'{name} is an option of section="{owner}", not of {section!r}')
            way = ": a and b set how far it reaches" if name in ("radius", "width") else ": leave it out"
            raise InputError(f"{name} is no option of section={section!r}{way}")


def _build_relation(a: object, b: object, lam: Any) -> "Conic":
    """Return the relation of a potential section; each of a and b is the other one if it is left out."""
    from cqblend.blends.potential.relations import Conic  # which takes NumPy: ``import cqblend`` does not

    if a is None and b is None:
        raise InputError('section="potential" takes a and b, how far each side is moved (mm): give one or both')
    first, second = _check_size("a", b if a is None else a), _check_size("b", a if b is None else b)
    return Conic(first, second, 0.0 if lam is None else lam)


def _format_orders(made: tuple[int, int, int]) -> str:
    return str(made[0]) if len(set(made)) == 1 else str(made)


def check_pde_orders(order: object) -> tuple[int, int, int]:
    """Return the orders of partial differential equations for x, y and z: one for all, or three.

    Raises
    ------
    InputError
        If one is not 2, 4 or 6.
    """
    given = tuple(order) if isinstance(order, list | tuple) else (order,) * 3
    if len(given) != 3 or not all(isinstance(n, Integral) and n in PDE_ORDERS for n in given):
        raise InputError(f"order must be 2, 4 or 6, or three of them for x, y and z, not {shown(order)}")
    return int(given[0]), int(given[1]), int(given[2])


_RADIUS_PAIR_MESSAGE = (
    "radius must be a number, not {0}: a pair would mean a radius for each side, but a ball touches both with one; "
    "give width={0} for rails that far from the edge on side 1 and side 2. A radius that varies along the edge is "
    "not built yet: cut the faces into parts and blend these, or take OCCT's own fillet"
)


def _check_size(name: str, value: object) -> float:
    """Return a length that an edge can be blended with, as a float."""
    if callable(value):
        raise UnsupportedError(f"a {name} that varies along the edge is not built yet; give a number")
    if name == "radius" and isinstance(value, tuple | list) and len(value) == 2:
        raise InputError(_RADIUS_PAIR_MESSAGE.format(shown(value)))
    size = check_positive(name, value)
    if size < MIN_SIZE:
        raise SizeError(f"{name} {size:g} mm is below {MIN_SIZE:g} mm, ten times OCCT's tolerance; scale the model up")
    if size > MAX_SIZE:
        raise InputError(
            f"{name} {size:g} mm is above {MAX_SIZE:g} mm, where doubles are coarser than OCCT's tolerance"
        )
    return size
