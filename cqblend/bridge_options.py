"""The options of a bridge: one record that ``cqblend.bridge`` and ``Workplane.bridge`` share.

`BridgeOptions` holds them as a caller gives them: names, defaults and documentation stand there, and nowhere else.
`BridgeOptions.to_request` checks them. Light, since ``import cqblend`` loads it.
"""

from dataclasses import dataclass
from functools import partial
from typing import Literal

from cqblend.argument_checks import (
    check_angle,
    check_choice,
    check_flag,
    check_number,
    check_pair,
    check_positive,
    refuse_ignored_options,
)
from cqblend.blend_numbers import PDE_ORDERS, check_bulge
from cqblend.blend_options import (
    BLEND_DEFAULTS,
    CONTINUITIES,
    EXACT_FORM_IS_EXACT,
    FORMS,
    G0_HAS_NO_CROSS_FIELD,
    TANGENTS,
    ContinuityName,
    FormWanted,
    TangentsName,
)
from cqblend.errors import InputError, shown

BridgeSection = Literal["hermite", "pde"]

_BRIDGE_SECTIONS: tuple[BridgeSection, ...] = ("hermite", "pde")


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeOptions:
    """The options of `cqblend.bridge` and ``Workplane.bridge``, as a caller gives them.

    Attributes
    ----------
    continuity : {"G0", "G1", "G2", "G3"} or pair of them, default "G1"
        Continuity with the faces that stay, for both sides or a pair. With ``section="pde"`` the same on both sides,
        and "G2" at most: the equations have order 2, 4 or 6.
    bulge : float or pair of float, default 1.0
        Factor on the length of the cross derivatives, for both sides or a pair: below 1 the bridge turns off sooner,
        above 1 it goes on further in the direction in which it leaves.
    tangents : {"perpendicular", "parametric", "chord"} or pair of them, default "perpendicular"
        Direction in which the bridge leaves, for both sides or a pair: perpendicular to the rail in space,
        perpendicular to it in the parameters of the face, or towards the other rail.
    section : {"hermite", "pde"}, default "hermite"
        How the bridge is filled between the rails: by polynomials, or by partial differential equations, which carry
        more of the rails' shape into the middle.
    start : float, optional
        Where on side 2 the start of side 1 lands, as a share of the length of its rail, from 0 to 1. Both rails run
        counter-clockwise around what goes, seen from outside, from the first vertex of their boundary or wire. By
        default the start with the least twist.
    solid : bool, default True
        Whether the bridge is put into the bodies; if not, the result's shape is the bridge alone: one face, or a shell
        of several.
    form : {"auto", "exact", "compact"}, default "auto"
        ``"exact"``: exact rails and tangent planes; ``"compact"``: the spline of least degree within the tolerances;
        ``"auto"``: exact where that has degree 7 at most, else compact.
    tolerance : float, default 1e-07
        Largest distance between the rails of the compact form and the exact ones, mm.
    angular_tolerance : float, default 1e-05
        Largest angle between the tangent planes of the compact form and its neighbours', rad.
    steer : float, default 0.349
        Largest angle by which the directions are turned, next to where a rail crosses a knot line of its face, so that
        the bridge has no crease inside, rad. 0 turns nothing.
    crease : float, optional
        Largest angle of a crease inside a face of the bridge that steering leaves, rad. By default
        `angular_tolerance`, or the angle of the crease that the face itself has there.
    """

    continuity: str | tuple[str, str] = "G1"
    bulge: float | tuple[float, float] = 1.0
    tangents: str | tuple[str, str] = "perpendicular"
    section: str = "hermite"
    start: float | None = None
    solid: bool = True
    form: str = BLEND_DEFAULTS.form
    tolerance: float = BLEND_DEFAULTS.tolerance
    angular_tolerance: float = BLEND_DEFAULTS.angular_tolerance
    steer: float = BLEND_DEFAULTS.steer
    crease: float | None = None

    def to_request(self) -> "BridgeRequest":
        """Return the same options, checked, and each in one form.

        Raises
        ------
        InputError
            An option is of the wrong type, out of range or unknown, or has no effect beside another one.

        Examples
        --------
        >>> BridgeOptions(continuity=("G1", "G2")).to_request().orders
        (1, 2)
        """
        continuity = check_pair("continuity", self.continuity, partial(check_choice, built=CONTINUITIES))
        section = check_choice("section", self.section, _BRIDGE_SECTIONS)
        if continuity == ("G0", "G0"):
            refuse_ignored_options(
                G0_HAS_NO_CROSS_FIELD,
                tangents=(self.tangents, BRIDGE_DEFAULTS.tangents),
                bulge=(self.bulge, BRIDGE_DEFAULTS.bulge),
                steer=(self.steer, BRIDGE_DEFAULTS.steer),
            )
        form = check_choice("form", self.form, FORMS)
        if form == "exact" and section == "hermite":
            refuse_ignored_options(EXACT_FORM_IS_EXACT, tolerance=(self.tolerance, BRIDGE_DEFAULTS.tolerance))
        request = BridgeRequest(
            continuity=continuity,
            bulge=check_pair("bulge", self.bulge, check_bulge),
            tangents=check_pair("tangents", self.tangents, partial(check_choice, built=TANGENTS)),
            section=section,
            start=None if self.start is None else check_number("start", self.start),
            solid=check_flag("solid", self.solid),
            form=form,
            tolerance=check_positive("tolerance", self.tolerance),
            angular_tolerance=check_positive("angular_tolerance", self.angular_tolerance),
            steer=check_angle("steer", self.steer),
            crease=None if self.crease is None else check_angle("crease", self.crease),
        )
        if request.start is not None and not 0 <= request.start <= 1:
            raise InputError(f"start is a share of the length of side 2, from 0 to 1, not {request.start:g}")
        if section == "pde" and (continuity[0] != continuity[1] or request.equation_order not in PDE_ORDERS):
            raise InputError(
                f"continuity={shown(self.continuity)} is not that of equations, which give G0, G1 or G2 on both sides: "
                'take one of these, or section="hermite"'
            )
        return request


BRIDGE_DEFAULTS = BridgeOptions()
"""The options if none is given: the source of every default."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeRequest:
    """The options of a bridge after `BridgeOptions.to_request`: checked, pairs always pairs, numbers floats."""

    continuity: tuple[ContinuityName, ContinuityName]
    bulge: tuple[float, float]
    tangents: tuple[TangentsName, TangentsName]
    section: BridgeSection
    start: float | None
    solid: bool
    form: FormWanted
    tolerance: float
    angular_tolerance: float
    steer: float
    crease: float | None

    @property
    def orders(self) -> tuple[int, int]:
        """The orders of continuity, by side."""
        first, second = self.continuity
        return int(first[1]), int(second[1])

    @property
    def equation_order(self) -> int:
        """The order of the equations of a pde section with the continuity of side 1."""
        return 2 * (self.orders[0] + 1)
