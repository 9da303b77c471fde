"""Volumes inside shapes against closed forms."""

import math

import cadquery as cq
import numpy as np
import pytest
from measured_shapes import prism, wrapped
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert

from cqblend.brep.verification.volumes import measure_volume


class TestVolume:
    """Closed forms, on which OCCT's other integrators fail."""

    @pytest.mark.parametrize(
        ("shape", "expected"),
        [
            (cq.Workplane().box(3, 4, 5), 60.0),
            (cq.Workplane().sphere(5), 4 / 3 * math.pi * 125),
            (cq.Workplane().circle(2).extrude(7).translate((300, -50, 80)), 28 * math.pi),
            (cq.Workplane().box(10, 10, 10).edges("|Z").fillet(2), 10 * (100 - 4 * 4 * (1 - math.pi / 4))),
        ],
    )
    def test_analytic(self, shape, expected):
        for solid in (wrapped(shape), BRepBuilderAPI_NurbsConvert(wrapped(shape), True).Shape()):
            volume, error = measure_volume(solid)
            assert volume == pytest.approx(expected, rel=1e-6)
            assert abs(volume - expected) <= error + 1e-12 * expected
            assert error < 1e-4 * expected
            assert measure_volume(solid.Reversed())[0] == pytest.approx(-expected, rel=1e-6)

    def test_an_extruded_spline(self):
        """The area inside the spline by Green's theorem on a dense polygon, with Richardson's step."""
        part = prism()
        curve = part.faces(">Z").edges().val()._geomAdaptor()
        ts = np.linspace(curve.FirstParameter(), curve.LastParameter(), 20001)
        points = np.array([curve.Value(t).Coord()[:2] for t in ts.tolist()])
        fine, coarse = (0.5 * np.sum(np.cross(p[:-1], p[1:])) for p in (self.lift(points), self.lift(points[::2])))
        area = fine + (fine - coarse) / 3
        assert measure_volume(wrapped(part))[0] == pytest.approx(10 * area, rel=1e-6)

    @staticmethod
    def lift(points):
        return np.column_stack((points, np.zeros(len(points))))
