"""Pieces that cover themselves, by closed forms; pieces that only touch themselves do not."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pieces_cases import arc, box, circle, cone, cylinder, frustum, gores, lattice, tower

from cqblend.errors import GeometryError
from cqblend.patterns.outline.overlap import find_overlap, find_winding_errors
from cqblend.patterns.outline.pieces import Piece, Run
from cqblend.patterns.outline.plane_path import Path


def sector(radius: float, angle: float) -> Path:
    """A cone's development."""
    rim = arc(radius, 0, angle, max(2, int(angle)))
    return Path.from_paths([Path.from_points([[0, 0], rim.points[0]]), rim, Path.from_points([rim.points[-1], [0, 0]])])


def annulus(outer: float, inner: float, angle: float, pieces: int = 12) -> Path:
    """A frustum's development."""
    out, back = arc(outer, 0, angle, pieces), arc(inner, angle, 0, pieces)
    return Path.from_paths(
        [
            out,
            Path.from_points([out.points[-1], back.points[0]]),
            back,
            Path.from_points([back.points[-1], out.points[0]]),
        ]
    )


@pytest.mark.parametrize("model", [box, cylinder, tower, frustum, cone, gores, lattice])
def test_known_patterns_do_not_overlap(model):
    for piece in model().pieces:
        found = find_overlap(piece)
        assert found.area == 0.0
        assert not found
        assert found.place is None


@pytest.mark.parametrize("beyond", [0.05, 0.5, 2.0, 6.0])
def test_a_cone_beyond_a_full_turn_covers_its_excess(beyond):
    found = find_winding_errors([sector(10.0, 2 * np.pi + beyond)])
    assert found.area == pytest.approx(50 * beyond, rel=2e-5)
    angle = np.arctan2(*found.place[::-1]) % (2 * np.pi)
    assert 0 < angle < beyond
    assert 0 < np.linalg.norm(found.place) < 10


def test_three_turns_count_twice():
    found = find_winding_errors([annulus(10.0, 8.0, 6 * np.pi - 1)])
    assert found.area == pytest.approx((4 * np.pi - 1) / 2 * (100 - 64), rel=2e-5)


def test_a_spiral_ring_that_crosses_itself():
    found = find_winding_errors([annulus(10.0, 8.0, 2 * np.pi + 0.3)])
    assert found.area == pytest.approx(0.15 * 36, rel=2e-5)
    assert len(found.regions) == 1


@pytest.mark.parametrize("gap", [0.0, 1e-12, -1e-12, 1e-10, -1e-10])
def test_closed_exactly_is_no_overlap(gap):
    assert not find_winding_errors([sector(10.0, 2 * np.pi + gap)])
    assert not find_winding_errors([annulus(10.0, 9.0, 2 * np.pi + gap)])
    assert not find_winding_errors([annulus(10.0, 9.99, 2 * np.pi + gap, 40)])


@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 1e4))
def test_rounding_of_touching_ends_gives_no_alarm(seed, size):
    noise = np.random.default_rng(seed)
    ring = annulus(size, 0.8 * size, 2 * np.pi)
    points = ring.points + noise.normal(0, 1e-12 * size, ring.points.shape)
    points[-1] = points[0]
    assert overlap_area(Path(points, ring.bulges)) == 0.0


def overlap_area(path: Path) -> float:
    return find_winding_errors([path]).area


def test_a_figure_of_eight_has_one_lobe_the_wrong_way():
    eight = Path.from_points([[0, 0], [1, -1], [1, 1], [-2, -2], [-2, 2], [0, 0]])
    found = find_winding_errors([eight])
    assert found.area == pytest.approx(4.0)


def test_holes_inside_across_outside_and_on_each_other():
    outline = Path.from_points([[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]])
    within = circle(2.0, (5.0, 5.0), clockwise=True)
    across = circle(2.0, (10.0, 5.0), clockwise=True)
    outside = circle(2.0, (20.0, 5.0), clockwise=True)
    assert not find_winding_errors([outline, within])
    assert find_winding_errors([outline, across]).area == pytest.approx(2 * np.pi, rel=2e-5)
    assert find_winding_errors([outline, outside]).area == pytest.approx(4 * np.pi, rel=2e-5)
    assert find_winding_errors([outline, within, within]).area == pytest.approx(4 * np.pi, rel=2e-5)
    assert find_winding_errors([outline, within.reversed()]).area == pytest.approx(4 * np.pi, rel=2e-5)


def test_a_hole_that_touches_the_outline():
    outline = circle(10.0)
    assert not find_winding_errors([outline, circle(4.0, (6.0, 0.0), clockwise=True)])
    square = Path.from_points([[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]])
    notch = Path.from_points([[0, 4], [4, 6], [10, 5], [0, 4]]).reversed()
    assert not find_winding_errors([square, notch if notch.area < 0 else notch.reversed()])


def test_clockwise_outline_counts_whole():
    assert find_winding_errors([circle(3.0, clockwise=True)]).area == pytest.approx(9 * np.pi, rel=2e-5)


def test_degenerate_and_bad_pieces():
    point = Path.from_points(np.ones((3, 2)))
    assert find_winding_errors([point]).area == 0.0
    line = Path.from_points([[0, 0], [1, 0], [0, 0]])
    assert not find_winding_errors([line])
    (piece, *_) = box().pieces
    bad = replace(piece.loops[0][0], path=Path.from_points([[0, 0], [np.nan, 0]]))
    with pytest.raises(GeometryError, match=r"piece 1 .* not finite"):
        find_overlap(Piece("1", ((bad, *piece.loops[0][1:]),)))


def test_saddle_ring_of_the_issue_is_found():
    """A ring whose boundaries wave strongly develops to more than a full turn."""
    angles = np.linspace(0, 9.0, 800)
    inner = np.column_stack([np.cos(angles), np.sin(angles)]) * 20
    outer = inner * 1.3
    points = np.concatenate([outer, inner[::-1], outer[:1]])
    run = Run(Path.from_points(points), np.zeros((len(points), 3)), "rail")
    found = find_overlap(Piece("1", ((run,),)))
    assert found.area == pytest.approx((9 - 2 * np.pi) / 2 * 400 * (1.3**2 - 1), rel=1e-3)


def test_gores_of_many_segments_do_not_overlap():
    assert not any(find_overlap(piece) for piece in gores(30, segments=300).pieces)
