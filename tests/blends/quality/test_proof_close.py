"""Crossings of knot lines that nearly coincide: brought together, in every form, and proven as OCCT evaluates them."""

from __future__ import annotations

import numpy as np
import pytest
from proof_witness import LongCurve, LongSurface, measure

from cqblend import Rail, hermite_blend
from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.edge_parameters import spread_samples
from cqblend.brep.measurement.knot_lines import find_knot_crossings
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface
from cqblend.splines.breaks import align_breaks, merge_breaks
from cqblend.splines.tolerances import SPLINE_TOLERANCES


def sheet(middle, at, *, degree=3, repeats=1, bend=0.0):
    """Ten millimetres of a wavy sheet with a knot line in the middle, both ways."""
    lines = [middle] if isinstance(middle, float) else list(middle)
    knots = np.concatenate([np.zeros(degree + 1), np.repeat(lines, repeats), np.ones(degree + 1)])
    greville = np.array([knots[i + 1 : i + degree + 1].mean() for i in range(len(knots) - degree - 1)])
    u, v = np.meshgrid(greville, greville, indexing="ij")
    height = 0.1 * np.sin(3 * u) * np.cos(4 * v) + bend * np.maximum(u - 0.5, 0)
    return Surface.from_bspline((degree, degree), (knots, knots), 10 * np.stack([u, v, height], -1) + at)


def pair(apart, offset, repeats=1):
    """The two sheets of the case that first showed what slivers do, and their rails."""
    first = sheet(0.5, [offset, 0, 0], repeats=repeats)
    second = sheet(0.5 + apart, [offset, 0, 4], repeats=repeats)
    return (
        Rail(first, Curve.bezier([(0.05, 0.9), (0.95, 0.8)])),
        Rail(second, Curve.bezier([(0.05, 0.2), (0.95, 0.1)])),
    )


def measured(blend):
    """Return what is measured of both sides, by long doubles and by OCCT."""
    surface = LongSurface(*blend.surface.to_bspline())
    return [
        measure(surface, end, LongCurve(*curve.to_bspline()), LongSurface(*other.to_bspline()))
        for end, (other, curve) in enumerate(blend.traces)
    ]


@pytest.mark.parametrize(
    ("form", "apart"), [("exact", 2e-9), ("exact", 1e-8), ("exact", 5e-7), ("compact", 2e-9), ("auto", 1e-8)]
)
@pytest.mark.parametrize(("repeats", "angle"), [(1, 1e-10), (2, 3e-8)])
def test_near_crossings_make_no_slivers(form, apart, repeats, angle):
    """C2 sheets gave 1.1e-6 rad, proven to 5.5e-14; C1 ones miss a share of the distance between the crossings."""
    blend = hermite_blend(*pair(apart, 100.0, repeats), form=form)
    assert np.diff(blend.surface.breaks[0]).min() > SPLINE_TOLERANCES.near_breaks
    certificate = blend.certificate
    for sides in measured(blend):
        for found in sides:
            assert found.gap <= certificate.proof.gap
            assert found.angle <= certificate.proof.angle
            assert found.angle <= (angle if blend.form == "exact" else 1e-5)
    assert certificate.angle <= certificate.proof.angle
    if blend.form == "exact":
        assert certificate.proof.angle < 30 * angle


def test_curvatures_stay_equal_across_crossings_that_are_brought_together():
    blend = hermite_blend(*pair(1e-8, 0.0), continuity="G2", form="exact")
    for side, sides in zip(blend.certificate.proof.sides, measured(blend), strict=True):
        for found in sides:
            assert found.curvature_jump <= side.curvature_jump < 1e-4
            assert found.curvature_jump < 1e-7


@pytest.mark.parametrize("apart", [3e-6, 1e-5, 1e-4])
def test_compact_blends_do_not_chase_the_rounding_of_short_pieces(apart):
    """G2 across crossings too far apart to be one: no number of spans makes curvatures better than rounding."""
    blend = hermite_blend(*pair(apart, 1000.0), continuity="G2", form="compact")
    assert blend.surface.to_bspline()[2].shape[0] < 400
    for side, sides in zip(blend.certificate.proof.sides, measured(blend), strict=True):
        for found in sides:
            assert found.angle <= min(side.angle, 1e-5)
            assert found.curvature_jump <= side.curvature_jump


def test_a_jump_of_curvature_is_proven_for_each_side_or_not_at_all():
    blend = hermite_blend(*pair(1e-8, 10.0), continuity=("G2", "G1"), form="exact")
    proof = blend.certificate.proof
    first, second = measured(blend)
    assert proof.curvature_jump is None  # what G1 leaves on the second side
    assert max(found.curvature_jump for found in second) > 0.1
    assert max(found.curvature_jump for found in first) <= proof.sides[0].curvature_jump < 1e-4
    assert proof.sides[1].curvature_jump is None
    assert proof.angle == max(side.angle for side in proof.sides)


def test_knots_next_to_each_other_that_make_a_crease_are_one():
    first, second = (sheet((0.5, 0.5 + 1e-8), [0, 0, z], degree=2, repeats=1, bend=0.5) for z in (0, 4))
    with pytest.raises(GeometryError, match=r"has a crease of 0\.61 rad inside, .* at t = 0\.5"):
        hermite_blend(
            Rail(first, Curve.bezier([(0.05, 0.9), (0.95, 0.8)])),
            Rail(second, Curve.bezier([(0.05, 0.2), (0.95, 0.1)])),
        )


def test_breaks_become_the_least_smooth_one_and_pieces_meet():
    def kinked(at, order):
        left = Curve.from_bspline(3, [0, 0, 0, 0, at, at, at, at], [[0.0], [1], [2], [3]])
        right = Curve.from_bspline(3, [at, at, at, at, 1, 1, 1, 1], [[3.0], [4], [4], [7]])
        return left.join(right, continuity=order)

    rough, smooth = kinked(0.5, 0), kinked(0.5 + 1e-7, 1)
    for curves in ([rough, smooth], [smooth, rough]):
        together = align_breaks(curves)
        for curve in together:
            assert np.array_equal(curve.breaks, [0, 0.5, 1])
            assert curve.coefs[-1, 0, 0] == curve.coefs[0, 0, 1]
    assert align_breaks([smooth])[0] is smooth
    assert np.array_equal(
        merge_breaks(np.array([0, 1e-7, 0.3, 0.3 + 1e-7, 1.0]), np.array([0, 1 - 1e-8, 1.0])), [0, 0.3, 1]
    )


@pytest.mark.parametrize("apart", [1e-4, 1e-8, 1e-12])
def test_samples_lie_in_every_span(apart):
    ts = spread_samples(np.array([0.0, 0.3, 0.3 + apart, 1.0]), 100)
    assert ((ts > 0.3) & (ts < 0.3 + apart)).sum() >= 9
    assert np.diff(ts).min() > 0


def test_crossings_are_found_to_rounding_however_close():
    from cqblend.brep.conversion.spline_arrays import surface_from_arrays

    surface = surface_from_arrays(*sheet((0.5, 0.5 + 1e-9), [0, 0, 0], degree=5).to_bspline())
    rail = Curve.bezier([(0.1, 0.2), (0.2, 0.4), (0.9, 0.9)])
    t = np.sort(find_knot_crossings(lambda t: rail(t).T, 0.0, 1.0, SurfaceEvaluator(surface)))
    off = np.abs(np.subtract.outer(rail(t), [0.5, 0.5 + 1e-9])).min(axis=(1, 2))
    assert len(t) == 4  # once through both lines of u, and once through both of v
    assert off.max() < 1e-15
