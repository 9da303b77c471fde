"""A strip that is turned about an axis: its points, derivatives and rails, by the angle."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest

from cqblend.blends.network.strip_surface import RevolvedStrip
from cqblend.blends.sections.revolved_section import RevolvedSection
from cqblend.splines import Curve
from cqblend.surfaces.vectors import LocalFrame

AXES = np.linalg.qr(np.array([[0.3, -1.2, 0.5], [0.9, 0.4, -0.2], [-0.1, 0.8, 1.1]]))[0]
FRAME = LocalFrame(np.array([4.0, -2.5, 6.0]), AXES * np.sign(np.linalg.det(AXES)))
PROFILE = Curve.bezier([(4.0, 0.0), (4.6, 0.1), (5.0, 0.4), (5.0, 1.0)])
BREAKS, ANGLES = np.array([0.0, 0.3, 0.7, 1.0]), np.array([0.0, 1.1, 2.9, 4.0])
STRIP = RevolvedStrip(RevolvedSection(PROFILE, FRAME, BREAKS, ANGLES, 0.0))


def test_points_are_those_of_the_profile_turned():
    """Turned by CadQuery."""
    s, v = np.array([0.0, 0.7, 2.0, 4.0]), np.array([0.0, 0.3, 0.8, 1.0])
    origin, axis = cq.Vector(*FRAME.origin), cq.Vector(*FRAME.axes[2])
    for point, angle, start in zip(STRIP(s, v), s, STRIP.locate_section(0.0).curve(v), strict=True):
        vertex = cq.Vertex.makeVertex(*start).rotate(origin, origin + axis, float(np.degrees(angle)))
        assert np.linalg.norm(point - vertex.toTuple()) < 1e-13


def test_derivatives_are_limits_of_differences():
    s, v, h = np.array([0.4, 2.2, 3.1]), np.array([0.2, 0.5, 0.9]), 1e-5
    jet = STRIP.jet(s, v, 3)
    for i in range(3):
        for j in range(3 - i):
            along = (STRIP.jet(s + h, v, 2)[i, j] - STRIP.jet(s - h, v, 2)[i, j]) / (2 * h)
            across = (STRIP.jet(s, v + h, 2)[i, j] - STRIP.jet(s, v - h, 2)[i, j]) / (2 * h)
            assert np.abs(jet[i + 1, j] - along).max() < 1e-8
            assert np.abs(jet[i, j + 1] - across).max() < 1e-8


@pytest.mark.parametrize("end", [0, 1])
def test_rails_are_circles_along_its_boundaries(end):
    s = np.linspace(*STRIP.domain, 7)
    assert np.abs(STRIP.rail_curves[end](s) - STRIP(s, np.full(7, float(end)))).max() < 1e-14


def test_angles_and_parameters_of_rails_are_inverse_to_each_other():
    t = np.linspace(0, 1, 33)
    s = STRIP.section.map_to_angles(t)
    assert np.all(np.diff(s) > 0)
    assert np.abs(STRIP.to_rail_parameters(s) - t).max() < 1e-14
    assert np.abs(STRIP.section.map_to_angles(BREAKS) - ANGLES).max() < 1e-14
