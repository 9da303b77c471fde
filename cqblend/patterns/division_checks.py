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
from cqblend.patterns.trimming.boundary_run_draft import RunDraft, subdivide_parameters
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


def find_border_mismatch(face: DividedPatch, edges: SampledEdges) -> tuple[GeometryError, float] | None:
    """Return an error if the strips of a face are too short in space along an edge to another face.

    With it comes the ratio of the mismatch to the allowed one.
    """
    limit = ASSEMBLY_TOLERANCES.edge_excess
    for number, strips in measure_borders(face, edges).items():
        edge = float(edges.lengths[number].sum())
        if edge > (1 + limit) * strips:
            excess = edge / strips - 1 if strips > 0 else np.inf
            error = GeometryError(
                f"edge {number} is {excess:.1%} longer than the strips that end there: the face is too narrow for the "
                "tolerance; choose a smaller one, or the other direction"
            )
            return error, excess / limit
    return None


def measure_borders(face: DividedPatch, edges: SampledEdges) -> dict[int, float]:
    """Return, by number of the edge, the lengths of the borders of a face's strips in space, mm.

    Left out are edges that could not be sampled, and those at which the face meets itself: there its strips are equally
    short on both sides of the seam.
    """
    numbers: list[int] = []
    chains: list[Array] = []
    for key, use in face.patch.list_uses():
        faces = edges.edges[use.edge].faces
        if use.edge in edges.samples and faces != 2 * faces[:1] and face.strips:
            vertices = edges.use_points[key]
            inner = use.pcurve(subdivide_parameters(edges.samples[use.edge].t).ravel())
            parts = np.concatenate([vertices[:-1, None], inner.reshape(len(vertices) - 1, -1, 2)], axis=1)
            chains.append(np.concatenate([parts.reshape(-1, 2), vertices[-1:]]))
            numbers.append(use.edge)
    if not chains:
        return {}
    starts, stops = (np.concatenate([chain[part] for chain in chains]) for part in (slice(None, -1), slice(1, None)))
    (t, across), middles = face.to_rail_axes(np.stack([starts, stops]).reshape(-1, 2)), (starts + stops) / 2
    owners = np.searchsorted(face.make_cut_lines().strip_borders, face.to_rail_axes(middles)[1])
    points = np.empty((2, len(starts), 3))
    for strip_index in np.unique(owners).tolist():
        own = owners == strip_index
        both = np.tile(own, 2)
        points[:, own] = face.strips[strip_index].locate_points(t[both], across[both]).reshape(2, -1, 3)
    steps = np.linalg.norm(points[1] - points[0], axis=1)
    lengths = np.add.reduceat(steps, np.cumsum([0] + [len(chain) - 1 for chain in chains[:-1]]))
    return dict(zip(numbers, lengths.tolist(), strict=True))


def find_area_mismatch(
    face: DividedPatch, pieces: Sequence[Piece], edges: SampledEdges
) -> tuple[GeometryError, float] | None:
    """Return an error if the pieces of a thin face differ from it in area, with the ratio to what is allowed.

    The area of other faces follows from the tolerance.
    """
    limits = ASSEMBLY_TOLERANCES
    if not face.strips or not pieces or face.refinement >= STRIP_TOLERANCES.max_refinement:
        return None
    borders = {use.edge for _, use in face.patch.list_uses() if edges.edges[use.edge].faces != 2 * (face.patch.index,)}
    border_length = sum(float(edges.lengths[number].sum()) for number in borders)
    is_thin = 2 * face.patch.area < limits.thin_face * edges.tolerance * border_length
    area = sum(piece.area for piece in pieces)
    if not is_thin or abs(area - face.patch.area) <= limits.area_mismatch * face.patch.area:
        return None
    error = GeometryError(
        f"its pieces have {area:.6g} of {face.patch.area:.6g} mm2: the face is too narrow for the tolerance; "
        "choose a smaller one, or the other direction"
    )
    return error, abs(area / face.patch.area - 1) / limits.area_mismatch


def find_self_overlap(piece: Piece) -> SelfOverlap | None:
    """Return why a piece overlaps itself, None if it does not."""
    if not has_overlap(piece):
        return None
    return "flat" if has_overlap(_straighten_runs(piece)) else "bent"


def _straighten_runs(piece: Piece) -> Piece:
    """Return a piece with straight segments between its vertices."""
    loops = [[replace(run, path=Path.from_points(run.path.points)) for run in loop] for loop in piece.loops]
    return replace(piece, loops=tuple(map(tuple, loops)))
