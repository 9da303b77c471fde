"""Blends of chains by what is picked of them: one edge or all, in any order, of whole faces or split ones."""

from __future__ import annotations

import math

import cadquery as cq
import pytest
from OCP.ShapeUpgrade import ShapeUpgrade_ShapeDivideClosedEdges
from OCP.TopAbs import TopAbs_EDGE

import cqblend
from cqblend.brep.topology import ShapeIndex
from cqblend.errors import InputError, SizeError

W, V = cq.Workplane, cq.Vector


def rounded_box() -> cq.Shape:
    return W().box(30, 20, 10).edges("|Z").fillet(3).val()


def top_edges(body: cq.Shape) -> list[cq.Edge]:
    """The edges along the outline of the top, also of tops in parts, sorted around it."""
    level = max(vertex.Z for vertex in body.Vertices())
    flat = [edge for edge in body.Edges() if all(abs(v.Z - level) < 1e-6 for v in edge.Vertices())]
    border = [edge for edge in flat if any(abs(f.normalAt().z) < 0.5 for f in edge.ancestors(body, "Face").Faces())]
    return sorted(border, key=lambda edge: math.atan2(edge.Center().y, edge.Center().x))


def number(body: cq.Shape, edges: list[cq.Edge]) -> list[int]:
    index = ShapeIndex(body.wrapped, TopAbs_EDGE)
    return [index.find_number(edge.wrapped) for edge in edges]


def split(body: cq.Shape, *, at_x: float) -> cq.Shape:
    """Cut a body in two, and put it together again with the faces in parts."""
    half = cq.Solid.makeBox(200, 200, 200, V(at_x, -100, -100))
    return body.intersect(half).fuse(body.cut(half)).Solids()[0]


def measure_volume(result) -> float:
    verification = cqblend.verify(result.shape, result.faces)
    assert verification.ok
    return verification.volume


def removed_from_box(radius: float) -> float:
    """What the blend of a ball of this radius takes from the top of the rounded box, of arcs for sections."""
    area, centroid = (1 - math.pi / 4) * radius**2, (1 - 2 / (3 * (4 - math.pi))) * radius
    return area * (2 * (24 + 14) + 2 * math.pi * (3 - centroid))  # by Pappus's theorem


@pytest.mark.parametrize("radius", [1.0, 2.5])
def test_one_edge_of_the_top_of_a_rounded_box_stands_for_all(radius):
    body = rounded_box()
    edges = top_edges(body)
    assert len(edges) == 8
    volumes = []
    for picked in ([edges[0]], [edges[3]], [edges[5], edges[2]], edges, [*edges[::-1], edges[4]]):
        result = cqblend.blend_edges(body, picked, radius)
        assert sorted(result.certificate.blended) == sorted(number(body, edges))
        assert result.certificate.coverage == 1
        assert result.certificate.ends == ()
        assert len(result.faces) == 8
        volumes.append(measure_volume(result))
    assert max(volumes) - min(volumes) < 1e-9 * volumes[0]
    removed = cqblend.verify(body).volume - volumes[0]
    assert removed == pytest.approx(removed_from_box(radius), rel=2e-3)


def test_oblique_chains_do_not_depend_on_the_pick():
    """Cells of splines, with kinks that are rounded: which of two cells gives way does not depend on the pick."""
    shear = cq.Matrix([[1, 0, 0.3, 0], [0, 1, 0.1, 0], [0, 0, 1, 0]])
    body = rounded_box().transformGeometry(shear)
    edges = top_edges(body)
    results = [cqblend.blend_edges(body, edge, 0.5) for edge in (edges[0], edges[3])]
    areas = [sorted(face.Area() for face in result.faces) for result in results]
    assert areas[0] == pytest.approx(areas[1], rel=1e-6)


@pytest.mark.parametrize("at_x", [0.0, 12.0, 13.5])
@pytest.mark.parametrize("count", [1, None])
def test_chains_of_split_faces_are_those_of_whole_ones(at_x, count):
    """Cut through straight cells, at the smooth edges between cells, and through the rounded corners."""
    body = split(rounded_box(), at_x=at_x)
    edges = top_edges(body)
    result = cqblend.blend_edges(body, edges[:count], 2)
    assert len(result.faces) == 8
    assert "taken as one" in result.certificate.method
    assert sorted(result.certificate.blended) == sorted(number(body, edges))
    whole = rounded_box()
    expected = measure_volume(cqblend.blend_edges(whole, top_edges(whole), 2))
    assert measure_volume(result) == pytest.approx(expected, rel=1e-12)


def test_faces_with_an_apex_stay_in_parts_and_are_cells():
    """A drill tip of two half cones, which OCCT does not survive to unite, under two half cylinders."""
    outline = [(0, -20), (8, -20), (8, -5), (0, 0)]
    half = W("XZ").polyline(outline).close().revolve(180, (0, 0, 0), (0, 1, 0)).val()
    body = half.fuse(half.rotate(V(), V(0, 0, 1), 180))
    rims = [edge for edge in body.Edges() if edge.geomType() == "CIRCLE" and abs(edge.Center().z + 5) < 1e-6]
    result = cqblend.blend_edges(body, rims[0], 1)
    assert sorted(result.certificate.blended) == sorted(number(body, rims))
    assert len(result.faces) == 2
    whole = W("XZ").polyline(outline).close().revolve(360, (0, 0, 0), (0, 1, 0))
    expected = cqblend.blend_edges(whole, whole.edges("%CIRCLE and (not <Z)"), 1)
    assert measure_volume(result) == pytest.approx(measure_volume(expected), rel=1e-8)


def test_just_what_is_picked():
    body = rounded_box()
    edges = top_edges(body)
    for picked in (edges[1:2], edges[1:4]):
        result = cqblend.blend_edges(body, picked, 1, chain=False, ends="flat")
        assert sorted(result.certificate.blended) == sorted(number(body, picked))
        assert len(result.faces) == len(picked)
        assert [end.kind for end in result.certificate.ends] == ["flat", "flat"]
        assert cqblend.verify(result.shape, result.faces).ok


def test_a_ring_in_pieces_is_followed_only_if_asked_to():
    """The foot of a boss in two arcs, at whose vertices only the two faces meet."""
    body = cq.Solid.makeCylinder(8, 3).fuse(cq.Solid.makeCylinder(4, 9)).Solids()[0]
    divide = ShapeUpgrade_ShapeDivideClosedEdges(body.wrapped)
    divide.Perform()
    cut = cq.Shape.cast(divide.Result()).Solids()[0]
    arcs = [e for e in cut.Edges() if e.geomType() == "CIRCLE" and e.radius() == 4 and abs(e.Center().z - 3) < 1e-6]
    assert len(arcs) == 2
    for picked, chain in ((arcs[:1], True), (arcs, True), (arcs, False)):
        result = cqblend.blend_edges(cut, picked, 1, chain=chain)
        assert sorted(result.certificate.blended) == sorted(number(cut, arcs))
        assert result.certificate.ends == ()
        assert len(result.faces) == 1
    half = cqblend.blend_edges(cut, arcs[0], 1, chain=False, ends="flat")
    assert half.certificate.blended == tuple(number(cut, arcs[:1]))
    assert [end.kind for end in half.certificate.ends] == ["flat", "flat"]
    assert 0.9 < half.certificate.coverage <= 1


def test_ends_of_a_chain_run_as_the_lowest_picked_edge_does():
    body = W().moveTo(0, -6).lineTo(10, -6).threePointArc((16, 0), (10, 6)).lineTo(0, 6).close().extrude(7).val()
    edges = [edge for edge in top_edges(body) if edge.Center().x > 1]
    assert len(edges) == 3
    lowest = min(edges, key=lambda edge: body.Edges().index(edge))
    for picked in (lowest, cq.Edge(lowest.wrapped.Reversed())):
        others = [edge for edge in edges if edge is not lowest]
        result = cqblend.blend_edges(body, [*others, picked], 1, ends=("natural", "flat"))
        (natural,) = (end.vertex for end in result.certificate.ends if end.kind == "natural")
        (flat,) = (end.vertex for end in result.certificate.ends if end.kind == "flat")
        start, stop = (body.Vertices()[one - 1].Center() for one in (natural, flat))
        chord = picked.endPoint() - picked.startPoint()  # the outline runs along x, y and -x
        sense = chord.y if lowest.geomType() == "CIRCLE" else -chord.x * lowest.Center().y
        assert (stop - start).y * sense > 0


def test_the_first_face_is_side_1_all_along():
    body = rounded_box()
    edges = top_edges(body)
    top = W(body).faces(">Z").val()
    for first in (top, next(face for face in edges[0].ancestors(body, "Face").Faces() if not face.isSame(top))):
        result = cqblend.blend_edges(body, edges[::3], width=(1, 2), first=first)
        sides = {rail.side for rail in result.certificate.rails if rail.face == body.Faces().index(top) + 1}
        assert sides == {1 if first is top else 2}


def test_a_chain_that_fails_is_left_out_whole():
    plate = W().box(60, 30, 6).edges("|Z").fillet(3).faces(">Z").workplane().hole(10)
    rim = next(edge for edge in plate.edges("%CIRCLE").vals() if edge.radius() == 5 and edge.Center().z > 0)
    outline = min(plate.faces(">Z").edges().vals(), key=lambda edge: edge.Center().y)
    with pytest.raises(SizeError):
        cqblend.blend_edges(plate, [rim, outline], 4)
    result = cqblend.blend_edges(plate, [rim, outline], 4, on_error="skip")
    assert result.certificate.blended == (plate.val().Edges().index(rim) + 1,)
    assert result.skipped[0].edges == (plate.val().Edges().index(outline) + 1,)
    lengths = [edge.Length() for edge in plate.faces(">Z").edges().vals()]
    assert result.certificate.coverage == pytest.approx(rim.Length() / sum(lengths), rel=1e-6)


def test_the_largest_size_is_that_of_the_chain():
    body = W(rounded_box())
    edge = body.edges(">Z and >Y")
    assert cqblend.max_size(body, edge, tolerance=0.01) == pytest.approx(3, rel=0.02)
    assert cqblend.max_size(body, edge, tolerance=0.01, chain=False, ends="flat") > 4


def test_the_fluent_method_follows_chains_too():
    part = W(rounded_box()).edges(">Z and >Y")
    counts: list[int] = []
    part.blend(1, report=lambda result: counts.append(len(result.faces)))
    part.blend(1, chain=False, ends="flat", report=lambda result: counts.append(len(result.faces)))
    assert counts == [8, 1]


def test_build123d_edges_stand_for_their_chains_too():
    build123d = pytest.importorskip("build123d")
    box = build123d.fillet(build123d.Box(30, 20, 10).edges().filter_by(build123d.Axis.Z), 3)
    edge = box.edges().sort_by(build123d.Axis.Z)[-1]
    assert len(cqblend.blend_edges(box, edge, 1).faces) == 8
    assert len(cqblend.blend_edges(box, edge, 1, chain=False, ends="flat").faces) == 1


def test_chain_is_yes_or_no():
    box = W().box(3, 2, 1)
    with pytest.raises(InputError, match="chain must be"):
        cqblend.blend_edges(box, box.edges("|Z"), 0.1, chain="all")


def test_errors_about_edges_that_were_not_picked_say_so():
    body = rounded_box()
    straight = next(edge for edge in top_edges(body) if edge.geomType() == "LINE")
    with pytest.raises(SizeError, match=r"it continues edge \d+: chain=False") as caught:
        cqblend.blend_edges(body, straight, 5)
    assert caught.value.shape != f"edge {number(body, [straight])[0]}"
    with pytest.raises(SizeError) as caught:
        cqblend.blend_edges(body, top_edges(body), 5)
    assert "chain=False" not in str(caught.value)


def test_a_chain_ends_before_an_edge_that_is_too_small_for_it():
    box = cq.Workplane().box(30, 20, 10)
    rounded = cq.Workplane(obj=cqblend.blend_edges(box, box.edges(">Z and >X"), 1.5).shape)
    upright = rounded.edges("|Z and >X and >Y")  # goes on round the end of that blend, an arc of 1.5 mm
    result = cqblend.blend_edges(rounded, upright, 4)
    alone = cqblend.blend_edges(rounded, upright, 4, chain=False)
    assert len(result.faces) == len(result.certificate.blended) == 1
    assert [end.kind for end in result.certificate.ends] == ["natural", "natural"]
    assert result.shape.Volume() == pytest.approx(alone.shape.Volume(), rel=1e-12)
    assert cqblend.verify(result.shape).ok
    small = cqblend.blend_edges(rounded, upright, 1)
    assert len(small.certificate.blended) > 1
    assert set(result.certificate.blended) < set(small.certificate.blended)
