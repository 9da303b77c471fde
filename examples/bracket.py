"""The same with build123d: a bracket whose inner corner is filled by a rolling ball, and whose outer one by a width."""

from build123d import Axis, Box, Cylinder, Pos

import cqblend

plate, wall = Box(40, 30, 6), Pos(-17, 0, 14) * Box(6, 30, 34)
bracket = (plate + wall - Pos(8, 0, 0) * Cylinder(5, 6)).solid()

inner = bracket.edges().filter_by(Axis.Y).sort_by_distance((-14, 0, 3))[0]
result = cqblend.blend_edges(bracket, inner, radius=4)
print(result.certificate)

outer = result.shape.edges().filter_by(Axis.Y).sort_by_distance((-20, 0, -3))[0]
result = cqblend.blend_edges(result.shape, outer, width=(8, 5))
print(result.certificate)

if "show_object" in globals():
    show_object(result.shape, name="bracket")  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
