"""Families of reshaped surfaces: against control points moved by hand in exact arithmetic, and closed forms."""

from fractions import Fraction
from math import comb

import cadquery as cq
import numpy as np
import pytest

from cqblend import reshape, to_surface
from cqblend.blends.potential.offset_family import interpolate_unit_normals
from cqblend.blends.potential.surface_family import find_closed_directions
from cqblend.errors import GeometryError, InputError
from cqblend.splines import Curve, Surface

RNG = np.random.default_rng(6)
NET = (
    RNG.normal(size=(4, 5, 3)) + 3 * np.stack(np.meshgrid(np.arange(4), np.arange(5), [0], indexing="ij"), -1)[:, :, 0]
)
UV = RNG.random((7, 2))


def bezier(net, weights=None):
    p, q = np.array(net.shape[:2]) - 1
    return Surface.from_bspline((p, q), (np.repeat([0.0, 1.0], p + 1), np.repeat([0.0, 1.0], q + 1)), net, weights)


def bernstein(n, i, x):
    return comb(n, i) * x**i * (1 - x) ** (n - i)


def value(net, u, v):
    """Evaluate a Bezier patch in fractions, eq. 3 as it stands."""
    u, v = Fraction(float(u)), Fraction(float(v))
    out = [Fraction(0)] * 3
    for j, row in enumerate(net):
        for k, point in enumerate(row):
            weight = bernstein(len(net) - 1, j, u) * bernstein(len(row) - 1, k, v)
            out = [have + weight * part for have, part in zip(out, point, strict=True)]
    return out


def moved(net, reference, amount):
    """Move control points along their vectors from the reference, in fractions; ``amount`` (j, k) says how far."""
    c = [Fraction(float(x)) for x in reference]
    return [
        [
            [p + Fraction(amount(j, k)) * (p - q) for p, q in zip(map(Fraction, point.tolist()), c, strict=True)]
            for k, point in enumerate(row)
        ]
        for j, row in enumerate(net)
    ]


def at(family, s, uv=UV):
    """Evaluate a family without making a surface of it: what blends do."""
    course = family.course(Curve.bezier(np.array([[0.0], [0.0], [s]])), "1")  # 0 and slope 0 at x = 0, s at x = 1
    return family.jet(uv, course(np.ones(len(uv))))


CASES = {
    "centroid": ({}, lambda: NET.mean(axis=(0, 1)), lambda s: lambda j, k: s),
    "point": ({"reference": (1, 2, -3)}, lambda: (1, 2, -3), lambda s: lambda j, k: s),
    "extents": (
        {"reference": "extents", "tuning": (1, 0.5, 0)},
        lambda: np.ptp(NET, axis=(0, 1)) / 2 * [1, 0.5, 0],
        lambda s: lambda j, k: s,
    ),
    "shrinking": ({"amounts": -0.5}, lambda: NET.mean(axis=(0, 1)), lambda s: lambda j, k: -s / 2),
    "function": ({"amounts": lambda s: s**2}, lambda: NET.mean(axis=(0, 1)), lambda s: lambda j, k: s**2),
    "per control point": (
        {"amounts": [[0, 1, 2.0, np.sin, None]] * 4},
        lambda: NET.mean(axis=(0, 1)),
        lambda s: lambda j, k: [0, s, 2 * s, np.sin(s), s][k],
    ),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("s", [0.0, 0.25, -0.5])
def test_control_points_move_along_their_vectors_from_the_reference(name, s):
    options, reference, amount = CASES[name]
    family = reshape(bezier(NET), **options)
    net = moved(NET, reference(), amount(s))
    expected = np.array([[float(x) for x in value(net, *uv)] for uv in UV])
    assert np.abs(family(s)(*UV.T) - expected).max() < 1e-14 * 12
    if s:
        assert np.abs(at(family, s)[0] - expected).max() < 1e-13 * 12


def test_a_reference_may_wander():
    def reference(s):
        return np.stack([s, 0 * s, -3 - s], axis=-1)

    family = reshape(bezier(NET), reference=reference)
    for s in (0.25, 0.5):
        net = moved(NET, (s, 0, -3 - s), lambda j, k, s=s: s)
        expected = np.array([[float(x) for x in value(net, *uv)] for uv in UV])
        assert np.abs(family(s)(*UV.T) - expected).max() < 1e-13
        assert np.abs(at(family, s)[0] - expected).max() < 1e-12


def test_weights_stay():
    weights = RNG.uniform(0.5, 2, size=(4, 5))
    surface = bezier(NET, weights)
    family = reshape(surface, reference=(0, 0, 0))
    assert np.abs(family(0.5)(*UV.T) - 1.5 * surface(*UV.T)).max() < 1e-13
    assert np.array_equal(family(0.5).to_bspline()[3], weights)


@pytest.mark.parametrize("name", ["centroid", "function", "per control point", "normal", "normal per control point"])
def test_derivatives_are_those_of_the_values(name):
    options = {
        "normal": {"by": "normal"},
        "normal per control point": {"by": "normal", **CASES["per control point"][0]},
    }
    family = reshape(bezier(NET), **(options[name] if name in options else CASES[name][0]))
    course = family.course(Curve.bezier(np.array([[0.0], [0.0], [0.3]])), "1")
    x, h = RNG.random(7), 1e-5

    def point(uv, x):
        return family.jet(uv, course(x))[0]

    jet = family.jet(UV, course(x))
    for k, step in enumerate(np.eye(2) * h, 1):
        assert (
            np.abs((point(UV + step, x) - point(UV - step, x)) / (2 * h) - jet[k]).max() < 1e-8 * np.abs(jet[k]).max()
        )
    assert np.abs((point(UV, x + h) - point(UV, x - h)) / (2 * h) - jet[3]).max() < 1e-8 * np.abs(jet[3]).max()


def faces():
    cylinder = cq.Solid.makeCylinder(3, 7, cq.Vector(1, 2, 3), cq.Vector(1, 1, 0.3))
    cone = cq.Solid.makeCone(3, 1, 4)
    return {
        "plane": cq.Solid.makeBox(3, 4, 5).Faces()[0],
        "cylinder": next(face for face in cylinder.Faces() if face.geomType() == "CYLINDER"),
        "cone": next(face for face in cone.Faces() if face.geomType() == "CONE"),
        "sphere": cq.Workplane().sphere(5).faces().val(),
        "torus": cq.Workplane(cq.Solid.makeTorus(5, 2)).faces().val(),
    }


@pytest.mark.parametrize("name", faces())
@pytest.mark.parametrize("sign", [1, -1])
def test_offsets_of_analytic_faces_are_exact_families(name, sign):
    """By OCCT: every point of the reshaped surface is at s from the face."""
    face = faces()[name]
    family = reshape(face, by="normal", amounts=sign)
    surface, base = family(0.5), to_surface(face)
    assert interpolate_unit_normals(base) is not None
    assert surface.degree == base.degree
    (u0, u1), (v0, v1) = base.domain
    u, v = u0 + (u1 - u0) * RNG.uniform(0.05, 0.95, 40), v0 + (v1 - v0) * RNG.uniform(0.05, 0.95, 40)
    for point, foot in zip(surface(u, v), base(u, v), strict=True):
        assert np.linalg.norm(point - foot) == pytest.approx(0.5, abs=1e-13)
        apart = cq.Vertex.makeVertex(*point).distance(cq.Workplane(face).val())
        assert apart == pytest.approx(0.5, abs=1e-9)


def test_offsets_of_freeform_surfaces_are_splines_within_their_tolerance():
    x, y = np.meshgrid(np.linspace(0, 6, 4), np.linspace(0, 8, 5), indexing="ij")
    surface = bezier(np.stack([x, y, np.cos(x) + np.sin(y)], axis=-1))
    for tolerance in (1e-3, 1e-6):
        offset = reshape(surface, by="normal", tolerance=tolerance)(0.5)
        assert interpolate_unit_normals(surface) is None
        jet = surface.jet(*UV.T, 1)
        normal = np.cross(jet[1, 0], jet[0, 1])
        expected = jet[0, 0] + 0.5 * normal / np.linalg.norm(normal, axis=1)[:, None]
        assert np.abs(offset(*UV.T) - expected).max() <= 0.5 * tolerance


def test_closed_surfaces_are_periodic_unless_their_amounts_are_not():
    pipe = to_surface(faces()["cylinder"])
    assert find_closed_directions(pipe) == (True, False)
    assert reshape(pipe, by="normal").primary.periods[0] is not None
    rows = pipe.to_bspline()[2].shape[0]
    uneven = [[1.0 + j / rows] * 2 for j in range(rows)]
    assert reshape(pipe, by="normal", amounts=uneven).primary.periods == (None, None)
    assert reshape(pipe, amounts=uneven).primary.periods == (None, None)


PLANE = bezier(np.stack([*np.meshgrid([0.0, 3, 6], [0.0, 5], indexing="ij"), np.zeros((3, 2))], axis=-1))
BAD = [
    (lambda: reshape(PLANE), "lies in the surface, which is a plane"),
    (lambda: reshape(PLANE, reference=(77, -5, 0)), "lies in the surface"),
    (lambda: reshape(3), "surface must be a face"),
    (lambda: reshape(PLANE, by="magic"), "by must be"),
    (lambda: reshape(PLANE, by="normal", reference=(0, 0, 1)), "normals need none"),
    (lambda: reshape(PLANE, reference=(0, 0)), "a reference is"),
    (lambda: reshape(PLANE, reference="middle"), "reference must be"),
    (lambda: reshape(PLANE, reference=(0, 0, np.nan)), "a reference is"),
    (lambda: reshape(PLANE, reference=lambda s: s), "points"),
    (lambda: reshape(PLANE, reference=(0, 0, 1), tuning=(1, 2)), "tuning is three numbers"),
    (lambda: reshape(PLANE, reference="extents", tuning=None), "tuning is three numbers"),
    (lambda: reshape(PLANE, reference="extents", tuning=3), "tuning is three numbers"),
    (lambda: reshape(PLANE, reference=(0, 0, 1), amounts="2"), "amounts must be a finite number"),
    (lambda: reshape(PLANE, reference=(0, 0, 1), amounts=np.inf), "amounts must be a finite number"),
    (lambda: reshape(PLANE, reference=(0, 0, 1), amounts=[[1, 2], [3, 4]]), "3 x 2 control points"),
    (lambda: reshape(PLANE, reference=(0, 0, 1), amounts=[1, 2, 3]), "3 x 2 control points"),
    (lambda: reshape(PLANE, by="normal", tolerance=0), "tolerance must be above 0"),
    (lambda: at(reshape(PLANE, by="normal", amounts=lambda s: s + 1), 1.0), "is 1 at s = 0"),
    (lambda: at(reshape(PLANE, by="normal", amounts=np.sqrt), 1.0), "too steeply"),
    (lambda: at(reshape(PLANE, by="normal", amounts=lambda s: s / 0), 1.0), "not finite|returns as many"),
    (lambda: at(reshape(PLANE, by="normal", amounts=lambda s: [1, 2, 3]), 1.0), "returns as many numbers"),
]


@pytest.mark.filterwarnings("ignore:invalid value", "ignore:divide by zero")
@pytest.mark.parametrize(("make", "message"), BAD)
def test_what_cannot_be_reshaped_says_why(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_creases_tear_offsets():
    net = np.array([[[x, y, abs(x - 1)] for y in (0.0, 1)] for x in (0.0, 1, 2)])
    roof = Surface.from_bspline((1, 1), ([0, 0, 1, 2, 2], [0, 0, 1, 1]), net)
    with pytest.raises(GeometryError, match=r"crease of 1.6 rad at u = 1: .* from a reference"):
        reshape(roof, by="normal")
    assert reshape(roof, reference=(1, 0, -1))(1.0)(1.0, 0.0).tolist() == [1, 0, 1]


@pytest.mark.parametrize("mirrored", [False, True])
def test_normals_of_faces_point_out_of_the_material(mirrored):
    solid = cq.Workplane().box(4, 6, 8).faces(">Z").workplane().circle(1).cutThruAll().val()
    solid = solid.mirror("XZ") if mirrored else solid
    for one in solid.Faces():
        surface, grown = to_surface(one), reshape(one, by="normal")(0.1)
        (u0, u1), (v0, v1) = surface.domain
        at = 0.6 * u0 + 0.4 * u1, 0.7 * v0 + 0.3 * v1
        assert (grown(*at) - surface(*at)) @ np.array(one.normalAt(cq.Vector(*surface(*at))).toTuple()) > 0.099


@pytest.mark.parametrize("low", [-15.0, -0.3, 0.0, 2.0, 7.34])
def test_kinks_of_a_closed_direction_are_those_of_every_period(low):
    pipe = cq.Workplane().cylinder(12, 2).faces("%CYLINDER").val()
    family = reshape(pipe, by="normal")
    within = low, low + 2 * np.pi
    knots, orders = family.kinks(0, within)
    inside = np.sort(knots[(knots >= within[0]) & (knots < within[1])])
    thirds = np.arange(-9, 12) * 2 * np.pi / 3
    np.testing.assert_allclose(inside, thirds[(thirds >= within[0]) & (thirds < within[1])], atol=1e-12)
    assert len(orders) == len(knots)
