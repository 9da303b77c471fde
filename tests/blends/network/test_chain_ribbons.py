"""Ribbons of chains: consecutive cells have one end section, and one tangent plane all along it."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from chain_cases import chain_of, rim_of
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.gp import gp_Vec

from cqblend.blends.rails.ribbon_end import EndJets
from cqblend.errors import GeometryError, SizeError

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
    blends = [context.section.fill(context.fit_rails((0.0, 1.0))) for context in case.contexts]
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


def sheared_prism(x, y):
    """A rounded box whose uprights lean by (x, y) on a height of 10."""
    outline = cq.Sketch().rect(30, 20).vertices().fillet(4)
    (face,) = outline._faces.Faces()
    return cq.Workplane(cq.Shape.cast(BRepPrimAPI_MakePrism(face.wrapped, gp_Vec(x, y, 10)).Shape()))


@pytest.mark.parametrize("options", SIZES, ids=["radius", "widths", "G2"])
@pytest.mark.parametrize("lean", [(3, 2), (7, 0)])
def test_cross_derivatives_run_along_oblique_smooth_edges(lean, options):
    """Else the cells would meet at an angle."""
    case = rim_of(sheared_prism(*lean), **options)
    ribbons = case.fit()
    gap, angle = case.measure(case.fill(ribbons))
    assert gap <= GAP
    assert angle <= ANGLE
    upright = np.array([*lean, 10.0])
    for walls in (pair[1] for pair in ribbons.cells):
        for end in (0, 1):
            vector = EndJets.from_ribbon(walls, end).values[1]
            assert np.linalg.norm(np.cross(vector, upright)) <= 1e-12 * np.linalg.norm(vector) * np.linalg.norm(upright)
    bends = [ribbon.bend for pair in ribbons.cells for ribbon in pair]
    assert 1e-4 < max(bends) < 0.5


def test_a_bent_rail_is_as_far_from_its_contacts_as_it_says():
    case = rim_of(sheared_prism(3, 2), radius=1.5)
    for cell, pair in zip(case.cells, case.fit().cells, strict=True):
        natural = cell.solve(np.linspace(-0.2, 1.2, 20001))
        for side, ribbon in enumerate(pair):
            t = np.linspace(*ribbon.c.domain, 101)
            made = ribbon.jets[0](t)
            points = cell.primaries[side].jet(natural.uv[side])[0]
            steps = np.linalg.norm(made[:, None, :3] / made[:, None, 3:] - points, axis=2).min(axis=1)
            assert steps.max() == pytest.approx(ribbon.bend, abs=2e-3)


def freeform_top():
    """A rounded box under a wavy spline face."""
    points = [
        [cq.Vector(x, y, 10 + 1.2 * np.sin(x / 9) + 0.8 * np.cos(y / 7)) for y in np.linspace(-30, 30, 9)]
        for x in np.linspace(-40, 40, 9)
    ]
    knife = cq.Face.makeSplineApprox(points, tol=1e-4, minDeg=3, maxDeg=3)
    parts = cq.Workplane().box(30, 20, 40).edges("|Z").fillet(4).val().split(knife).Solids()
    return cq.Workplane(min(parts, key=lambda part: part.Center().z))


@pytest.mark.parametrize("options", SIZES, ids=["radius", "widths", "G2"])
def test_cells_under_one_freeform_face_share_one_ratio_of_speeds(options):
    body = freeform_top()
    case = rim_of(body, body.faces("%BSPLINE").val(), **options)
    ribbons = case.fit()
    gap, angle = case.measure(case.fill(ribbons))
    assert gap <= GAP
    assert angle <= ANGLE
    assert max(ribbon.bend for pair in ribbons.cells for ribbon in pair) < 0.1


def leaning_wedge(first, second):
    """A body on whose upper front edge both faces go on in cylinders, past smooth edges that lean by two slopes."""

    def extrude(plane, slope, direction):
        outline = cq.Workplane(plane).moveTo(-20, -15).lineTo(-20, 5).lineTo(0, 5)
        middle, last = ((20 * np.sin(a), 20 * np.cos(a) - 15) for a in (0.3, 0.6))
        outline = outline.threePointArc(middle, last).lineTo(last[0], -15).close()
        wire = outline.wires().val().translate(cq.Vector(-20 * slope, 0, 0) - cq.Vector(*direction) / 2)
        way = gp_Vec(30 * slope, *direction[1:])
        return cq.Workplane(cq.Shape.cast(BRepPrimAPI_MakePrism(cq.Face.makeFromWires(wire).wrapped, way).Shape()))

    return extrude("XY", first, (0, 0, 30)).intersect(extrude("XZ", second, (0, 30, 0)))


@pytest.mark.parametrize("section", ["hermite", "pde"])
@pytest.mark.parametrize("slopes", [(0, 0), (0.3, 0), (0.3, -0.3), (0.5, 0.2)])
def test_both_rails_end_at_their_own_smooth_edge(slopes, section):
    body = leaning_wedge(*slopes)
    straight = min(body.edges("%LINE").vals(), key=lambda edge: (edge.Center() - cq.Vector(-10, 5, 5)).Length)
    curved = min(body.edges("not %LINE").vals(), key=lambda edge: (edge.positionAt(0.5) - cq.Vector(6, 4, 4)).Length)
    front = next(face for face in body.faces().vals() if any(edge.isSame(straight) for edge in face.Edges()))
    case = chain_of(body.val(), [straight, curved], front, radius=1.5, section=section)
    ribbons = case.fit((0.1, 0.8))
    gap, angle = case.measure(case.fill(ribbons))
    assert gap <= GAP
    assert angle <= ANGLE
    for side, edge in enumerate(case.crossings[0]):
        end = EndJets.from_ribbon(ribbons.cells[0][side], 1).values[0]
        edge_points = case.cells[0].primaries[side].jet(edge.before(np.linspace(*edge.domain, 20001))[0])[0]
        assert np.linalg.norm(edge_points - end, axis=1).min() <= 2e-3
        along = normalise(edge_points[-1] - edge_points[0])
        off = end - edge_points[0]
        assert np.linalg.norm(off - along * (off @ along)) <= 1e-12


def normalise(vector):
    return vector / np.linalg.norm(vector)


@pytest.mark.parametrize("roughness", [1e-3, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("options", SIZES, ids=["radius", "widths", "G2"])
def test_a_rough_smooth_edge_costs_its_own_angle_and_no_gap(options, roughness):
    bend = (15 * np.cos(roughness), 15 * np.sin(roughness) - 10)
    body = cq.Workplane().polyline([(-15, -10), (0, -10), bend, (15, 10), (-15, 10)]).close().extrude(10)
    top = body.faces(">Z").val()
    edges = [edge for edge in top.Edges() if edge.Center().y < -9]
    case = chain_of(body.val(), edges, top, **options)
    gap, angle = case.measure(case.fill(case.fit((0.1, 0.9))))
    assert gap <= GAP
    assert angle == pytest.approx(roughness, rel=1e-5)


@pytest.mark.parametrize("length", [1.0, 0.05])
def test_a_cell_may_be_much_shorter_than_the_width(length):
    """An arc of radius 20 between splines, which continue it."""
    start, stop = 0.2, 0.2 + length / 20
    arc = [(5 + 20 * (np.sin(a) - np.sin(start)), -8 + 20 * (np.cos(start) - np.cos(a))) for a in (start, stop)]
    middle = (start + stop) / 2
    between = (5 + 20 * (np.sin(middle) - np.sin(start)), -8 + 20 * (np.cos(start) - np.cos(middle)))
    body = cq.Workplane().moveTo(-12, -8)
    body = body.spline([(-4, -9), arc[0]], tangents=[(1, 0), (np.cos(start), np.sin(start))], includeCurrent=True)
    body = body.threePointArc(between, arc[1])
    body = body.spline([(15, -2), (12, 7)], tangents=[(np.cos(stop), np.sin(stop)), (-1, 0.3)], includeCurrent=True)
    body = body.lineTo(-12, 7).close().extrude(10)
    top = body.faces(">Z").val()
    edges = [edge for edge in top.Edges() if edge.geomType() != "LINE"]
    case = chain_of(body.val(), edges, top, radius=2.0)
    ribbons = case.fit((0.1, 0.9))
    assert [pair[0].light for pair in ribbons.cells].count(True) == 1
    gap, angle = case.measure(case.fill(ribbons))
    assert gap <= GAP
    assert angle <= ANGLE


@pytest.mark.parametrize("order", [4, 6])
def test_pde_cells_have_hermite_sections_where_they_meet(order):
    case = rim_of(four_splines(), radius=2.0, section="pde", order=order)
    gap, angle = case.measure(case.fill(case.fit()))
    assert gap <= GAP
    assert angle <= ANGLE


def turned_part(offset):
    """A cylinder with a rounded rim, cut off beside its axis: the cut, and the edges around it but for the lowest."""
    body = cq.Workplane().circle(12).extrude(20).faces(">Z").edges().fillet(4)
    body = body.intersect(cq.Workplane().box(40, 40, 60).translate((0, 20 + offset, 0)))
    cut = body.faces("<Y").val()
    return body.val(), [edge for edge in cut.Edges() if edge.Center().z > 1], cut


@pytest.mark.parametrize("continuity", ["G1", "G2", "G3"])
@pytest.mark.parametrize("offset", [0, 4])
def test_sections_of_higher_order_follow_curved_smooth_edges(offset, continuity):
    """By Codazzi's equations, what goes on is common to both faces along a smooth edge, if sections bend as it does."""
    body, edges, cut = turned_part(offset)
    case = chain_of(body, edges, cut, radius=1.5, continuity=continuity)
    gap, angle = case.measure(case.fill(case.fit((0.1, 0.9))))
    assert gap <= GAP
    assert angle <= ANGLE


def test_curvature_that_cannot_go_on_at_a_very_oblique_edge_is_refused():
    body, edges, cut = turned_part(6)
    case = chain_of(body, edges, cut, width=(1.5, 2.0), continuity="G2")
    with pytest.raises(GeometryError, match="too oblique to the rail for curvature to go on there; take G1"):
        case.fit((0.1, 0.9))


def test_rails_have_a_kink_at_a_very_oblique_edge():
    body, edges, cut = turned_part(6)
    case = chain_of(body, edges, cut, radius=1.5)
    ribbons = case.fit((0.1, 0.9))
    gap, angle = case.measure(case.fill(ribbons))
    assert gap <= GAP
    assert angle <= ANGLE
    assert max(junction.angle for junction in ribbons.junctions) <= ANGLE


def test_a_ball_larger_than_the_radius_of_a_corner_is_refused():
    body = cq.Workplane().box(30, 20, 10).edges("|Z").fillet(1)
    with pytest.raises(SizeError, match="a rail turns back: the size is larger than the radius of curvature there"):
        rim_of(body, radius=2.0).fit()
