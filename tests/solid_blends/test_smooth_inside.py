"""Blends are smooth inside: across knot lines where only parameters have a kink, and else as sharp as is asked for.

Measured by OCCT's one-sided derivatives at the knots of the blend, and against closed forms of the surfaces.
"""

import math
import re

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_SurfaceOfRevolution

import cqblend
from cqblend import Curve, Rail, Surface, hermite_blend
from cqblend.errors import GeometryError, InputError
from cqblend.splines import bernstein
from cqblend.surfaces.tensor_surface import TensorSurface

STATIONS = np.linspace(0.03, 0.97, 7).tolist()


def inner_angle(face) -> float:
    """The largest angle between normals on both sides of a knot of a blend, by OCCT's polynomials on either side."""
    surface = BRep_Tool.Surface_s(getattr(face, "wrapped", face))
    first, last = surface.FirstVKnotIndex(), surface.LastVKnotIndex()
    worst = 0.0
    for k in range(surface.FirstUKnotIndex() + 1, surface.LastUKnotIndex()):
        for v in STATIONS:
            normals = []
            for span in ((k - 1, k), (k, k + 1)):
                rates = [surface.LocalDN(surface.UKnot(k), v, *span, first, last, *n).Coord() for n in ((1, 0), (0, 1))]
                normals.append(np.cross(*rates))
            worst = max(worst, math.atan2(np.linalg.norm(np.cross(*normals)), normals[0] @ normals[1]))
    return worst


def beside(face, gradient, hesse, end) -> tuple[float, float]:
    """How far a blend is along one boundary from a surface F = 0: the angle of normals, and normal curvatures."""
    surface = BRep_Tool.Surface_s(face.wrapped)
    u0, u1, *_ = surface.Bounds()
    angle = jump = 0.0
    for u in (u0 + (u1 - u0) * (np.arange(60) + 0.37) / 60).tolist():
        d = {n: np.array(surface.DN(u, end, *n).Coord()) for n in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))}
        p = np.array(surface.Value(u, end).Coord())
        n, g = np.cross(d[1, 0], d[0, 1]), gradient(p)
        sine = np.linalg.norm(np.cross(n, g)) / np.linalg.norm(n) / np.linalg.norm(g)
        angle = max(angle, sine)
        n *= np.sign(n @ g) / np.linalg.norm(n)
        for turn in np.linspace(0, math.pi, 8, endpoint=False):
            a, b = math.cos(turn) / np.linalg.norm(d[1, 0]), math.sin(turn) / np.linalg.norm(d[0, 1])
            way = a * d[1, 0] + b * d[0, 1]
            own = n @ (a * a * d[2, 0] + 2 * a * b * d[1, 1] + b * b * d[0, 2]) / (way @ way)
            jump = max(jump, abs(own + way @ hesse(p) @ way / np.linalg.norm(g) / (way @ way)))
    return angle, jump


def scaled(solid, a, b, c):
    return solid.transformGeometry(cq.Matrix([[a, 0, 0, 0], [0, b, 0, 0], [0, 0, c, 0], [0, 0, 0, 1]]))


def ball():
    return cq.Solid.makeSphere(1, angleDegrees1=-90, angleDegrees2=90)


def ellipsoid(axes):
    weights = 2 / np.square(axes)
    return scaled(ball(), *axes), lambda p: weights * p, lambda _: np.diag(weights)


def slanted(body, normal, at):
    """A body cut by a plane, and the curved edges of the cut."""
    tool = cq.Workplane(cq.Plane(at, (1, 0, 0.001), normal)).box(300, 300, 150, centered=(True, True, False)).val()
    cut = body.cut(tool)
    solid = cut.Solids()[0] if isinstance(cut, cq.Compound) else cut
    plane = cq.Vector(*normal).normalized()
    return solid, [
        edge
        for edge in solid.Edges()
        if all(abs((edge.positionAt(s) - cq.Vector(*at)).dot(plane)) < 1e-6 for s in (0.0, 0.3, 0.7))
    ]


@pytest.mark.parametrize(("continuity", "bound"), [("G1", None), ("G2", 1e-5), ("G3", 1e-5)])
def test_a_cut_ellipsoid_is_blended_without_steering(continuity, bound):
    body, gradient, hesse = ellipsoid((20.0, 11.0, 9.0))
    solid, edges = slanted(body, (0.3, 0.4, 1.0), (1.0, 0.5, 2.0))
    result = cqblend.blend_edges(solid, edges, 1.2, continuity=continuity, steer=0)
    (blend,) = result.faces
    assert result.shape.isValid()
    assert inner_angle(blend) <= 1e-9
    assert result.certificate.inner_crease <= 1e-9
    ends = [beside(blend, gradient, hesse, end) for end in (0.0, 1.0)]
    angle, jump = min(ends)
    assert angle <= 1e-6
    assert bound is None or jump <= bound


def test_the_ridge_of_two_ellipsoids_has_curvature_without_steering():
    """The edge is cut by the splines' own seams and poles; G2 was refused, and G1 had a crease of 7.6e-4 rad."""
    first, second = (
        ball().transformGeometry(cq.Matrix([[a, 0, 0, x], [0, b, 0, y], [0, 0, c, z], [0, 0, 0, 1]]))
        for (a, b, c), (x, y, z) in (((16, 9, 7), (0, 0, 0)), ((12, 10, 8), (10.5, 1.2, 0.8)))
    )
    solid = cq.Workplane(first).intersect(cq.Workplane(second)).val().Solids()[0]
    edges = [edge for edge in solid.Edges() if edge.Length() > 1 and len(edge.ancestors(solid, "Face").Faces()) == 2]
    edges = [edge for edge in edges if cqblend.continuity(solid, edge).angle > 0.1]
    result = cqblend.blend_edges(solid, edges, 0.8, continuity="G2", steer=0)
    assert result.shape.isValid()
    assert max(map(inner_angle, result.faces)) <= 1e-9
    assert result.certificate.curvature_jump <= 1e-4


@pytest.mark.parametrize("shape", ["cylinder", "torus"])
def test_scaled_cylinders_and_tori(shape):
    if shape == "cylinder":
        body = scaled(cq.Solid.makeCylinder(1, 3), 12.0, 7.0, 5.0)
        solid, edges = slanted(body, (0.2, 0.3, 1.0), (0.0, 0.0, 9.0))
    else:
        body = scaled(cq.Solid.makeTorus(2.5, 1), 6.0, 4.0, 5.0)
        solid, edges = slanted(body, (0.1, 0.05, 1.0), (0.0, 0.0, 2.0))
    size = 0.7
    result = cqblend.blend_edges(solid, edges[:1], size, continuity="G2", steer=0)
    assert result.shape.isValid()
    assert max(map(inner_angle, result.faces)) <= 1e-9
    assert result.certificate.curvature_jump <= 1e-4


def wall(kind):
    solid = {
        "cylinder": lambda: cq.Solid.makeCylinder(5, 20),
        "sphere": lambda: cq.Solid.makeSphere(8, angleDegrees1=-90, angleDegrees2=90),
        "torus": lambda: cq.Solid.makeTorus(10, 3),
        "cone": lambda: cq.Solid.makeCone(7, 4, 20),
    }[kind]()
    return cqblend.to_surface(next(f for f in solid.Faces() if f.geomType() == kind.upper()))


def across(surface, *places):
    """A curve through shares of the domain of a surface."""
    low, high = np.transpose(surface.domain)
    return Curve.bezier(low + np.array(places) * (high - low))


@pytest.mark.parametrize("continuity", ["G1", "G2", "G3"])
@pytest.mark.parametrize("kind", ["cylinder", "sphere", "torus", "cone"])
def test_analytic_faces_as_splines_need_no_steering(kind, continuity):
    """Circles of three arcs, whose parametrisation is C1 where they meet: their shape is smooth."""
    first, second = wall(kind), cqblend.to_surface(cq.Solid.makeCylinder(20, 40).Faces()[0])
    rails = (
        Rail(first, across(first, (0.08, 0.4), (0.4, 0.6), (0.9, 0.45)), "left"),
        Rail(second, across(second, (0.08, 0.4), (0.4, 0.5), (0.9, 0.6)), "right"),
    )
    blend = hermite_blend(*rails, continuity=continuity, form="exact", steer=0)
    assert inner_angle(blend.face()) <= 1e-9
    assert blend.certificate.angle <= 1e-10
    assert blend.certificate.curvature_jump <= 1e-7 or continuity == "G1"


def test_directions_that_are_taken_as_they_are_get_the_kink_too():
    """T1 in its own length is no fit, as long as parameters have no kink."""
    rails = [
        Rail(wall(kind), across(wall(kind), (0.08, 0.4), (0.4, 0.6), (0.9, 0.45)), side)
        for kind, side in (("sphere", "left"), ("torus", "right"))
    ]
    blend = hermite_blend(*rails, tangents="parametric", length="field", bulge=0.1, form="exact", steer=0)
    assert inner_angle(blend.face()) <= 1e-8
    assert blend.certificate.angle <= 1e-9


def polynomial(f, p, q):
    """Bernstein coefficients (p+1, q+1, 3) of a polynomial map of the unit square."""
    u, v = ((1 - np.cos(np.pi * np.arange(n + 1) / n)) / 2 for n in (p, q))
    a, b = (np.linalg.inv(bernstein.evaluate_basis(n, 1 - x, x).T) for n, x in ((p, u), (q, v)))
    return np.einsum("iu,jv,uvd->ijd", a, b, f(*np.meshgrid(u, v, indexing="ij")))


def bent(cubic=0.0, square=0.0):
    """Two patches of one graph, the parameters of the second changed by (u, v) -> (x, y); or of two that differ."""

    def height(x, y, more=0.0):
        return np.stack([x, y, 0.3 * x**2 - 0.2 * x * y + 0.15 * y**2 + 0.1 * x**3 - 0.05 * x * y**2 + more], -1)

    def moved(u, v):
        x, y = 1.7 * u * (1 + 0.25 * v) - 0.3 * u**2, v + 0.2 * u * v * (1 - v)
        return height(x, y, square * x**2 + cubic * x**3)

    patches = [polynomial(lambda u, v: height(u - 1, v), 9, 9), polynomial(moved, 9, 9)]
    coefs = np.stack(patches, -1).transpose(0, 1, 2, 3)[..., None]
    return Surface((np.array([-1.0, 0, 1]), np.array([0.0, 1])), coefs, continuity=(np.array([0]), np.empty(0, int)))


@pytest.mark.parametrize(("shape", "more"), [(4, {}), (2, {"cubic": 0.1}), (1, {"square": 0.1})])
def test_the_order_of_a_shape_does_not_depend_on_parameters(shape, more):
    uv = np.array([[0, 0.2], [0, 0.5], [0, 0.9]])
    continuity, found, crease = TensorSurface.from_spline(bent(**more)).measure_smoothness(uv, 0)
    assert continuity == [0] * 3
    assert found == [shape] * 3
    assert max(crease) < 1e-12


@pytest.mark.parametrize("continuity", ["G1", "G2", "G3"])
def test_parameters_with_a_kink_that_varies_along_the_knot_line(continuity):
    """Not even the first derivatives agree, by a factor that is different everywhere."""
    y, (dx, dy) = 0.45, (1.6, 0.5)
    r, s = np.linalg.solve([[1.7 * (1 + 0.25 * y), 0], [0.2 * y * (1 - y), 1]], [dx, dy])
    before = Curve.bezier([[-0.8, 0.2], [-0.53, 0.28], [-dx / 6, y - dy / 6], [0, y]], domain=(0, 0.5))
    after = Curve.bezier([[0, y], [r / 6, y + s / 6], [0.45, 0.62], [0.6, 0.8]], domain=(0.5, 1))
    roof = [[[-1, -1, 2.0], [-1, 2, 2.0]], [[1.5, -1, 1.5], [1.5, 2, 1.5]]]
    plane = Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), roof)
    rails = Rail(bent(), before.join(after)), Rail(plane, Curve.bezier([[0.1, 0.75], [0.9, 0.8]]))
    blend = hermite_blend(*rails, continuity=continuity, steer=0)
    assert inner_angle(blend.face()) <= 1e-9
    assert blend.certificate.curvature_jump <= 1e-4 or continuity == "G1"


# Creases that surfaces make: refused, turned away, or allowed.


def folded_sheets(seed=3):
    """Two bicubic sheets that are C1 at u = 0.6, and rails across that line."""
    knots = [0, 0, 0, 0, 0.6, 0.6, 1, 1, 1, 1], [0, 0, 0, 0, 1, 1, 1, 1]
    x, y = np.meshgrid(np.linspace(0, 10, 6), np.linspace(0, 10, 4), indexing="ij")
    rng = np.random.default_rng(seed)
    sheets = [
        Surface.from_bspline((3, 3), knots, np.stack([x, y, z + rng.uniform(-0.5, 0.5, x.shape)], -1)) for z in (0, 6)
    ]
    curves = Curve.bezier([[0.1, 0.2], [0.9, 0.35]]), Curve.bezier([[0.1, 0.7], [0.9, 0.75]])
    return [Rail(sheet, curve) for sheet, curve in zip(sheets, curves, strict=True)]


def test_a_crease_is_refused_with_the_way_out_and_each_way_is_one():
    rails = folded_sheets()
    with pytest.raises(
        GeometryError, match=r"crease of .* rad inside.*t = .* u = 0\.6 of surface \d, .* only G1"
    ) as told:
        hermite_blend(*rails, steer=0)
    steer, crease, is_ = (
        float(re.search(pattern, str(told.value)).group(1))
        for pattern in (r"steer=([\d.]+)", r"crease=([\d.e-]+)", r"crease of ([\d.e-]+)")
    )
    assert inner_angle(hermite_blend(*rails, steer=steer).face()) <= 1e-9
    allowed = hermite_blend(*rails, steer=0, crease=crease)
    assert inner_angle(allowed.face()) == pytest.approx(is_, rel=0.1)
    for less in (0.0, 0.9 * is_):
        with pytest.raises(GeometryError, match=f"over {max(less, 1e-9):.2g}"):
            hermite_blend(*rails, steer=0, crease=less)


@pytest.mark.parametrize("crease", [-0.1, 1.6, "sharp", math.nan, True, (0.1, 0.1)])
def test_crease_is_an_angle(crease):
    box = cq.Solid.makeBox(3, 3, 3)
    calls = (
        lambda: cqblend.blend_edges(box, box.Edges()[0], 0.5, crease=crease),
        lambda: hermite_blend(*folded_sheets(), crease=crease),
        lambda: cqblend.pde_blend(*folded_sheets(), crease=crease),
        lambda: cqblend.potential_blend(
            *(rail.surface for rail in folded_sheets()), cqblend.Conic(1, 1), crease=crease
        ),
    )
    for call in calls:
        with pytest.raises(InputError, match="crease"):
            call()


def test_a_rail_whose_speed_jumps_is_told():
    """Straight across parameters of unequal speed: the rail is that of its caller, and the blend has its kink."""
    x, y = np.meshgrid([0, 1, 2, 3, 6, 9.0, 12], [0, 4, 8, 12.0], indexing="ij")
    net = np.stack([x, y, 0.02 * y**2], -1)
    surface = Surface.from_bspline((3, 3), ([0] * 4 + [1] * 3 + [2] * 4, [0] * 4 + [1] * 4), net)
    assert TensorSurface.from_spline(surface).measure_smoothness(np.array([[1, 0.4]]), 0)[:2] == ([0], [4])
    corners = [[[0, 0, 9], [0, 9, 4]], [[12, 0, 8], [12, 9, 5]]]
    plate = Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), corners)
    rails = [Rail(surface, Curve.bezier([[0.2, 0.3], [1.8, 0.3]])), Rail(plate, Curve.bezier([[0.1, 0.8], [0.9, 0.9]]))]
    with pytest.raises(GeometryError, match="the speed of the rail on surface 1 jumps"):
        hermite_blend(*rails)


# Open arcs.


def turned(points, angle):
    return cq.Workplane("XZ").polyline(points).close().revolve(angle, (0, 0, 0), (0, 1, 0)).val()


STEP = [(12, 0), (30, 0), (30, 5), (20, 5), (20, 12), (12, 12)]
TAPER = [(12, 0), (30, 0), (27, 6), (20, 11), (12, 11)]


@pytest.mark.parametrize(
    ("points", "radius", "height"), [(STEP, 30, 5), (STEP, 20, 5), (TAPER, 27, 6), (TAPER, 20, 11)]
)
@pytest.mark.parametrize(("angle", "poles"), [(75, 3), (200, 5), (340, 7)])
def test_open_arcs_are_as_light_as_circles(points, radius, height, angle, poles):
    body = turned(points, angle)
    edge = [
        e
        for e in body.Edges()
        if e.geomType() == "CIRCLE" and abs(e.radius() - radius) < 1e-6 and abs(e.Center().z - height) < 1e-6
    ]
    result = cqblend.blend_edges(body, edge, 1.4, section="hermite")
    assert result.shape.isValid()
    assert (result.certificate.degree, result.certificate.poles) == ((2, 3), (poles, 4))
    surface = BRep_Tool.Surface_s(result.faces[0].wrapped)
    u0, u1, *_ = surface.Bounds()
    for v in (0.0, 0.3, 1.0):  # circles about the axis, at one height
        ring = np.array([surface.Value(u, v).Coord() for u in np.linspace(u0, u1, 50).tolist()])
        assert np.ptp(np.hypot(ring[:, 0], ring[:, 1])) <= 1e-12 * radius
        assert np.ptp(ring[:, 2]) <= 1e-12 * radius
    assert isinstance(surface, Geom_SurfaceOfRevolution)
    assert surface.BasisCurve().NbKnots() == 2  # one span: there is nothing inside at which it could crease


# The side of a rail.


def test_the_side_is_told_by_the_whole_rail():
    """Sheets with bumps, side by side: a human sees the side, although the sign changes somewhere along some rails."""
    rng = np.random.default_rng(11)

    def sheet():
        x, y = np.meshgrid(np.linspace(0, 10, 6), np.linspace(0, 10, 6), indexing="ij")
        knots = [0, 0, 0, 0, 1 / 3, 2 / 3, 1, 1, 1, 1]
        return Surface.from_bspline((3, 3), (knots, knots), np.stack([x, y, rng.normal(0, 0.8, (6, 6))], -1))

    changing = 0
    for i in range(40):
        side, waves = ("left", "right")[i % 2], np.clip(rng.normal(0, 0.08, (2, 5)), -0.18, 0.18)
        along = np.linspace(0.1, 0.9, 5)
        one = Rail(sheet(), Curve.bezier(np.stack([along, 0.5 + waves[0]], -1)))
        two = Rail(sheet(), Curve.bezier(np.stack([along, 0.5 + waves[1]], -1)))
        t = np.linspace(0, 1, 200)
        way = np.array([0, 1.0 if side == "left" else -1.0, rng.uniform(-3, 3)])
        two = Rail(two.surface + ((one.curve3d()(t) - two.curve3d()(t)).mean(axis=0) + way), two.curve)
        product = (np.cross(one.curve3d()(t, 1), one.normal()(t)) * (two.curve3d()(t) - one.curve3d()(t))).sum(axis=1)
        changing += bool(product.min() * product.max() < 0)
        assert one.towards(two).side == side
    assert changing >= 3


def test_what_lies_on_both_sides_alike_is_refused_with_the_shares():
    flat = Surface.from_bspline((1, 1), ([0, 0, 9, 9], [0, 0, 9, 9]), [[[0, 0, 0], [0, 9, 0]], [[9, 0, 0], [9, 9, 0]]])
    rail = Rail(flat, Curve.bezier([[1, 5], [8, 5]]))
    with pytest.raises(GeometryError, match=r"50% speak for the left, 50% for the right; give side="):
        rail.towards(Rail(flat, Curve.bezier([[1, 3], [8, 7]])))
    assert rail.towards(Rail(flat, Curve.bezier([[1, 4.5], [8, 7]]))).side == "left"
