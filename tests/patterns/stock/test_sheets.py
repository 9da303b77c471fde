"""Pieces on sheets: none overlap, all are on their sheets, closely packed; measured by sampling, not by the packer."""

import importlib.util
from dataclasses import replace

import numpy as np
import pieces_cases as cases
import pytest
import shapely

from cqblend.errors import GeometryError, InputError, InstallationError, SizeError, VerificationError
from cqblend.patterns.outline.pieces import Piece, Pieces, Run
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock import spyrrow_packing
from cqblend.patterns.stock.sheets import Sheets, arrange_pieces, verify_spacing
from cqblend.patterns.stock.stock_proportions import PACKING_LIMITS

ALL = [cases.box, cases.cylinder, cases.tower, cases.frustum, cases.cone, cases.gores, cases.lattice]


def check(sheets, pieces):
    """Gaps and margins are kept; pieces are only moved."""
    for number in range(sheets.count):
        shapes = []
        for piece in sheets.pieces_on(number):
            shell, *holes = (path.sampled(1e-4) for path in piece.cuts)
            shapes.append(shapely.Polygon(shell, holes))
        for i, shape in enumerate(shapes):
            low, high = np.reshape(shape.bounds, (2, 2))
            assert (low >= sheets.margin - 1e-3).all()
            assert (high <= np.array(sheets.size) - sheets.margin + 1e-3).all()
            if shapes[:i]:
                assert shapely.distance(shape, shapes[:i]).min() > sheets.gap - 3e-3
    for before, after in zip(pieces.pieces, sheets.pieces.pieces, strict=True):
        assert (before.name, after.area) == (after.name, pytest.approx(before.area, rel=1e-9))
    assert sheets.pieces.seams == pieces.seams


def used_fraction(sheets):
    """Area of the pieces over the area of all sheets."""
    cut = sum(path.area for piece in sheets.pieces.pieces for path in piece.cuts)
    return cut / (sheets.count * sheets.size[0] * sheets.size[1])


def rectangles(*sizes):
    pieces = []
    for k, (w, h) in enumerate(sizes):
        path = Path.from_points([[0, 0], [w, 0], [w, h], [0, h], [0, 0]])
        pieces.append(Piece(str(k), ((Run(path, np.zeros((5, 3)), "trim"),),)))
    return Pieces(tuple(pieces), ())


@pytest.mark.parametrize("case", ALL)
@pytest.mark.parametrize("sheet", [None, (210.0, 150.0)])
def test_no_overlap(case, sheet):
    pieces = case()
    sheets = arrange_pieces(pieces, sheet)
    check(sheets, pieces)
    assert sheet in (None, sheets.size)
    if sheet is None:
        assert sheets.count == 1
        assert used_fraction(sheets) > 0.4


def test_pieces_may_fill_the_sheet_exactly():
    sheets = arrange_pieces(rectangles((90.0, 50.0), (50.0, 90.0)), (100.0, 60.0))
    assert sheets.count == 2
    check(sheets, rectangles((90.0, 50.0), (50.0, 90.0)))


def test_a_piece_that_fits_only_aslant_is_laid_aslant():
    long = rectangles((120.0, 5.0))
    check(arrange_pieces(long, (110.0, 90.0)), long)
    assert arrange_pieces(long, (110.0, 90.0)).count == 1


def test_ring_sectors_lie_in_each_other():
    outer, inner = cases.arc(80.0, 0.0, np.pi / 2), cases.arc(70.0, np.pi / 2, 0.0)
    ends = Path.from_points([outer.points[-1], inner.points[0]]), Path.from_points([inner.points[-1], outer.points[0]])
    runs = tuple(Run(p, np.zeros((len(p.points), 3)), "rail") for p in (outer, ends[0], inner, ends[1]))
    pieces = Pieces(tuple(Piece(str(k), (runs,)) for k in range(6)), ())
    sheets = arrange_pieces(pieces, margin=0.0)
    check(sheets, pieces)
    wide, high = 80 * np.sqrt(2), 80 - 70 * np.sqrt(0.5)
    assert np.prod(sheets.size) < 0.75 * 6 * wide * high


def test_small_pieces_go_into_holes():
    plate = cases.tower(80.0, 30.0, 5.0).pieces[0]
    pieces = Pieces((plate, *rectangles((15.0, 15.0), (15.0, 15.0)).pieces), ())
    sheets = arrange_pieces(pieces, (90.0, 90.0))
    check(sheets, pieces)
    assert sheets.count == 1


def test_the_fewest_sheets_for_squares():
    assert arrange_pieces(cases.lattice(), (245.0, 245.0)).count == 1
    assert arrange_pieces(cases.lattice(5, 4), (100.0, 130.0), gap=2.0).count == 1


def test_what_does_not_fit_is_refused_by_name():
    with pytest.raises(SizeError, match=r"piece 0 is 300.0 x 20.0 mm and does not fit the 190 x 90 mm"):
        arrange_pieces(rectangles((300.0, 20.0)), (200.0, 100.0))
    bad = [{"sheet": 5}, {"sheet": (0, 5)}, {"sheet": (9, 9)}, {"margin": -1}, {"gap": np.nan}, {"packer": "box"}]
    for wrong in bad:
        with pytest.raises(InputError):
            arrange_pieces(cases.box(), **wrong)
    with pytest.raises(InputError, match="no pieces"):
        arrange_pieces(Pieces((), ()))


def test_the_check_finds_what_is_wrong():
    pieces = rectangles((20.0, 20.0), (20.0, 20.0))
    apart = Pieces((pieces.pieces[0].moved(0, np.array([5, 5])), pieces.pieces[1].moved(0, np.array([30, 5]))), ())
    verify_spacing(Sheets((60.0, 40.0), apart, (0, 0), 5.0, 3.0))
    with pytest.raises(VerificationError, match="pieces 0 and 1 are nearer than 6 mm on sheet 1"):
        verify_spacing(Sheets((60.0, 40.0), apart, (0, 0), 5.0, 6.0))
    with pytest.raises(VerificationError, match="leaves sheet 1"):
        verify_spacing(Sheets((52.0, 40.0), apart, (0, 0), 5.0, 3.0))
    twice = Pieces((apart.pieces[0], apart.pieces[0]), ())
    with pytest.raises(VerificationError):
        verify_spacing(Sheets((60.0, 40.0), twice, (0, 0), 5.0, 0.0))


@pytest.mark.skipif(importlib.util.find_spec("spyrrow") is None, reason="an optional extra")
@pytest.mark.parametrize("sheet", [None, (150.0, 100.0)])
def test_spyrrow_packs(sheet):
    pieces = cases.box()
    sheets = arrange_pieces(pieces, sheet, packer="spyrrow", seconds=1)
    check(sheets, pieces)


def test_spyrrow_is_asked_for_by_name(monkeypatch):
    monkeypatch.setattr(spyrrow_packing, "find_spec", lambda name: None)
    with pytest.raises(InstallationError, match=r"cqblend\[nesting\]"):
        arrange_pieces(cases.box(), packer="spyrrow")


def test_failures_of_the_other_process_are_told(monkeypatch, tmp_path):
    monkeypatch.setattr(spyrrow_packing, "find_spec", lambda name: name)
    worker = tmp_path / "worker.py"
    monkeypatch.setattr(spyrrow_packing, "WORKER", worker)
    worker.write_text("raise RuntimeError('no luck')")
    with pytest.raises(GeometryError, match="no luck"):
        arrange_pieces(cases.box(), packer="spyrrow")
    worker.write_text("import time; time.sleep(60)")
    monkeypatch.setattr(spyrrow_packing, "PACKING_LIMITS", replace(PACKING_LIMITS, grace_seconds=0.2))
    with pytest.raises(GeometryError, match="did not end"):
        arrange_pieces(cases.box(), packer="spyrrow", seconds=0.3)
    with pytest.raises(InputError, match="seconds"):
        arrange_pieces(cases.box(), packer="spyrrow", seconds=-1)
