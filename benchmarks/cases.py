"""What is to be rounded: edges of real STEP parts, and fillets known to fail, beside the random families of bodies."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cadquery as cq
import numpy as np
from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape

from benchmarks.bodies import Case, Rng, draw
from benchmarks.real_edges import read_listed_edges


@dataclass(frozen=True)
class Trial:
    """Edges of a shape to be rounded in one go; ``freeform`` if one of them touches a B-spline face."""

    name: str
    shape: TopoDS_Shape
    edges: Sequence[TopoDS_Edge]
    radius: float
    freeform: bool = False


def draw_family(family: Callable[[Rng], Case], draws: int) -> Iterator[Trial]:
    """Yield the first draws of a random family."""
    for number in range(draws):
        case = draw(family, number)
        yield make_trial(f"{case.name} {number}", case.body, [case.edge], case.radius)


def real(folder: Path) -> Iterator[Trial]:
    """Yield the listed edges of real parts."""
    for listed in read_listed_edges(folder):
        yield Trial(listed.name, listed.shape, [listed.edge], listed.radius, listed.freeform)


def failing() -> Iterator[Trial]:
    """Yield fillets that OCCT fails on although they look easy."""
    work = (
        cq.Workplane("YZ")
        .cylinder(75, 40)
        .faces(">X")
        .workplane()
        .transformed(rotate=(-45, 0, 0))
        .split(keepBottom=True)
    )
    for radius in (1, 3, 4, 8):
        yield make_trial("F1 split cylinder", work.val(), work.edges("|Y").vals(), radius)
    work = cq.Workplane().box(50, 30, 10)
    for radius in (4.999999, 5):
        yield make_trial("F3 full round", work.val(), work.edges("|Y and >X").vals(), radius)
    for angle in (170, 174.28, 176, 179.9):
        height = 20 * math.tan(math.radians((180 - angle) / 2))
        outline = [(-20, 0), (0, height), (20, 0), (20, -10), (-20, -10)]
        roof = cq.Workplane().polyline(outline).close().extrude(10).val()
        ridge = min(roof.Edges(), key=lambda edge: (edge.Center() - cq.Vector(0, height, 5)).Length)
        yield make_trial(f"F5 roof {angle:g}", roof, [ridge], 5)
    pipes = cq.Solid.makeCylinder(10, 120, cq.Vector(0, 0, -60)).fuse(
        cq.Solid.makeCylinder(10, 120, cq.Vector(-60, 0, 0), cq.Vector(1, 0, 0))
    )
    crossing = [edge for edge in pipes.Edges() if edge.geomType() not in {"CIRCLE", "LINE"}]
    for radius in (1, 2, 4):
        yield make_trial("F6 equal cylinders", pipes, crossing, radius)
    turn = np.arange(16) * math.pi / 8
    oval = cq.Edge.makeSpline([cq.Vector(20 * math.cos(t), 10 * math.sin(t)) for t in turn], periodic=True)
    prism = cq.Solid.extrudeLinear(cq.Wire.assembleEdges([oval]), [], cq.Vector(0, 0, 10))
    rim = max(prism.Edges(), key=lambda edge: edge.Center().z)
    for radius in (3, 4):
        yield make_trial("F7 spline prism", prism, [rim], radius)
    wavy, rims = _wavy_block()
    for radius in (2, 5):
        yield make_trial("F8 wavy block", wavy, rims, radius)
        yield make_trial("F8 one edge", wavy, rims[:1], radius)


def _wavy_block() -> tuple[cq.Shape, list[cq.Edge]]:
    at = np.linspace(-25, 25, 41)
    rate = 2 * math.pi / 30
    points = [[cq.Vector(x, y, 3 * math.sin(rate * x) * math.cos(rate * y)) for y in at.tolist()] for x in at.tolist()]
    top = cq.Face.makeSplineApprox(points, tol=1e-3, minDeg=3, maxDeg=3)
    halves = cq.Solid.makeBox(40, 40, 40, cq.Vector(-20, -20, -20)).split(top).Solids()
    block = min(halves, key=lambda solid: solid.Center().z)
    return block, [edge for edge in block.Edges() if "BSPLINE" in _kinds(block, edge)]


def _kinds(body: cq.Shape, edge: cq.Edge) -> set[str]:
    return {face.geomType() for face in edge.ancestors(body, "Face").Faces()}


def make_trial(name: str, body: cq.Shape, edges: Sequence[cq.Edge], radius: float) -> Trial:
    """Return the trial of rounding edges of a body of CadQuery."""
    freeform = any("BSPLINE" in _kinds(body, edge) for edge in edges)
    return Trial(name, body.wrapped, [edge.wrapped for edge in edges], radius, freeform)
