"""Potential blends of surfaces: against the implicit potential method, closed forms, and OCCT.

Reshaped by its normals, a plane, a cylinder or a sphere through a point P has s = the signed distance of P; reshaped
from a reference, s is that of a similarity. So the blend must solve Hoffmann and Hopcroft's implicit equation
f(s1(P), s2(P)) = 0, which knows nothing of parameters, tracing, ribbons or splines.
"""

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Pnt, gp_Vec
from potential_pairs import PAIRS, SIZES, face, normal, plate

import cqblend
from cqblend.errors import GeometryError, InputError

RNG = np.random.default_rng(8)


def points(blend, n=41, m=17):
    """Return points (n, m, 3) of a blend, by OCCT, inside and on its boundary."""
    surface = BRep_Tool.Surface_s(blend.face())
    t, v = np.linspace(*blend.surface.domain[0], n), np.linspace(0, 1, m)
    return np.array([[surface.Value(a, b).Coord() for b in v] for a in t])


def conic(a, b, lam, s1, s2):
    return b**2 * s1**2 + a**2 * s2**2 + a**2 * b**2 - 2 * a * b**2 * s1 - 2 * a**2 * b * s2 + 2 * lam * s1 * s2


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, -3.0])
@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.parametrize("form", ["exact", "compact"])
def test_blends_solve_the_implicit_equation(name, share, form):
    make, amounts = PAIRS[name]
    a, b = SIZES.get(name, (1.0, 1.0))
    lam = share * a * b
    blend = cqblend.potential_blend(*make(), cqblend.Conic(a, b, lam), form=form)
    assert blend.form == form
    p = points(blend)
    s1, s2 = amounts(p)
    allowed = 1e-5 * blend.sweep.width
    gradient = 2 * (1 + abs(share)) * a**2 * b**2 / min(a, b) * (4 if name in SIZES else 1)
    assert np.abs(conic(a, b, lam, s1, s2)).max() < allowed * gradient
    assert np.abs(s1[:, 0]).max() < 1e-6  # rail 1 on surface 1
    assert np.abs(s2[:, 0] - b).max() < allowed  # where it meets surface 2 reshaped by b
    assert np.abs(s2[:, -1]).max() < 1e-6
    assert np.abs(s1[:, -1] - a).max() < allowed
    certificate = blend.certificate
    assert certificate.valid
    assert certificate.gap < (1e-12 if form == "exact" else 2e-7)
    assert certificate.angle < (1e-10 if form == "exact" else 1e-5)
    assert blend.skin <= allowed
    if form == "exact":
        assert certificate.proof.angle < 1e-10


@pytest.mark.parametrize("name", ["plate and tilted pipe", "a ball from its middle"])
def test_joints_are_smooth_by_finite_differences(name):
    """The implicit amounts grow from the rails with the square of the distance."""
    make, amounts = PAIRS[name]
    blend = cqblend.potential_blend(*make(), cqblend.Conic(*SIZES.get(name, (1.0, 1.0)), 0), form="exact")
    surface = BRep_Tool.Surface_s(blend.face())
    for end, which in ((0.0, 0), (1.0, 1)):
        for t in RNG.uniform(0, 1, 9):
            p, u, v = gp_Pnt(), gp_Vec(), gp_Vec()
            surface.D1(t, end, p, u, v)
            here, way = np.array(p.Coord()), np.array(v.Coord())
            way *= 1e-4 / np.linalg.norm(way)
            slope = (amounts(here + way)[which] - amounts(here - way)[which]) / 2e-4
            assert abs(slope) < 1e-8


def test_a_plate_and_a_pipe_make_a_torus():
    blend = cqblend.potential_blend(*PAIRS["plate and pipe"][0](), cqblend.Conic(1, 1, 0))
    p = points(blend)
    assert np.abs(np.hypot(np.hypot(p[..., 0], p[..., 1]) - 4, p[..., 2] - 1) - 1).max() < 1e-5 * 1.5


def patches(seed=0):
    x, y = np.meshgrid(np.linspace(-6, 6, 4), np.linspace(-6, 6, 5), indexing="ij")
    rng = np.random.default_rng(seed)
    floor = np.stack([x, y, rng.uniform(-0.5, 0.5, (4, 5))], axis=-1)
    angle = np.linspace(-0.3, np.pi + 0.3, 5)
    rows = [
        ((2.6 - 0.1 * z) * np.cos(angle), (3.2 - 0.1 * z) * np.sin(angle) - 2, np.full(5, z)) for z in (-3, 0, 3, 6)
    ]
    return [
        cqblend.Surface.from_bspline((3, 4), ([0] * 4 + [1] * 4, [0] * 5 + [1] * 5), net)
        for net in (np.moveaxis(rows, 1, 2), floor)
    ]


def made(relation=None, seed=0, **options):
    tower, floor = patches(seed)
    families = (
        cqblend.reshape(tower, reference=(0, -2, 2), amounts=0.3),
        cqblend.reshape(floor, reference=(0, 0, -12), amounts=0.06),
    )
    return cqblend.potential_blend(*families, relation or cqblend.Conic(1, 1, 0), **options)


@pytest.mark.parametrize("seed", range(3))
def test_bezier_patches_blend_from_boundary_to_boundary(seed):
    """Every section joins two points of the reshaped patches, found again by OCCT."""
    blend = made(seed=seed, form="exact")
    assert blend.certificate.angle < 1e-10
    assert blend.certificate.gap < 1e-13
    tower, floor = blend.families
    for v in (0.0, 0.2, 0.5, 0.8, 1.0):
        s1, s2 = blend.amounts(v)
        faces = [cq.Face(cqblend.to_face(one(s))) for one, s in ((tower, s1), (floor, s2))]
        for t in (0.0, 0.31, 0.77, 1.0):
            vertex = cq.Vertex.makeVertex(*blend.surface(t, v))
            assert max(one.distance(vertex) for one in faces) < 1e-5 * blend.sweep.width
    rails = [rail.curve for rail in blend.rails]
    assert abs(rails[0](0.0)[1]) < 1e-12  # the tower's v runs along
    assert abs(rails[0](1.0)[1] - 1) < 1e-12


def test_swept_points_are_exact():
    """To 1e-12 of the size, on both reshaped surfaces as splines of their own."""
    blend = made()
    t, v = RNG.uniform(0, 1, 50), RNG.uniform(0, 1, 50)
    swept = blend.swept(t, v)
    q = blend.sweep.solve_parameters(t, 1 - v)
    for k, family in enumerate(blend.families):
        for point, uv, s in zip(swept, q[:, 2 * k : 2 * k + 2], blend.amounts(v)[:, k], strict=True):
            assert np.linalg.norm(family(float(s))(*uv) - point) < 1e-12 * 12
    assert np.abs(blend.surface(t, v) - swept).max() < 1.1 * max(blend.skin, 1e-5 * blend.sweep.width)


def test_reach_is_what_a_and_b_say():
    """On planes at right angles, a is the reach on surface 2 and b that on surface 1."""
    net = np.array([[[0, y, z] for z in (-9.0, 9)] for y in (-12.0, 12)])
    wall = cqblend.Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), net)
    p = points(cqblend.potential_blend(normal(plate()), normal(wall), cqblend.Conic(2, 3, 0), form="exact"))
    assert np.abs(p[:, 0] - [3, 0, 0])[:, [0, 2]].max() < 1e-12
    assert np.abs(p[:, -1] - [0, 0, 2])[:, [0, 2]].max() < 1e-12


@pytest.mark.slow
def test_sharpness_grows_as_lambda_falls():
    bends, nearest = [], []
    for lam in (0.9, 0, -1, -10, -100):
        blend = cqblend.potential_blend(*PAIRS["plate and pipe"][0](), cqblend.Conic(1, 1, lam))
        v = np.linspace(0, 1, 801)
        point, rate, second = (blend.surface(np.full_like(v, 0.4), v, 0, k) for k in range(3))
        bends.append((np.linalg.norm(np.cross(rate, second), axis=1) / np.linalg.norm(rate, axis=1) ** 3).max())
        nearest.append(np.hypot(np.hypot(point[:, 0], point[:, 1]) - 3, point[:, 2]).min())  # to the edge
    assert (np.diff(nearest) < 0).all()
    assert (np.diff(bends[1:]) > 0).all()
    assert bends[1] == pytest.approx(1, abs=5e-3)  # the circle


def test_hermite_of_the_same_ribbons_is_near_and_less():
    """For a circle a Hermite section with these ribbons is a known cubic; for a sharp conic it is far off."""
    far = []
    for lam in (0, -10):
        blend = cqblend.potential_blend(*PAIRS["plate and pipe"][0](), cqblend.Conic(1, 1, lam), form="exact")
        plain = blend.hermite
        t, v = np.linspace(0, 1, 33), np.linspace(0, 1, 33)
        for end in (0, -1):
            assert np.abs(plain.surface.grid(t, v)[:, end] - blend.surface.grid(t, v)[:, end]).max() < 1e-13
        assert plain.certificate.angle < 1e-10
        far.append(np.abs(plain.surface.grid(t, v) - blend.surface.grid(t, v)).max())
    assert 0.01 < far[0] < 0.2
    assert far[1] > 0.05


def test_other_relations():
    def circle(x):
        return 1 - np.sin(np.pi * x / 2), 1 - np.cos(np.pi * x / 2)

    for relation in (circle, (lambda x: circle(x)[0], lambda x: circle(x)[1])):
        p = points(cqblend.potential_blend(*PAIRS["plate and pipe"][0](), relation))
        assert np.abs(np.hypot(np.hypot(p[..., 0], p[..., 1]) - 4, p[..., 2] - 1) - 1).max() < 2e-5
    fork = cqblend.BezierRelation([(1, 0), (0.4, 0), (0.9, 0.9), (0, 0.4), (0, 1)])
    blend = cqblend.potential_blend(*PAIRS["plate and pipe"][0](), fork)
    p = points(blend)
    s = np.stack(PAIRS["plate and pipe"][1](p), axis=-1)
    curve = fork(np.linspace(0, 1, 20001))
    assert max(np.linalg.norm(curve - one, axis=1).min() for one in s[::5].reshape(-1, 2)) < 1e-4


def test_amounts_that_vanish_keep_the_joint():
    """Half of the pipe's wall is not reshaped: there the blend is the pipe, and the plate's joint stays as sharp."""
    angle = np.arange(19) * np.pi / 8
    circle = 3 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    _, knots, row, _ = cqblend.Curve.from_bspline(3, np.arange(-3, 20) / 16, circle).to_bspline()
    net = np.stack([np.insert(row, 2, z, axis=1) for z in (-5.0, 5.0)], axis=1)
    wall = cqblend.Surface.from_bspline((3, 1), (knots, [0, 0, 1, 1]), net)
    functions = [[0.0 if 5 <= j <= 13 else 1.0] * 2 for j in range(19)]
    blend = cqblend.potential_blend(normal(plate()), normal(wall, functions), cqblend.Conic(1, 0.6, 0), form="exact")
    first, second = blend.certificate.rails
    assert 0.3 < first.kept < 0.5
    assert second.kept == 0
    assert blend.certificate.angle < 1e-10
    assert "side 1: the joint stays as it was on " in str(blend.certificate)
    assert [ribbon.order for ribbon in blend.ribbons] == [0, 1]
    t = np.linspace(0, 1, 401)
    u = blend.rails[1].curve(t)[:, 0]
    kept = (u > wall.breaks[0][6]) & (u < wall.breaks[0][10])
    p = blend.surface.grid(t[kept], np.linspace(0, 1, 17))
    ruling = wall(u[kept], np.zeros(kept.sum()))
    assert np.abs(p[..., :2] - ruling[:, None, :2]).max() < 1e-5
    assert np.abs(p[:, 0, 2]).max() < 1e-12  # it starts in the plate


BALL = cq.Workplane().sphere(5).faces().val()
PIPE = face(cq.Solid.makeCylinder(3, 12, cq.Vector(0, 0, -6)), "CYLINDER")
CONIC = cqblend.Conic(1, 1, 0)
BAD = [
    (
        lambda: cqblend.potential_blend(normal(plate(lift=9.0)), normal(BALL), CONIC),
        "do not meet at s = .* come within .* at \\(",
    ),
    (lambda: cqblend.potential_blend(normal(BALL), normal(PIPE), CONIC), "meet in 2 curves .* closed through .*near="),
    (
        lambda: cqblend.potential_blend(normal(plate()), normal(PIPE, -1), cqblend.Conic(1, 3.5, 0)),
        "surface 2 is reshaped so far that it turns over .* s = .* at \\(",
    ),
    (
        lambda: cqblend.potential_blend(normal(BALL), normal(PIPE), cqblend.Conic(3, 1, 0), near=(0, 0, 5)),
        "leaves surface 2 at v = 12.* s = ",
    ),
    (
        lambda: cqblend.potential_blend(normal(plate(lift=5 + 2 * (1 - np.sqrt(0.5))), -1), normal(BALL), CONIC),
        "touch, at an angle of .* at s = .0.2929, 0.2929., at \\(.*5.2929\\)",
    ),
    (
        lambda: cqblend.potential_blend(normal(plate(lift=4.8), 1), normal(BALL), cqblend.Conic(0.5, 0.1, 0)),
        "lost near s = |do not meet at s",
    ),
    (lambda: cqblend.potential_blend(normal(plate()), normal(PIPE), CONIC, near=(0, 0)), "near is a point"),
    (lambda: cqblend.potential_blend(normal(plate()), normal(PIPE), CONIC, near="top"), "near is a point"),
    (lambda: cqblend.potential_blend(normal(plate()), normal(PIPE), CONIC, skin=0), "skin must be above 0"),
    (lambda: cqblend.potential_blend(normal(plate()), normal(PIPE), CONIC, skin=1e-9), "below .* of the distance"),
    (lambda: cqblend.potential_blend(normal(plate(), 0), normal(PIPE), CONIC), "amounts of surface 1 are 0 throughout"),
    (lambda: cqblend.potential_blend(normal(plate()), normal(PIPE), lambda x: None), "a relation returns s1 and s2"),
    (lambda: cqblend.potential_blend(normal(plate()), normal(PIPE), CONIC, form="neat"), "form must be"),
    (lambda: cqblend.potential_blend(normal(plate()), 5, CONIC), "surface must be a face"),
    (lambda: cqblend.potential_blend(plate(), normal(PIPE), CONIC), "lies in the surface"),
    (lambda: cqblend.potential_blend(normal(plate()), normal(PIPE), "conic"), "a relation is"),
    (lambda: made(seed=1, near=(0, 0, 0), relation=lambda x: (1 - x, x)), "slopes"),
]


@pytest.mark.parametrize(("make", "message"), BAD)
def test_what_cannot_be_blended_says_why_and_where(make, message):
    with pytest.raises((GeometryError, InputError), match=message):
        make()


def test_a_reference_on_the_wrong_side_is_told():
    tower, floor = patches()
    families = (
        cqblend.reshape(tower, reference=(0, 0, 2), amounts=0.3),
        cqblend.reshape(floor, reference=(0, 0, -12), amounts=0.06),
    )
    with pytest.raises(GeometryError, match=r"surface 1 does not move to the same side .* another reference"):
        cqblend.potential_blend(*families, CONIC)


def test_near_chooses():
    for z in (4.0, -4.0):
        blend = cqblend.potential_blend(normal(BALL), normal(PIPE), cqblend.Conic(0.5, 0.5, 0), near=(0, 3, z))
        assert np.sign(blend.surface(0.5, 0.5)[2]) == np.sign(z)


def test_swept_points_stay_in_their_range():
    blend = made()
    with pytest.raises(InputError, match="runs over"):
        blend.swept(0.5, 1.1)
    with pytest.raises(InputError, match="runs over"):
        blend.swept(np.array([0.5, -0.1]), 0.5)


def test_known_kinks_make_no_spans_shorter_than_those_of_the_rails():
    """The pipe is three arcs, at whose ends curves bend although no surface does."""
    pipe = face(cq.Solid.makeCylinder(2, 12, cq.Vector(0, 0, -6)), "CYLINDER")
    blend = cqblend.potential_blend(normal(plate()), normal(pipe), cqblend.Conic(1, 1, -3), form="exact")
    shortest = min(np.diff(ribbon.c.breaks).min() for ribbon in blend.ribbons)
    assert np.diff(blend.surface.breaks[0]).min() > 0.3 * shortest


@pytest.mark.parametrize("centre", [(1e4, 0.0, 0.0), (1e4, 1e4, 0.0)])
def test_blends_far_from_the_origin(centre):
    pipe = face(cq.Solid.makeCylinder(2, 12, cq.Vector(*centre) - cq.Vector(0, 0, 6)), "CYLINDER")
    blend = cqblend.potential_blend(
        normal(plate() + np.array(centre)), normal(pipe), cqblend.Conic(1, 1, -3), form="exact"
    )
    assert blend.certificate.angle < 1e-9
    assert blend.certificate.valid
    p = points(blend) - centre
    assert np.abs(conic(1, 1, -3, p[..., 2], np.hypot(p[..., 0], p[..., 1]) - 2)).max() < 3e-4


def rough(seed=5):
    """Return a gentle quadratic B-spline, C1, and a wall through it."""
    x, y = np.meshgrid(np.linspace(-8, 8, 5), np.linspace(-8, 8, 5), indexing="ij")
    net = np.stack([x, y, np.random.default_rng(seed).uniform(-0.4, 0.4, (5, 5))], axis=-1)
    knots = [0, 0, 0, 1, 2, 3, 3, 3]
    wall = np.array([[[t, 0.3 * t, z] for z in (-6.0, 6)] for t in (-30.0, 30)])
    return cqblend.Surface.from_bspline((2, 2), (knots, knots), net), cqblend.Surface.from_bspline(
        (1, 1), ([0, 0, 1, 1],) * 2, wall
    )


def test_rough_surfaces_get_a_looser_skin_and_say_so():
    quadratic, wall = rough()
    with pytest.raises(GeometryError, match=r"crease of 0\.001\d rad inside, .* v = 1 of surface 2, which is only G1"):
        cqblend.potential_blend(normal(wall), normal(quadratic), cqblend.Conic(0.5, 0.4), form="exact")
    blend = cqblend.potential_blend(normal(wall), normal(quadratic), cqblend.Conic(0.5, 0.4), form="exact", crease=0.01)
    assert blend.certificate.angle < 1e-10
    assert blend.certificate.gap < 1e-12
    assert blend.skin <= 2e-3 * blend.sweep.width
    t, v = np.meshgrid(np.linspace(*blend.sweep.domain, 33), np.linspace(0, 1, 17), indexing="ij")
    assert np.linalg.norm(blend.surface(t, v) - blend.swept(t, v), axis=-1).max() <= 1.5 * blend.skin


@pytest.mark.slow
def test_a_rail_over_a_pole_is_told():
    ball = cq.Workplane().sphere(6).faces().val()
    pipe = face(cq.Solid.makeCylinder(2, 12, cq.Vector(2.25, 0, 0)), "CYLINDER")
    with pytest.raises(GeometryError, match=r"surface 1 is singular .* near .* keep the blend clear of it"):
        cqblend.potential_blend(normal(ball), normal(pipe), cqblend.Conic(0.5, 0.5))
