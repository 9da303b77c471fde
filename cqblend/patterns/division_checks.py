"""Judges the division of a face by its flat pieces: by their borders, their areas, and whether they overlap themselves.

Only finds faults; :mod:`cqblend.patterns.unrolling` divides faulty faces anew.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from cqblend.errors import GeometryError
from cqblend.patterns.flattening.flat_face import DividedPatch
from cqblend.patterns.flattening.flat_loops import PieceDraft
from cqblend.patterns.flattening.sampled_edges import SampledEdges
from cqblend.patterns.outline.overlap import has_overlap
from cqblend.patterns.outline.pieces import Piece
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.patterns.tolerances import ASSEMBLY_TOLERANCES
from cqblend.patterns.trimming.boundary_run_draft import RunDraft
from cqblend.patterns.trimming.boundary_run_keys import EdgeRunKey
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import UnrollOptions

SelfOverlap = Literal["flat", "bent"]
"""Why a piece overlaps itself: with straight segments between its vertices, too, or only because these are bent."""


def find_missing_vertices(
    drafts: Sequence[PieceDraft], edges: SampledEdges, options: UnrollOptions
) -> dict[int, Array]:
    """Return, by number of the edge, parameters at which it needs more vertices: its flat curves are to be arcs.

    The error of an arc falls with the third power of its length.
    """
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
            is_long = np.diff(t) > ASSEMBLY_TOLERANCES.same_vertex * (breaks[-1] - breaks[0])
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
    """Return an error if the strips of a face are too short along an edge to another face, or differ from it in area.

    With it comes the ratio of the mismatch to the allowed one. Areas are compared of thin faces only; the area of
    others follows from the tolerance.

    Parameters
    ----------
    face
        The divided face.
    pieces
        Its pieces, with the drafts that they were made of.
    edges
        The vertices along all edges.
    """
    if not face.strips or not pieces:
        return None
    limits = ASSEMBLY_TOLERANCES
    lengths: dict[int, Array] = defaultdict(lambda: np.zeros(2))  # by number of the edge: its own, and of the pieces
    for draft, _ in pieces:
        for key, run in _list_edge_runs(draft):
            lengths[key.edge] += edges.lengths[key.edge][key.first : key.last].sum(), run.curve_lengths.sum()
    # where a face meets itself, its strips are equally short on both sides of the seam
    self_joints = {number for number in lengths if edges.edges[number].faces == 2 * edges.edges[number].faces[:1]}
    borders = {number: pair for number, pair in lengths.items() if number not in self_joints}
    for number, (edge, strips) in borders.items():
        if edge > (1 + limits.edge_excess) * strips:
            excess = edge / strips - 1 if strips > 0 else np.inf
            error = GeometryError(
                f"edge {number} is {excess:.1%} longer than the strips that end there: the face is too narrow for the "
                "tolerance; choose a smaller one, or the other direction"
            )
            return error, excess / limits.edge_excess
    border_length = sum(edge for edge, _ in borders.values())
    area = sum(piece.area for _, piece in pieces)
    is_thin = 2 * face.patch.area < limits.thin_face * edges.tolerance * border_length
    can_refine = face.refinement < STRIP_TOLERANCES.max_refinement
    if is_thin and can_refine and abs(area - face.patch.area) > limits.area_mismatch * face.patch.area:
        error = GeometryError(
            f"its pieces have {area:.6g} of {face.patch.area:.6g} mm2: the face is too narrow for the tolerance; "
            "choose a smaller one, or the other direction"
        )
        return error, abs(area / face.patch.area - 1) / limits.area_mismatch
    return None


def find_self_overlap(piece: Piece) -> SelfOverlap | None:
    """Return why a piece overlaps itself, None if it does not."""
    if not has_overlap(piece):
        return None
    return "flat" if has_overlap(_straighten_runs(piece)) else "bent"


def _straighten_runs(piece: Piece) -> Piece:
    """Return a piece with straight segments between its vertices."""
    loops = [[replace(run, path=Path.from_points(run.path.points)) for run in loop] for loop in piece.loops]
    return replace(piece, loops=tuple(map(tuple, loops)))
