"""Intersections of reshaped surfaces: branches counted as level curves on a grid; points on both, in fractions."""

import itertools
from collections import deque
from fractions import Fraction
from math import comb

import cadquery as cq
import numpy as np
import pytest

from cqblend import reshape, to_surface
from cqblend.blends.potential.family_pair import FamilyPair
from cqblend.blends.potential.intersection_branches import trace_branches
from cqblend.blends.potential.relations import Conic
from cqblend.errors import GeometryError
from cqblend.splines import Surface

STILL = 1e-9  # mm, by which surfaces are reshaped where they should stay as they are


def bezier(net):
    p, q = np.array(net.shape[:2]) - 1
    return Surface.from_bspline((p, q), (np.repeat([0.0, 1.0], p + 1), np.repeat([0.0, 1.0], q + 1)), net)


def height_field(heights):
    p, q = np.array(heights.shape) - 1
    x, y = np.meshgrid(np.arange(p + 1) / p, np.arange(q + 1) / q, indexing="ij")
    return bezier(np.stack([10 * x, 10 * y, heights], axis=-1))


def meeting(one, other, a=STILL, b=STILL):
    return FamilyPair.from_relation((reshape(one, by="normal"), reshape(other, by="normal")), Conic(a, b, 0))


def components(heights, n=1500):
    """Count the level curves z = 0 of a height field, open and closed, on a grid: cells that change sign, connected."""
    x = (np.arange(n + 1) + 0.37) / (n + 0.74)
    p, q = np.array(heights.shape) - 1
    basis = [np.stack([comb(d, i) * x**i * (1 - x) ** (d - i) for i in range(d + 1)]) for d in (p, q)]
    sign = np.einsum("in,jm,ij->nm", *basis, heights) > 0
    quad = np.stack([sign[:-1, :-1], sign[1:, :-1], sign[:-1, 1:], sign[1:, 1:]])
    cells = quad.any(axis=0) & ~quad.all(axis=0)
    count = {"open": 0, "closed": 0}
    while cells.any():
        seed = tuple(np.argwhere(cells)[0])
        cells[seed], queue, border = False, deque([seed]), False
        while queue:
            i, j = queue.popleft()
            border |= i in (0, n - 1) or j in (0, n - 1)
            for k, m in (
                (i + 1, j),
                (i - 1, j),
                (i, j + 1),
                (i, j - 1),
                (i + 1, j + 1),
                (i - 1, j - 1),
                (i + 1, j - 1),
                (i - 1, j + 1),
            ):
                if 0 <= k < n and 0 <= m < n and cells[k, m]:
                    cells[k, m] = False
                    queue.append((k, m))
        count["open" if border else "closed"] += 1
    return count


@pytest.mark.parametrize("seed", range(12))
def test_all_branches_are_found(seed):
    """Height fields of degree 6 x 7 with a random net have up to half a dozen zero curves."""
    rng = np.random.default_rng(seed)
    heights = rng.normal(size=(7, 8)) * (4 if seed % 2 else 1)
    expected = components(heights)
    plane = height_field(np.zeros((2, 2)))
    plane = plane * 1.2 + [-1, -1, 0]
    found = trace_branches(meeting(plane, height_field(heights)), 0.5)
    assert {"open": sum(not one.closed for one in found), "closed": sum(one.closed for one in found)} == expected
    for branch in found:
        assert np.abs(branch.points[:, 2]).max() < 1e-8
        ends = branch.points[[0, -1], :2]
        if branch.closed:
            assert np.linalg.norm(ends[0] - ends[1]) < 1e-9
        else:
            assert np.minimum(np.abs(ends), np.abs(ends - 10)).min(axis=1).max() < 1e-9


def de_casteljau(net, u, v):
    def at(points, x):
        while len(points) > 1:
            points = [[(1 - x) * a + x * b for a, b in zip(p, q, strict=True)] for p, q in itertools.pairwise(points)]
        return points[0]

    u, v = Fraction(float(u)), Fraction(float(v))
    return at([at([list(map(Fraction, point)) for point in row], v) for row in net], u)


def test_traced_points_lie_on_both_surfaces():
    """To 1e-12 of the size, by de Casteljau's algorithm in fractions on control points moved in fractions."""
    rng = np.random.default_rng(3)
    first, second = (
        np.stack(
            [*np.meshgrid(np.linspace(-4, 4, 4), np.linspace(-4, 4, 5), indexing="ij"), rng.normal(size=(4, 5))], -1
        )
        for _ in range(2)
    )
    second = second[..., [2, 1, 0]] + [0, 0, 1]
    families = [reshape(bezier(net), reference=(0.5, 0, -9)) for net in (first, second)]
    made = FamilyPair.from_relation((families[0], families[1]), Conic(0.1, 0.2, 0))
    found = trace_branches(made, 0.5)
    assert found
    s = [Fraction(float(x)) for x in made.s(0.5)]
    centre = [Fraction(1, 2), Fraction(0), Fraction(-9)]
    nets = [
        [
            [[p + t * (p - c) for p, c in zip(map(Fraction, point.tolist()), centre, strict=True)] for point in row]
            for row in net
        ]
        for net, t in zip((first, second), s, strict=True)
    ]
    for branch in found:
        for q, point in zip(branch.parameters[::3], branch.points[::3], strict=True):
            one, other = de_casteljau(nets[0], *q[:2]), de_casteljau(nets[1], *q[2:])
            assert max(abs(float(a - b)) for a, b in zip(one, other, strict=True)) < 1e-12 * 8
            assert max(abs(float(a) - b) for a, b in zip(one, point, strict=True)) < 1e-12 * 8


def face(solid, kind):
    return to_surface(next(one for one in solid.Faces() if one.geomType() == kind))


def test_two_circles():
    ball = to_surface(cq.Workplane().sphere(5).faces().val())
    pipe = face(cq.Solid.makeCylinder(3, 12, cq.Vector(0, 0, -6)), "CYLINDER")
    found = trace_branches(meeting(ball, pipe), 0.5)
    assert sorted(round(float(one.points[:, 2].mean()), 6) for one in found) == [-4, 4]
    assert all(one.closed for one in found)
    for one in found:
        assert np.abs(np.hypot(*one.points[:, :2].T) - 3).max() < 1e-8
        assert (
            abs(abs(one.parameters[-1, 2] - one.parameters[0, 2]) - 2 * np.pi) < 1e-9
        )  # once around, through the seam


def test_a_torus_cut_off_centre():
    ring = to_surface(cq.Workplane(cq.Solid.makeTorus(5, 2)).faces().val())
    for offset, count in ((0.0, 2), (4.0, 1), (5.0, 1), (6.9, 1)):
        plane = bezier(np.array([[[offset, -9.0, -9], [offset, -9, 9]], [[offset, 9, -9], [offset, 9, 9]]]))
        assert len(trace_branches(meeting(ring, plane), 0.5)) == count


def test_small_loops_are_not_lost():
    """A bump that pierces the plane by a loop of a fiftieth of its size."""
    heights = np.full((5, 5), -1.0)
    heights[2, 2] = 1 / (comb(4, 2) / 2**4) ** 2 - 1 + 0.0004
    plane = height_field(np.zeros((2, 2))) * 1.2 + [-1, -1, 0]
    (found,) = trace_branches(meeting(plane, height_field(heights)), 0.5)
    assert found.closed
    assert np.ptp(found.points, axis=0)[:2].max() < 0.4


def touching(lift):
    ball = to_surface(cq.Workplane().sphere(5).faces().val())
    plane = bezier(np.array([[[-9.0, -9.0, lift], [-9, 9, lift]], [[9, -9, lift], [9, 9, lift]]]))
    return meeting(plane, ball)


def test_surfaces_that_touch_are_told():
    ball = to_surface(cq.Workplane().sphere(5).faces().val())
    small = to_surface(cq.Workplane().sphere(3).faces().val()) + np.array([8, 0, 0])
    for made in (touching(5.0), meeting(ball, small, STILL / 10, STILL / 10)):
        with pytest.raises(GeometryError, match=r"touch|cannot be followed"):
            trace_branches(made, 0.5)


def test_surfaces_that_coincide_are_told():
    one = height_field(np.zeros((3, 3)))
    with pytest.raises(GeometryError, match="touch"):
        trace_branches(meeting(one, one + np.array([0.1, 0.2, 0.0]), STILL * 1e-3, STILL * 1e-3), 0.5)


def test_surfaces_that_stay_apart_have_no_branches():
    assert trace_branches(touching(5.5), 0.5) == []
    assert trace_branches(meeting(height_field(np.zeros((2, 2))), height_field(np.ones((3, 3)))), 0.5) == []
