"""What remains inside new boundaries of faces, with shapely's overlay of fine polygons as the witness."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import Polygon
from shapely.geometry import polygon as rings

from cqblend.blends.network.face_arrangement import BoundaryCurve, find_remainder

TOLERANCE = 1e-7


def line(a, b, ends, *, new: bool = True) -> BoundaryCurve:
    a, b = np.array(a, float), np.array(b, float)
    return BoundaryCurve(lambda t: a + t[:, None] * (b - a), (0.0, 1.0), ends, straight=True, new=new)


def loop(points, name: str, *, new: bool = True) -> list[BoundaryCurve]:
    count = len(points)
    return [
        line(points[k], points[(k + 1) % count], ((name, k), (name, (k + 1) % count)), new=new) for k in range(count)
    ]


def circle(x: float, y: float, r: float, *, clockwise: bool = True, new: bool = False) -> BoundaryCurve:
    span = (2 * np.pi, 0.0) if clockwise else (0.0, 2 * np.pi)
    return BoundaryCurve(
        lambda t: np.stack([x + r * np.cos(t), y + r * np.sin(t)], axis=1), span, ((x, y, r), (x, y, r)), new=new
    )


def plate(width: float) -> list[BoundaryCurve]:
    """What a strip of some width along the lower side leaves of a rectangle of 30 x 20."""
    return loop([(0, width), (30, width), (30, 20), (0, 20)], "plate")


def polygon_of(curves: list[BoundaryCurve], count: int = 4001) -> Polygon:
    return Polygon(np.concatenate([c.evaluate(np.linspace(*c.span, 2 if c.straight else count))[:-1] for c in curves]))


@pytest.mark.parametrize(
    ("width", "y", "r", "outcome"),
    [
        (3.0, 6.0, 2.0, "clear"),
        (3.0, 4.0, 2.0, "cut"),
        (7.0, 4.0, 2.0, "swallowed"),
        (3.0, 5.0 + 1e-6, 2.0, "clear"),
        (3.0, 5.0 - 1e-6, 2.0, "cut"),
        (3.0, 5.0, 2.0, "cut"),
        (7.0, 5.0 - 1e-6, 2.0, "swallowed"),
        (7.0, 5.0 + 1e-6, 2.0, "cut"),
        (7.0, 5.0, 2.0, "cut"),
        (3.0, 500.0 - 480.0 - 2.0 - 1e-6, 2.0, "clear"),
    ],
)
def test_a_hole_beside_a_strip(width, y, r, outcome):
    found = find_remainder([*plate(width), circle(15, y, r)], TOLERANCE)
    assert {
        "clear": found.is_sound,
        "cut": bool(found.meetings),  # touched ones as well
        "swallowed": not found.meetings and found.bounding[-1] == 0 and found.piece_count == 1,
    }[outcome]
    for meeting in found.meetings:
        assert {0, 4} == set(meeting.curves)
        assert np.hypot(*(meeting.point - [15, y])) == pytest.approx(r, abs=1e-6)
        assert meeting.point[1] == pytest.approx(width, abs=1e-6)


def test_areas_are_those_of_the_overlay():
    """A hole that is cut: what remains of the plate less the hole, whatever the strip took of it."""
    curves = [*plate(3.0), circle(15, 4, 2)]
    found = find_remainder(curves, TOLERANCE)
    expected = polygon_of(curves[:4]).difference(polygon_of(curves[4:]))
    assert sum(found.areas) == pytest.approx(expected.area, rel=2e-3)
    assert len(found.meetings) == 2


def test_a_rail_beyond_the_far_side_leaves_nothing():
    found = find_remainder(plate(21.0), TOLERANCE)
    assert found.piece_count == 0
    assert not found.bounding.any()
    assert not found.is_sound


def test_a_waist_leaves_two_pieces():
    """The rail leaves the face at a notch that reaches over it, and comes back beyond."""
    outline = [(0, 5), (30, 5), (30, 20), (16, 20), (15, 4), (14, 20), (0, 20)]
    found = find_remainder(loop(outline, "waist"), TOLERANCE)
    assert found.piece_count == 2
    assert len(found.meetings) == 2
    notch = Polygon([(16, 20), (15, 4), (14, 20)])
    expected = Polygon([(0, 5), (30, 5), (30, 20), (0, 20)]).difference(notch)
    assert sorted(found.areas) == pytest.approx(sorted(part.area for part in expected.geoms))


@pytest.mark.parametrize(("gap", "meets"), [(1e-5, False), (-1e-5, True), (1e-8, True)])
def test_rails_that_run_along_each_other(gap, meets):
    """Two concentric rims of a ring, each with a strip: they are told apart at a hundred times the tolerance."""
    curves = [circle(0, 0, 2 + gap, clockwise=False, new=True), circle(0, 0, 2, new=True)]
    found = find_remainder(curves, TOLERANCE)
    assert bool(found.meetings) == (meets and gap > 0)
    assert found.is_sound == (not meets)


def test_curves_that_leave_a_common_end_tangentially_do_not_meet():
    def parabola(t):
        return np.stack([t, t**2 / 6], axis=1)

    curves = [
        BoundaryCurve(parabola, (3.0, 0.0), ("b", "a")),
        line((0, 0), (33, 0), ("a", "c"), new=False),
        line((33, 0), (3, 1.5), ("c", "b")),
    ]
    assert find_remainder(curves, TOLERANCE).is_sound
    turned = [
        BoundaryCurve(curve.evaluate, curve.span[::-1], curve.ends[::-1], straight=curve.straight, new=curve.new)
        for curve in curves[::-1]
    ]
    found = find_remainder(turned, TOLERANCE)
    assert not found.meetings
    assert not found.bounding.any()


def test_curves_that_lie_on_each_other_meet():
    curves = [*loop([(0, 0), (30, 0), (30, 20), (0, 20)], "one"), *loop([(5, 0), (5, 5), (9, 5), (9, 0)], "two")]
    assert find_remainder(curves, TOLERANCE).meetings


def test_ends_that_do_not_quite_agree_are_forgiven_within_the_slack():
    """A rail that overshoots the neighbour edge by less than the vertex's tolerance."""
    curves = [
        line((0, 3), (30 + 1e-5, 3), (0, 1)),
        line((30, 3), (30, 20), (1, 2), new=False),
        line((30, 20), (0, 20), (2, 3), new=False),
        line((0, 20), (0, 3), (3, 0), new=False),
    ]
    assert not find_remainder(curves, TOLERANCE, slack=1e-4).meetings


@pytest.mark.parametrize("seed", range(12))
def test_random_faces_agree_with_the_overlay(seed):
    """Wavy rails above a row of holes: each is clear, cut or swallowed as shapely says; and so is the area."""
    random = np.random.default_rng(seed)
    heights = random.uniform(2, 9, 6)

    def wave(t):
        x = 30 * t
        return np.stack([x, 5 + 0.5 * sum(h / 9 * np.sin((k + 1) * 3 * t + h) for k, h in enumerate(heights))], axis=1)

    (_, y0), (_, y1) = wave(np.array([0.0, 1.0]))
    outer = [
        BoundaryCurve(wave, (0.0, 1.0), (0, 1)),
        line((30, y1), (30, 20), (1, 2), new=False),
        line((30, 20), (0, 20), (2, 3), new=False),
        line((0, 20), (0, y0), (3, 0), new=False),
    ]
    holes = [circle(x, random.uniform(3.5, 8), random.uniform(0.3, 2)) for x in (3.0, 9.0, 15.0, 21.0, 27.0)]
    found = find_remainder([*outer, *holes], TOLERANCE)
    face = polygon_of(outer)
    expected = face
    for k, hole in enumerate(holes, 4):
        disc = rings.orient(polygon_of([hole]))
        expected = expected.difference(disc)
        meets = any(k in meeting.curves for meeting in found.meetings)
        share = found.bounding[k]
        state = "cut" if meets else "clear" if share == 1 else "swallowed" if share == 0 else "unsure"
        assert state == ("clear" if face.contains(disc) else "swallowed" if face.disjoint(disc) else "cut")
    assert sum(found.areas) == pytest.approx(expected.area, rel=1e-2)
    assert found.piece_count == len(getattr(expected, "geoms", [expected]))
