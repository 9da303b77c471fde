"""How far from a vertex blends stop."""

import numpy as np
import pytest
from plane_corners import PlaneCorner

from cqblend.blends.corners.setbacks import Setback, choose_setback, fit_setbacks, locate_crossing
from cqblend.errors import SizeError


@pytest.mark.parametrize("degrees", [20, 60, 90, 140])
def test_crossings_are_where_rails_cross(degrees):
    angle = np.radians(degrees)
    directions = [[1, 0, 0], [np.cos(angle), np.sin(angle), 0], [-0.1, 0.2, -1]]
    corner = PlaneCorner(directions, [(1, 0.7), (1.2, 1), (1, 1)])
    crossing = corner.cross_rails(0)
    assert np.isclose(locate_crossing(0.7, 1.2, angle), crossing[0])
    assert np.isclose(locate_crossing(1.2, 0.7, angle), crossing[1])


def test_setbacks_are_longer_than_the_farthest_crossing():
    assert choose_setback(2.0, (1.0, 3.0)) == Setback(5.0, pytest.approx(3.3))
    assert choose_setback(2.0, (-1.0, -3.0)) == Setback(0.5, 0.5)


def test_setbacks_shrink_on_short_edges():
    low, high = Setback(5.0, 3.0), Setback(4.0, 2.0)
    assert fit_setbacks(20.0, low, high) == (5.0, 4.0)
    assert fit_setbacks(20.0, None, high) == (0.0, 4.0)
    start, stop = fit_setbacks(7.5, low, high)
    assert np.isclose(start + stop, 0.94 * 7.5)
    assert 3.0 < start < 5.0
    assert 2.0 < stop < 4.0
    with pytest.raises(SizeError, match=r"take 5 mm of its 5\.2 mm"):
        fit_setbacks(5.2, low, high)
