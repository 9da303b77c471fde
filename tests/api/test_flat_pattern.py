"""cqblend.unroll, judged by witnesses of its own: closed forms, OCCT's distances and lengths, files read back."""

import json
import math
from functools import cache

import cadquery as cq
import ezdxf
import mpmath
import numpy as np
import pytest
import shapely
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_Sewing
from OCP.gp import gp_Pln
from OCP.TopoDS import TopoDS_Face
from places import CASES
from unroll_witness import (
    area,
    bareness,
    chain_gap,
    edge_length,
    faces_of,
    facing,
    fold_error,
    is_drawn_well,
    length,
    links_are_sound,
    meshed_area,
    polygon,
    seam_gap,
    seam_mismatch,
    shared_lengths,
    strays,
)

import cqblend
from cqblend.errors import InputError, SelectionError, TopologyError, UnrollError
from cqblend.splines import Surface, hermite


def cut_off(shape, point, normal):
    """What is behind a plane."""
    return shape.cut(cq.Workplane(cq.Plane(point, normal=normal)).rect(300, 300).extrude(300).val())


def drilled_sphere():
    return cq.Solid.makeSphere(10, angleDegrees1=-90).cut(cq.Solid.makeCylinder(2, 40, cq.Vector(3, 1, -20)))


def crossed_cylinders():
    cylinder = cq.Solid.makeCylinder(5, 20)
    return cylinder.cut(cq.Solid.makeCylinder(2, 20, cq.Vector(-10, 1, 10), cq.Vector(1, 0, 0)))


def drilled_cone():
    return cq.Solid.makeCone(5, 0, 12).cut(cq.Solid.makeCylinder(1, 20, cq.Vector(-10, 0.5, 3), cq.Vector(1, 0, 0)))


def lofted():
    return cq.Workplane().circle(5).workplane(offset=8).rect(6, 6).loft().val()


def vase():
    outline = cq.Workplane().moveTo(3, 0).spline([(5, 3), (3, 6)], includeCurrent=True)
    return outline.lineTo(0, 6).lineTo(0, 0).close().revolve(240, (0, 0, 0), (0, 1, 0)).val()


def pipe():
    return cq.Workplane("XZ").circle(1).sweep(cq.Workplane().spline([(0, 0), (5, 2), (9, 8)])).val()


# Shape, tolerance, and by how much seams may be longer than the edges they stand for: where twisted strips are laid
# flat, or a border runs across strips that are off the face, the longer of both sides counts.
MODELS = {
    "box": (lambda: cq.Solid.makeBox(3, 4, 5), 0.01, 1e-12),
    "cylinder": (lambda: cq.Solid.makeCylinder(5, 20), 0.01, 1e-12),
    "oblique cylinder": (lambda: cut_off(cq.Solid.makeCylinder(5, 20), (0, 0, 12), (0.3, 0.4, 1)), 0.01, 1e-12),
    "crossed cylinders": (crossed_cylinders, 0.01, 1e-9),
    "cone": (lambda: cq.Solid.makeCone(5, 0, 12), 0.01, 1e-12),
    "frustum": (lambda: cq.Solid.makeCone(5, 3, 12), 0.01, 1e-12),
    "drilled cone": (drilled_cone, 0.01, 1e-9),
    "sphere": (lambda: cq.Solid.makeSphere(5, angleDegrees1=-90), 0.05, 0),
    "hemisphere": (lambda: cq.Solid.makeSphere(5), 0.05, 1e-12),
    "torus": (lambda: cq.Solid.makeTorus(10, 3), 0.1, 0),
    "drilled sphere": (drilled_sphere, 0.1, 1e-3),
    "quartered sphere": (lambda: drilled_sphere().cut(cq.Solid.makeBox(20, 20, 20)), 0.15, 1e-3),
    "loft": (lofted, 0.02, 1e-6),
    "moved loft": (lambda: lofted().moved(cq.Location((100, 200, -50), (1, 2, 3), 77)), 0.02, 1e-6),
    "mirrored loft": (lambda: lofted().mirror("XY"), 0.02, 1e-6),
    "vase": (vase, 0.05, 1e-3),
    "pipe": (pipe, 0.04, 1e-3),
    "rounded plate": (
        lambda: cq.Workplane().box(10, 8, 3).faces(">Z").workplane().hole(3).edges("|Z").fillet(1.5).val(),
        0.01,
        1e-12,
    ),
    "two bodies": (
        lambda: cq.Compound.makeCompound(
            [cq.Solid.makeCone(5, 0, 12), cq.Solid.makeCone(5, 0, 12).moved(cq.Location((50, 0, 0)))]
        ),
        0.01,
        1e-12,
    ),
}

every_model = pytest.mark.parametrize("name", MODELS)


@cache
def model(name):
    return MODELS[name][0]()


@cache
def unrolled(name):
    return cqblend.unroll(model(name), MODELS[name][1])


def total_length(pattern):
    return sum(length(run.path.points, run.path.bulges) for piece in pattern.strips for _, _, run in piece.runs())


@every_model
def test_pieces_are_sound(name):
    pattern = unrolled(name)
    size = model(name).BoundingBox().DiagonalLength
    assert links_are_sound(pattern)
    assert all(is_drawn_well(piece) for piece in pattern.strips)
    assert chain_gap(pattern) < 1e-12 * size
    assert fold_error(pattern) < 1e-9
    assert pattern.report.overlap == 0


@every_model
def test_both_sides_of_a_seam_have_one_length_and_one_place(name):
    pattern, tolerance = unrolled(name), MODELS[name][1]
    assert seam_mismatch(pattern) < 1e-9
    assert pattern.report.seam_mismatch < 1e-9
    assert seam_gap(pattern) <= 2 * (tolerance + pattern.report.flat)


@every_model
def test_edges_of_the_shape_are_covered_once_by_seams(name):
    pattern, shape, longer = unrolled(name), model(name), MODELS[name][2]
    records = pattern.report.pieces
    owner = {number: record.faces for record in records for number in record.faces}
    found = {}
    for seam in pattern.seams:
        pair = tuple(sorted({records[side.piece].faces for side in seam.sides}))
        if len(pair) == 2:
            path = pattern.pieces.run(seam.sides[0]).path
            found[pair] = found.get(pair, 0.0) + length(path.points, path.bulges)
    expected = shared_lengths(shape.wrapped, owner)
    assert set(found) == set(expected)
    for pair, total in expected.items():
        assert -1e-9 <= found[pair] / total - 1 <= longer + 1e-9
    assert all(run.seam is not None for piece in pattern.strips for _, _, run in piece.runs())  # all of them are closed


@every_model
def test_strips_stay_within_the_tolerance_both_ways(name):
    pattern, shape, tolerance = unrolled(name), model(name), MODELS[name][1]
    rng = np.random.default_rng(1)
    assert pattern.report.deviation <= tolerance
    assert strays(pattern, shape.wrapped, 4, rng) <= tolerance
    assert bareness(pattern, shape.wrapped, 3, rng) <= tolerance


@every_model
def test_pieces_show_their_outer_side(name):
    assert facing(unrolled(name), model(name).wrapped, np.random.default_rng(2)) > 0.7


@every_model
def test_areas_add_up(name):
    pattern, shape, tolerance = unrolled(name), model(name), MODELS[name][1]
    flat = sum(polygon(piece, 64).area for piece in pattern.strips)
    assert pattern.report.area == pytest.approx(flat, rel=1e-4)
    stretched = sum(abs(record.flat_area - record.area) for record in pattern.report.pieces)
    assert abs(flat - area(shape.wrapped)) <= tolerance * total_length(pattern) + stretched


@every_model
def test_strips_in_space_are_valid(name):
    pattern, shape, tolerance = unrolled(name), model(name), MODELS[name][1]
    strips = pattern.strips_3d()
    assert strips.isValid()
    assert len(strips.Faces()) == len(pattern.strips)
    found = meshed_area(strips, tolerance / 2)
    assert found == pytest.approx(area(shape.wrapped), abs=1.5 * tolerance * total_length(pattern))
    if len(shape.Solids()) == 1:
        assert strips.ShapeType() == "Shell"
        assert strips.Closed()


# Closed forms.


def distances(points):
    return np.linalg.norm(points[:, None] - points, axis=-1)


def test_an_oblique_cylinder_is_bounded_by_a_sine():
    pattern, radius = unrolled("oblique cylinder"), 5.0
    i = [record.kind for record in pattern.report.pieces].index("cylinder")
    (piece,) = [pattern.strips[i]]
    for _, _, run in piece.runs():
        theta = np.unwrap(np.arctan2(run.space[:, 1], run.space[:, 0]))
        expected = distances(np.column_stack([radius * theta, run.space[:, 2]]))
        assert np.abs(distances(run.path.points) - expected).max() < 1e-9
    slope = 0.5  # of the plane z = 12 - 0.3 x - 0.4 y
    ellipse = float(4 * radius * math.hypot(1, slope) * mpmath.ellipe(slope**2 / (1 + slope**2)))
    lengths = sorted(length(run.path.points, run.path.bulges) for _, _, run in piece.runs())
    generators = [12 - 0.3 * 5, 12 - 0.3 * 5]
    assert lengths == pytest.approx(sorted([*generators, 2 * math.pi * radius, ellipse]), rel=1e-9)
    assert piece.area == pytest.approx(2 * math.pi * radius * 12, rel=1e-6)


def test_a_cylinder_is_a_rectangle():
    pattern = unrolled("cylinder")
    (piece,) = [p for p, record in zip(pattern.strips, pattern.report.pieces, strict=True) if record.kind == "cylinder"]
    assert piece.area == pytest.approx(200 * math.pi, rel=1e-9)
    sides = sorted(length(run.path.points, run.path.bulges) for _, _, run in piece.runs())
    assert sides == pytest.approx([20, 20, 10 * math.pi, 10 * math.pi], rel=1e-9)


@pytest.mark.parametrize(("top", "name"), [(0, "cone"), (3, "frustum")])
def test_a_cone_is_a_sector_of_two_pi_times_the_sine(top, name):
    pattern = unrolled(name)
    (piece,) = [p for p, record in zip(pattern.strips, pattern.report.pieces, strict=True) if record.kind == "cone"]
    sine = (5 - top) / math.hypot(5 - top, 12)
    outer, inner = 5 / sine, top / sine
    assert piece.area == pytest.approx(math.pi * sine * (outer**2 - inner**2), rel=1e-9 if top == 0 else 1e-8)
    rail = max((run for _, _, run in piece.runs()), key=lambda run: run.path.length)
    assert length(rail.path.points, rail.path.bulges) == pytest.approx(10 * math.pi, rel=1e-9)
    first, last = rail.path.points[[0, -1]]
    assert np.linalg.norm(last - first) == pytest.approx(2 * outer * math.sin(math.pi * sine), rel=1e-9)


def test_a_tangent_developable_of_a_helix_keeps_lengths_and_area():
    radius, rise, near, far, end = 3.0, 1.0, 1.0, 3.0, 4.0
    t = np.linspace(0, end, 97)

    def rail(multiple):
        cycle = [np.cos(t), -np.sin(t), -np.cos(t), np.sin(t)]
        x = [radius * cycle[k % 4] for k in range(5)]
        y = [radius * cycle[(k + 3) % 4] for k in range(5)]
        z = [rise * t, np.full(len(t), rise), *[np.zeros(len(t))] * 3]
        jets = np.stack([np.stack(row, axis=-1) for row in zip(x, y, z, strict=True)])
        return hermite(t, jets[:4] + multiple * jets[1:])

    degree, knots, poles, _ = rail(near).to_bspline()
    surface = Surface.from_bspline(
        (degree, 1), (knots, [0, 0, 1, 1]), np.stack([poles, rail(far).to_bspline()[2]], axis=1)
    )
    (piece,) = cqblend.unroll(surface, 1e-3).strips
    speed = math.hypot(radius, rise)
    rails = [end * math.hypot(speed, multiple * radius) for multiple in (near, far)]
    rulings = [(far - near) * speed] * 2
    found = sorted(length(run.path.points, run.path.bulges) for _, _, run in piece.runs())
    assert found == pytest.approx(sorted([*rails, *rulings]), rel=1e-9)
    assert piece.area == pytest.approx(end * radius * speed * (far**2 - near**2) / 2, rel=1e-7)


def test_an_extruded_spline_is_a_rectangle():
    wire = cq.Workplane().spline([(9, 0), (0, 6), (-9, 0), (0, -6)], periodic=True).close()
    solid = wire.extrude(8).val()
    (face,) = [face for face in solid.Faces() if face.geomType() != "PLANE"]
    pattern = cqblend.unroll(face, 0.01)
    (piece,) = pattern.strips
    assert pattern.report.pieces[0].kind == "cylinder"
    around = max(edge_length(edge.wrapped) for edge in face.Edges())
    assert piece.area == pytest.approx(8 * around, rel=1e-9)
    found = sorted(length(run.path.points, run.path.bulges) for _, _, run in piece.runs())
    assert found == pytest.approx([8, 8, around, around], rel=1e-9)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_a_planar_face_keeps_to_its_outline_in_space(tolerance):
    disc = cq.Face.makeFromWires(cq.Wire.makeCircle(5, (0, 0, 0), (0, 0, 1)))
    pattern = cqblend.unroll(disc, tolerance)
    assert pattern.report.area == pytest.approx(25 * math.pi, abs=tolerance * 10 * math.pi)
    edges = [edge.positionAt(x).toTuple() for edge in pattern.strips_3d().Edges() for x in np.linspace(0, 1, 501)]
    assert np.abs(np.linalg.norm(edges, axis=1) - 5).max() <= tolerance


# Options.

OPTIONS = [
    {"method": "elber"},
    {"method": "curvature"},
    {"even": True},
    {"least_width": 0.05},
    {"developable": True},
    {"direction": "u"},
    {"direction": "v"},
    {"direction": "rings"},
    {"flat_tolerance": 1e-4},
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options"),
    [*[("pipe", options) for options in OPTIONS], *[("drilled sphere", OPTIONS[i]) for i in (0, 1, 4, 5)]],
    ids=str,
)
def test_every_option_makes_a_sound_pattern(name, options):
    shape, tolerance = model(name), 3 * MODELS[name][1]
    pattern = cqblend.unroll(shape, tolerance, **options)
    assert links_are_sound(pattern)
    assert all(is_drawn_well(piece) for piece in pattern.strips)
    assert seam_mismatch(pattern) < 1e-9
    assert fold_error(pattern) < 1e-9
    assert pattern.report.deviation <= tolerance
    assert strays(pattern, shape.wrapped, 1, np.random.default_rng(3)) <= tolerance + pattern.report.flat


def test_pairings_of_a_degree_beyond_floats_are_none():
    """Rails paired anew of degree above 128 have a twist of degree above 1029, whose binomials are no floats."""
    with pytest.raises(InputError, match="developable has no effect"):
        cqblend.unroll(model("pipe"), 10 * MODELS["pipe"][1], developable=True)


def test_even_strips_share_the_error():
    bounds = [record.bound for record in cqblend.unroll(model("sphere"), 0.05, even=True).report.pieces]
    usual = [record.bound for record in unrolled("sphere").report.pieces]
    assert len(bounds) == len(usual)
    assert max(bounds) - min(bounds) < max(usual) - min(usual)
    assert max(bounds) <= max(usual)


def test_the_longest_strips_are_fewer_than_elbers():
    ratio = 1.0
    for name in ("sphere", "torus"):
        ours, theirs = unrolled(name), cqblend.unroll(model(name), MODELS[name][1], method="elber")
        assert ours.report.elber == len(theirs.strips)
        ratio *= len(theirs.strips) / len(ours.strips)
    assert math.sqrt(ratio) >= 1.5


def test_progress_rises_to_the_end():
    told = []
    cqblend.unroll(model("sphere"), 0.05, progress=lambda part, what: told.append((part, what)))
    parts = [part for part, _ in told]
    assert parts == sorted(parts)
    assert parts[0] >= 0
    assert parts[-1] <= 1
    assert all(isinstance(what, str) for _, what in told)


# What is unrolled.


def bumpy():
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij")
    return Surface.from_bspline((3, 3), ([0] * 4 + [1] * 4,) * 2, np.stack([x, y, rng.normal(0, 1, (4, 4))], axis=-1))


def test_a_bare_surface_has_free_borders():
    surface = bumpy()
    pattern = cqblend.unroll(surface, 0.02)
    assert links_are_sound(pattern)
    free = [run for piece in pattern.strips for _, _, run in piece.runs() if run.seam is None]
    sides = [surface.isoparametric(**{axis: value}) for axis in "uv" for value in (0, 1)]
    around = sum(np.linalg.norm(np.diff(side(np.linspace(0, 1, 20001)), axis=0), axis=1).sum() for side in sides)
    assert sum(length(run.path.points, run.path.bulges) for run in free) == pytest.approx(around, rel=1e-6)


def test_a_bare_surface_may_have_a_pole():
    net = [[[0, 0, 0]] * 3, [[1, 0, 1], [1, 1, 1.5], [0, 1, 1]], [[2, 0, 0], [2, 2, 0], [0, 2, 0]]]
    pattern = cqblend.unroll(Surface.from_bspline((2, 2), ([0] * 3 + [1] * 3,) * 2, net), 0.02)
    assert all(is_drawn_well(piece) for piece in pattern.strips)
    assert seam_mismatch(pattern) < 1e-9


def test_chosen_faces_keep_the_seams_between_them():
    box = cq.Workplane().box(1, 2, 3)
    assert len(cqblend.unroll(box.faces(">Z or >X"), 0.1).seams) == 1
    assert len(cqblend.unroll(box.val().Faces(), 0.1).seams) == 12
    assert len(cqblend.unroll([face.copy() for face in box.val().Faces()], 0.1).seams) == 12  # joined where they touch
    assert len(cqblend.unroll(box.val().Faces()[:1] * 2, 0.1).strips) == 1
    assert len(cqblend.unroll(box, 0.1).strips) == 6


@pytest.mark.parametrize("scale", [1e-3, 1e-2, 1e4])
def test_patterns_scale(scale):
    pattern = cqblend.unroll(lofted().scale(scale), 0.02 * scale)
    usual = unrolled("loft")
    assert len(pattern.strips) == len(usual.strips)
    assert pattern.report.area == pytest.approx(usual.report.area * scale**2, rel=1e-6)
    assert seam_mismatch(pattern) < 1e-9


def test_far_from_the_origin():
    far = cqblend.unroll(lofted().moved(cq.Location((1e5, 1e5, 0))), 0.02)
    assert far.report.area == pytest.approx(unrolled("loft").report.area, rel=1e-6)
    assert seam_mismatch(far) < 1e-9


def ring(outer):
    """A ring around z = 0.7 R cos 2 phi on radius R = 10."""
    phi = np.arange(64) * np.pi / 32
    inner = 10 * np.column_stack([np.cos(phi), np.sin(phi), 0.7 * np.cos(2 * phi)])
    rails = [cq.Edge.makeSpline([cq.Vector(*p) for p in line], periodic=True) for line in (inner, outer(inner))]
    return cq.Face.makeRuledSurface(*rails)


@pytest.mark.parametrize("method", ["longest", "elber"])
@pytest.mark.parametrize(
    "outer",
    [lambda p: p * 1.3, lambda p: p * [1.3, 1.3, 1], lambda p: p * [1.3, 1.3, 1.69], lambda p: p + np.array([0, 0, 3])],
    ids=["cone", "conoid", "saddle", "cylinder"],
)
def test_a_ring_never_covers_itself(outer, method):
    face = ring(outer)
    pattern = cqblend.unroll(face, 0.05, method=method)
    assert all(is_drawn_well(piece) for piece in pattern.strips)
    assert seam_mismatch(pattern) < 1e-9
    assert pattern.report.area == pytest.approx(area(face.wrapped), rel=5e-3)


def test_the_ring_of_a_cone_of_more_than_a_full_turn_is_cut():
    assert len(cqblend.unroll(ring(lambda p: p * 1.3), 0.05).strips) > 1


# Files and shapes that come out.


def test_json_has_the_same_seams(tmp_path):
    pattern = unrolled("drilled sphere")
    data = json.loads(pattern.export(tmp_path / "pattern.json").read_text())
    assert len(data["pieces"]) == len(pattern.strips)
    worst = 0.0
    for seam in data["seams"]:
        runs = [data["pieces"][side["piece"]]["loops"][side["loop"]][side["run"]] for side in seam["sides"]]
        sizes = [length(run["path"]["points"], run["path"]["bulges"]) for run in runs]
        worst = max(worst, abs(sizes[0] - sizes[1]) / max(sizes))
    assert worst < 1e-9


@pytest.mark.parametrize("name", ["drilled sphere", "crossed cylinders", "loft"])
def test_dxf_has_the_same_outlines(tmp_path, name):
    pattern = unrolled(name)
    drawing = ezdxf.readfile(pattern.export(tmp_path / "pattern.dxf", fit=0)).modelspace()
    cuts = [entity for entity in drawing if entity.dxf.layer == "CUT"]
    assert {entity.dxftype() for entity in cuts} == {"LWPOLYLINE"}
    assert all(entity.closed for entity in cuts)
    loops = [loop for piece in pattern.strips for loop in piece.loops]
    assert len(cuts) == len(loops)
    found = []
    for entity in cuts:
        rows = np.array(entity.get_points("xyb"))
        found.append(length(np.concatenate([rows[:, :2], rows[:1, :2]]), rows[:, 2]))
    expected = [sum(length(run.path.points, run.path.bulges) for run in loop) for loop in loops]
    assert sorted(found) == pytest.approx(sorted(expected), rel=1e-9)


def test_pieces_placed_as_faces_do_not_overlap():
    pattern = unrolled("crossed cylinders")
    faces = pattern.faces()
    assert all(face.isValid() and isinstance(face, cq.Face) for face in faces)
    assert sum(area(face.wrapped) for face in faces) == pytest.approx(pattern.report.area, rel=1e-9)
    assert all(face.normalAt().z == pytest.approx(1) for face in faces)
    boxes = [shapely.box(b.xmin, b.ymin, b.xmax, b.ymax) for b in (face.BoundingBox() for face in faces)]
    assert shapely.union_all(boxes).area == pytest.approx(sum(box.area for box in boxes), rel=1e-9)


@pytest.mark.parametrize("name", ["drilled sphere", "crossed cylinders", "loft"])
def test_step_files_come_back_valid(tmp_path, name):
    pattern = unrolled(name)
    for what, shape in (("3d", pattern.strips_3d()), ("flat", cq.Compound.makeCompound(pattern.faces()))):
        path = str(tmp_path / f"{what}.step")
        cq.exporters.export(cq.Workplane(shape), path)
        back = cq.importers.importStep(path)
        (found,) = back.vals()
        assert found.isValid()
        assert len(found.Faces()) == len(pattern.strips)
        assert meshed_area(found, 0.01) == pytest.approx(meshed_area(shape, 0.01), rel=1e-4)


def test_formers_are_the_circles_between_the_strips_of_a_torus():
    formers = unrolled("torus").cross_sections()
    assert formers
    assert all(former.isValid() for former in formers)


# Errors.


@pytest.mark.parametrize("tolerance", [0, -1, math.nan, math.inf, "a", True, None, [1]], ids=repr)
def test_tolerances_that_are_none(tolerance):
    with pytest.raises(InputError, match="tolerance"):
        cqblend.unroll(cq.Solid.makeBox(1, 1, 1), tolerance)


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("method", "best"),
        ("direction", "w"),
        ("developable", 1),
        ("even", None),
        ("least_width", 0),
        ("least_width", math.nan),
        ("flat_tolerance", -1),
        ("progress", 3),
    ],
)
def test_options_that_are_none(option, value):
    with pytest.raises(InputError, match=option):
        cqblend.unroll(cq.Solid.makeBox(1, 1, 1), 0.1, **{option: value})


@pytest.mark.parametrize(
    "shape",
    [
        list,
        lambda: None,
        lambda: 42,
        lambda: "box",
        dict,
        lambda: cq.Workplane(),
        lambda: cq.Workplane().box(1, 1, 1).edges(),
        lambda: cq.Solid.makeBox(1, 1, 1).Edges(),
        lambda: cq.Solid.makeBox(1, 1, 1).Wires()[0],
        lambda: [cq.Solid.makeBox(1, 1, 1), None],
        lambda: TopoDS_Face(),
        lambda: cq.Compound.makeCompound([]),
        lambda: cq.Compound.makeCompound(cq.Solid.makeBox(1, 1, 1).Edges()),
    ],
)
def test_what_has_no_faces(shape):
    with pytest.raises((InputError, SelectionError), match=r"face|nothing"):
        cqblend.unroll(shape(), 0.1)


def test_three_faces_at_an_edge_are_refused():
    def quad(x, y):
        return cq.Face.makeFromWires(cq.Wire.makePolygon([(0, 0, 0), (x, y, 0), (x, y, 1), (0, 0, 1)], close=True))

    sewing = BRepBuilderAPI_Sewing(1e-6, True, True, True, True)
    for corner in ((1, 0), (0, 1), (-1, -1)):
        sewing.Add(quad(*corner).wrapped)
    sewing.Perform()
    book = cq.Shape.cast(sewing.SewedShape())
    with pytest.raises(TopologyError, match="faces 1, 2, 3"):
        cqblend.unroll(book, 0.1)
    assert len(cqblend.unroll(book.Faces()[:2], 0.1).seams) == 1


@pytest.mark.parametrize(
    "net", [[[[0, 0, 0]] * 2] * 2, [[[0, 0, 0], [1, 0, 0]]] * 2, [[[0, 0, 0], [1, 0, 0]], [[2, 0, 0], [3, 0, 0]]]]
)
def test_surfaces_without_area_are_refused(net):
    with pytest.raises(UnrollError, match="degenerate") as caught:
        cqblend.unroll(Surface.from_bspline((1, 1), ([0, 0, 1, 1],) * 2, net), 0.1)
    assert caught.value.pattern is None


def impossible():
    return cq.Face(BRepBuilderAPI_MakeFace(gp_Pln()).Face())


def test_one_impossible_face_leaves_the_others():
    with pytest.raises(UnrollError, match=r"face 7: .*unbounded") as caught:
        cqblend.unroll([cq.Solid.makeBox(1, 1, 1), impossible()], 0.1)
    (failure,) = caught.value.failures
    assert failure.faces == (7,)
    pattern = caught.value.pattern
    assert len(pattern.strips) == 6
    assert len(pattern.seams) == 12
    assert pattern.report.area == pytest.approx(6)


def test_narrow_strips_are_refused_by_name():
    with pytest.raises(UnrollError, match=r"face 1: .*least_width"):
        cqblend.unroll(model("sphere"), 0.05, least_width=1e3)


@pytest.mark.parametrize(
    ("strip", "points"), [(99, [0, 0]), ("a", [0, 0]), (0, [0, 0, 0]), (0, "x"), (0, []), (0, [math.nan, 0])]
)
def test_points_that_cannot_be_folded(strip, points):
    with pytest.raises(InputError):
        unrolled("box").fold(strip, points)


def test_the_same_shape_gives_the_same_numbers():
    """The input stays as it is, and nothing is drawn by lot."""
    first, second = (cqblend.unroll(model("loft"), 0.02) for _ in range(2))
    for one, other in zip(first.strips, second.strips, strict=True):
        for (_, _, a), (_, _, b) in zip(one.runs(), other.runs(), strict=True):
            assert np.array_equal(a.path.points, b.path.points)
            assert np.array_equal(a.path.bulges, b.path.bulges)


def test_a_part_from_elsewhere():
    path = CASES / "nist__nist_ctc_01_asme1_ap242-e1.stp"
    if not path.exists():
        pytest.skip("shared cases are absent")
    (solid,) = cq.importers.importStep(str(path)).val().Solids()
    pattern = cqblend.unroll(solid, 1e-3 * solid.BoundingBox().DiagonalLength)
    assert len(faces_of(solid.wrapped)) >= len(pattern.strips)
    assert seam_mismatch(pattern) < 1e-9
    assert links_are_sound(pattern)
    assert pattern.report.area == pytest.approx(area(solid.wrapped), rel=1e-5)
