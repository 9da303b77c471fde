"""What BRepCheck is asked about: the wires that changed, and those near them."""

import cadquery as cq
import pytest
from blended_solids import make_plate
from OCP.TopAbs import TopAbs_WIRE

import cqblend
from cqblend.brep.topology import ShapeIndex, find_end_vertices
from cqblend.brep.verification.replaced_faces import ReplacedFaces
from cqblend.brep.verification.slim_faces import list_changed_parts


def count_wires(shape):
    return len(ShapeIndex(shape, TopAbs_WIRE))


def blend(edges, radius):
    plate = make_plate(5)
    result = cqblend.blend_edges(plate.val().wrapped, [edge.wrapped for edge in edges(plate)], radius)
    return ReplacedFaces(plate.val().wrapped, result.shape, list(result.faces))


def test_one_rim_needs_its_own_wire_and_the_outer_one():
    replaced = blend(lambda plate: plate.faces(">Z").edges("%CIRCLE").vals()[12:13], 0.3)
    (part,) = (part for part in list_changed_parts(replaced) if count_wires(part.face) > 4)
    assert count_wires(part.face) == 26
    assert count_wires(part.slim_face) == 2
    assert len(part.uses) == len(part.old_uses) == 1


@pytest.mark.parametrize("count", [2, 9])
def test_rims_are_checked_one_by_one(count):
    replaced = blend(lambda plate: plate.faces(">Z").edges("%CIRCLE").vals()[:count], 0.3)
    parts = [part for part in list_changed_parts(replaced) if count_wires(part.face) > 4]
    assert len(parts) == count
    assert {count_wires(part.slim_face) for part in parts} == {2}


def test_a_corner_of_the_outer_wire_needs_no_hole():
    """The edges that were trimmed there run along the whole plate, but changed at one end only."""
    replaced = blend(lambda plate: plate.edges("|Z and >X and >Y").vals(), 0.5)
    parts = [part for part in list_changed_parts(replaced) if count_wires(part.face) > 4]
    assert len(parts) == 2  # top and bottom
    assert {count_wires(part.slim_face) for part in parts} == {1}


def test_wires_near_to_a_change_are_kept():
    """Two holes that are apart, but lie in each other's boxes."""
    plate = cq.Workplane().box(30, 30, 5).faces(">Z").workplane()
    plate = plate.pushPoints([(0, 0), (2.1, 2.1), (9, 0), (-9, 3)]).hole(2.0)
    rim = min(plate.faces(">Z").edges("%CIRCLE").vals(), key=lambda edge: edge.Center().x ** 2 + edge.Center().y ** 2)
    result = cqblend.blend_edges(plate.val().wrapped, [rim.wrapped], 0.3)
    replaced = ReplacedFaces(plate.val().wrapped, result.shape, list(result.faces))
    (part,) = (part for part in list_changed_parts(replaced) if count_wires(part.face) > 4)
    assert count_wires(part.slim_face) == 3


def test_whole_wires_are_never_taken_apart():
    """What encloses a change of volume is closed: at each vertex as many uses start as stop."""
    replaced = blend(lambda plate: plate.edges("|Z and >X and >Y").vals(), 0.5)
    parts = [part for part in list_changed_parts(replaced, whole_wires=True) if part.old_face is not None]
    assert len(parts) == len(replaced.old) == 4
    for part in parts:
        for uses in (part.uses, part.old_uses):
            starts, stops = zip(*map(find_end_vertices, uses), strict=True)
            assert all(sum(one.IsSame(other) for other in stops) == 1 for one in starts)
