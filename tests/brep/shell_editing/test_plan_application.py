"""Edits of face boundaries: how the new boundary is traced to loops."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from OCP.TopAbs import TopAbs_EDGE

from cqblend.brep.shell_editing.plan_application import trace_loops
from cqblend.brep.topology import explore_subshapes, find_end_vertices, reverse_edge
from cqblend.errors import TopologyError


def face_with_hole() -> cq.Face:
    return cq.Workplane().rect(10, 10).extrude(1).faces(">Z").workplane().hole(4).faces(">Z").val()


@pytest.mark.parametrize("seed", range(4))
def test_loops_are_found_from_shuffled_uses(seed):
    face = face_with_hole().wrapped
    uses = list(explore_subshapes(face, TopAbs_EDGE))
    order = np.random.default_rng(seed).permutation(len(uses))
    loops = trace_loops([uses[i] for i in order], face)
    assert sorted(len(loop) for loop in loops) == [1, 4]
    for loop in loops:
        for one, other in zip(loop, loop[1:] + loop[:1], strict=True):
            assert find_end_vertices(one)[1].IsSame(find_end_vertices(other)[0])


def test_a_seam_is_traced_once_each_way():
    face = next(f for f in cq.Solid.makeCylinder(3, 7).Faces() if f.geomType() == "CYLINDER").wrapped
    (loop,) = trace_loops(list(explore_subshapes(face, TopAbs_EDGE)), face)
    assert len(loop) == 4


def test_a_boundary_that_does_not_close_is_an_error():
    face = face_with_hole().wrapped
    uses = list(explore_subshapes(face, TopAbs_EDGE))
    longest = max(range(len(uses)), key=lambda i: cq.Edge(uses[i]).geomType() == "LINE")
    with pytest.raises(TopologyError, match="cannot be closed along the rail"):
        trace_loops(uses[:longest] + uses[longest + 1 :], face)
    with pytest.raises(TopologyError, match="cannot be closed along the rail"):
        trace_loops([reverse_edge(uses[longest]), *uses[:longest], *uses[longest + 1 :]], face)
