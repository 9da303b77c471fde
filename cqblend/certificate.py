"""The certificate of a blend: how exactly it meets its neighbours, as records of numbers and as text.

The numbers are measured elsewhere; here they are kept in one set of names and units, which the Python interface, the
command line and the tests share. Depends on `cqblend.errors` only.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, reduce
from operator import or_
from typing import TYPE_CHECKING, Literal

from cqblend.errors import InputError, shown

if TYPE_CHECKING:
    from cqblend.blends.quality.smoothness_proof import Proof

Form = Literal["exact", "compact"]
SectionKind = Literal["arc", "hermite", "pde", "potential"]
EndKind = Literal["natural", "flat", "point", "ball", "cross", "setback", "mitre", "turn"]
NewEdgeKind = Literal["end", "border", "seam", "between", "mitre", "spoke", "corner curve"]
NothingToBlend = Literal["smooth", "seam", "degenerate"]


@dataclass(frozen=True, slots=True)
class RailRecord:
    """How well a blend face meets one of its two neighbours, measured along the whole rail on the final faces.

    Attributes
    ----------
    side : int
        1 or 2; side 1 is the face given as ``first=``, else the one with the lower index.
    face, edge : int
        The neighbour and the blended edge: 1-based indices in the face map and the edge map of the *input* shape
        (the order of ``TopExp::MapShapes``, which is that of ``shape.Faces()`` in CadQuery, from 1); 0 where surfaces
        were blended, not a shape.
    gap : float
        Largest distance between blend and neighbour, mm.
    angle : float
        Largest angle between their normals, rad, as ``atan2(|n1 x n2|, n1 . n2)``.
    curvature_jump : float
        Largest jump of the normal curvature across the rail, 1/mm.
    direction : float
        Largest angle between the cross direction and the one asked for by ``tangents``, rad.
    length : float
        Largest deviation of the length of the cross derivative from what was asked, relative.
    tolerance : float
        Largest tolerance of an edge on the rail, mm.
    kept : float
        Share of the rail, 0 to 1, along which the blend's cross derivative vanishes, so that the joint of the two faces
        stays as it was; angle and curvature jump are not measured there. Above 0 only on potential blends whose amounts
        vanish.
    held : bool
        Whether the rail is held on an existing edge: there the blend is G0, and ``angle`` is that of the edge.
    bend : float
        Largest distance (mm) by which the rail leaves the path of the contacts: where the path would have a kink at an
        oblique smooth edge between two cells of a chain, it is rounded off.
    section : {"arc", "hermite", "pde", "potential"}
        What the sections of the blend are: ``"arc"``, arcs of the rolling ball, on a cylinder, a torus or a sphere;
        ``"hermite"``, polynomials; ``"pde"`` and ``"potential"``, with an interior of that kind.
    """

    side: int
    face: int
    edge: int
    gap: float
    angle: float
    curvature_jump: float
    direction: float
    length: float
    tolerance: float
    kept: float = 0.0
    held: bool = False
    bend: float = 0.0
    section: SectionKind = "hermite"


@dataclass(frozen=True, slots=True)
class EndRecord:
    """How a blend ends at one end of an open edge.

    Attributes
    ----------
    edge, vertex : int
        1-based indices in the edge map and the vertex map of the *input* shape; ``vertex`` is 0 if that does not have
        it, because faces at it were made one, or an earlier blend of the same call made it.
    kind : {"natural", "flat", "point", "ball", "cross", "setback", "mitre", "turn"}
        ``"natural"``: on the faces around the end of the edge, or in the border of an open shell; ``"flat"``: in a flat
        cap across the edge; ``"point"``: at the vertex itself, where the size is 0; ``"mitre"``: in the blend of
        another edge; the others: at a corner, by the method that it is made with.
    before : float
        Distance from the vertex to a cap that stands before it, mm along the edge.
    cause : str
        Why an end is flat where that was asked for only if it cannot be natural; empty otherwise.
    """

    edge: int
    vertex: int
    kind: EndKind
    before: float = 0.0
    cause: str = ""

    def __str__(self) -> str:
        before = f", {self.before:.3g} mm before it" if self.before else ""
        cause = f": {self.cause}" if self.cause else ""
        kind = "pointed" if self.kind == "point" else self.kind
        return f"edge {self.edge} has a {kind} end at vertex {self.vertex}{before}{cause}"


@dataclass(frozen=True, slots=True)
class EdgeRecord:
    """How well the two faces at an edge of a blend face that is no rail meet, measured along the whole edge.

    Attributes
    ----------
    kind : {"end", "border", "seam", "between", "mitre", "spoke", "corner curve"}
        ``"end"``: between the blend and the face or cap that it ends on; ``"border"``: an end in the border of an open
        shell; ``"seam"``: where a closed blend meets itself; ``"between"``: between two blend faces that go on
        smoothly; ``"mitre"``: between two that meet at an angle; ``"spoke"``: between two patches of a corner;
        ``"corner curve"``: between such a patch and a neighbour.
    edge, vertex : int
        The blended edge, and the vertex of it that an end, or a corner, is at: 1-based indices in the edge map and the
        vertex map of the *input* shape; ``vertex`` is 0 of other kinds, or if the input does not have it. Of a corner,
        ``edge`` is one of those that are blended there.
    gap : float
        Largest distance of a face from the edge's own curve, mm.
    angle : float or None
        Largest angle between the normals, rad; None of an end or a mitre, where the faces may meet at any, or there is
        but one.
    tolerance : float
        The edge's tolerance, mm, which covers the gap.
    curvature_jump : float or None
        Largest jump of the normal curvature across the edge, 1/mm; None where there is no angle. Cells of chains and
        patches of corners meet their neighbours G1, whatever the continuity along rails.
    """

    kind: NewEdgeKind
    edge: int
    vertex: int
    gap: float
    angle: float | None
    tolerance: float
    curvature_jump: float | None = None

    @property
    def strays(self) -> bool:
        """Whether a face is further from the edge than its tolerance says."""
        return self.gap > self.tolerance

    def __str__(self) -> str:
        name = {
            "end": f"the end at vertex {self.vertex}",
            "border": f"the free end at vertex {self.vertex}",
            "seam": "the seam",
            "between": "an edge between two blends",
            "spoke": f"an edge between two patches at vertex {self.vertex}",
            "corner curve": f"the edge of a patch at vertex {self.vertex}",
            "mitre": f"the mitre at vertex {self.vertex}",
        }
        angle = "" if self.angle is None else f", angle {self.angle:.1e} rad"
        return (
            f"edge {self.edge}: {name[self.kind]} has gap {self.gap:.1e} mm{angle}, tolerance {self.tolerance:.1e} mm"
        )


_SMOOTH_KINDS: dict[NewEdgeKind, str] = {
    "between": "between blends",
    "spoke": "between patches of a corner",
    "corner curve": "of patches beside faces",
}
"""Kinds of edges inside a blend, or beside a patch, of which the text of a certificate has the largest figures."""


@dataclass(frozen=True, slots=True)
class SkippedEdges:
    """Edges that were picked, but not blended: one at which there is nothing to blend, or a network that was left out.

    Attributes
    ----------
    edges : tuple of int
        Their 1-based indices in the edge map of the *input* shape.
    kind : str
        ``"smooth"``: the faces at the edge meet smoothly already; ``"seam"``: a closed face meets itself there;
        ``"degenerate"``: a pole, without length. With ``on_error="skip"`` also the ``kind`` of the error because of
        which a network of edges was left out, such as ``"too large"``, or the name of its type, if it has no kind.
    place : float or None
        Where on the edge: t, the fraction of its length, from 0 to 1.
    message : str
        The same in words, with the number.
    """

    edges: tuple[int, ...]
    kind: str
    place: float | None
    message: str


_COLUMNS = (
    # attribute, title, unit
    ("side", "side", ""),
    ("face", "face", ""),
    ("edge", "edge", ""),
    ("gap", "gap", "mm"),
    ("angle", "angle", "rad"),
    ("curvature_jump", "curvature jump", "1/mm"),
    ("direction", "direction", "rad"),
    ("length", "length", "rel."),
    ("tolerance", "tolerance", "mm"),
)


@dataclass(frozen=True)
class Certificate:
    """How exact a blend is: one record for each rail, and figures of the whole blend.

    The properties ``gap``, ``angle``, ``curvature_jump``, ``direction``, ``length`` and ``tolerance`` are the largest
    over all rails, in the units of `RailRecord`; angle and curvature jump over those that are not held on an edge.

    Attributes
    ----------
    rails : tuple of RailRecord
        Two for each blended edge.
    form : {"exact", "compact"}
        ``exact``: rails and tangent planes are those of the neighbours, to rounding; ``compact``: a spline of least
        degree within the asked tolerances.
    degree : tuple of int
        Along the rail and across, largest over the blend faces; of arcs, those of the rational spline that is the same
        surface.
    poles : tuple of int
        Number of control points along the rail and across, largest over the blend faces; of arcs likewise.
    rational : bool
        Whether any blend face has weights.
    inner_crease : float
        Largest angle inside the blend, across a section where the neighbour is not smooth enough, rad.
    method : str
        How the blend came into the solid: ``"wire substitution"``, or the fallback by its name.
    validity : tuple of callable
        Functions that tell whether a whole result is valid, called when `valid` is read.
    width : tuple of float
        Smallest and largest straight distance from rail to rail, mm.
    stations : int
        Points at which each rail was measured, least over the rails.
    coverage : float
        Blended length over the length of all edges that were meant: picked, but for those with nothing to blend, or on
        a chain with those. At most 1.
    ends : tuple of EndRecord
        Two for each open edge.
    edge_tolerance : float
        Largest tolerance of all edges that were made or cut, mm. Where an edge of the input strays from its faces
        further than it says, a piece of it gets the tolerance that it needs.
    residual : float or None
        Root mean square of the residual of the partial differential equations, relative to that of sections that only
        meet the boundary data; the largest over x, y and z and all blends. None for other sections.
    proofs, energies : tuple of callable
        Functions that compute the proof and the energy of each blend, called when `proof` and `fairness` are read.
    skipped : tuple of SkippedEdges
        Picked edges that were not blended, and why.
    edges : tuple of EdgeRecord
        All edges of the blend faces that are no rails.
    blended : tuple of int
        The blended edges, picked or on a chain with those: 1-based indices in the edge map of the *input* shape, in the
        order of the blend faces.

    Examples
    --------
    >>> rail = RailRecord(1, 2, 7, gap=0.0, angle=1e-16, curvature_jump=0.4, direction=0.0, length=2e-9, tolerance=1e-7)
    >>> print(Certificate((rail,), "exact", (1, 3), (2, 4), False, 0.0, "wire substitution", (3.5, 3.5), 1000))
    valid blend, exact, hermite, degree 1 x 3, 2 x 4 poles, by wire substitution
    width 3.5 mm, inner crease 0.0e+00 rad, 1000 stations a rail
    side  face  edge      gap    angle  curvature jump  direction   length  tolerance
                           mm      rad            1/mm        rad     rel.         mm
       1     2     7  0.0e+00  1.0e-16         4.0e-01    0.0e+00  2.0e-09    1.0e-07
    """

    rails: tuple[RailRecord, ...]
    form: Form
    degree: tuple[int, int]
    poles: tuple[int, int]
    rational: bool
    inner_crease: float
    method: str
    width: tuple[float, float]
    stations: int
    coverage: float = 1.0
    ends: tuple[EndRecord, ...] = ()
    edge_tolerance: float = 0.0
    residual: float | None = None
    validity: tuple[Callable[[], bool], ...] = field(default=(), repr=False, compare=False)
    proofs: tuple[Callable[[], "Proof"], ...] = field(default=(), repr=False, compare=False)
    energies: tuple[Callable[[], float], ...] = field(default=(), repr=False, compare=False)
    skipped: tuple[SkippedEdges, ...] = ()
    edges: tuple[EdgeRecord, ...] = ()
    blended: tuple[int, ...] = ()

    @cached_property
    def valid(self) -> bool:
        """Whether the whole result is valid for OCCT's own ordinary check, that of ``isValid()``.

        False only if the input was not valid there either: all that is new or touched has been found valid before the
        result was returned. Computed when first read, for that takes as long as it does for the whole body. Of a blend
        of surfaces, whether it does not fold.
        """
        return all(is_valid() for is_valid in self.validity)

    @cached_property
    def proof(self) -> "Proof | None":
        """Bounds on gap (mm), angle (rad) and curvature jump (1/mm) that hold at every point of the rails.

        They are computed from the spline coefficients of the finished surfaces, without sampling, when first read, in
        up to some tenths of a second. None if there are measurements only.
        """
        return reduce(or_, [prove() for prove in self.proofs]) if self.proofs else None

    @cached_property
    def fairness(self) -> float | None:
        """Thin-plate energy: the integral of the sum of the squared principal curvatures over all blend faces.

        Without unit; the smaller, the fairer. Computed when first read. None if there is no function that computes it.
        """
        return sum(energy() for energy in self.energies) if self.energies else None

    @property
    def section(self) -> str:
        """What the sections are, as in `RailRecord`: ``"arc"``, or ``"arc and hermite"`` if of two kinds.

        Which edge has which is in `rails`.
        """
        return " and ".join(dict.fromkeys(rail.section for rail in self.rails))

    @property
    def gap(self) -> float:
        """Largest distance between blend and neighbour, mm."""
        return max(rail.gap for rail in self.rails)

    @property
    def angle(self) -> float:
        """Largest angle between the normals of blend and neighbour, rad."""
        return max(rail.angle for rail in self.rails if not rail.held)

    @property
    def curvature_jump(self) -> float:
        """Largest jump of the normal curvature across a rail, 1/mm."""
        return max(rail.curvature_jump for rail in self.rails if not rail.held)

    @property
    def direction(self) -> float:
        """Largest angle between the cross direction and the one asked for, rad."""
        return max(rail.direction for rail in self.rails)

    @property
    def length(self) -> float:
        """Largest deviation of the cross derivative's length from what was asked, relative."""
        return max(rail.length for rail in self.rails)

    @property
    def tolerance(self) -> float:
        """Largest tolerance of an edge on a rail, mm."""
        return max(rail.tolerance for rail in self.rails)

    @classmethod
    def merge(cls, certificates: Sequence["Certificate"]) -> "Certificate":
        """One certificate for several blends in one solid: all rails, and the worst of everything else.

        Raises
        ------
        InputError
            These are no certificates, or none is given.
        """
        if not isinstance(certificates, list | tuple) or not all(isinstance(one, cls) for one in certificates):
            raise InputError(f"certificates are merged, a list of them, not {shown(certificates)}")
        if not certificates:
            raise InputError("there is no certificate to merge")
        return cls(
            rails=tuple(rail for one in certificates for rail in one.rails),
            form="exact" if all(one.form == "exact" for one in certificates) else "compact",
            degree=(max(one.degree[0] for one in certificates), max(one.degree[1] for one in certificates)),
            poles=(max(one.poles[0] for one in certificates), max(one.poles[1] for one in certificates)),
            rational=any(one.rational for one in certificates),
            inner_crease=max(one.inner_crease for one in certificates),
            method=", ".join(dict.fromkeys(one.method for one in certificates)),
            validity=tuple(is_valid for one in certificates for is_valid in one.validity),
            width=(min(one.width[0] for one in certificates), max(one.width[1] for one in certificates)),
            stations=min(one.stations for one in certificates),
            coverage=min(one.coverage for one in certificates),
            ends=tuple(end for one in certificates for end in one.ends),
            edge_tolerance=max(one.edge_tolerance for one in certificates),
            residual=max((one.residual for one in certificates if one.residual is not None), default=None),
            proofs=tuple(prove for one in certificates for prove in one.proofs),
            energies=tuple(energy for one in certificates for energy in one.energies),
            skipped=tuple(edge for one in certificates for edge in one.skipped),
            edges=tuple(edge for one in certificates for edge in one.edges),
            blended=tuple(edge for one in certificates for edge in one.blended),
        )

    def __str__(self) -> str:
        low, high = (f"{value:.4g}" for value in self.width)
        state = "valid" if self.valid else "INVALID"
        degree, poles = (f"{along} x {across}" for along, across in (self.degree, self.poles))
        rational = ", rational" if self.rational else ""
        residual = "" if self.residual is None else f", residual {self.residual:.1e}"
        width = low if low == high else f"{low} to {high}"
        head = (
            f"{state} blend, {self.form}, {self.section}, degree {degree}, {poles} poles{rational}, by {self.method}",
            f"width {width} mm, inner crease {self.inner_crease:.1e} rad, {self.stations} stations a rail{residual}",
        )
        kept = [
            f"side {one.side}: the joint stays as it was on {one.kept:.1%} of the rail"
            for one in self.rails
            if one.kept
        ]
        held = [
            f"side {one.side}: G0, held on the edge of face {one.face}, at {one.angle:.3g} rad"
            for one in self.rails
            if one.held
        ]
        covered = [f"the blend covers {self.coverage:.1%} of the edges"] if self.coverage < 1 else []
        flat = [str(end) for end in self.ends if end.kind == "flat"]
        edges = [
            *(str(edge) for edge in self.edges if edge.strays),
            *_summarise_smooth_edges(self.edges),
        ]
        skipped = [f"passed over: {one.message}" for one in self.skipped]
        return "\n".join((*head, *_format_table(self.rails), *kept, *held, *covered, *flat, *edges, *skipped))


def _summarise_smooth_edges(edges: Sequence[EdgeRecord]) -> list[str]:
    """Return a line for each kind of edges between blends and patches, with the largest figures of all of them."""
    lines = []
    for kind, name in _SMOOTH_KINDS.items():
        own = [edge for edge in edges if edge.kind == kind]
        if own:
            figures = [(edge.gap, edge.angle or 0.0, edge.curvature_jump or 0.0) for edge in own]
            gap, angle, jump = map(max, zip(*figures, strict=True))
            count = "1 edge" if len(own) == 1 else f"{len(own)} edges"
            lines.append(f"{count} {name}: gap {gap:.1e} mm, angle {angle:.1e} rad, curvature jump {jump:.1e} 1/mm")
    return lines


def _format_table(rails: Sequence[RailRecord]) -> list[str]:
    """Return the lines of the table of rails, numbers right-aligned under their title and unit."""
    mixed = len({rail.section for rail in rails}) > 1
    columns = (*_COLUMNS, ("section", "section", "")) if mixed else _COLUMNS
    rows = [[title for _, title, _ in columns], [unit for _, _, unit in columns]]
    rows += [[_format_cell(getattr(rail, name)) for name, _, _ in columns] for rail in rails]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]


def _format_cell(value: float | str) -> str:
    return str(value) if isinstance(value, int | str) else f"{value:.1e}"
