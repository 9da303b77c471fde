"""What may be wrong with faces that are drafts flat: told before it is returned.

Exists because a division is judged by its pieces: by their borders, their area, and whether they cover themselves. What
is done about it is not known here.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from cqblend.errors import GeometryError
from cqblend.patterns.flatten.flat_face import DividedPatch
from cqblend.patterns.outline.overlap import has_overlap
from cqblend.patterns.outline.pieces import Piece
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.patterns.trim.flat_loops import PieceDraft, SampledEdges
from cqblend.patterns.trim.run_draft import RunDraft
from cqblend.patterns.trim.run_keys import EdgeRunKey
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import UnrollOptions

_AREA_MISMATCH, _THIN_FACE = 0.02, 4.0
"""By how much pieces may differ from their face in area, relative, if that is thinner than so many tolerances."""

_EDGE_EXCESS = 0.02
"""By how much an edge may be longer than the ends of strips along it, relative."""


def find_missing_vertices(
    drafts: Sequence[PieceDraft], edges: SampledEdges, options: UnrollOptions
) -> dict[int, Array]:
    """Return, by number of the edge, parameters at which it needs more vertices for its flat curves to be arcs."""
    wanted: dict[int, list[Array]] = defaultdict(list)
    for piece in drafts:
        tolerance = options.flat / piece.face.refinement
        for key, draft in _list_edge_runs(piece):
            if draft.kind == "end":
                continue
            error = replace(draft, lengths=draft.curve_lengths).measure_arc_error()
            t = edges.samples[key.edge].t[key.first : key.last + 1]
            error = error if draft.along_key else error[::-1]
            breaks = edges.edges[key.edge].breaks
            is_long = np.diff(t) > 1e-6 * (breaks[-1] - breaks[0])
            for k in np.flatnonzero((error > tolerance) & is_long):
                parts = int(np.clip(np.ceil((error[k] / tolerance) ** (1 / 3)), 2, 8))
                wanted[key.edge].append(np.linspace(t[k], t[k + 1], parts + 1)[1:-1])
    return {number: np.concatenate(parameters) for number, parameters in wanted.items()}


def _list_edge_runs(piece: PieceDraft) -> Iterator[tuple[EdgeRunKey, RunDraft]]:
    """Return the runs of a piece that are stretches of edges, with their keys."""
    return ((draft.key, draft) for loop in piece.loops for draft in loop if isinstance(draft.key, EdgeRunKey))


def find_face_mismatch(
    face: DividedPatch, pieces: Sequence[tuple[PieceDraft, Piece]], edges: SampledEdges
) -> tuple[GeometryError, float] | None:
    """Return how the strips of a face are not what they stand for: along an edge to another face, or in area.

    With it comes by which factor they are. Areas are compared of thin faces only; those of others follow from the
    tolerance.
    """
    if not face.strips or not pieces:
        return None
    along: dict[int, Array] = defaultdict(lambda: np.zeros(2))
    for one, _ in pieces:
        for key, draft in _list_edge_runs(one):
            along[key.edge] += edges.lengths[key.edge][key.first : key.last].sum(), draft.curve_lengths.sum()
    # a face that meets itself is as short on one side of the seam as on the other
    meets = {number for number in along if edges.edges[number].faces == 2 * edges.edges[number].faces[:1]}
    borders = {number: sums for number, sums in along.items() if number not in meets}
    for number, (edge, strips) in borders.items():
        if edge > (1 + _EDGE_EXCESS) * strips:
            excess = edge / strips - 1 if strips > 0 else np.inf
            error = GeometryError(
                f"edge {number} is {excess:.1%} longer than the strips that end there: the face is too narrow for the "
                "tolerance; choose a smaller one, or the other direction"
            )
            return error, excess / _EDGE_EXCESS
    around = sum(edge for edge, _ in borders.values())
    area = sum(piece.area for _, piece in pieces)
    thin = 2 * face.patch.area < _THIN_FACE * edges.tolerance * around
    can_refine = face.refinement < STRIP_TOLERANCES.max_refinement
    if thin and can_refine and abs(area - face.patch.area) > _AREA_MISMATCH * face.patch.area:
        error = GeometryError(
            f"its pieces have {area:.6g} of {face.patch.area:.6g} mm2: the face is too narrow for the tolerance; "
            "choose a smaller one, or the other direction"
        )
        return error, abs(area / face.patch.area - 1) / _AREA_MISMATCH
    return None


def find_self_overlapping(drafts: Sequence[PieceDraft], pieces: Sequence[Piece]) -> list[tuple[PieceDraft, bool]]:
    """Return what has become pieces that cover themselves, and whether they do so only because of their bows."""
    both = zip(drafts, pieces, strict=True)
    return [(one, not has_overlap(_straighten_runs(piece))) for one, piece in both if has_overlap(piece)]


def _straighten_runs(piece: Piece) -> Piece:
    """Return a piece with straight segments between its vertices."""
    loops = [[replace(run, path=Path.from_points(run.path.points)) for run in loop] for loop in piece.loops]
    return replace(piece, loops=tuple(map(tuple, loops)))
