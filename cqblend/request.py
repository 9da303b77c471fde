"""What a caller asks of a blend, checked once.

Holds `BlendRequest`, the options of `cqblend.blend_edges` as a frozen value in which every field makes sense on its
own. It exists so that the core never meets a string for a radius, and so that an option that is not built yet raises
instead of being ignored. It must not know the shape: whether a radius fits is the core's business.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from numbers import Integral, Real
from typing import TYPE_CHECKING, Literal, TypeVar

from cqblend.errors import InputError, SizeError, UnsupportedError, shown

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Face

Continuity = Literal["G0", "G1", "G2", "G3"]
Tangents = Literal["parametric", "perpendicular", "chord"]
Section = Literal["hermite"]
FormWanted = Literal["auto", "exact", "compact"]

# What is built, and what is part of the interface but not built yet.
CONTINUITY: tuple[Continuity, ...] = ("G0", "G1", "G2", "G3")
_TANGENTS: tuple[Tangents, ...] = ("parametric", "perpendicular", "chord")
_TANGENTS_LATER = ("guide", "combination")
_SECTION: tuple[Section, ...] = ("hermite",)
_SECTION_LATER = ("pde", "potential")
FORM: tuple[FormWanted, ...] = ("auto", "exact", "compact")

Chosen = TypeVar("Chosen", bound=str)
Checked = TypeVar("Checked")

STEER = math.radians(20)
"""rad. More than that, a turn would show in the shape of the blend."""

SMALLEST = 1e-6
"""Ten times OCCT's default tolerance, mm: below it an edge cannot be told from its blend."""

LARGEST = 1e9
"""mm. Above it neighbouring doubles lie further apart than OCCT's default tolerance of 1e-7."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BlendRequest:
    """The options of `cqblend.blend_edges`, in one form. Make it with `BlendRequest.checked`.

    Attributes
    ----------
    radius : float or None
        Radius of the rolling ball, mm. Exactly one of radius and width is given.
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
    section : {"hermite"}
        How the interior is filled.
    form : {"auto", "exact", "compact"}
        Which form of the blend is wanted; see `cqblend.Certificate`.
    tolerance, angular_tolerance : float
        Of the compact form, mm and rad.
    first : TopoDS_Face or None
        The face that counts as side 1.
    """

    radius: float | None
    width: tuple[float, float] | None
    continuity: tuple[Continuity, Continuity]
    tangents: tuple[Tangents, Tangents]
    bulge: tuple[float, float]
    steer: float
    section: Section
    form: FormWanted
    tolerance: float
    angular_tolerance: float
    first: "TopoDS_Face | None"

    @classmethod
    def checked(
        cls,
        radius: object = None,
        *,
        width: object = None,
        continuity: object = None,
        tangents: object = "perpendicular",
        bulge: object = 1.0,
        steer: object = STEER,
        section: object = "hermite",
        form: object = "auto",
        tolerance: object = 1e-7,
        angular_tolerance: object = 1e-5,
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
        if (radius is None) == (width is None):
            given = "neither" if radius is None else "both"
            raise InputError(f"give exactly one of radius and width, not {given}")
        return cls(
            radius=None if radius is None else _size("radius", radius),
            width=None if width is None else pair("width", width, _size),
            continuity=pair(
                "continuity", "G1" if continuity is None else continuity, partial(choice, built=CONTINUITY)
            ),
            tangents=pair("tangents", tangents, partial(choice, built=_TANGENTS, later=_TANGENTS_LATER)),
            bulge=pair("bulge", bulge, positive),
            steer=turn("steer", steer),
            section=choice("section", section, _SECTION, _SECTION_LATER),
            form=choice("form", form, FORM),
            tolerance=positive("tolerance", tolerance),
            angular_tolerance=positive("angular_tolerance", angular_tolerance),
            first=first,
        )


def choice(name: str, value: object, built: tuple[Chosen, ...], later: tuple[str, ...] = ()) -> Chosen:
    """Return the built option that `value` names."""
    for option in built:
        if isinstance(value, str) and value == option:
            return option
    if isinstance(value, str) and value in later:
        raise UnsupportedError(f"{name}={value!r} is not built yet; use {_listed(built)}")
    raise InputError(f"{name} must be {_listed(built)}, not {shown(value)}")


def _listed(options: tuple[str, ...]) -> str:
    return " or ".join(map(repr, options))


def _size(name: str, value: object) -> float:
    """Return a length that an edge can be blended with, as a float."""
    if callable(value):
        raise UnsupportedError(f"a {name} that varies along the edge is not built yet; give a number")
    size = positive(name, value)
    if size < SMALLEST:
        raise SizeError(f"{name} {size:g} mm is below {SMALLEST:g} mm, ten times OCCT's tolerance; scale the model up")
    if size > LARGEST:
        raise InputError(f"{name} {size:g} mm is above {LARGEST:g} mm, where doubles are coarser than OCCT's tolerance")
    return size


def pair(name: str, value: object, check: Callable[[str, object], Checked]) -> tuple[Checked, Checked]:
    """Return one checked value a side from one value or a pair."""
    if not isinstance(value, tuple | list):
        checked = check(name, value)
        return checked, checked
    if len(value) != 2:
        raise InputError(f"{name} must be one value or a pair, one for each side, not {len(value)} values")
    return check(f"{name}[0]", value[0]), check(f"{name}[1]", value[1])


def flag(name: str, value: object) -> bool:
    """Return a value that is True or False."""
    if not isinstance(value, bool):
        raise InputError(f"{name} must be True or False, not {shown(value)}")
    return value


def count(name: str, value: object) -> int:
    """Return a whole number above 0."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 1:
        raise InputError(f"{name} must be a whole number above 0, not {shown(value)}")
    return int(value)


def turn(name: str, value: object) -> float:
    """Return an angle between 0 and a quarter turn, rad."""
    angle = positive(name, value, zero=True)
    if angle > math.pi / 2:
        raise InputError(f"{name} is an angle in radians, at most pi/2, not {angle:g}; math.radians converts degrees")
    return angle


def positive(name: str, value: object, *, zero: bool = False) -> float:
    """Return a finite number above 0 (or 0, if that is allowed) as a float. A bool is no number."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InputError(f"{name} must be a number, not {shown(value)}")
    try:
        number = float(value)
    except OverflowError:
        raise InputError(f"{name} must be finite, not a number of more than 308 digits") from None
    if not math.isfinite(number):
        raise InputError(f"{name} must be finite, not {number}")
    if number < 0 or (number == 0 and not zero):
        raise InputError(f"{name} must {'not be below' if zero else 'be above'} 0, not {number:g}")
    return number
