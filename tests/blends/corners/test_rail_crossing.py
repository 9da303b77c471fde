"""Where rails cross, and the curves in which blends end there."""

import numpy as np
import pytest
from plane_corners import PlaneCorner

from cqblend.blends.corners.rail_crossing import build_end_section, cross_end_tangents, cross_rails
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface

ARC = Curve.bezier([[-1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, 0.0]])
"""A parabola, y = 1 - x^2, t from 0 to 1 as x from -1 to 1."""

LINE = Curve.bezier([[-2.0, 0.75, 0.0], [2.0, 0.75, 0.0]])
"""It crosses the parabola at x = -1/2 and at x = 1/2."""


@pytest.mark.parametrize(("ends", "x"), [((0, 0), -0.5), ((1, 1), 0.5)])
def test_of_two_crossings_the_one_next_to_the_ends_is_found(ends, x):
    crossing = cross_rails((ARC, LINE), ends)
    assert np.allclose(crossing.point, [x, 0.75, 0.0], atol=1e-15)
    assert np.allclose(crossing.parameters, [(x + 1) / 2, (x + 2) / 4], atol=1e-15)
    assert np.allclose(crossing.tangents, [[1 / np.sqrt(2), -np.sign(x) / np.sqrt(2), 0.0], [1.0, 0.0, 0.0]])


def test_rails_may_cross_past_their_ends():
    short = ARC.clip(0.0, 0.2)
    assert np.allclose(cross_rails((short, LINE), (1, 0)).point, [-0.5, 0.75, 0.0], atol=1e-14)


def test_rails_that_miss_each_other_are_refused():
    with pytest.raises(GeometryError, match=r"do not cross at the corner: they stay 0\.1 mm apart"):
        cross_rails((ARC, LINE + np.array([0.0, 0.0, 0.1])), (0, 0))


def test_ends_are_continued_by_their_tangents():
    lines = Curve.bezier([[-3.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]), Curve.bezier([[2.0, 2.0, 0.0], [2.0, 4.0, 0.0]])
    assert np.allclose(cross_end_tangents(lines, (1, 0)), [2.5, -0.5])


def test_end_sections_leave_in_the_direction_of_the_other_rails():
    corner = PlaneCorner([[1, 0.2, -0.3], [-0.4, 1, -0.5], [-0.5, -0.8, -0.6]], [(1, 1.4), (1.2, 0.8), (1, 1)])
    strip = corner.make_strip(0)
    stops = np.array([corner.cross_rails(2)[1], corner.cross_rails(0)[0]])
    others = np.stack([corner.edges[2], corner.edges[1]])
    section = strip.compose(build_end_section(strip, stops, others))
    for t, other in zip((0.0, 1.0), others, strict=True):
        assert np.linalg.norm(np.cross(section(t, 1), other)) < 1e-13
        assert np.abs(section(t) - strip(stops[int(t)], t)).max() < 1e-14


def test_a_rail_along_the_own_one_is_refused():
    strip = Surface.from_rows([Curve.bezier([[0.0, y, 0.0], [4.0, y, 0.0]]) for y in (0.0, 1.0)])
    with pytest.raises(GeometryError, match="run in one direction"):
        build_end_section(strip, np.array([0.5, 0.5]), np.array([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]))
