"""Angles between the faces at an edge: smooth, sharp, convex or concave, and fading at an end."""

from __future__ import annotations

import math

import cadquery as cq
import numpy as np
import pytest
from chained_solids import fading_block, gently_fading_block

from cqblend.brep.selection.dihedral_angles import DihedralAngles
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.topology import reverse_edge

W, V = cq.Workplane, cq.Vector


def measure(body: cq.Shape, point: tuple[float, float, float]) -> DihedralAngles:
    index = SolidIndex(body.wrapped)
    edge = min(body.Edges(), key=lambda one: (one.Center() - V(*point)).Length)
    return index.measure_dihedral_angles(edge.wrapped)


def test_convex_and_concave_edges_of_a_bracket():
    body = W().polyline([(0, 0), (9, 0), (9, 2), (2, 2), (2, 8), (0, 8)]).close().extrude(5).val()
    convex, concave = measure(body, (0, 0, 2.5)), measure(body, (2, 2, 2.5))
    assert convex.inner == pytest.approx(math.pi / 2)
    assert concave.inner == pytest.approx(-math.pi / 2)
    assert convex.is_sharp
    assert convex.is_convex
    assert concave.is_sharp
    assert not concave.is_convex


def test_smooth_edges_and_seams():
    body = W().box(10, 10, 10).edges("|Z").fillet(2).val()
    assert measure(body, (5, 3, 0)).is_smooth
    assert not measure(body, (5, 3, 0)).is_sharp
    assert measure(cq.Solid.makeCylinder(4, 9), (4, 0, 4.5)).is_smooth


def test_angles_along_an_edge_that_fades():
    """tan(theta) = slope of the top, x / 40 and x^2 / 400, in the middles of 16 equal parts of all but the margins."""
    share = np.linspace(0.02, 0.98, 17)
    for make, slope in ((fading_block, 20 * share / 40), (gently_fading_block, (20 * share) ** 2 / 400)):
        angles = measure(make(), (10, 0, 0))
        inner = angles.inner if angles.ends[0] == 0 else angles.inner[::-1]
        assert inner == pytest.approx(np.arctan(slope))
        assert min(map(abs, angles.ends)) < 1e-12
        assert angles.is_sharp
        assert angles.is_convex


def test_what_is_smooth_inside_is_not_sharp():
    fades = DihedralAngles(np.array([0.0, 1e-4, 0.1, 0.2]), (0.0, 0.3))
    assert fades.is_sharp
    assert fades.middle.tolist() == [0.1, 0.2]
    assert not DihedralAngles(np.array([0.0, 1e-4, 0.1, 0.2]), (0.1, 0.3)).is_sharp
    assert not DihedralAngles(np.array([0.1, 1e-4, 0.1, 0.2]), (0.0, 0.3)).is_sharp
    assert not DihedralAngles(np.array([-0.1, 0.1, 0.2]), (-0.2, 0.3)).is_sharp
    assert not DihedralAngles(np.array([0.1, 0.2, math.pi]), (0.1, math.pi)).is_sharp


def test_ends_are_those_of_the_use():
    body = gently_fading_block()
    edge = min(body.Edges(), key=lambda one: (one.Center() - V(10, 0, 0)).Length).wrapped
    angles = SolidIndex(body.wrapped).measure_dihedral_angles(edge)
    for end in (0, 1):
        assert angles.find_end_angle(edge, end) == angles.find_end_angle(reverse_edge(edge), 1 - end)
