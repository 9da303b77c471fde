"""Blends of solids whose sizes vary: sound, exact, where they should be, and as a ball of that radius has them."""

from __future__ import annotations

import runpy
from io import BytesIO

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS
from places import CASES

import cqblend
from cqblend.brep.topology import explore_subshapes
from cqblend.errors import CqblendError, InputError, SizeError, UnsupportedError

BOX = cq.Workplane().box(30, 20, 10)
EDGE = ">X and >Z"
LINEAR = cqblend.linear(1, 3)
TABLE = cqblend.table([(0, 1), (0.3, 1.2), (0.6, 3), (1, 2)])


def sine(t):
    return 2 + 0.8 * np.sin(2 * np.pi * t)


def arch(t):
    return 2 * np.sin(np.pi * t)


def wavy() -> tuple[cq.Workplane, cq.Edge]:
    """Return a block with a freeform top, and an edge of that."""
    places = np.linspace(-25, 25, 24)
    points = [
        [cq.Vector(x, y, 10 + 1.5 * np.sin(2 * np.pi * x / 30) * np.cos(2 * np.pi * y / 30)) for y in places]
        for x in places
    ]
    halves = cq.Solid.makeBox(40, 40, 30, cq.Vector(-20, -20, -15)).split(cq.Face.makeSplineApprox(points, tol=1e-3))
    body = min(halves.Solids(), key=lambda half: half.Center().z)
    return cq.Workplane(body), max((e for e in body.Edges() if e.Center().z > 5), key=lambda e: e.Center().x)


def half_cylinder() -> tuple[cq.Workplane, cq.Edge]:
    body = cq.Workplane().circle(10).extrude(20).intersect(cq.Workplane().box(30, 10, 60).translate((0, 5, 0)))
    return body, next(e for e in body.val().Edges() if e.geomType() == "CIRCLE" and e.Center().z > 5)


def wedge() -> tuple[cq.Workplane, cq.Edge]:
    """Return a wedge of 22 degrees, and its sharp edge."""
    body = cq.Workplane("XZ").polyline([(0, 0), (30, 0), (0, 12)]).close().extrude(20)
    return body, body.edges(">X").val()


def step() -> tuple[cq.Workplane, cq.Edge]:
    """Return a body with a concave edge."""
    body = BOX.cut(cq.Workplane().box(20, 20, 10).translate((10, 0, 5)))
    return body, body.edges(cq.selectors.NearestToPointSelector((0, 0, 0))).val()


def rim() -> tuple[cq.Workplane, cq.Edge]:
    body = cq.Workplane().circle(10).extrude(12)
    return body, body.edges(">Z").val()


def foot() -> tuple[cq.Workplane, cq.Edge]:
    body = cq.Workplane().box(40, 40, 8).faces(">Z").workplane().circle(8).extrude(12)
    return body, body.faces(">Z[-2]").edges("%CIRCLE").val()


def straight() -> tuple[cq.Workplane, cq.Edge]:
    return BOX, BOX.edges(EDGE).val()


BODIES = {make.__name__: make for make in (straight, wedge, step, half_cylinder, wavy, rim, foot)}
CLOSED = ("rim", "foot")
LAWS = {"linear": LINEAR, "sine": sine, "table": TABLE, "to 0": cqblend.linear(0, 2), "0 to 0": arch}
SOLID_CASES = [
    (body, law)
    for body in BODIES
    for law in LAWS
    if (law == "sine" if body in CLOSED else True) and (body, law) != ("wedge", "table")
]


def check_sound(result: cqblend.BlendResult, angle: float = 1e-10) -> None:
    """Check a blend by all that looks at it without knowing how it was made."""
    verification = cqblend.verify(result.shape)
    assert verification.ok, verification.problems
    assert result.shape.isValid()
    assert result.certificate.angle <= angle
    assert result.certificate.coverage == 1.0


@pytest.mark.parametrize(("body", "law"), SOLID_CASES)
def test_it_is_sound_and_exactly_tangent(body, law):
    solid, edge = BODIES[body]()
    size = LAWS[law]
    if body == "wedge":
        size = {"linear": cqblend.linear(0.4, 1), "sine": lambda t: sine(t) / 3}.get(law, size)
    result = cqblend.blend_edges(solid, edge, size, form="exact")
    check_sound(result)
    points = [end.kind for end in result.certificate.ends].count("point")
    assert points == {"to 0": 1, "0 to 0": 2}.get(law, 0)


@pytest.mark.parametrize(
    "options",
    [
        {"continuity": "G2"},
        {"continuity": "G3"},
        {"continuity": ("G2", "G1")},
        {"section": "pde"},
        {"section": "pde", "order": 6},
        {"tangents": "parametric"},
        {"tangents": "chord"},
        {"bulge": 0.8},
        {"form": "compact"},
    ],
    ids=str,
)
@pytest.mark.parametrize("law", ["linear", "sine", "to 0", "0 to 0"])
def test_it_goes_with_every_option(law, options):
    result = cqblend.blend_edges(BOX, BOX.edges(EDGE), LAWS[law], **options)
    assert cqblend.verify(result.shape, result.faces).ok
    assert result.certificate.angle <= (1e-5 if "form" in options else 1e-10)
    if options.get("continuity") in ("G2", "G3"):
        assert result.certificate.curvature_jump <= 1e-6


# Constant laws.


def write_brep(shape: cq.Shape) -> bytes:
    stream = BytesIO()
    BRepTools.Write_s(shape.wrapped, stream)
    return stream.getvalue()


@pytest.mark.parametrize("make", [straight, rim, wavy])
@pytest.mark.parametrize("options", [{}, {"section": "hermite", "continuity": "G2"}])
def test_a_constant_function_is_the_number_bit_for_bit(make, options):
    body, edge = make()
    number, function, by_edge = (
        cqblend.blend_edges(body, edge, size, **options) for size in (1.3, lambda t: 1.3 + 0 * t, {edge: lambda _: 1.3})
    )
    assert write_brep(number.shape) == write_brep(function.shape) == write_brep(by_edge.shape)


# Where it is.


def measure_widths(result: cqblend.BlendResult, t: np.ndarray) -> np.ndarray:
    """Return the straight distances between both rails of the blend face in shares of its own parameter."""
    surface = BRep_Tool.Surface_s(result.faces[0].wrapped)
    u0, u1, v0, v1 = surface.Bounds()
    return np.array([surface.Value(u, v0).Distance(surface.Value(u, v1)) for u in u0 + (u1 - u0) * t])


def locate_rails(result: cqblend.BlendResult) -> list[np.ndarray]:
    """Return points (n, 3) of each edge of the blend face that is no point."""
    edges = result.faces[0].Edges()
    return [np.array([point.toTuple() for point in edge.positions(np.linspace(0, 1, 201))]) for edge in edges]


def test_radii_of_a_box_are_where_they_should_be():
    """The rails of a ball of radius R at a right angle are R from the edge."""
    edge = BOX.edges(EDGE).val()
    result = cqblend.blend_edges(BOX, edge, TABLE)
    start, direction = edge.startPoint().toTuple(), np.array([0.0, -1.0, 0.0])
    rails = [rail for rail in locate_rails(result) if np.ptp(rail[:, 1]) > 19]
    assert len(rails) == 2
    for rail in rails:
        t = (rail - start) @ direction / 20
        across = np.abs(rail - start)[:, [0, 2]].max(axis=1)
        assert np.abs(across - TABLE(t)).max() < 3e-5


@pytest.mark.parametrize("turned", [False, True])
def test_t_runs_in_the_sense_of_the_picked_edge(turned):
    edge = BOX.edges(EDGE).val()
    picked = cq.Edge(edge.wrapped.Reversed()) if turned else edge
    result = cqblend.blend_edges(BOX, picked, LINEAR)
    start = np.array((edge.endPoint() if turned else edge.startPoint()).toTuple())
    near = min(result.faces[0].Edges(), key=lambda one: np.linalg.norm(one.Center().toTuple() - start))
    assert near.geomType() != "LINE"
    ends = [np.array(vertex.toTuple()) for vertex in near.Vertices()]
    assert [np.linalg.norm(end - start) for end in ends] == pytest.approx([1.0, 1.0])


def test_of_several_picked_edges_the_one_with_the_lowest_index_counts():
    body = cq.Workplane().box(40, 30, 10).edges("|Z and >X and >Y").fillet(6)
    chain = [e for e in body.faces(">Z").edges().vals() if e.Center().x > 10 or e.Center().y > 10]
    chain = [e for e in chain if abs(e.Center().x - 20) < 3 or abs(e.Center().y - 15) < 3]
    by_index = sorted(chain, key=lambda edge: [edge.isSame(other) for other in body.val().Edges()].index(True))
    results = [cqblend.blend_edges(body, picks, LINEAR) for picks in (by_index, by_index[::-1], by_index[:1])]
    assert len({write_brep(result.shape) for result in results[:2]}) == 1
    assert results[2].shape.Center().toTuple() == pytest.approx(results[0].shape.Center().toTuple(), abs=1e-9)
    for result in results:
        check_sound(result)
        assert len(result.faces) == 3


def test_on_a_closed_edge_t_starts_at_its_vertex():
    body, edge = rim()
    result = cqblend.blend_edges(body, edge, lambda t: 2 + np.cos(2 * np.pi * t))
    start = np.array(edge.startPoint().toTuple())
    rails = [rail for rail in locate_rails(result) if np.ptp(rail[:, 1]) > 10]
    top = max(rails, key=lambda rail: rail[:, 2].mean())
    deepest = top[np.linalg.norm(top[:, :2], axis=1).argmin()]
    assert np.linalg.norm(deepest[:2] - start[:2] * 0.7) < 0.1


def test_widths_by_side_belong_to_the_side_that_is_first():
    top, side = BOX.faces(">Z").val(), BOX.faces(">X").val()
    edge = BOX.edges(EDGE).val()
    for first, axis in ((top, 0), (side, 2)):
        result = cqblend.blend_edges(BOX, edge, width=(cqblend.linear(1, 3), 2), first=first)
        check_sound(result)
        start = np.array(edge.startPoint().toTuple())
        rails = [rail for rail in locate_rails(result) if np.ptp(rail[:, 1]) > 19]
        (own,) = (rail for rail in rails if np.abs(rail - start)[:, 2 - axis].max() < 1e-9)
        t = np.abs(own - start)[:, 1] / 20
        assert np.abs(np.abs(own - start)[:, axis] - (1 + 2 * t)).max() < 2e-5


# As a ball of that radius would have it.


def sample_grid(face: cq.Face, along: int = 41, across: int = 41) -> tuple[np.ndarray, ...]:
    """Return points and normals (n, m, 3) of a blend face along (n) and across (m), by OCCT."""
    surface = BRep_Tool.Surface_s(face.wrapped)
    u0, u1, v0, v1 = surface.Bounds()
    points, normals = np.empty((along, across, 3)), np.empty((along, across, 3))
    for i, u in enumerate(np.linspace(u0, u1, along)):
        for j, v in enumerate(np.linspace(v0, v1, across)):
            p, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
            surface.D1(u, v, p, du, dv)
            points[i, j], normal = p.Coord(), np.array(du.Crossed(dv).Coord())
            normals[i, j] = normal / max(np.linalg.norm(normal), 1e-300)
    return points, normals


@pytest.mark.parametrize("law", [LINEAR, sine, cqblend.linear(0.3, 4)], ids=["linear", "sine", "steep"])
@pytest.mark.parametrize("make", [straight, half_cylinder])
def test_sections_are_arcs_of_circles_in_planes_square_to_the_path_of_the_centre(make, law):
    """The centre of the ball is where both normals at the rails meet; sections are the cubics nearest to its circle."""
    body, edge = make()
    result = cqblend.blend_edges(body, edge, law, section="hermite")
    points, normals = sample_grid(result.faces[0], 601)
    first, last, n1, n2 = points[:, 0], points[:, -1], normals[:, 0], normals[:, -1]
    # |first - s n1 - centre| = |last - s n2 - centre| = 0: the radius, with its sign, by least squares
    radius = ((first - last) * (n1 - n2)).sum(1) / ((n1 - n2) ** 2).sum(1)
    centre = (first - radius[:, None] * n1 + last - radius[:, None] * n2) / 2
    assert np.abs(first - radius[:, None] * n1 - centre).max() < 1e-5
    rate = np.gradient(centre, axis=0, edge_order=2)
    rate /= np.linalg.norm(rate, axis=1, keepdims=True)
    inner = slice(2, -2)  # where differences are central
    middle = centre + ((first - centre) * rate).sum(1)[:, None] * rate
    arms = points - middle[:, None]
    circle = np.linalg.norm(first - middle, axis=1)[:, None]
    off_plane, off_circle = (arms * rate[:, None]).sum(-1), np.linalg.norm(arms, axis=-1) - circle
    half = np.arccos(np.clip((arms[:, 0] * arms[:, -1]).sum(-1) / circle[:, 0] ** 2, -1, 1)) / 2
    assert (np.abs(off_plane) / circle)[inner].max() < 3e-5
    least = find_cubic_arc_error(half.max())
    assert 0.9 * least < (np.abs(off_circle) / circle)[inner].max() < least + 2e-5


def find_cubic_arc_error(half: float) -> float:
    """Return how far the cubic with the arc's end points and tangents, and its middle, is from an arc of radius 1.

    The arc turns by 2 ``half`` (rad); at a right angle, that is 2.7e-4. By Goldapp, Approximation of circular arcs by
    cubic polynomials, CAGD 8 (1991): the radius squared less 1 is proportional to v^2 (1 - v)^2 (1 - 2 v)^2.
    """
    v = np.linspace(0, 1, 2001)
    length = 4 / 3 * np.tan(half / 2)
    start, end = np.array([1.0, 0.0]), np.array([np.cos(2 * half), np.sin(2 * half)])
    poles = [start, start + length * np.array([0, 1]), end - length * np.array([-end[1], end[0]]), end]
    basis = [(1 - v) ** 3, 3 * v * (1 - v) ** 2, 3 * v**2 * (1 - v), v**3]
    return float(
        np.abs(np.linalg.norm(sum(np.outer(b, p) for b, p in zip(basis, poles, strict=True)), axis=1) - 1).max()
    )


def test_a_linear_radius_between_planes_is_a_cone():
    """Its apex is where the radius would be 0."""
    result = cqblend.blend_edges(BOX, BOX.edges(EDGE), cqblend.linear(0, 4))
    points, normals = sample_grid(result.faces[0])
    edge = BOX.edges(EDGE).val()
    apex, along = np.array(edge.startPoint().toTuple()), np.array([0.0, -1.0, 0.0])
    axis = 20 * along + 4 * np.array([-1.0, 0.0, -1.0])  # the centre is R from both planes
    axis /= np.linalg.norm(axis)
    arms, own = points[1:] - apex, normals[1:]
    assert np.abs((own * arms).sum(-1)).max() < 1e-12  # straight lines through the apex
    heights = arms @ axis
    radii = np.linalg.norm(arms - heights[..., None] * axis, axis=-1) / heights
    rail = (
        (arms[:, 0] - heights[:, :1] * axis) / heights[:, :1],
        (arms[:, -1] - heights[:, -1:] * axis) / heights[:, -1:],
    )
    size = np.linalg.norm(rail[0], axis=1)
    assert size == pytest.approx(np.full(40, 4 / np.sqrt(20**2 + 2 * 4**2 - 4**2)), rel=1e-12)
    half = np.arccos((rail[0] * rail[1]).sum(-1) / size**2).max() / 2
    assert (np.abs(radii - size[:, None]) / size[:, None]).max() < 1.01 * find_cubic_arc_error(half)
    assert result.certificate.degree == (1, 3)


@pytest.mark.skipif(not CASES.is_dir(), reason="the cases are not at hand")
def test_the_case_with_a_radius_as_a_law():
    body, edges, law = runpy.run_path(str(CASES / "blend_cases.py"))["CASES"]["25_variable"][0]()
    result = cqblend.blend_edges(body, edges, law)
    check_sound(result)
    assert result.certificate.degree == (1, 3)


# Points.


def test_at_a_point_the_vertex_stays_and_nothing_else_changes():
    edge = BOX.edges(EDGE).val()
    result = cqblend.blend_edges(BOX, edge, cqblend.linear(0, 3))
    start = edge.startPoint()
    (vertex,) = (one for one in result.shape.Vertices() if (one.Center() - start).Length < 1e-9)
    assert any(vertex.isSame(one) for one in BOX.val().Vertices())
    uses = list(explore_subshapes(result.faces[0].wrapped, TopAbs_EDGE))
    assert [BRep_Tool.Degenerated_s(TopoDS.Edge_s(use)) for use in uses].count(True) == 1
    assert len(uses) == 4
    unchanged = [face for face in BOX.val().Faces() if any(face.isSame(one) for one in result.shape.Faces())]
    assert len(unchanged) == 3  # but for the two beside the edge, and the one across its other end
    assert len(result.shape.Faces()) == 7


def test_an_end_that_is_no_point_may_be_flat():
    edge = BOX.edges(EDGE)
    for law, kinds in ((LINEAR, ["flat", "flat"]), (cqblend.linear(0, 2), ["point", "flat"])):
        result = cqblend.blend_edges(BOX, edge, law, ends="flat")
        assert cqblend.verify(result.shape, result.faces).ok
        assert [end.kind for end in result.certificate.ends] == kinds
    with pytest.raises(InputError, match="ends has no effect where the size is 0 at both ends"):
        cqblend.blend_edges(BOX, edge, arch, ends="flat")


def test_both_ends_may_be_points():
    result = cqblend.blend_edges(BOX, BOX.edges(EDGE), arch)
    assert len(result.shape.Vertices()) == 8
    assert [end.kind for end in result.certificate.ends] == ["point", "point"]
    assert "pointed end at vertex" in str(result.certificate.ends[0])


def test_a_blended_body_goes_on_being_a_body():
    """It is cut, blended and filleted on."""
    result = cqblend.blend_edges(BOX, BOX.edges(EDGE), cqblend.linear(0, 3))
    part = cq.Workplane(result.shape)
    assert part.cut(cq.Workplane().box(8, 8, 40)).val().isValid()
    assert part.edges("|Z and <X and <Y").blend(2).val().isValid()
    assert part.edges("|Z and <X and <Y").fillet(1).val().isValid()


@pytest.mark.parametrize(
    "law", [lambda t: 3 * t**2, lambda t: 2 * np.sin(np.pi * t) ** 2, lambda t: 3 * t**3], ids="abc"
)
def test_cusps(law):
    check_sound(cqblend.blend_edges(BOX, BOX.edges(EDGE), law))


def test_both_widths_go_to_0_or_none():
    result = cqblend.blend_edges(BOX, BOX.edges(EDGE), width=(cqblend.linear(0, 3), cqblend.linear(0, 2)))
    check_sound(result)
    with pytest.raises(InputError, match="on one side only"):
        cqblend.blend_edges(BOX, BOX.edges(EDGE), width=(cqblend.linear(0, 3), 2))


def test_in_an_open_shell_a_blend_may_end_in_a_point():
    shell = cq.Shell.makeShell(cq.Workplane().box(30, 20, 10).faces("not >Z").vals())
    edge = cq.Workplane(shell).edges("|Z and >X and >Y")
    for law in (cqblend.linear(0, 2), cqblend.linear(2, 0)):
        result = cqblend.blend_edges(shell, edge, law)
        assert cqblend.verify(result.shape, result.faces).ok
        assert sorted(end.kind for end in result.certificate.ends) == ["natural", "point"]


def test_rails_of_two_that_vary_may_meet_all_along():
    """A full round whose only edge runs obliquely: the radii add up to the thickness everywhere."""
    slab = cq.Workplane().box(50, 30, 10)
    first, second = slab.edges("|Y and >X").vals()  # in opposite senses
    result = cqblend.blend_edges(slab, [first, second], {first: cqblend.linear(4, 6), second: cqblend.linear(4, 6)})
    check_sound(result)
    assert len(result.shape.Faces()) == 7


# Sizes by edge.


def test_each_edge_has_its_own_size():
    uprights = BOX.edges("|Z").vals()
    result = cqblend.blend_edges(
        BOX, uprights, {edge: 1 + number for number, edge in enumerate(uprights)}, section="hermite"
    )
    check_sound(result)
    assert [measure_widths(one, np.array([0.5]))[0] for one in split_faces(result)] == pytest.approx(
        [np.sqrt(2) * (1 + number) for number in range(4)]
    )


def split_faces(result: cqblend.BlendResult) -> list[cqblend.BlendResult]:
    return [cqblend.BlendResult(result.shape, (face,), result.certificate) for face in result.faces]


def test_edges_are_found_whatever_their_sense():
    edge = BOX.edges(EDGE).val()
    turned = cq.Edge(edge.wrapped.Reversed())
    assert cqblend.blend_edges(BOX, edge, {turned: 2}).certificate.valid


@pytest.mark.parametrize(
    ("picked", "sizes", "message"),
    [
        (slice(0, 2), slice(0, 1), r"edge \d+ is to be blended, but no size is given for it"),
        (slice(0, 1), slice(0, 2), r"a size is given for edge \d+, which is not picked"),
    ],
)
def test_sizes_are_those_of_the_picked_edges(picked, sizes, message):
    uprights = BOX.edges("|Z").vals()
    with pytest.raises(InputError, match=message):
        cqblend.blend_edges(BOX, uprights[picked], dict.fromkeys(uprights[sizes], 2))


def test_edges_of_other_shapes_have_no_sizes_here():
    edge = BOX.edges(EDGE).val()
    with pytest.raises(InputError, match="a size is given for an edge that does not belong to the shape"):
        cqblend.blend_edges(BOX, edge, {edge: 2, cq.Solid.makeBox(1, 1, 1).Edges()[0]: 2})
    with pytest.raises(InputError, match="radius for each edge is a mapping from edges to sizes, not from a face"):
        cqblend.blend_edges(BOX, edge, {BOX.faces(">Z").val(): 2})
    with pytest.raises(InputError, match="two sizes are given for edge"):
        cqblend.blend_edges(BOX, edge, {edge.wrapped: 2, edge.wrapped.Reversed(): 3})


def tray() -> tuple[cq.Workplane, list[cq.Edge]]:
    body = cq.Workplane().box(40, 30, 10).edges("|Z").fillet(6)
    return body, body.faces(">Z").edges().vals()


def test_along_a_chain_sizes_agree_or_are_refused_with_the_vertex():
    body, rim_edges = tray()
    sizes = {edge: 1 if edge.geomType() == "LINE" else 2 for edge in rim_edges}
    with pytest.raises(InputError, match=r"radius is [12] mm before vertex \d+ and [12] mm after it.*taper="):
        cqblend.blend_edges(body, rim_edges, sizes)
    result = cqblend.blend_edges(body, rim_edges, sizes, taper=6)
    check_sound(result)
    assert len(result.faces) == 8
    widths = sorted(round(float(measure_widths(one, np.array([0.5]))[0]), 4) for one in split_faces(result))
    assert widths == pytest.approx([np.sqrt(2)] * 4 + [2 * np.sqrt(2)] * 4, abs=2e-4)
    with pytest.raises(InputError, match=r"taper is too long: at vertex \d+, there is no room"):
        cqblend.blend_edges(body, rim_edges, sizes, taper=10)


@pytest.mark.parametrize("continuity", ["G1", "G2"])
def test_a_law_runs_along_a_whole_closed_chain(continuity):
    body, rim_edges = tray()
    result = cqblend.blend_edges(
        body, rim_edges[:1], lambda t: 1.5 + 0.5 * np.sin(2 * np.pi * t), continuity=continuity
    )
    check_sound(result)
    assert len(result.faces) == 8
    assert all(edge.angle <= 1e-10 for edge in result.certificate.edges if edge.kind == "between")


@pytest.mark.parametrize("turned", [False, True])
def test_on_a_closed_chain_t_starts_where_the_picked_edge_with_the_lowest_index_does(turned):
    body, rim_edges = tray()
    lowest = next(edge for edge in body.val().Edges() if any(edge.isSame(one) for one in rim_edges))
    others = [edge for edge in rim_edges if not edge.isSame(lowest)]
    picked = cq.Edge(lowest.wrapped.Reversed()) if turned else lowest
    length = sum(edge.Length() for edge in rim_edges)
    result = cqblend.blend_edges(body, [*others, picked], lambda t: 1.5 + 0.5 * np.cos(2 * np.pi * t))
    check_sound(result)
    start = np.array((lowest.endPoint() if turned else lowest.startPoint()).toTuple())
    top = np.concatenate(
        [rail for one in split_faces(result) for rail in locate_rails(one) if np.ptp(rail[:, 2]) < 1e-9]
    )
    top = top[np.abs(top[:, 2] - 5) < 1e-9]
    near = top[np.linalg.norm(top - start, axis=1).argmin()]
    assert np.linalg.norm(near - start) == pytest.approx(2.0, abs=1e-3)
    along = np.array((lowest.tangentAt(0.0) if not turned else -lowest.tangentAt(1.0)).toTuple())
    if lowest.geomType() == "LINE":  # a quarter of the way along it, the radius has gone down by that much
        share = lowest.Length() / 4
        place = start + share * along
        found = np.linalg.norm(top - place, axis=1).min()
        assert found == pytest.approx(1.5 + 0.5 * np.cos(2 * np.pi * share / length), abs=2e-2)


def test_a_chain_may_end_in_points():
    body = cq.Workplane().box(40, 30, 10).edges("|Z and >X and >Y").fillet(6)
    arc = next(e for e in body.faces(">Z").edges().vals() if e.geomType() == "CIRCLE")
    result = cqblend.blend_edges(body, arc, arch)
    check_sound(result)
    assert len(result.faces) == 3
    assert [end.kind for end in result.certificate.ends] == ["point", "point"]


# What is refused.


def test_arcs_are_not_exact_where_the_radius_varies():
    with pytest.raises(UnsupportedError, match='section="arc" is not exact here: the radius varies along the edge'):
        cqblend.blend_edges(BOX, BOX.edges(EDGE), LINEAR, section="arc")


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (LINEAR, "radius is 1 mm at t = 0 and 3 mm at t = 1, which are one place on a closed edge"),
        (arch, "radius is 0 at an end: that can only be on an open edge"),
    ],
)
def test_closed_edges_have_one_size_where_they_close(law, message):
    with pytest.raises(InputError, match=message):
        cqblend.blend_edges(*rim(), law)


def test_sizes_that_do_not_fit_say_where_and_how_much_less_would():
    body, edge = wavy()
    with pytest.raises(SizeError, match=r"at t = [0-9.]+.*at most about [0-9.]+ times as much fits") as caught:
        cqblend.blend_edges(body, edge, cqblend.linear(1, 60))
    assert caught.value.place is not None


def test_the_largest_size_is_a_factor_on_sizes_that_vary():
    upright = BOX.edges("|Z and >X and >Y")
    factor = cqblend.max_size(BOX, upright, radius=cqblend.linear(1, 2))
    assert factor > 9.7
    assert cqblend.blend_edges(BOX, upright, cqblend.linear(0.98 * factor, 1.96 * factor)).certificate.valid
    with pytest.raises(CqblendError):
        cqblend.blend_edges(BOX, upright, cqblend.linear(1.03 * factor, 2.06 * factor))
    assert cqblend.max_size(BOX, upright, width=(1, 2)) == pytest.approx(15, rel=0.02)
    with pytest.raises(InputError, match="by has no effect"):
        cqblend.max_size(BOX, upright, by="width", radius=LINEAR)


def test_the_fluent_method_takes_them_as_well():
    part = BOX.edges(EDGE).blend(cqblend.linear(0, 3))
    assert part.val().isValid()
    assert BOX.edges(EDGE).blend(width=(LINEAR, 2)).val().isValid()
