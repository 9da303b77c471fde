"""Boxes, trays, profiles and letters as people draw them, with edges that meet at corners, as they pick them.

Each is a body, a selection, and a radius for all or one for each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cadquery as cq


@dataclass(frozen=True)
class CornerPart:
    """A body with picked edges and a radius for all, or one for each."""

    body: cq.Shape
    edges: Sequence[cq.Edge]
    radius: float | Sequence[float]

    @property
    def radii(self) -> list[float]:
        """The radius of each edge."""
        return [self.radius] * len(self.edges) if isinstance(self.radius, (int, float)) else list(self.radius)


Maker = Callable[[], CornerPart]


def picked(body: cq.Workplane, selector: str, radius: float) -> CornerPart:
    """Pick edges by a selector of CadQuery's; an empty one picks all of them."""
    return CornerPart(body.val(), body.edges(selector or None).vals(), radius)


def at_height(body: cq.Workplane, z: float, within: float = math.inf) -> list[cq.Edge]:
    """List the edges that lie at a height, no farther out than a distance."""
    found = []
    for edge in body.val().Edges():
        box = edge.BoundingBox()
        level = max(abs(box.zmin - z), abs(box.zmax - z)) < 1e-5
        if level and max(-box.xmin, box.xmax, -box.ymin, box.ymax) < within:
            found.append(edge)
    return found


# -- boxes


def make_block() -> cq.Workplane:
    """Make the body of several parts."""
    return cq.Workplane().box(30, 20, 10, centered=(True, True, False))


def top_of_a_box() -> CornerPart:
    block = make_block()
    return CornerPart(block.val(), block.faces(">Z").edges().vals(), 2.0)


def all_of_a_box() -> CornerPart:
    return picked(make_block(), "", 1.0)


def one_corner_of_a_box() -> CornerPart:
    return picked(make_block(), "(>X and >Y) or (>X and >Z) or (>Y and >Z)", 3.0)


def one_corner_of_a_cube_half_its_side() -> CornerPart:
    return picked(cq.Workplane().box(10, 10, 10), "(>X and >Y) or (>X and >Z) or (>Y and >Z)", 5.0)


def all_of_a_cube_nearly_half_its_side() -> CornerPart:
    return picked(cq.Workplane().box(10, 10, 10), "", 4.99)


def two_that_meet() -> CornerPart:
    return picked(make_block(), "(>X and >Z) or (>Y and >Z)", 2.0)


def three_in_a_row() -> CornerPart:
    return picked(make_block(), "(>X and >Z) or (>Y and >Z) or (<X and >Z)", 2.0)


def zigzag() -> CornerPart:
    return picked(make_block(), "(>X and >Z) or (>X and >Y) or (>Y and <Z)", 2.0)


def all_but_the_bottom() -> CornerPart:
    return picked(make_block(), "not <Z", 1.5)


def large_uprights_small_rims() -> CornerPart:
    return _sized(lambda edge: 4.0 if abs(edge.tangentAt(0).z) > 0.5 else 1.0)


def small_uprights_large_rims() -> CornerPart:
    return _sized(lambda edge: 1.0 if abs(edge.tangentAt(0).z) > 0.5 else 2.0)


def one_size_for_each_direction() -> CornerPart:
    return _sized(lambda edge: 1.0 + abs(edge.tangentAt(0).y) + 2 * abs(edge.tangentAt(0).z))


def one_size_for_each_edge() -> CornerPart:
    block = make_block()
    edges = block.edges().vals()
    return CornerPart(block.val(), edges, [0.8 + 0.17 * n for n in range(len(edges))])


def top_of_a_box_of_two_sizes() -> CornerPart:
    block = make_block()
    edges = block.faces(">Z").edges().vals()
    return CornerPart(block.val(), edges, [2.0 if abs(edge.tangentAt(0).x) > 0.5 else 1.2 for edge in edges])


def _sized(size: Callable[[cq.Edge], float]) -> CornerPart:
    block = make_block()
    edges = block.edges().vals()
    return CornerPart(block.val(), edges, [size(edge) for edge in edges])


# -- shells and pockets


def _tray() -> cq.Workplane:
    return cq.Workplane().box(40, 30, 20, centered=(True, True, False)).faces("+Z").shell(-2, kind="intersection")


def all_of_a_shelled_box() -> CornerPart:
    return picked(_tray(), "", 0.5)


def rim_of_a_shelled_box() -> CornerPart:
    tray = _tray()
    return CornerPart(tray.val(), at_height(tray, 20), 0.8)


def outer_rim_of_a_shelled_box() -> CornerPart:
    tray = _tray()
    inner = at_height(tray, 20, within=19)
    return CornerPart(tray.val(), [e for e in at_height(tray, 20) if not any(e.isSame(i) for i in inner)], 1.2)


def inside_of_a_shelled_box() -> CornerPart:
    tray = _tray()
    inner = [e for e in tray.val().Edges() if max(abs(e.Center().x), 4 / 3 * abs(e.Center().y)) < 18.1]
    return CornerPart(tray.val(), [e for e in inner if e.Center().z > 0.1 and e.Center().z < 19.9], 3.0)


def outside_of_a_shelled_box() -> CornerPart:
    tray = _tray()
    bottom = at_height(tray, 0)
    uprights = [e for e in tray.edges("|Z").vals() if abs(e.Center().x) > 19]
    return CornerPart(tray.val(), [*bottom, *uprights], 3.0)


def shell_with_rounded_uprights() -> CornerPart:
    box = cq.Workplane().box(40, 30, 20, centered=(True, True, False)).edges("|Z").fillet(5)
    return picked(box.faces("+Z").shell(-2), "", 0.6)


def _pocket() -> cq.Workplane:
    return make_plate().faces(">Z").workplane().rect(24, 14).cutBlind(-5)


def make_plate() -> cq.Workplane:
    """Make the body of several parts."""
    return cq.Workplane().box(40, 30, 8, centered=(True, True, False))


def rim_of_a_pocket() -> CornerPart:
    pocket = _pocket()
    return CornerPart(pocket.val(), at_height(pocket, 8, within=14), 1.0)


def inside_of_a_pocket() -> CornerPart:
    pocket = _pocket()
    uprights = [e for e in pocket.edges("|Z").vals() if abs(e.Center().x) < 14]
    return CornerPart(pocket.val(), [*at_height(pocket, 3, within=14), *uprights], 1.5)


def floor_of_a_pocket() -> CornerPart:
    pocket = _pocket()
    return CornerPart(pocket.val(), at_height(pocket, 3, within=14), 1.5)


def all_of_a_plate_with_a_pocket() -> CornerPart:
    return picked(_pocket(), "", 0.7)


def slot_that_opens_at_a_side() -> CornerPart:
    return picked(make_plate().cut(cq.Workplane().box(20, 8, 10).translate((15, 0, 8))), "", 0.8)


# -- profiles, text, brackets


def make_angle() -> cq.Workplane:
    """Make the body of several parts."""
    return cq.Workplane().polyline([(0, 0), (24, 0), (24, 5), (5, 5), (5, 18), (0, 18)]).close().extrude(12)


def all_of_an_angle() -> CornerPart:
    return picked(make_angle(), "", 1.0)


def top_of_an_angle() -> CornerPart:
    return picked(make_angle(), ">Z", 1.0)


def all_of_a_channel() -> CornerPart:
    outline = [(0, 0), (20, 0), (20, 14), (16, 14), (16, 4), (4, 4), (4, 14), (0, 14)]
    return picked(cq.Workplane().polyline(outline).close().extrude(15), "", 1.0)


def all_of_a_beam() -> CornerPart:
    outline = [
        (0, 0),
        (16, 0),
        (16, 3),
        (9.5, 3),
        (9.5, 15),
        (16, 15),
        (16, 18),
        (0, 18),
        (0, 15),
        (6.5, 15),
        (6.5, 3),
        (0, 3),
    ]
    return picked(cq.Workplane().polyline(outline).close().extrude(30), "", 0.7)


def all_of_a_staircase() -> CornerPart:
    outline = [(0, 0), (24, 0), (24, 4), (16, 4), (16, 8), (8, 8), (8, 12), (0, 12)]
    return picked(cq.Workplane().polyline(outline).close().extrude(14), "", 0.9)


def _star() -> cq.Workplane:
    at = [(math.pi / 2 + n * math.pi / 5, 14 if n % 2 == 0 else 7) for n in range(10)]
    return cq.Workplane().polyline([(r * math.cos(a), r * math.sin(a)) for a, r in at]).close().extrude(6)


def top_of_a_star() -> CornerPart:
    return picked(_star(), ">Z", 0.8)


def all_of_a_star() -> CornerPart:
    return picked(_star(), "", 0.6)


def top_of_text() -> CornerPart:
    text = cq.Workplane().text("AEK", 22, 4, combine=False)
    return CornerPart(text.val(), text.faces(">Z").edges().vals(), 0.3)


def all_of_a_letter() -> CornerPart:
    return picked(cq.Workplane().text("T", 22, 4, combine=False), "", 0.4)


def all_of_a_curved_letter() -> CornerPart:
    return picked(cq.Workplane().text("R", 22, 4, combine=False), "", 0.3)


def _bracket() -> cq.Workplane:
    body = cq.Workplane().box(40, 30, 5, centered=(True, True, False))
    body = body.union(cq.Workplane().box(5, 30, 25, centered=(True, True, False)).translate((-17.5, 0, 5)))
    rib = cq.Workplane("XZ").polyline([(-15, 5), (5, 5), (-15, 25)]).close().extrude(2, both=True)
    return body.union(rib)


def all_of_a_bracket() -> CornerPart:
    return picked(_bracket(), "", 0.8)


def feet_of_a_rib() -> CornerPart:
    bracket = _bracket()
    feet = [e for e in bracket.val().Edges() if abs(abs(e.Center().y) - 2) < 1e-6 and min(e.Center().z - 5, 15) < 14]
    feet = [e for e in feet if abs(e.tangentAt(0).x * e.tangentAt(0).z) < 1e-6]
    return CornerPart(bracket.val(), feet, 1.5)


def bracket_with_holes() -> CornerPart:
    return picked(make_angle().faces("<Y").workplane(centerOption="CenterOfBoundBox").hole(5), "", 0.7)


PARTS: tuple[Maker, ...] = (
    top_of_a_box,
    all_of_a_box,
    one_corner_of_a_box,
    one_corner_of_a_cube_half_its_side,
    all_of_a_cube_nearly_half_its_side,
    two_that_meet,
    three_in_a_row,
    zigzag,
    all_but_the_bottom,
    large_uprights_small_rims,
    small_uprights_large_rims,
    one_size_for_each_direction,
    one_size_for_each_edge,
    top_of_a_box_of_two_sizes,
    all_of_a_shelled_box,
    rim_of_a_shelled_box,
    outer_rim_of_a_shelled_box,
    inside_of_a_shelled_box,
    outside_of_a_shelled_box,
    shell_with_rounded_uprights,
    rim_of_a_pocket,
    inside_of_a_pocket,
    floor_of_a_pocket,
    all_of_a_plate_with_a_pocket,
    slot_that_opens_at_a_side,
    all_of_an_angle,
    top_of_an_angle,
    all_of_a_channel,
    all_of_a_beam,
    all_of_a_staircase,
    top_of_a_star,
    all_of_a_star,
    top_of_text,
    all_of_a_letter,
    all_of_a_curved_letter,
    all_of_a_bracket,
    feet_of_a_rib,
    bracket_with_holes,
)
