"""Tabs: true to measure, beside their piece, beneath the neighbour, apart from each other, told where they are not."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pieces_cases import arc, box, circle, cone, cylinder, frustum, gores, lattice, tower, valley

from cqblend.errors import InputError
from cqblend.patterns.outline.pieces import Piece, Pieces, Place, Run, Seam
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.tab_options import TabOptions
from cqblend.patterns.stock.tabs import fit_tabs

MODELS = [box, valley, cylinder, tower, frustum, cone, gores]
STYLES = ["one", "alternating", "both", "strips", "allowance"]
FINE = 1e-3


def polygon(paths) -> shapely.Polygon:
    shell, *holes = (path.sampled(FINE) for path in paths)
    return shapely.Polygon(shell, holes)


def tabs_of(piece: Piece):
    """The tabs alone, as polygons."""
    beyond = polygon(piece.cuts).difference(polygon(piece.outlines).buffer(2 * FINE))
    return [part for part in shapely.get_parts(beyond) if part.area > 0.05]


def assert_sound(before: Pieces, after: Pieces):
    assert after.seams == before.seams
    for old, new in zip(before.pieces, after.pieces, strict=False):
        assert new.loops == old.loops
        cut = polygon(new.cuts)
        assert cut.is_valid  # no tab meets another one, or the piece
        assert all(path.closed for path in new.cuts)
        assert cut.buffer(3 * FINE).contains(polygon(old.outlines))
        # nothing is counted twice: the area is that of the union
        whole = shapely.union_all([polygon(old.outlines), *(part.buffer(4 * FINE) for part in tabs_of(new))])
        assert whole.area == pytest.approx(cut.area, rel=5e-3)
        assert sum(path.area for path in new.cuts) == pytest.approx(cut.area, rel=1e-3)
        assert all(path.chords.min() > 1e-7 for path in new.cuts)


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("model", MODELS)
def test_cut_outlines_are_sound_in_every_style(model, style):
    pieces = model()
    tabs = fit_tabs(pieces, TabOptions(style=style, width=4.0))
    assert tabs.missing == ()
    assert (tabs.heights >= 1.0).all()
    assert (tabs.heights <= 4.0 + 1e-12).all()
    assert (tabs.coverage > 0.8).all()
    assert (tabs.coverage < 1 + 1e-9).all()
    assert_sound(pieces, tabs.pieces)
    again = fit_tabs(pieces, TabOptions(style=style, width=4.0)).pieces
    for one, other in zip(again.pieces, tabs.pieces.pieces, strict=True):
        for a, b in zip(one.cuts, other.cuts, strict=True):
            np.testing.assert_array_equal(a.points, b.points)


def test_one_tab_for_each_edge_of_a_cube():
    pieces = box()
    tabs = fit_tabs(pieces, TabOptions(width=5.0))
    assert sum(len(tabs_of(piece)) for piece in tabs.pieces.pieces) == 12
    area = sum(path.area for piece in tabs.pieces.pieces for path in piece.cuts)
    assert area == pytest.approx(6 * 1600 + 12 * (40 - 5) * 5, rel=1e-12)
    scores = [score for piece in tabs.pieces.pieces for score in piece.scores]
    assert len(scores) == 12
    assert all(score.fold == "mountain" and score.path.length == pytest.approx(40) for score in scores)
    assert (tabs.coverage == 1).all()
    assert (tabs.heights == 5).all()
    assert tabs.narrowed == ()
    for piece in tabs.pieces.pieces:  # the corners are where they were
        cut = {tuple(point) for point in piece.cuts[0].points}
        assert {tuple(point) for point in piece.outlines[0].points} <= cut


def carried(pieces: Pieces, seam: Seam, side: int, shape: shapely.Geometry) -> shapely.Geometry:
    """What lies beside a straight run, moved rigidly to the other piece of the seam."""
    own, other = pieces.run(seam.sides[side]).path.points, pieces.run(seam.sides[1 - side]).path.points[::-1]
    turn = np.angle(np.dot([1, 1j], other[-1] - other[0]) / np.dot([1, 1j], own[-1] - own[0]))
    cos, sin = np.cos(turn), np.sin(turn)
    shift = other[0] - np.array([[cos, -sin], [sin, cos]]) @ own[0]
    return shapely.transform(shape, lambda points: points @ np.array([[cos, sin], [-sin, cos]]) + shift)


@pytest.mark.parametrize("style", ["one", "alternating"])
@pytest.mark.parametrize("sizes", [(40, 40, 40), (40, 30, 3), (60, 4, 4), (7, 11, 13)])
def test_tabs_lie_beneath_the_neighbour_and_clear_of_each_other(style, sizes):
    pieces = box(*sizes)
    done = fit_tabs(pieces, TabOptions(style=style, width=5.0)).pieces
    beneath = {k: [] for k in range(6)}
    for seam in pieces.seams:
        for side in (0, 1):
            place, other = seam.sides[side], seam.sides[1 - side]
            run = shapely.LineString(pieces.run(place).path.points)
            for tab in tabs_of(done.pieces[place.piece]):
                if tab.distance(run) < 3 * FINE and tab.boundary.intersection(run.buffer(5 * FINE)).length > 0.5:
                    landed = carried(pieces, seam, side, tab)
                    assert polygon(pieces.pieces[other.piece].outlines).buffer(5 * FINE).contains(landed)
                    beneath[other.piece].append(landed)
    assert sum(map(len, beneath.values())) == sum(len(tabs_of(piece)) for piece in done.pieces)
    for shapes in beneath.values():
        assert shapely.union_all(shapes).area == pytest.approx(sum(shape.area for shape in shapes), rel=1e-9)


def test_alternating_teeth_are_congruent_and_interlock():
    pieces = valley(60.0)
    tabs = fit_tabs(pieces, TabOptions(style="alternating", width=4.0, pitch=15.0))
    (seam,) = pieces.seams
    teeth = [tabs_of(tabs.pieces.pieces[side.piece]) for side in seam.sides]
    assert [len(each) for each in teeth] == [2, 2]
    assert {round(tooth.area, 1) for each in teeth for tooth in each} == {round((15 - 4) * 4.0, 1)}
    assert tabs.coverage[0] == pytest.approx(1.0)
    # side by side, each tooth of one side lies beneath the other piece between the teeth of that one
    run = pieces.run(seam.sides[0]).path
    bases = []
    for side in (0, 1):
        for score in tabs.pieces.pieces[seam.sides[side].piece].scores:
            assert score.fold == "valley"
            ends = shapely.LineString(score.path.points)
            ends = ends if side == 0 else carried(pieces, seam, 1, ends)
            along = shapely.line_locate_point(shapely.LineString(run.points), shapely.points(ends.coords))
            bases.append(sorted(along))
    np.testing.assert_allclose(sorted(bases), [[0, 15], [15, 30], [30, 45], [45, 60]], atol=1e-9)


def test_flanges_and_allowances_are_on_both_sides():
    for style, each in (("both", 40 * 5 - 25), ("allowance", 0)):
        tabs = fit_tabs(box(), TabOptions(style=style, width=5.0))
        for piece in tabs.pieces.pieces:
            expected = 1600 + 4 * each if each else 50**2
            assert sum(path.area for path in piece.cuts) == pytest.approx(expected, rel=1e-12)
            assert len(piece.scores) == 4
        assert (tabs.coverage == 1).all()
    hollow = fit_tabs(valley(), TabOptions(style="both", width=5.0))
    assert {score.fold for piece in hollow.pieces.pieces for score in piece.scores} == {"mountain"}


def test_allowances_of_round_pieces_are_round():
    tabs = fit_tabs(cylinder(20.0), TabOptions(style="allowance", width=3.0))
    disc = tabs.pieces.pieces[0].cuts[0]
    assert disc.area == pytest.approx(math.pi * 23**2, rel=1e-12)
    assert disc.length == pytest.approx(math.pi * 46, rel=1e-12)
    plate = fit_tabs(tower(80.0, 15.0), TabOptions(style="allowance", width=3.0)).pieces.pieces[0]
    assert plate.cuts[1].area == pytest.approx(-math.pi * 12**2, rel=1e-12)
    assert plate.cuts[0].area == pytest.approx(80**2, rel=1e-12)  # its border is free


def test_free_runs_have_no_tabs():
    pieces = frustum()
    for style in STYLES:
        done = fit_tabs(pieces, TabOptions(style=style, width=4.0)).pieces.pieces[0]
        cut = shapely.LineString(done.cuts[0].sampled(FINE))
        for run in done.loops[0]:
            if run.seam is None:
                assert cut.buffer(3 * FINE).contains(shapely.LineString(run.path.sampled(FINE)))


def test_pieces_without_seams_stay_as_they_are():
    square = Piece("1", ((Run(circle(10.0), np.zeros((3, 3)), "trim"),),))
    tabs = fit_tabs(Pieces((square,), ()), TabOptions(width=5.0))
    assert tabs.pieces.pieces[0] is square
    assert tabs.missing == tabs.narrowed == ()
    assert tabs.coverage.shape == (0,)


def test_curved_seams_have_teeth_and_straight_ones_have_not():
    tabs = fit_tabs(cylinder(20.0, 50.0), TabOptions(style="both", width=5.0))
    counts = [len(tabs_of(piece)) for piece in tabs.pieces.pieces]
    assert counts == [12, 12, 12 + 12 + 2]
    few = fit_tabs(cylinder(200.0, 500.0), TabOptions(style="both", width=5.0, pitch=40.0))
    assert len(tabs_of(few.pieces.pieces[0])) == math.ceil(2 * math.pi * 200 / 40)


def test_taper_is_the_angle_of_the_legs():
    for taper in (math.pi / 6, math.pi / 4):
        piece = fit_tabs(valley(), TabOptions(width=5.0, taper=taper)).pieces.pieces[0]
        (tab,) = tabs_of(piece)
        assert sum(path.area for path in piece.cuts) - 1600 == pytest.approx(40 * 5 - 25 / math.tan(taper), rel=1e-12)
        assert tab.minimum_rotated_rectangle.area == pytest.approx(200, rel=1e-2)
    corner = fit_tabs(valley(), TabOptions(width=5.0, taper=math.pi / 2)).pieces.pieces[
        0
    ]  # the neighbour's corner allows 45 degrees
    assert sum(path.area for path in corner.cuts) - 1600 == pytest.approx(40 * 5 - 25, rel=1e-12)


def test_connecting_strips_are_pieces_of_their_own():
    pieces = box(40, 40, 40)
    tabs = fit_tabs(pieces, TabOptions(style="strips", width=5.0))
    assert tabs.pieces.pieces[:6] == pieces.pieces
    strips = tabs.pieces.pieces[6:]
    assert [strip.name for strip in strips] == [f"S{seam.label}" for seam in pieces.seams]
    for strip in strips:
        assert strip.area == pytest.approx(2 * (40 - 5) * 5, rel=1e-12)
        (score,) = strip.scores
        assert score.path.length == pytest.approx(40)
        assert score.fold == "mountain"
        assert strip.tabs is None
        assert all(run.seam is None for *_, run in strip.runs())
        assert polygon(strip.outlines).is_valid
        assert polygon(strip.outlines).buffer(1e-9).contains(shapely.LineString(score.path.points))


def test_strips_follow_a_curve_that_both_sides_share_and_else_are_straight_stubs():
    outer, inner = circle(20.0), circle(20.0, clockwise=True)
    half = [np.array([[20.0, 0, 0], [-20, 0, 0], [20, 0, 0]])] * 2
    square = Path.from_points([[30, 30], [-30, 30], [-30, -30], [30, -30], [30, 30]])
    disc = Piece("D", ((Run(outer, half[0], "trim", 0),),))
    plate = Piece("P", ((Run(square, np.zeros((5, 3)), "trim"),), (Run(inner, half[1], "trim", 0),)))
    flat = Pieces((disc, plate), (Seam("7", (Place(0, 0, 0), Place(1, 1, 0)), angle=0.1),))
    strips = fit_tabs(flat, TabOptions(style="strips", width=4.0)).pieces.pieces[2:]
    assert [strip.name for strip in strips] == ["S7.1", "S7.2"]  # a ring in one part would touch itself
    for strip in strips:
        (score,) = strip.scores
        assert score.path.length == pytest.approx(20 * math.pi, rel=1e-12)
        assert polygon(strip.outlines).is_valid
        assert math.pi * 80 * 2 - 2 * 4 * 4.5 < strip.area < math.pi * 80 * 2
        distances = np.linalg.norm(strip.outlines[0].points, axis=1)
        assert (distances.min(), distances.max()) == pytest.approx((16, 24), rel=1e-9)
    stubs = fit_tabs(cylinder(20.0), TabOptions(style="strips", width=4.0)).pieces.pieces[3:]
    assert Counter(stub.name.partition(".")[0] for stub in stubs) == {"S1": 12, "S2": 12, "S3": 1}
    assert len({stub.name for stub in stubs}) == 25
    assert not any(score.path.bulges.any() for stub in stubs for score in stub.scores)
    lengths = [stub.scores[0].path.length for stub in stubs if stub.name.startswith("S1.")]
    assert sum(lengths) == pytest.approx(40 * math.pi, rel=1e-12)


def slot(gap: float) -> Pieces:
    """A plate with a slot from above; the slot's two sides have seams with two small plates."""
    points = [
        [0, 0],
        [60 + gap, 0],
        [60 + gap, 50],
        [30 + gap, 50],
        [30 + gap, 10],
        [30, 10],
        [30, 50],
        [0, 50],
        [0, 0],
    ]
    corners = np.array(points, dtype=float)
    space = np.column_stack([corners, np.zeros(len(corners))])
    seam = {3: 0, 5: 1}
    runs = tuple(
        Run(Path.from_points(corners[k : k + 2]), space[k : k + 2], "trim", seam.get(k))
        for k in range(len(corners) - 1)
    )
    small = np.array([[0, 0], [40, 0], [40, 40], [0, 40], [0, 0]], dtype=float)
    others = tuple(
        Piece(
            name,
            (
                tuple(
                    Run(Path.from_points(small[k : k + 2]), np.full((2, 3), np.nan), "trim", number if k == 0 else None)
                    for k in range(4)
                ),
            ),
        )
        for number, name in enumerate("AB")
    )
    seams = tuple(Seam(str(n + 1), (Place(0, 0, k), Place(n + 1, 0, 0)), angle=1.0) for k, n in seam.items())
    return Pieces((Piece("U", (runs,)), *others), seams)


def test_tabs_give_way_in_a_narrow_slot_or_change_sides():
    for gap in (12.0, 9.0, 6.0, 3.0):
        pieces = slot(gap)
        for style in ("both", "allowance", "alternating", "one"):
            tabs = fit_tabs(pieces, TabOptions(style=style, width=5.0))
            assert_sound(pieces, tabs.pieces)
            assert tabs.missing == ()
            if style == "one":
                assert (tabs.heights == 5).all()
                assert tabs.narrowed == ()
            if style == "both":
                assert (tabs.heights < gap / 2).all() or gap >= 10
                assert (tabs.narrowed == ()) == (gap >= 10)


def test_what_does_not_fit_is_reported():
    pieces = slot(1.0)
    tabs = fit_tabs(pieces, TabOptions(style="both", width=5.0))
    assert_sound(pieces, tabs.pieces)
    np.testing.assert_allclose(tabs.coverage, 0.5)  # the small plates' side
    assert tabs.narrowed == ("1", "2")
    tiny = box(0.3, 0.3, 40)
    tabs = fit_tabs(tiny, TabOptions(style="one", width=5.0))
    assert len(tabs.missing) == 12
    assert all(piece.tabs is None and piece.scores == () for piece in tabs.pieces.pieces)
    lower = fit_tabs(tiny, TabOptions(style="one", width=5.0, least=0.02))
    assert lower.missing == ()
    assert len(lower.narrowed) == 12


def test_a_piece_that_overlaps_itself_gets_no_tabs():
    rim = arc(40.0, 0, 7.0, 8)
    runs = (
        Run(Path.from_points([[0, 0], rim.points[0]]), np.zeros((2, 3)), "end", 0),
        Run(rim, np.zeros((9, 3)), "rail"),
        Run(Path.from_points([rim.points[-1], [0, 0]]), np.zeros((2, 3)), "end", 0),
    )
    pieces = Pieces((Piece("C", (runs,)),), (Seam("1", (Place(0, 0, 0), Place(0, 0, 2))),))
    tabs = fit_tabs(pieces, TabOptions(width=3.0, style="allowance"))
    assert tabs.missing == ("1",)
    assert tabs.pieces.pieces[0].tabs is None


def plug(size: float = 30.0) -> Pieces:
    """A square in a square hole, each a single run with corners inside."""
    square = size / 2 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]])
    space = np.column_stack([square, np.zeros(5)])
    inner = Piece("A", ((Run(Path.from_points(square), space, "trim", 0),),))
    border = Run(Path.from_points(3 * square), 3 * space, "trim")
    outer = Piece("B", ((border,), (Run(Path.from_points(square[::-1]), space[::-1], "trim", 0),)))
    return Pieces((inner, outer), (Seam("1", (Place(0, 0, 0), Place(1, 1, 0)), angle=0.0),))


def test_a_run_with_corners_has_tabs_that_end_there():
    pieces = plug()
    for style in STYLES:
        tabs = fit_tabs(pieces, TabOptions(style=style, width=4.0))
        assert_sound(pieces, tabs.pieces)
        assert tabs.coverage[0] == pytest.approx(1.0)
        assert tabs.heights[0] == 4.0
    one = fit_tabs(pieces, TabOptions(width=4.0)).pieces
    assert sum(path.area for path in one.pieces[0].cuts) == pytest.approx(900 + 4 * (30 - 4) * 4, rel=1e-12)
    assert len(fit_tabs(pieces, TabOptions(style="strips", width=4.0)).pieces.pieces) == 2 + 4
    plain = fit_tabs(pieces, TabOptions(style="allowance", width=4.0)).pieces
    assert [path.area for path in plain.pieces[0].cuts] == pytest.approx([38**2], rel=1e-12)
    assert plain.pieces[1].cuts[1].area == pytest.approx(-(22**2), rel=1e-12)


def test_degenerate_runs_are_passed_over():
    pieces = valley()
    first = pieces.pieces[0]
    point = Run(Path.from_points([[0, 0], [0, 0]]), np.zeros((2, 3)), "end")
    place = pieces.seams[0].sides[0]
    loop = (point, *first.loops[0])
    moved = replace(pieces.seams[0], sides=(replace(place, run=place.run + 1), pieces.seams[0].sides[1]))
    done = fit_tabs(Pieces((replace(first, loops=(loop,)), pieces.pieces[1]), (moved,)), TabOptions(width=5.0))
    assert done.coverage[0] == 1
    assert sum(path.area for path in done.pieces.pieces[0].cuts) == pytest.approx(1600 + 175)


def test_a_seam_to_a_mirrored_piece():
    pieces = valley()
    mirrored = pieces.pieces[1]
    runs = tuple(
        replace(run, path=run.path.mirrored().reversed(), space=run.space[::-1]) for run in mirrored.loops[0][::-1]
    )
    (seam,) = pieces.seams
    place = replace(seam.sides[1], run=3 - seam.sides[1].run)
    turned = Pieces(
        (pieces.pieces[0], replace(mirrored, loops=(runs,))),
        (replace(seam, sides=(seam.sides[0], place), opposed=False),),
    )
    for style in STYLES:
        tabs = fit_tabs(turned, TabOptions(style=style, width=5.0))
        assert tabs.coverage[0] == pytest.approx(1)
        assert tabs.heights[0] == 5
        assert_sound(turned, tabs.pieces)


@settings(deadline=None, max_examples=25)
@given(
    st.sampled_from([box, valley, cylinder, tower, frustum, cone]),
    st.sampled_from(STYLES),
    st.floats(0.3, 60.0),
    st.floats(0.1, math.pi / 2),
    st.floats(0.3, 20.0),
)
def test_whatever_is_asked_for_is_sound(model, style, width, taper, pitch):
    pieces = model()
    tabs = fit_tabs(pieces, TabOptions(style=style, width=width, taper=taper, pitch=max(pitch, 0.8) * width))
    assert ((tabs.heights == 0) == (tabs.coverage == 0)).all()
    for piece in tabs.pieces.pieces:
        cut = polygon(piece.cuts)
        assert cut.is_valid
        assert cut.area > polygon(piece.outlines).area - 10 * FINE * cut.length


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"width": 0}, r"the width of tabs is a positive number of mm, not 0"),
        ({"width": math.nan}, r"the width of tabs .* not nan"),
        ({"width": -3.0}, r"the width of tabs .* not -3"),
        ({"width": "5"}, r"the width of tabs .* not '5'"),
        ({"width": 5, "pitch": 0.0}, r"the pitch of tabs"),
        ({"width": 5, "least": math.inf}, r"the least height of tabs"),
        ({"width": 5, "least": 6}, r"the least height of tabs, 6 mm, exceeds their width, 5 mm"),
        ({"width": 5, "taper": 0}, r"the taper of tabs is an angle above 0"),
        ({"width": 5, "taper": 45}, r"the taper of tabs .* not 45"),
        ({"width": 5, "style": "zigzag"}, r"the style of tabs is one of one, alternating, .*, not 'zigzag'"),
    ],
)
def test_bad_input_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        fit_tabs(valley(), TabOptions(**options))


def test_tabs_on_tabs_are_refused():
    with pytest.raises(InputError, match="piece 1 has tabs already"):
        fit_tabs(fit_tabs(valley(), TabOptions(width=5.0)).pieces, TabOptions(width=5.0))


def test_many_seams():
    pieces = lattice(10, 12)
    tabs = fit_tabs(pieces, TabOptions(width=3.0))
    assert tabs.narrowed == tabs.missing == ()
    assert len(pieces.seams) == 218


@pytest.mark.parametrize("style", STYLES)
def test_too_many_teeth_are_refused_before_they_are_made(style):
    for options in ({"width": 1e-9}, {"width": 1e-3, "pitch": 1e-9}, {"width": 1e-9, "pitch": 1e3}):
        with pytest.raises(InputError, match="teeth, more than 20000: take wider tabs or a longer pitch"):
            fit_tabs(cylinder(), TabOptions(style=style, **options))


def test_too_many_teeth_in_all_are_refused():
    assert len(gores().seams) > 1
    longest = max(run.path.length for piece in gores().pieces for *_, run in piece.runs() if run.seam is not None)
    with pytest.raises(InputError, match="would be about"):
        fit_tabs(gores(), TabOptions(width=longest / 3 / 15_000))


def test_wide_tabs_are_lowered_as_far_as_narrow_ones():
    pieces = gores()
    wide, narrow = (fit_tabs(pieces, TabOptions(width=width)) for width in (100.0, 8.0))
    assert set(wide.missing) <= set(narrow.missing)
    assert wide.heights[wide.heights > 0].min() >= 2.0


@pytest.mark.parametrize("style", ["one", "alternating", "strips"])
@pytest.mark.parametrize(
    ("degrees", "fold"), [(0.9, None), (-0.9, None), (0.0, None), (1.1, "mountain"), (-1.1, "valley")]
)
def test_across_smooth_seams_nothing_is_folded(style, degrees, fold):
    whole = lattice(2, 1)
    pieces = replace(whole, seams=tuple(replace(seam, angle=math.radians(degrees)) for seam in whole.seams))
    tabs = fit_tabs(pieces, TabOptions(style=style, width=5.0))
    assert tabs.missing == ()
    assert {score.fold for piece in tabs.pieces.pieces for score in piece.scores} == ({fold} if fold else set())


def test_flanges_are_folded_on_smooth_seams_too():
    flanged = fit_tabs(lattice(2, 1), TabOptions(style="both", width=5.0)).pieces
    assert [score.fold for piece in flanged.pieces for score in piece.scores] == ["mountain", "mountain"]
