"""Edges as curves in the parameters of to_surface, against OCCT's evaluation of the face along its own pcurve."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
from OCP.Geom2d import Geom2d_Circle, Geom2d_OffsetCurve
from OCP.Geom2dAPI import Geom2dAPI_ProjectPointOnCurve
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Ax2d, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED
from OCP.TopoDS import TopoDS

from cqblend.blends.rails.rail import Rail
from cqblend.brep.conversion.pcurves import edge_to_curve, project_to_parameters, read_edge_pcurve
from cqblend.brep.conversion.spline_conversion import to_face, to_surface, to_surface_with_map
from cqblend.brep.topology import explore_subshapes
from cqblend.errors import GeometryError, InputError, SelectionError, UnsupportedError
from cqblend.splines import Curve, Surface

SPAN = np.linspace(0, 1, 201)
V = cq.Vector


def bodies() -> dict[str, cq.Shape]:
    def drill(radius, x, y):
        return cq.Workplane().cylinder(40, radius).translate((x, y, 0))

    slab = cq.Workplane().box(30, 30, 3).rotate((0, 0, 0), (1, 0.3, 0), 30).translate((0, 0, 4))
    profile = (
        cq.Workplane("XZ").moveTo(0, 0).lineTo(6, 0).spline([(6, 0), (8, 4), (5, 9), (6, 12)], includeCurrent=False)
    )
    vase = profile.lineTo(0, 12).close().revolve(360, (0, 0), (0, 1))
    made = {
        "box": cq.Workplane().box(3, 4, 5),
        "cylinder": cq.Workplane().cylinder(10, 4),
        "ball": cq.Workplane().sphere(6),
        "torus": cq.Workplane(obj=cq.Solid.makeTorus(9, 3)),
        "drilled ball": cq.Workplane().sphere(6).cut(drill(2, 2, 1)),
        "sliced cone": cq.Workplane(obj=cq.Solid.makeCone(5, 2, 7)).cut(slab),
        "sliced torus": cq.Workplane(obj=cq.Solid.makeTorus(9, 3)).cut(slab),
        "drilled vase": vase.cut(cq.Workplane("YZ").cylinder(40, 2).translate((0, 1, 6))),
        "tube": cq.Workplane().spline([(9, 0), (0, 6), (-9, 0), (0, -6)], periodic=True).close().extrude(8).cut(slab),
    }
    place = cq.Location(V(1, 2, 3), V(1, 1, 0), 40)
    return {name: body.val().moved(place) for name, body in made.items()}


BODIES = bodies()


def uses(body):
    return [
        (face.wrapped, edge) for face in BODIES[body].Faces() for edge in explore_subshapes(face.wrapped, TopAbs_EDGE)
    ]


def kernel_run(face, edge):
    """OCCT's points of the face along an edge's pcurve, as the edge runs."""
    pcurve, (first, last) = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0), BRep_Tool.Range_s(edge, face)
    surface = BRep_Tool.Surface_s(face)
    t = first + (last - first) * (SPAN[::-1] if edge.Orientation() == TopAbs_REVERSED else SPAN)
    uv = [pcurve.Value(x).Coord() for x in t.tolist()]
    return np.array(uv), np.array([surface.Value(*x).Coord() for x in uv])


def along(surface, curve):
    t = curve.domain[0] + (curve.domain[1] - curve.domain[0]) * SPAN
    return surface(*curve(t).T)


@pytest.mark.parametrize("body", BODIES)
def test_pcurves_run_as_the_kernel_says(body):
    for face, edge in uses(body):
        surface, curve = to_surface(face), read_edge_pcurve(face, edge)
        uv, points = kernel_run(face, edge)
        found = along(surface, curve)
        size = np.abs(surface.bounds()).max()
        assert curve.domain == pytest.approx(BRep_Tool.Range_s(edge, face), abs=1e-12)
        assert np.abs(found[[0, -1]] - points[[0, -1]]).max() < 1e-13 * size
        straight = np.ptp(uv, axis=0) < 1e-14
        if straight.any():  # at another speed where the parameter is an angle
            assert curve.degree == 1
            fixed = to_surface_with_map(face)[1].to_spline(uv[:1])[:, straight]
            assert np.abs(curve(np.array(curve.domain))[:, straight] - fixed).max() < 1e-14 * size
        elif curve.rational:  # a conic, in a plane, at another speed
            pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
            t = curve.domain[0] + np.ptp(curve.domain) * SPAN
            feet = [Geom2dAPI_ProjectPointOnCurve(gp_Pnt2d(*x), pcurve).LowerDistance() for x in curve(t).tolist()]
            assert max(feet) < 1e-13 * size
        else:
            assert np.abs(found - points).max() < 1e-11 * size


def test_seams_are_told_apart_by_orientation():
    face = next(face.wrapped for face in BODIES["cylinder"].Faces() if face.geomType() == "CYLINDER")
    seams = [edge for edge in explore_subshapes(face, TopAbs_EDGE) if BRep_Tool.IsClosed_s(edge, face)]
    (u0, u1), _ = to_surface(face).domain
    sides = {edge.Orientation(): read_edge_pcurve(face, edge) for edge in seams}
    assert sorted(curve(curve.domain[0])[0] for curve in sides.values()) == pytest.approx([u0, u1], abs=1e-14)
    up, down = (curve(np.array(curve.domain))[:, 1] for curve in sides.values())
    assert up == pytest.approx(down[::-1], abs=1e-14)


def test_reversed_edges_run_backwards():
    for face, edge in uses("drilled vase"):
        there, back = read_edge_pcurve(face, edge), read_edge_pcurve(face, TopoDS.Edge_s(edge.Reversed()))
        if not BRep_Tool.IsClosed_s(edge, face):
            a, b = there.domain
            t = a + (b - a) * SPAN
            assert np.abs(there(t) - back(t[::-1])).max() < 1e-12
        if not BRep_Tool.Degenerated_s(edge):
            ends = edge_to_curve(edge)
            assert np.abs(ends(np.array(ends.domain)) - along(to_surface(face), there)[[0, -1]]).max() < 1e-6


def test_an_offset_pcurve_and_a_foreign_edge_are_refused():
    face = uses("box")[0][0]
    with pytest.raises(SelectionError, match="not one of the face's"):
        read_edge_pcurve(face, uses("cylinder")[0][1])
    surface = BRep_Tool.Surface_s(face)
    circle = Geom2d_Circle(gp_Ax2d(gp_Pnt2d(0, 0), gp_Dir2d(1, 0)), 1.0)
    made = BRepBuilderAPI_MakeEdge(Geom2d_OffsetCurve(circle, 0.25), surface, 0.1, 2.0).Edge()
    disc = BRepBuilderAPI_MakeFace(surface, BRepBuilderAPI_MakeWire(made).Wire(), False).Face()
    with pytest.raises(UnsupportedError, match="offset curve"):
        read_edge_pcurve(disc, made)
    poles = [edge for _, edge in uses("ball") if BRep_Tool.Degenerated_s(edge)]
    with pytest.raises(SelectionError, match="degenerate"):
        edge_to_curve(poles[0])


def test_a_pcurve_is_a_rail():
    face = next(face.wrapped for face in BODIES["drilled vase"].Faces() if face.geomType() == "CYLINDER")
    for edge in explore_subshapes(face, TopAbs_EDGE):
        rail = Rail(to_surface(face), read_edge_pcurve(face, edge), "left")
        assert np.linalg.norm(rail.field("parametric")(np.array(rail.domain)), axis=-1).min() > 0


def wavy(rational=False, knots_u=(0.2, 0.4, 0.6)):
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.linspace(0, 10, 7), np.linspace(0, 10, 6), indexing="ij")
    poles = np.stack([x, y, np.sin(x / 2) * np.cos(y / 3)], -1) + rng.uniform(-0.2, 0.2, (7, 6, 3))
    knots = (np.r_[[0] * 4, knots_u, [1] * 4], np.r_[[0] * 4, 0.3, 0.7, [1] * 4])
    return Surface.from_bspline((3, 3), knots, poles, rng.uniform(0.7, 1.4, (7, 6)) if rational else None)


def nearest(surface, points):
    """OCCT's foot points of points on a surface."""
    kernel = BRep_Tool.Surface_s(to_face(surface))
    return np.array([GeomAPI_ProjectPointOnSurf(gp_Pnt(*x), kernel).NearestPoint().Coord() for x in points.tolist()])


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("tolerance", [1e-5, 1e-9])
def test_projection_meets_the_kernels(rational, tolerance):
    surface = wavy(rational)
    arc = Curve.bezier([[1.5, 2, 2], [5, 9, 0], [7, 2, 1], [8.5, 7, 0]])
    curve = project_to_parameters(surface, arc, tolerance)
    assert curve.domain == arc.domain
    error = np.linalg.norm(along(surface, curve) - nearest(surface, arc(SPAN)), axis=1)
    assert error.max() < 1.5 * tolerance + 1e-9  # OCCT's own feet are good to about 1e-10
    assert len(curve.breaks) < 6 * tolerance**-0.25


def test_projection_of_a_curve_on_the_surface_gives_back_its_parameters():
    surface = wavy(True)
    path = Curve.bezier([[0.1, 0.2], [0.5, 0.9], [0.7, 0.1], [0.9, 0.8]])
    curve = project_to_parameters(surface, surface.compose(path), 1e-10)
    assert np.abs(curve(SPAN) - path(SPAN)).max() < 1e-10


def test_projection_of_edges():
    """The hole in a sphere, and straight edges, which stay straight; also along a seam, on either side of it."""
    for face, edge in uses("drilled vase") + uses("cylinder"):
        if cq.Face(face).geomType() != "CYLINDER":
            continue
        surface, curve = to_surface(face), project_to_parameters(to_surface(face), edge)
        space = edge_to_curve(edge)
        t = space.domain[0] + np.ptp(space.domain) * SPAN
        assert np.abs(along(surface, curve) - space(t)).max() < 3e-7  # the edges' own tolerance is 1e-7
        if cq.Edge(edge).geomType() in ("LINE", "CIRCLE"):
            assert curve.degree <= 3
            assert np.ptp(curve(t), axis=0).min() < 1e-9


def test_a_closed_projection_is_periodic():
    surface = wavy()
    ring = edge_to_curve(cq.Edge.makeCircle(2.5, V(5, 5, 2)).wrapped)
    curve = project_to_parameters(surface, ring, 1e-7)
    first, last = curve.jet(np.array(curve.domain), 2).swapaxes(0, 1)
    assert (first[0] == last[0]).all()
    assert np.abs(last[1] - first[1]).max() < 1e-11
    assert np.abs(last[2] - first[2]).max() < 1e-6  # rounding over the square of a step of 1e-3
    assert Rail(surface, curve).closed


def test_bad_projections_are_refused_by_parameter():
    surface = wavy()
    with pytest.raises(GeometryError, match=r"at t = 0\.\d+, .* has no foot on the surface inside"):
        project_to_parameters(surface, Curve.bezier([[5.0, 5, 2], [15, 5, 2]]))
    with pytest.raises(GeometryError, match=r"at t = 0\.\d+, where they have a kink"):
        project_to_parameters(surface, Curve.from_bspline(1, [0, 0, 0.5, 1, 1], [[2.0, 2, 1], [5, 8, 1], [8, 2, 1]]))
    with pytest.raises(GeometryError, match="off the surface where that is only C1"):
        project_to_parameters(wavy(knots_u=(0.3, 0.6, 0.6)), Curve.bezier([[1.5, 2, 4], [8.5, 7, 3]]), 1e-9)
    cylinder = next(to_surface(f) for f, _ in uses("cylinder") if cq.Face(f).geomType() == "CYLINDER")
    middle, across = cylinder(np.array([-0.5, 0.5]) % (2 * np.pi), 1.0)
    with pytest.raises(GeometryError, match=r"jump, from .* at t = "):
        project_to_parameters(cylinder, Curve.bezier([middle, across]))
    for arguments in (
        (surface, Curve.bezier([[0.1, 0.1], [0.9, 0.9]])),
        (surface, Curve.bezier([[1.0, 1, 1]] * 2), 0.0),
    ):
        with pytest.raises(InputError):
            project_to_parameters(*arguments)
