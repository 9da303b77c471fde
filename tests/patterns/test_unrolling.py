"""Rounds of unrolling: faces are laid flat again only where that can change anything, and then nothing else changes."""

import runpy
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from places import EXAMPLES

from cqblend.brep.conversion.patch_reading import read_patches
from cqblend.patterns import unrolling
from cqblend.patterns.flattening.sampled_edges import SampledEdges
from cqblend.patterns.unrolling import unroll_patches
from cqblend.unroll_options import UnrollOptions


@cache
def teapot():
    """The teapot's patches, and a tolerance at which some of its faces are too narrow and have to be divided again."""
    solid = runpy.run_path(str(EXAMPLES / "unroll_models.py"))["teapot"]()
    return read_patches([solid.wrapped]), 1e-2 * solid.BoundingBox().DiagonalLength


@pytest.fixture
def rounds(monkeypatch):
    """For every round: the divided faces, the vertices that edges need, and the indices of faces that are laid."""
    found = []
    flatten, lay = unrolling.flatten_patch_loops, unrolling._UnrollState.lay_faces_flat

    def lay_and_note(state, edges, tell):
        required = {number: len(parameters) for number, parameters in state.required_parameters.items()}
        found.append((tuple(state.faces), required, set()))
        return lay(state, edges, tell)

    def flatten_and_note(face, *others):
        found[-1][2].add(face.patch.index)
        return flatten(face, *others)

    monkeypatch.setattr(unrolling._UnrollState, "lay_faces_flat", lay_and_note)
    monkeypatch.setattr(unrolling, "flatten_patch_loops", flatten_and_note)
    return found


def edges_of(face):
    return {use.edge for _, use in face.patch.list_uses()}


def test_only_faces_with_a_new_division_or_new_vertices_and_their_neighbours_are_laid_again(rounds):
    shell, tolerance = teapot()
    unroll_patches(shell, UnrollOptions(tolerance))
    assert len(rounds) > 2
    assert rounds[0][2] == {patch.index for patch in shell.patches}
    for (before, required_before, _), (after, required, laid) in pairwise(rounds):
        changed = {face.patch.index for face in after if face not in before}
        touched = {number for number, count in required.items() if count != required_before.get(number)}
        touched |= {number for face in after if face.patch.index in changed for number in edges_of(face)}
        may_change = {face.patch.index for face in after if edges_of(face) & touched}
        assert changed <= laid <= may_change
    assert min(len(laid) for *_, laid in rounds) < len(shell.patches) / 2


def list_arrays(result):
    return [
        array for piece in result.pieces.pieces for *_, run in piece.runs() for array in (run.path.points, run.space)
    ]


def test_what_is_kept_is_what_would_be_made_again(monkeypatch):
    shell, tolerance = teapot()
    kept = unroll_patches(shell, UnrollOptions(tolerance))
    monkeypatch.setattr(SampledEdges, "is_same_for", lambda *_: False)
    monkeypatch.setattr(
        unrolling,
        "SampledEdges",
        lambda shell, faces, options, required, _: SampledEdges(shell, faces, options, required),
    )
    flatten, assemble = unrolling.flatten_patch_loops, unrolling.assemble_pieces
    monkeypatch.setattr(unrolling, "flatten_patch_loops", lambda face, edges, options, _: flatten(face, edges, options))
    monkeypatch.setattr(unrolling, "assemble_pieces", lambda drafts, layout, _: assemble(drafts, layout, None))
    made = unroll_patches(shell, UnrollOptions(tolerance))
    assert kept.records == made.records
    assert kept.pieces.seams == made.pieces.seams
    for one, other in zip(list_arrays(kept), list_arrays(made), strict=True):
        assert np.array_equal(one, other)
