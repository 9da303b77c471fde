"""Faces with borders of two edges: at a coarse tolerance each of them is one arc, and two chords enclose nothing."""

import cadquery as cq
import numpy as np
import pytest
from shapely.geometry import Polygon

import cqblend
from cqblend.errors import GeometryError
from cqblend.patterns.trimming.domain_cells import CutLines, DomainSide, cut_domain


def lens(width: float, height: float) -> cq.Workplane:
    """Two arcs over one chord of twice the width, each as high as given."""
    plan = cq.Workplane().moveTo(-width, 0).threePointArc((0, height), (width, 0))
    return plan.threePointArc((0, -height), (-width, 0)).close().extrude(2)


def arc(width: float, height: float) -> tuple[float, float]:
    """Return the radius and the angle of an arc."""
    radius = (width**2 + height**2) / (2 * height)
    return radius, float(2 * np.arcsin(width / radius))


def segment_area(width: float, height: float) -> float:
    """Return the area between an arc and its chord."""
    radius, angle = arc(width, height)
    return float(radius**2 / 2 * (angle - np.sin(angle)))


def areas(pattern: cqblend.Pattern) -> list[float]:
    """Return the areas of the pieces, from points along their outlines alone."""
    found = []
    for piece in pattern.strips:
        shell, *holes = ([tuple(point) for point in path.sampled(1e-7)] for path in piece.outlines)
        found.append(Polygon(shell, holes).area)
    return sorted(found)


@pytest.mark.parametrize("height", [0.3, 0.01])
@pytest.mark.parametrize("tolerance", [0.01, 3.05, 300.0])
def test_a_lens_is_laid_flat_whole_however_coarse_the_tolerance(height: float, tolerance: float) -> None:
    body = lens(3, height)
    wall = 2 * np.prod(arc(3, height))
    found = areas(cqblend.unroll(body.val(), tolerance))
    assert found == pytest.approx(sorted([*[2 * segment_area(3, height)] * 2, wall, wall]), rel=1e-5)


@pytest.mark.parametrize("tolerance", [0.01, 3.05, 300.0])
def test_a_hole_of_two_edges_stays_a_hole(tolerance: float) -> None:
    plate = cq.Workplane().box(20, 20, 2, centered=(True, True, False)).cut(lens(5, 0.5))
    pattern = cqblend.unroll(plate.val(), tolerance)
    assert areas(pattern)[-2:] == pytest.approx([400 - 2 * segment_area(5, 0.5)] * 2, rel=1e-6)
    assert sorted(len(piece.loops) for piece in pattern.strips) == [1] * 6 + [2] * 2
    assert pattern.report.seam_mismatch < 1e-9


def test_loops_that_enclose_nothing_are_named() -> None:
    there = np.array([[0.0, 0.0], [1.0, 1.0]])
    with pytest.raises(GeometryError, match=r"a trimming loop of 2 vertices, the first at \(u, v\) = \(0\.0, 0\.0\)"):
        cut_domain([[DomainSide(0, there), DomainSide(1, there[::-1])]], CutLines(1, np.empty(0)))
    square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [np.nan, 4.0], [0.0, 0.0]])
    with pytest.raises(GeometryError, match="encloses nothing"):
        cut_domain([[DomainSide(0, square)]], CutLines(1, np.empty(0)))
