"""Unrolls the patches of a shape to flat pieces: divides, flattens and trims them, and joins the borders by seams.

Both sides of every seam have the same length, to rounding. The length of a seam is that of the curve in space it stands
for, or of the longer side where a strip is stretched; segments of a side whose chords are shorter are bent to arcs.
Divisions whose pieces are faulty are replaced, see :mod:`cqblend.patterns.division_checks`. Depends on strips,
flattening and trimming, not on OCCT, tabs, sheets or files.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from cqblend.errors import CqblendError, Failure, GeometryError
from cqblend.patterns.division_checks import find_face_mismatch, find_missing_vertices, find_self_overlapping
from cqblend.patterns.flattening.face_division import (
    cut_strips_across,
    divide_finer,
    divide_other_way,
    divide_patch,
    merge_thin_strips,
)
from cqblend.patterns.flattening.flat_face import DividedPatch
from cqblend.patterns.flattening.flat_loops import PieceDraft, SampledEdges, flatten_patch_loops
from cqblend.patterns.outline.pieces import Piece, Pieces, Place, Run, Seam
from cqblend.patterns.tolerances import ASSEMBLY_TOLERANCES
from cqblend.patterns.trimming.boundary_run_draft import RunDraft
from cqblend.patterns.trimming.boundary_run_keys import EdgeRunKey, RunKey
from cqblend.patterns.trimming.trimmed_patch import Patch, PatchShell
from cqblend.patterns.unroll_result import Areas, PieceSource, Record, UnrollResult
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import UnrollOptions

Progress = Callable[[float, str], object]
"""Is called with the part of the work that is done, 0 to 1, and the name of the next step."""

_SELF_OVERLAP_ERROR = GeometryError(
    "a piece would cover itself where its border is bowed to the length of a longer seam, however narrow its strips; "
    "take a smaller tolerance"
)


def unroll_patches(shell: PatchShell, options: UnrollOptions, progress: Progress | None = None) -> UnrollResult:
    """Unroll patches to pieces.

    A patch that cannot be unrolled is left out, its neighbours are not; see :attr:`UnrollResult.failures`.

    Parameters
    ----------
    shell
        The patches and the edges that they share.
    options
        How they are divided and flattened.
    progress
        Told before every step.
    """
    tell = _ignore_progress if progress is None else progress
    state = _UnrollState(options, failures=[Failure((face,), error) for face, error in shell.refused.items()])
    dividing = ASSEMBLY_TOLERANCES.dividing_share
    for i, patch in enumerate(shell.patches):
        tell(dividing * i / len(shell.patches), f"dividing face {patch.index}")
        try:
            state.faces.append(divide_patch(patch, options))
        except CqblendError as error:
            state.failures.append(_make_failure(patch, error))
    required_parameters: dict[int, Array] = {}  # by number of the edge: where it needs vertices
    rounds = 0
    while True:
        edges = SampledEdges(shell, state.faces, options, required_parameters)
        drafts: list[PieceDraft] = []
        has_new_division = False
        for i, face in enumerate(tuple(state.faces)):
            tell(dividing + (1 - dividing) * i / len(state.faces), f"laying face {face.patch.index} flat")
            try:
                drafts += flatten_patch_loops(face, edges, options)
            except CqblendError as error:
                has_new_division |= state.replace_division(face, partial(divide_other_way, face, options, error))
        if has_new_division:
            continue
        rounds += 1
        missing = find_missing_vertices(drafts, edges, options) if rounds < ASSEMBLY_TOLERANCES.most_rounds else {}
        if missing:
            for number, parameters in missing.items():
                known = required_parameters.get(number, np.empty(0))
                required_parameters[number] = np.concatenate([known, parameters])
            continue
        result = _assemble_pieces(shell, drafts, state)
        if not (state.redivide_faulty(drafts, result, edges) or state.merge_thin_strips(drafts, result)):
            return result


@dataclass(slots=True, eq=False)
class _UnrollState:
    """The divided faces that are being unrolled, and the faces that failed."""

    options: UnrollOptions
    failures: list[Failure]
    faces: list[DividedPatch] = field(default_factory=list)

    def replace_division(self, face: DividedPatch, divide: Callable[[], DividedPatch]) -> bool:
        """Replace the division of a face by another one; drop the face and return False if that raises an error."""
        index = self.faces.index(face)
        try:
            self.faces[index] = divide()
        except CqblendError as error:
            self.failures.append(_make_failure(face.patch, error))
            del self.faces[index]
            return False
        return True

    def redivide_faulty(self, drafts: Sequence[PieceDraft], result: UnrollResult, edges: SampledEdges) -> bool:
        """Divide faces anew whose pieces overlap themselves or do not match the face; return whether there were any.

        Strips whose pieces overlap are cut across. If they do so only because their borders are bent, or do not match
        the face in length or area, the face is divided with a finer tolerance.
        """
        overlapping = find_self_overlapping(drafts, result.pieces.pieces)
        pieces: dict[int, list[tuple[PieceDraft, Piece]]] = defaultdict(list)
        for draft, piece in zip(drafts, result.pieces.pieces, strict=True):
            pieces[draft.face.patch.index].append((draft, piece))
        found = False
        for face in tuple(self.faces):
            own = [(draft, only_bent) for draft, only_bent in overlapping if draft.face is face]
            cuts = [(draft.strip_index, sum(draft.rail_extent) / 2) for draft, only_bent in own if not only_bent]
            if cuts:
                self.replace_division(face, partial(cut_strips_across, face, cuts))
            elif own:
                self.replace_division(face, partial(divide_finer, face, self.options, _SELF_OVERLAP_ERROR))
            elif (mismatch := find_face_mismatch(face, pieces[face.patch.index], edges)) is not None:
                error, factor = mismatch
                factor = ASSEMBLY_TOLERANCES.refinement_margin * factor
                self.replace_division(face, partial(divide_finer, face, self.options, error, factor))
            else:
                continue
            found = True
        return found

    def merge_thin_strips(self, drafts: Sequence[PieceDraft], result: UnrollResult) -> bool:
        """Merge strips whose pieces are too thin with their neighbours; return whether any division changed."""
        least = self.options.least_width
        if least is None:
            return False
        thin: dict[int, set[int]] = defaultdict(set)
        wide: set[int] = set()
        for draft, record in zip(drafts, result.records, strict=True):
            if record.width < least:
                thin[draft.face.patch.index].add(draft.strip_index)
            else:
                wide.add(draft.face.patch.index)
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
    """Do nothing."""


def _assemble_pieces(shell: PatchShell, drafts: Sequence[PieceDraft], state: _UnrollState) -> UnrollResult:
    """Bend the runs to the lengths of their seams, and make pieces, seams and records of them."""
    sides_by_key: dict[RunKey, list[tuple[Place, RunDraft]]] = defaultdict(list)
    for i, draft in enumerate(drafts):
        for j, loop in enumerate(draft.loops):
            for k, (key, run) in enumerate(_list_keyed_runs(loop)):
                sides_by_key[key].append((Place(i, j, k), run))
    seams: list[Seam] = []
    seam_indices: dict[RunKey | None, int] = {}
    final: dict[Place, RunDraft] = {}
    stretch = 0.0
    for key, sides in sides_by_key.items():
        places, runs = [place for place, _ in sides], [run for _, run in sides]
        if state.options.layout == "triangles":
            runs = [replace(run, lengths=run.chord_lengths) for run in runs]
        elif isinstance(key, EdgeRunKey):
            runs, excess = _equalise_lengths(runs)
            stretch = max(stretch, excess)
        if len(runs) == 2:
            seam_indices[key] = len(seams)
            (first, second), (here, there) = places, runs
            runs[1] = replace(there, bow_inward=here.kind == there.kind == "end")
            angle = _measure_fold_angle(shell, key, drafts[first.piece], drafts[second.piece])
            seams.append(Seam(str(len(seams) + 1), (first, second), here.along_key != there.along_key, angle))
        final.update(zip(places, runs, strict=True))
    pieces, records = [], []
    for i, (draft, name) in enumerate(zip(drafts, _name_pieces(drafts), strict=True)):
        loops = [
            [final[Place(i, j, k)] for k in range(len(_list_keyed_runs(loop)))] for j, loop in enumerate(draft.loops)
        ]
        piece = Piece(name, tuple(tuple(_make_run(run, seam_indices.get(run.key)) for run in loop) for loop in loops))
        pieces.append(piece)
        border_error = max((float(run.measure_arc_error().max()) for loop in loops for run in loop), default=0.0)
        records.append(_make_record(draft, piece, border_error))
    faces = {draft.face.patch.index: draft.face for draft in drafts}.values()
    return UnrollResult(
        pieces=Pieces(tuple(pieces), tuple(seams)),
        records=tuple(records),
        sources=tuple(_make_source(draft) for draft in drafts),
        failures=tuple(state.failures),
        stretch=stretch,
        strips=sum(max(len(face.strips), 1) for face in faces),
        elber=sum(face.elber_count for face in faces),
        ideal=sum(face.ideal_count for face in faces),
        areas=tuple(_compare_areas(face, drafts, pieces) for face in faces),
        detours=tuple(_describe_detour(face) for face in faces if face.failures),
    )


def _name_pieces(drafts: Sequence[PieceDraft]) -> list[str]:
    """Return the number of its face for each piece; with its ordinal among the pieces of that face, if it has more."""
    numbers = [draft.face.patch.index for draft in drafts]
    counts = Counter(numbers)
    ordinals: Counter[int] = Counter()
    names = []
    for number in numbers:
        ordinals[number] += 1
        names.append(f"{number}.{ordinals[number]}" if counts[number] > 1 else str(number))
    return names


def _compare_areas(face: DividedPatch, drafts: Sequence[PieceDraft], pieces: Sequence[Piece]) -> Areas:
    """Return the area of a face and of its pieces."""
    own = sum(piece.area for draft, piece in zip(drafts, pieces, strict=True) if draft.face is face)
    return Areas(face.patch.faces, face.patch.area, own)


def _describe_detour(face: DividedPatch) -> str:
    """Return a text on the strategy by which a face was divided, and on those that failed before."""
    reasons = "; ".join(f"not {strategy}: {error}" for strategy, error in face.failures)
    return f"face {face.patch.index}: {face.strategy}, {reasons}"


def _make_run(draft: RunDraft, seam: int | None) -> Run:
    """Return a run of a piece with the index of its seam; an end of a strip becomes one arc."""
    final = draft.drop_inner_vertices() if draft.kind == "end" else draft
    return Run(final.to_path(), final.points_3d, final.kind, seam)


def _list_keyed_runs(loop: Sequence[RunDraft]) -> list[tuple[RunKey, RunDraft]]:
    """Return the runs of a loop with their keys, without poles: these have no key, and no length in space."""
    return [(draft.key, draft) for draft in loop if draft.key is not None]


def _clamp_lengths(draft: RunDraft) -> Array:
    """Return the wanted lengths (n,) of the segments of a run, not much longer than their chords.

    Else their arcs would bulge far beyond the piece.
    """
    return np.clip(draft.lengths, draft.chord_lengths, ASSEMBLY_TOLERANCES.most_bow * draft.chord_lengths)


def _equalise_lengths(drafts: Sequence[RunDraft]) -> tuple[list[RunDraft], float]:
    """Give a run along an edge one length on all sides: that of the edge, or of the longest chords.

    Returns the runs, and their excess in length over the edge, relative to it. A segment gets the length of its part of
    the edge, where that is not much longer than its chord, as it is next to a pole, where a strip is much shorter than
    the face. The length that is missing then is shared by all segments.
    """
    clamped = [_clamp_lengths(draft) for draft in drafts]
    edge = float(drafts[0].lengths.sum())
    total = max(edge, *(float(lengths.sum()) for lengths in clamped))
    runs = []
    for draft, lengths in zip(drafts, clamped, strict=True):
        sum_of_lengths = float(lengths.sum())
        scaled = lengths * (total / sum_of_lengths) if sum_of_lengths > 0 else lengths
        runs.append(replace(draft, lengths=scaled))
    return runs, total / edge - 1 if edge > 0 else 0.0


def _measure_fold_angle(shell: PatchShell, key: RunKey, first: PieceDraft, second: PieceDraft) -> float:
    """Return the angle (rad) by which the outer normal turns across the middle of a seam, positive if convex."""
    if isinstance(key, EdgeRunKey):
        return shell.edges[key.edge].angle
    if first.strip_index == second.strip_index:
        return 0.0
    lower, upper = sorted((first, second), key=lambda draft: draft.strip_index)
    t = (key.start + key.stop) / 2
    below, above = lower.face.strips[lower.strip_index].rails, upper.face.strips[upper.strip_index].rails
    tangent = above[0](t, 1)
    down, up = below[1](t) - below[0](t), above[1](t) - above[0](t)
    sign = 1.0 if lower.face.upward else -1.0
    normals = [sign * np.cross(tangent, ruling) for ruling in (down, up)]
    before, after = (n / max(float(np.linalg.norm(n)), 1e-300) for n in normals)
    angle = float(np.arctan2(np.linalg.norm(np.cross(before, after)), before @ after))
    return angle if (after - before) @ up > 0 else -angle


def _make_record(draft: PieceDraft, piece: Piece, border_error: float) -> Record:
    """Return the quality record of a piece; the error of its bent borders is given, mm."""
    faces, strip = draft.face.patch.faces, draft.unrolled_strip
    width = 2 * piece.area / max(sum(path.length for path in piece.outlines), np.finfo(float).tiny)
    if strip is None:
        return Record(
            name=piece.name,
            faces=faces,
            kind="plane",
            bound=draft.face.patch.plane_deviation,
            proven=True,
            error=border_error,
            twist=0.0,
            ruling=0.0,
            strain=0.0,
            area=piece.area,
            flat_area=piece.area,
            width=width,
        )
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


def _make_source(draft: PieceDraft) -> PieceSource:
    """Return where a piece comes from in space."""
    loops = tuple(tuple(run.to_trim_curve() for run in loop) for loop in draft.loops)
    return PieceSource(draft.face.patch, draft.unrolled_strip, draft.face.upward, loops)
