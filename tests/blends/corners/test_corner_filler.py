"""Quads and single patches in holes between blends of plane faces, against normals made of the sides alone."""

from dataclasses import replace

import numpy as np
import pytest
from plane_corners import (
    PlaneCorner,
    find_normals,
    find_side_normals,
    measure_angles,
    measure_outer_angles,
    measure_spoke_angles,
    regular_pyramid,
)

from cqblend.blends.corners import corner_filler
from cqblend.blends.corners.corner_filler import fill_with_one_patch, fill_with_quads
from cqblend.blends.corners.patch_quality import measure_patches
from cqblend.errors import GeometryError, InputError

BOX = [[-1, 0, 0], [0, -1, 0], [0, 0, -1]]
MIXED = [[-1, 0, 0], [0, -1, 0], [0.4, 0.5, -1]]
CORNERS = {
    "equal": (BOX, [(2, 2)] * 3),
    "unequal": (BOX, [(2, 1.5), (1, 1.8), (1.0, 0.7)]),
    "skew": ([[1, 0.2, -0.3], [-0.4, 1, -0.5], [-0.5, -0.8, -0.6]], [(1, 1.4), (1.2, 0.8), (1, 1)]),
    "pyramid 4": (regular_pyramid(4, 0.8), [(1, 1)] * 4),
    "pyramid 5": (regular_pyramid(5, 0.7), [(1, 1), (0.9, 1), (1, 1), (1.1, 1), (1, 1)]),
    "pyramid 6": (regular_pyramid(6, 0.7), [(1, 1)] * 6),
    "saddle 4": ([[1, 0, 0.6], [0, 1, -0.6], [-1, 0, 0.6], [0, -1, -0.6]], [(1, 1)] * 4),
}


def make_corner(name):
    return PlaneCorner(*CORNERS[name])


@pytest.mark.parametrize("name", CORNERS)
@pytest.mark.parametrize("dim", [3, 4])
def test_quads_where_rails_cross_are_smooth_with_all_around(name, dim):
    sides, _ = make_corner(name).list_crossing_sides(dim)
    fill = fill_with_quads(sides)
    assert len(fill.patches) == len(sides)
    assert measure_outer_angles(sides, fill.patches) < 1e-12
    assert measure_spoke_angles(fill.patches) < 1e-12


@pytest.mark.parametrize("name", CORNERS)
@pytest.mark.parametrize("dim", [3, 4])
def test_setback_quads_are_smooth_with_all_around(name, dim):
    corner = make_corner(name)
    sides = corner.list_setback_sides([3.5] * corner.count, dim)
    fill = fill_with_quads(sides)
    assert len(fill.patches) == 2 * corner.count
    assert measure_outer_angles(sides, fill.patches) < 1e-12
    assert measure_spoke_angles(fill.patches) < 1e-12
    assert measure_patches(fill.patches).neighbour_cosine > 0.8


@pytest.mark.parametrize("name", ["pyramid 4", "saddle 4"])
@pytest.mark.parametrize("dim", [3, 4])
def test_four_sides_take_one_patch(name, dim):
    sides, _ = make_corner(name).list_crossing_sides(dim)
    (patch,) = fill_with_one_patch(sides).patches
    x, low, high = np.linspace(0, 1, 101), np.zeros(101), np.ones(101)
    places = [(x, low), (high, x), (1 - x, high), (low, 1 - x)]
    for side, (u, v) in zip(sides, places, strict=True):
        assert measure_angles(find_normals(patch, u, v), find_side_normals(side, x)) < 1e-12
        points = side.curve(x)
        assert np.abs(patch(u, v) - points[:, :3]).max() < 1e-13


def test_patches_run_through_the_sides():
    sides, _ = make_corner("unequal").list_crossing_sides()
    patches = fill_with_quads(sides).patches
    x = np.linspace(0, 1, 33)
    for i, side in enumerate(sides):
        assert np.abs(patches[i](x, 0 * x) - side.curve(x / 2)).max() < 1e-13
        following = patches[(i + 1) % len(sides)]
        assert np.abs(following(0 * x, x) - side.curve(1 - x / 2)).max() < 1e-13


def test_any_unknowns_leave_quads_smooth(monkeypatch):
    """What the energy chooses is smooth by construction: so is anything else."""
    rng = np.random.default_rng(16)
    monkeypatch.setattr(
        corner_filler, "_minimise_energy", lambda energy: np.append(1.0, 0.3 * rng.standard_normal(len(energy) - 1))
    )
    for name in ("unequal", "pyramid 5"):
        corner = make_corner(name)
        for sides in (corner.list_crossing_sides()[0], corner.list_setback_sides([3.5] * corner.count)):
            patches = fill_with_quads(sides).patches
            assert measure_outer_angles(sides, patches) < 1e-9
            assert measure_spoke_angles(patches) < 1e-9


def test_the_order_of_sides_does_not_matter():
    sides, _ = make_corner("skew").list_crossing_sides()
    first = fill_with_quads(sides).patches
    second = fill_with_quads([*sides[1:], *sides[:1]]).patches
    x = np.linspace(0, 1, 9)
    for a, b in zip(first, [second[-1], *second[:-1]], strict=True):
        assert np.abs(a.grid(x, x) - b.grid(x, x)).max() < 1e-10


def test_both_spaces_have_nearly_one_solution():
    corner = make_corner("equal")
    plain, homogeneous = (fill_with_quads(corner.list_crossing_sides(dim)[0]).patches for dim in (3, 4))
    x = np.linspace(0, 1, 9)
    for a, b in zip(plain, homogeneous, strict=True):
        assert np.abs(a.grid(x, x) - b.grid(x, x)).max() < 0.02


def test_small_corners_far_from_the_origin_do_not_fold():
    corner = PlaneCorner(BOX, [(0.01, 0.01)] * 3)
    sides = corner.list_setback_sides([0.025] * 3, 4)
    quality = measure_patches(fill_with_quads(sides).patches)
    assert quality.curvature * 0.01 < 3
    assert quality.neighbour_cosine > 0.8


@pytest.mark.parametrize(("degrees", "most"), [(17, 2.0), (30, 1.5), (60, 1.5)])
def test_acute_wedges_bend_little(degrees, most):
    """Two faces at an acute angle, cut square: setback patches, widths those of a ball of radius 1."""
    angle = np.pi + np.radians(degrees)
    normals = [np.array([1.0, 0.0, 0.0]), np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([0.0, 0.0, 1.0])]
    corner = PlaneCorner.of_ball(normals, 1.0)
    sides = corner.list_setback_sides(corner.choose_setbacks())
    fill = fill_with_quads(sides)
    quality = measure_patches(fill.patches)
    assert measure_outer_angles(sides, fill.patches) < 1e-11
    assert quality.curvature < most
    assert quality.neighbour_cosine > 0.5


def test_face_curves_off_their_rails_are_refused():
    corner = make_corner("equal")
    with pytest.raises(GeometryError, match="different twists") as caught:
        fill_with_quads(corner.list_setback_sides([4.0] * 3, turn=0.1))
    assert caught.value.kind == "twist"
    assert 0.01 < caught.value.value < 0.1


def test_sides_in_different_planes_are_refused():
    corner = make_corner("equal")
    sides = corner.list_setback_sides([4.0] * 3)
    tilted = sides[1].fields[0] + np.array([0.0, 0.0, 0.1])
    sides[1] = replace(sides[1], fields=(tilted, sides[1].fields[1]))
    with pytest.raises(GeometryError, match="different tangent planes"):
        fill_with_quads(sides)


def test_sides_that_do_not_close_are_refused():
    sides, _ = make_corner("equal").list_crossing_sides()
    with pytest.raises(InputError, match="apart where they should meet"):
        fill_with_quads([sides[0], sides[2], sides[1]])
    with pytest.raises(InputError, match="three sides at least"):
        fill_with_quads(sides[:2])
    with pytest.raises(InputError, match="four sides, not 3"):
        fill_with_one_patch(sides)
