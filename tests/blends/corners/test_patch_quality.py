"""Curvature and folds of patches."""

import numpy as np
import pytest

from cqblend.blends.corners.patch_quality import check_patches, measure_patches
from cqblend.errors import GeometryError
from cqblend.splines import Surface


def make_saddle(bend):
    """Return z = bend x y over the unit square."""
    poles = np.array([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, bend]]], float)
    return Surface(([0.0, 1.0], [0.0, 1.0]), poles[..., None, None])


def test_curvature_is_that_of_a_saddle():
    """At its origin, the principal curvatures of z = b x y are b and -b: nowhere are they larger."""
    quality = measure_patches([make_saddle(0.5), make_saddle(2.0)])
    assert quality.curvature == pytest.approx(2.0)


def test_sharp_patches_are_refused():
    assert check_patches([make_saddle(2.0)], 1.4).curvature == pytest.approx(2.0)
    with pytest.raises(GeometryError, match="bend 4 times as sharply"):
        check_patches([make_saddle(2.0)], 2.0)


def test_folds_are_refused():
    poles = np.array([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [0.2, -0.5, 0]]], float)
    with pytest.raises(GeometryError, match="fold"):
        check_patches([Surface(([0.0, 1.0], [0.0, 1.0]), poles[..., None, None])], 1.0)
