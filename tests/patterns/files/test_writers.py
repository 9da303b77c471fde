"""Every file is read back by other code than wrote it: closed loops, none twice, true size, areas, labels."""

import json
import re
import xml.etree.ElementTree as ET
from collections import Counter

import cadquery
import ezdxf
import numpy as np
import pieces_cases as cases
import pypdf
import pytest
import shapely

import cqblend
from cqblend.errors import InputError
from cqblend.patterns.files.drawing import Layer, draw_sheets, join_drawings
from cqblend.patterns.files.page_dimensions import DRAWING_LAYOUT
from cqblend.patterns.files.pattern_files import ExportOptions, export_sheets
from cqblend.patterns.files.pdf_file import PAPERS, write_pdf
from cqblend.patterns.outline.pieces import Piece, Pieces, Run
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.labels import make_label_strokes
from cqblend.patterns.stock.sheets import arrange_pieces
from cqblend.patterns.stock.split_pieces import split_to_fit

ALL = [cases.box, cases.cylinder, cases.tower, cases.frustum, cases.cone, cases.gores]
POINT = 25.4 / 72
PRINTABLE_A4 = (190.0, 261.0)  # less margins and footer


def arc_points(a, b, bulge, count=400):
    """Points of an arc from its ends and its bulge, by its centre."""
    a, b = complex(*a), complex(*b)
    if abs(bulge) < 1e-12:
        return np.array([a])
    angle = 4 * np.arctan(bulge)
    centre = (a - b * np.exp(-1j * angle)) / (1 - np.exp(-1j * angle))
    return centre + (a - centre) * np.exp(1j * angle * np.arange(count) / count)


def area(loop):
    """Area of a polygon of complex points."""
    return float((np.conj(loop) * np.roll(loop, -1)).imag.sum() / 2)


def from_dxf(file):
    """Layers to loops and lines (closed, complex points)."""
    document = ezdxf.readfile(file)
    assert not document.audit().has_errors
    assert (document.dxfversion, document.header["$INSUNITS"]) == ("AC1024", 4)
    found = {}
    for entity in document.modelspace():
        assert entity.dxftype() == "LWPOLYLINE"
        assert document.layers.has_entry(entity.dxf.layer)
        points = [(x, y, bulge) for x, y, bulge in entity.get_points("xyb")]
        following = points[1:] + points[:1] if entity.closed else points[1:]
        curve = [arc_points(p[:2], q[:2], p[2]) for p, q in zip(points, following, strict=False)]
        if not entity.closed:
            curve.append(np.array([complex(*points[-1][:2])]))
        found.setdefault(entity.dxf.layer, []).append((entity.closed, np.concatenate(curve)))
    return found


def svg_arc(a, b, radius, large, sweep, count=400):
    """Points of an SVG arc, by the construction of the recommendation (F.6.5)."""
    half = abs(b - a) / 2
    radius = max(radius, half)
    offset = np.sqrt(max(radius**2 - half**2, 0.0)) * (1 if large == sweep else -1)
    # y points down: a positive sweep runs clockwise on the screen, which is with increasing angle here
    centre = (a + b) / 2 + offset * -1j * (b - a) / abs(b - a)
    start, stop = np.angle(a - centre), np.angle(b - centre)
    turn = (stop - start) % (2 * np.pi) if sweep else -((start - stop) % (2 * np.pi))
    assert (abs(turn) > np.pi + 1e-6) == bool(large) or abs(abs(turn) - np.pi) < 1e-3
    return centre + radius * np.exp(1j * (start + turn * np.arange(count) / count))


def from_svg(file):
    """Layers to loops and lines (closed, complex points, y up), and the size."""
    root = ET.parse(file).getroot()
    ns = "{http://www.w3.org/2000/svg}"
    assert root.tag == ns + "svg"
    width, height = (float(re.fullmatch(r"([\d.]+)mm", root.get(side))[1]) for side in ("width", "height"))
    assert [float(x) for x in root.get("viewBox").split()] == [0, 0, width, height]
    found = {}
    for group in root:
        for element in group:
            assert element.tag == ns + "path"
            tokens = re.findall(r"[MLAZ]|-?[\d.]+", element.get("d"))
            at, curve, closed = None, [], False
            while tokens:
                command = tokens.pop(0)
                if command == "Z":
                    closed = True
                    continue
                values = [float(tokens.pop(0)) for _ in range(7 if command == "A" else 2)]
                to = complex(*values[-2:])
                if command == "L":
                    curve.append(np.array([at]))
                elif command == "A":
                    curve.append(svg_arc(at, to, values[0], bool(values[3]), bool(values[4])))
                at = to
            if not closed or abs(at - curve[0][0]) > 1e-6:
                curve.append(np.array([at]))
            points = np.concatenate(curve)
            found.setdefault(group.get("id"), []).append((closed, points.real + 1j * (height - points.imag)))
    return found, (width, height)


def from_pdf(page):
    """Strokes of a page: (colour, dashes, closed, complex points in mm from its lower left corner)."""
    matrix, stack, found = np.eye(3), [], []
    colour, dashes, pieces, at = None, None, [], None

    def place(x, y):
        return complex(*(np.array([x, y, 1.0]) @ matrix)[:2]) * POINT

    content = pypdf.generic.ContentStream(page["/Contents"].get_object(), page.pdf)
    for values, operator in content.operations:
        v = [float(x) for x in values if isinstance(x, (int, float, pypdf.generic.FloatObject))]
        if operator == b"cm":
            matrix = np.array([[v[0], v[1], 0], [v[2], v[3], 0], [v[4], v[5], 1]]) @ matrix
        elif operator == b"q":
            stack.append((matrix, colour, dashes))
        elif operator == b"Q":
            matrix, colour, dashes = stack.pop()
        elif operator == b"RG":
            colour = tuple(round(255 * x) for x in v)
        elif operator == b"d":
            dashes = tuple(float(x) for x in values[0])
        elif operator == b"m":
            at = place(*v)
            pieces.append([False, [at]])
        elif operator == b"l":
            at = place(*v)
            pieces[-1][1].append(at)
        elif operator == b"c":
            b, c, d = place(*v[:2]), place(*v[2:4]), place(*v[4:])
            t = np.linspace(0, 1, 65)[1:]
            s = 1 - t
            pieces[-1][1].extend(s**3 * at + 3 * s * s * t * b + 3 * s * t * t * c + t**3 * d)
            at = d
        elif operator == b"h":
            pieces[-1][0] = True
        elif operator in (b"S", b"s"):
            found.extend((colour, dashes, closed, np.array(points)) for closed, points in pieces)
            pieces = []
        elif operator == b"n":
            pieces = []
    return found


def expected(pieces):
    return sorted(path.area for piece in pieces.pieces for path in piece.outlines)


def same_areas(loops, pieces, fit=DRAWING_LAYOUT.arc_tolerance):
    areas = sorted(area(points) for _, points in loops)
    length = max(run.path.length for piece in pieces.pieces for *_, run in piece.runs()) * 4
    assert np.allclose(areas, expected(pieces), rtol=1e-4, atol=fit * length)


def none_twice(loops):
    keys = [
        tuple(sorted((round(p.real, 3), round(p.imag, 3)) for p in points[:: max(len(points) // 7, 1)]))
        for _, points in loops
    ]
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize("case", ALL)
def test_dxf_and_svg(case, tmp_path):
    pieces = case()
    sheets = arrange_pieces(pieces)
    dxf = from_dxf(export_sheets(sheets, tmp_path / "a.dxf"))
    svg, size = from_svg(export_sheets(sheets, tmp_path / "a.svg"))
    assert size == pytest.approx(sheets.size, abs=1e-8)
    for found in (dxf, svg):
        loops = found["CUT"]
        assert all(closed for closed, _ in loops)
        same_areas(loops, pieces)
        none_twice([one for layer in found.values() for one in layer])
        points = np.concatenate([points for _, points in loops])
        low = sheets.margin
        assert points.real.min() >= low - 1e-2
        assert points.imag.min() >= low - 1e-2
        assert points.real.max() <= sheets.size[0] - low + 1e-2
        assert points.imag.max() <= sheets.size[1] - low + 1e-2
    assert {k: len(v) for k, v in dxf.items()} == {k: len(v) for k, v in svg.items()}
    for layer in dxf:
        for (closed, a), (closed2, b) in zip(dxf[layer], svg[layer], strict=True):
            assert closed == closed2
            assert abs(a[0] - b[0]) < 1e-6
            assert area(a) == pytest.approx(area(b), rel=1e-5, abs=1e-3)


def test_true_size(tmp_path):
    sheets = arrange_pieces(cases.box(40.0, 30.0, 20.0))
    lengths = Counter({40.0: 8, 30.0: 8, 20.0: 8})
    dxf = from_dxf(export_sheets(sheets, tmp_path / "a.dxf"))["CUT"]
    svg = from_svg(export_sheets(sheets, tmp_path / "a.svg"))[0]["CUT"]
    pages = pypdf.PdfReader(export_sheets(sheets, tmp_path / "a.pdf", ExportOptions(page="a3"))).pages
    pdf = [
        (c, p[:-1] if p[0] == p[-1] else p) for page in pages for k, _, c, p in from_pdf(page) if k == (255, 0, 0) and c
    ]
    for loops, digits in ((dxf, 9), (svg, 7), (pdf, 4)):
        sides = [abs(d) for _, points in loops for d in np.roll(points, -1) - points]
        assert Counter(round(float(side), digits) for side in sides) == lengths


def signature(strokes):
    """Lengths of strokes, relative to the longest: the same for a label of any size at any place."""
    lengths = sorted(
        float(np.abs(np.diff(np.append(points, points[0]) if closed else points)).sum()) for closed, points in strokes
    )
    return tuple(round(length / lengths[-1], 3) for length in lengths)


def clusters(strokes, distance):
    """Strokes whose distance is below a limit, together."""
    lines = [shapely.linestrings(np.column_stack([points.real, points.imag])) for _, points in strokes]
    groups = shapely.get_parts(shapely.union_all(shapely.buffer(lines, distance / 2)))
    return [[one for one, line in zip(strokes, lines, strict=True) if group.intersects(line)] for group in groups]


def test_labels_are_twice_per_seam(tmp_path):
    sheets = arrange_pieces(cases.box())
    layers = from_dxf(export_sheets(sheets, tmp_path / "a.dxf"))
    texts = [seam.label for seam in sheets.pieces.seams for _ in range(2)] + [p.name for p in sheets.pieces.pieces]
    wanted = Counter()
    for text in texts:
        paths = make_label_strokes(text, 4.0)
        wanted[signature([(path.closed, (path.points @ [1, 1j])) for path in paths])] += 1
    assert Counter(map(signature, clusters(layers["ENGRAVE"], 1.7))) == wanted
    assert len(texts) == 2 * 12 + 6
    # each inside its piece
    pieces = [shapely.Polygon(np.column_stack([p.real, p.imag])) for _, p in layers["CUT"]]
    for _, points in layers["ENGRAVE"]:
        line = shapely.linestrings(np.column_stack([points.real, points.imag]))
        assert sum(piece.contains(line) for piece in pieces) == 1
    assert "ENGRAVE" not in from_dxf(export_sheets(sheets, tmp_path / "b.dxf", ExportOptions(label_height=None)))


def test_pdf_pages_have_true_size_and_say_where_they_belong(tmp_path):
    sheets = arrange_pieces(cases.cylinder(60.0, 200.0))
    (drawing,) = draw_sheets(sheets)
    file = export_sheets(sheets, tmp_path / "a.pdf", ExportOptions(page="a4"))
    reader = pypdf.PdfReader(file)
    tile = np.array(PRINTABLE_A4)
    texts = [page.extract_text() for page in reader.pages]
    rows, columns = (int(x) for x in re.search(r"row \d+ of (\d+), column \d+ of (\d+)", texts[0]).groups())
    assert 1 < len(reader.pages) <= rows * columns
    total = 0.0
    for page, text in zip(reader.pages, texts, strict=True):
        size = np.array([float(page.mediabox.width), float(page.mediabox.height)]) * POINT
        landscape = size[0] > size[1]
        assert np.allclose(size, PAPERS["a4"][:: -1 if landscape else 1], atol=1e-3)
        assert "100 mm" in text
        for word in ("cut", "mountain", "valley", "engrave", "guide"):
            assert word in text
        strokes = from_pdf(page)
        black = [points for colour, dashes, _, points in strokes if colour == (0, 0, 0) and not dashes]
        spans = np.array([abs(points[-1] - points[0]) for points in black if len(points) == 2])
        assert np.isclose(spans, 100.0, atol=1e-4).sum() == 1
        assert np.isclose(spans, 8.0, atol=1e-4).sum() >= 8  # two strokes for each of four crosses
        assert {dashes for _, dashes, _, _ in strokes} >= {(3.0, 1.5), (3.0, 1.0, 0.3, 1.0)}
        # put back to where the tile is, every page draws the same outline
        row, column = (int(x) for x in re.search(r"row (\d+) of \d+, column (\d+)", text).groups())
        tile = size - [20.0, 20.0 + 16.0]
        shift = (column - 1) * tile[0] + 1j * (rows - row) * tile[1] - (10.0 + 26.0j)
        for colour, _, closed, points in strokes:
            if colour == (255, 0, 0) and closed:
                places = points + shift
                ends = np.concatenate([path.points for path in drawing.paths_on(Layer.CUT)]) @ [1, 1j]
                assert np.abs(places[0] - ends).min() < 1e-3
        total = max(total, max(abs(area(p)) for colour, _, closed, p in strokes if closed and colour == (255, 0, 0)))
    assert total == pytest.approx(2 * np.pi * 60 * 200, rel=1e-4)


def test_a_sheet_that_fits_a_page_is_not_tiled(tmp_path):
    sheets = arrange_pieces(cases.gores(), PRINTABLE_A4)
    reader = pypdf.PdfReader(export_sheets(sheets, tmp_path / "a.pdf"))
    assert len(reader.pages) == sheets.count
    assert "row" not in reader.pages[0].extract_text()
    loops = [(c, p) for page in reader.pages for k, _, c, p in from_pdf(page) if k == (255, 0, 0) and c]
    same_areas(loops, sheets.pieces)
    plotter = pypdf.PdfReader(export_sheets(sheets, tmp_path / "b.pdf", ExportOptions(page=None))).pages[0]
    assert float(plotter.mediabox.width) * POINT == pytest.approx(sheets.size[0] + 20.0, abs=1e-3)


def test_labels_without_room_are_listed_on_a_page(tmp_path):
    sheets = arrange_pieces(cases.box(40.0, 40.0, 1.0))
    (drawing,) = draw_sheets(sheets)
    text = pypdf.PdfReader(export_sheets(sheets, tmp_path / "a.pdf")).pages[-1].extract_text()
    assert drawing.notes
    assert all(note in text for note in drawing.notes)


@pytest.mark.parametrize("case", ALL)
def test_json_holds_everything(case, tmp_path):
    pieces = split_to_fit(case(), (70.0, 60.0))
    sheets = arrange_pieces(pieces, (80.0, 70.0))
    file = export_sheets(
        sheets, tmp_path / "a.json", ExportOptions(report={"area": np.float64(2.0), "worst": np.nan, "list": (1, 2)})
    )
    found = json.loads(file.read_text(encoding="utf-8"), parse_constant=lambda name: pytest.fail(name))
    assert found["schema"] == "cqblend.pattern/1"
    assert found["report"] == {"area": 2.0, "worst": None, "list": [1, 2]}
    assert found["sheet"]["size"] == [80.0, 70.0]
    for piece, told in zip(sheets.pieces.pieces, found["pieces"], strict=True):
        assert told["name"] == piece.name
        whole = 0.0
        for loop, runs in zip(piece.loops, told["loops"], strict=True):
            points = []
            for run, one in zip(loop, runs, strict=True):
                path = one["path"]
                assert path["points"] == run.path.points.tolist()
                assert len(one["space"]) == len(path["points"]) == len(path["bulges"]) + 1
                for p, q, bulge in zip(path["points"], path["points"][1:], path["bulges"], strict=False):
                    points.append(arc_points(p, q, bulge))
                    chord = np.hypot(q[0] - p[0], q[1] - p[1])
                    assert chord <= one["length"] + 1e-9
            whole += area(np.concatenate(points))
        assert whole == pytest.approx(told["area"], rel=1e-4)
    for index, seam in enumerate(found["seams"]):
        for side in seam["sides"]:
            run = found["pieces"][side["piece"]]["loops"][side["loop"]][side["run"]]
            assert run["seam"] == index
            assert run["length"] == pytest.approx(seam["length"], rel=1e-9)
    assert len({seam["label"] for seam in found["seams"]}) == len(found["seams"])


def test_kerf_has_its_twin_in_every_drawing(tmp_path):
    sheets = arrange_pieces(cases.tower())
    for found in (
        from_dxf(export_sheets(sheets, tmp_path / "a.dxf", ExportOptions(kerf=0.3))),
        from_svg(export_sheets(sheets, tmp_path / "a.svg", ExportOptions(kerf=0.3)))[0],
    ):
        same_areas(found["GUIDE"], sheets.pieces)
        assert sum(area(p) for _, p in found["CUT"]) > sum(area(p) for _, p in found["GUIDE"])


def test_the_same_pattern_gives_the_same_files(tmp_path):
    sheets = arrange_pieces(cases.cone())
    for suffix in ("dxf", "svg", "pdf", "json"):
        first, second = (export_sheets(sheets, tmp_path / f"{k}.{suffix}").read_bytes() for k in "ab")
        assert first == second


def test_arcs_beyond_half_a_turn(tmp_path):
    wide = Path(np.array([[10.0, 0.0], [0.0, -10.0], [10.0, 0.0]]), np.array([np.tan(3 * np.pi / 8), 0.0]))
    sheets = arrange_pieces(Pieces((Piece("1", ((Run(wide, np.zeros((3, 3)), "trim"),),)),), ()))
    three_quarters = 100 * np.pi * 3 / 4 + 50
    for found in (
        from_dxf(export_sheets(sheets, tmp_path / "a.dxf")),
        from_svg(export_sheets(sheets, tmp_path / "a.svg"))[0],
    ):
        assert area(found["CUT"][0][1]) == pytest.approx(three_quarters, rel=1e-4)


def test_files_are_whole_or_not_there(tmp_path, monkeypatch):
    sheets = arrange_pieces(cases.box())
    target = tmp_path / "a.svg"
    export_sheets(sheets, target)
    before = target.read_bytes()
    monkeypatch.setattr(
        "cqblend.patterns.files.pattern_files.write_svg", lambda drawing, path: path.write_text("x") and 1 / 0
    )
    with pytest.raises(ZeroDivisionError):
        export_sheets(sheets, target)
    assert target.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["a.svg"]


def test_what_cannot_be_written_is_refused(tmp_path):
    sheets = arrange_pieces(cases.box())
    with pytest.raises(InputError, match=r"\.dxf, \.svg, \.pdf, \.json, not to 'a.png'"):
        export_sheets(sheets, tmp_path / "a.png")
    with pytest.raises(InputError, match="does not exist: make it first"):
        export_sheets(sheets, tmp_path / "none" / "a.dxf")
    with pytest.raises(InputError, match="paper is one of a0"):
        export_sheets(sheets, tmp_path / "a.pdf", ExportOptions(page="a9"))
    with pytest.raises(InputError, match="too small"):
        write_pdf(draw_sheets(sheets), tmp_path / "a.pdf", page=(100.0, 100.0))
    with pytest.raises(InputError):
        export_sheets(sheets, 5)
    assert not list(tmp_path.iterdir())


def test_several_sheets_are_beside_each_other(tmp_path):
    sheets = arrange_pieces(cases.box(), (100.0, 60.0))
    found, size = from_svg(export_sheets(sheets, tmp_path / "a.svg"))
    assert size == pytest.approx(join_drawings(draw_sheets(sheets)).size)
    assert len(found["GUIDE"]) == sheets.count == 3
    same_areas(found["CUT"], sheets.pieces)
    assert len(pypdf.PdfReader(export_sheets(sheets, tmp_path / "a.pdf")).pages) == 3


def test_patterns_keep_their_gap_beside_the_kerf(tmp_path):
    pattern = cqblend.unroll(cadquery.Workplane().box(30, 20, 10), 0.1)
    for gap, kerf in ((0.0, 3.0), (2.0, 1.0)):
        file = pattern.export(tmp_path / "a.dxf", gap=gap, kerf=kerf, margin=4.0, labels=None)
        cuts = [shapely.Polygon(np.column_stack([p.real, p.imag])) for _, p in from_dxf(file)["CUT"]]
        assert len(cuts) == 6
        for k, cut in enumerate(cuts):
            assert all(cut.distance(other) > gap - 5e-3 for other in cuts[:k])
            assert all(cut.intersection(other).area < 0.05 for other in cuts[:k])
            assert min(cut.bounds) > 4.0 - 5e-3


@pytest.mark.parametrize("suffix", ["dxf", "svg", "pdf", "json"])
@pytest.mark.parametrize(
    "wrong", [{"page": "b9"}, {"page": (0, 1)}, {"seconds": -1}, {"seconds": "1"}, {"kerf": "1"}, {"gap": None}]
)
def test_patterns_check_all_numbers_whatever_the_format(tmp_path, suffix, wrong):
    pattern = cqblend.unroll(cadquery.Workplane().box(30, 20, 10), 0.1)
    with pytest.raises(InputError):
        pattern.export(tmp_path / f"a.{suffix}", **wrong)
    assert not list(tmp_path.iterdir())
