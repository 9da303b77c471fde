"""Potential blends with an implicit partner: against the implicit potential method, by OCCT's points of the blend."""

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Pnt, gp_Vec
from potential_pairs import axis_distance, face, normal, plate

import cqblend
from cqblend.errors import GeometryError, InputError

RADII = np.array([6.0, 5.0, 4.0])
LEAN = (0.3, 0.1, 1.0)


def ellipsoid(x, y, z):
    return np.sqrt((x / 6) ** 2 + (y / 5) ** 2 + (z / 4) ** 2) - 1


def ellipsoid_gradient(x, y, z):
    return np.stack([x / 36, y / 25, z / 16]) / (ellipsoid(x, y, z) + 1)


def level(x, y, z):
    return z


def level_gradient(x, y, z):
    return 0 * x, 0 * y, 1 + 0 * z


def waves(x, y, z):
    return z - 0.4 * np.cos(x / 3) - 0.2 * np.sin(y / 2)


def waves_gradient(x, y, z):
    return np.stack([0.4 / 3 * np.sin(x / 3), -0.1 * np.cos(y / 2), 1 + 0 * z])


def pipe(radius, origin, direction=(0, 0, 1), height=12.0):
    solid = cq.Solid.makeCylinder(radius, height, cq.Vector(*origin), cq.Vector(*direction))
    return normal(face(solid, "CYLINDER"))


def bent_sheet():
    """Return an open sheet that rises from the waves, and the distance function of its plane-parallel copies."""
    net = np.array([[[x, 0.0, z] for z in (-4.0, 8.0)] for x in (-5.0, 5.0)])
    return cqblend.Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), net)


CASES = {
    # parametric family, its amount s1 at any point, implicit surface, (a, b, lambda)
    "pipe on a plane": (
        lambda: pipe(3, (0, 0, -5)),
        lambda p: np.hypot(p[..., 0], p[..., 1]) - 3,
        (level, level_gradient),
        (1.0, 1.0, 0.0),
    ),
    "leaning pipe on an ellipsoid": (
        lambda: pipe(1.5, (0.5, 0, 0), LEAN),
        lambda p: axis_distance(p, [0.5, 0, 0], LEAN) - 1.5,
        (ellipsoid, ellipsoid_gradient),
        (0.8, 0.15, -0.1),
    ),
    "wall on waves": (
        lambda: normal(bent_sheet(), -1),
        lambda p: p[..., 1],
        (waves, waves_gradient),
        (1.0, 0.8, 0.0),
    ),
}


def blend_case(name, **options):
    make, _, functions, conic = CASES[name]
    return cqblend.potential_blend(make(), cqblend.ImplicitSurface(*functions), cqblend.Conic(*conic), **options)


def occt_jets(blend, t, v):
    surface, out = BRep_Tool.Surface_s(blend.face()), []
    for a, b in zip(*np.broadcast_arrays(t, v), strict=True):
        point, along, across = gp_Pnt(), gp_Vec(), gp_Vec()
        surface.D1(float(a), float(b), point, along, across)
        out.append([point.Coord(), along.Coord(), across.Coord()])
    return np.array(out).swapaxes(0, 1)


@pytest.mark.parametrize("form", ["exact", "compact"])
@pytest.mark.parametrize("name", CASES)
def test_blends_solve_the_implicit_equation(name, form):
    """f(s1(P), s2(P)) = 0 by the conic, with the amounts of both surfaces as functions of space."""
    _, amount, (function, _), (a, b, lam) = CASES[name]
    blend = blend_case(name, form=form)
    t, v = (x.ravel() for x in np.meshgrid(np.linspace(*blend.surface.domain[0], 41), np.linspace(0, 1, 17)))
    points = occt_jets(blend, t, v)[0]
    s1, s2 = amount(points), function(*points.T)
    conic = b**2 * s1**2 + a**2 * s2**2 + a**2 * b**2 - 2 * a * b**2 * s1 - 2 * a**2 * b * s2 + 2 * lam * s1 * s2
    allowed = 1e-5 * blend.sweep.width
    assert np.abs(conic).max() < 4 * allowed * max(a, b) ** 3
    assert blend.skin <= 2 * allowed
    assert np.abs(s1[v == 0]).max() < 1e-6
    assert np.abs(s2[v == 1]).max() < (1e-8 if form == "exact" else 2e-7)
    assert np.abs(s1[v == 1] - a).max() < allowed
    assert np.abs(s2[v == 0] - b).max() < allowed


@pytest.mark.parametrize("name", CASES)
def test_joints_are_exact_on_the_parametric_side_and_as_measured_on_the_other(name):
    _, amount, (function, gradient), _ = CASES[name]
    blend = blend_case(name, form="exact")
    first, second = blend.certificate.rails
    assert blend.certificate.valid
    assert first.gap < 1e-12
    assert first.angle < 1e-10
    assert second.gap < 1e-8
    assert second.angle < 1e-6
    assert blend.certificate.proof is None
    t = np.linspace(*blend.surface.domain[0], 173)
    point, along, across = occt_jets(blend, t, 1.0)
    normals, slopes = np.cross(along, across), np.stack(gradient(*point.T), axis=1)
    sine = np.linalg.norm(np.cross(normals, slopes), axis=1)
    angle = np.arctan2(sine, np.abs((normals * slopes).sum(axis=1)))
    assert angle.max() <= 1.5 * second.angle + 1e-15
    assert (np.abs(function(*point.T)) / np.linalg.norm(slopes, axis=1)).max() <= 1.5 * second.gap + 1e-15
    point, _, across = occt_jets(blend, t, 0.0)
    way = 1e-4 * across / np.linalg.norm(across, axis=1)[:, None]
    assert np.abs(amount(point + way) - amount(point - way)).max() / 2e-4 < 1e-7


def test_curves_and_amounts_are_those_of_the_relation():
    blend = blend_case("leaning pipe on an ellipsoid")
    v = np.linspace(0, 1, 9)
    s1, s2 = blend.amounts(v).T
    points = blend.swept(0.37, v)
    assert np.abs(axis_distance(points, [0.5, 0, 0], LEAN) - 1.5 - s1).max() < 1e-12
    assert np.abs(ellipsoid(*points.T) - s2).max() < 1e-12


def test_of_several_curves_the_nearest_is_taken():
    through = pipe(1.5, (0, 0, -10), height=20.0)
    ball = cqblend.ImplicitSurface(ellipsoid, ellipsoid_gradient)
    relation = cqblend.Conic(0.6, 0.1, 0)
    with pytest.raises(GeometryError, match="meet in 2 curves"):
        cqblend.potential_blend(through, ball, relation)
    for height in (-4, 4):
        blend = cqblend.potential_blend(through, ball, relation, near=(0, 0, height))
        assert blend.surface(0.2, 0.5)[2] * height > 0


def wrong_gradient(x, y, z):
    return np.stack([x, y, z])


BAD = {
    "first": ((None, None), InputError, "is to be surface 2"),
    "gradient": ((level, wrong_gradient), InputError, "but differences of its function are"),
    "shape of f": ((lambda x, y, z: 1.0, level_gradient), InputError, "not an array of shape"),
    "shape of gradient": ((level, lambda x, y, z: np.stack([x, y, z], axis=1)), InputError, "three arrays"),
    "not finite": ((lambda x, y, z: z * np.nan, level_gradient), InputError, "not finite"),
    "raises": ((lambda x, y, z: {}[0], level_gradient), InputError, "takes arrays x, y and z"),
    "no function": ((level, 3.0), InputError, "is a function of x, y and z"),
    "apart": ((lambda x, y, z: z - 40, level_gradient), GeometryError, "does not meet f = "),
}


def blend_bad(function, gradient):
    if function is None:
        return cqblend.potential_blend(cqblend.ImplicitSurface(level, level_gradient), plate(), cqblend.Conic(1, 1, 0))
    partner = cqblend.ImplicitSurface(function, gradient)
    return cqblend.potential_blend(pipe(3, (0, 0, -5)), partner, cqblend.Conic(1, 1, 0))


@pytest.mark.parametrize("name", BAD)
def test_bad_partners_are_named(name):
    functions, error, message = BAD[name]
    with pytest.raises(error, match=message):
        blend_bad(*functions)
