"""Chains: which edges follow one another, where chains end, and that it does not matter which of them are picked."""

from __future__ import annotations

import math
from itertools import permutations

import cadquery as cq
import numpy as np
import pytest
from chain_witness import ChainWitness
from chained_solids import (
    chamfered,
    d_shape,
    fading_block,
    letters,
    pocket,
    rounded_box,
    rounded_by_blend,
    sheared_prism,
    slot,
    spline_outline,
    tapered,
)
from OCP.BRep import BRep_Tool
from OCP.BRepAlgoAPI import BRepAlgoAPI_Splitter
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
from OCP.BRepLib import BRepLib
from OCP.GCE2d import GCE2d_MakeSegment
from OCP.gp import gp_Pnt2d
from OCP.TopAbs import TopAbs_SOLID
from OCP.TopTools import TopTools_ListOfShape
from places import CASES

from cqblend.brep.selection.chain_tracing import trace_chain
from cqblend.brep.selection.chains import Chain
from cqblend.brep.selection.picked_edges import select_chains
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.step_files import read_step
from cqblend.brep.topology import explore_subshapes

W, V = cq.Workplane, cq.Vector


BODIES = [
    rounded_box, slot, d_shape, spline_outline, tapered, letters, pocket, sheared_prism, chamfered, rounded_by_blend,
]  # fmt: skip


def trace_all(index: SolidIndex) -> dict[int, tuple[list[int], tuple[str, ...]]]:
    """Return the numbers of the edges of the chain through every sharp edge of a solid, and why it ends."""
    found = {}
    for number in range(1, len(index.edges) + 1):
        edge = index.edges[number]
        angles = index.measure_dihedral_angles(edge)
        if angles is not None and angles.is_sharp:
            trace = trace_chain(index, index.find_sides(edge))
            found[number] = ([index.edges.find_number(one.use) for one in trace.edges], trace.ends)
    return found


def check_traces(solid) -> int:
    """Compare the chains of a solid with those that the witness finds; return how many edges they go on in."""
    index, witness = SolidIndex(solid), ChainWitness(solid)
    chains = trace_all(index)
    sharp = {number for number, kind in witness.kinds.items() if kind in ("convex", "concave")}
    assert set(chains) == sharp
    followed = 0
    for number, (edges, _) in chains.items():
        expected = {number}
        while True:
            beyond = {k for one in expected for end in (0, 1) for k in witness.find_following(one, end)} - expected
            if not beyond:
                break
            expected |= beyond
        assert set(edges) == expected
        assert len(edges) == len(expected)
        followed += len(edges) > 1
    return followed


@pytest.mark.parametrize("make", BODIES)
def test_chains_are_those_that_brute_force_finds(make):
    assert sum(map(check_traces, explore_subshapes(make().wrapped, TopAbs_SOLID))) > 0


@pytest.mark.skipif(not CASES.is_dir(), reason="the STEP cases are not at hand")
@pytest.mark.parametrize(
    "name",
    [
        "bd__M6-1x12-countersunk-screw.step",
        "nist__nist_ctc_01_asme1_ap242-e1.stp",
        "nist__nist_ctc_05_asme1_ap242-e1.stp",
        "occt__trj2_io1-ca-214.stp",
    ],
)
def test_chains_of_real_parts_are_those_that_brute_force_finds(name):
    assert sum(map(check_traces, explore_subshapes(read_step(CASES / name), TopAbs_SOLID))) > 0


def select(body: cq.Shape, edges, first: cq.Face | None = None, *, follow: bool = True) -> list[Chain]:
    picked = [edge.wrapped for edge in edges]
    selection = select_chains(body.wrapped, picked, first and first.wrapped, None, follow=follow)
    return [found.chain for network in selection.networks for found in network]


def rim(body: cq.Shape) -> list[cq.Edge]:
    return W(body).faces(">Z").edges().vals()


def describe(chain: Chain) -> list:
    return [(cell.edge_number, cell.face_numbers) for cell in chain.cells]


def sort_cyclically(rows: list) -> list:
    start = rows.index(min(rows))
    return rows[start:] + rows[:start]


def test_the_rim_of_a_rounded_box_is_one_closed_chain_of_eight_cells():
    body = rounded_box()
    (chain,) = select(body, rim(body)[:1])
    assert chain.closed
    assert len(chain.cells) == len(chain.junctions) == 8
    assert chain.ends == ()
    assert {cell.edge_number for cell in chain.cells} == {body.Edges().index(edge) + 1 for edge in rim(body)}
    for k, (cell, junction) in enumerate(zip(chain.cells, chain.junctions, strict=True)):
        after = chain.cells[(k + 1) % 8]
        assert not cell.spine.closed
        assert cell.spine.vertices[1].IsSame(junction.vertex)
        assert after.spine.vertices[0].IsSame(junction.vertex)
        assert sorted(map(len, junction.crossed)) == [0, 1]


def test_sides_and_sense_are_the_same_all_along():
    body = rounded_box()
    top = W(body).faces(">Z").val()
    for edge in rim(body):
        for first in (top, next(f for f in edge.ancestors(body, "Face").Faces() if not f.isSame(top))):
            (chain,) = select(body, [edge], first)
            is_top = [[side.face.IsSame(top.wrapped) for side in cell.sides] for cell in chain.cells]
            assert is_top == [[first is top, first is not top]] * 8
            points = np.concatenate([cell.spine.evaluate_points(np.linspace(0, 1, 9))[:-1] for cell in chain.cells])
            x, y = points[:, 0], points[:, 1]
            turns = (x * np.roll(y, -1) - np.roll(x, -1) * y).sum()
            assert (turns > 0) == (first is top)  # counter-clockwise with the top to the left


def test_it_does_not_matter_which_edges_of_a_chain_are_picked_and_in_which_order():
    body = slot()
    edges = rim(body)
    lowest = min(edges, key=lambda edge: body.Edges().index(edge))
    (expected,) = select(body, [lowest])
    for order in permutations(edges):
        (chain,) = select(body, [*order, order[0]])
        assert describe(chain) == describe(expected)
    others = [edge for edge in edges if edge is not lowest]
    (chain,) = select(body, others)
    assert sort_cyclically(describe(chain)) == sort_cyclically(describe(expected))
    assert chain.cells[0].edge_number == min(body.Edges().index(edge) + 1 for edge in others)


def test_only_what_is_picked_without_following():
    body = rounded_box()
    edges = sorted(rim(body), key=lambda edge: math.atan2(edge.Center().y, edge.Center().x))
    (chain,) = select(body, [edges[2], edges[0], edges[1]], follow=False)
    numbers = [body.Edges().index(edge) + 1 for edge in edges[:3]]
    assert [cell.edge_number for cell in chain.cells] in (numbers, numbers[::-1])
    assert chain.ends == ("not picked", "not picked")
    assert not chain.closed
    assert len(select(body, [edges[0], edges[2]], follow=False)) == 2
    (whole,) = select(body, edges, follow=False)
    assert whole.closed
    assert len(whole.cells) == 8


def test_corners_end_a_chain():
    body = d_shape()
    (chain,) = select(body, [edge for edge in rim(body) if edge.geomType() == "CIRCLE"])
    assert not chain.closed
    assert chain.ends == ("corner", "corner")
    assert [cell.spine.length for cell in chain.cells] == pytest.approx([10, 6 * math.pi, 10])
    (alone,) = select(body, [edge for edge in rim(body) if edge.Center().x < 1])
    assert len(alone.cells) == 1


def test_a_sharp_edge_that_meets_the_chain_from_a_side_ends_it():
    """Two prisms side by side with one straight top edge, but fronts of different slopes, and a wall between these."""
    left = W("YZ").polyline([(0, 0), (10, 0), (10, -10), (0, -10)]).close().extrude(-20)
    right = W("YZ").polyline([(0, 0), (10, 0), (10, -10), (4, -10)]).close().extrude(20)
    body = left.union(right, clean=True).val()
    edge = min(body.Edges(), key=lambda one: (one.Center() - V(10, 0, 0)).Length)
    (chain,) = select(body, [edge])
    assert len(chain.cells) == 1
    assert sorted(chain.ends) == ["corner", "sharp edge"]


def test_a_chain_ends_where_its_faces_become_tangent():
    body = fading_block()
    assert body.isValid()
    edge = min(body.Edges(), key=lambda one: (one.Center() - V(10, 0, 0)).Length)
    (chain,) = select(body, [edge])
    (cell,) = chain.cells
    starts_at_fading = cell.spine.evaluate_points(np.array([0.0]))[0, 0] < 1
    assert chain.ends == (("fading", "corner") if starts_at_fading else ("corner", "fading"))


def split_side(can: cq.Shape) -> cq.Shape:
    """A can whose side is divided by two lines from the seam's upper end: slivers with a tip there."""
    side = next(face for face in can.Faces() if face.geomType() == "CYLINDER").wrapped
    cans, lines = TopTools_ListOfShape(), TopTools_ListOfShape()
    cans.Append(can.wrapped)
    for start, stop in ((0.0, 0.6), (2 * math.pi, 2 * math.pi - 0.6)):
        line = GCE2d_MakeSegment(gp_Pnt2d(start, 8.0), gp_Pnt2d(stop, 0.0)).Value()
        edge = BRepBuilderAPI_MakeEdge(line, BRep_Tool.Surface_s(side)).Edge()
        BRepLib.BuildCurves3d_s(edge)
        lines.Append(edge)
    splitter = BRepAlgoAPI_Splitter()
    splitter.SetArguments(cans)
    splitter.SetTools(lines)
    splitter.Build()
    return cq.Shape.cast(splitter.Shape())


def test_an_edge_that_closes_past_other_faces_is_one_cell_with_a_junction():
    body = split_side(cq.Solid.makeCylinder(5, 8))
    assert len(body.Faces()) > 3
    (edge,) = (e for e in body.Edges() if e.geomType() == "CIRCLE" and e.Center().z > 7)
    (chain,) = select(body, [edge])
    assert chain.closed
    (cell,), (junction,) = chain.cells, chain.junctions
    assert not cell.spine.closed
    assert sorted(map(len, junction.crossed)) == [0, 3]  # both lines and the seam between the slivers


def test_a_ring_split_by_vertices_is_one_cell():
    body = W().circle(8).extrude(3).union(W().circle(4).extrude(9)).val().Solids()[0]
    circles = [e for e in body.Edges() if e.geomType() == "CIRCLE"]
    for circle in circles:
        (chain,) = select(body, [circle])
        assert chain.closed
        assert len(chain.cells) == 1
        assert chain.junctions == ()
        assert chain.cells[0].spine.closed
