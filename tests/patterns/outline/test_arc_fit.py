"""Arcs fitted to chains of segments, measured against dense samples of both."""

import numpy as np
import pieces_cases as cases
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from cqblend.errors import InputError
from cqblend.patterns.outline.arc_fit import fit_arcs
from cqblend.patterns.outline.plane_path import Path, solve_bulges


def dense(path, count):
    """Points by the circle through both ends and the middle of each arc: independent of Path.at."""
    found = []
    for a, b, bulge in zip(path.points[:-1], path.points[1:], path.bulges, strict=True):
        f = np.linspace(0, 1, count, endpoint=False)
        a_, b_ = complex(*a), complex(*b)
        if abs(bulge) < 1e-12:
            z = a_ + f * (b_ - a_)
        else:
            angle = 4 * np.arctan(bulge)
            centre = (a_ - b_ * np.exp(-1j * angle)) / (1 - np.exp(-1j * angle))
            z = centre + (a_ - centre) * np.exp(1j * angle * f)
        found.append(np.column_stack([z.real, z.imag]))
    return np.concatenate([*found, path.points[-1:]])


def deviation(first, second):
    """Largest distance either way, and the largest error of the polygon it is measured to."""
    fine = [dense(path, 8 + 2000 // len(path.bulges)) for path in (first, second)]
    lines = [shapely.linestrings(points) for points in fine]
    coarse = [points[:: max(len(points) // 700, 1)] for points in fine]
    return max(
        shapely.distance(shapely.points(coarse[0]), lines[1]).max(),
        shapely.distance(shapely.points(coarse[1]), lines[0]).max(),
    )


def wave(seed, count):
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, count)
    k = rng.uniform(1, 6, 4)
    return np.column_stack([120 * t + 3 * np.sin(k[0] * t), 15 * np.sin(k[1] * t) + 4 * np.cos(k[2] * t + k[3])])


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6), st.integers(20, 150), st.sampled_from([1e-2, 2e-3]), st.booleans())
def test_nothing_is_further_than_the_tolerance(seed, count, tolerance, bowed):
    points = wave(seed, count)
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    path = Path(points, solve_bulges(chords, chords * 1.0005) if bowed else np.zeros(count - 1))
    few = fit_arcs(path, tolerance)
    assert deviation(path, few) <= tolerance
    assert (few.points[[0, -1]] == path.points[[0, -1]]).all()
    assert {tuple(p) for p in few.points} <= {tuple(p) for p in path.points}


def test_smooth_chains_become_few_arcs_of_the_same_length():
    angle = np.linspace(0.3, 2.1, 400)
    path = Path.from_points(200 * np.column_stack([np.cos(angle), 0.6 * np.sin(angle)]))
    few = fit_arcs(path, 2e-3)
    assert len(few.bulges) < 20
    assert few.length == pytest.approx(path.length, rel=1e-6)


def test_circles_and_corners_stay():
    assert fit_arcs(cases.circle(10.0), 1e-3).bulges.tolist() == [1.0, 1.0]
    square = Path.from_points([[0, 0], [5, 0], [10, 0], [10, 10], [0, 10], [0, 0]])
    assert fit_arcs(square, 0.5).points.tolist() == [[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]]
    angle = np.linspace(0, 2 * np.pi, 721)
    polygon = 50 * np.column_stack([np.cos(angle), np.sin(angle)])
    polygon[-1] = polygon[0]
    few = fit_arcs(Path.from_points(polygon), 1e-2)
    assert few.closed
    assert len(few.bulges) <= 3
    assert few.area == pytest.approx(np.pi * 2500, rel=1e-4)


def test_out_and_back_is_not_smoothed_away():
    path = Path.from_points([[0, 0], [4, 0.001], [8, 0], [4, 0.002], [0.5, 0.003]])
    assert deviation(path, fit_arcs(path, 0.01)) <= 0.01


def test_no_tolerance_changes_nothing_and_bad_ones_are_refused():
    path = Path.from_points(wave(1, 30))
    assert fit_arcs(path, 0.0) is path
    for bad in (-1.0, np.nan, np.inf, "a"):
        with pytest.raises(InputError):
            fit_arcs(path, bad)
