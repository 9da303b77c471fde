"""Patterns that makers asked for: whole, told apart from what they cannot be, and with what they are made of named."""

import json
import math
import warnings
from functools import cache

import cadquery as cq
import ezdxf
import numpy as np
import pypdf
import pytest
from places import CASES
from unroll_witness import distance, is_drawn_well, links_are_sound, polygon, seam_gap, seam_mismatch

import cqblend
from cqblend.errors import InputError, PatternWarning, UnrollError, VerificationError
from cqblend.patterns.files import drawing
from cqblend.patterns.outline.pieces import Piece, Pieces, Run
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock import sheets
from cqblend.splines import Surface


def sheet_of(function, p, q, size=(30.0, 20.0)):
    """A polynomial patch over a rectangle, through heights at equal steps of its poles."""
    x, y = np.meshgrid(np.linspace(0, size[0], p + 1), np.linspace(0, size[1], q + 1), indexing="ij")
    knots = [0.0] * (p + 1) + [1.0] * (p + 1), [0.0] * (q + 1) + [1.0] * (q + 1)
    return Surface.from_bspline((p, q), knots, np.stack([x, y, function(x, y)], axis=-1))


@cache
def sail():
    """A cambered sail: its panels may run across or along, with a fifth of the strain in one of both."""
    rows = []
    for z in np.arange(9) / 8:
        chord, twist = 1100 * (1 - z) + 60 * z, math.radians(4 + 14 * z)
        camber = 0.10 * chord * (0.6 + z * (1 - z) * 1.6)
        row = []
        for u in np.arange(9) / 8:
            bow = 4 * camber * u * (1 - u)
            x = u * chord * math.cos(twist) - bow * math.sin(twist)
            row.append(cq.Vector(x, u * chord * math.sin(twist) + bow * (1 - 0.25 * (u - 0.4)), 2600 * z))
        rows.append(row)
    return cq.Face.makeSplineApprox(rows, tol=1e-2)


def spindle():
    """Half a tube, 300 mm long, of a radius of 1 to 1.4 mm."""
    angles = np.pi * np.arange(9) / 8
    rings = []
    for x in (0, 100, 200, 300):
        r = 1 + 0.5 * math.sin(math.pi * x / 300)
        rings.append([cq.Vector(x, r * math.cos(t), r * math.sin(t)) for t in angles])
    return cq.Face.makeSplineApprox(rings, tol=1e-3)


def faceted(count, angle):
    """A strip of planar facets, each turned against the one before by an angle; a surface of degree 1 in v."""
    turns = angle * (np.arange(count) - (count - 1) / 2)
    across = np.concatenate([[[0.0, 0.0]], np.cumsum(np.stack([np.cos(turns), np.sin(turns)], axis=1) * 1.5, axis=0)])
    poles = np.array([[[x, y, z] for y, z in across] for x in (0.0, 40.0)])
    knots = [0.0, *np.arange(count + 1.0), float(count)]
    return Surface.from_bspline((1, 1), ([0, 0, 1, 1], knots), poles)


def is_sound(pattern):
    return (
        links_are_sound(pattern)
        and all(is_drawn_well(piece) for piece in pattern.strips)
        and seam_mismatch(pattern) <= pattern.report.seam_mismatch < 1e-9
    )


# Another way where the first one fails.


@pytest.mark.skipif(not (CASES / "boat_face6.brep").exists(), reason="the face is not part of the project")
def test_a_hull_whose_rulings_meet_in_one_direction_is_divided_in_the_other():
    hull = cq.Shape.importBrep(str(CASES / "boat_face6.brep"))
    pattern = cqblend.unroll(hull, 0.5)
    assert is_sound(pattern)
    assert pattern.report.strips == 19
    (detour,) = pattern.report.detours
    assert detour.startswith("face 1: rulings along v, not rulings along u: ")
    assert "cannot be laid flat" in detour
    assert detour in " ".join(str(pattern.report).split("detour  "))
    with pytest.raises(UnrollError, match=r"face 1: .* cannot be laid flat"):
        cqblend.unroll(hull, 0.5, direction="u")


def twisted(turn):
    """A ruled strip of which one end ruling is turned about its middle, and the other not."""
    cos, sin = math.cos(turn), math.sin(turn)
    poles = np.array([[[0.0, -5, 0], [0, 5, 0]], [[6, -5 * cos, -5 * sin], [6, 5 * cos, 5 * sin]]])
    return Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), poles)


def test_narrower_strips_are_tried_where_both_directions_fail():
    surface = twisted(2.0)  # normals turn by more than a right angle along the rulings of both directions
    for direction in ("u", "v"):
        with pytest.raises(UnrollError, match="cannot be laid flat"):
            cqblend.unroll(surface, 1.0, direction=direction)
    pattern = cqblend.unroll(surface, 1.0)
    assert is_sound(pattern)
    assert pattern.report.deviation <= 1.0
    assert pattern.report.strain <= 0.01
    (detour,) = pattern.report.detours
    assert "narrower strips, not rulings along" in detour


def test_triangles_are_tried_at_last():
    surface = twisted(2.0)
    pattern = cqblend.unroll(surface, 1.0, method="elber")  # the paper's strips are not made narrower
    assert is_sound(pattern)
    assert math.isnan(pattern.report.strain)
    assert "as triangles, not rulings along" in pattern.report.detours[0]
    assert pattern.report.deviation <= 1.0


def test_of_equally_many_strips_those_with_less_strain_are_taken():
    face = sail()
    strains = {}
    for direction in ("u", "v", "auto"):
        report = cqblend.unroll(face, 5.0, direction=direction).report
        assert report.strips == 4
        strains[direction] = report.strain
    assert strains["auto"] == min(strains["u"], strains["v"]) < 0.3 * max(strains["u"], strains["v"])


# Narrow faces, and thin pieces.


@pytest.mark.parametrize("direction", ["auto", "u", "v"])
def test_a_face_narrower_than_the_tolerance_keeps_its_area(direction):
    face = spindle()
    pattern = cqblend.unroll(face, 1.6, direction=direction)
    assert is_sound(pattern)
    assert pattern.report.face_area == pytest.approx(face.Area(), rel=1e-3)
    assert pattern.report.area == pytest.approx(face.Area(), rel=0.02)
    (areas,) = pattern.report.areas
    assert (areas.faces, areas.face, areas.pieces) == ((1,), pattern.report.face_area, pattern.report.area)
    for piece in pattern.strips:  # no end is a half circle
        for _, _, run in piece.runs():
            assert run.path.length <= 1.021 * np.linalg.norm(run.path.points[-1] - run.path.points[0])


def test_strips_whose_edges_are_much_longer_are_refused():
    rod = cq.Workplane("XZ").center(6, 0).circle(1e-4).revolve(90, (-6, 0, 0), (-6, 1, 0)).val()
    with pytest.raises(UnrollError, match=r"face \d: edge \d+ is .*% longer than the strips .*smaller"):
        cqblend.unroll(rod, 5.0, direction="v")


def test_thin_pieces_are_named():
    report = cqblend.unroll(faceted(6, math.radians(3)), 0.5).report
    flat = cqblend.unroll(cq.Workplane().box(30, 20, 1.5).val(), 0.1)
    thin = {record.name for record in flat.report.pieces if record.area < 100}
    assert set(flat.report.thin) == thin
    assert len(thin) == 4
    assert f"below 2 mm: {', '.join(flat.report.thin)}" in str(flat.report)
    assert set(report.thin) == {record.name for record in report.pieces if record.width < 2}
    for piece, record in zip(flat.strips, flat.report.pieces, strict=True):
        shape = polygon(piece)
        assert record.width == pytest.approx(2 * shape.area / shape.length)


def test_thin_pieces_are_merged_where_that_keeps_the_tolerance():
    surface = faceted(8, math.radians(2))  # strips end at kinks
    options = {"direction": "v", "method": "curvature"}  # without halving across kinks
    narrow = cqblend.unroll(surface, 0.1, **options)
    assert len(narrow.strips) == 8
    assert narrow.report.unmerged == ()
    wide = cqblend.unroll(surface, 0.1, least_width=2.5, **options)
    assert is_sound(wide)
    assert wide.report.unmerged == ()
    assert len(wide.strips) <= 4
    assert all(record.width >= 2.5 for record in wide.report.pieces)
    assert wide.report.deviation <= 0.1
    exact = cqblend.unroll(surface, 1e-3, least_width=1.4, **options)
    assert len(exact.strips) == 8
    assert exact.report.deviation <= 1e-3
    kept = cqblend.unroll(cq.Workplane().box(30, 20, 1.5).val(), 0.1, least_width=5.0)
    assert len(kept.strips) == 6
    assert len(kept.report.unmerged) == 4
    assert kept.report.unmerged == kept.report.thin


def test_a_least_width_in_a_chain_and_what_is_none():
    seen = []
    cq.Workplane().box(30, 20, 1.5).unroll(0.1, least_width=5.0, report=seen.append)
    assert len(seen[0].report.unmerged) == 4
    for wrong in (0, -1, math.nan, "wide", True):
        with pytest.raises(InputError, match="least_width"):
            cqblend.unroll(cq.Workplane().box(1, 1, 1).val(), 0.1, least_width=wrong)


def test_what_is_cut_never_crosses_itself():
    bow = Path.from_points(np.array([[0.0, 0], [10, 10], [10, 0], [0, 10], [0, 0]]))
    placed = sheets.Sheets(
        (20.0, 20.0), Pieces((Piece("7", ((Run(bow, np.zeros((5, 3)), "trim"),),)),), ()), (0,), 0, 0
    )
    with pytest.raises(VerificationError, match=r"piece 7 crosses itself: .* mm2 about"):
        drawing.draw_sheets(placed, label_height=None)


# Strips in space.


@pytest.mark.parametrize("degree", [25, 26, 30])
def test_strips_of_any_degree_are_there_in_space(degree):
    surface = sheet_of(lambda x, y: 3 * np.sin(x / 8) + 2 * np.cos(y / 9), degree, 2)
    pattern = cqblend.unroll(surface, 0.2, direction="v")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        shape = pattern.strips_3d()
    assert shape.isValid()
    assert len(shape.Faces()) == len(pattern.strips)
    assert [one.category for one in told] == [PatternWarning] * (degree > 25)
    if degree > 25:
        assert "within" in str(told[0].message)
        assert told[0].filename == __file__
    t = np.linspace(*surface.domain[0], 9)
    for source in pattern._unrolled.sources:
        for point in source.unrolled_strip.rails[0](t):
            assert distance(point, shape.wrapped) < 1e-7
    assert pattern.cross_sections()


# Vertices of cuts.


@pytest.mark.parametrize("options", [{}, {"layout": "triangles"}, {"developable": True}, {"direction": "u"}], ids=str)
def test_vertices_made_by_cutting_to_the_sheet_lie_on_the_face(options, tmp_path):
    surface = sheet_of(lambda x, y: 20 * np.sin(x / 150) + 30 * np.cos(y / 120), 3, 3, size=(400.0, 300.0))
    pattern = cqblend.unroll(surface, 2.0, **options)
    before = {tuple(point) for piece in pattern.strips for _, _, run in piece.runs() for point in run.space}
    face = cqblend.to_face(surface)
    file = pattern.export(tmp_path / "p.json", sheet=(160, 120))
    made = [
        tuple(point)
        for piece in json.loads(file.read_text())["pieces"]
        for loop in piece["loops"]
        for run in loop
        for point in run["space"]
        if tuple(point) not in before
    ]
    assert len(made) > 20
    assert max(distance(point, face) for point in made[::5]) < 1e-9


# Loose faces.


def loose(shape):
    return [face.copy() for face in shape.faces().vals()]


def test_faces_that_touch_are_joined():
    box = cq.Workplane().box(60, 40, 20).edges("|Z").fillet(5)
    together, apart = cqblend.unroll(box.val(), 0.1), cqblend.unroll(loose(box), 0.1)
    assert len(together.seams) == len(apart.seams) == 24
    assert is_sound(apart)
    assert seam_gap(apart) < 1e-6
    plain = cqblend.unroll(loose(cq.Workplane().box(60, 40, 20)), 0.1)
    assert len(plain.seams) == 12
    assert all(run.seam is not None for piece in plain.strips for *_, run in piece.runs())


def test_faces_a_little_apart_are_joined_within_the_tolerance():
    faces = [
        face.moved(cq.Location((0, 0, 1e-3 * (i == 0)))) for i, face in enumerate(loose(cq.Workplane().box(9, 8, 7)))
    ]
    assert len(cqblend.unroll(faces, 0.1).seams) == 12
    assert len(cqblend.unroll(faces, 0.1, flat_tolerance=1e-4).seams) < 12


def test_borders_that_cannot_be_joined_are_counted():
    ground = cq.Face.makePlane(20, 20, (0, 0, 0), (0, 0, 1))
    walls = [
        cq.Face.makeFromWires(cq.Wire.makePolygon([(10, -10, 0), (10, 10, 0), (x, 10, z), (x, -10, z)], close=True))
        for x, z in ((10, 20), (15, -20))
    ]
    with pytest.warns(PatternWarning, match=r"1 borders of faces run along other faces"):
        pattern = cqblend.unroll([ground, *walls], 0.1)
    assert len(pattern.seams) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cqblend.unroll([ground.moved(cq.Location((0, 0, z))) for z in (0, 5)], 0.1)


# A file for each sheet.


def test_every_sheet_has_a_file_of_its_own(tmp_path):
    pattern = cqblend.unroll(cq.Workplane().box(90, 60, 40).val(), 0.1).with_tabs(5)
    size = (110.0, 120.0)
    files = {s: pattern.export(tmp_path / f"p.{s}", sheet=size, per_sheet=True) for s in ("dxf", "svg", "json")}
    count = len(files["dxf"])
    assert count > 1
    for suffix, found in files.items():
        assert [file.name for file in found] == [f"p-{k + 1}.{suffix}" for k in range(count)]
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(file.name for f in files.values() for file in f)
    names = []
    for drawn, written in zip(files["dxf"], files["json"], strict=True):
        points = [point[:2] for line in ezdxf.readfile(drawn).modelspace() for point in line.get_points()]
        assert np.min(points) >= 0
        assert (np.max(points, axis=0) <= size).all()
        record = json.loads(written.read_text())
        names += [piece["name"] for piece in record["pieces"]]
        for i, seam in enumerate(record["seams"]):
            here = [side for side in seam["sides"] if side["piece"] is not None]
            assert here
            assert all("name" in side for side in seam["sides"] if side["piece"] is None)
            for side in here:
                assert record["pieces"][side["piece"]]["loops"][side["loop"]][side["run"]]["seam"] == i
    assert sorted(names) == sorted(piece.name for piece in pattern.strips)


def test_fonts_are_embedded_and_the_legend_is_inside_the_sheet(tmp_path):
    pattern = cqblend.unroll(cq.Workplane().box(90, 60, 40).val(), 0.1)
    size = (200.0, 150.0)
    plots = pattern.export(tmp_path / "p.pdf", sheet=size, per_sheet=True, page=None)
    pages = [page for file in (*plots, pattern.export(tmp_path / "a.pdf")) for page in pypdf.PdfReader(file).pages]
    for page in pages:
        fonts = page["/Resources"].get("/Font", {}).values()
        assert fonts
        for font in fonts:
            assert "/FontFile2" in font.get_object()["/FontDescriptor"].get_object()
        assert "fold: valley" in page.extract_text()
    for page in pages[: len(plots)]:
        assert [float(side) * 25.4 / 72 for side in page.mediabox[2:]] == pytest.approx(size, abs=1e-3)
