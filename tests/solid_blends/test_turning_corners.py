"""Corners of three blended edges, of which one is blended first: the others go on in a cell around its end.

Where all have one radius the ball stands still there, however oblique the faces are to each other.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import cadquery as cq
import numpy as np
import pytest

import cqblend

RADIUS = 1.0


def make_tetrahedron() -> cq.Solid:
    corners = [cq.Vector(*point) for point in ((0, 0, 0), (20, 0, 0), (6, 17, 0), (8, 6, 15))]
    faces = [
        cq.Face.makeFromWires(cq.Wire.makePolygon([corners[k] for k in loop], close=True))
        for loop in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
    ]
    return cq.Solid.makeSolid(cq.Shell.makeShell(faces))


def make_tilted_box() -> cq.Shape:
    above = cq.Workplane().box(60, 60, 20).rotate((0, 0, 0), (1, 0, 0), 15).translate((0, 0, 14))
    return cq.Workplane().box(20, 14, 20).cut(above).val()


BODIES = {
    "tetrahedron": make_tetrahedron,
    "wedge": lambda: cq.Solid.makeWedge(20, 15, 12, 5, 4, 14, 9),
    "tilted box": make_tilted_box,
    "tapered prism": lambda: cq.Workplane().polygon(5, 20).extrude(10, taper=12).val(),
}


def choose_first_edges(body: cq.Shape) -> list[cq.Edge]:
    """Return edges without common vertices, one at each vertex: those that stand up most steeply, or opposite ones."""
    first: list[cq.Edge] = []
    for edge in sorted(body.Edges(), key=lambda edge: -abs(edge.tangentAt(0.5).z)):
        if not any(one.isSame(other) for near in first for one in near.Vertices() for other in edge.Vertices()):
            first.append(edge)
    return first


def find_rest(body: cq.Shape, edges: Sequence[cq.Edge]) -> list[cq.Edge]:
    """Return the edges of a body that lie on some straight ones, in part."""
    found = []
    for edge in edges:
        middle = cq.Vertex.makeVertex(*edge.positionAt(0.5).toTuple())
        found.append(next(one for one in body.Edges() if one.geomType() == "LINE" and one.distance(middle) < 1e-9))
    return found


def blend_all_edges(body: cq.Shape, radius: float, **options: object) -> tuple[cq.Shape, cqblend.BlendResult]:
    first = choose_first_edges(body)
    rest = [edge for edge in body.Edges() if not any(edge.isSame(one) for one in first)]
    rounded = cqblend.blend_edges(body, first, radius).shape
    result = cqblend.blend_edges(rounded, find_rest(rounded, rest), radius, **options)
    return result.shape, result


def measure_swept_volume(body: cq.Shape, radius: float) -> float:
    """Return the volume that a ball sweeps inside of a convex polyhedron, by Steiner's formula.

    The polyhedron of the ball's centres has the faces moved inwards by the radius; at its edges and corners the body is
    made of sectors of cylinders and spheres.
    """
    planes = [
        (np.array(f.normalAt().toTuple()), np.array(f.Center().toTuple()) @ f.normalAt().toTuple())
        for f in body.Faces()
    ]
    corners: dict[tuple[int, ...], np.ndarray] = {}
    for vertex in body.Vertices():
        point = np.array(vertex.toTuple())
        at = tuple(k for k, (normal, offset) in enumerate(planes) if abs(normal @ point - offset) < 1e-9)
        normals = np.stack([planes[k][0] for k in at])
        corners[at] = np.linalg.solve(normals, [planes[k][1] - radius for k in at])
    volume = area = bend = 0.0
    for k, (normal, offset) in enumerate(planes):
        points = np.stack([point for at, point in corners.items() if k in at])
        middle = points.mean(axis=0)
        x = points[0] - middle
        x /= np.linalg.norm(x)
        y = np.cross(normal, x)
        points = points[np.argsort(np.arctan2((points - middle) @ y, (points - middle) @ x))]
        loop = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0) @ normal / 2
        area += loop
        volume += loop * (offset - radius) / 3
    for edge in body.Edges():
        middle = np.array(edge.Center().toTuple())
        first, second = (k for k, (normal, offset) in enumerate(planes) if abs(normal @ middle - offset) < 1e-9)
        one, other = (point for at, point in corners.items() if first in at and second in at)
        bend += np.linalg.norm(one - other) * np.arccos(planes[first][0] @ planes[second][0])
    return volume + area * radius + bend * radius**2 / 2 + 4 / 3 * np.pi * radius**3


@pytest.mark.parametrize("name", BODIES)
def test_a_ball_of_one_radius_leaves_pieces_of_spheres_at_oblique_corners(name):
    body = BODIES[name]()
    shape, result = blend_all_edges(body, RADIUS)
    assert shape.isValid()
    assert cqblend.verify(shape).ok
    assert shape.Volume() == pytest.approx(measure_swept_volume(body, RADIUS), rel=1e-12)
    kinds = Counter(face.geomType() for face in result.faces)
    assert kinds["SPHERE"] == len(body.Vertices())
    assert set(kinds) == {"SPHERE", "CYLINDER"}
    assert result.certificate.angle < 1e-11
    assert result.certificate.gap < 1e-11
    between = [edge for edge in result.certificate.edges if edge.kind == "between"]
    assert max(edge.angle for edge in between) < 1e-13
    assert max(edge.gap for edge in between) < 1e-12
    assert result.certificate.proof.angle < 1e-7


def test_corners_survive_step_and_a_later_cut(tmp_path):
    shape, _ = blend_all_edges(make_tilted_box(), RADIUS)
    path = tmp_path / "corners.step"
    cq.exporters.export(cq.Workplane(shape), str(path))
    read = cq.importers.importStep(str(path)).val()
    assert read.isValid()
    assert read.Volume() == pytest.approx(shape.Volume(), rel=1e-11)
    tool = cq.Workplane().box(8, 8, 60).translate((10, 7, 0)).val()
    assert shape.cut(tool).Volume() + shape.intersect(tool).Volume() == pytest.approx(shape.Volume(), rel=1e-9)


def assert_smooth(result: cqblend.BlendResult, angle: float, between: float) -> None:
    """Check what OCCT measures along rails, and between blends: there, rounding is divided by how near a pole is."""
    assert result.shape.isValid()
    assert cqblend.verify(result.shape).ok
    assert result.certificate.angle < angle
    joints = [edge for edge in result.certificate.edges if edge.kind == "between"]
    assert max(edge.angle for edge in joints) < between
    assert max(edge.gap for edge in joints) < 1e-9


def test_polynomial_sections_join_at_the_point_of_an_oblique_face():
    _, result = blend_all_edges(make_tilted_box(), RADIUS, section="hermite")
    assert_smooth(result, 1e-11, 1e-8)
    assert result.certificate.proof.angle < 1e-9


@pytest.mark.parametrize("radius", [4 * (1 - 1e-9), 4 * (1 - 1e-6)])
def test_radii_that_differ_by_less_than_rails_do_make_one_point(radius):
    box = cq.Workplane().box(20, 14, 10)
    rounded = cqblend.blend_edges(box.val(), box.edges("|Z").vals(), 4).shape
    top = next(face for face in rounded.Faces() if face.Center().z > 4.99)
    result = cqblend.blend_edges(rounded, top.Edges(), radius)
    assert_smooth(result, 1e-11, 1e-10)
    assert result.certificate.proof.angle < 1e-9
    exact = cqblend.blend_edges(rounded, top.Edges(), 4, section="hermite").shape.Volume()
    assert result.shape.Volume() == pytest.approx(exact, rel=1e-6)


def make_cut_cylinder() -> cq.Shape:
    above = cq.Workplane().box(60, 60, 20).rotate((0, 0, 0), (1, 0, 0), 20).translate((0, 0, 24))
    beside = cq.Workplane().box(30, 60, 60).translate((20, 0, 0))
    return cq.Workplane().circle(10).extrude(20).cut(above).cut(beside).val()


def make_curved_prism() -> cq.Shape:
    corners = [(-10, -8), (10, -8), (10, 8), (-10, 8)]
    middles = [(0, -10), (12, 0), (0, 6), (-8, 0)]
    outline = cq.Workplane().moveTo(*corners[0])
    for middle, corner in zip(middles, [*corners[1:], corners[0]], strict=True):
        outline = outline.spline([middle, corner], includeCurrent=True)
    return outline.close().extrude(10).val()


def make_block_with_a_curved_top() -> cq.Shape:
    points = [
        [cq.Vector(x, y, 5 + np.sin(x / 12) + np.cos(y / 9)) for y in np.linspace(-13, 13, 5)]
        for x in np.linspace(-16, 16, 5)
    ]
    top = cq.Face.makeSplineApprox(points, tol=1e-3, minDeg=3, maxDeg=3)
    parts = cq.Workplane().box(24, 18, 30).translate((0, 0, 10)).val().split(top).Solids()
    return min(parts, key=lambda part: part.Center().z)


@pytest.mark.parametrize(
    ("make", "angle"),
    [(make_cut_cylinder, 1e-5), (make_curved_prism, 1e-11), (make_block_with_a_curved_top, 1e-5)],
)
def test_all_edges_of_curved_bodies_are_blended(make, angle):
    # where an earlier blend is compact, it is off its faces by up to 1e-5 rad, and so are the cells beyond
    body = make()
    result = cqblend.blend_edges(body, body.Edges(), RADIUS)
    assert_smooth(result, angle, max(angle, 1e-10))
    assert result.shape.Volume() == pytest.approx(body.fillet(RADIUS, body.Edges()).Volume(), rel=1e-4)
    assert max(rail.bend for rail in result.certificate.rails) < 0.05 * RADIUS


def choose_radii(body: cq.Shape, *radii: float) -> dict[cq.Edge, float]:
    """Return radii of all edges of a body, of those along z, x and y."""
    tangents = [np.abs(edge.tangentAt(0.5).toTuple()) for edge in body.Edges()]
    return {
        edge: radii[0] if tangent[2] > 0.8 else radii[1 + int(tangent[1] > tangent[0])]
        for edge, tangent in zip(body.Edges(), tangents, strict=True)
    }


@pytest.mark.parametrize(
    ("make", "radii"),
    [
        (lambda: cq.Solid.makeBox(20, 14, 10), (3, 2, 1)),
        (make_tilted_box, (2, 1, 1.5)),
        (make_tilted_box, (1.5, 1.49, 1.45)),
    ],
)
def test_edges_of_different_sizes_meet_around_the_largest(make, radii):
    body = make()
    chosen = choose_radii(body, *radii)
    result = cqblend.blend_edges(body, list(chosen), chosen)
    assert_smooth(result, 1e-10, 1e-8)
    # what a ball of the largest and of the smallest of the radii leaves are bounds
    volumes = [body.fillet(radius, body.Edges()).Volume() for radius in (max(radii), min(radii))]
    assert volumes[0] < result.shape.Volume() < volumes[1]


def test_the_size_changes_along_the_end_of_the_first_blend_and_nowhere_else():
    box = cq.Workplane().box(20, 14, 10)
    chosen = choose_radii(box.val(), 3, 2, 1)
    shape = cqblend.blend_edges(box.val(), list(chosen), chosen).shape
    for point, radius in [((5, -7, 5), 2), ((-5, 7, -5), 2), ((10, 2, 5), 1), ((10, -2, -5), 1)]:
        corner = cq.Vector(*point)
        inwards = cq.Vector(
            *(
                -np.sign(x) if abs(x) in (5, 7, 10) and k != (0 if radius == 2 else 1) else 0
                for k, x in enumerate(point)
            )
        )
        centre = corner + inwards * radius
        probe = cq.Vertex.makeVertex(*centre.toTuple())
        assert shape.distance(probe) == 0.0  # inside the solid
        assert min(face.distance(probe) for face in shape.Faces()) == pytest.approx(radius, rel=5e-4)


def make_angle(*, oblique: bool) -> cq.Shape:
    """An angle profile: at its inner corner, one edge is concave and two are convex."""
    corners = [(0, 0), (20, 0), (22, 9), (9, 7), (7, 20), (0, 22)]
    prism = cq.Workplane().polyline(corners).close().extrude(14)
    if not oblique:
        return prism.val()
    above = cq.Workplane().box(80, 80, 20).rotate((0, 0, 0), (1, 0.4, 0), 12).translate((8, 8, 20))
    return prism.cut(above).val()


def make_tapered_boss() -> cq.Shape:
    return cq.Workplane().box(40, 30, 8).faces(">Z").workplane().rect(16, 12).extrude(10, taper=10).val()


@pytest.mark.parametrize(
    ("make", "rel"),
    [
        (lambda: make_angle(oblique=False), 1e-12),  # a torus around the concave blend
        (lambda: make_angle(oblique=True), 1e-4),
        (make_tapered_boss, 1e-4),
    ],
)
def test_two_edges_go_around_the_blend_of_one_of_the_other_convexity(make, rel):
    body = make()
    result = cqblend.blend_edges(body, body.Edges(), RADIUS)
    assert_smooth(result, 1e-11, 1e-7)
    assert result.shape.Volume() == pytest.approx(body.fillet(RADIUS, body.Edges()).Volume(), rel=rel)
