"""Chains on parts as people draw them: one valid solid, complete, smooth at every rail and joint, however it was asked.

What comes out is judged by the benchmarks' oracles, which share nothing with what they judge.
"""

from __future__ import annotations

import itertools

import cadquery as cq
import pytest

import cqblend
from benchmarks.blend_scores import Blended, Limits, score_blend
from benchmarks.everyday_parts import PARTS, at_height, box_with_larger_uprights, pocket_floor, rounded_box
from cqblend.__main__ import main

EXACT, COMPACT = Limits(gap=1e-9, angle=1e-10), Limits(angle=1e-5)


def judge(part, result, radius, **options):
    """Assert that a result is complete and sound."""
    limits = EXACT if result.certificate.form == "exact" else COMPACT
    faces = [face.wrapped for face in result.faces]
    edges = [edge.wrapped for edge in part.edges]
    blended = Blended(part.body.val().wrapped, edges, radius, result.shape.wrapped, faces)
    score = score_blend(blended, limits, **options)
    assert score.verdict == "complete", score.message


@pytest.mark.parametrize("maker", PARTS, ids=lambda maker: maker.__name__)
def test_one_pick_blends_the_whole_chain(maker):
    part = maker()
    result = cqblend.blend_edges(part.body, part.edges, part.radius)
    assert len(result.faces) == part.cells
    assert result.certificate.coverage == 1
    assert result.shape.isValid()
    assert len(result.shape.Solids()) == len(part.body.val().Solids())
    judge(part, result, part.radius)


def test_chain_false_blends_just_what_was_picked():
    part = box_with_larger_uprights()
    result = cqblend.blend_edges(part.body, part.edges, part.radius, chain=False)
    assert len(result.faces) == 1
    judge(part, result, part.radius, chain=False)


SELECTIONS = {
    "one edge": lambda body: body.edges(">Z and >Y"),
    "edges of a face": lambda body: body.faces(">Z").edges(),
    "a selector of all": lambda body: body.edges(">Z"),
    "a list, backwards": lambda body: body.edges(">Z").vals()[::-1],
    "some, each twice": lambda body: body.edges(">Z").vals()[2:5] * 2,
    "two apart": lambda body: body.edges(">Z").vals()[1:6:4],
}


@pytest.mark.parametrize("select", SELECTIONS.values(), ids=SELECTIONS.keys())
def test_however_it_is_selected_the_result_is_the_same(select):
    body = rounded_box(1.0).body
    wanted = cqblend.blend_edges(body, body.edges(">Z").vals()[0], 1.0)
    result = cqblend.blend_edges(body, select(body), 1.0)
    assert len(result.faces) == len(wanted.faces) == 8
    assert cqblend.verify(result.shape).volume == pytest.approx(cqblend.verify(wanted.shape).volume, rel=1e-12)


def test_both_rims_in_one_call_and_in_two_are_the_same():
    body = rounded_box(1.0).body
    once = cqblend.blend_edges(body, body.edges(">Z or <Z"), 1.0)
    assert len(once.faces) == 16
    volumes = [cqblend.verify(once.shape).volume]
    for first, second in ((">Z", "<Z"), ("<Z", ">Z")):
        half = body.edges(first).blend(1.0)
        volumes.append(cqblend.verify(half.edges(second).blend(1.0).val()).volume)
    assert volumes == pytest.approx(volumes[:1] * 3, rel=1e-9)


@pytest.mark.parametrize("levels", list(itertools.permutations([4, 12])), ids=str)
def test_floor_and_rim_of_a_pocket_in_either_order(levels):
    body = pocket_floor().body
    for z in levels:
        body = cq.Workplane(cqblend.blend_edges(body, at_height(body, z, within=20)[:1], 1.5).shape)
    assert body.val().isValid()
    assert cqblend.verify(body.val()).volume == pytest.approx(17641.65, abs=0.01)


@pytest.mark.parametrize("options", [{}, {"section": "hermite"}, {"continuity": "G2"}, {"form": "compact"}], ids=str)
def test_a_floor_goes_on_past_uprights_that_were_blended_before(options):
    """The smooth edges that the chain passes are rails of other blends, of any kind."""
    pocket = (
        cq.Workplane().box(50, 40, 12, centered=(True, True, False)).faces(">Z").workplane().rect(34, 24).cutBlind(-8)
    )
    upright = [edge for edge in pocket.edges("|Z").vals() if abs(edge.Center().x) < 20]
    body = cq.Workplane(cqblend.blend_edges(pocket, upright, 5, **options).shape)
    part = type(pocket_floor())(body, at_height(body, 4, within=20)[:1], 2.0, 8)
    result = cqblend.blend_edges(part.body, part.edges, part.radius)
    assert len(result.faces) == part.cells
    judge(part, result, part.radius)


@pytest.mark.parametrize("maker", [rounded_box, None], ids=["convex", "concave"])
def test_from_the_command_line(maker, tmp_path, capsys):
    part = pocket_floor() if maker is None else maker(1.0)
    source, target = tmp_path / "in.step", tmp_path / "out.step"
    cq.exporters.export(part.body, str(source))
    place = part.edges[0].Center()
    near = f"{place.x},{place.y},{place.z}"
    assert main(["blend", "--near", near, "--radius", f"{part.radius}", str(source), str(target)]) == 0
    assert "valid blend" in capsys.readouterr().out
    written = cq.importers.importStep(str(target)).val()
    assert written.isValid()
    assert len(written.Faces()) == len(part.body.val().Faces()) + part.cells
