"""Blended solids of all orders of continuity: both sides of every rail as OCCT's own surfaces have them.

A rail is an edge of the result between the blend and what is left of a face. Along it, gap, tangent plane, and second
and third derivatives of normal sections in five directions are compared at the parameters of both faces' own pcurves.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import product

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepCheck import BRepCheck_Analyzer
from spline_witness import angle, kernel_jet, meeting, normal

import cqblend
from cqblend.errors import DegreeError, GeometryError, InputError

SIZE = 20.0


def crossed_cylinders():
    upright = cq.Workplane().circle(8).extrude(30)
    return upright.union(cq.Workplane("YZ", origin=(0, 0, 15)).circle(5).extrude(20)).val()


def bent_wall():
    """A block of which one side is an extruded spline."""
    profile = cq.Workplane().moveTo(0, 0).spline([(6, 1.2), (12, -0.8), (20, 0.5)], includeCurrent=True)
    return profile.lineTo(20, 12).lineTo(0, 12).close().extrude(10).val()


def loft():
    """A body of which the side is a B-spline surface of high degree."""
    lower = cq.Workplane().ellipse(10, 7)
    return lower.workplane(offset=12).ellipse(6, 8).loft().val()


BODIES = {
    "planes": (lambda: cq.Workplane().box(20, 20, 20).val(), ("PLANE", "PLANE"), 3.0),
    "rim": (lambda: cq.Workplane().circle(10).extrude(12).val(), ("CYLINDER", "PLANE"), 2.0),
    "cone": (lambda: cq.Solid.makeCone(10, 6, 12), ("CONE", "PLANE"), 2.0),
    "cylinders": (crossed_cylinders, ("CYLINDER", "CYLINDER"), 1.5),
    "extruded spline": (bent_wall, ("EXTRUSION", "PLANE"), 1.5),
    "loft": (loft, ("BSPLINE", "PLANE"), 1.5),
}


@cache
def body(name):
    """Return a body and its longest edge between two faces of the given kinds."""
    make, kinds, _ = BODIES[name]
    solid = make()
    faces = solid.Faces()

    def around(edge):
        return tuple(sorted(face.geomType() for face in faces if any(edge.isSame(one) for one in face.Edges())))

    return solid, max((edge for edge in solid.Edges() if around(edge) == kinds), key=lambda edge: edge.Length())


def blended(name, **options):
    solid, edge = body(name)
    result = cqblend.blend_edges(solid, edge, BODIES[name][2], **{"form": "exact", **options})
    assert BRepCheck_Analyzer(result.shape.wrapped).IsValid()
    return result


def met(result, count=300):
    """Return gap, angle, jump of curvature and of its change, largest where each blend meets a face, for each pair.

    These are its rails, and the edge across which it goes on in another blend.
    """
    found = {}
    for (row, blend), (number, face) in product(enumerate(result.faces), enumerate(result.shape.Faces())):
        shared = [edge for edge in face.Edges() if any(edge.isSame(one) for one in blend.Edges())]
        for edge in [] if face.isSame(blend) else shared:
            t = np.linspace(*BRep_Tool.Range_s(edge.wrapped), count)[1:-1].tolist()
            jets = []
            for one in (blend, face):
                curve = BRep_Tool.CurveOnSurface_s(edge.wrapped, one.wrapped, 0.0, 0.0)
                jets.append(kernel_jet(BRep_Tool.Surface_s(one.wrapped), [curve.Value(x).Coord() for x in t]))
            if np.sin(angle(*(normal(jet) for jet in jets))).max() > 0.5:
                continue  # an end of the blend
            found.setdefault((row, number), []).append([float(x.max()) for x in meeting(*jets)])
    return [np.max(rows, axis=0) for rows in found.values()]


def order_of(row):
    """The continuity that a rail has: how many of its jumps, after the gap, are rounding."""
    gap, turn, bend, rate = row
    assert gap <= 1e-12 * SIZE
    smooth = [turn <= 1e-10, bend * SIZE <= 1e-8, rate * SIZE**2 <= 1e-5, False]
    return smooth.index(False)


EXACT = [name for name in BODIES if name != "loft"]


@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize("order", [1, 2, 3])
def test_both_rails_are_as_smooth_as_asked_and_no_smoother(name, order):
    result = blended(name, continuity=f"G{order}")
    assert [order_of(row) for row in met(result)] == [order, order]
    assert {rail.side for rail in result.certificate.rails} == {1, 2}
    assert (result.certificate.curvature_jump * SIZE <= 1e-8) == (order > 1)


@pytest.mark.parametrize("name", ["rim", "extruded spline"])
@pytest.mark.parametrize("orders", [(1, 2), (2, 1), (3, 1), (2, 3)])
def test_each_side_has_its_own_order(name, orders):
    result = blended(name, continuity=tuple(f"G{k}" for k in orders))
    assert sorted(order_of(row) for row in met(result)) == sorted(orders)
    assert result.certificate.degree[1] == sum(orders) + 1
    for rail, order in zip(result.certificate.rails, orders, strict=True):
        assert (rail.curvature_jump * SIZE <= 1e-8) == (order > 1)


@pytest.mark.parametrize("name", EXACT)
def test_an_edge_that_is_only_joined_gets_a_chamfer(name):
    """G0: the rails are met, the tangent planes are not."""
    result = blended(name, continuity="G0")
    assert result.certificate.degree[1] == 1
    assert result.certificate.angle > 0.1
    assert result.certificate.gap <= 1e-10


def test_the_plugin_takes_continuity_in_pairs():
    part = cq.Workplane().box(20, 20, 20).edges("|Z and >X and >Y").blend(3, continuity=("G2", "G1"))
    assert part.val().isValid()


@pytest.mark.parametrize("tangents", ["chord", ("chord", "perpendicular")])
@pytest.mark.parametrize("bulge", [(0.7, 1.3)])
def test_directions_and_bulges_leave_the_order_alone(tangents, bulge):
    result = blended("cylinders", continuity="G2", tangents=tangents, bulge=bulge)
    assert [order_of(row) for row in met(result)] == [2, 2]


@pytest.mark.parametrize("order", [1, 2])
def test_degrees_that_the_kernel_cannot_hold(order):
    with pytest.raises(DegreeError, match=r"edge 5: the exact blend has degree \d+ along the rail, OCCT holds 25"):
        blended("loft", continuity=f"G{order}")
    result = blended("loft", continuity=f"G{order}", form="auto")
    assert result.certificate.form == "compact"
    assert max(result.certificate.degree) <= 7
    for gap, turn, bend, _ in met(result, 1500):
        assert gap <= 2e-7
        assert turn <= 1e-5
        assert order == 1 or bend * BODIES["loft"][2] <= 1e-3


@pytest.mark.parametrize("continuity", ["G4", "g2", ("G1",), ("G1", "G2", "G1"), 2, ("G1", "C2")])
def test_continuities_that_there_are_not(continuity):
    with pytest.raises(InputError, match="continuity"):
        blended("planes", continuity=continuity)


def test_g2_on_the_rim_of_a_periodic_spline():
    """Both of its ends are crossed by the closed rail at one place: a piece of 6e-14 between them once spoiled it."""
    turn = [2 * math.pi * i / 48 for i in range(48)]
    case = cq.Workplane().spline([(35 * math.cos(a), 70 * math.sin(a)) for a in turn], periodic=True).close().extrude(8)
    result = cqblend.blend_edges(case, case.faces("<Z").edges(), 3, continuity="G2")
    assert result.shape.isValid()
    assert result.certificate.curvature_jump < 1e-4
    assert result.certificate.inner_crease < 1e-7


@pytest.mark.parametrize("continuity", ["G0", ("G0", "G1"), "G2"])
def test_edges_are_flagged_as_smooth_as_they_are(continuity):
    box = cq.Solid.makeBox(10, 10, 10)
    result = cqblend.blend_edges(box, box.edges("|Z and >X and >Y"), 2, continuity=continuity)
    assert cqblend.verify(result.shape, result.faces).ok


def test_what_folds_is_withheld():
    shape, edge = body("cylinders")
    with pytest.raises(GeometryError, match="the blend folds at t = "):
        cqblend.blend_edges(shape, edge, 1.5, tangents="parametric", form="exact")
