"""Spines: stations at equal fractions of the arc length, head to tail along the first face's boundary."""

from __future__ import annotations

import math

import cadquery as cq
import numpy as np
import pytest
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.GCPnts import GCPnts_AbscissaPoint

from cqblend.brep.conversion.support_face import read_support_face
from cqblend.brep.selection.spine import EdgeSpine

V = cq.Vector


def length(edge: cq.Edge, first: float | None = None, last: float | None = None) -> float:
    curve = BRepAdaptor_Curve(edge.wrapped)
    a = curve.FirstParameter() if first is None else first
    b = curve.LastParameter() if last is None else last
    return GCPnts_AbscissaPoint.Length_s(curve, a, b, 1e-12)


EDGES = {
    "line": cq.Edge.makeLine(V(1, 2, 3), V(4, 6, 3)),
    "arc": cq.Edge.makeThreePointArc(V(5, 0, 0), V(0, 5, 0), V(-5, 0, 0)),
    "circle": cq.Edge.makeCircle(5),
    "ellipse": cq.Edge.makeEllipse(8, 5),
    "spline": cq.Edge.makeSpline([V(0, 0, 0), V(4, 3, 1), V(9, 1, 5), V(12, 8, 3)]),
}
every = pytest.mark.parametrize("edge", EDGES.values(), ids=EDGES.keys())


@every
@pytest.mark.parametrize("reverse", [False, True])
def test_points_lie_at_fractions_of_the_arc_length(edge, reverse):
    use = edge.wrapped.Reversed() if reverse else edge.wrapped
    spine = EdgeSpine([cq.Edge(use).wrapped], edge.IsClosed())
    assert spine.length == pytest.approx(length(edge), rel=1e-6)
    t = np.linspace(0, 1, 21)
    _, parameters = spine.locate_parameters(t)
    curve = BRepAdaptor_Curve(edge.wrapped)
    whole = length(edge)
    for fraction, parameter in zip(t.tolist(), parameters.tolist(), strict=True):
        gone = length(edge, curve.FirstParameter(), parameter)
        assert gone / whole == pytest.approx(1 - fraction if reverse else fraction, abs=1e-5)
    steps = np.diff(spine.evaluate_points(np.linspace(0, 1, 2001)), axis=0)
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(whole, rel=1e-5)


@pytest.mark.parametrize(("name", "turn"), [("arc", math.pi), ("circle", 2 * math.pi)])
def test_arcs_of_circles_know_their_angle(name, turn):
    edge = EDGES[name]
    assert EdgeSpine([edge.wrapped], edge.IsClosed()).measure_arc_angle() == pytest.approx(turn, abs=1e-6)


@pytest.mark.parametrize("name", ["line", "ellipse", "spline"])
def test_other_curves_are_no_arcs(name):
    edge = EDGES[name]
    assert EdgeSpine([edge.wrapped], edge.IsClosed()).measure_arc_angle() is None


# On a solid.


def prism() -> cq.Solid:
    """A prism whose top has an outline of two arcs and a line, the arcs one smooth joint with one curved side."""
    return (
        cq.Workplane().moveTo(8, 0).threePointArc((0, 8), (-8, 0)).lineTo(-8, -5).lineTo(8, -5).close().extrude(6).val()
    )


def top_of(body: cq.Shape) -> cq.Face:
    return max(body.Faces(), key=lambda face: face.Center().z)


def test_stations_past_the_ends_lie_on_the_tangents():
    body = prism()
    face = top_of(body)
    edge = next(e for e in face.Edges() if e.geomType() == "CIRCLE")
    side = next(f for f in edge.ancestors(body, "Face").Faces() if not f.isSame(face))
    spine = EdgeSpine([edge.wrapped], closed=False)
    points = spine.evaluate_points(np.linspace(0, 1, 33))
    sides = (read_support_face(face.wrapped, points), read_support_face(side.wrapped, points))
    t = np.array([-0.1, 0.0, 0.3, 1.0, 1.2])
    stations = spine.locate_stations(t, sides)
    past = np.array([-0.1, 0, 0, 0, 0.2]) * spine.length
    inside = spine.evaluate_points(np.clip(t, 0, 1))
    assert np.abs(stations.points - inside - stations.tangents * past[:, None]).max() < 1e-12
    assert np.abs(np.linalg.norm(stations.tangents, axis=1) - 1).max() < 1e-14
    h = 1e-5
    ahead = spine.evaluate_points(np.array([0.3 + h])) - spine.evaluate_points(np.array([0.3 - h]))
    assert np.abs(stations.tangents[2] - ahead[0] / np.linalg.norm(ahead)).max() < 1e-6
    for one, uv in zip(sides, stations.uv, strict=True):
        assert np.abs(one.primary.jet(uv[1:4])[0] - stations.points[1:4]).max() < 1e-7
