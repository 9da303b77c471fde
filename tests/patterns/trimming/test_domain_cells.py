"""Trimmed domains cut along parameter lines: areas by shapely, sides by hand."""

from itertools import pairwise

import numpy as np
import pytest
import shapely

from cqblend.errors import GeometryError
from cqblend.patterns.trimming.domain_cells import CutLines, DomainSide, EdgeStep, LineStep, cut_domain


def loop(points, uses=None):
    """A closed polygon as one side for each segment, or as one for each run of points of the same use."""
    closed = np.array([*points, points[0]], dtype=float)
    uses = list(range(len(points))) if uses is None else uses
    return [DomainSide(use, closed[i : i + 2]) for use, i in zip(uses, range(len(points)), strict=True)]


def with_crossings(points, lines):
    """A polygon with vertices of exactly their values where it crosses lines of both axes."""
    found = [np.array(points[0], dtype=float)]
    for start, stop in pairwise(np.array([*points, points[0]], dtype=float)):
        inner = []
        for axis in (0, 1):
            for value in lines.list_values(axis):
                if min(start[axis], stop[axis]) < value < max(start[axis], stop[axis]):
                    part = (value - start[axis]) / (stop[axis] - start[axis])
                    vertex = start + part * (stop - start)
                    vertex[axis] = value
                    inner.append((part, vertex))
        found += [vertex for _, vertex in sorted(inner, key=lambda pair: pair[0])]
        found.append(stop)
    return [tuple(map(float, point)) for point in found[:-1]]


def ring(steps):
    return shapely.Polygon([step.start for step in steps])


def area(cell):
    return ring(cell.loops[0]).area - sum(ring(hole).area for hole in cell.loops[1:])


def assert_sound(cells, lines):
    """Loops are closed, wind as they should, keep to their row, and lines have a neighbour on the other side."""
    lined = {}
    for cell in cells:
        for k, steps in enumerate(cell.loops):
            assert all(before.stop == after.start for before, after in zip(steps, [*steps[1:], steps[0]], strict=True))
            assert ring(steps).exterior.is_ccw == (k == 0)
            across = [step.start[lines.axis] for step in steps]
            if cell.strip_index > 0:
                assert min(across) >= lines.strip_borders[cell.strip_index - 1]
            if cell.strip_index < len(lines.strip_borders):
                assert max(across) <= lines.strip_borders[cell.strip_index]
            for step in steps:
                if isinstance(step, LineStep):
                    axis, index = step.axis, step.line_index
                    assert step.start[axis] == step.stop[axis] == lines.list_values(axis)[index]
                    low, high = sorted((step.start[1 - axis], step.stop[1 - axis]))
                    sense = 1 if step.start[1 - axis] < step.stop[1 - axis] else -1
                    lined.setdefault((axis, index, sense), []).append((low, high))
    for (axis, index, sense), stretches in lined.items():
        total = sum(high - low for low, high in stretches)
        assert total == pytest.approx(sum(high - low for low, high in lined[axis, index, -sense]))


SQUARE = [(0, 0), (4, 0), (4, 4), (0, 4)]
HOLE = [(1.0, 1.5), (1.5, 3.0), (3.0, 2.5), (2.5, 1.0)]  # clockwise


@pytest.mark.parametrize("axis", [0, 1])
def test_a_hole_across_several_rows(axis):
    lines = CutLines(axis, np.array([0.5, 1.25, 2.0, 2.75, 3.5]))
    outer, hole = with_crossings(SQUARE, lines), with_crossings(HOLE, lines)
    uses = list(range(len(outer))), list(range(len(outer), len(outer) + len(hole)))
    cells = cut_domain([loop(outer, uses[0]), loop(hole, uses[1])], lines)
    assert_sound(cells, lines)
    domain = shapely.Polygon(SQUARE, [HOLE])
    assert sum(map(area, cells)) == pytest.approx(domain.area, rel=1e-12)
    assert sorted({cell.strip_index for cell in cells}) == list(range(6))
    assert all(len(cell.loops) == 1 for cell in cells)
    # every segment of both loops is a step of exactly one cell
    used = sorted(
        step.use_index for cell in cells for steps in cell.loops for step in steps if isinstance(step, EdgeStep)
    )
    assert used == sorted([*uses[0], *uses[1]])


def test_a_hole_inside_one_row_stays_a_hole():
    lines = CutLines(1, np.array([0.5, 3.5]))
    cells = cut_domain([loop(with_crossings(SQUARE, lines)), loop(HOLE, [90, 91, 92, 93])], lines)
    assert_sound(cells, lines)
    assert [len(cell.loops) for cell in cells] == [1, 2, 1]
    assert {step.use_index for step in cells[1].loops[1]} == {90, 91, 92, 93}


def test_without_lines_the_domain_is_one_cell():
    (cell,) = cut_domain([loop(SQUARE), loop(HOLE, [4, 5, 6, 7])], CutLines(1, np.array([])))
    assert cell.strip_index == 0
    assert [len(steps) for steps in cell.loops] == [4, 4]
    assert area(cell) == pytest.approx(16 - shapely.Polygon(HOLE).area)


def test_cuts_belong_to_their_rows():
    lines = CutLines(1, np.array([2.0]), {1: [1.0, 3.0]})
    points = [(0, 0), (4, 0), (4, 2), (4, 4), (3, 4), (1, 4), (0, 4), (0, 2)]
    cells = cut_domain([loop(points)], lines)
    assert_sound(cells, lines)
    assert [(cell.strip_index, area(cell)) for cell in cells] == [(0, 8.0), (1, 2.0), (1, 4.0), (1, 2.0)]
    assert lines.list_values(0).tolist() == [1.0, 3.0]
    assert lines.list_values(1).tolist() == [2.0]


def test_places_tell_the_sense_along_the_edge():
    """A cell may run along a side backwards only if the domain was given clockwise: places rise, uses are kept."""
    side = DomainSide(7, np.array([[0.0, 0.0], [1.0, -0.2], [2.0, 0.0]]))
    back = DomainSide(8, np.array([[2.0, 0.0], [2.0, 1.0], [0.0, 1.0], [0.0, 0.0]]))
    (cell,) = cut_domain([[side, back]], CutLines(1, np.array([])))
    assert sorted(step.point_indices for step in cell.loops[0] if step.use_index == 7) == [(0, 1), (1, 2)]
    assert sorted(step.point_indices for step in cell.loops[0] if step.use_index == 8) == [(0, 1), (1, 2), (2, 3)]


def test_a_loop_given_clockwise_is_turned():
    turned = [DomainSide(0, np.array([(0, 0), (0, 4), (4, 4), (4, 0), (0, 0)], dtype=float))]
    (cell,) = cut_domain([turned], CutLines(1, np.array([])))
    assert ring(cell.loops[0]).exterior.is_ccw
    assert sorted(step.point_indices for step in cell.loops[0]) == [(1, 0), (2, 1), (3, 2), (4, 3)]


@pytest.mark.parametrize("seed", range(6))
def test_random_stars_keep_their_area(seed):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 40))
    radius = rng.uniform(0.3, 1.0, 40)
    star = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]).tolist()
    lines = CutLines(seed % 2, np.sort(rng.uniform(-0.9, 0.9, 7)))
    cells = cut_domain([loop(with_crossings(star, lines))], lines)
    assert_sound(cells, lines)
    assert sum(map(area, cells)) == pytest.approx(shapely.Polygon(star).area, rel=1e-12)


def test_loops_that_cross_are_refused():
    bow_tie = [(0, 0), (4, 4), (4, 0), (0, 4)]
    with pytest.raises(GeometryError, match="not simple"):
        cut_domain([loop(bow_tie)], CutLines(1, np.array([])))
