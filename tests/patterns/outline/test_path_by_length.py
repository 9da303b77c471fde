"""Stretches of a path add up to it, and its offset curves keep their distance."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from pieces_cases import arc

from cqblend.patterns.outline.path_by_length import PathByLength
from cqblend.patterns.outline.plane_path import Path


def test_stretches_and_offset_curves_of_a_path():
    path = Path.from_paths([arc(10.0, 0.0, 1.5, 2), Path.from_points([arc(10.0, 0, 1.5).points[-1], [-20.0, 15.0]])])
    measured = PathByLength(path)
    assert measured.length == pytest.approx(path.length)
    cut = np.array([0.0, 3.0, 7.5, 11.0, 20.0, measured.length])
    parts = [measured.clip_between(a, b) for a, b in pairwise(cut)]
    np.testing.assert_allclose([part.length for part in parts], np.diff(cut), rtol=1e-12)
    whole = Path.from_paths(parts)
    assert whole.length == pytest.approx(path.length)
    np.testing.assert_array_equal(measured.clip_between(0.0, measured.length).points, path.points)
    np.testing.assert_allclose(measured.offset_curve(0.0, 15.0, 2.0).length, 12.0 * 1.5, rtol=1e-12)
    np.testing.assert_allclose(measured.offset_curve(0.0, 15.0, -2.0).length, 8.0 * 1.5, rtol=1e-12)
    assert measured.mean_curvature(1.0, 14.0) == pytest.approx(0.1)
    line = shapely.LineString(path.sampled(1e-6))
    points = measured.offset_curve(2.0, 14.0, 1.5).sampled(1e-6)
    np.testing.assert_allclose(shapely.distance(line, shapely.points(points)), 1.5, atol=1e-5)
