"""From patches to pieces: strips are divided, flattened and trimmed, and their borders become seams.

Exists to keep one promise: both sides of every seam have the same length, to rounding. The length of a seam is that of
the curve in space it stands for, the longer of the two where a strip is stretched; a side whose chord is shorter is
bowed to it. Holds the order of the steps, and what is known of every piece. Must not know OCCT, tabs, sheets or files.
"""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from cqblend.errors import CqblendError, Failure, GeometryError
from cqblend.patterns.flatten.flat_face import DividedPatch, UnrolledStrip
from cqblend.patterns.outline.pieces import Piece, Pieces, Place, Run, Seam
from cqblend.patterns.soundness import find_face_mismatch, find_missing_vertices, find_self_overlapping
from cqblend.patterns.strips.division_strategies import (
    cut_strips_across,
    divide_finer,
    divide_other_way,
    divide_patch,
    merge_thin_strips,
)
from cqblend.patterns.trim.flat_loops import PieceDraft, SampledEdges, flatten_patch_loops
from cqblend.patterns.trim.run_draft import RunDraft
from cqblend.patterns.trim.run_keys import EdgeRunKey, RunKey
from cqblend.patterns.trim.trimmed_patch import Patch, PatchShell, TrimmedSurface
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import UnrollOptions

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
    unrolled_strip
        The strip; None on a plane.
    upward
        Whether R_t x R_w of the strip points to the outer side.
    loops
        Its boundary, run by run, as a curve or as points (n + 1, 2) on the ruled strip, (t, w), or in the plane.
    """

    patch: Patch
    unrolled_strip: UnrolledStrip | None
    upward: bool
    loops: tuple[tuple[Array | Curve, ...], ...]

    def to_trimmed_surface(self) -> TrimmedSurface:
        """Return the piece in space: a ruled surface or a plane, and what is kept of it."""
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


def unroll_patches(skin: PatchShell, options: UnrollOptions, progress: Progress | None = None) -> UnrollResult:
    """Unroll patches to pieces.

    A patch that cannot be done is left out, its neighbours are not; see ``Unrolled.failures``.
    """
    tell = _ignore_progress if progress is None else progress
    work = _UnrollState(options, failures=[Failure((face,), error) for face, error in skin.refused.items()])
    for i, patch in enumerate(skin.patches):
        tell(0.6 * i / len(skin.patches), f"dividing face {patch.index}")
        try:
            work.faces.append(divide_patch(patch, options))
        except CqblendError as error:
            work.failures.append(_make_failure(patch, error))
    required_parameters: dict[int, Array] = {}
    turn = 0
    while True:
        edges = SampledEdges(skin, work.faces, options, required_parameters)
        drafts: list[PieceDraft] = []
        again = False
        for i, face in enumerate(tuple(work.faces)):
            tell(0.6 + 0.4 * i / len(work.faces), f"laying face {face.patch.index} flat")
            try:
                drafts += flatten_patch_loops(face, edges, options)
            except CqblendError as error:
                again |= work.replace_division(face, partial(divide_other_way, face, options, error))
        if again:
            continue
        turn += 1
        missing = find_missing_vertices(drafts, edges, options) if turn < _MOST_ROUNDS else {}
        if missing:
            for number, parameters in missing.items():
                known = required_parameters.get(number, np.empty(0))
                required_parameters[number] = np.concatenate([known, parameters])
            continue
        result = _assemble_pieces(skin, drafts, work)
        if not (work.redivide_faulty(drafts, result, edges) or work.merge_thin_strips(drafts, result)):
            return result


@dataclass(slots=True, eq=False)
class _UnrollState:
    """The faces that are being unrolled, and those that cannot be."""

    options: UnrollOptions
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

    def redivide_faulty(self, drafts: Sequence[PieceDraft], result: UnrollResult, edges: SampledEdges) -> bool:
        """Divide faces anew whose pieces cover themselves, or are not what they stand for; whether there were any."""
        twice = find_self_overlapping(drafts, result.pieces.pieces)
        pieces: dict[int, list[tuple[PieceDraft, Piece]]] = defaultdict(list)
        for one, piece in zip(drafts, result.pieces.pieces, strict=True):
            pieces[one.face.patch.index].append((one, piece))
        found = False
        for face in tuple(self.faces):
            cuts = [(one.strip_index, sum(one.rail_extent) / 2) for one, bent in twice if one.face is face and not bent]
            if cuts:
                self.replace_division(face, partial(cut_strips_across, face, cuts))
            elif any(one.face is face for one, _ in twice):
                self.replace_division(face, partial(divide_finer, face, self.options, _SELF_OVERLAP_ERROR))
            elif (wrong := find_face_mismatch(face, pieces[face.patch.index], edges)) is not None:
                error, factor = wrong
                self.replace_division(face, partial(divide_finer, face, self.options, error, 1.1 * factor))
            else:
                continue
            found = True
        return found

    def merge_thin_strips(self, drafts: Sequence[PieceDraft], result: UnrollResult) -> bool:
        """Merge strips whose pieces are too thin with their neighbours; whether there were any that could be."""
        least = self.options.least_width
        if least is None:
            return False
        thin: dict[int, set[int]] = defaultdict(set)
        wide: set[int] = set()
        for one, record in zip(drafts, result.records, strict=True):
            if record.width < least:
                thin[one.face.patch.index].add(one.strip_index)
            else:
                wide.add(one.face.patch.index)
        found = False
        for face in tuple(self.faces):
            indices = sorted(thin[face.patch.index])
            union = merge_thin_strips(face, indices, self.options) if indices and face.strips else None
            if union is not None:
                found |= self.replace_division(face, partial(_return_division, union))
            elif face.width_error is not None and face.patch.index not in wide:
                found = True
                self.replace_division(face, partial(_raise_error, face.width_error))
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


def _assemble_pieces(skin: PatchShell, drafts: Sequence[PieceDraft], work: _UnrollState) -> UnrollResult:
    """Bend the runs to the lengths of their seams, and make the pieces."""
    members: dict[RunKey, list[tuple[Place, RunDraft]]] = defaultdict(list)
    for i, one in enumerate(drafts):
        for j, loop in enumerate(one.loops):
            for k, (key, draft) in enumerate(_list_keyed_runs(loop)):
                members[key].append((Place(i, j, k), draft))
    seams: list[Seam] = []
    numbers: dict[RunKey | None, int] = {}
    final: dict[Place, RunDraft] = {}
    stretch = 0.0
    for key, sides in members.items():
        places, runs = [place for place, _ in sides], [draft for _, draft in sides]
        if work.options.layout == "triangles":
            runs = [replace(run, lengths=run.chord_lengths) for run in runs]
        elif isinstance(key, EdgeRunKey):
            runs, excess = _equalise_lengths(runs)
            stretch = max(stretch, excess)
        if len(runs) == 2:
            numbers[key] = len(seams)
            (first, second), (here, there) = places, runs
            runs[1] = replace(there, bow_inward=here.kind == there.kind == "end")
            angle = _measure_fold_angle(skin, key, drafts[first.piece], drafts[second.piece])
            seams.append(Seam(str(len(seams) + 1), (first, second), here.along_key != there.along_key, angle))
        final.update(zip(places, runs, strict=True))
    counts: dict[int, int] = defaultdict(int)
    for one in drafts:
        counts[one.face.patch.index] += 1
    pieces, records = [], []
    ordinals: dict[int, int] = defaultdict(int)
    for i, one in enumerate(drafts):
        index = one.face.patch.index
        ordinals[index] += 1
        name = f"{index}.{ordinals[index]}" if counts[index] > 1 else str(index)
        loops = [
            [final[Place(i, j, k)] for k in range(len(_list_keyed_runs(loop)))] for j, loop in enumerate(one.loops)
        ]
        piece = Piece(name, tuple(tuple(_make_run(run, numbers.get(run.key)) for run in loop) for loop in loops))
        pieces.append(piece)
        error = max((float(run.measure_arc_error().max()) for loop in loops for run in loop), default=0.0)
        records.append(_make_record(one, piece, error))
    faces = {one.face.patch.index: one.face for one in drafts}.values()
    return UnrollResult(
        Pieces(tuple(pieces), tuple(seams)),
        tuple(records),
        tuple(_make_source(one) for one in drafts),
        tuple(work.failures),
        stretch,
        sum(max(len(face.strips), 1) for face in faces),
        sum(face.elber_count for face in faces),
        sum(face.ideal_count for face in faces),
        tuple(_compare_areas(face, drafts, pieces) for face in faces),
        tuple(_describe_detour(face) for face in faces if face.failures),
    )


def _compare_areas(face: DividedPatch, drafts: Sequence[PieceDraft], pieces: Sequence[Piece]) -> Areas:
    own = sum(piece.area for one, piece in zip(drafts, pieces, strict=True) if one.face is face)
    return Areas(face.patch.faces, face.patch.area, own)


def _describe_detour(face: DividedPatch) -> str:
    reasons = "; ".join(f"not {strategy}: {error}" for strategy, error in face.failures)
    return f"face {face.patch.index}: {face.strategy}, {reasons}"


def _make_run(draft: RunDraft, seam: int | None) -> Run:
    final = draft.drop_inner_vertices() if draft.kind == "end" else draft
    return Run(final.to_path(), final.points_3d, final.kind, seam)


def _list_keyed_runs(loop: Sequence[RunDraft]) -> list[tuple[RunKey, RunDraft]]:
    """Return the runs of a loop with their keys, except poles, which have none."""
    return [(draft.key, draft) for draft in loop if draft.key is not None]


def _clamp_lengths(draft: RunDraft) -> Array:
    """Return the lengths of segments, where they are not much longer than their chords; else they would be balloons."""
    return np.clip(draft.lengths, draft.chord_lengths, _MOST_BOW * draft.chord_lengths)


def _equalise_lengths(drafts: Sequence[RunDraft]) -> tuple[list[RunDraft], float]:
    """Give a run along an edge one length on all sides: that of the edge, or of the longest chords.

    Returns the runs, and by how much they are longer than the edge, relative to it. A segment becomes as long as its
    part of the edge, where that is not much longer than its chord; where a strip is much shorter than the face, as next
    to a pole, it would be a balloon. What is missing then is shared by all.
    """
    clamped = [_clamp_lengths(draft) for draft in drafts]
    edge = float(drafts[0].lengths.sum())
    total = max(edge, *(float(lengths.sum()) for lengths in clamped))
    runs = []
    for draft, lengths in zip(drafts, clamped, strict=True):
        whole = float(lengths.sum())
        runs.append(replace(draft, lengths=lengths * (total / whole) if whole > 0 else lengths))
    return runs, total / edge - 1 if edge > 0 else 0.0


def _measure_fold_angle(skin: PatchShell, key: RunKey, first: PieceDraft, second: PieceDraft) -> float:
    """Return the angle by which the outer normal turns across the middle of a seam, positive if convex."""
    if isinstance(key, EdgeRunKey):
        return skin.edges[key.edge].angle
    if first.strip_index == second.strip_index:
        return 0.0
    lower, upper = sorted((first, second), key=lambda one: one.strip_index)
    t = (key.start + key.stop) / 2
    below, above = lower.face.strips[lower.strip_index].rails, upper.face.strips[upper.strip_index].rails
    tangent = above[0](t, 1)
    down, up = below[1](t) - below[0](t), above[1](t) - above[0](t)
    sign = 1.0 if lower.face.upward else -1.0
    normals = [sign * np.cross(tangent, ruling) for ruling in (down, up)]
    before, after = (n / max(float(np.linalg.norm(n)), 1e-300) for n in normals)
    angle = float(np.arctan2(np.linalg.norm(np.cross(before, after)), before @ after))
    return angle if (after - before) @ up > 0 else -angle


def _make_record(one: PieceDraft, piece: Piece, border_error: float) -> Record:
    faces, strip = one.face.patch.faces, one.unrolled_strip
    width = 2 * piece.area / max(sum(path.length for path in piece.outlines), np.finfo(float).tiny)
    if strip is None:
        off = one.face.patch.plane_deviation
        return Record(piece.name, faces, "plane", off, True, border_error, 0.0, 0.0, 0.0, piece.area, piece.area, width)
    flat = strip.flat
    return Record(
        name=piece.name,
        faces=faces,
        kind=flat.kind,
        bound=strip.bound,
        proven=strip.proven,
        error=max(flat.error, border_error),
        twist=flat.normal_turn,
        ruling=flat.ruling_error,
        strain=flat.strain,
        area=flat.area_space,
        flat_area=flat.area_flat,
        width=width,
    )


def _make_source(one: PieceDraft) -> PieceSource:
    loops = tuple(tuple(draft.to_trim_curve() for draft in loop) for loop in one.loops)
    return PieceSource(one.face.patch, one.unrolled_strip, one.face.upward, loops)
