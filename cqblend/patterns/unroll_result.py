"""What unrolling returns: pieces with a quality record and a source each, areas of faces, and faces that failed."""

from dataclasses import dataclass

from cqblend.errors import Failure
from cqblend.patterns.flattening.flat_face import UnrolledStrip
from cqblend.patterns.outline.pieces import Pieces
from cqblend.patterns.trimming.trimmed_patch import Patch, TrimmedSurface
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array


@dataclass(frozen=True, slots=True)
class Record:
    """Quality record of one flat piece.

    Attributes
    ----------
    name
        Of the piece.
    faces
        Numbers of the faces it comes from.
    kind
        Of the strip: plane, cylinder, cone, tangent (developable), twisted.
    bound
        Distance between the face and the strip in space, both ways, mm.
    proven
        Whether the bound is certified; that of a strip whose rulings were paired anew is measured.
    error
        Distance between the strip in space and the flat piece folded, mm; borders that are bent to the length of a
        seam included, straight ends of strips not.
    twist
        Proven bound of the angle by which the normal turns along a ruling, rad, see
        :func:`cqblend.patterns.strips.developability.bound_normal_turn`; 0 if the strip is developable.
    ruling
        Largest relative change in length of a ruling.
    strain
        Largest relative change of lengths inside the strip; 0 if it is developable. Rails and rulings keep theirs.
    area, flat_area
        Of the whole strip before it was trimmed, in space and flat, mm^2.
    width
        Mean width of the piece: twice its area over the length of its outlines, mm.
    """

    name: str
    faces: tuple[int, ...]
    kind: str
    bound: float
    proven: bool
    error: float
    twist: float
    ruling: float
    strain: float
    area: float
    flat_area: float
    width: float


@dataclass(frozen=True, slots=True)
class Areas:
    """Area of a face, or of faces of one plane, and of the pieces that it became, mm^2.

    Strips of a face that bulges lie inside it, and are smaller.
    """

    faces: tuple[int, ...]
    face: float
    pieces: float


@dataclass(frozen=True, slots=True, eq=False)
class PieceSource:
    """Where a piece comes from in space.

    Attributes
    ----------
    patch
        The face, or faces of one plane, that it is of.
    unrolled_strip
        The strip; None on a plane.
    upward
        Whether R_t x R_w of the strip points to the outer side.
    loops
        Its boundary, run by run, as a curve or as points (n + 1, 2): in the parameters (t, w) of the ruled strip, or in
        the plane.
    """

    patch: Patch
    unrolled_strip: UnrolledStrip | None
    upward: bool
    loops: tuple[tuple[Array | Curve, ...], ...]

    def to_trimmed_surface(self) -> TrimmedSurface:
        """Return the piece in space: its ruled surface or plane with its boundary."""
        if self.unrolled_strip is None:
            return TrimmedSurface(self.patch.surface, self.loops, self.patch.outward)
        return TrimmedSurface(self.unrolled_strip.to_ruled_surface(), self.loops, self.upward)

    def fold(self, points: Array) -> Array:
        """Return where points (.., 2) of the flat piece are in space, (.., 3)."""
        if self.unrolled_strip is not None:
            return self.unrolled_strip.flat.fold(points)
        assert self.patch.frame is not None
        return self.patch.frame.to_world_coords(points)

    def map_to_face(self, points: Array) -> Array:
        """Return the points of the face, (n, 3), for which points (n, 2) of the flat piece stand."""
        return self.fold(points) if self.unrolled_strip is None else self.unrolled_strip.map_to_surface(points)


@dataclass(frozen=True, slots=True, eq=False)
class UnrollResult:
    """Pieces with their seams, a record and a source for each, and the faces that could not be unrolled.

    Attributes
    ----------
    pieces
        The pieces and the seams between them.
    records, sources
        One of each piece, in the same order.
    failures
        Faces that could not be unrolled, and why.
    stretch
        Largest relative excess of the length of a seam over that of the edge that it stands for.
    strips
        Number of strips, N, a plane being one; trimming may divide a strip into several pieces, or leave nothing of it.
    elber
        Number of strips by Elber's algorithm 1, in the same directions.
    ideal
        Estimate N* of the least number, summed over the faces.
    areas
        Of every face.
    detours
        Texts on faces that could not be divided by the first strategy: the one that was taken, and why others failed.
    """

    pieces: Pieces
    records: tuple[Record, ...]
    sources: tuple[PieceSource, ...]
    failures: tuple[Failure, ...]
    stretch: float
    strips: int
    elber: int
    ideal: float
    areas: tuple[Areas, ...]
    detours: tuple[str, ...]
