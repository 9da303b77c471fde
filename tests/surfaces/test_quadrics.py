"""What cannot be lifted to a quadric: the apex of a cone, the point of a sphere opposite to its pole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from kernel_surfaces import pairs

from cqblend.errors import GeometryError


def test_a_cone_is_not_lifted_across_its_apex():
    pair = pairs()["cone +0.4, nappe +1"]
    apex = -3 / math.sin(0.4)
    with pytest.raises(GeometryError, match="apex of a cone"):
        pair.primary.lift_points(np.array([[0.0, apex + 1], [0.0, apex - 1]]))


def test_a_sphere_is_not_lifted_opposite_to_its_pole():
    pair = pairs()["spinning sphere"]
    with pytest.raises(GeometryError, match="opposite"):
        pair.primary.lift_points(np.array([[0.0, -math.pi / 2]]))
