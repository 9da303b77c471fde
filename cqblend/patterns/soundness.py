"""What may be wrong with faces that are laid flat: told before it is returned.

Exists because a division is judged by its pieces: by their borders, their area, and whether they cover themselves. What
is done about it is not known here.
"""

from collections import defaultdict
from collections.abc import Hashable, Sequence
from dataclasses import replace

import numpy as np

from cqblend.errors import GeometryError
from cqblend.patterns.flatten.flat_face import DividedPatch
from cqblend.patterns.outline.overlap import has_overlap
from cqblend.patterns.outline.pieces import Piece
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.strips.division_ways import MAX_REFINE_FACTOR
from cqblend.patterns.trim.flat_loops import PieceDraft, SampledEdges
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import UnrollOptions

_AREA_MISMATCH, _THIN_FACE = 0.02, 4.0
"""By how much pieces may differ from their face in area, relative, if that is thinner than so many tolerances."""

_EDGE_EXCESS = 0.02
"""By how much an edge may be longer than the ends of strips along it, relative."""


def add_edge_vertices(
    extra: dict[int, Array], laid: Sequence[PieceDraft], edges: SampledEdges, wishes: UnrollOptions
) -> bool:
    """Add vertices to edges whose flat curves arcs between their vertices do not follow; whether any were."""
    wanted: dict[int, list[Array]] = defaultdict(list)
    for one in laid:
        tolerance = wishes.flat / one.face.finer
        for draft in (draft for loop in one.loops for draft in loop if is_edge_key(draft.key) and draft.kind != "end"):
            assert isinstance(draft.key, tuple)
            _, number, low, high = draft.key
            off = replace(draft, lengths=draft.curve_lengths).measure_arc_error()
            t = edges.samples[number].t[low : high + 1]
            off = off if draft.rising else off[::-1]
            long = np.diff(t) > 1e-6 * (edges.edges[number].breaks[-1] - edges.edges[number].breaks[0])
            for k in np.flatnonzero((off > tolerance) & long):
                parts = int(np.clip(np.ceil((off[k] / tolerance) ** (1 / 3)), 2, 8))
                wanted[number].append(np.linspace(t[k], t[k + 1], parts + 1)[1:-1])
    for number, places in wanted.items():
        extra[number] = np.concatenate([extra.get(number, np.empty(0)), *places])
    return bool(wanted)


def is_edge_key(key: Hashable | None) -> bool:
    """Return whether the key of a draft is that of a stretch of an edge."""
    return isinstance(key, tuple) and key[0] == "edge"


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
        for draft in (draft for loop in one.loops for draft in loop if is_edge_key(draft.key)):
            assert isinstance(draft.key, tuple)
            _, number, low, high = draft.key
            along[number] += edges.lengths[number][low:high].sum(), draft.curve_lengths.sum()
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
    if thin and face.finer < MAX_REFINE_FACTOR and abs(area - face.patch.area) > _AREA_MISMATCH * face.patch.area:
        error = GeometryError(
            f"its pieces have {area:.6g} of {face.patch.area:.6g} mm2: the face is too narrow for the tolerance; "
            "choose a smaller one, or the other direction"
        )
        return error, abs(area / face.patch.area - 1) / _AREA_MISMATCH
    return None


def find_self_overlapping(laid: Sequence[PieceDraft], pieces: Sequence[Piece]) -> list[tuple[PieceDraft, bool]]:
    """Return what has become pieces that cover themselves, and whether they do so only because of their bows."""
    both = zip(laid, pieces, strict=True)
    return [(one, not has_overlap(_straighten_runs(piece))) for one, piece in both if has_overlap(piece)]


def _straighten_runs(piece: Piece) -> Piece:
    """Return a piece with straight segments between its vertices."""
    loops = [[replace(run, path=Path.from_points(run.path.points)) for run in loop] for loop in piece.loops]
    return replace(piece, loops=tuple(map(tuple, loops)))
