"""Ribbons of chains: consecutive cells have one end section, and one tangent plane all along it."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from chain_cases import rim_of

GAP, ANGLE = 1e-12, 1e-11


def rounded_box():
    return cq.Workplane().box(30, 20, 10).edges("|Z").fillet(4)


def tapered_box():
    return cq.Workplane().sketch().rect(30, 20).vertices().fillet(4).finalize().extrude(10, taper=8)


def line_spline_arc():
    outline = cq.Workplane().moveTo(-10, -8).lineTo(10, -8)
    outline = outline.spline([(16, -2), (12, 8)], tangents=[(1, 0), (-1, 0)], includeCurrent=True)
    return outline.lineTo(-10, 8).threePointArc((-18, 0), (-10, -8)).close().extrude(10)


def four_splines():
    outline = cq.Workplane().moveTo(-12, -8)
    for points, tangents in (
        ([(-4, -9), (5, -8)], [(1, 0), (1, 0.2)]),
        ([(14, -3), (12, 7)], [(1, 0.2), (-1, 0.3)]),
        ([(0, 10), (-10, 8)], [(-1, 0.3), (-1, -0.2)]),
        ([(-17, 0), (-12, -8)], [(-1, -0.2), (1, 0)]),
    ):
        outline = outline.spline(points, tangents=tangents, includeCurrent=True)
    return outline.close().extrude(10)


SIZES = [{"radius": 2.0}, {"width": (1.5, 2.0)}, {"radius": 2.0, "continuity": "G2"}]


@pytest.mark.parametrize("options", SIZES, ids=["radius", "widths", "G2"])
@pytest.mark.parametrize("body", [rounded_box, tapered_box])
def test_straight_and_circular_cells_stay_light(body, options):
    case = rim_of(body(), **options)
    ribbons = case.fit()
    assert [ribbon.light for pair in ribbons.cells for ribbon in pair] == [True] * 16
    gap, angle = case.measure(case.fill(ribbons))
    assert gap <= GAP
    assert angle <= ANGLE


@pytest.mark.parametrize("options", SIZES, ids=["radius", "widths", "G2"])
def test_a_cubic_cell_takes_the_sections_of_its_light_neighbours(options):
    case = rim_of(line_spline_arc(), **options)
    ribbons = case.fit()
    assert sorted(pair[0].light for pair in ribbons.cells) == [False, True, True, True]
    gap, angle = case.measure(case.fill(ribbons))
    assert gap <= GAP
    assert angle <= ANGLE


@pytest.mark.parametrize("form", ["exact", "compact"])
@pytest.mark.parametrize("options", SIZES, ids=["radius", "widths", "G2"])
def test_a_closed_chain_of_cubic_cells_has_no_seam(options, form):
    case = rim_of(four_splines(), **options, form=form)
    ribbons = case.fit()
    assert not any(ribbon.light for pair in ribbons.cells for ribbon in pair)
    gap, angle = case.measure(case.fill(ribbons))
    assert gap <= GAP
    assert angle <= ANGLE


def test_what_the_fit_reports_of_junctions_is_what_their_surfaces_have():
    case = rim_of(four_splines(), radius=2.0)
    ribbons = case.fit()
    assert len(ribbons.junctions) == 4
    assert max(junction.gap for junction in ribbons.junctions) <= GAP
    assert max(junction.angle for junction in ribbons.junctions) <= ANGLE


def test_cells_alone_would_not_meet():
    """What the chains do together is not there by itself."""
    case = rim_of(four_splines(), radius=2.0)
    blends = [context.make_blend((0.0, 1.0)) for context in case.contexts]
    gap, angle = case.measure(blends)
    assert gap > 1e-7
    assert angle > 1e-6


def test_one_open_cell_is_what_it_is_alone():
    case = rim_of(four_splines(), radius=2.0)
    case.cells, case.crossings, case.closed = case.cells[:1], [], False
    (pair,) = case.fit((-0.05, 1.02)).cells
    alone = case.contexts[0].fit_rails((-0.05, 1.02))
    for made, wanted in zip(pair, alone, strict=True):
        assert np.array_equal(made.c.coefs, wanted.c.coefs)
        assert np.array_equal(made.directions[0].coefs, wanted.directions[0].coefs)
