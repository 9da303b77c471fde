"""Plans are plain data: made, asked and printed without a solid."""

from __future__ import annotations

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

from cqblend.blends.network.blend_plan import (
    CapPlan,
    EdgePiece,
    EdgeUse,
    FacePlan,
    KeptEdge,
    NewEdge,
    PatchPlan,
    PlannedPcurve,
    PlannedSurface,
    PlannedVertex,
    SolidPlan,
    StripPlan,
    reverse_path,
)
from cqblend.splines import Curve, Surface
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import LocalFrame

CORNERS = [PlannedVertex(np.array(point, dtype=float)) for point in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))]
PATCH = PlannedSurface(Surface(([0, 1], [0, 1]), np.zeros((2, 2, 3, 1, 1))))


def edge(role: str, start: int, stop: int, face: int) -> NewEdge:
    ends = (CORNERS[start], CORNERS[stop])
    line, flat = Curve.bezier([one.point for one in ends]), Curve.bezier([one.point[:2] for one in ends])
    return NewEdge(role, line, (0.0, 1.0), ends, (PlannedPcurve(PATCH, flat), PlannedPcurve(face, flat)))


FIRST, SECOND = edge("rail", 0, 1, 3), edge("rail", 3, 2, 4)
LOW, HIGH = edge("end curve", 0, 3, 5), edge("end curve", 1, 2, 6)
BOUNDARY = (EdgeUse(FIRST), EdgeUse(HIGH), *reverse_path([EdgeUse(SECOND)]), EdgeUse(LOW).reverse())


def plan() -> SolidPlan:
    old = PlannedVertex(np.array([5.0, 0.0, 0.0]), number=8)
    piece = EdgePiece(12, (0.2, 1.0), (CORNERS[0], old), (1e-9, 0.0))
    cap = CapPlan(PlannedSurface(Plane(LocalFrame(np.zeros(3), np.eye(3)))), (EdgeUse(HIGH),))
    rails = ((FIRST,), (SECOND,))
    strip = StripPlan((11,), (3, 4), PATCH, BOUNDARY, rails, end_edges=((LOW,), (HIGH,)), caps=(cap,))
    faces = (
        FacePlan(3, {11: (), 12: (piece,)}, (EdgeUse(FIRST, forward=False),)),
        FacePlan(4, {11: ()}, (EdgeUse(SECOND),)),
        FacePlan(5, {12: (piece,), 13: (KeptEdge(13),)}, (EdgeUse(LOW),)),
    )
    return SolidPlan((strip,), faces)


def test_every_edge_and_vertex_is_there_once():
    made = plan()
    assert len(made.edges) == len(set(made.edges)) == 5
    assert set(made.vertices) == set(CORNERS)
    assert made.removed_edges == (11,)


def test_uses_follow_each_other_around_a_strip():
    ends = [(use.start_vertex, use.reverse().start_vertex) for use in BOUNDARY]
    assert all(one[1] is other[0] for one, other in zip(ends, ends[1:] + ends[:1], strict=True))


def test_a_plan_is_printed_in_words():
    assert str(plan()).splitlines() == [
        "4 new vertices, 5 edges made or cut",
        "blend of edge 11 between faces 3 and 4, 4 sides, 1 flat ends",
        "face 3: edges cut: 11 in 0, 12 in 1; added: 1 rail",
        "face 4: edges cut: 11 in 0; added: 1 rail",
        "face 5: edges cut: 12 in 1, 13 in 1; added: 1 end curve",
    ]


@pytest.mark.parametrize("part", [CORNERS[0], FIRST, PATCH, plan(), plan().strips[0], plan().faces[0]])
def test_plans_cannot_be_changed(part):
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(part, dataclasses.fields(part)[0].name, None)


def test_plans_need_no_kernel():
    code = "import sys, cqblend.blends.network.blend_plan; print(any(name.startswith('OCP') for name in sys.modules))"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown.strip() == "False"


def test_patches_of_corners_count_and_are_printed():
    spoke = edge("spoke", 0, 2, 3)
    made = dataclasses.replace(plan(), patches=(PatchPlan(7, (11, 14), PATCH, (EdgeUse(FIRST), EdgeUse(spoke))),))
    assert spoke in made.edges
    assert len(made.edges) == len(plan().edges) + 1
    assert "patch at vertex 7 between edges 11, 14, 2 sides" in str(made)
