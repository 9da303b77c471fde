"""Coordinates in tangent planes undo partial derivatives, on every kind of surface."""

from __future__ import annotations

import math

import numpy as np
import pytest
from kernel_surfaces import pairs, sample_parameters, seeded_random

from cqblend.errors import GeometryError
from cqblend.surfaces.vectors import to_tangent_coordinates


@pytest.mark.parametrize("pair", pairs().values(), ids=pairs().keys())
def test_tangent_coordinates_undo_the_partial_derivatives(pair):
    uv = sample_parameters(pair)
    jet = pair.primary.jet(uv)
    rs = seeded_random(pair).normal(size=uv.shape)
    vector = rs[:, :1] * jet[1] + rs[:, 1:] * jet[2]
    normal = np.cross(jet[1], jet[2])
    assert np.abs(to_tangent_coordinates(jet, vector) - rs).max() < 1e-12
    assert np.abs(to_tangent_coordinates(jet, vector + normal) - rs).max() < 1e-12


def test_a_pole_of_a_sphere_has_no_tangent_coordinates():
    pair = pairs()["sphere"]
    jet = pair.primary.jet(np.array([[0.0, math.pi / 2]]))
    jet[1] = 0
    with pytest.raises(GeometryError, match="singular"):
        to_tangent_coordinates(jet, np.ones((1, 3)))
