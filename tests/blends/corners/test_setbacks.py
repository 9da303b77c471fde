"""How far from a vertex blends stop."""

import numpy as np
import pytest
from plane_corners import PlaneCorner

from cqblend.blends.corners.setbacks import Setback, choose_setback, fit_setback
from cqblend.errors import SizeError


@pytest.mark.parametrize("degrees", [20, 60, 90, 140])
def test_crossings_are_where_rails_cross(degrees):
    angle = np.radians(degrees)
    directions = [[1, 0, 0], [np.cos(angle), np.sin(angle), 0], [-0.1, 0.2, -1]]
    corner = PlaneCorner(directions, [(1, 0.7), (1.2, 1), (1, 1)])
    crossing = corner.cross_rails(0)
    assert np.isclose((1.2 + 0.7 * np.cos(angle)) / np.sin(angle), crossing[0])
    assert np.isclose((0.7 + 1.2 * np.cos(angle)) / np.sin(angle), crossing[1])


def test_setbacks_are_longer_than_the_farthest_crossing():
    assert choose_setback(2.0, (1.0, 3.0)) == Setback(5.0, pytest.approx(3.3))
    assert choose_setback(2.0, (-1.0, -3.0)) == Setback(0.5, 0.5)


def test_setbacks_shrink_on_short_edges():
    setback = Setback(5.0, 3.0)
    assert fit_setback(setback, 20.0) == 5.0
    assert np.isclose(fit_setback(setback, 8.0), 3.76)
    with pytest.raises(SizeError, match=r"take 3 mm of the edge, there are 2\.35"):
        fit_setback(setback, 5.0)
