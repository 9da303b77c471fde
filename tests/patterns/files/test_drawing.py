"""What drawings consist of: closed outlines, each once, in order; kerf; labels; scores."""

from dataclasses import replace

import numpy as np
import pieces_cases as cases
import pytest
import shapely

from cqblend.errors import InputError, SizeError
from cqblend.patterns.files.drawing import STYLES, Layer, draw_sheets, join_drawings
from cqblend.patterns.files.page_dimensions import DRAWING_LAYOUT
from cqblend.patterns.outline.pieces import Piece, Pieces, Run
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.kerf import compensate_kerf
from cqblend.patterns.stock.sheets import arrange_pieces
from cqblend.patterns.stock.tab_options import TabOptions
from cqblend.patterns.stock.tabs import fit_tabs

ALL = [cases.box, cases.cylinder, cases.tower, cases.frustum, cases.cone, cases.gores]


def polygon(path, tolerance=1e-4):
    return shapely.Polygon(path.sampled(tolerance))


@pytest.mark.parametrize("case", ALL)
def test_each_outline_is_cut_once_holes_first(case):
    pieces = case()
    sheets = arrange_pieces(pieces)
    (drawing,) = draw_sheets(sheets)
    cuts = drawing.paths_on(Layer.CUT)
    assert len(cuts) == sum(len(piece.loops) for piece in pieces.pieces)
    assert all(path.closed for path in cuts)
    area = sum(piece.area for piece in pieces.pieces)
    assert sum(path.area for path in cuts) == pytest.approx(
        area, abs=DRAWING_LAYOUT.arc_tolerance * sum(path.length for path in cuts) / 2
    )
    (exact,) = draw_sheets(sheets, arc_tolerance=0.0, label_height=None)
    assert sum(path.area for path in exact.paths_on(Layer.CUT)) == pytest.approx(area, rel=1e-9)
    assert [path.area > 0 for path in cuts] == [
        k == 0 for piece in pieces.pieces for k in range(len(piece.loops))[::-1]
    ]
    middles = [tuple(np.round(path.points.mean(axis=0), 6)) for path in cuts]
    assert len(set(middles)) == len(middles)
    assert all((path.points >= 0).all() and (path.points <= drawing.size).all() for path in cuts)


@pytest.mark.parametrize("case", ALL)
def test_kerf_moves_outlines_away_from_the_piece_and_keeps_the_twin(case):
    pieces, kerf = case(), 0.4
    (drawing,) = draw_sheets(arrange_pieces(pieces), kerf=kerf)
    cuts, twins = drawing.paths_on(Layer.CUT), drawing.paths_on(Layer.GUIDE)
    assert len(cuts) == len(twins)
    outer = [path for path in twins if path.area > 0]
    for path in cuts:
        assert path.closed
        lines = shapely.MultiLineString([twin.sampled(1e-4) for twin in twins])
        samples = path.sampled(1e-4)
        distance = shapely.distance(shapely.points(samples), lines)
        assert np.abs(distance - kerf / 2).max() < 3e-3
        inside = shapely.contains_xy(shapely.unary_union([polygon(one) for one in outer]), *samples.T)
        assert inside.all() == (path.area < 0)
        assert inside.any() == (path.area < 0)


def test_kerf_keeps_arcs():
    (drawing,) = draw_sheets(arrange_pieces(cases.cone()), kerf=0.2)
    disc = min(drawing.paths_on(Layer.CUT), key=lambda path: path.length)
    assert len(disc.bulges) <= 3
    assert disc.area == pytest.approx(np.pi * 20.1**2, rel=1e-4)


def test_holes_keep_their_order_and_narrow_ones_are_refused():
    plate = Path.from_points([[0, 0], [40, 0], [40, 10], [0, 10], [0, 0]])
    holes = [cases.circle(r, (x, 5.0), clockwise=True) for r, x in ((1.0, 5.0), (3.0, 15.0), (2.0, 30.0))]
    lines = compensate_kerf([plate, *holes], 0.2, 1e-3, name="1")
    assert [line.area for line in lines[1:]] == pytest.approx([-np.pi * (r - 0.1) ** 2 for r in (1, 3, 2)], rel=1e-3)
    with pytest.raises(SizeError, match="piece 7 has a hole or a slit that is narrower than the kerf of 2 mm"):
        compensate_kerf([plate, *holes], 2.0, 1e-3, name="7")


def test_labels_are_on_both_sides_of_each_seam():
    pieces = cases.box()
    (drawing,) = draw_sheets(arrange_pieces(pieces))
    (plain,) = draw_sheets(arrange_pieces(pieces), label_height=None)
    assert drawing.notes == ()
    assert drawing.paths_on(Layer.ENGRAVE)
    assert not plain.paths_on(Layer.ENGRAVE)
    inside = shapely.unary_union([polygon(path) for path in drawing.paths_on(Layer.CUT)])
    assert all(inside.contains(shapely.linestrings(path.points)) for path in drawing.paths_on(Layer.ENGRAVE))


def test_labels_without_room_are_noted_and_written_above():
    pieces = cases.box(40.0, 40.0, 1.0)
    (drawing,) = draw_sheets(arrange_pieces(pieces))
    assert drawing.notes
    page = join_drawings([drawing])
    assert page.size[1] > drawing.size[1]
    highest = max(path.points[:, 1].max() for path in page.paths_on(Layer.GUIDE))
    assert drawing.size[1] < highest <= page.size[1]


def test_scores_of_tabs_are_on_their_layers():
    pieces = fit_tabs(cases.valley(), TabOptions(width=5.0)).pieces
    (drawing,) = draw_sheets(arrange_pieces(pieces))
    scores = [score for piece in pieces.pieces for score in piece.scores]
    assert scores
    drawn = len(drawing.paths_on(Layer.SCORE_MOUNTAIN)) + len(drawing.paths_on(Layer.SCORE_VALLEY))
    assert drawn == len(scores)
    cut = sum(path.area for path in drawing.paths_on(Layer.CUT))
    assert cut == pytest.approx(sum(path.area for piece in pieces.pieces for path in piece.cuts), rel=1e-4)


def test_flattened_rails_become_few_arcs_and_keep_their_length():
    angle = np.linspace(0, 1.5, 301)
    inner, outer = (r * np.column_stack([np.cos(angle), 0.8 * np.sin(angle)]) for r in (60.0, 80.0))
    corners = [outer, [outer[-1], inner[-1]], inner[::-1], [inner[0], outer[0]]]
    runs = tuple(Run(Path.from_points(c), np.zeros((len(c), 3)), "rail") for c in corners)
    pieces = Pieces((Piece("1", (runs,)),), ())
    (few,) = draw_sheets(arrange_pieces(pieces))
    (all_,) = draw_sheets(arrange_pieces(pieces), arc_tolerance=0.0)
    assert len(all_.paths_on(Layer.CUT)[0].bulges) == 602
    assert len(few.paths_on(Layer.CUT)[0].bulges) < 20
    assert few.stretch < 1e-6
    assert few.paths_on(Layer.CUT)[0].area == pytest.approx(pieces.pieces[0].area, rel=1e-5)


def test_sheets_beside_each_other_are_framed():
    drawings = draw_sheets(arrange_pieces(cases.box(), (100.0, 60.0)))
    assert len(drawings) == 3
    page = join_drawings(drawings)
    assert page.size == (3 * 100.0 + 2 * 10.0, 60.0)
    assert len(page.paths_on(Layer.GUIDE)) == 3
    assert len(page.paths_on(Layer.CUT)) == 6


def test_bad_lengths_are_refused():
    sheets = arrange_pieces(cases.box())
    for wrong in ({"kerf": -0.1}, {"kerf": np.nan}, {"arc_tolerance": -1.0}, {"label_height": 0.0}):
        with pytest.raises(InputError):
            draw_sheets(sheets, **wrong)


def test_every_layer_has_a_style():
    assert set(STYLES) == set(Layer)


def test_kerfs_that_close_slits_and_notches_are_refused():
    slit = Path.from_points(
        [[0, 0], [40, 0], [40, 20], [20.05, 20], [20.05, 5], [19.95, 5], [19.95, 20], [0, 20], [0, 0]]
    )
    (line,) = compensate_kerf([slit], 0.05, 1e-3, name="1")
    assert line.length == pytest.approx(slit.length, abs=0.3)
    wedge = Path.from_points([[0, 0], [40, 0], [40, 20], [20.3, 20], [20, 8], [19.7, 20], [0, 20], [0, 0]])
    for outline in (slit, wedge):
        for kerf in (0.2, 1.0, 3.0, 50.0):
            with pytest.raises(SizeError, match=r"piece 4 has a hole or a slit .* lower the kerf, or .* direction="):
                compensate_kerf([outline], kerf, 1e-3, name="4")
    hole = Path.from_points([[19.9, 5], [19.9, 15], [20.1, 15], [20.1, 5], [19.9, 5]])
    plate = Path.from_points([[0, 0], [40, 0], [40, 20], [0, 20], [0, 0]])
    for kerf in (0.3, 3.0, 50.0):
        with pytest.raises(SizeError):
            compensate_kerf([plate, hole], kerf, 1e-3, name="4")


@pytest.mark.parametrize("kerf", [0.1, 0.5, 1.0, 3.0, 6.0])
def test_kerf_goes_round_right_corners(kerf):
    corner = Path.from_points([[0, 0], [40, 0], [40, 20], [20, 20], [20, 40], [0, 40], [0, 0]])
    (line,) = compensate_kerf([corner], kerf, 1e-3, name="1")
    # five corners are gone round; at the inner one both lines meet
    exact = corner.area + corner.length * kerf / 2 + (5 * np.pi / 4 - 1) * kerf**2 / 4
    assert line.area == pytest.approx(exact, abs=1e-3 * line.length)


def test_notes_fit_the_drawing_and_name_the_piece():
    pieces = cases.box(40.0, 40.0, 1.0)
    (drawing,) = draw_sheets(arrange_pieces(pieces))
    assert any(f"{piece.name} (name)" in note for piece in pieces.pieces for note in drawing.notes)
    narrow = replace(drawing, size=(10.0, drawing.size[1]), notes=("a rather long note, " * 5,))
    page = join_drawings([narrow])
    strokes = [path for path in page.paths_on(Layer.GUIDE) if path.points[:, 1].min() > drawing.size[1]]
    assert 200.0 < max(path.points[:, 0].max() for path in strokes) <= page.size[0]
