"""The plan of a bridge, as plain data, before anything is built."""

import cadquery as cq
import pytest

from cqblend.api.cad_shapes import to_given_side
from cqblend.blends.network.blend_plan import NewEdge
from cqblend.brep.shell_editing.bridge_planning import plan_bridge
from cqblend.bridge_options import BridgeOptions
from cqblend.solid_blends import bridging


def plan(bodies, *sides, **options):
    """The plan of a bridge between sides of bodies."""
    request = BridgeOptions(**options).to_request()
    shape = cq.Compound.makeCompound(bodies).wrapped
    joined = bridging.read_bodies(shape, (to_given_side("side1", sides[0]), to_given_side("side2", sides[1])))
    pairing, cells = bridging.fit_cells(joined, request)
    placed = [bridging.place_cell(joined, cell, bridging.fill_cell(cell, request)) for cell in cells]
    return plan_bridge(joined.index, joined.sides, pairing, placed)


def roles(made):
    return sorted(edge.role for edge in made.edges if isinstance(edge, NewEdge))


def test_a_prism_between_boxes_takes_their_corners():
    low, high = cq.Workplane().box(4, 3, 2), cq.Workplane().box(4, 3, 2).translate((1, 1, 9))
    made = plan([low.val(), high.val()], low.faces(">Z"), high.faces("<Z"))
    assert len(made.strips) == 4
    assert len(made.removed_faces) == 2
    assert made.vertices == ()  # all eight corners are those of the boxes
    assert roles(made) == ["mitre"] * 4 + ["rail"] * 8
    assert len(made.faces) == 8
    assert all(len(face.pieces) == 1 and len(face.added) == 1 for face in made.faces)


def test_a_tube_keeps_the_vertices_of_both_rims():
    low, high = cq.Workplane().circle(3).extrude(2), cq.Workplane().circle(2).extrude(2).translate((0, 0, 9))
    turned = high.rotate((0, 0, 0), (0, 0, 1), 40)
    made = plan([low.val(), turned.val()], low.faces(">Z"), turned.faces("<Z"))
    assert len(made.strips) == 1
    assert roles(made) == ["rail", "rail", "rail", "seam"]  # the upper rim is cut at its own vertex, too
    assert len(made.vertices) == 1
    assert sum(vertex.number > 0 for edge in made.edges for vertex in edge.vertices) == 5


@pytest.mark.parametrize(("turn", "pieces"), [(0, 2), (90, 0)])
def test_an_opening_cuts_the_seam_that_it_lies_on(turn, pieces):
    """A round hole in a cylinder, where x is largest, which is where its seam is, or a quarter turn from there."""
    tank = cq.Workplane().circle(3).extrude(9)
    drill, pipe = (cq.Workplane("YZ", origin=(x, 0, 4.5)).circle(1).extrude(9) for x in (0, 9))
    drill, pipe = (one.rotate((0, 0, 0), (0, 0, 1), turn) for one in (drill, pipe))
    ahead = cq.Vector(1, 0, 0) if not turn else cq.Vector(0, 1, 0)
    hole = [
        one
        for one in tank.cut(drill).edges().vals()
        if one.geomType() == "BSPLINE" and one.Center().dot(ahead) > 2.5 and 3 < one.Center().z < 6
    ]
    end = pipe.faces(cq.selectors.DirectionMinMaxSelector(ahead, directionMax=False))
    made = plan([tank.val(), pipe.val()], (tank.faces("%CYLINDER").val(), hole), end)
    wall = next(face for face in made.faces if face.number == made.strips[0].support_faces[0])
    assert [len(kept) for kept in wall.pieces.values()] == [pieces] * (pieces > 0)
