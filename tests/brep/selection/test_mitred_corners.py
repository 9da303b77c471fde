"""Corners that are found where two of the blended edges and another one meet."""

from __future__ import annotations

import cadquery as cq
import numpy as np

from cqblend.brep.selection.blend_corners import find_mitres
from cqblend.brep.selection.picked_edges import select_chains
from cqblend.brep.topology import locate_vertex


def find(body: cq.Shape, edges):
    """Return the chains of the one network that edges are, and its mitres."""
    (network,) = select_chains(body.wrapped, [edge.wrapped for edge in edges], None, None, follow=True).networks
    chains = [one.chain for one in network]
    return chains, find_mitres(chains)


def test_every_corner_of_the_top_of_a_box_is_a_mitre_around_the_top():
    work = cq.Workplane().box(20, 14, 10)
    chains, corners = find(work.val(), work.edges(">Z").vals())
    assert len(corners) == 4
    assert sorted((end.chain, end.end) for corner in corners for end in corner.ends) == [
        (chain, end) for chain in range(4) for end in (0, 1)
    ]
    for corner in corners:
        assert corner.method == "mitre"
        first, second = corner.ends
        joints = [chains[end.chain].cells[-end.end] for end in (first, second)]
        vertices = [joint.spine.vertices[end.end] for joint, end in zip(joints, (first, second), strict=True)]
        assert vertices[0].IsSame(vertices[1])
        assert joints[0].index.vertices.find_number(vertices[0]) == corner.vertex
        # Seen from above, the way from the first edge over the top to the second is counter-clockwise.
        arms = [cq.Vector(*joint.spine.evaluate_points(np.array([0.5]))[0]) for joint in joints]
        arms = [arm - cq.Vector(*locate_vertex(vertices[0])) for arm in arms]
        assert arms[0].cross(arms[1]).z > 0


def test_a_vertex_of_three_blended_edges_and_one_of_four_faces_are_no_mitres():
    work = cq.Workplane().box(20, 14, 10)
    assert len(find(work.val(), work.edges(">Z or (|Z and >X and >Y)").vals())[1]) == 3
    pyramid = cq.Workplane().rect(20, 20).workplane(offset=10).rect(8, 8).loft()
    tip = pyramid.faces(">Z").workplane().rect(8, 8).workplane(offset=4).rect(0.5, 0.5).loft(combine=True)
    assert tip.val().isValid()
    _, corners = find(tip.val(), [edge for edge in tip.val().Edges() if abs(edge.Center().z - 10) < 1e-6])
    assert corners == []  # a second sharp edge goes up from each


def test_edges_of_different_convexity_are_no_mitre():
    low = cq.Workplane().box(20, 20, 4, centered=(False, False, False))
    step = low.union(cq.Workplane().box(8, 20, 10, centered=(False, False, False)))
    vertex = cq.Vector(8, 0, 4)
    at_vertex = [
        edge
        for edge in step.val().Edges()
        if min((point - vertex).Length for point in (edge.startPoint(), edge.endPoint())) < 1e-6
    ]
    foot = next(edge for edge in at_vertex if abs(edge.Center().x - 8) < 1e-6 and abs(edge.Center().z - 4) < 1e-6)
    rim = next(edge for edge in at_vertex if edge.Center().x > 9)
    assert find(step.val(), [foot, rim])[1] == []
