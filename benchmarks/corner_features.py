"""Features that meet, bodies that are no boxes, and parts with earlier blends, with edges as people pick them."""

from __future__ import annotations

from collections.abc import Sequence

import cadquery as cq

import cqblend
from benchmarks.corner_parts import CornerPart, Maker, at_height, make_angle, make_block, make_plate, picked


def _legs() -> cq.Workplane:
    body = cq.Workplane().box(50, 36, 6)
    spots = [(x, y) for x in (-17, 17) for y in (-11, 11)]
    return body.faces("<Z").workplane().pushPoints(spots).rect(7, 6).extrude(18)


def feet_of_legs() -> CornerPart:
    legs = _legs()
    return CornerPart(legs.val(), at_height(legs, -3, within=24), 1.2)


def feet_and_uprights_of_legs() -> CornerPart:
    legs = _legs()
    uprights = [e for e in legs.edges("|Z").vals() if e.Length() > 10]
    return CornerPart(legs.val(), [*at_height(legs, -3, within=24), *uprights], 1.2)


def all_of_a_table() -> CornerPart:
    return picked(_legs(), "", 1.0)


def _flush_legs() -> cq.Workplane:
    body = cq.Workplane().box(50, 36, 6)
    return body.faces("<Z").workplane().rect(43, 30, forConstruction=True).vertices().rect(7, 6).extrude(18)


def feet_of_flush_legs() -> CornerPart:
    legs = _flush_legs()
    feet = [e for e in at_height(legs, -3) if e.Length() < 8]
    return CornerPart(legs.val(), feet, 1.2)


def all_of_a_table_with_flush_legs() -> CornerPart:
    return picked(_flush_legs(), "", 1.0)


def _tower(degrees: float, tilt: float) -> cq.Workplane:
    tower = cq.Workplane().polygon(6, 19).extrude(60).translate((0, 0, -30))
    return (
        cq.Workplane()
        .box(42, 40, 18)
        .union(tower.rotate((0, 0, 0), (0, 0, 1), degrees).rotate((0, 0, 0), (1, 0, 0), tilt))
    )


def feet_of_a_tilted_tower() -> CornerPart:
    body = _tower(0, 25)
    return CornerPart(body.val(), [*at_height(body, 9, within=19), *at_height(body, -9, within=19)], 2.0)


def all_of_an_upright_tower() -> CornerPart:
    return picked(_tower(10, 0), "", 1.5)


def all_of_a_tilted_tower() -> CornerPart:
    return picked(_tower(10, 20), "", 1.0)


def all_of_a_boss_on_a_plate() -> CornerPart:
    return picked(make_plate().faces(">Z").workplane().rect(14, 10).extrude(7), "", 1.0)


def all_of_a_boss_in_the_corner_of_a_plate() -> CornerPart:
    return picked(make_plate().union(cq.Workplane().box(12, 10, 7, centered=False).translate((8, 5, 8))), "", 1.0)


def all_of_a_boss_at_the_side_of_a_plate() -> CornerPart:
    return picked(make_plate().union(cq.Workplane().box(12, 10, 7, centered=False).translate((-5, 5, 8))), "", 1.0)


def two_bosses_side_by_side() -> CornerPart:
    bosses = (
        cq.Workplane()
        .box(8, 12, 7, centered=(False, True, False))
        .union(cq.Workplane().box(8, 9, 11, centered=(False, True, False)).translate((-8, 0, 0)))
    )
    return picked(make_plate().union(bosses.translate((0, 0, 8))), "", 0.5)


def corner_of_a_room() -> CornerPart:
    room = (
        cq.Workplane()
        .box(20, 20, 20, centered=False)
        .cut(cq.Workplane().box(20, 20, 20, centered=False).translate((4, 4, 4)))
    )
    edges = [e for e in room.val().Edges() if min(e.Center().toTuple()) > 3.9 and max(e.Center().toTuple()) < 19.9]
    return CornerPart(room.val(), [e for e in edges if sorted(e.Center().toTuple())[1] < 4.1], 3.0)


def all_of_a_room() -> CornerPart:
    room = (
        cq.Workplane()
        .box(20, 20, 20, centered=False)
        .cut(cq.Workplane().box(20, 20, 20, centered=False).translate((4, 4, 4)))
    )
    return picked(room, "", 1.2)


def all_of_a_notched_cube() -> CornerPart:
    return picked(cq.Workplane().box(20, 20, 20).cut(cq.Workplane().box(20, 20, 20).translate((10, 10, 10))), "", 1.5)


def all_of_crossing_bars() -> CornerPart:
    return picked(cq.Workplane().box(40, 8, 6).union(cq.Workplane().box(9, 30, 6)), "", 1.0)


def all_of_two_bars_of_two_heights() -> CornerPart:
    return picked(cq.Workplane().box(40, 8, 6).union(cq.Workplane().box(9, 30, 12)), "", 1.0)


def all_of_a_house() -> CornerPart:
    return picked(cq.Workplane("XZ").polyline([(-8, 0), (8, 0), (8, 9), (0, 15), (-8, 9)]).close().extrude(18), "", 1.0)


# -- bodies that are not boxes


def top_of_a_nut() -> CornerPart:
    return picked(cq.Workplane().polygon(6, 20).circle(5).extrude(7), ">Z", 0.8)


def all_of_a_nut() -> CornerPart:
    return picked(cq.Workplane().polygon(6, 20).circle(5).extrude(7), "", 0.8)


def all_of_a_half_cylinder() -> CornerPart:
    half = cq.Workplane().moveTo(0, -10).lineTo(0, 10).threePointArc((10, 0), (0, -10)).close().extrude(8)
    return picked(half, "", 1.0)


def all_of_a_sector() -> CornerPart:
    return picked(cq.Workplane(cq.Solid.makeCylinder(12, 8, angleDegrees=70)), "", 1.0)


def all_of_a_cone_sector() -> CornerPart:
    return picked(cq.Workplane(cq.Solid.makeCone(14, 8, 12, angleDegrees=100)), "", 1.0)


def all_of_an_eighth_of_a_ball() -> CornerPart:
    eighth = cq.Workplane().sphere(14).intersect(cq.Workplane().box(20, 20, 20, centered=False))
    return picked(eighth, "", 1.0)


def all_of_a_lens_of_two_cylinders() -> CornerPart:
    one = cq.Workplane().center(-5, 0).circle(10).extrude(6)
    return picked(one.intersect(cq.Workplane().center(5, 0).circle(10).extrude(6)), "", 0.8)


def all_of_a_plate_with_a_spline_outline() -> CornerPart:
    plate = cq.Workplane().moveTo(0, 0).lineTo(45, 3).spline([(35, 21), (17, 29), (1, 22)], includeCurrent=True)
    return picked(plate.spline([(-3, 11), (0, 0)], includeCurrent=True).close().extrude(5), "", 0.7)


def all_of_a_frustum() -> CornerPart:
    return picked(cq.Workplane().rect(20, 16).workplane(offset=12).rect(12, 9).loft(ruled=True), "", 1.0)


def all_of_a_twisted_loft() -> CornerPart:
    lower = cq.Workplane().rect(18, 14)
    upper = lower.workplane(offset=14).transformed(rotate=(0, 0, 18)).rect(14, 12)
    return picked(upper.loft(ruled=True), "", 1.0)


def all_of_a_smooth_loft() -> CornerPart:
    return picked(
        cq.Workplane().rect(18, 14).workplane(offset=7).rect(13, 10).workplane(offset=7).rect(17, 12).loft(), "", 1.0
    )


def all_of_a_tapered_block() -> CornerPart:
    return picked(cq.Workplane().rect(24, 18).extrude(10, taper=8), "", 1.0)


def all_of_a_wedge() -> CornerPart:
    return picked(cq.Workplane("XZ").polyline([(0, 0), (24, 0), (24, 10)]).close().extrude(14), "", 0.8)


def all_of_a_dovetail() -> CornerPart:
    outline = [(-12, 0), (12, 0), (12, 8), (5, 8), (8, 16), (-8, 16), (-5, 8), (-12, 8)]
    return picked(cq.Workplane("XZ").polyline(outline).close().extrude(20), "", 0.8)


def all_of_a_tetrahedron() -> CornerPart:
    return _polyhedron([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])


def all_of_a_pyramid() -> CornerPart:
    points = [(1, 1, 0), (-1, 1, 0), (-1, -1, 0), (1, -1, 0), (0, 0, 1.2)]
    return _polyhedron(points, [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)])


def all_of_an_octahedron() -> CornerPart:
    points = [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    above = [(n, (n + 1) % 4, 4) for n in range(4)]
    return _polyhedron(points, [*above, *((b, a, 5) for a, b, _ in above)])


def _polyhedron(points: Sequence[Sequence[float]], polygons: Sequence[Sequence[int]]) -> CornerPart:
    corners = [cq.Vector(*(10.0 * x for x in point)) for point in points]
    wires = [cq.Wire.makePolygon([corners[n] for n in polygon], close=True) for polygon in polygons]
    solid = cq.Solid.makeSolid(cq.Shell.makeShell([cq.Face.makeFromWires(wire) for wire in wires]))
    return CornerPart(solid, solid.Edges(), 1.0)


def all_of_a_cross_gable() -> CornerPart:
    """Eight edges meet where the two ridges cross."""
    gable = cq.Workplane("XZ").polyline([(-8, 0), (8, 0), (8, 6), (0, 13), (-8, 6)]).close().extrude(15, both=True)
    return picked(gable.union(gable.rotate((0, 0, 0), (0, 0, 1), 90)), "", 0.8)


# -- beside earlier blends


def beside_one_native_fillet() -> CornerPart:
    body = make_block().edges("|Z and >X and >Y").fillet(3)
    return CornerPart(body.val(), body.faces(">Z").edges().vals(), 1.5)


def beside_one_blend() -> CornerPart:
    body = _block_with_a_blend()
    return CornerPart(body.val(), body.faces(">Z").edges().vals(), 1.5)


def rest_of_a_box_with_one_blend() -> CornerPart:
    return picked(_block_with_a_blend(), "", 1.0)


def _block_with_a_blend() -> cq.Workplane:
    block = make_block()
    return cq.Workplane(cqblend.blend_edges(block, block.edges("|Z and >X and >Y"), 3.0).shape)


def uprights_below_a_native_rim() -> CornerPart:
    body = make_block().faces(">Z").edges().fillet(2)
    return CornerPart(body.val(), body.edges("|Z").vals(), 2.0)


def small_uprights_below_a_native_rim() -> CornerPart:
    body = make_block().faces(">Z").edges().fillet(2)
    return CornerPart(body.val(), body.edges("|Z").vals(), 1.0)


def small_corner_after_a_large_native_one() -> CornerPart:
    body = make_block().edges("(>X and >Z) or (>Y and >Z)").fillet(2)
    left = [e for e in body.edges("|Z").vals() if e.Center().x > 14 and e.Center().y > 9]
    return CornerPart(body.val(), left, 1.0)


def lower_rim_after_native_uprights_of_one_size() -> CornerPart:
    body = cq.Workplane().box(12, 11, 10).edges("|Z").fillet(1.2)
    return CornerPart(body.val(), body.edges("<Z").vals(), 1.2)


def second_foot_beside_a_native_one() -> CornerPart:
    body = make_angle().edges("|Z").edges(cq.NearestToPointSelector((5, 5, 6))).fillet(2)
    return CornerPart(body.val(), body.edges(">Z").vals(), 1.0)


FEATURES: tuple[Maker, ...] = (
    feet_of_legs,
    feet_and_uprights_of_legs,
    all_of_a_table,
    feet_of_flush_legs,
    all_of_a_table_with_flush_legs,
    feet_of_a_tilted_tower,
    all_of_an_upright_tower,
    all_of_a_tilted_tower,
    all_of_a_boss_on_a_plate,
    all_of_a_boss_in_the_corner_of_a_plate,
    all_of_a_boss_at_the_side_of_a_plate,
    two_bosses_side_by_side,
    corner_of_a_room,
    all_of_a_room,
    all_of_a_notched_cube,
    all_of_crossing_bars,
    all_of_two_bars_of_two_heights,
    all_of_a_house,
    top_of_a_nut,
    all_of_a_nut,
    all_of_a_half_cylinder,
    all_of_a_sector,
    all_of_a_cone_sector,
    all_of_an_eighth_of_a_ball,
    all_of_a_lens_of_two_cylinders,
    all_of_a_plate_with_a_spline_outline,
    all_of_a_frustum,
    all_of_a_twisted_loft,
    all_of_a_smooth_loft,
    all_of_a_tapered_block,
    all_of_a_wedge,
    all_of_a_dovetail,
    all_of_a_tetrahedron,
    beside_one_native_fillet,
    beside_one_blend,
    rest_of_a_box_with_one_blend,
    uprights_below_a_native_rim,
    small_uprights_below_a_native_rim,
    small_corner_after_a_large_native_one,
    lower_rim_after_native_uprights_of_one_size,
    second_foot_beside_a_native_one,
)
HARD_FEATURES: tuple[Maker, ...] = (all_of_a_pyramid, all_of_an_octahedron, all_of_a_cross_gable)
"""Parts with vertices at which four edges meet, or eight."""
