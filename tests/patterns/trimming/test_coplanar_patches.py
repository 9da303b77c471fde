"""Coplanar patches merged: loops of polyominoes made by hand, with pinches and holes, against shapely."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
import shapely

from cqblend.patterns.trimming.coplanar_patches import (
    make_planar_patch,
    merge_coplanar_patches,
    project_to_plane,
    sample_loop_polygon,
)
from cqblend.patterns.trimming.trimmed_patch import EdgeUse, Patch, PatchEdge, PatchShell, PlaneFrame
from cqblend.splines import Curve

TILT = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, 0.6]])


def same(t):
    return t


def tiles(cells, *, lift=lambda cell: 0.0, size=1.0):
    """Return a skin of unit squares, one patch each, that share their sides; each has a frame of its own."""
    vertices, edges, patches = {}, {}, []

    def number(table, key):
        return table.setdefault(key, len(table) + 1)

    corners, sides = {}, {}
    for i, cell in enumerate(cells):
        z = lift(cell)
        ring = [(cell[0] + a, cell[1] + b, z) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))]
        quarter = np.array([[0, 1], [-1, 0]]) if i % 2 else np.eye(2)
        frame = PlaneFrame(
            TILT @ [size * cell[0], size * cell[1], z], TILT[:, :2] @ quarter[0], TILT[:, :2] @ quarter[1]
        )
        loop = []
        for start, stop in pairwise(ring):
            along = start < stop
            low, high = (start, stop) if along else (stop, start)
            index = number(sides, (low, high))
            ends = np.array([[size * x, size * y, height] for x, y, height in (low, high)]) @ TILT.T
            points = Curve.bezier(ends)
            for end, place in zip((low, high), ends, strict=True):
                vertices[number(corners, end)] = place
            edges[index] = PatchEdge(
                index, points, np.array([0.0, 1.0]), points, same, (corners[low], corners[high]), (), 0.0, 0.0
            )
            loop.append(EdgeUse(index, along, project_to_plane(frame, points), np.array([0.0, 1.0])))
        patches.append(make_planar_patch((i + 1,), frame, [tuple(loop)]))
    return PatchShell(tuple(patches), edges, vertices)


def outline(patch):
    return shapely.Polygon(sample_loop_polygon(patch.loops[0]), [sample_loop_polygon(loop) for loop in patch.loops[1:]])


RING = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)]


@pytest.mark.parametrize(
    ("cells", "holes"),
    [
        ([(0, 0), (1, 0)], 0),
        ([(0, 0), (1, 0), (1, 1), (0, 1)], 0),
        (RING, 1),
        ([cell for cell in RING if cell != (2, 2)], 1),
        ([(x, y) for x in range(5) for y in range(5) if (x, y) not in [(1, 1), (2, 2), (3, 3), (3, 1)]], 4),
        ([(x, y) for x in range(4) for y in range(4) if (x, y) not in [(1, 1), (2, 2), (3, 3)]], 2),
    ],
    ids=["two", "four", "ring", "pinched ring", "holes that touch", "holes that touch the outside"],
)
def test_tiles_become_one_piece(cells, holes):
    (patch,) = merge_coplanar_patches(tiles(cells)).patches
    assert patch.faces == tuple(range(1, len(cells) + 1))
    assert len(patch.loops) == 1 + holes
    shape = outline(patch)
    assert shape.is_valid
    assert shape.area == pytest.approx(len(cells), rel=1e-12)
    for loop in patch.loops:
        for before, use in zip(loop[-1:] + loop[:-1], loop, strict=True):
            np.testing.assert_allclose(before.ends[1], use.ends[0], atol=1e-12)


def test_edges_between_merged_patches_are_dropped_and_others_kept():
    skin = merge_coplanar_patches(tiles(RING))
    found = Counter(use.edge for loop in skin.patches[0].loops for use in loop)
    assert set(found) == set(skin.edges)
    assert set(found.values()) == {1}
    assert len(skin.edges) == 16


def test_a_step_is_no_neighbour():
    skin = tiles([(0, 0), (1, 0), (2, 0)], lift=lambda cell: float(cell[0] == 2))
    assert [patch.faces for patch in merge_coplanar_patches(skin).patches] == [(1, 2), (3,)]


def test_planes_that_differ_by_more_than_rounding_stay_apart():
    skin = tiles([(0, 0), (1, 0)])
    first, second = skin.patches
    turned = np.array([np.cos(1e-6), 0.0, np.sin(1e-6)])
    frame = PlaneFrame(second.frame.origin, TILT @ turned, second.frame.y * 0 + TILT[:, 1])
    tilted = Patch(second.faces, "plane", second.surface, True, second.loops, frame)
    assert len(merge_coplanar_patches(PatchShell((first, tilted), skin.edges, skin.vertices)).patches) == 2


def test_a_patch_folded_back_onto_its_neighbour_stays_apart():
    skin = tiles([(0, 0), (1, 0)])
    first, second = skin.patches
    turned = make_planar_patch(
        second.faces,
        PlaneFrame(second.frame.origin, second.frame.y, second.frame.x),
        [tuple(use.reversed_use for use in loop[::-1]) for loop in second.loops],
    )
    assert len(merge_coplanar_patches(PatchShell((first, turned), skin.edges, skin.vertices)).patches) == 2


def test_nothing_changes_where_nothing_is_shared():
    skin = tiles([(0, 0), (2, 2)])
    assert merge_coplanar_patches(skin).patches == skin.patches
