"""Pieces cut along lines: nothing is lost, seams keep two sides of one length, parts are joined as the whole was."""

from string import ascii_uppercase

import numpy as np
import pieces_cases as cases
import pytest

from cqblend.errors import GeometryError, InputError, SizeError
from cqblend.patterns.outline.pieces import Piece, Pieces, Place, Run, Score
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.split_pieces import split_piece, split_to_fit

ALL = [cases.box, cases.cylinder, cases.tower, cases.frustum, cases.cone, cases.gores]


def check(pieces):
    """Loops are chains, the first counterclockwise; runs and seams know each other; labels are unique."""
    for i, piece in enumerate(pieces.pieces):
        for j, loop in enumerate(piece.loops):
            for k, run in enumerate(loop):
                following = loop[(k + 1) % len(loop)]
                assert np.allclose(run.path.points[-1], following.path.points[0], atol=1e-9)
                assert run.space.shape == (len(run.path.points), 3)
                if run.seam is not None:
                    assert Place(i, j, k) in pieces.seams[run.seam].sides
        assert piece.outlines[0].area > 0
        assert all(path.area < 0 for path in piece.outlines[1:])
    for index, seam in enumerate(pieces.seams):
        assert seam.sides[0] != seam.sides[1]
        assert all(pieces.run(side).seam == index for side in seam.sides)
    assert pieces.mismatch() < 1e-12
    for words in ([piece.name for piece in pieces.pieces], [seam.label for seam in pieces.seams]):
        assert len(set(words)) == len(words)


def total(pieces):
    return sum(piece.area for piece in pieces.pieces)


@pytest.mark.parametrize("case", ALL)
@pytest.mark.parametrize("size", [(60.0, 45.0), (37.0, 23.0)])
def test_parts_fit_and_nothing_is_lost(case, size):
    whole = case()
    parts = split_to_fit(whole, size)
    check(parts)
    assert total(parts) == pytest.approx(total(whole), rel=1e-12)
    for piece in parts.pieces:
        points = np.concatenate([path.sampled(1e-3) for path in piece.outlines])
        turned = (points[:, 0] + 1j * points[:, 1]) * np.exp(1j * np.linspace(0, np.pi, 1801))[:, None]
        boxes = np.stack([np.ptp(turned.real, axis=1), np.ptp(turned.imag, axis=1)], axis=1)
        assert (boxes <= np.array(size) + 0.1).all(axis=1).any()
    old = {seam.label: whole.run(seam.sides[0]).path.length for seam in whole.seams}
    for label, length in old.items():  # the parts of a seam are as long as it was
        own = [seam for seam in parts.seams if seam.label.rstrip(ascii_uppercase) == label]
        assert sum(parts.run(seam.sides[0]).path.length for seam in own) == pytest.approx(length, rel=1e-12)


def test_the_partner_is_divided_at_the_same_lengths():
    whole = cases.cylinder()
    index, line = 0, np.array([[3.0, 0.0], [3.0, 1.0]])  # through the bottom disc
    parts = split_piece(whole, index, line)
    check(parts)
    assert [piece.name for piece in parts.pieces] == ["BA", "BB", "T", "W"]
    wall = parts.pieces[3]
    assert len(wall.loops[0]) == 6  # its lower rim is in three parts now
    angle = np.arccos(3.0 / 20.0)
    lengths = sorted(run.path.length for run in wall.loops[0] if run.path.points[-1, 1] == run.path.points[0, 1] == 0)
    assert np.allclose(lengths, sorted([20 * angle, 20 * (2 * np.pi - 2 * angle), 20 * angle]), rtol=1e-12)
    assert parts.pieces[0].area == pytest.approx(200 * (2 * np.pi - 2 * angle) + 3 * np.sqrt(400 - 9), rel=1e-12)


def test_a_seam_of_a_piece_with_itself_is_divided_on_both_sides():
    parts = split_piece(cases.cylinder(), 2, np.array([[0.0, 20.0], [1.0, 20.0]]))
    check(parts)
    assert [piece.name for piece in parts.pieces[2:]] == ["WA", "WB"]
    assert [piece.area for piece in parts.pieces[2:]] == pytest.approx([40 * np.pi * 30, 40 * np.pi * 20])
    assert {seam.label for seam in parts.seams} == {"1", "2", "3A", "3B", "C1"}
    tall = next(seam for seam in parts.seams if parts.run(seam.sides[0]).path.length == pytest.approx(30.0))
    assert {side.piece for side in tall.sides} == {2}


def test_holes_go_to_the_part_around_them_or_into_its_border():
    whole = cases.tower()
    beside = split_piece(whole, 0, np.array([[25.0, 0.0], [25.0, 1.0]]))
    check(beside)
    assert [len(piece.loops) for piece in beside.pieces[:2]] == [2, 1]
    through = split_piece(whole, 0, np.array([[5.0, 0.0], [5.0, 1.0]]))
    check(through)
    assert [len(piece.loops) for piece in through.pieces[:2]] == [1, 1]
    assert sum(seam.label.startswith("C") for seam in through.seams) == 2


def test_places_in_space_are_on_the_chords():
    parts = split_piece(cases.box(), 0, np.array([[10.0, 0.0], [10.0, 1.0]]))
    check(parts)
    for seam in parts.seams:
        first, second = (parts.run(side).space for side in seam.sides)
        assert np.allclose(first, second[::-1], atol=1e-12)
    cut = parts.run(parts.seams[-1].sides[0])
    assert (cut.kind, parts.seams[-1].label) == ("cut", "C1")
    assert np.linalg.norm(np.diff(cut.space, axis=0)) == pytest.approx(cut.path.length) == 40.0


def test_a_comb_falls_into_several_parts():
    points = [[0, 0], [50, 0], [50, 30], [40, 30], [40, 10], [30, 10], [30, 30], [20, 30], [20, 10], [10, 10], [10, 30]]
    path = Path.from_points([*points, [0, 30], [0, 0]])
    comb = Pieces((Piece("1", ((Run(path, np.zeros((13, 3)), "trim"),),)),), ())
    parts = split_piece(comb, 0, np.array([[0.0, 20.0], [1.0, 20.0]]))
    check(parts)
    assert sorted(piece.area for piece in parts.pieces) == pytest.approx([100.0, 100.0, 100.0, 800.0])


def test_scores_are_cut_too():
    square = Path.from_points([[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]])
    score = Score(Path.from_points([[0, 5], [10, 5]]), "mountain")
    whole = Pieces((Piece("1", ((Run(square, np.zeros((5, 3)), "trim"),),), scores=(score,)),), ())
    parts = split_piece(whole, 0, np.array([[4.0, 0.0], [4.0, 1.0]]))
    assert [piece.scores[0].path.length for piece in parts.pieces] == pytest.approx([4.0, 6.0])


def test_arcs_that_are_crossed_twice():
    sagitta = Path(
        np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 10.0], [0.0, 10.0], [0.0, 0.0]]), np.array([-0.5, 0, 0, 0])
    )
    whole = Pieces((Piece("1", ((Run(sagitta, np.zeros((5, 3)), "trim"),),)),), ())  # notched from below, 5 deep
    parts = split_piece(whole, 0, np.array([[0.0, 3.0], [1.0, 3.0]]))
    check(parts)
    assert len(parts.pieces) == 3
    assert total(parts) == pytest.approx(total(whole), rel=1e-12)


def test_what_cannot_be_cut_is_refused():
    whole = cases.box()
    with pytest.raises(InputError, match="does not cross piece 1"):
        split_piece(whole, 0, np.array([[100.0, 0.0], [100.0, 1.0]]))
    with pytest.raises(GeometryError, match="touches its boundary near"):
        split_piece(whole, 0, np.array([[0.0, 0.0], [1.0, 1.0]]))
    with pytest.raises(InputError, match="two different points"):
        split_piece(whole, 0, np.array([[1.0, 1.0], [1.0, 1.0]]))
    tabbed = Pieces((Piece("1", whole.pieces[0].loops, tabs=whole.pieces[0].outlines), *whole.pieces[1:]), whole.seams)
    with pytest.raises(InputError, match="before tabs"):
        split_piece(tabbed, 0, np.array([[10.0, 0.0], [10.0, 1.0]]))
    with pytest.raises(SizeError, match="1000 parts"):
        split_to_fit(whole, (0.5, 0.5))
    with pytest.raises(InputError):
        split_to_fit(whole, (0.0, 10.0))


def test_pieces_that_fit_stay_as_they_are():
    whole = cases.box()
    parts = split_to_fit(whole, (60.0, 41.0))
    assert parts is whole
