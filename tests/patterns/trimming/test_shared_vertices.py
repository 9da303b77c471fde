"""Vertices along edges: arcs through them follow the curve, crossings are found, both uses agree."""

from itertools import pairwise

import numpy as np
import pytest

from cqblend.errors import GeometryError
from cqblend.patterns.trimming.domain_cells import CutLines
from cqblend.patterns.trimming.shared_vertices import (
    CutEdgeUse,
    find_crossings,
    merge_parameters,
    refine_parameters,
    sample_edge,
    snap_to_lines,
)
from cqblend.patterns.trimming.tolerances import TRIM_TOLERANCES
from cqblend.patterns.trimming.trimmed_patch import EdgeUse, PatchEdge

NO_LINES = CutLines(1, np.array([]))
UNIT = (1.0, 1.0)
SNAP = TRIM_TOLERANCES.line_snap


def circle(t):
    return np.stack([5 * np.cos(t), 5 * np.sin(t), np.zeros_like(t)], axis=-1)


def helix(t):
    return np.stack([np.cos(3 * t), np.sin(3 * t), t * t], axis=-1)


def edge(points, start=0.0, stop=1.0, degenerate=False):
    return PatchEdge(1, points, np.array([start, stop]), None, lambda t: t, (1, 2), (1, 2), np.nan, 0.0, degenerate)


def use(pcurve, start=0.0, stop=1.0, degenerate=False):
    return EdgeUse(1, True, pcurve, np.array([start, stop]), degenerate)


def worst_distance_from_arcs(points, t):
    """Of dense points from the circles through each pair of neighbours and the curve's point between them."""
    worst = 0.0
    for start, stop in pairwise(t):
        a, m, b = points(np.array([start, (start + stop) / 2, stop]))
        u, v = m - a, b - a
        normal = np.cross(u, v)
        square = normal @ normal
        inner = points(np.linspace(start, stop, 17)[1:-1])
        if square < 1e-24:
            worst = max(worst, np.linalg.norm(np.cross(inner - a, v), axis=1).max() / np.linalg.norm(v))
            continue
        centre = a + (u @ u * np.cross(v, normal) - v @ v * np.cross(u, normal)) / (2 * square)
        radius = np.linalg.norm(a - centre)
        off = (inner - centre) @ normal / np.sqrt(square)
        inside = np.linalg.norm(inner - centre - off[:, None] * normal / np.sqrt(square), axis=1) - radius
        worst = max(worst, np.hypot(off, inside).max())
    return worst


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
def test_arcs_follow_the_curve(tolerance):
    t = refine_parameters(helix, np.array([0.0, 1.0]), tolerance, np.inf)
    assert worst_distance_from_arcs(helix, t) <= 1.6 * tolerance
    assert (np.diff(t) > 0).all()


def test_a_circle_takes_few_arcs_and_keeps_to_its_chords():
    t = refine_parameters(circle, np.linspace(0, 2 * np.pi, 3), 1e-2, np.inf)
    assert 6 <= len(t) - 1 <= 16
    t = refine_parameters(circle, np.linspace(0, 2 * np.pi, 3), 1e-2, 1e-4)
    assert 5 * (1 - np.cos(np.diff(t).max() / 2)) <= 1e-4


def test_a_straight_line_takes_no_vertices():
    t = refine_parameters(lambda t: np.stack([t, 2 * t, -t], axis=-1), np.array([0.0, 0.3, 1.0]), 1e-9, 1e-9)
    assert t.tolist() == [0.0, 0.3, 1.0]


def test_too_many_vertices_are_refused():
    def rough(t):
        return np.stack([t, np.sin(1e5 * t), np.zeros_like(t)], axis=-1)

    with pytest.raises(GeometryError, match=r"vertices .* loosen the tolerance"):
        refine_parameters(rough, np.linspace(0, 1, 5000), 1e-9, np.inf)


def test_points_next_to_a_line_are_put_on_it():
    lines = CutLines(1, np.array([0.25, 0.5]), {0: [0.75]})
    uv = np.array(
        [
            [0.75 + SNAP / 2, 0.25 - SNAP / 2],
            [0.75 + 2 * SNAP, 0.5 + 2 * SNAP],
            [0.1, 0.1],
        ]
    )
    found = snap_to_lines(uv, lines, UNIT)
    assert found[0].tolist() == [0.75, 0.25]
    assert np.array_equal(found[1:], uv[1:])
    assert snap_to_lines(uv, lines, (1.0, 10.0))[1, 1] == 0.5  # relative to the extent


def test_crossings_are_found_to_rounding():
    lines = CutLines(1, np.array([0.2, 0.6]), {1: [0.5]})
    curve = use(lambda t: np.stack([t, t**2], axis=-1))
    at, axis, value = find_crossings(CutEdgeUse(curve, lines, UNIT), np.linspace(0, 1, 8))
    order = np.argsort(at)
    assert at[order] == pytest.approx([np.sqrt(0.2), 0.5, np.sqrt(0.6)], abs=1e-14)
    assert axis[order].tolist() == [1, 0, 1]
    assert value[order].tolist() == [0.2, 0.5, 0.6]


def test_a_sample_on_a_line_is_a_crossing_once():
    curve = use(lambda t: np.stack([t, t], axis=-1))
    at, _, value = find_crossings(CutEdgeUse(curve, CutLines(1, np.array([0.5])), UNIT), np.linspace(0, 1, 5))
    assert at.tolist() == [0.5]
    assert value.tolist() == [0.5]


def test_an_edge_along_a_line_does_not_cross_it():
    curve = use(lambda t: np.stack([t, np.full_like(t, 0.5)], axis=-1))
    at, *_ = find_crossings(CutEdgeUse(curve, CutLines(1, np.array([0.5])), UNIT), np.linspace(0, 1, 5))
    assert len(at) == 0


def test_close_parameters_are_merged_and_ends_kept():
    found = merge_parameters(np.array([1e-9, 0.5, 0.5 + 1e-9, 0.7, 1 - 1e-9]), 1e-6, np.array([0.0, 1.0]))
    assert found.tolist() == [0.0, 0.5, 0.7, 1.0]


def test_both_uses_have_vertices_where_either_crosses():
    lines = CutLines(1, np.array([0.3])), CutLines(0, np.array([0.6]))
    uses = use(lambda t: np.stack([t, t], axis=-1)), use(lambda t: np.stack([1 - t, t * t], axis=-1))
    line = edge(lambda t: np.stack([t, t, t], axis=-1))
    found = sample_edge(line, [CutEdgeUse(one, at, UNIT) for one, at in zip(uses, lines, strict=True)], 1e-3, 1e-3)
    assert found.t[found.strip_breaks] == pytest.approx([0, 0.3, 0.4, 1], abs=1e-12)
    assert found.uv[0][found.strip_breaks[1]].tolist()[1] == 0.3  # exactly
    assert found.uv[1][found.strip_breaks[2]].tolist()[0] == 0.6
    assert all(len(uv) == len(found.t) for uv in found.uv)


def test_a_pole_has_vertices_at_the_lines_only():
    pole = edge(lambda t: np.zeros((len(t), 3)), degenerate=True)
    around = use(lambda t: np.stack([t, np.zeros_like(t)], axis=-1), degenerate=True)
    found = sample_edge(pole, [CutEdgeUse(around, CutLines(0, np.array([0.25, 0.75])), UNIT)], 1e-3, 1e-3)
    assert found.t == pytest.approx([0, 0.25, 0.75, 1], abs=1e-12)
    assert found.uv[0][:, 0].tolist() == pytest.approx([0, 0.25, 0.75, 1], abs=1e-12)


def test_a_curved_edge_has_vertices_close_enough():
    line = edge(circle, 0.0, 2.0)
    found = sample_edge(
        line, [CutEdgeUse(use(lambda t: np.stack([t / 2, t * 0], axis=-1), 0.0, 2.0), NO_LINES, UNIT)], 1e-6, 1e-3
    )
    assert found.strip_breaks.tolist() == [0, len(found.t) - 1]
    assert 5 * (1 - np.cos(np.diff(found.t).max() / 2)) <= 1e-3
