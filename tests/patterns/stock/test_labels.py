"""Labels stay inside their piece and apart; those that do not fit have no strokes."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from pieces_cases import box, cone, cylinder, frustum, gores, lattice, tower

from cqblend.errors import InputError
from cqblend.patterns.outline.pieces import Piece, Pieces, Run
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.labels import is_underlined, make_label_strokes, place_labels
from cqblend.patterns.stock.stroke_font import make_text_strokes, measure_text_width

MODELS = [box, cylinder, tower, frustum, cone, gores]


def polygon(piece: Piece) -> shapely.Polygon:
    shell, *holes = (path.sampled(1e-4) for path in piece.outlines)
    return shapely.make_valid(shapely.Polygon(shell, holes))


def hull(label) -> shapely.Geometry:
    return shapely.MultiPoint(np.concatenate([path.points for path in label.strokes])).convex_hull


def all_labels(pieces: Pieces, **options):
    return [place_labels(piece, pieces.seams, **options) for piece in pieces.pieces]


@pytest.mark.parametrize("model", MODELS)
def test_labels_are_inside_apart_and_complete(model):
    pieces = model()
    for piece, found in zip(pieces.pieces, all_labels(pieces, height=3.0), strict=True):
        assert found[0].text == piece.name
        assert found[0].seam is None
        wanted = [run.seam for *_, run in piece.runs() if run.seam is not None]
        assert [label.seam for label in found[1:]] == wanted
        assert [label.text for label in found[1:]] == [pieces.seams[k].label for k in wanted]
        assert all(label.is_engraved for label in found)
        hulls = [hull(label) for label in found]
        room = polygon(piece)
        assert all(room.contains(shape) for shape in hulls)
        for i, shape in enumerate(hulls):
            assert all(shape.disjoint(other) for other in hulls[:i])


@pytest.mark.parametrize("model", MODELS)
def test_a_seam_label_stands_on_its_run(model):
    pieces = model()
    for piece, found in zip(pieces.pieces, all_labels(pieces, height=2.0), strict=True):
        runs = [run for *_, run in piece.runs() if run.seam is not None]
        for run, label in zip(runs, found[1:], strict=True):
            line = shapely.LineString(run.path.sampled(1e-4))
            ahead = np.array([np.cos(label.angle), np.sin(label.angle)])
            foot = label.place + ahead * measure_text_width(label.text, label.height) / 2
            along = line.project(shapely.Point(foot))
            tangent = np.subtract(line.interpolate(along + 0.01).coords[0], line.interpolate(along - 0.01).coords[0])
            assert tangent @ ahead / np.linalg.norm(tangent) > 0.98  # reads along the run
            above = foot + label.height * np.array([-ahead[1], ahead[0]])
            assert line.distance(shapely.Point(above)) > line.distance(shapely.Point(foot))
            assert line.distance(shapely.Point(foot)) < 2.6 * label.height
            assert 0.05 * line.length < along < 0.95 * line.length


def strip(length: float, width: float) -> Pieces:
    points = [[0, 0], [length, 0], [length, width], [0, width], [0, 0]]
    below = Run(Path.from_points(points[:2]), np.zeros((2, 3)), "rail", 0)
    right = Run(Path.from_points(points[1:3]), np.zeros((2, 3)), "end", 1)
    above = Run(Path.from_points(points[2:4]), np.zeros((2, 3)), "rail", 2)
    left = Run(Path.from_points(points[3:]), np.zeros((2, 3)), "end", 3)
    return replace(box(), pieces=(Piece("7.3", ((below, right, above, left),)),))


def test_small_pieces_have_small_labels_then_none():
    heights = []
    for width in (60.0, 12.0, 6.0, 3.0, 0.5):
        pieces = strip(200.0, width)
        found = place_labels(pieces.pieces[0], pieces.seams, height=4.0)
        assert len(found) == 5
        assert {label.text for label in found} == {"7.3", "1", "2", "3", "4"}
        heights.append([label.height for label in found])
        for label in found:
            assert label.is_engraved == bool(label.strokes)
            assert label.height == 0 or label.height >= 1.0 - 1e-12
            if label.strokes:
                assert polygon(pieces.pieces[0]).contains(hull(label))
            else:
                assert np.isfinite(label.place).all()
    assert heights[0] == [6.0, 4.0, 4.0, 4.0, 4.0]
    assert all(np.array(a).sum() >= np.array(b).sum() for a, b in pairwise(heights))
    assert not any(heights[-1])


def test_labels_move_with_their_piece():
    pieces = cylinder()
    turn, shift = 0.0, np.array([30.0, -12.0])
    for piece in pieces.pieces:
        there = place_labels(piece.moved(turn, shift), pieces.seams, height=3.0)
        for a, b in zip(place_labels(piece, pieces.seams, height=3.0), there, strict=True):
            np.testing.assert_allclose(a.moved(turn, shift).place, b.place, atol=1e-9)
    label = place_labels(pieces.pieces[0], pieces.seams)[1]
    there = label.moved(0.7, shift)
    for path, other in zip(there.strokes, make_text_strokes(label.text, label.height), strict=True):
        np.testing.assert_allclose(path.points, other.moved(there.angle, there.place).points, atol=1e-12)


def test_degenerate_runs_and_pieces_are_not_engraved():
    pieces = strip(200.0, 60.0)
    piece = pieces.pieces[0]
    point = Run(Path.from_points([[0, 0], [0, 0]]), np.zeros((2, 3)), "end", 5)
    found = place_labels(replace(piece, loops=((point, *piece.loops[0]),)), pieces.seams)
    assert [label.is_engraved for label in found] == [True, False, True, True, True, True]
    flat = strip(200.0, 0.0)
    assert not any(label.is_engraved for label in place_labels(flat.pieces[0], flat.seams))


@pytest.mark.parametrize("bad", [0, -1.0, np.nan, np.inf, "4", None])
def test_bad_heights(bad):
    pieces = box()
    with pytest.raises(InputError, match="the height of labels is a positive number of mm"):
        place_labels(pieces.pieces[0], pieces.seams, height=bad)
    if bad is not None:
        with pytest.raises(InputError, match="the least height of labels is a positive number of mm"):
            place_labels(pieces.pieces[0], pieces.seams, least=bad)
    with pytest.raises(InputError, match="the least height of labels, 5 mm, exceeds"):
        place_labels(pieces.pieces[0], pieces.seams, least=5.0)


def test_a_thousand_seams():
    pieces = lattice(20, 25)
    found = all_labels(pieces, height=2.0)
    assert sum(label.is_engraved for each in found for label in each) == 500 + 2 * len(pieces.seams)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [(text, True) for text in ("6", "9", "66", "99", "16", "91", "18.6", "68", "89", "6.1")]
    + [(text, False) for text in ("69", "96", "1", "80", "11", "26", "96-4", "", "A6")],
)
def test_what_reads_otherwise_upside_down_is_underlined(text, wanted):
    plain, found = make_text_strokes(text, 6.0), make_label_strokes(text, 6.0)
    assert is_underlined(text) == wanted
    assert len(found) - len(plain) == wanted
    if wanted:
        np.testing.assert_allclose(found[-1].points, [[0.0, -1.0], [measure_text_width(text, 6.0), -1.0]])


def test_underlines_stay_inside_and_apart():
    pieces = box()
    renamed = Pieces(
        tuple(replace(piece, name="6.9") for piece in pieces.pieces),
        tuple(replace(seam, label="16") for seam in pieces.seams),
    )
    for piece, found in zip(renamed.pieces, all_labels(renamed, height=4.0), strict=True):
        assert all(label.is_engraved for label in found)
        assert [len(label.strokes) for label in found] == [len(make_label_strokes(label.text, 1.0)) for label in found]
        hulls = [hull(label) for label in found]
        assert all(polygon(piece).contains(shape) for shape in hulls)
        for i, shape in enumerate(hulls):
            assert all(shape.disjoint(other) for other in hulls[:i])


def test_names_shrink_before_seams_lose_their_labels():
    pieces = strip(20.0, 8.0)
    found = place_labels(pieces.pieces[0], pieces.seams, height=6.0, least=1.5)
    assert all(label.is_engraved for label in found)
    assert found[0].height < 6.0
