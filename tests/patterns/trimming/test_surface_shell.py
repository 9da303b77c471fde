"""Bare surfaces as patches: their sides, seams and poles."""

import numpy as np
import pytest

from cqblend.errors import InputError
from cqblend.patterns.trimming.surface_shell import make_surface_shell
from cqblend.splines import Surface

LINE = [0.0, 0.0, 1.0, 1.0]
ROOT = np.sqrt(0.5)


def circles(radii, heights):
    """A surface of circles over u, closed, at given radii and heights along v."""
    corners = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
    weights = np.array([1, ROOT, 1, ROOT, 1, ROOT, 1, ROOT, 1])
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    net = [[[*(r * corner), z] for r, z in zip(radii, heights, strict=True)] for corner in corners]
    return Surface.from_bspline((2, 1), (knots, LINE), net, np.outer(weights, np.ones(len(radii))))


def ends(patch):
    return [use.ends for use in patch.loops[0]]


def assert_sound(skin):
    (patch,) = skin.patches
    assert patch.outward
    assert patch.kind == "freeform"
    chain = ends(patch)
    for here, there in zip(chain, [*chain[1:], chain[0]], strict=True):
        assert np.array_equal(here[1], there[0])
    corners = np.array([end[0] for end in chain])
    x, y = corners.T
    assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0  # counterclockwise
    for use in patch.loops[0]:
        edge = skin.edges[use.edge]
        t = np.linspace(*edge.breaks[[0, -1]], 33)
        uv = use.pcurve(t)
        assert np.abs(patch.surface(uv[:, 0], uv[:, 1]) - edge.points(t)).max() < 1e-12
        assert use.degenerate == edge.degenerate


def test_an_open_surface_has_four_edges():
    net = [[[0, 0, 0], [0, 2, 0]], [[3, 0, 0], [3, 2, 1]]]
    skin = make_surface_shell(Surface.from_bspline((1, 1), (LINE, LINE), net))
    assert_sound(skin)
    assert len(skin.edges) == 4
    assert all(edge.faces == (1,) and not edge.degenerate for edge in skin.edges.values())
    assert skin.refused == {}


def test_a_closed_surface_meets_itself():
    skin = make_surface_shell(circles((2, 3), (0, 5)))
    assert_sound(skin)
    assert len(skin.edges) == 3
    (seam,) = [edge for edge in skin.edges.values() if len(edge.faces) == 2]
    uses = [use for use in skin.patches[0].loops[0] if use.edge == seam.index]
    assert [use.forward for use in uses].count(True) == 1  # up on one side, down on the other


@pytest.mark.parametrize(("radii", "poles"), [((0, 3), 1), ((3, 0), 1)])
def test_a_pole_is_a_degenerate_edge(radii, poles):
    skin = make_surface_shell(circles(radii, (0, 5)))
    assert_sound(skin)
    assert sum(edge.degenerate for edge in skin.edges.values()) == poles
    assert all(edge.curve is None for edge in skin.edges.values() if edge.degenerate)


def test_two_sides_at_one_point_are_two_poles():
    net = [[[0, 0, 0], [0, 0, 1], [0, 0, 2]], [[0, 0, 0], [1, 0, 1], [0, 0, 2]]]
    skin = make_surface_shell(Surface.from_bspline((1, 2), (LINE, [0, 0, 0, 1, 1, 1]), net))
    assert_sound(skin)
    assert len([edge for edge in skin.edges.values() if edge.degenerate]) == 2


def test_a_surface_of_the_plane_is_refused():
    net = [[[0, 0], [0, 1]], [[1, 0], [1, 1]]]
    with pytest.raises(InputError, match="dimension 2"):
        make_surface_shell(Surface.from_bspline((1, 1), (LINE, LINE), net))
