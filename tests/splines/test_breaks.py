"""Curves cut at common breaks stay what they were; breaks that nearly coincide become one."""

import numpy as np
import pytest
from spline_oracles import quarter_arc

from cqblend.splines import Curve, interpolate
from cqblend.splines.breaks import align_breaks, merge_breaks

X = np.linspace(0, 1, 203)


def wave(t):
    return interpolate(t, np.stack([np.sin(3 * t), np.cos(2 * t)], -1))


def test_curves_get_each_others_breaks_and_keep_their_values():
    curves = [
        wave(np.linspace(0, 1, 6)),
        wave(np.linspace(0, 1, 8)),
        quarter_arc(),
        Curve.bezier([[0.0, 1.0], [2.0, 0.0]]),
    ]
    aligned = align_breaks(curves)
    for before, after in zip(curves, aligned, strict=True):
        np.testing.assert_array_equal(after.breaks, aligned[0].breaks)
        assert after.rational == before.rational
        np.testing.assert_allclose(after(X), before(X), rtol=0, atol=1e-15)
    assert len(aligned[0].breaks) == 12


@pytest.mark.parametrize("rational", [False, True])
def test_breaks_that_nearly_coincide_become_one(rational):
    """To move a break over d changes values by d^3, where the curve is C2."""
    moved = np.linspace(0, 1, 6) + np.array([0, 5e-7, -5e-7, 5e-7, 0, 0])
    curves = [wave(np.linspace(0, 1, 6)), wave(moved)]
    if rational:
        curves = [curve * Curve.bezier([[1.0], [1.0]], [1.0, 2.0]) for curve in curves]
    first, second = align_breaks(curves)
    np.testing.assert_array_equal(first.breaks, second.breaks)
    assert len(first.breaks) == 6
    for before, after in zip(curves, (first, second), strict=True):
        assert after.rational is rational
        np.testing.assert_allclose(after(X), before(X), rtol=0, atol=1e-14)


def test_breaks_are_merged_by_their_share_of_the_range():
    np.testing.assert_array_equal(
        merge_breaks(np.array([0.0, 4.0, 10.0]), np.array([0.0, 4.0 + 1e-6, 10.0])), [0, 4, 10]
    )
    assert len(merge_breaks(np.array([0.0, 4.0, 10.0]), np.array([0.0, 4.0 + 1e-4, 10.0]))) == 4
