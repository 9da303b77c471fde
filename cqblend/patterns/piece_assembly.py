"""Makes pieces of the drafts of their loops: gives both sides of every seam one length, and joins them.

The length of a seam is that of the curve in space it stands for, or of the longer side where a strip is stretched;
segments of a side whose chords are shorter are bent to arcs. Depends on flattened loops and on what trims them.
"""

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cqblend.errors import Failure
from cqblend.patterns.flattening.flat_face import DividedPatch
from cqblend.patterns.flattening.flat_loops import PieceDraft
from cqblend.patterns.outline import plane_path
from cqblend.patterns.outline.pieces import Piece, Pieces, Place, Run, Seam
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.tolerances import ASSEMBLY_TOLERANCES
from cqblend.patterns.trimming.boundary_run_draft import RunDraft
from cqblend.patterns.trimming.boundary_run_keys import EdgeRunKey, RunKey
from cqblend.patterns.trimming.trimmed_patch import PatchShell
from cqblend.patterns.unroll_result import Areas, PieceSource, Record, UnrollResult
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import Layout


@dataclass(frozen=True, slots=True, eq=False)
class BentRun:
    """A run with its final lengths, its segments bent to arcs of these.

    Attributes
    ----------
    draft
        The run; an end of a strip is one segment.
    path
        The run in the plane.
    """

    draft: RunDraft
    path: Path

    def measure_border_error(self) -> float:
        """Return the largest distance, mm, of the exact curve in the plane from the path; 0 at ends of strips."""
        if self.draft.kind == "end":
            return 0.0
        return float(plane_path.measure_arc_deviations(self.path, self.draft.inner_points).max())


@dataclass(frozen=True, slots=True, eq=False)
class BentSides:
    """All runs with one key, bent to one length: both sides of a seam, or the only one of an open border.

    Attributes
    ----------
    drafts
        As they were before.
    runs
        As they are now, in the same order.
    stretch
        Relative excess in length over the edge that they stand for.
    """

    drafts: tuple[RunDraft, ...]
    runs: tuple[BentRun, ...]
    stretch: float


@dataclass(frozen=True, slots=True, eq=False)
class AssembledPieces:
    """Pieces of drafts, with the seams between them.

    Attributes
    ----------
    drafts
        Of the pieces, in the same order.
    pieces
        The pieces.
    places
        By key of a run: where it occurs.
    sides
        By key of a run: all runs with that key, bent.
    """

    drafts: tuple[PieceDraft, ...]
    pieces: tuple[Piece, ...]
    places: dict[RunKey, list[Place]]
    sides: dict[RunKey, BentSides]


def assemble_pieces(drafts: Sequence[PieceDraft], layout: Layout, known: AssembledPieces | None) -> AssembledPieces:
    """Bend the runs of drafts to the lengths of their seams, and make pieces of them.

    What an earlier assembly has `known` is taken from there, where the drafts of all sides are the same.
    """
    places: dict[RunKey, list[Place]] = defaultdict(list)
    runs: dict[RunKey, list[RunDraft]] = defaultdict(list)
    for i, draft in enumerate(drafts):
        for j, loop in enumerate(draft.loops):
            for k, (key, run) in enumerate(_list_keyed_runs(loop)):
                places[key].append(Place(i, j, k))
                runs[key].append(run)
    sides: dict[RunKey, BentSides] = {}
    seams: dict[RunKey, int] = {}
    for key, sides_of_key in runs.items():
        earlier = known.sides.get(key) if known else None
        if earlier is None or earlier.drafts != tuple(sides_of_key):
            earlier = _bend_sides(key, sides_of_key, layout)
        sides[key] = earlier
        if len(sides_of_key) == 2:
            seams[key] = len(seams)
    final = {
        place: _make_run(bent, seams.get(key))
        for key, places_of_key in places.items()
        for place, bent in zip(places_of_key, sides[key].runs, strict=True)
    }
    pieces = tuple(
        Piece(
            name,
            tuple(
                tuple(final[Place(i, j, k)] for k in range(len(_list_keyed_runs(loop))))
                for j, loop in enumerate(draft.loops)
            ),
        )
        for i, (draft, name) in enumerate(zip(drafts, _name_pieces(drafts), strict=True))
    )
    return AssembledPieces(tuple(drafts), pieces, dict(places), sides)


def join_pieces(assembled: AssembledPieces, shell: PatchShell, failures: Sequence[Failure]) -> UnrollResult:
    """Return the result: pieces and the seams between them, with a record and a source for each piece."""
    drafts, pieces = assembled.drafts, assembled.pieces
    seams: list[Seam] = []
    for key, places in assembled.places.items():
        if len(places) == 2:
            first, second = places
            here, there = (run.draft for run in assembled.sides[key].runs)
            angle = _measure_fold_angle(shell, key, drafts[first.piece], drafts[second.piece])
            seams.append(Seam(str(len(seams) + 1), (first, second), here.along_key != there.along_key, angle))
    border_errors = np.zeros(len(pieces))
    for key, places in assembled.places.items():
        for place, run in zip(places, assembled.sides[key].runs, strict=True):
            border_errors[place.piece] = max(border_errors[place.piece], run.measure_border_error())
    faces = {draft.face.patch.index: draft.face for draft in drafts}.values()
    return UnrollResult(
        pieces=Pieces(pieces, tuple(seams)),
        records=tuple(map(_make_record, drafts, pieces, border_errors.tolist())),
        sources=tuple(_make_source(draft) for draft in drafts),
        failures=tuple(failures),
        stretch=max((sides.stretch for sides in assembled.sides.values()), default=0.0),
        strips=sum(max(len(face.strips), 1) for face in faces),
        elber=sum(face.elber_count for face in faces),
        ideal=sum(face.ideal_count for face in faces),
        areas=tuple(_compare_areas(face, drafts, pieces) for face in faces),
        detours=tuple(_describe_detour(face) for face in faces if face.failures),
    )


def measure_mean_width(piece: Piece) -> float:
    """Return the mean width of a piece, mm: twice its area over the length of its outlines."""
    return 2 * piece.area / max(sum(path.length for path in piece.outlines), np.finfo(float).tiny)


def _bend_sides(key: RunKey, drafts: Sequence[RunDraft], layout: Layout) -> BentSides:
    """Give all runs with one key one length, and bend them to it."""
    runs, stretch = list(drafts), 0.0
    if layout == "triangles":
        runs = [replace(run, lengths=run.chord_lengths) for run in runs]
    elif isinstance(key, EdgeRunKey):
        runs, stretch = _equalise_lengths(runs)
    if len(runs) == 2:
        runs[1] = replace(runs[1], bow_inward=runs[0].kind == runs[1].kind == "end")
    return BentSides(tuple(drafts), tuple(map(_bend_run, runs)), max(stretch, 0.0))


def _bend_run(draft: RunDraft) -> BentRun:
    """Bend the segments of a run to their lengths; an end of a strip becomes one arc."""
    path = (draft.drop_inner_vertices() if draft.kind == "end" else draft).to_path()
    return BentRun(draft, path)


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


def _make_run(bent: BentRun, seam: int | None) -> Run:
    """Return a run of a piece with the index of its seam."""
    points_3d = bent.draft.points_3d[[0, -1]] if bent.draft.kind == "end" else bent.draft.points_3d
    return Run(bent.path, points_3d, bent.draft.kind, seam)


def _compare_areas(face: DividedPatch, drafts: Sequence[PieceDraft], pieces: Sequence[Piece]) -> Areas:
    """Return the area of a face and of its pieces."""
    own = sum(piece.area for draft, piece in zip(drafts, pieces, strict=True) if draft.face is face)
    return Areas(face.patch.faces, face.patch.area, own)


def _describe_detour(face: DividedPatch) -> str:
    """Return a text on the strategy by which a face was divided, and on those that failed before."""
    reasons = "; ".join(f"not {strategy}: {error}" for strategy, error in face.failures)
    return f"face {face.patch.index}: {face.strategy}, {reasons}"


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
    width = measure_mean_width(piece)
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
