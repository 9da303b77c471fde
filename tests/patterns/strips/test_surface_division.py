"""Division into strips: few enough, and as close as is claimed, by a witness that knows no fractions and no bounds."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from spline_witness import surface_jet

import cqblend
from benchmarks.strips import diagonal, models, patches, pawn, revolved, sphere, torus
from cqblend.errors import GeometryError, InputError
from cqblend.patterns.strips.surface_division import divide_surface, divide_surfaces
from cqblend.splines import Curve, Surface

BEZIER = {degree: np.repeat([0.0, 1.0], degree + 1) for degree in (1, 2, 3)}


def extruded(poles, degree=2, knots=None, length=10.0):
    """Surface (u, v) of a profile in y and z, along x in u."""
    poles = np.asarray(poles, float)
    ends = [np.column_stack([np.full(len(poles), x), poles]) for x in (0.0, length)]
    return Surface.from_bspline((1, degree), (BEZIER[1], BEZIER[degree] if knots is None else knots), np.array(ends))


def bumpy(seed, degrees=(3, 3), rational=False, size=10.0):
    rng = np.random.default_rng(seed)
    shape = tuple(degree + 1 for degree in degrees)
    base = np.stack([*np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij"), np.zeros(shape)], -1)
    weights = np.exp(rng.uniform(-1, 1, shape)) if rational else None
    poles = size * (base + rng.uniform(-0.2, 0.2, base.shape))
    return Surface.from_bspline(degrees, tuple(BEZIER[degree] for degree in degrees), poles, weights)


def to_segments(points, first, last):
    """Least distances of points (n, 3) from any of the segments (m, 3) to (m, 3)."""
    chord = last - first
    square = np.maximum((chord**2).sum(-1), 1e-300)
    away = points[:, None] - first
    part = np.clip((away * chord).sum(-1) / square, 0, 1)
    return np.linalg.norm(away - part[..., None] * chord, axis=-1).min(axis=1)


def witnessed(strip, across=31, along=61):
    """Largest distances surface to strip, and strip to surface, between dense samples, from plain arrays.

    Rulings are segments between points of the surface itself; curves of the surface are polygons.
    """
    arrays = strip.surface.to_bspline()
    (u0, u1), _ = strip.surface.domain
    u, v = np.linspace(u0, u1, along), np.linspace(*strip.span, across)
    grid = np.stack(np.meshgrid(u, v, indexing="ij"), -1).reshape(-1, 2)
    points = surface_jet(arrays, grid, 0)[0, 0].reshape(along, across, 3)
    first, last = points[:, 0], points[:, -1]
    there = max(to_segments(points[:, j], first, last).max() for j in range(across))
    shares = np.linspace(0, 1, 9)[1:-1, None]
    back = max(
        to_segments(first[i] + shares * (last[i] - first[i]), points[i, :-1], points[i, 1:]).max() for i in range(along)
    )
    return there, back


def assert_kept(division, tolerance, **samples):
    """The strips lie one beside the other and deviate no more than they claim."""
    assert division.bound <= tolerance
    for before, after in zip(division.strips[:-1], division.strips[1:], strict=True):
        assert before.span[1] == after.span[0]
        t = np.linspace(*before.rails[1].domain, 7)
        assert np.abs(before.rails[1](t) - after.rails[0](t)).max() <= 1e-12 * np.abs(before.rails[1](t)).max()
    start, end = division.strips[0].surface.domain[1]
    assert (division.strips[0].span[0], division.strips[-1].span[1]) == (start, end)
    for strip in division.strips:
        there, back = witnessed(strip, **samples)
        assert there <= strip.bound * (1 + 1e-9) + 1e-12
        assert back <= strip.bound * (1 + 1e-2) + 1e-9  # of polygons with 30 sides


# -- how many


def test_rings_of_a_sphere_are_as_few_as_inscribed_chords_can_be():
    for share in (0.1, 0.03, 0.01, 0.003, 0.001):
        tolerance = share * 20 * math.sqrt(3)
        division = divide_surface(sphere(), tolerance, direction="v")
        assert len(division.strips) == math.ceil(math.pi / (2 * math.acos(1 - tolerance / 10)))
        assert division.ideal_count == pytest.approx(math.pi * math.sqrt(10 / (8 * tolerance)), rel=1e-5)


@pytest.mark.parametrize("name", ["sphere", "torus", "teapot body", "pawn"])
def test_elber_needs_more_strips_and_never_fewer(name):
    surface = models()[name]
    size = diagonal(surface)
    ratios = []
    for share in (3e-2, 1e-2, 3e-3):
        found = [divide_surface(surface, share * size, direction=way) for way in "uv"]
        for one in found:
            assert len(one.strips) <= one.elber_count
            assert one.bound <= share * size
        ratios.append(min(one.elber_count for one in found) / min(len(one.strips) for one in found))
    assert np.exp(np.log(ratios).mean()) >= 1.5


def test_teapot_patches_take_as_many_strips_as_sampled_deviations_allow():
    poles = cqblend.teapot.poles().reshape(-1, 3)
    tolerance = 1e-3 * float(np.linalg.norm(np.ptp(poles, axis=0)))
    counts = {way: sum(len(divide_surface(one, tolerance, direction=way).strips) for one in patches()) for way in "uv"}
    assert counts == {"u": 234, "v": 158}


def test_faces_of_cadquery():
    import cadquery as cq

    surface = cqblend.to_surface(cq.Workplane().sphere(1).faces().val())
    division = divide_surface(surface, 0.01 * diagonal(surface))
    assert (division.direction, len(division.strips)) == ("v", 6)
    assert_kept(division, 0.01 * diagonal(surface))


# -- side by side


@pytest.mark.parametrize("options", [{}, {"even": True}, {"method": "elber"}, {"method": "curvature"}], ids=str)
def test_surfaces_side_by_side_are_divided_as_one_by_one(options):
    """Of several degrees and numbers of pieces, with kinks, weights that separate and others, and one without area."""
    line = Surface.from_bspline((1, 1), (BEZIER[1], BEZIER[1]), [[(0, 0, 0), (1, 0, 0)], [(0, 0, 0), (1, 0, 0)]])
    odd = [bumpy(3), bumpy(4, rational=True), bumpy(5, rational=True), line, sphere(), torus(3.0, 1.0), pawn()]
    surfaces = [*patches()[::4], *odd, *patches()[1::4]]
    for surface, found in zip(surfaces, divide_surfaces(surfaces, 0.1, **options), strict=True):
        if surface is line:
            assert isinstance(found, GeometryError)
            continue
        alone = divide_surface(surface, 0.1, **options)
        assert (found.direction, found.elber_count) == (alone.direction, alone.elber_count)
        assert found.ideal_count == pytest.approx(alone.ideal_count, rel=1e-12)
        assert len(found.strips) == len(alone.strips)
        for one, other in zip(found.strips, alone.strips, strict=True):
            assert one.span == pytest.approx(other.span, abs=1e-9)
            assert one.bound == pytest.approx(other.bound, rel=1e-6, abs=1e-12)
            assert one.bound <= 0.1


def test_surfaces_that_cannot_be_divided_are_errors_beside_the_others():
    surfaces = [torus(), sphere(1e9), extruded([(0, 0), (5, 0), (10, 0)])]
    first, second, third = divide_surfaces(surfaces, 0.01, direction="v", least_width=5.0)
    assert isinstance(first, GeometryError)
    assert "least_width" in str(first)
    assert isinstance(second, GeometryError)
    assert "more than 10000 strips" in str(second)
    assert len(third.strips) == 1
    assert divide_surfaces([], 0.1) == []
    with pytest.raises(InputError, match="only a Surface"):
        divide_surfaces([sphere(), None], 0.1)


def test_neighbours_share_the_curve_between_them():
    strips = divide_surface(sphere(), 0.05, direction="v").strips
    assert len(strips) > 2
    for one, other in pairwise(strips):
        assert one.rails[1] is other.rails[0]


# -- how close


@pytest.mark.parametrize("method", ["longest", "elber", "curvature"])
@pytest.mark.parametrize("name", ["sphere", "torus", "teapot body", "pawn"])
def test_models_keep_to_the_tolerance(name, method):
    surface = models()[name]
    tolerance = 0.01 * diagonal(surface)
    assert_kept(divide_surface(surface, tolerance, method=method), tolerance, along=41, across=21)


def test_bounds_are_within_two_per_cent_of_what_is_taken():
    for surface in (sphere(), bumpy(3), bumpy(4, rational=True)):
        for strip in divide_surface(surface, 0.05, direction="v").strips[:-1]:
            there, _ = witnessed(strip, across=101, along=41)
            assert there >= 0.9 * strip.bound or there == pytest.approx(same_u(strip), rel=0.02)
            assert same_u(strip) >= 0.98 * strip.bound


def same_u(strip):
    """Largest sampled distance between points of surface and strip at the same u and fraction."""
    u, v = np.meshgrid(np.linspace(*strip.surface.domain[0], 101), np.linspace(*strip.span, 101), indexing="ij")
    w = strip.find_fractions(u, v)[..., None]
    on_strip = (1 - w) * strip.rails[0](u) + w * strip.rails[1](u)
    return np.linalg.norm(strip.surface(u, v) - on_strip, axis=-1).max()


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    p=st.integers(1, 3),
    q=st.integers(1, 3),
    rational=st.booleans(),
    share=st.sampled_from([3e-2, 1e-2]),
    way=st.sampled_from("uv"),
    method=st.sampled_from(["longest", "elber"]),
)
def test_random_surfaces_keep_to_the_tolerance(seed, p, q, rational, share, way, method):
    surface = bumpy(seed, (p, q), rational)
    division = divide_surface(surface, 10 * share, direction=way, method=method)
    assert_kept(division, 10 * share, across=21, along=31)
    for strip in division.strips:
        u, v = np.meshgrid(np.linspace(0, 1, 13), np.linspace(*strip.span, 41), indexing="ij")
        w = strip.find_fractions(u, v)
        assert (w[:, 0] == 0).all()
        assert (w[:, -1] == 1).all()
        assert np.diff(w, axis=1).min() >= -1e-9
        assert same_u(strip) <= strip.bound * (1 + 1e-9) + 1e-12


def test_a_control_row_that_folds_back_keeps_to_the_tolerance():
    surface = extruded([(0, 0), (-5, 0), (10, 0)])
    for method in ("longest", "elber"):
        for tolerance in (2.0, 0.5, 0.1, 0.01):
            division = divide_surface(surface, tolerance, direction="v", method=method)
            assert len(division.strips) <= 3
            assert_kept(division, tolerance, across=101)


def test_weights_that_are_no_product_keep_to_the_tolerance():
    poles = np.array([[(0, 0, 0), (0, 1, 0), (0, 2, 0)], [(5, 0, 0), (5, 1, 0), (5, 2, 0)]], float) * [1, 5, 1]
    poles[:, 1, 2] = 1.0
    surface = Surface.from_bspline((1, 2), (BEZIER[1], BEZIER[2]), poles, np.array([[1, 0.05, 1], [1, 20, 1]]))
    for method in ("longest", "elber"):
        division = divide_surface(surface, 0.02, direction="v", method=method)
        assert len(division.strips) > 1
        assert_kept(division, 0.02)


def test_elber_s_bound_is_the_largest_coefficient_of_the_difference():
    # one strip; rows at 0, 1/2, 1 by projection; the middle one is 3 above the chord
    surface = extruded([(0, 0), (4, 3), (8, 0)])
    division = divide_surface(surface, 3.001, direction="v", method="elber")
    assert (len(division.strips), division.bound) == (1, pytest.approx(3.0, rel=1e-12))
    # below it the strip is halved: the middle row is at (2, 3/2), the chord goes to (4, 3/2)
    assert len(divide_surface(surface, 2.999, direction="v", method="elber").strips) == 2
    assert divide_surface(surface, 2.999, direction="v", method="elber").bound == pytest.approx(
        3 / math.hypot(4, 1.5), rel=1e-12
    )
    # the true deviation is half of that: ours needs one strip
    assert divide_surface(surface, 2.999, direction="v").bound == pytest.approx(1.5, rel=1e-2)


def test_elber_projects_the_middle_column():
    rows = np.array([(0, 0, 0), (1, 0, 0), (4, 0, 0)], float)  # fractions 0, 1/4, 1 on the middle column
    poles = np.stack([rows * [2, 1, 1], rows + np.array([0, 5, 0]), rows * [2, 1, 1] + np.array([0, 10, 0])])
    poles[0, 1, 0] = poles[2, 1, 0] = 6.0  # elsewhere 3/4
    surface = Surface.from_bspline((2, 2), (BEZIER[2], BEZIER[2]), poles)
    strip = divide_surface(surface, 5.0, direction="v", method="elber").strips[0]
    assert strip.find_fractions(0.3, 0.5) == pytest.approx(2 * 0.25 * 0.25 + 0.25)
    assert strip.bound == pytest.approx(4.0)  # 6 against a quarter of 8


# -- where


def test_kinks_divide_and_speeds_do_not():
    knots = np.array([0, 0, 0, 1, 1, 2, 2, 2], float)
    bent = extruded([(0, 0), (1, 0), (2, 0), (3, 1), (4, 2)], knots=knots)
    assert [one.span for one in divide_surface(bent, 1e-2, direction="v").strips] == [(0.0, 1.0), (1.0, 2.0)]
    faster = extruded([(0, 0), (1, 0), (2, 0), (12, 0), (22, 0)], knots=knots)
    assert len(divide_surface(faster, 1e-2, direction="v").strips) == 1
    # arcs whose knots are C1 only, and no kinks: the fewest strips do not end there
    ends = {one.span[1] for one in divide_surface(sphere(), 0.05, direction="v").strips}
    assert 1.0 not in ends


def test_curvature_divides_at_the_ridges_of_figure_5():
    y = np.linspace(0, 30, 13)
    z = np.where((np.arange(13) == 4) | (np.arange(13) == 8), 6.0, 0.0)
    knots = np.concatenate([[0] * 4, np.arange(1, 10), [10] * 4]).astype(float)
    surface = extruded(np.column_stack([y, z]), 3, knots)
    division = divide_surface(surface, 0.05, direction="v", method="curvature")
    ends = [one.span[1] for one in division.strips]
    jets = surface.jet(0.5, np.linspace(0, 10, 20001), 2)
    bend = np.abs(np.cross(jets[0, 1], jets[0, 2])[:, 0]) / np.linalg.norm(jets[0, 1], axis=-1) ** 3
    peaks = 1 + np.flatnonzero((bend[1:-1] > bend[:-2]) & (bend[1:-1] > bend[2:]))
    assert len(peaks) >= 2
    for peak in np.linspace(0, 10, 20001)[peaks]:
        assert min(abs(np.array(ends) - peak)) <= 1e-3
    assert_kept(division, 0.05)


def test_even_strips_are_as_many_and_deviate_alike():
    for surface in (sphere(), bumpy(5), pawn()):
        tolerance = 0.01 * diagonal(surface)
        plain, even = (divide_surface(surface, tolerance, direction="v", even=flag) for flag in (False, True))
        assert len(plain.strips) == len(even.strips)
        assert_kept(even, tolerance)
    bounds = [one.bound for one in divide_surface(bumpy(5), 0.05, direction="v", even=True).strips]
    assert max(bounds) <= 1.05 * min(bounds)


def test_a_least_width_makes_strips_even_and_then_refuses():
    surface = bumpy(5)

    def widths(division):
        return [
            np.linalg.norm(np.subtract(*(rail(np.linspace(0, 1, 101)) for rail in one.rails)), axis=1).max()
            for one in division.strips
        ]

    plain = divide_surface(surface, 0.06, direction="v")
    narrow, even = min(widths(plain)), min(widths(divide_surface(surface, 0.06, direction="v", even=True)))
    assert narrow < even
    allowed = divide_surface(surface, 0.06, direction="v", least_width=(narrow + even) / 2)
    assert len(allowed.strips) == len(plain.strips)
    with pytest.raises(GeometryError, match=r"strip from v = .* to .* is .* wide, less than least_width=9"):
        divide_surface(surface, 0.06, direction="v", least_width=9)


def test_the_direction_with_fewer_strips_then_rings_then_the_simpler_one():
    cylinder = revolved(1, np.array([0.0, 0, 1, 1]), np.array([(5.0, 0.0), (5.0, 20.0)]))
    assert (divide_surface(cylinder, 0.1).direction, len(divide_surface(cylinder, 0.1).strips)) == ("v", 1)
    assert divide_surface(cylinder.transpose(), 0.1).direction == "u"
    assert divide_surface(cylinder.transpose(), 0.1).strips[0].transposed
    sheet = Surface.from_bspline((1, 1), (BEZIER[1], BEZIER[1]), [[(0, 0, 0), (0, 1, 0)], [(1, 0, 0), (1, 1, 0)]])
    assert len(divide_surface(sheet.elevate(0, 1), 0.1).strips) == 1
    assert divide_surface(sheet.elevate(0, 1), 0.1).direction == "u"
    assert divide_surface(sheet.elevate(1, 0), 0.1).direction == "v"
    # a long tube of large waves: rings are more, but it is what is asked for
    waves = np.column_stack([5 + 0.4 * (-1.0) ** np.arange(23), np.arange(23.0) * 3])
    tube = revolved(3, np.concatenate([[0] * 4, np.arange(1, 20), [20] * 4]).astype(float), waves)
    rings = divide_surface(tube, 0.05, direction="rings")
    assert rings.direction == "v"
    assert len(divide_surface(tube, 0.05).strips) <= len(rings.strips)
    assert divide_surface(torus(), 1.0, direction="rings").direction == divide_surface(torus(), 1.0).direction
    assert divide_surface(bumpy(1), 1.0, direction="rings").direction == divide_surface(bumpy(1), 1.0).direction


# -- singular and bad input


def test_poles_are_rails():
    division = divide_surface(sphere(), 0.5, direction="v")
    first, last = division.strips[0].rails[0], division.strips[-1].rails[1]
    t = np.linspace(*first.domain, 9)
    assert np.abs(first(t) - [0, 0, -10]).max() <= 1e-14
    assert np.abs(last(t) - [0, 0, 10]).max() <= 1e-14
    # even if the tolerance allows a single strip: it would be a line
    assert len(divide_surface(sphere(), 15.0, direction="v").strips) > 1
    assert_kept(divide_surface(sphere(), 15.0, direction="v"), 15.0)


def test_strips_may_pinch_out_at_a_side_that_is_a_point():
    poles = bumpy(8).to_bspline()[2].copy()
    poles[0] = poles[0, 0]
    surface = Surface.from_bspline((3, 3), (BEZIER[3], BEZIER[3]), poles)
    assert_kept(divide_surface(surface, 0.05, direction="v"), 0.05)
    assert_kept(divide_surface(surface, 0.05, direction="u"), 0.05)


def test_a_ruled_surface_is_one_strip():
    surface = bumpy(2, (3, 1))
    strip = divide_surface(surface, 1e-6, direction="v").strips[0]
    assert strip.bound <= 1e-12
    u, v = np.random.default_rng(0).uniform(size=(2, 20))
    assert np.abs(strip.find_fractions(u, v) - v).max() <= 1e-12


def test_rails_of_the_same_control_points_and_other_weights_are_not_the_same():
    poles = np.repeat(np.array([(0, 0, 0), (5, 0, 0), (10, 4, 0)], float)[:, None], 2, axis=1)
    surface = Surface.from_bspline((2, 1), (BEZIER[2], BEZIER[1]), poles, np.array([[3, 0.4], [2, 4], [0.5, 0.4]]))
    division = divide_surface(surface, 0.1, direction="v")
    assert len(division.strips) == 1
    assert_kept(division, 0.1)


@pytest.mark.parametrize("tolerance", [0, -1.0, math.nan, math.inf, "wide", None, True])
def test_tolerances_are_positive_numbers(tolerance):
    with pytest.raises(InputError, match="tolerance"):
        divide_surface(sphere(), tolerance)


def test_bad_arguments():
    with pytest.raises(InputError, match="direction='w'"):
        divide_surface(sphere(), 1.0, direction="w")
    with pytest.raises(InputError, match="method='best'"):
        divide_surface(sphere(), 1.0, method="best")
    with pytest.raises(InputError, match="least_width=nan"):
        divide_surface(sphere(), 1.0, least_width=math.nan)
    with pytest.raises(InputError, match="only a Surface"):
        divide_surface(Curve.bezier([[0, 0, 0], [1, 0, 0]]), 1.0)
    with pytest.raises(InputError, match="dim 3"):
        divide_surface(sphere()[0], 1.0)


def test_degenerate_surfaces():
    point = Surface.from_bspline((1, 1), (BEZIER[1], BEZIER[1]), np.ones((2, 2, 3)))
    line = Surface.from_bspline((1, 1), (BEZIER[1], BEZIER[1]), [[(0, 0, 0), (1, 0, 0)], [(0, 0, 0), (1, 0, 0)]])
    between_points = Surface.from_bspline(
        (1, 2), (BEZIER[1], BEZIER[2]), [[(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 0, 0), (1, 0, 0), (2, 0, 0)]]
    )
    for surface in (point, line, between_points):
        with pytest.raises(GeometryError, match="degenerate"):
            divide_surface(surface, 0.1)


def test_tolerances_out_of_reach():
    with pytest.raises(GeometryError, match=r"tolerance=1e-08 takes more than 10000 strips"):
        divide_surface(sphere(), 1e-8, direction="v")
    with pytest.raises(GeometryError, match=r"tolerance=1e-16 is within the rounding"):
        divide_surface(sphere(), 1e-16)
