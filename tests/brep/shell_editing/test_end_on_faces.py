"""Ends of open blends: natural, on whatever faces lie there, and flat where that is asked for."""

import math
from io import BytesIO

import cadquery as cq
import numpy as np
import pytest
from OCP.BinTools import BinTools
from OCP.BRepCheck import BRepCheck_Analyzer

import cqblend


def content(shape: cq.Shape) -> bytes:
    stream = BytesIO()
    BinTools.Write_s(shape.wrapped, stream)
    return stream.getvalue()


def rounded_box() -> cq.Shape:
    """A box with rounded upright edges: the edges around its top go on tangentially from face to face."""
    return cq.Workplane().box(30, 20, 10).edges("|Z").fillet(4).val()


def top_edge(box: cq.Shape) -> cq.Edge:
    return next(edge for edge in box.Edges() if (edge.Center() - cq.Vector(0, -10, 5)).Length < 1e-6)


def ridge() -> cq.Shape:
    """Two equal cylinders that cross: the angle along each quarter of the joint fades to nothing at its ends."""
    rods = [
        cq.Solid.makeCylinder(5, 40, cq.Vector(*start), cq.Vector(*along))
        for start, along in (((-20, 0, 0), (1, 0, 0)), ((0, -20, 0), (0, 1, 0)))
    ]
    return rods[0].fuse(rods[1]).Solids()[0]


def sharp_edge(body: cq.Shape) -> cq.Edge:
    return next(e for e in body.Edges() if cqblend.continuity(body, e).angle > 1)


def apex() -> cq.Shape:
    """A pyramid: four faces meet at its tip."""
    base = [cq.Vector(x, y, 0) for x, y in ((-10, -10), (10, -10), (10, 10), (-10, 10))]
    tip = cq.Vector(0, 0, 12)
    loops = [base, *([base[k - 1], base[k], tip] for k in range(4))]
    faces = [cq.Face.makeFromWires(cq.Wire.makePolygon([*loop, loop[0]])) for loop in loops]
    return cq.Solid.makeSolid(cq.Shell.makeShell(faces))


def check(body: cq.Shape, result: cqblend.BlendResult, *, grows: bool, flat: bool = True) -> None:
    assert result.certificate.method == "wire substitution" + ", flat ends" * flat
    assert result.shape.isValid()
    assert BRepCheck_Analyzer(result.shape.wrapped, True, False, True).IsValid()
    assert cqblend.verify(result.shape, result.faces).ok
    assert (result.shape.Volume() > body.Volume()) == grows


def kinds(result: cqblend.BlendResult) -> list[str]:
    return [end.kind for end in result.certificate.ends]


@pytest.mark.parametrize("radius", [0.5, 1.5])
def test_a_piece_of_a_tangent_chain_with_flat_ends(radius):
    """The caps stand at the vertices, on the smooth edges where the rounded corners begin."""
    box = rounded_box()
    before = content(box)
    result = cqblend.blend_edges(box, top_edge(box), radius, chain=False, ends="flat")
    check(box, result, grows=False)
    assert content(box) == before
    assert result.certificate.angle < 1e-12
    assert result.certificate.coverage == 1
    added = [f for f in result.shape.Faces() if f.geomType() == "PLANE" and f.Area() < radius**2]
    assert sorted(round(cap.Center().x, 9) for cap in added) == [-11, 11]
    for cap in added:
        assert abs(cap.normalAt().x) == pytest.approx(1, abs=1e-12)
        assert cap.Area() == pytest.approx((1 - math.pi / 4) * radius**2, rel=2e-3)
    removed = box.Volume() - result.shape.Volume()
    assert removed == pytest.approx((1 - math.pi / 4) * radius**2 * 22, rel=2e-3)
    assert kinds(result) == ["flat", "flat"]
    points = [box.Vertices()[end.vertex - 1].toTuple() for end in result.certificate.ends]
    assert sorted(points) == [(-11, -10, 5), (11, -10, 5)]
    assert "has a flat end at vertex" in str(result.certificate)


def test_flat_ends_where_asked_for_may_stand_before_the_vertex():
    """The ridge of a ship's bow fades out: a cap stands as near to its end as it can, and coverage says where."""
    body = ridge()
    edge = sharp_edge(body)
    result = cqblend.blend_edges(body, edge, 0.8, ends="flat")
    check(body, result, grows=True)
    assert result.certificate.angle < 1e-7
    assert 0.5 < result.certificate.coverage < 0.999
    length = 2 * edge.Length() * (1 - result.certificate.coverage)  # the joint goes on in a second, equal edge
    assert sum(end.before for end in result.certificate.ends) == pytest.approx(length, rel=1e-6)
    assert f"covers {result.certificate.coverage:.1%}" in str(result.certificate)


def test_a_pair_of_ends_runs_as_the_edge_does():
    box = cq.Workplane().box(30, 20, 10).val()
    edge = top_edge(box)
    for picked in (edge, cq.Edge(edge.wrapped.Reversed())):
        result = cqblend.blend_edges(box, picked, 2, ends=("natural", "flat"))
        (start,) = (end for end in result.certificate.ends if end.kind == "natural")
        assert box.Vertices()[start.vertex - 1].Center() == picked.startPoint()
        assert result.certificate.coverage < 1
        assert cqblend.verify(result.shape, result.faces).ok


def test_what_is_no_end_is_refused():
    box = cq.Workplane().box(30, 20, 10).val()
    with pytest.raises(cqblend.errors.InputError, match="ends must be 'natural' or 'flat' or 'auto', not 'round'"):
        cqblend.blend_edges(box, top_edge(box), 2, ends="round")
    with pytest.raises(cqblend.errors.InputError, match="one for each end of the edge, not 3 values"):
        cqblend.blend_edges(box, top_edge(box), 2, ends=("flat",) * 3)


# Vertices of mixed convexity: an edge of the end face must be lengthened to where the blend ends on it.


def flush_step(wall: str) -> cq.Shape:
    """An L-shaped extrusion: the edges along its leg end at the wall, flush with the sides of the leg."""
    outline = cq.Workplane().lineTo(40, 0).lineTo(40, 10).lineTo(10, 10)
    if wall == "spline":
        outline = outline.spline([(12, 20), (9, 30), (11, 40)], includeCurrent=True).lineTo(0, 40)
    elif wall == "arc":
        outline = outline.threePointArc((13, 25), (10, 40)).lineTo(0, 40)
    else:
        outline = outline.lineTo(10, 40).lineTo(0, 40)
    return outline.close().extrude(20).val()


@pytest.mark.parametrize("wall", ["plane", "arc", "spline"])
def test_an_edge_that_ends_at_a_flush_wall(wall):
    """The blend cuts into the wall's own border, which goes on to where the blend meets it: one unique way to end."""
    body = flush_step(wall)
    edge = min(body.Edges(), key=lambda e: (e.Center() - cq.Vector(25, 10, 20)).Length)
    before = content(body)
    result = cqblend.blend_edges(body, edge, 3)
    assert content(body) == before
    check(body, result, grows=False, flat=False)
    assert kinds(result) == ["natural", "natural"]
    removed = cqblend.verify(body).volume - cqblend.verify(result.shape).volume
    if wall == "plane":
        assert removed == pytest.approx((1 - math.pi / 4) * 9 * 30, rel=2e-3)
    # the far corner of the blend lies on the side of the leg, below the vertex, and on the wall's surface
    wall_face = next(f for f in result.shape.Faces() if (f.Center() - wall_centre(body)).Length < 1)
    lowest = min(wall_face.Vertices(), key=lambda v: (v.Center() - cq.Vector(10, 7, 20)).Length)
    assert abs(lowest.Y - 7) < 1e-6
    assert abs(lowest.Z - 20) < 1e-9


def wall_centre(body: cq.Shape) -> cq.Vector:
    return min(body.Faces(), key=lambda f: (f.Center() - cq.Vector(11, 25, 10)).Length).Center()


def lug() -> tuple[cq.Shape, cq.Edge]:
    """A boss tangent to the sides of its plate, and its foot."""
    plate = cq.Workplane().box(40, 26, 9, centered=(False, True, False))
    body = plate.union(cq.Workplane().center(40, 0).circle(13).extrude(24)).clean().val()
    return body, next(e for e in body.Edges() if e.geomType() == "CIRCLE" and abs(e.Center().z - 9) < 1e-6)


@pytest.mark.parametrize("radius", [1, 3, 5, 9])
def test_the_foot_of_a_lug_runs_out_on_its_tangent_sides(radius):
    """The fillet is cut off by the planes of the sides, into which the boss goes on smoothly."""
    body, foot = lug()
    result = cqblend.blend_edges(body, foot, radius)
    assert result.certificate.method == "wire substitution"
    assert result.certificate.coverage == 1
    assert kinds(result) == ["natural", "natural"]
    assert result.shape.isValid()
    assert BRepCheck_Analyzer(result.shape.wrapped, True, False, True).IsValid()
    assert result.certificate.edge_tolerance < 5e-7
    assert result.shape.BoundingBox().ymax == pytest.approx(13, abs=1e-6)
    (blend,) = result.faces
    t, v = np.meshgrid(np.linspace(0.2, 0.8, 9), np.linspace(0, 1, 17), indexing="ij")
    low, high = blend._uvBounds()[:2]
    for u, w in zip((low + t * (high - low)).ravel().tolist(), v.ravel().tolist(), strict=True):
        x, y, z = blend._geomAdaptor().Value(u, w).Coord()
        distance = math.hypot(13 + radius - math.hypot(x - 40, y), 9 + radius - z)  # from the middle of the ball
        assert distance == pytest.approx(radius, rel=1e-3)


def test_the_foot_of_a_lug_adds_up():
    body, foot = lug()
    result = cqblend.blend_edges(body, foot, 3)
    check(body, result, grows=True, flat=False)
    rho = np.linspace(13, 16, 20001)
    height = 3 - np.sqrt(9 - (16 - rho) ** 2)
    exact = np.trapezoid(height * rho * 2 * np.arcsin(13 / rho), rho)  # of the ball's own fillet, between the sides
    added = cqblend.verify(result.shape).volume - cqblend.verify(body).volume
    assert added == pytest.approx(exact, rel=2e-3)


def test_one_end_fails_and_the_other_is_natural():
    """A plate on one with a rounded corner: the blend has a face to end on above, and below one of no depth.

    That is so with the width of the corner's radius and a section that strays from the circle. An arc goes on in the
    corner's own cylinder, and takes off just what that lacks.
    """
    low = cq.Workplane().box(90, 80, 6, centered=(True, True, False)).edges("|Z and >X and >Y").fillet(9)
    body = low.union(cq.Workplane().box(90, 80, 6, centered=(True, True, False)).translate((0, 0, 6))).val()
    edge = min(body.Edges(), key=lambda e: (e.Center() - cq.Vector(45, 40, 9)).Length)
    with pytest.raises(cqblend.errors.SizeError, match="nothing would remain of edge"):
        cqblend.blend_edges(body, edge, 9, section="hermite")
    arc = cqblend.blend_edges(body, edge, 9)
    check(body, arc, grows=False, flat=False)
    assert kinds(arc) == ["natural", "natural"]
    assert cut_off(body, arc) == pytest.approx((1 - math.pi / 4) * 81 * 6, rel=1e-9)
    assert len(arc.shape.Faces()) == len(body.Faces())  # the underside of the plate goes
    up = edge.startPoint().z < edge.endPoint().z
    result = cqblend.blend_edges(
        body, edge, 9, section="hermite", ends=("flat", "natural") if up else ("natural", "flat")
    )
    check(body, result, grows=False)
    flat, natural = sorted(result.certificate.ends, key=lambda end: end.kind)
    assert body.Vertices()[natural.vertex - 1].Z == 12
    assert result.certificate.coverage == pytest.approx(1 - flat.before / 6)
    smaller = cqblend.blend_edges(body, edge, 8)
    check(body, smaller, grows=False, flat=False)
    assert smaller.certificate.coverage == 1


def test_an_end_in_the_edge_of_an_earlier_round():
    """A plate over the rounded corner of another: a round of the same radius ends in the edge of that one."""
    low = cq.Workplane().box(90, 80, 6, centered=(True, True, False)).edges("|Z and >X and >Y").fillet(9)
    body = low.union(cq.Workplane().box(90, 80, 6, centered=(True, True, False)).translate((0, 0, 6))).val()
    result = cqblend.blend_edges(body, edge_near(body, 45, 40, 9), 9, section="arc")
    check(body, result, grows=False, flat=False)
    assert len(result.shape.Faces()) == len(body.Faces())  # the blend comes, and the underside goes
    assert cut_off(body, result) == pytest.approx((1 - math.pi / 4) * 81 * 6, rel=1e-6)


def rounded_foot() -> tuple[cq.Shape, cq.Edge]:
    """The foot of a rounded box on a plate, straight and curved pieces in turn, and one straight piece."""
    body = cq.Workplane().box(60, 60, 6).union(cq.Workplane().box(30, 20, 20).edges("|Z").fillet(4)).val().Solids()[0]
    return body, next(e for e in body.Edges() if (e.Center() - cq.Vector(0, -10, 3)).Length < 1e-6)


def test_a_flat_end_in_place_of_a_natural_one_is_told():
    """The wall recedes past its vertex, so that the blend of one piece meets no face there."""
    body, edge = rounded_foot()
    with pytest.warns(cqblend.errors.FlatEndWarning) as warned:
        result = cqblend.blend_edges(body, edge, 2, chain=False, ends="auto")
    check(body, result, grows=True)
    assert result.certificate.coverage == 1
    assert kinds(result) == ["flat", "flat"]
    points = [body.Vertices()[end.vertex - 1].toTuple() for end in result.certificate.ends]
    assert len(warned) == 2
    for warning, end, (x, y, z) in zip(warned, result.certificate.ends, points, strict=True):
        text = str(warning.message)
        assert f"vertex {end.vertex} at ({x:g}, {y:g}, {z:g}), beside face " in text
        assert end.cause.startswith("the joint goes on there in edge ")
        assert end.cause in text
        assert warning.filename == __file__


def test_natural_ends_raise_where_they_cannot_be():
    body, edge = rounded_foot()
    with pytest.raises(
        cqblend.errors.TopologyError,
        match=r'cannot end at vertex \d+ at .*, beside face \d+: the joint goes on there in edge \d+, .*ends="flat"',
    ):
        cqblend.blend_edges(body, edge, 2, chain=False)


def cut_off(body: cq.Shape, result: cqblend.BlendResult) -> float:
    return cqblend.verify(body).volume - cqblend.verify(result.shape).volume


def edge_near(body: cq.Shape, *point: float) -> cq.Edge:
    return min(body.Edges(), key=lambda e: (e.Center() - cq.Vector(*point)).Length)


def tool_volume(body: cq.Shape, radius: float) -> float:
    """Return the volume that a fillet of the edge at y = 10, z = 5, straight through, takes off, by OCCT's own cut."""
    bar = cq.Solid.makeBox(80, radius, radius, cq.Vector(-40, 10 - radius, 5 - radius))
    rod = cq.Solid.makeCylinder(radius, 80, cq.Vector(-40, 10 - radius, 5 - radius), cq.Vector(1, 0, 0))
    return body.Volume() - body.cut(bar.cut(rod)).Volume()


def box_with_end(kind: str) -> cq.Shape:
    """A box, the edge along X at y = 10, z = 5 of which ends on what its kind says."""
    box = cq.Workplane().box(30, 20, 10)
    if kind == "chamfer across":
        return box.edges(">X and |Y and >Z").chamfer(2).val()
    if kind == "chamfer beside":
        return box.edges(">X and >Y and |Z").chamfer(1).val()
    if kind == "native fillet":
        return box.edges(">X and >Y and |Z").fillet(3).val()
    if kind == "own blend":
        return box.edges(">X and >Y and |Z").blend(3).val()
    if kind == "step":
        return box.cut(cq.Workplane().box(4, 20, 1.2).translate((13, 0, 4.4))).val()
    if kind == "notch":
        return box.cut(cq.Workplane().box(2, 3, 3).translate((14, 7, 5))).val()
    if kind == "pocket":  # in the end face, which the end curve crosses twice
        return box.cut(cq.Workplane().box(2, 2, 2).translate((14.5, 8.6, 3.5))).val()
    if kind == "bore":
        return box.cut(cq.Workplane("XY", origin=(15, 10, 3.5)).circle(4).extrude(5)).val()
    if kind == "countersink":
        return box.cut(cq.Workplane(cq.Solid.makeCone(4, 1, 4, cq.Vector(15, 10, 1.5)))).val()
    beside = cq.Workplane().polyline([(20, 10), (30, 10), (30, -20), (10, -20)]).close().extrude(20, both=True)
    below = cq.Workplane("XZ").polyline([(20, 5), (30, 5), (30, -20), (14, -20)]).close().extrude(20, both=True)
    return cq.Workplane().box(40, 20, 10).cut(beside).cut(below).val()  # "ridge"


@pytest.mark.parametrize(
    ("kind", "radius"),
    [
        ("chamfer across", 3),
        ("chamfer across", 5),
        ("chamfer beside", 1),
        ("chamfer beside", 4),
        ("native fillet", 1),
        ("native fillet", 3),
        ("native fillet", 5),
        ("own blend", 2),
        ("own blend", 5),
        ("step", 2),
        ("step", 4),
        ("notch", 2.5),
        ("notch", 4.5),
        ("pocket", 3.4),
        ("bore", 3),
        ("bore", 5),
        ("countersink", 2),
        ("countersink", 4),
        ("ridge", 3),
    ],
)
def test_an_end_on_several_faces(kind, radius):
    """The blend is cut by whatever lies around its end: OCCT cuts off as much with a straight tool."""
    body = box_with_end(kind)
    edge = edge_near(body, 0, 10, 5)
    before = content(body)
    result = cqblend.blend_edges(body, edge, radius, chain=False)
    assert content(body) == before
    check(body, result, grows=False, flat=False)
    assert kinds(result) == ["natural", "natural"]
    assert result.certificate.angle < 1e-12
    assert result.certificate.edge_tolerance < 2e-7
    assert len(result.shape.Faces()) == len(body.Faces()) + 1
    assert cut_off(body, result) == pytest.approx(tool_volume(body, radius), rel=2e-3)


def test_faces_under_the_end_go():
    """A plate over the rounded corner of another: a larger blend takes the underside there, and that rounding, too."""
    low = cq.Workplane().box(90, 80, 6, centered=(True, True, False)).edges("|Z and >X and >Y").fillet(9)
    body = low.union(cq.Workplane().box(90, 80, 6, centered=(True, True, False)).translate((0, 0, 6))).val()
    result = cqblend.blend_edges(body, edge_near(body, 45, 40, 9), 10)
    check(body, result, grows=False, flat=False)
    assert len(result.shape.Faces()) == len(body.Faces()) - 1
    removed = (1 - math.pi / 4) * (100 * 12 - 81 * 6)  # the blend goes on to the bottom
    assert cut_off(body, result) == pytest.approx(removed, rel=4e-3)


def test_a_rib_that_a_rail_runs_into():
    """The foot of a rib on a tapered face, which the blend would reach: the rib stays, and stands on the blend."""
    rib = cq.Workplane().box(2, 8, 14, centered=(True, True, False)).translate((11, 12, 0))
    body = cq.Workplane().rect(32, 22).extrude(20, taper=7).union(rib).val()
    edge = edge_near(body, 16 - 10 * math.tan(math.radians(7)), 11 - 10 * math.tan(math.radians(7)), 10)
    result = cqblend.blend_edges(body, edge, 5)
    check(body, result, grows=False, flat=False)
    assert len(result.shape.Faces()) == len(body.Faces()) + 1
    # not by what rib and result have in common: OCCT finds nothing, for the tolerance of an edge that union() has left
    assert result.shape.fuse(rib.val()).Volume() == pytest.approx(result.shape.Volume(), abs=1e-6)
    plain = cq.Workplane().rect(32, 22).extrude(20, taper=7)
    native = plain.edges(cq.NearestToPointSelector(edge.Center())).fillet(5).union(rib).val()
    assert result.shape.Volume() == pytest.approx(native.Volume(), rel=1e-7)


def test_a_rib_that_a_concave_blend_runs_over():
    """A rib at the foot of a wall, lower than the blend: it stops the blend below, and carries it on its top."""
    wall = cq.Workplane().box(30, 4, 20).translate((0, -8, 8))
    rib = cq.Workplane().box(3, 8, 3).translate((13.5, -3, 3))
    body = cq.Workplane().box(30, 20, 4).union(wall).union(rib).val()
    result = cqblend.blend_edges(body, edge_near(body, -1.5, -6, 2), 4)
    check(body, result, grows=True, flat=False)
    whole = cq.Workplane().box(30, 20, 4).union(wall).val()
    plain = cqblend.blend_edges(whole, edge_near(whole, 0, -6, 2), 4)
    assert result.shape.Volume() == pytest.approx(plain.shape.fuse(rib.val()).Volume(), rel=1e-6)


def half_sunk_pipe(turn: float, around: float) -> tuple[cq.Shape, cq.Edge]:
    """A cylinder that comes out of a wider one at its end, half of it below; and the edge in which they meet.

    ``turn`` and ``around`` (degrees) tell where their seams are: with 90 and 270, the narrow one's leaves from an end.
    """
    wide = cq.Solid.makeCylinder(10, 60).rotate(cq.Vector(), cq.Vector(0, 0, 1), around)
    narrow = cq.Solid.makeCylinder(4, 25, cq.Vector(), cq.Vector(1, 0, 0))
    body = wide.fuse(narrow.rotate(cq.Vector(), cq.Vector(1, 0, 0), turn)).Solids()[0]
    return body, next(edge for edge in body.Edges() if edge.geomType() not in ("LINE", "CIRCLE"))


@pytest.mark.parametrize("around", [0, 45])
@pytest.mark.parametrize("turn", [90, 270])
@pytest.mark.parametrize("radius", [0.2, 1.0, 2.5])
def test_a_seam_of_a_side_leaves_from_the_end(turn, around, radius):
    """The part of the seam next to the blend becomes a border, and the rest stays: the shape is that without a seam."""
    body, edge = half_sunk_pipe(turn, around)
    result = cqblend.blend_edges(body, edge, radius, ends="natural")
    check(body, result, grows=True, flat=False)
    assert kinds(result) == ["natural", "natural"]
    expected = cqblend.verify(cqblend.blend_edges(*half_sunk_pipe(0, 0), radius, ends="natural").shape).volume
    assert cqblend.verify(result.shape).volume == pytest.approx(expected, rel=1e-6)


def test_a_vertex_of_many_faces():
    body = apex()
    edge = max(body.Edges(), key=lambda e: e.Center().z if e.Length() > 1 else -1)
    result = cqblend.blend_edges(body, edge, 1)
    check(body, result, grows=False, flat=False)
    assert len(result.shape.Faces()) == 6
    flat = cqblend.blend_edges(body, edge, 1, ends="flat")
    assert cqblend.verify(flat.shape, flat.faces).ok
    ends = np.array([vertex.toTuple() for vertex in flat.shape.Vertices()])
    assert ends[:, 2].max() == pytest.approx(12, abs=1e-9)
