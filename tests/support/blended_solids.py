"""Sound blends of many families, made by cqblend: what the corpus of faulty solids is made from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import cadquery as cq
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

import cqblend
from benchmarks import bodies


@dataclass(frozen=True)
class Replacement:
    """What ``check_solid`` is asked about: a solid before and after, and its new faces."""

    name: str
    before: TopoDS_Shape
    after: TopoDS_Shape
    new_faces: tuple[TopoDS_Face, ...]
    grows: bool | None
    tolerance: float = 1e-5


def blend(name: str, body: cq.Shape, edges: Sequence[cq.Edge], radius: float, **options) -> Replacement:
    """Blend edges of a body, by polynomials."""
    picked = [edge.wrapped for edge in edges]
    result = cqblend.blend_edges(body.wrapped, picked, radius, section="hermite", **options)
    grows = cq.Shape.cast(result.shape).Volume() > body.Volume()
    return Replacement(name, body.wrapped, result.shape, tuple(result.faces), grows)


def make_plate(count: int, pitch: float = 4.0) -> cq.Workplane:
    """A square plate with count x count holes of radius 1."""
    plate = cq.Workplane().box(count * pitch, count * pitch, 5).faces(">Z").workplane()
    return plate.rarray(pitch, pitch, count, count).hole(2.0)


def _draw(family: Callable[[bodies.Rng], bodies.Case], number: int) -> Replacement:
    case = bodies.draw(family, number)
    return blend(f"{case.name} {number}", case.body, [case.edge], case.radius)


def _blend_box(name: str, selector: str, count: int, **options) -> Replacement:
    part = cq.Workplane().box(20, 16, 12)
    edges = part.edges(selector).vals()
    assert len(edges) == count
    return blend(name, part.val(), edges, 2.0, **options)


def _blend_rims(name: str, count: int, which: slice) -> Replacement:
    plate = make_plate(count)
    return blend(name, plate.val(), plate.faces(">Z").edges("%CIRCLE").vals()[which], 0.3)


def _blend_spline_block() -> Replacement:
    """An edge of a block whose faces are all stored as splines."""
    block = cq.Shape.cast(BRepBuilderAPI_NurbsConvert(cq.Solid.makeBox(20, 16, 12).wrapped).Shape())
    outermost = max(block.Edges(), key=lambda edge: edge.Center().x + edge.Center().y)
    return blend("spline block", block, [outermost], 2.0)


@cache
def make_sound_blends() -> tuple[Replacement, ...]:
    """Return the sound blends."""
    rod = cq.Workplane().circle(6).extrude(15)
    step = cq.Workplane().box(20, 20, 5).faces(">Z").workplane().circle(5).extrude(6)
    return (
        _draw(bodies.box, 0),
        _draw(bodies.oblique_box, 0),
        _draw(bodies.angle_bracket, 1),
        _draw(bodies.loft, 0),
        _draw(bodies.freeform_top, 0),
        _draw(bodies.freeform_top, 1),
        _draw(bodies.cylinder_cap, 0),
        _draw(bodies.sphere_and_boss, 0),
        _draw(bodies.sphere_with_hole, 0),
        _draw(bodies.two_spheres, 0),
        _draw(bodies.box_with_round_end, 0),
        _draw(bodies.dome_and_boss, 0),
        _blend_box("box, flat ends", "|Z and >X and >Y", 1, ends="flat"),
        _blend_box("box, four edges", "|Z", 4),
        _blend_box("box, G2", "|Z and >X and >Y", 1, continuity="G2"),
        blend("rod", rod.val(), rod.faces(">Z").edges().vals(), 1.5),
        blend("step", step.val(), step.faces(">Z[1]").edges("%CIRCLE").vals(), 1.0),
        _blend_rims("plate, one rim", 5, slice(12, 13)),
        _blend_rims("plate, nine rims", 3, slice(None)),
        _blend_spline_block(),
    )
