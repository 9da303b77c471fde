"""Unrolls the patches of a shape to flat pieces: divides, flattens and trims them, and joins the borders by seams.

Divisions whose pieces are faulty are replaced, see :mod:`cqblend.patterns.division_checks`, until there are none. What
has been laid flat stays as it is where neither the division of the face nor the vertices on its edges have changed.
Depends on strips, flattening and trimming, not on OCCT, tabs, sheets or files.
"""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from cqblend.errors import CqblendError, Failure, GeometryError
from cqblend.patterns.division_checks import (
    SelfOverlap,
    find_area_mismatch,
    find_border_mismatch,
    find_missing_vertices,
    find_self_overlap,
)
from cqblend.patterns.flattening.face_division import (
    cut_strips_across,
    divide_finer,
    divide_other_way,
    divide_patches,
    merge_thin_strips,
)
from cqblend.patterns.flattening.flat_face import DividedPatch
from cqblend.patterns.flattening.flat_loops import PieceDraft, flatten_patch_loops
from cqblend.patterns.flattening.sampled_edges import SampledEdges
from cqblend.patterns.outline.pieces import Piece
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.piece_assembly import AssembledPieces, assemble_pieces, join_pieces, measure_mean_width
from cqblend.patterns.tolerances import ASSEMBLY_TOLERANCES
from cqblend.patterns.trimming.trimmed_patch import Patch, PatchShell
from cqblend.patterns.unroll_result import UnrollResult
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
    state = _UnrollState(shell, options, failures=[Failure((face,), error) for face, error in shell.refused.items()])
    dividing = ASSEMBLY_TOLERANCES.dividing_share
    count = len(shell.patches)
    state.divide_patches(lambda i: tell(dividing * i / count, f"dividing face {shell.patches[i].index}"))
    rounds = 0
    while True:
        edges = state.sample_edges()
        if state.redivide_short(edges) or state.lay_faces_flat(edges, tell):
            continue
        rounds += 1
        if rounds < ASSEMBLY_TOLERANCES.most_rounds and state.require_missing_vertices():
            continue
        assembled = state.assemble_pieces()
        if not (state.redivide_faulty(assembled, edges) or state.merge_thin_strips(assembled)):
            return join_pieces(assembled, shell, state.failures)


@dataclass(frozen=True, slots=True, eq=False)
class _LaidFace:
    """A face laid flat.

    Attributes
    ----------
    face
        As it was divided.
    edges
        With the vertices on its borders.
    drafts
        Of its pieces.
    missing
        By number of the edge: parameters at which its borders need more vertices.
    """

    face: DividedPatch
    edges: SampledEdges
    drafts: list[PieceDraft]
    missing: dict[int, Array]


@dataclass(slots=True, eq=False)
class _UnrollState:
    """The divided faces that are being unrolled, the faces that failed, and what is known from earlier rounds.

    Attributes
    ----------
    shell, options
        What is unrolled, and how.
    failures
        Faces that cannot be unrolled, and why.
    faces
        The others, divided.
    required_parameters
        By number of the edge: where it needs vertices.
    edges, matching, laid, assembled, overlaps
        The last edges; by index of the patch, the faces whose strips are as long as their edges, and the faces as they
        were laid flat; the last pieces; by draft, its paths and whether they overlap.
    """

    shell: PatchShell
    options: UnrollOptions
    failures: list[Failure]
    faces: list[DividedPatch] = field(default_factory=list)
    required_parameters: dict[int, Array] = field(default_factory=dict)
    edges: SampledEdges | None = None
    matching: dict[int, DividedPatch] = field(default_factory=dict)
    laid: dict[int, _LaidFace] = field(default_factory=dict)
    assembled: AssembledPieces | None = None
    overlaps: dict[PieceDraft, tuple[tuple[Path, ...], SelfOverlap | None]] = field(default_factory=dict)

    def divide_patches(self, tell: Callable[[int], object]) -> None:
        """Divide all patches, and note those that cannot be; `tell` is called with the index of each."""
        divided = divide_patches(self.shell.patches, self.options, tell)
        for patch, found in zip(self.shell.patches, divided, strict=True):
            if isinstance(found, CqblendError):
                self.failures.append(_make_failure(patch, found))
            else:
                self.faces.append(found)

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

    def sample_edges(self) -> SampledEdges:
        """Choose the vertices along all edges."""
        self.edges = SampledEdges(self.shell, self.faces, self.options, self.required_parameters, self.edges)
        return self.edges

    def lay_faces_flat(self, edges: SampledEdges, tell: Progress) -> bool:
        """Lay faces flat that have changed; return whether one had to be divided another way instead."""
        has_new_division = False
        dividing = ASSEMBLY_TOLERANCES.dividing_share
        for i, face in enumerate(tuple(self.faces)):
            tell(dividing + (1 - dividing) * i / len(self.faces), f"laying face {face.patch.index} flat")
            known = self.laid.get(face.patch.index)
            if known is not None and known.face is face and edges.is_same_for(face, known.edges):
                continue
            strips = [draft.unrolled_strip for draft in known.drafts] if known else []
            known_strips = {strip.strip: strip for strip in strips if strip is not None}
            try:
                drafts = flatten_patch_loops(face, edges, self.options, known_strips)
            except CqblendError as error:
                divide = partial(divide_other_way, face, self.options, error)
                has_new_division |= self.replace_division(face, divide)
            else:
                missing = find_missing_vertices(drafts, edges, self.options)
                self.laid[face.patch.index] = _LaidFace(face, edges, drafts, missing)
        return has_new_division

    def require_missing_vertices(self) -> bool:
        """Require the vertices that flat borders need to be arcs; return whether there are any."""
        found = False
        for face in self.faces:
            for number, parameters in self.laid[face.patch.index].missing.items():
                known = self.required_parameters.get(number, np.empty(0))
                self.required_parameters[number] = np.concatenate([known, parameters])
                found = True
        return found

    def assemble_pieces(self) -> AssembledPieces:
        """Make pieces of all faces."""
        drafts = [draft for face in self.faces for draft in self.laid[face.patch.index].drafts]
        self.assembled = assemble_pieces(drafts, self.options.layout, self.assembled)
        return self.assembled

    def redivide_faulty(self, assembled: AssembledPieces, edges: SampledEdges) -> bool:
        """Divide faces anew whose pieces overlap themselves or miss its area; return whether there were any.

        Strips whose pieces overlap are cut across. If they do so only because their borders are bent, or miss the area
        of the face, it is divided with a finer tolerance.
        """
        overlaps = self._find_self_overlaps(assembled)
        pieces: dict[int, list[Piece]] = defaultdict(list)
        for draft, piece in zip(assembled.drafts, assembled.pieces, strict=True):
            pieces[draft.face.patch.index].append(piece)
        found = False
        for face in tuple(self.faces):
            own = [(draft, overlap) for draft, overlap in overlaps if draft.face is face]
            cuts = [(draft.strip_index, sum(draft.rail_extent) / 2) for draft, overlap in own if overlap == "flat"]
            if cuts:
                self.replace_division(face, partial(cut_strips_across, face, cuts))
            elif own:
                self.replace_division(face, partial(divide_finer, face, self.options, _SELF_OVERLAP_ERROR))
            elif (mismatch := find_area_mismatch(face, pieces[face.patch.index], edges)) is not None:
                self._divide_finer(face, *mismatch)
            else:
                continue
            found = True
        return found

    def redivide_short(self, edges: SampledEdges) -> bool:
        """Divide faces finer whose strips are too short for their edges; return whether there were any."""
        found = False
        for face in tuple(self.faces):
            if self.matching.get(face.patch.index) is face:
                continue
            mismatch = find_border_mismatch(face, edges)
            if mismatch is None:
                self.matching[face.patch.index] = face
            else:
                self._divide_finer(face, *mismatch)
                found = True
        return found

    def _divide_finer(self, face: DividedPatch, error: GeometryError, mismatch: float) -> None:
        """Divide a face finer because of an error, given the ratio of a mismatch to the allowed one."""
        factor = ASSEMBLY_TOLERANCES.refinement_margin * mismatch
        self.replace_division(face, partial(divide_finer, face, self.options, error, factor))

    def _find_self_overlaps(self, assembled: AssembledPieces) -> list[tuple[PieceDraft, SelfOverlap]]:
        """Return the drafts of pieces that overlap themselves, and why; of unchanged pieces that is known."""
        known, self.overlaps = self.overlaps, {}
        for draft, piece in zip(assembled.drafts, assembled.pieces, strict=True):
            paths = tuple(run.path for *_, run in piece.runs())
            earlier = known.get(draft)
            if earlier is None or earlier[0] != paths:
                earlier = paths, find_self_overlap(piece)
            self.overlaps[draft] = earlier
        return [(draft, overlap) for draft, (_, overlap) in self.overlaps.items() if overlap is not None]

    def merge_thin_strips(self, assembled: AssembledPieces) -> bool:
        """Merge strips whose pieces are too thin with their neighbours; return whether any division changed."""
        least = self.options.least_width
        if least is None:
            return False
        thin: dict[int, set[int]] = defaultdict(set)
        wide: set[int] = set()
        for draft, piece in zip(assembled.drafts, assembled.pieces, strict=True):
            if measure_mean_width(piece) < least:
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
