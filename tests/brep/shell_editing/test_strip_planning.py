"""Plans of blended solids: plain data, complete before anything is built, and built as they say."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX

from cqblend.blend_options import BlendOptions
from cqblend.blends.network.blend_plan import EdgePiece, FacePlan, NewEdge, PlannedVertex
from cqblend.brep.selection.picked_edges import select_chains
from cqblend.brep.shell_editing.plan_application import apply_plan
from cqblend.brep.shell_editing.strip_planning import ChainConflictError, _merge_face_plans, merge_chains
from cqblend.brep.topology import ShapeIndex
from cqblend.errors import TopologyError
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.network_draft import NetworkDrafts
from cqblend.solid_blends.section_methods import choose_section_method
from cqblend.solid_blends.strip_context import StripContext


def plan(body: cq.Shape, edges, radius: float):
    method = choose_section_method(BlendOptions(radius).to_request())
    selection = select_chains(body.wrapped, [edge.wrapped for edge in edges], None, None, follow=False)
    chains = [network[0].chain for network in selection.networks]
    contexts = [ChainContext(one, tuple(StripContext(cell, method) for cell in one.cells)) for one in chains]
    drafts = [draft for context in contexts for draft in NetworkDrafts([context]).make_first()]
    index = drafts[0].context.index
    return index, merge_chains(index, [draft.planned for draft in drafts])


def plate_with_holes() -> cq.Workplane:
    return cq.Workplane().box(30, 30, 5).faces(">Z").workplane().rarray(10, 10, 3, 3).hole(4)


def test_a_plan_of_one_edge_of_a_box_says_all_of_it():
    box = cq.Workplane().box(30, 20, 10)
    index, planned = plan(box.val(), box.edges("|Z and >X and >Y").vals(), 2)
    (strip,) = planned.strips
    assert len(planned.vertices) == 4
    assert all(vertex.number == 0 for vertex in planned.vertices)
    new = [edge for edge in planned.edges if isinstance(edge, NewEdge)]
    assert sorted(edge.role for edge in new) == ["end curve", "end curve", "rail", "rail"]
    assert sum(isinstance(edge, EdgePiece) for edge in planned.edges) == 4
    assert planned.removed_edges == strip.spine
    assert {face.number for face in planned.faces} >= set(strip.support_faces)
    assert len(planned.faces) == 4
    text = str(planned)
    assert text.splitlines()[0] == "4 new vertices, 8 edges made or cut"
    first, second = strip.support_faces
    assert f"blend of edge {strip.spine[0]} between faces {first} and {second}, 4 sides" in text
    assert text.count("1 end curve") == 2
    assert text.count("1 rail") == 2
    assert len(index.faces) == 6  # nothing is built yet


def test_what_is_built_is_what_was_planned():
    work = plate_with_holes()
    rims = work.faces(">Z").edges("%CIRCLE").vals()
    index, planned = plan(work.val(), rims, 0.5)
    proposal = apply_plan(index, planned)
    assert len(planned.strips) == len(proposal.strips) == len(rims)
    before, after = (ShapeIndex(solid, TopAbs_EDGE) for solid in (index.solid, proposal.solid))
    fresh = [edge for edge in after if edge not in before]
    assert len(fresh) == len(planned.edges)
    vertices = ShapeIndex(index.solid, TopAbs_VERTEX)
    fresh_vertices = [vertex for vertex in ShapeIndex(proposal.solid, TopAbs_VERTEX) if vertex not in vertices]
    points = np.array(sorted(tuple(np.round(BRep_Tool.Pnt_s(vertex).Coord(), 9)) for vertex in fresh_vertices))
    wanted = np.array(sorted(tuple(np.round(vertex.point, 9)) for vertex in planned.vertices))
    assert np.abs(points - wanted).max() < 1e-8
    faces = ShapeIndex(index.solid, TopAbs_FACE)
    untouched = [face for face in ShapeIndex(proposal.solid, TopAbs_FACE) if face in faces]
    assert len(untouched) == len(faces) - len(planned.faces)


def test_each_touched_face_is_planned_once_however_many_blends_it_has():
    work = plate_with_holes()
    _, planned = plan(work.val(), work.faces(">Z").edges("%CIRCLE").vals(), 0.5)
    numbers = [face.number for face in planned.faces]
    assert len(numbers) == len(set(numbers)) == 10
    assert max(len(face.pieces) for face in planned.faces) == 9


def test_a_seam_that_two_blends_cut_is_cut_once_at_both_ends():
    rod = cq.Workplane().cylinder(10, 5)
    _, planned = plan(rod.val(), rod.faces(">Z or <Z").edges().vals(), 1)
    pieces = [edge for edge in planned.edges if isinstance(edge, EdgePiece)]
    assert len(pieces) == 1
    (low, high) = pieces[0].span
    assert high - low == pytest.approx(8)
    assert not any(vertex.number for vertex in pieces[0].vertices)


def test_an_edge_that_two_blends_trim_is_trimmed_once():
    box = cq.Workplane().box(30, 20, 10)
    _, planned = plan(box.val(), box.edges("|Z").vals(), 2)
    pieces = [edge for edge in planned.edges if isinstance(edge, EdgePiece)]
    assert len(pieces) == 8
    lengths = sorted(round(piece.span[1] - piece.span[0], 9) for piece in pieces)
    assert lengths == [16.0] * 4 + [26.0] * 4


def test_strips_that_leave_nothing_of_an_edge_between_them_are_told_apart():
    box = cq.Workplane().box(30, 20, 10)
    with pytest.raises(ChainConflictError, match="nothing would remain of edge") as caught:
        plan(box.val(), box.edges("|Z and >X").vals(), 11)
    assert caught.value.chains == (0, 1)


def test_an_edge_is_not_replaced_twice():
    vertices = (PlannedVertex(np.zeros(3)), PlannedVertex(np.ones(3)))
    pieces = [(EdgePiece(7, (0.0, at), vertices),) for at in (0.5, 0.6)]
    with pytest.raises(TopologyError, match="face 3 of the solid, and its edge 7"):
        _merge_face_plans([FacePlan(3, {7: piece}) for piece in pieces])
