"""Loops of a face grouped by the piece that they bound."""

import cadquery as cq
from OCP.TopoDS import TopoDS

from cqblend.brep.shell_editing.face_boundary import FaceBoundary
from cqblend.brep.shell_editing.face_pieces import group_loops
from cqblend.brep.topology import orient_forward


def test_holes_go_to_the_piece_around_them():
    plate = cq.Workplane().box(40, 20, 2).faces(">Z").workplane().pushPoints([(-12, 0), (12, 0), (14, 4)]).hole(1.5)
    top = plate.faces(">Z").val()
    face, holes = TopoDS.Face_s(orient_forward(top.wrapped)), [wire.wrapped for wire in top.innerWires()]
    halves = [cq.Workplane().box(18, 20, 2).translate((x, 0, 0)).faces(">Z").val() for x in (-11, 11)]
    outer = [FaceBoundary(half.wrapped).uses for half in halves]
    assert len(holes) == 3
    groups = group_loops(face, outer, holes)
    assert sorted(map(len, groups)) == [2, 3]
    (alone,) = group_loops(face, outer[:1], holes)
    assert len(alone) == 4
