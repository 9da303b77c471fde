"""From patches to pieces: strips are divided, flattened and trimmed, and their borders become seams.

Exists to keep one promise: both sides of every seam have the same length, to rounding. The length of a seam is that of
the curve in space it stands for, the longer of the two where a strip is stretched; a side whose chord is shorter is
bowed to it. Holds the order of the steps, and what is known of every piece. Must not know OCCT, tabs, sheets or files.
"""

from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from cqblend.errors import CqblendError, Failure, GeometryError
from cqblend.patterns.flatten.flat_face import DividedPatch, UnrolledStrip, UnrollOptions
from cqblend.patterns.outline.pieces import Piece, Pieces, Place, Run, Seam
from cqblend.patterns.soundness import add_edge_vertices, find_face_mismatch, find_self_overlapping, is_edge_key
from cqblend.patterns.strips.division_ways import (
    cut_strips_across,
    divide_finer,
    divide_other_way,
    divide_patch,
    merge_thin_strips,
)
from cqblend.patterns.trim.flat_loops import PieceDraft, RunDraft, SampledEdges, flatten_patch_loops
from cqblend.patterns.trim.trimmed_patch import Patch, PatchShell, TrimmedSurface
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array

Progress = Callable[[float, str], object]
"""Is told the part of the work that is done, and what is done next."""

_MOST_BOW = 1.1
"""Length to chord of an arc of 86 degrees. Samples of edges are closer."""

_MOST_ROUNDS = 6
"""Vertices are added to edges so often at most."""


@dataclass(frozen=True, slots=True)
class Record:
    """What is known of a piece.

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
        Whether the bound is certified; a strip whose rulings were paired anew is measured.
    error
        Distance between the strip in space and the flat piece folded, mm; borders that are bowed to the length of a
        seam included, straight ends of strips not.
    twist
        Proven bound of the angle by which the normal turns along a ruling, rad, see
        :func:`cqblend.patterns.strips.developability.bound_normal_turn`; 0 if the strip is developable.
    ruling
        Largest change in length of a ruling, relative.
    strain
        By how much lengths inside the strip change, relative, at most; 0 if it is developable. Rails and rulings keep
        theirs.
    area, flat_area
        Of the whole strip before it was trimmed, in space and flat, mm^2.
    width
        How wide the piece is on average: twice its area over the length of its outlines, mm.
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
    """What a face, or faces of one plane, has of area, and what its pieces have, mm^2.

    Strips of a face that bulges lie inside it, and are smaller.
    """

    faces: tuple[int, ...]
    face: float
    pieces: float


@dataclass(frozen=True, slots=True, eq=False)
class PieceSource:
    """What a piece was before it was laid flat.

    Attributes
    ----------
    patch
        The face, or faces of one plane, that it is of.
    laying
        The strip; None on a plane.
    upward
        Whether R_t x R_w of the strip points to the outer side.
    loops
        Its boundary, run by run, as a curve or as points (n + 1, 2) on the ruled strip, (t, w), or in the plane.
    """

    patch: Patch
    laying: UnrolledStrip | None
    upward: bool
    loops: tuple[tuple[Array | Curve, ...], ...]

    def to_trimmed_surface(self) -> TrimmedSurface:
        """Return the piece in space: a ruled surface or a plane, and what is kept of it."""
        if self.laying is None:
            return TrimmedSurface(self.patch.surface, self.loops, self.patch.outward)
        return TrimmedSurface(self.laying.to_ruled_surface(), self.loops, self.upward)

    def fold(self, points: Array) -> Array:
        """Return where points (.., 2) of the flat piece are in space, (.., 3)."""
        if self.laying is not None:
            return self.laying.flat.fold(points)
        assert self.patch.frame is not None
        return self.patch.frame.to_world_coords(points)

    def map_to_face(self, points: Array) -> Array:
        """Return the points of the face, (n, 3), for which points (n, 2) of the flat piece stand."""
        return self.fold(points) if self.laying is None else self.laying.map_to_surface(points)


@dataclass(frozen=True, slots=True, eq=False)
class UnrollResult:
    """Pieces with their seams, a record and a source for each, and what could not be done.

    Attributes
    ----------
    stretch
        By how much a seam is longer than the edge that it stands for, relative, at most.
    strips
        Number of strips, N, a plane being one; trimming may part a strip into several pieces, or leave nothing of it.
    elber
        The same by Elber's algorithm 1, in the same directions.
    ideal
        N*, summed over the faces.
    areas
        Of every face.
    detours
        Faces that could not be divided the first way that was tried: which one was taken, and why the others failed.
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


def unroll_patches(skin: PatchShell, wishes: UnrollOptions, progress: Progress | None = None) -> UnrollResult:
    """Unroll patches to pieces.

    A patch that cannot be done is left out, its neighbours are not; see ``Unrolled.failures``.
    """
    tell = _ignore_progress if progress is None else progress
    work = _UnrollState(wishes, failures=[Failure((face,), error) for face, error in skin.refused.items()])
    for i, patch in enumerate(skin.patches):
        tell(0.6 * i / len(skin.patches), f"dividing face {patch.index}")
        try:
            work.faces.append(divide_patch(patch, wishes))
        except CqblendError as error:
            work.failures.append(_make_failure(patch, error))
    extra: dict[int, Array] = {}
    turn = 0
    while True:
        edges = SampledEdges(skin, work.faces, wishes, extra)
        laid: list[PieceDraft] = []
        again = False
        for i, face in enumerate(tuple(work.faces)):
            tell(0.6 + 0.4 * i / len(work.faces), f"laying face {face.patch.index} flat")
            try:
                laid += flatten_patch_loops(face, edges, wishes)
            except CqblendError as error:
                again |= work.replace_division(face, partial(divide_other_way, face, wishes, error))
        if again:
            continue
        turn += 1
        if turn < _MOST_ROUNDS and add_edge_vertices(extra, laid, edges, wishes):
            continue
        result = _assemble_pieces(skin, laid, work)
        if not (work.redivide_faulty(laid, result, edges) or work.merge_thin_strips(laid, result)):
            return result


@dataclass(slots=True, eq=False)
class _UnrollState:
    """The faces that are being unrolled, and those that cannot be."""

    wishes: UnrollOptions
    failures: list[Failure]
    faces: list[DividedPatch] = field(default_factory=list)

    def replace_division(self, face: DividedPatch, another: Callable[[], DividedPatch]) -> bool:
        """Put another division of a face in its place; leave it out if there is none, and return False."""
        place = self.faces.index(face)
        try:
            self.faces[place] = another()
        except CqblendError as error:
            self.failures.append(_make_failure(face.patch, error))
            del self.faces[place]
            return False
        return True

    def redivide_faulty(self, laid: Sequence[PieceDraft], result: UnrollResult, edges: SampledEdges) -> bool:
        """Divide faces anew whose pieces cover themselves, or are not what they stand for; whether there were any."""
        twice = find_self_overlapping(laid, result.pieces.pieces)
        pieces: dict[int, list[tuple[PieceDraft, Piece]]] = defaultdict(list)
        for one, piece in zip(laid, result.pieces.pieces, strict=True):
            pieces[id(one.face)].append((one, piece))
        found = False
        for face in tuple(self.faces):
            rows = [(one.row, sum(one.span) / 2) for one, bent in twice if one.face is face and not bent]
            if rows:
                self.replace_division(face, partial(cut_strips_across, face, rows))
            elif any(one.face is face for one, _ in twice):
                self.replace_division(face, partial(divide_finer, face, self.wishes, _SELF_OVERLAP_ERROR))
            elif (wrong := find_face_mismatch(face, pieces[id(face)], edges)) is not None:
                error, factor = wrong
                self.replace_division(face, partial(divide_finer, face, self.wishes, error, 1.1 * factor))
            else:
                continue
            found = True
        return found

    def merge_thin_strips(self, laid: Sequence[PieceDraft], result: UnrollResult) -> bool:
        """Merge strips whose pieces are too thin with their neighbours; whether there were any that could be."""
        least = self.wishes.least_width
        if least is None:
            return False
        thin: dict[int, set[int]] = defaultdict(set)
        wide: set[int] = set()
        for one, record in zip(laid, result.records, strict=True):
            if record.width < least:
                thin[id(one.face)].add(one.row)
            else:
                wide.add(id(one.face))
        found = False
        for face in tuple(self.faces):
            union = (
                merge_thin_strips(face, sorted(thin[id(face)]), self.wishes) if thin[id(face)] and face.strips else None
            )
            if union is not None:
                found |= self.replace_division(face, partial(_return_division, union))
            elif face.refusal is not None and id(face) not in wide:
                found = True
                self.replace_division(face, partial(_raise_error, face.refusal))
        return found


_SELF_OVERLAP_ERROR = GeometryError(
    "a piece would cover itself where its border is bowed to the length of a longer seam, however narrow its strips; "
    "take a smaller tolerance"
)


def _return_division(face: DividedPatch) -> DividedPatch:
    return face


def _raise_error(error: CqblendError) -> DividedPatch:
    raise error


def _make_failure(patch: Patch, error: CqblendError) -> Failure:
    """Name the face in an error, unless it is named already."""
    return Failure(
        patch.faces, error if error.shape.startswith("face") else error.with_details(shape=f"face {patch.index}")
    )


def _ignore_progress(part: float, what: str) -> None:
    """Take no notice."""


def _assemble_pieces(skin: PatchShell, laid: Sequence[PieceDraft], work: _UnrollState) -> UnrollResult:
    """Bow the runs to the lengths of their seams, and make the pieces."""
    members: dict[Hashable, list[tuple[Place, RunDraft]]] = defaultdict(list)
    for i, one in enumerate(laid):
        for j, loop in enumerate(one.loops):
            for k, draft in enumerate(_skip_poles(loop)):
                members[draft.key].append((Place(i, j, k), draft))
    seams: list[Seam] = []
    numbers: dict[Hashable, int] = {}
    stretch = 0.0
    for key, sides in members.items():
        if work.wishes.layout == "triangles":
            for _, draft in sides:
                draft.lengths = draft.chord_lengths
        elif is_edge_key(key):
            stretch = max(stretch, _equalise_lengths([draft for _, draft in sides]))
        if len(sides) == 2:
            numbers[key] = len(seams)
            (first, here), (second, there) = sides
            there.inward = here.kind == there.kind == "end"
            angle = _measure_fold_angle(skin, key, laid[first.piece], laid[second.piece])
            seams.append(Seam(str(len(seams) + 1), (first, second), here.rising != there.rising, angle))
    counts: dict[int, int] = defaultdict(int)
    for one in laid:
        counts[id(one.face)] += 1
    pieces, records = [], []
    ordinals: dict[int, int] = defaultdict(int)
    for one in laid:
        ordinals[id(one.face)] += 1
        index = one.face.patch.index
        name = f"{index}.{ordinals[id(one.face)]}" if counts[id(one.face)] > 1 else str(index)
        loops = [tuple(_make_run(draft, numbers.get(draft.key)) for draft in _skip_poles(loop)) for loop in one.loops]
        piece = Piece(name, tuple(loops))
        pieces.append(piece)
        records.append(_make_record(one, piece))
    faces = {id(one.face): one.face for one in laid}.values()
    return UnrollResult(
        Pieces(tuple(pieces), tuple(seams)),
        tuple(records),
        tuple(_make_source(one) for one in laid),
        tuple(work.failures),
        stretch,
        sum(max(len(face.strips), 1) for face in faces),
        sum(face.elber for face in faces),
        sum(face.ideal for face in faces),
        tuple(_compare_areas(face, laid, pieces) for face in faces),
        tuple(_describe_detour(face) for face in faces if face.failed),
    )


def _compare_areas(face: DividedPatch, laid: Sequence[PieceDraft], pieces: Sequence[Piece]) -> Areas:
    own = sum(piece.area for one, piece in zip(laid, pieces, strict=True) if one.face is face)
    return Areas(face.patch.faces, face.patch.area, own)


def _describe_detour(face: DividedPatch) -> str:
    reasons = "; ".join(f"not {way}: {error}" for way, error in face.failed)
    return f"face {face.patch.index}: {face.way}, {reasons}"


def _make_run(draft: RunDraft, seam: int | None) -> Run:
    final = draft.drop_inner_vertices() if draft.kind == "end" else draft
    return Run(final.to_path(), final.space, final.kind, seam)


def _skip_poles(loop: Sequence[RunDraft]) -> list[RunDraft]:
    """Return the drafts of a loop that are more than a pole."""
    return [draft for draft in loop if draft.key is not None]


def _clamp_lengths(draft: RunDraft) -> Array:
    """Return the lengths of segments, where they are not much longer than their chords; else they would be balloons."""
    return np.clip(draft.lengths, draft.chord_lengths, _MOST_BOW * draft.chord_lengths)


def _equalise_lengths(drafts: Sequence[RunDraft]) -> float:
    """Give a run along an edge one length on all sides: that of the edge, or of the longest chords.

    Returns by how much that is longer than the edge, relative to it. A segment becomes as long as its part of the
    edge, where that is not much longer than its chord; where a strip is much shorter than the face, as next to a
    pole, it would be a balloon. What is missing then is shared by all.
    """
    natural = [_clamp_lengths(draft) for draft in drafts]
    edge = float(drafts[0].lengths.sum())
    total = max(edge, *(float(lengths.sum()) for lengths in natural))
    for draft, lengths in zip(drafts, natural, strict=True):
        whole = float(lengths.sum())
        draft.lengths = lengths * (total / whole) if whole > 0 else lengths
    return total / edge - 1 if edge > 0 else 0.0


def _measure_fold_angle(skin: PatchShell, key: Hashable, first: PieceDraft, second: PieceDraft) -> float:
    """Return the angle by which the outer normal turns across the middle of a seam, positive if convex."""
    assert isinstance(key, tuple)
    if key[0] == "edge":
        return skin.edges[key[1]].angle
    if first.row == second.row:
        return 0.0
    lower, upper = sorted((first, second), key=lambda one: one.row)
    t = (key[4] + key[5]) / 2
    below, above = lower.face.strips[lower.row].rails, upper.face.strips[upper.row].rails
    tangent = above[0](t, 1)
    down, up = below[1](t) - below[0](t), above[1](t) - above[0](t)
    sign = 1.0 if lower.face.upward else -1.0
    normals = [sign * np.cross(tangent, ruling) for ruling in (down, up)]
    before, after = (n / max(float(np.linalg.norm(n)), 1e-300) for n in normals)
    angle = float(np.arctan2(np.linalg.norm(np.cross(before, after)), before @ after))
    return angle if (after - before) @ up > 0 else -angle


def _make_record(one: PieceDraft, piece: Piece) -> Record:
    faces, laying = one.face.patch.faces, one.laying
    error = max(
        (float(draft.measure_arc_error().max()) for loop in one.loops for draft in _skip_poles(loop)), default=0.0
    )
    width = 2 * piece.area / max(sum(path.length for path in piece.outlines), np.finfo(float).tiny)
    if laying is None:
        off = one.face.patch.plane_deviation
        return Record(piece.name, faces, "plane", off, True, error, 0.0, 0.0, 0.0, piece.area, piece.area, width)
    flat = laying.flat
    return Record(
        name=piece.name,
        faces=faces,
        kind=flat.kind,
        bound=laying.bound,
        proven=laying.proven,
        error=max(flat.error, error),
        twist=flat.turn,
        ruling=flat.ruling,
        strain=flat.strain,
        area=flat.area_space,
        flat_area=flat.area_flat,
        width=width,
    )


def _make_source(one: PieceDraft) -> PieceSource:
    loops = tuple(tuple(draft.to_trim_curve() for draft in loop) for loop in one.loops)
    return PieceSource(one.face.patch, one.laying, one.face.upward, loops)
