"""Blends of surfaces along given rails: how they meet what they blend, on plain arrays, by OCCT and in long doubles.

Nothing here asks cqblend how good it is, except where the certificate itself is examined.
"""

from __future__ import annotations

import math

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from spline_witness import (
    TURNS,
    angle,
    curve_jet,
    dot,
    kernel,
    kernel_jet,
    meeting,
    norm,
    normal,
    sections,
    surface_jet,
)

import cqblend
from cqblend import Combination, Curve, Guide, Rail, Surface, hermite_blend
from cqblend.errors import DegreeError, GeometryError, InputError

LONG = np.longdouble
SIZE = 10.0
STATIONS = 2000
FLOOR = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
WALL = np.array([(1.2, 0, 0.2), (0.1, 0, 1), (0, 1, 0), (1, 0, 0)])
CEILING = np.array([(0.05, 0.02, 0.35), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
INNER = ((0.25, 0.5, 0.75), (0.2, 0.4, 0.6, 0.8))


# What is blended: B-splines as arrays (degrees, knots, poles, weights).


def clamped(degree, inner):
    return np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])


def sheet(frame, *, degrees=(3, 3), inner=INNER, rational=False, size=SIZE, shift=0.0, seed=5):
    """A wavy sheet over the square that a frame (origin, two sides, normal) spans."""
    rng = np.random.default_rng(seed)
    knots = tuple(clamped(d, k) for d, k in zip(degrees, inner, strict=True))
    greville = [
        [k[i + 1 : i + d + 1].mean() for i in range(len(k) - d - 1)] for d, k in zip(degrees, knots, strict=True)
    ]
    u, v = np.meshgrid(*greville, indexing="ij")
    height = 0.06 * np.sin(5 * u + 3 * v) + rng.uniform(-0.025, 0.025, u.shape)
    poles = size * (frame[0] + u[..., None] * frame[1] + v[..., None] * frame[2] + height[..., None] * frame[3]) + shift
    return degrees, knots, poles, rng.uniform(0.7, 1.4, u.shape) if rational else None


def pair(**options):
    return sheet(FLOOR, **options), sheet(WALL, **{**options, "seed": 6})


def bezier(poles, weights=None):
    poles = np.array(poles, float)
    return len(poles) - 1, clamped(len(poles) - 1, ()), poles, None if weights is None else np.array(weights)


def bspline(degree, inner, poles):
    return degree, clamped(degree, inner), np.array(poles, float), None


RAILS = {
    "straight": (bezier([[0.78, 0.04], [0.83, 0.95]]), bezier([[0.28, 0.05], [0.26, 0.97]])),
    "isoparametric": (bezier([[0.8, 0.05], [0.8, 0.95]]), bezier([[0.25, 0.05], [0.25, 0.95]])),
    "quadratic": (
        bspline(2, (0.3, 0.7), [[0.75, 0.05], [0.85, 0.3], [0.72, 0.6], [0.8, 0.75], [0.78, 0.95]]),
        bspline(2, (0.5,), [[0.2, 0.1], [0.3, 0.3], [0.2, 0.7], [0.25, 0.9]]),
    ),
    "cubic": (
        bspline(3, (0.4, 0.7), [[0.75, 0.05], [0.85, 0.2], [0.72, 0.4], [0.85, 0.7], [0.72, 0.8], [0.78, 0.95]]),
        bspline(3, (0.5,), [[0.2, 0.1], [0.3, 0.3], [0.2, 0.5], [0.25, 0.7], [0.25, 0.9]]),
    ),
    "rational": (
        bezier([[0.7, 0.1], [0.9, 0.5], [0.72, 0.9]], [1, 1.7, 0.8]),
        bezier([[0.2, 0.1], [0.3, 0.5], [0.2, 0.9]], [1, 0.6, 1]),
    ),
}
GUIDE = Guide(Curve.bezier([[1, 0.2, 3], [0.5, 0.3, 1], [1.7, -0.3, 2]]), Curve.bezier([[-0.4, 0.2, -2], [0, 0.1, -2]]))
INTO = Curve.bezier([[1, 0.2], [0.7, -0.2]])
TANGENTS = {
    "T1": "parametric",
    "T2": "perpendicular",
    "T3": "chord",
    "T4": GUIDE,
    "T5": (Combination(INTO), Combination(Curve.bezier([[0.1, 0], [0.3, -0.2], [0, 0.1]]), INTO)),
}


def rails(surfaces, curves, sides=(None, None)):
    return [
        Rail(Surface.from_bspline(*surface), Curve.from_bspline(*curve), side)
        for surface, curve, side in zip(surfaces, curves, sides, strict=True)
    ]


def wavy():
    """The pair on which IRIT was measured."""
    knots = clamped(3, np.arange(1, 10) / 10)
    greville = np.array([knots[i + 1 : i + 4].mean() for i in range(13)])
    i, j = np.meshgrid(range(13), range(13), indexing="ij")
    x, y = greville[i] + 0.02 * np.sin(1.1 * j), greville[j] + 0.02 * np.cos(1.7 * i)
    poles = np.stack([x, y, 0.25 * np.sin(0.7 * i) * np.cos(0.9 * j)], -1)
    curve = np.array([(0.05, 0.10), (0.40, 0.95), (0.65, 0.05), (0.95, 0.90)])
    surfaces = [((3, 3), (knots, knots), poles + move, None) for move in ([0, 0, 0], [0.3, 0.2, 1])]
    return surfaces, (bezier(curve), bezier(np.stack([curve[:, 0], 1 - curve[:, 1]], -1)))


# How it is measured.


def resolution(blend, at, speed):
    """What rounding of its poles to doubles does to the slope of a blend along its rail, at the given stations.

    A slope is a difference of poles times the degree, over the length of the piece.
    """
    (degree, _), _, poles, _ = blend.surface.to_bspline()
    breaks = blend.surface.breaks[0]
    piece = np.diff(breaks)[np.clip(np.searchsorted(breaks, at, side="right") - 1, 0, len(breaks) - 2)]
    return degree * np.spacing(np.abs(poles).max()) / (piece * speed), degree / (piece * speed)


def examine(blend, surfaces, curves, orders, *, size=SIZE, kind="occt", stations=300):
    """Check at stations of both rails that the blend meets its surfaces, each with its order of continuity."""
    t = np.linspace(*blend.surface.domain[0], stations)
    arrays, made = blend.surface.to_bspline(), BRep_Tool.Surface_s(blend.face())
    for v, surface, curve, order in zip((0.0, 1.0), surfaces, curves, orders, strict=True):
        ends = np.stack([t, np.full_like(t, v)], -1)
        if kind == "occt":
            one, other = kernel_jet(made, ends), kernel_jet(kernel(surface), curve_jet(curve, t, 0)[0])
        else:
            one = surface_jet(arrays, ends, 3, LONG)
            other = surface_jet(surface, curve_jet(curve, t, 0, LONG)[0], 3, LONG)
        gap, turn, bend, rate = meeting(one, other)
        noise, per = resolution(blend, t, norm(one[1, 0]))
        noise *= 8 if kind == "long" else 16  # OCCT's own rounding comes to that of the poles
        assert gap.max() <= 1e-13 * size
        if order > 0:
            assert (turn <= np.maximum(1e-12, noise)).all()
        if order > 1:
            assert (bend * size <= np.maximum(1e-8, noise * per * size)).all()
        if order > 2 and kind == "long":
            assert (rate * size**2 <= np.maximum(1e-6, 4 * noise * (per * size) ** 2)).all()


def creases(blend):
    """Return the angle between the normals on both sides of every inner knot of a blend, and the knots."""
    arrays = blend.surface.to_bspline()
    knots, v = np.unique(arrays[1][0])[1:-1], np.linspace(0, 1, 7)
    if not len(knots):
        return np.zeros(1), knots
    uv = np.stack([np.repeat(knots, len(v)), np.tile(v, len(knots))], -1)
    before, after = (normal(surface_jet(arrays, uv, 1, LONG, side=side)) for side in ("left", "right"))
    return angle(before, after).reshape(-1, len(v)).max(axis=1).astype(float), knots


# Must hold.


@pytest.mark.parametrize(("name", "rational"), [("cubic", False), ("cubic", True), ("rational", True)])
@pytest.mark.parametrize("tangents", TANGENTS)
def test_exact_forms_of_all_five_types_meet_their_surfaces(tangents, name, rational):
    surfaces, curves = pair(rational=rational), RAILS[name]
    blend = hermite_blend(*rails(surfaces, curves), tangents=TANGENTS[tangents], form="exact")
    examine(blend, surfaces, curves, (1, 1), stations=STATIONS)
    assert creases(blend)[0].max() <= 1e-7


@pytest.mark.parametrize(("continuity", "rational"), [("G1", False), ("G2", False), ("G2", True)])
@pytest.mark.parametrize("name", RAILS)
def test_exact_forms_on_all_kinds_of_rails(name, continuity, rational):
    surfaces, curves = pair(rational=rational), RAILS[name]
    blend = hermite_blend(*rails(surfaces, curves), continuity=continuity, bulge=0.6, form="exact", crease=0.1)
    assert blend.surface.rational == (rational or name == "rational")
    examine(blend, surfaces, curves, (int(continuity[1]),) * 2)


@pytest.mark.parametrize("length", [None, "field"])
@pytest.mark.parametrize("tangents", ["parametric", "perpendicular"])
def test_light_rails_keep_all_digits(tangents, length):
    surfaces, curves = pair(), RAILS["quadratic"]
    blend = hermite_blend(*rails(surfaces, curves), tangents=tangents, length=length, bulge=0.2, form="exact")
    examine(blend, surfaces, curves, (1, 1), kind="long")


@pytest.mark.parametrize("continuity", ["G1", "G2"])
def test_the_wavy_pair(continuity):
    surfaces, curves = wavy()
    made = rails(surfaces, curves, ("left", "right"))
    blend = hermite_blend(*made, tangents="parametric", continuity=continuity, form="exact", length=0.1, crease=0.1)
    for kind in ("occt", "long"):
        examine(blend, surfaces, curves, (int(continuity[1]),) * 2, size=1.0, kind=kind)


@pytest.mark.parametrize("orders", [(0, 1), (1, 2), (2, 0), (0, 0), (2, 1)])
def test_each_side_has_its_own_order(orders):
    surfaces, curves = pair(), RAILS["straight"]
    continuity = tuple(f"G{k}" for k in orders)
    blend = hermite_blend(*rails(surfaces, curves), continuity=continuity, form="exact")
    assert blend.surface.degree[1] == sum(orders) + 1
    examine(blend, surfaces, curves, orders)


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize(
    ("degrees", "inner"), [((3, 3), ((), ())), ((4, 4), ((0.5,), (0.3, 0.6))), ((5, 5), ((), (0.5,)))]
)
@pytest.mark.parametrize("orders", [(3, 3), (0, 3)])
def test_third_order(orders, degrees, inner, rational):
    """In long doubles: those of OCCT leave few digits of third derivatives."""
    surfaces, curves = pair(degrees=degrees, inner=inner, rational=rational), RAILS["straight"]
    blend = hermite_blend(*rails(surfaces, curves), continuity=tuple(f"G{k}" for k in orders), form="exact")
    examine(blend, surfaces, curves, orders, kind="long")


def test_third_order_needs_surfaces_that_have_it():
    with pytest.raises(GeometryError, match=r"C3.*v = 0\.2.*only C2.*t = 0\.1"):
        hermite_blend(*rails(pair(), RAILS["straight"]), continuity="G3")


@pytest.mark.parametrize("continuity", ["G1", "G2"])
def test_spheres_and_cylinders_as_splines_against_their_equations(continuity):
    """The sphere's normal is radial and its curvature 1/R in all directions, whatever splines say."""
    ball = cq.Solid.makeSphere(4.0, cq.Vector(0, 0, 0), angleDegrees1=-90, angleDegrees2=90).Faces()[0]
    tube = cq.Solid.makeCylinder(3.0, 12.0, cq.Vector(9, 0, -6)).faces("%CYLINDER")
    first, second = cqblend.to_surface(ball), cqblend.to_surface(tube)

    def across(surface, a, b):
        (u0, u1), (v0, v1) = surface.domain
        ends = [[u0 + (u1 - u0) * x, v0 + (v1 - v0) * y] for x, y in (a, b)]
        return Curve.bezier([ends[0], [(ends[0][0] + ends[1][0]) / 2 + 0.1, (ends[0][1] + ends[1][1]) / 2], ends[1]])

    one = Rail(first, across(first, (0.06, 0.35), (0.1, 0.65)), "left")
    two = Rail(second, across(second, (0.4, 0.3), (0.42, 0.7)), "left")
    blend = hermite_blend(one, two, continuity=continuity, form="exact")
    arrays, t = blend.surface.to_bspline(), np.linspace(0, 1, 500)
    for v, radius, middle, flat in ((0.0, 4.0, [0, 0, 0], 0.0), (1.0, 3.0, [9, 0, 0], 1.0)):
        jet = surface_jet(arrays, np.stack([t, np.full_like(t, v)], -1), 3, LONG)
        out = (jet[0, 0] - middle) * [1, 1, 1 - flat]
        assert np.abs(norm(out) - radius).max() <= 1e-13 * SIZE
        out /= norm(out)[:, None]
        turn = np.minimum(angle(normal(jet), out), angle(-normal(jet), out))
        noise, per = resolution(blend, t, norm(jet[1, 0]))
        assert (turn <= np.maximum(1e-12, 8 * noise)).all()
        if continuity == "G2":
            along = np.cross(out, [0.0, 0.0, 1.0])
            along /= norm(along)[:, None]
            bend, _ = sections(jet, along, np.cross(out, along), TURNS)
            true = -(np.cos(TURNS) ** 2 if flat else np.ones(len(TURNS))) / radius
            assert (np.abs(bend - true[:, None]) * SIZE <= np.maximum(1e-8, 8 * noise * per * SIZE)).all()


# Rails that close, are edges, are projections, or run over other domains.


def circle(centre, radius):
    """The NURBS circle of nine poles: no more than C0 in homogeneous coordinates."""
    ring = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], float)
    knots = np.array([0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]) / 4
    return 2, knots, np.array(centre) + radius * ring, np.tile([1, math.sqrt(0.5)], 5)[:9]


@pytest.mark.parametrize("tangents", ["perpendicular", "parametric", "chord"])
def test_closed_rails_make_a_blend_that_closes_smoothly(tangents):
    surfaces = sheet(FLOOR), sheet(CEILING, inner=((0.3, 0.6), (0.5,)), seed=8)
    curves = circle((0.5, 0.5), 0.3), circle((0.5, 0.5), 0.15)
    blend = hermite_blend(*rails(surfaces, curves, ("left", "right")), tangents=tangents, form="exact")
    examine(blend, surfaces, curves, (1, 1))
    assert creases(blend)[0].max() <= 1e-7
    v = np.linspace(0, 1, 41)
    ends = [np.stack([np.full_like(v, t), v], -1) for t in (0.0, 1.0)]
    jets = [
        surface_jet(blend.surface.to_bspline(), end, 1, LONG, side)
        for end, side in zip(ends, ("right", "left"), strict=True)
    ]
    assert norm(jets[0][0, 0] - jets[1][0, 0]).max() <= 1e-13 * SIZE
    assert angle(normal(jets[0]), normal(jets[1])).max() <= 1e-7
    assert BRep_Tool.Surface_s(blend.face()).IsUClosed()
    assert cq.Face(blend.face()).isValid()


def test_edges_and_projected_curves_as_rails():
    box, ball = cq.Workplane().box(20, 20, 4).val(), cq.Solid.makeSphere(6, cq.Vector(0, 0, 12), angleDegrees1=-90)
    top = cq.Workplane(obj=box).faces(">Z").val()
    edge = top.Edges()[0]
    plane = cqblend.to_surface(top)
    one = Rail(plane, cqblend.curve_on(top, edge))
    start, end = (np.array(edge.positionAt(s).toTuple()) for s in (0, 1))
    line = Curve.bezier(np.add([0.2 * start, 0.2 * end], [0, 0, 6.0]))
    round_face = ball.Faces()[0]
    two = Rail(cqblend.to_surface(round_face), cqblend.projected(round_face, line).reparametrized(*one.domain))
    ahead = [np.diff(rail.curve3d()(rail.domain), axis=0)[0] for rail in (one, two)]
    if ahead[0] @ ahead[1] < 0:
        two = Rail(two.surface, two.curve.reverse())
    blend = hermite_blend(one, two, form="exact")
    t = np.linspace(*blend.surface.domain[0], 500)
    jets = [kernel_jet(BRep_Tool.Surface_s(blend.face()), np.stack([t, np.full_like(t, v)], -1)) for v in (0.0, 1.0)]
    assert np.abs(jets[0][0, 0][:, 2] - 2.0).max() <= 1e-13 * 20
    assert np.minimum(angle(normal(jets[0]), [[0, 0, 1.0]]), angle(normal(jets[0]), [[0, 0, -1.0]])).max() <= 1e-12
    out = jets[1][0, 0] - [0, 0, 12]
    assert np.abs(norm(out) - 6).max() <= 1e-13 * 20
    assert np.minimum(angle(normal(jets[1]), out), angle(normal(jets[1]), -out)).max() <= 1e-11


def test_rails_over_different_domains_make_the_same_blend():
    one, two = rails(pair(), RAILS["straight"])
    moved = Rail(two.surface, two.curve.reparametrized(-3, 7))
    t, v = np.meshgrid(np.linspace(0, 1, 31), np.linspace(0, 1, 7))
    for tangents in ("perpendicular", "chord"):
        same = [hermite_blend(one, other, tangents=tangents, form="exact").surface(t, v) for other in (two, moved)]
        assert np.abs(same[0] - same[1]).max() <= 1e-11 * SIZE


# No creases inside.


def crossings(surface, curve):
    """Return where a rail crosses knot lines, and the angle between C' x n and the line there."""
    t = np.linspace(0, 1, 2001)
    found = []
    for axis, lines in enumerate(INNER):
        for value in lines:
            offset = curve_jet(curve, t, 0)[0][:, axis] - value
            for k in np.flatnonzero(offset[:-1] * offset[1:] < 0).tolist():
                low, high = t[k], t[k + 1]
                for _ in range(50):
                    middle = (low + high) / 2
                    inside = (curve_jet(curve, [middle], 0)[0][0, axis] - value) * offset[k] > 0
                    low, high = (middle, high) if inside else (low, middle)
                c, rate = curve_jet(curve, [low], 1)
                jet = surface_jet(surface, c, 1)
                across = np.cross(rate[:, :1] * jet[1, 0] + rate[:, 1:] * jet[0, 1], normal(jet))
                line = jet[0, 1] if axis == 0 else jet[1, 0]
                found.append((low, float(min(angle(across, line)[0], angle(-across, line)[0]))))
    return sorted(found)


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize(("multiplicity", "continuity"), [(2, "G1"), (1, "G2"), (2, "G2")])
def test_steered_blends_have_no_crease(multiplicity, continuity, rational):
    """On C1 surfaces for G1 and G2, on C2 surfaces for G2; without steering they have."""
    inner = tuple(np.repeat(lines, multiplicity) for lines in INNER)
    surfaces, curves = pair(inner=inner, rational=rational), RAILS["isoparametric"]
    made = rails(surfaces, curves)
    assert max(turn for s, c in zip(surfaces, curves, strict=True) for _, turn in crossings(s, c)) < math.radians(20)
    blend = hermite_blend(*made, continuity=continuity, form="exact")
    examine(blend, surfaces, curves, (int(continuity[1]),) * 2)
    assert creases(blend)[0].max() <= 1e-7
    assert blend.certificate.inner_crease <= 1e-7
    if multiplicity == 2 and continuity == "G2":
        with pytest.raises(GeometryError, match="order 2 jump"):
            hermite_blend(*made, continuity=continuity, form="exact", steer=0)
        return
    straight = hermite_blend(*made, continuity=continuity, form="exact", steer=0, crease=0.5)
    found = creases(straight)[0].max()
    assert found > 1e-5
    assert straight.certificate.inner_crease == pytest.approx(found, rel=0.1)


@pytest.mark.parametrize("steer", [0.1, 0.35])
def test_steering_goes_as_far_as_it_may_and_what_is_left_is_reported(steer):
    """Section by section: no crease where the turn is allowed, and it is not the turn that makes one elsewhere."""
    surfaces, curves = pair(inner=tuple(np.repeat(lines, 2) for lines in INNER)), RAILS["rational"]
    blend = hermite_blend(*rails(surfaces, curves), form="exact", steer=steer, crease=0.5)
    found, knots = creases(blend)
    turns = [one for s, c in zip(surfaces, curves, strict=True) for one in crossings(s, c)]
    beyond = [t for t, turn in turns if turn > steer]
    within = [t for t, turn in turns if turn < steer and all(abs(t - other) > 1e-3 for other in beyond)]
    assert beyond
    assert within
    for t in within:
        assert found[np.abs(knots - t).argmin()] <= 1e-7
    assert found.max() > 1e-3
    assert blend.certificate.inner_crease == pytest.approx(found.max(), rel=0.1)
    assert blend.certificate.direction <= steer * 1.03 + 1e-3


@pytest.mark.parametrize("kind", ["parametric", "combination"])
def test_directions_with_kinks_are_rounded(kind):
    """T1 of a quadratic rail is no more than continuous; taken as it is, it would crease the blend."""
    bent = Curve.from_bspline(1, [0, 0, 0.5, 1, 1], [[1, 0.2], [1, 0.6], [1, -0.3]])
    tangents, other = (kind, kind) if kind == "parametric" else (Combination(bent), Combination(-bent))
    made = rails(pair(), RAILS["quadratic"])
    blend = hermite_blend(*made, tangents=(tangents, other), length="field", bulge=0.3, form="exact")
    assert creases(blend)[0].max() <= 1e-7


# Directions, lengths, and what the certificate says of them.


def leaving(blend, v):
    """Return the cross derivatives at one end, into the blend, from OCCT, and the parameters."""
    t = np.linspace(*blend.surface.domain[0], 1501)
    jet = kernel_jet(BRep_Tool.Surface_s(blend.face()), np.stack([t, np.full_like(t, v)], -1))
    return jet[0, 1] * (1 if v == 0 else -1), t


@pytest.mark.parametrize("name", ["straight", "quadratic", "cubic"])
@pytest.mark.parametrize("continuity", ["G1", "G2"])
def test_deviations_of_direction_and_length_are_as_certified(name, continuity):
    surfaces, curves = pair(), RAILS[name]
    options = {"bulge": (0.8, lambda t: 1 + t), "crease": 0.1}
    blend = hermite_blend(*rails(surfaces, curves), continuity=continuity, form="exact", **options)
    points = []
    for surface, curve in zip(surfaces, curves, strict=True):
        t = np.linspace(0, 1, 1501)
        c, rate = curve_jet(curve, t, 1)
        jet = surface_jet(surface, c, 1)
        points.append((jet[0, 0], np.cross(rate[:, :1] * jet[1, 0] + rate[:, 1:] * jet[0, 1], normal(jet))))
    for i, (point, across) in enumerate(points):
        vectors, t = leaving(blend, float(i))
        chord = points[1 - i][0] - point
        across = across * np.sign(dot(across, chord))[:, None]
        asked = norm(chord) * (0.8, 1 + t)[i]
        rail = blend.certificate.rails[i]
        turned, stretched = angle(vectors, across).max(), np.abs(norm(vectors) / asked - 1).max()
        assert turned <= rail.direction * 1.1 + 1e-7
        assert stretched <= rail.length * 1.1 + 1e-6
        if continuity == "G2":
            assert turned >= rail.direction / 2


def test_scaling_never_changes_directions():
    made = rails(pair(), RAILS["rational"])
    options = [{}, {"bulge": 0.4}, {"bulge": (2, lambda t: 1 + t**2)}, {"length": 3}, {"length": "field", "bulge": 0.1}]
    options.append({"length": Curve.bezier([[2.0], [5.0]]), "bulge": (1, 0.5)})
    found = [[leaving(hermite_blend(*made, form="exact", **one), v)[0] for v in (0.0, 1.0)] for one in options]
    for vectors in found[1:]:
        for mine, first in zip(vectors, found[0], strict=True):
            assert angle(mine, first).max() <= 3e-5
    assert np.abs(norm(found[3][0]) / 3 - 1).max() <= 1e-3
    assert np.abs(norm(found[5][1]) / (0.5 * np.linspace(2, 5, 1501)) - 1).max() <= 1e-3


# Sizes and degrees.


@pytest.mark.parametrize("continuity", ["G1", "G2"])
@pytest.mark.parametrize("size", [1e-3, 1e4])
def test_tiny_and_huge_surfaces(size, continuity):
    surfaces, curves = pair(size=size), RAILS["straight"]
    blend = hermite_blend(*rails(surfaces, curves), continuity=continuity, form="exact")
    examine(blend, surfaces, curves, (int(continuity[1]),) * 2, size=size)


def test_far_from_the_origin_it_is_as_exact_as_doubles_are():
    surfaces, curves = pair(size=1.0, shift=1e5), RAILS["straight"]
    blend = hermite_blend(*rails(surfaces, curves), form="exact")
    t, arrays = np.linspace(0, 1, STATIONS), blend.surface.to_bspline()
    for v, surface, curve in zip((0.0, 1.0), surfaces, curves, strict=True):
        one = surface_jet(arrays, np.stack([t, np.full_like(t, v)], -1), 1, LONG)
        other = surface_jet(surface, curve_jet(curve, t, 0, LONG)[0], 1, LONG)
        assert norm(one[0, 0] - other[0, 0]).max() <= 8 * np.spacing(1e5)
        turn = np.minimum(angle(normal(one), normal(other)), angle(-normal(one), normal(other)))
        assert (turn <= 8 * resolution(blend, t, norm(one[1, 0]))[0]).all()


@pytest.mark.parametrize("name", ["straight", "quadratic"])
def test_flat_patches_and_degree_five(name):
    for degrees, inner in (((1, 1), ((), ())), ((5, 5), ((0.4,), (0.3, 0.6)))):
        surfaces, curves = pair(degrees=degrees, inner=inner), RAILS[name]
        blend = hermite_blend(*rails(surfaces, curves), continuity="G2", form="exact")
        examine(blend, surfaces, curves, (2, 2))


@pytest.mark.parametrize("rational", [False, True])
def test_full_knots_that_are_smooth_count_as_smooth(rational):
    """OCCT inserts a knot until the surface falls apart there by its knots alone: the blend must not care."""
    surfaces, curves = pair(rational=rational), RAILS["isoparametric"]
    split = []
    for surface in surfaces:
        made = kernel(surface)
        made.InsertUKnot(0.5, 3, 1e-12, False)
        made.InsertVKnot(0.2, 3, 1e-12, False)
        made.InsertVKnot(0.6, 3, 1e-12, False)
        ranges = range(1, made.NbUPoles() + 1), range(1, made.NbVPoles() + 1)
        poles = np.array([[made.Pole(i, j).Coord() for j in ranges[1]] for i in ranges[0]])
        weights = np.array([[made.Weight(i, j) for j in ranges[1]] for i in ranges[0]])
        u = [made.UKnot(i) for i in range(1, made.NbUKnots() + 1) for _ in range(made.UMultiplicity(i))]
        v = [made.VKnot(i) for i in range(1, made.NbVKnots() + 1) for _ in range(made.VMultiplicity(i))]
        split.append(((3, 3), (np.array(u), np.array(v)), poles, weights if rational else None))
    for continuity in ("G1", "G2"):
        blend = hermite_blend(*rails(split, curves), continuity=continuity, form="exact")
        examine(blend, split, curves, (int(continuity[1]),) * 2)
        assert creases(blend)[0].max() <= 1e-7


def test_degrees_that_the_kernel_cannot_hold_are_refused_and_compact_has_none():
    surfaces, curves = pair(degrees=(5, 5), inner=((0.4,), (0.3, 0.6))), RAILS["cubic"]
    made = rails(surfaces, curves)
    with pytest.raises(DegreeError, match=r"degree 30.*compact"):
        hermite_blend(*made, form="exact")
    blend = hermite_blend(*made)
    assert blend.form == "compact"
    assert max(blend.surface.degree) <= 7
    t = np.linspace(0, 1, STATIONS)
    for v, surface, curve in zip((0.0, 1.0), surfaces, curves, strict=True):
        one = kernel_jet(BRep_Tool.Surface_s(blend.face()), np.stack([t, np.full_like(t, v)], -1))
        gap, turn, _, _ = meeting(one, kernel_jet(kernel(surface), curve_jet(curve, t, 0)[0]))
        assert gap.max() <= 1e-7
        assert turn.max() <= 1e-5


# What is refused.


JUMPING = Curve.from_bspline(1, [0, 0, 0.5, 0.5, 1, 1], [[1, 0.2], [1, 0.6], [1, -0.3], [1, 0.3]])
REFUSED = [
    ({"bulge": math.nan}, InputError, "bulge must be finite"),
    ({"bulge": -1}, InputError, "bulge must be above 0"),
    ({"bulge": (1, 0)}, InputError, r"bulge\[1\] must be above 0"),
    ({"bulge": True}, InputError, "bulge must be a number"),
    ({"bulge": (1, 1e-20)}, InputError, r"bulge\[1\] must be from 1e-12 to 1e\+06, not 1e-20"),
    ({"bulge": 1e300}, InputError, "bulge must be from 1e-12"),
    ({"bulge": lambda t: 1 - 2 * t}, InputError, "at t = 1: it must be above 0"),
    ({"bulge": lambda t: np.where(t > 0.6, math.nan, 1)}, InputError, r"nan at t = 0\.6"),
    ({"bulge": lambda t: np.ones(3)}, InputError, r"array of shape \(3,\)"),
    ({"bulge": Curve.bezier([[1, 1], [2, 1]])}, InputError, "curve of dim 1, not 2"),
    ({"bulge": Curve.bezier([[1], [-2]])}, InputError, "-2 at t = 1"),
    ({"length": (1, Curve.bezier([[1], [2]]).reparametrized(0, 0.5))}, InputError, r"rail 2 runs over \[0, 0\.5\]"),
    ({"length": math.inf}, InputError, "length must be finite"),
    ({"length": "fields"}, InputError, "length must be 'field', None, a number"),
    ({"continuity": "G4"}, InputError, "continuity must be"),
    ({"continuity": ("G1",)}, InputError, "one value or a pair"),
    ({"tangents": "guide"}, InputError, "a Guide or a Combination"),
    ({"tangents": Guide(Curve.bezier([[1, 1], [2, 1]]))}, InputError, "a Curve of dim 3, not one of dim 2"),
    (
        {"tangents": Guide(Curve.bezier([[1, 1, 0], [2, 1, 0]]).reparametrized(0, 2))},
        InputError,
        "runs over the rail's",
    ),
    ({"tangents": (Guide(Curve.bezier([[1, 0, 0], [-1, 2, 0]])), "chord")}, GeometryError, r"parallel .* t = 0\.4"),
    ({"tangents": (Combination(Curve.bezier([[1, 0], [-1, 0]])), "chord")}, GeometryError, r"parallel .* t = 0\.4"),
    ({"tangents": (Combination(JUMPING), "chord")}, InputError, r"Combination of rail 1 jumps at t = 0\.5"),
    ({"steer": -1}, InputError, "steer must not be below 0"),
    ({"form": "best"}, InputError, "form must be"),
    ({"tolerance": 0}, InputError, "tolerance must be above 0"),
]


@pytest.mark.parametrize(("options", "error", "message"), REFUSED)
def test_options_that_make_no_sense(options, error, message):
    with pytest.raises(error, match=message):
        hermite_blend(*rails(pair(), RAILS["straight"]), **options)


def test_rails_that_make_no_sense():
    surface = Surface.from_bspline(*sheet(FLOOR))
    up, along = Curve.bezier([[0.1, 0.1], [0.5, 0.9]]), Curve.bezier([[0.1, 0.1], [0.9, 0.3]])
    with pytest.raises(InputError, match=r"two cqblend\.Rail, not None"):
        hermite_blend(None, Rail(surface, up))
    with pytest.raises(GeometryError, match="side of the rail cannot be told: at t = 0,"):
        hermite_blend(Rail(surface, up), Rail(surface, along))
    with pytest.raises(GeometryError, match="at t = 0 of rail 1 has no length: do the rails meet"):
        hermite_blend(Rail(surface, up, "right"), Rail(surface, along, "left"))
    crossing = Curve.bezier([[0.1, 0.3], [0.9, 0.5]])
    with pytest.raises(GeometryError, match=r"side of the rail cannot be told: at t = 0\.5"):
        hermite_blend(Rail(surface, along), Rail(surface, Curve.bezier([[0.1, 0.3], [0.9, -0.1 + 0.2]])))
    with pytest.raises(GeometryError, match=r"run in opposite senses.*\.reverse\(\)"):
        hermite_blend(Rail(surface, along), Rail(surface, crossing.reverse()))
    beside = [Rail(surface, Curve.bezier([[a, 0.1], [b, 0.1]]), "left") for a, b in ((0.1, 0.5), (0.6, 0.9))]
    with pytest.raises(GeometryError, match=r"parallel to the rail at t = 0\.43"):
        hermite_blend(*beside, tangents="chord")


@pytest.mark.parametrize("apart", [0.0, 1e-14, 1e-12, 1e-10, 1e-8])
def test_crossings_of_both_rails_that_nearly_coincide_are_one(apart):
    def wave(line):
        knots = [0, 0, 0, 0, 1, 1, 1, 1], [0, 0, 0, 0, line, 1, 1, 1, 1]
        u, v = np.meshgrid(
            *(np.array([np.mean(k[i + 1 : i + 4]) for i in range(len(k) - 4)]) for k in knots), indexing="ij"
        )
        return Surface.from_bspline((3, 3), knots, 10 * np.stack([u, v, 0.1 * np.sin(3 * u) * np.cos(4 * v)], -1))

    first = Rail(wave(0.2), Curve.bezier([(0.9, 0.0), (0.9, 1.0)]))
    second = Rail(wave(0.2 + apart) + np.array([12, 0, 5]), Curve.bezier([(0.1, 0.0), (0.1, 1.0)]))
    blend = hermite_blend(first, second, continuity="G2", form="exact")
    assert np.diff(blend.surface.breaks[0]).min() > 1e-3
    assert blend.certificate.inner_crease < 1e-10
    assert blend.certificate.angle <= blend.certificate.proof.angle < 1e-10
    assert blend.certificate.curvature_jump <= blend.certificate.proof.curvature_jump < 1e-8


def test_functions_that_fail_are_named():
    for bulge in (lambda t: 1 if t < 0.5 else 2, lambda t: "much", lambda t: float(t)):
        with pytest.raises(InputError, match="takes an array of parameters"):
            hermite_blend(*rails(pair(), RAILS["straight"]), bulge=bulge)


def test_a_surface_that_folds_says_so():
    """Sections much longer than the rails are apart, on rails that are bent: they cross."""
    plane = Surface.from_bspline((1, 1), ([0, 0, 9, 9],) * 2, [[[0, 0, 0], [0, 9, 0]], [[9, 0, 0], [9, 9, 0]]])
    bent = Curve.bezier([(1, 4), (4.5, 8), (8, 4)])
    made = [hermite_blend(Rail(plane, bent), Rail(plane + np.array([0, 3, 2]), bent), length=size) for size in (3, 60)]
    assert [blend.certificate.valid for blend in made] == [True, False]
    assert "INVALID" in str(made[1].certificate)
