"""Which side of faces a point is on, by the nearest of them."""

import cadquery as cq
import numpy as np
import pytest
from OCP.TopoDS import TopoDS

from cqblend.brep.measurement.nearest_side import measure_height

OPEN_BOX = [face.wrapped for face in cq.Workplane().box(10, 10, 10).faces("not >Z").vals()]


@pytest.mark.parametrize(
    ("point", "height"),
    [
        ((0, 0, -3), -2),
        ((0, 0, -7), 2),
        ((4, 0, 0), -1),
        ((7, 0, 0), 2),
        ((8, 9, 0), 5),  # nearest to an edge
        ((6, 7, -7), 3),  # nearest to a vertex
        ((0, 4, 6), -np.sqrt(2)),  # above the opening, nearest to a free edge
        ((0, 6, 6), np.sqrt(2)),
    ],
)
def test_heights_over_an_open_box(point, height):
    place = np.array(point, dtype=float)
    assert measure_height(place, OPEN_BOX) == pytest.approx(height)
    turned = [TopoDS.Face_s(face.Reversed()) for face in OPEN_BOX]
    assert measure_height(place, turned) == pytest.approx(-height)
