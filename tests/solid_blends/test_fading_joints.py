"""Joints whose faces become tangent to each other at an end of the edge: the blend runs out in a point there."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest

import cqblend


def make_twisted_step(slope: float) -> cq.Solid:
    """A block whose top is z = 0 on the left and z = slope x y on the right, so that they meet at atan(slope y)."""
    x0, x1, y0, y1, z0 = -10.0, 10.0, 0.0, 20.0, -8.0

    def point(x, y):
        return cq.Vector(x, y, slope * max(x, 0.0) * y)

    def line(a, b):
        return cq.Edge.makeLine(a, b)

    def flat(*points):
        return cq.Face.makeFromWires(cq.Wire.makePolygon([*points, points[0]]))

    def low(x, y):
        return cq.Vector(x, y, z0)

    left = flat(point(x0, y0), point(0, y0), point(0, y1), point(x0, y1))
    right = cq.Face.makeRuledSurface(line(point(0, y0), point(0, y1)), line(point(x1, y0), point(x1, y1)))
    front = flat(low(x0, y0), low(x1, y0), point(x1, y0), point(0, y0), point(x0, y0))
    back = flat(low(x0, y1), low(x1, y1), point(x1, y1), point(0, y1), point(x0, y1))
    sides = [
        flat(low(x0, y0), point(x0, y0), point(x0, y1), low(x0, y1)),
        flat(low(x1, y0), point(x1, y0), point(x1, y1), low(x1, y1)),
        flat(low(x0, y0), low(x1, y0), low(x1, y1), low(x0, y1)),
    ]
    shell = cq.Shell.makeShell([left, right, front, back, *sides])
    return cq.Solid.makeSolid(shell).fix()


def find_ridge(body: cq.Solid) -> cq.Edge:
    (edge,) = (
        edge for edge in body.Edges() if edge.Length() == pytest.approx(20) and edge.Center().toTuple()[::2] == (0, 0)
    )
    return edge


@pytest.mark.parametrize("slope", [0.05, -0.04, 0.01])
@pytest.mark.parametrize("options", [{}, {"continuity": "G2"}, {"form": "exact"}], ids=str)
def test_a_blend_runs_out_where_its_joint_fades(slope, options):
    body = make_twisted_step(slope)
    assert body.isValid()
    result = cqblend.blend_edges(body, find_ridge(body), 6.0, **options)
    assert result.shape.isValid()
    assert cqblend.verify(result.shape).ok
    assert sorted(end.kind for end in result.certificate.ends) == ["natural", "point"]
    limit = 1e-9 if result.certificate.form == "exact" else 1e-5
    assert result.certificate.angle < limit
    # nothing of the edge is left
    middle = np.array(find_ridge(body).Center().toTuple())
    assert all(edge.distance(cq.Vertex.makeVertex(*middle)) > 1e-4 for edge in result.shape.Edges())


def test_rails_end_in_the_vertex():
    body = make_twisted_step(0.05)
    (face,) = cqblend.blend_edges(body, find_ridge(body), 6.0).faces
    corner = cq.Vertex.makeVertex(0, 0, 0)
    touching = [edge for edge in face.Edges() if edge.distance(corner) < 1e-9]
    assert len([edge for edge in touching if edge.Length() > 1]) == 2
