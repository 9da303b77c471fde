"""The options of a blend: one record that the function, the fluent method and the command line share.

`BlendOptions` holds the options of `cqblend.blend_edges` as a caller gives them: their names, defaults and
documentation stand there, and nowhere else. `BlendOptions.to_request` checks them and returns a `BlendRequest`, in
which every field has one form, so that no later stage meets a text for a radius, and no option is ignored. Whether a
radius fits the shape is not checked here. Light, since ``import cqblend`` loads it.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass, field, fields
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

from cqblend.argument_checks import (
    call_user_function,
    check_angle,
    check_choice,
    check_count_or_auto,
    check_flag,
    check_pair,
    check_positive,
    is_default,
    refuse_ignored_options,
)
from cqblend.blend_numbers import (
    OPTION_LIMITS,
    Size,
    build_relation,
    check_bulge,
    check_pde_orders,
    check_size,
)
from cqblend.errors import InputError, shown

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

    from cqblend.blends.potential.relations import Conic

GivenSize: TypeAlias = float | Callable[[Any], Any] | Mapping[Any, Any]
"""A size as a caller gives it: a number (mm), a function of t in [0, 1], or one of these for each of several edges."""

ContinuityName = Literal["G0", "G1", "G2", "G3"]
TangentsName = Literal["parametric", "perpendicular", "chord"]
SectionName = Literal["auto", "arc", "hermite", "pde", "potential"]
FormWanted = Literal["auto", "exact", "compact"]
EndWanted = Literal["natural", "flat", "auto"]
CornerWanted = Literal["auto", "ball", "cross", "setback", "mitre"]
OnError = Literal["raise", "skip"]

CONTINUITIES: tuple[ContinuityName, ...] = ("G0", "G1", "G2", "G3")
TANGENTS: tuple[TangentsName, ...] = ("parametric", "perpendicular", "chord")
SECTIONS: tuple[SectionName, ...] = ("auto", "arc", "hermite", "pde", "potential")
FORMS: tuple[FormWanted, ...] = ("auto", "exact", "compact")
ENDS: tuple[EndWanted, ...] = ("natural", "flat", "auto")
CORNERS: tuple[CornerWanted, ...] = ("auto", "ball", "cross", "setback", "mitre")
ON_ERROR: tuple[OnError, ...] = ("raise", "skip")

_TANGENTS_LATER = ("guide", "combination")
"""Cross directions that `cqblend.hermite_blend` has, and `cqblend.blend_edges` does not have yet."""

G0_HAS_NO_CROSS_FIELD = "on a blend that is G0 on both sides, which has no cross derivatives"
"""Completes "an option has no effect .."."""

EXACT_FORM_IS_EXACT = 'on form="exact", which keeps rails and tangent planes to rounding'
"""Completes "an option has no effect .."."""


_OF_PDE, _OF_POTENTIAL = {"section": "pde"}, {"section": "potential"}
"""Metadata of the options that only one section has."""


@dataclass(frozen=True, slots=True)
class BlendOptions:
    """The options of `cqblend.blend_edges`, ``Workplane.blend`` and ``cqblend blend``, as a caller gives them.

    Side 1 and side 2 are the two faces at an edge, see `first`. The rails are the curves on these faces at which the
    blend starts and ends.

    Attributes
    ----------
    radius : float, function or mapping, optional
        Radius of the ball that rolls along the edge and touches both faces on the rails, mm. Give either this or
        `width`, or, for the potential section, `a` and `b`. A radius that varies is a function of t, such as
        `cqblend.linear`, `cqblend.table` or any other, of arrays or of numbers: t runs from 0 to 1 by arc length, in
        the sense of the picked edge, of several the one with the lowest index in the shape; on a closed edge, from its
        vertex. Where it is 0 at an end, the blend ends there in a point. A mapping has a number or function for each
        picked edge; t runs along all edges that are blended in one, not along each.
    width : float, function, pair of these, or mapping, optional
        Straight distance from the edge to the rails, in the edge's normal plane, mm; a pair is for side 1 and side 2.
        As `radius`, it may vary, and be given for each edge. Not with the potential section.
    taper : float, optional
        Where edges go on tangentially, and a mapping gives them sizes that differ at the vertex between them: the
        length over which the sizes change there, mm, half of it on either side. By default, such sizes are refused.
    continuity : {"G0", "G1", "G2", "G3"} or pair of them, optional
        Order to which the blend meets its neighbours: touching, tangent, with the same curvature, with the same change
        of curvature. A pair is for side 1 and side 2. By default G1, or, with the pde section, what `order` gives. The
        potential section is G1.
    tangents : {"perpendicular", "parametric", "chord"} or pair of them, default "perpendicular"
        Direction in which the blend leaves its neighbours: perpendicular to the rail in space, perpendicular to it in
        the parameters of the face (on a sphere, about the rail's own axis), or towards the other rail (Kim and Elber's
        T2, T1, T3). With a radius that varies, the first is square to the path of the ball's centre instead. A pair is
        for side 1 and side 2. Not with the potential section.
    bulge : float or pair of float, default 1.0
        Factor on the length of the cross derivatives: below 1 flatter, above 1 fuller. A pair is for side 1 and side 2.
        Not with the potential section.
    steer : float, default 0.349
        Largest angle by which the directions are turned, next to where a rail crosses a knot line of its face, so that
        the blend has no crease inside, rad; by default 20 degrees. 0 turns nothing. Not with the potential section.
    crease : float, optional
        Largest angle of a crease inside the blend that steering leaves, rad. By default `angular_tolerance`, or the
        angle of the crease that the face itself has there.
    section : {"auto", "arc", "hermite", "pde", "potential"}, default "auto"
        How the blend is filled between the rails: ``"arc"``, by the arcs of the rolling ball, as a cylinder, a torus or
        a sphere: exact where the rails are straight, or circles about one axis, and refused elsewhere; ``"hermite"``,
        by polynomials, cubic across for G1, quintic for G2; ``"auto"``, by arcs where they are exact and go with all
        else that is asked for (a `radius`, G1, `tangents` perpendicular, `bulge` 1, a `form` that is not compact), else
        by polynomials; ``"pde"``, by partial differential equations (You and Zhang); ``"potential"``, by the curves in
        which both faces meet while they are moved along their normals (Lee, Bedi and Dubey), G1.
    a, b : float, optional
        Of the potential section, mm: side 1 is moved by a, which sets the reach on side 2, side 2 by b, which sets the
        reach on side 1. One of them is both if the other is left out.
    lam : float, optional
        Of the potential section, mm^2: lambda of `cqblend.Conic`, below a b. 0, the default, is an ellipse, less is
        sharper.
    order : {2, 4, 6} or three of them, optional
        Of the pde section: order of the equations, for x, y and z together or for each, as in `cqblend.pde_blend`.
        Orders 2, 4 (the default) and 6 are G0, G1 and G2, a mix such as (4, 4, 6) is as its lowest; `continuity`, if
        given, must agree.
    parameters : optional
        Of the pde section: shape parameters of the equations, as in `cqblend.pde_blend`. Functions are of t, from 0 to
        1 by length along all edges that are blended in one, as sizes are.
    terms : int, default "auto"
        Of the pde section: number of terms of the solution across the blend, as in `cqblend.pde_blend`; ``"auto"`` for
        as many as it takes.
    form : {"auto", "exact", "compact"}, default "auto"
        ``"exact"``: exact rails and tangent planes; ``"compact"``: the spline of least degree within the tolerances;
        ``"auto"``: exact where that has degree 7 at most, else compact.
    tolerance : float, default 1e-07
        Largest distance between the rails of the compact form and the exact ones, mm.
    angular_tolerance : float, default 1e-05
        Largest angle between the tangent planes of the compact form and its neighbours', rad.
    ends : {"natural", "flat", "auto"} or pair of them, default "natural"
        How the blend of an open edge ends: ``"natural"``, on whatever faces lie around its end; ``"flat"``, in a flat
        cap across the edge, which may stand some way before the vertex (``certificate.coverage`` says by how much);
        ``"auto"``, natural, and flat where that cannot be, at the vertex, with a `FlatEndWarning` for each such end. A
        pair is for the start and the end of the edge, in its own orientation; of a chain, in that of the picked edge
        with the lowest index. Where the size is 0, it ends in a point.
    corner : {"auto", "ball", "cross", "setback", "mitre"}, default "auto"
        How blends are put together at a vertex all of whose edges are blended, three or more: ``"ball"``, by a sphere
        between arcs, where one ball touches all faces there; ``"cross"``, by patches between blends that end where
        their rails cross; ``"setback"``, by patches between blends that end before that, and curves that round off the
        corners of the faces; ``"auto"``, at three edges by blends that go on around each other, elsewhere by the first
        of those that fits. Patches have common tangent planes with all around, to rounding, and no more: beside blends
        of G2, ``certificate.edges`` has the jump of curvature. Blends of two edges beside a sharp one always meet in a
        mitre, their intersection; ``"mitre"`` refuses all other corners.
    setback : float or mapping, optional
        Of ``corner="setback"``: the distance from the vertex at which blends end, along their edges, mm; a mapping has
        one for each of some picked edges. By default it follows from the widths and the angles of the faces.
    first : a face, optional
        The face that counts as side 1; by default the one with the lower index in the shape, of a chain the one at the
        picked edge with the lowest index. The side that it is on is side 1 all along the chain.
    on_error : {"raise", "skip"}, default "raise"
        What to do where edges cannot be blended: ``"raise"`` the error, and nothing is blended; or ``"skip"`` them and
        all edges that touch them, and blend the others: ``result.skipped`` has a record of each such network of edges.
        If nothing is left to blend, the error is raised.
    hold : edges or wires, optional
        Edges that take the place of a rail: each lies across one of the two faces beside a blended edge, along all of
        it, sharp or smooth. The ball of the given `radius` rolls along it and touches the other face only; the blend
        takes all of the face between, and is G0 at the held edge, in the direction of the ball. `continuity`, which is
        not a pair then, is that on the other side.
    chain : bool, default True
        Whether a blend goes on along edges that were not picked: past each end of an edge along the edge that continues
        it tangentially, as long as the faces on both sides go on smoothly, too. False blends just what was picked.
    """

    radius: GivenSize | None = None
    _: KW_ONLY
    width: GivenSize | tuple[GivenSize, GivenSize] | None = None
    taper: float | None = None
    continuity: str | tuple[str, str] | None = None
    tangents: str | tuple[str, str] = "perpendicular"
    bulge: float | tuple[float, float] = 1.0
    steer: float = math.radians(20)
    crease: float | None = None
    section: str = "auto"
    a: float | None = field(default=None, metadata=_OF_POTENTIAL)
    b: float | None = field(default=None, metadata=_OF_POTENTIAL)
    lam: float | None = field(default=None, metadata=_OF_POTENTIAL)
    order: int | tuple[int, int, int] | None = field(default=None, metadata=_OF_PDE)
    parameters: Any = field(default=None, metadata=_OF_PDE)
    terms: int | str = field(default="auto", metadata=_OF_PDE)
    form: str = "auto"
    tolerance: float = 1e-7
    angular_tolerance: float = 1e-5
    ends: str | tuple[str, str] = "natural"
    corner: str = "auto"
    setback: float | Mapping[Any, float] | None = None
    first: Any = None
    on_error: str = "raise"
    hold: Any = None
    chain: bool = True

    def to_request(self) -> "BlendRequest":
        """Check the options and bring them to one form; `first` must be a TopoDS face or None.

        Raises
        ------
        InputError
            An option is of the wrong type, not finite, out of range or unknown, does not belong to the section, or not
            exactly one of radius and width is given.
        SizeError
            The radius, a width, a or b is below the smallest size.
        UnsupportedError
            The option is part of the interface but not built yet.

        Examples
        --------
        >>> BlendOptions(width=3).to_request().width
        (3.0, 3.0)
        >>> BlendOptions(-1).to_request()
        Traceback (most recent call last):
        ...
        cqblend.errors.InputError: radius must be above 0, not -1
        """
        section = check_choice("section", self.section, SECTIONS)
        relation = None
        if section == "potential":
            self._refuse_given(section, "radius", "width", "taper", "tangents", "bulge", "steer")
            relation = build_relation(self.a, self.b, self.lam)
        else:
            self._refuse_given(section, "a", "b", "lam")
            if section == "arc":
                self._refuse_given(section, "width", "tangents", "bulge", "steer", "crease")
            if (self.radius is None) == (self.width is None):
                given = "neither" if self.radius is None else "both"
                raise InputError(f"give exactly one of radius and width, not {given}")
        edge_sizes = self._check_edge_sizes()
        radius = None if edge_sizes or self.radius is None else check_size("radius", self.radius)
        if self.hold is not None:
            self._check_hold(section, radius)
        continuity, orders = self._check_continuity(section)
        check_tangents = partial(check_choice, built=TANGENTS, later=_TANGENTS_LATER)
        tangents = check_pair("tangents", self.tangents, check_tangents)
        bulge = check_pair("bulge", self.bulge, check_bulge)
        form = check_choice("form", self.form, FORMS)
        is_ball = continuity == ("G1", "G1") and tangents == ("perpendicular", "perpendicular") and bulge == (1.0, 1.0)
        if section == "arc" and form == "compact":
            raise InputError('form "compact" is for splines, and the arcs of section="arc" are exact: leave it out')
        if section == "auto" and not (is_ball and self.width is None and form != "compact"):
            section = "hermite"
        if continuity == ("G0", "G0"):
            refuse_ignored_options(
                G0_HAS_NO_CROSS_FIELD,
                tangents=(self.tangents, BLEND_DEFAULTS.tangents),
                bulge=(self.bulge, BLEND_DEFAULTS.bulge),
                steer=(self.steer, BLEND_DEFAULTS.steer),
            )
        return BlendRequest(
            radius=radius,
            width=None if edge_sizes or self.width is None else check_pair("width", self.width, check_size),
            edge_sizes=edge_sizes,
            taper=None if self.taper is None else check_positive("taper", self.taper),
            continuity=continuity,
            tangents=tangents,
            bulge=bulge,
            steer=check_angle("steer", self.steer),
            crease=None if self.crease is None else check_angle("crease", self.crease),
            section=section,
            relation=relation,
            order=orders,
            parameters=self.parameters,
            terms=check_count_or_auto("terms", self.terms, OPTION_LIMITS.max_terms),
            form=form,
            tolerance=check_positive("tolerance", self.tolerance),
            angular_tolerance=check_positive("angular_tolerance", self.angular_tolerance),
            ends=check_pair("ends", self.ends, partial(check_choice, built=ENDS), each="end of the edge"),
            corner=check_choice("corner", self.corner, CORNERS),
            setbacks=self._check_setbacks(),
            first=self.first,
            on_error=check_choice("on_error", self.on_error, ON_ERROR),
            hold=() if self.hold is None else tuple(self.hold),
            chain=check_flag("chain", self.chain),
        )

    def _check_hold(self, section: SectionName, radius: "Size | None") -> None:
        """Raise InputError for options that have no meaning where a rail is held on an edge; ``radius`` is checked."""
        if section not in ("auto", "hermite", "arc"):
            raise InputError(f"hold is no option of section={section!r}: leave it out")
        if self.radius is None:
            raise InputError("hold takes a radius, not a width: the held edge says how wide the blend is")
        if not isinstance(radius, float):
            raise InputError("with hold, radius is a number: it does not vary, nor from edge to edge")
        if isinstance(self.continuity, tuple | list):
            raise InputError("with hold, continuity is that of the side that is not held: give one, not a pair")
        if not is_default(self.tangents, BLEND_DEFAULTS.tangents):
            raise InputError("tangents has no effect with hold: the ball gives the direction; leave it out")
        if "flat" in (self.ends if isinstance(self.ends, tuple | list) else (self.ends,)):
            raise InputError("with hold, the blend ends where the held edge does: ends cannot be flat")

    def _check_setbacks(self) -> "tuple[EdgeSetback, ...]":
        """Return the setbacks of single edges, or that of all."""
        if self.setback is None:
            return ()
        if self.corner != "setback":
            raise InputError('setback is an option of corner="setback": leave it out')
        if not isinstance(self.setback, Mapping):
            return (EdgeSetback(None, check_positive("setback", self.setback)),)
        rule = "setback is a number, or a mapping from edges to numbers"
        items = call_user_function(rule, list, call_user_function(rule, self.setback.items))
        if not items:
            raise InputError("setback has no numbers: as a mapping, it has one for each of some edges")
        return tuple(EdgeSetback(edge, check_positive("setback", value)) for edge, value in items)

    def _check_edge_sizes(self) -> "tuple[EdgeSizes, ...]":
        """Return the sizes of single edges, if radius or width is a mapping from edges."""
        name, given = ("radius", self.radius) if self.width is None else ("width", self.width)
        if not isinstance(given, Mapping):
            if self.taper is not None:
                raise InputError(f"taper has no effect unless {name} is a mapping from edges to sizes: leave taper out")
            return ()
        rule = f"{name} is a number, a function of t, or a mapping from edges to these"
        items = call_user_function(rule, list, call_user_function(rule, given.items))
        if not items:
            raise InputError(f"{name} must be a number, not {shown(given)}: as a mapping, it has a size for each edge")
        return tuple(
            EdgeSizes(edge, (check_size(name, size),) if name == "radius" else check_pair(name, size, check_size))
            for edge, size in items
        )

    def _check_continuity(
        self, section: SectionName
    ) -> tuple[tuple[ContinuityName, ContinuityName], tuple[int, int, int] | None]:
        """Return the continuity on both sides, and the orders of the equations that give it, None if there are none."""
        check = partial(check_choice, built=CONTINUITIES)
        if section != "pde":
            self._refuse_given(section, "order", "parameters", "terms")
            wanted = check_pair("continuity", "G1" if self.continuity is None else self.continuity, check)
            if section in ("arc", "potential") and wanted != ("G1", "G1"):
                what = "a potential blend" if section == "potential" else "a blend by arcs"
                raise InputError(f"{what} is G1 on both sides, not {shown(self.continuity)}: leave continuity out")
            return wanted, None
        orders = check_pde_orders(4 if self.order is None else self.order)
        follows: ContinuityName = CONTINUITIES[min(orders) // 2 - 1]
        if self.continuity is not None:
            for asked in check_pair("continuity", self.continuity, check):
                if asked != follows:
                    text = str(orders[0]) if len(set(orders)) == 1 else str(orders)
                    raise InputError(
                        f"continuity {asked} contradicts equations of order {text}, which are {follows} on both sides: "
                        "leave continuity out, or take order 2 for G0, 4 for G1, 6 for G2"
                    )
        return (follows, follows), orders

    def _refuse_given(self, section: SectionName, *names: str) -> None:
        """Raise InputError if an option was given that a section does not have."""
        for name in names:
            if is_default(getattr(self, name), getattr(BLEND_DEFAULTS, name)):
                continue
            owner = _SECTION_OF_OPTION.get(name)
            if owner is not None:
                raise InputError(f'{name} is an option of section="{owner}", not of {section!r}')
            way = _SIZE_OF_SECTION[section] if name in ("radius", "width") else "leave it out"
            raise InputError(f"{name} is no option of section={section!r}: {way}")


BLEND_DEFAULTS = BlendOptions()
"""The options if none is given: the source of every default."""

_SIZE_OF_SECTION = {"arc": "give the radius of the ball", "potential": "a and b set how far it reaches"}
"""What to give in place of a size that a section does not have."""

_SECTION_OF_OPTION: dict[str, SectionName] = {
    option.name: option.metadata["section"] for option in fields(BlendOptions) if "section" in option.metadata
}


class EdgeSizes(NamedTuple):
    """The sizes of one picked edge: the radius, or the widths on side 1 and side 2."""

    edge: "TopoDS_Edge"
    sizes: "tuple[Size, ...]"


class EdgeSetback(NamedTuple):
    """The setback (mm) of the blend of one picked edge, or, if there is no edge, of all."""

    edge: "TopoDS_Edge | None"
    distance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BlendRequest:
    """The options of a blend after `BlendOptions.to_request`: checked, and each in one form.

    Fields are documented in `BlendOptions`. What differs: pairs are always pairs, numbers are floats, sizes that vary
    are laws, `relation` stands for a, b and lam, `order` has one number for each coordinate, `terms` is None for
    ``"auto"``, and `section` is that only where arcs go with all else.

    Attributes
    ----------
    edge_sizes : tuple of EdgeSizes
        The sizes of single edges, in place of radius or width, which are None then.
    share : tuple of float
        The t, of all edges that are blended in one, at the start and at the end of what this request is for, where
        parameters are functions of it.
    setbacks : tuple of EdgeSetback
        The setbacks of single edges, or of all.
    relation : Conic or None
        How far side 1 and side 2 are moved together, mm; None for sections other than potential.
    """

    radius: "Size | None"
    width: "tuple[Size, Size] | None"
    edge_sizes: tuple[EdgeSizes, ...]
    taper: float | None
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
    corner: CornerWanted
    setbacks: tuple[EdgeSetback, ...]
    first: "TopoDS_Face | None"
    on_error: OnError
    hold: "tuple[TopoDS_Edge, ...]"
    chain: bool
    share: tuple[float, float] = (0.0, 1.0)
