"""PDE blends on real surfaces and in solids: how they meet them, by OCCT and by code that knows nothing of cqblend.

What the equations' solutions are is tested against closed forms in ``tests/blends/pde``.
"""

import math

import cadquery as cq
import numpy as np
import pytest
import test_surface_blend as sheets
from places import CASES
from real_parts import PART, SCREW, listed, part
from solid_problems import list_problems

import cqblend
from cqblend import demo
from cqblend.errors import CqblendError, InputError

ORDERS = [2, 4, 6, (2, 2, 4), (2, 2, 6), (4, 4, 6), (6, 4, 2)]
FOLLOWS = {2: "G0", 4: "G1", 6: "G2"}


def lowest(order):
    return min(np.atleast_1d(order))


def occt_jets(face, t, v):
    """Return points, first and second derivatives (6, n, 3) by OCCT: H, Ht, Hv, Htt, Hvv, Htv."""
    from OCP.BRep import BRep_Tool
    from OCP.gp import gp_Pnt, gp_Vec

    surface, out = BRep_Tool.Surface_s(face), []
    for a, b in zip(t, v, strict=True):
        point, vectors = gp_Pnt(), [gp_Vec() for _ in range(5)]
        surface.D2(a, b, point, *vectors)
        out.append([point.Coord(), *(vector.Coord() for vector in vectors)])
    return np.array(out).swapaxes(0, 1)


def angle(a, b):
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1))


# Along rails.


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", ["straight", "rational", "cubic"])
@pytest.mark.parametrize("rational", [False, True])
def test_exact_blends_keep_their_rails_and_planes(name, order, rational):
    """Gap 1e-13 of the size, angle 1e-10 and jump 1e-7 of 1/size by OCCT, whatever the equations are."""
    rails = sheets.rails(sheets.pair(rational=rational), sheets.RAILS[name])
    blend = cqblend.pde_blend(*rails, order=order, form="exact", crease=0.1)
    certificate = blend.certificate
    assert certificate.gap <= 1e-13 * sheets.SIZE
    if lowest(order) >= 4:
        assert certificate.angle <= 1e-10
        assert certificate.angle <= certificate.proof.angle <= 5e-10  # with all that OCCT's evaluation may add
    else:
        assert certificate.angle > 1e-2
    if lowest(order) == 6:
        pieces = np.diff(blend.surface.breaks[0])
        assert certificate.curvature_jump <= 1e-7 / sheets.SIZE * max(1.0, (2e-2 / pieces.min()) ** 2)
        assert certificate.curvature_jump <= certificate.proof.curvature_jump <= 1e-2  # of degree 18 and more
    else:
        assert certificate.curvature_jump > 1e-2


@pytest.mark.parametrize(("order", "limits"), [(4, (1e-7, 1e-5)), (4, (1e-5, 1e-3)), (6, (1e-7, 1e-5))])
def test_compact_blends_keep_the_tolerances(order, limits):
    rails = sheets.rails(sheets.pair(), sheets.RAILS["cubic"])
    options = {"form": "compact", "tolerance": limits[0], "angular_tolerance": limits[1], "crease": 0.1}
    blend = cqblend.pde_blend(*rails, order=order, **options)
    assert blend.surface.degree[0] == 5
    assert blend.certificate.gap <= limits[0]
    assert blend.certificate.angle <= limits[1]


@pytest.mark.parametrize("kind", ["occt", "long"])
@pytest.mark.parametrize(("order", "orders"), [(2, (0, 0)), (4, (1, 1)), (6, (2, 2)), ((4, 4, 6), (1, 1))])
def test_rails_keep_their_planes_by_another_measurement(order, orders, kind):
    """By OCCT's D3, and in long doubles from the arrays of B-splines alone."""
    surfaces, curves = sheets.pair(), sheets.RAILS["straight"]
    blend = cqblend.pde_blend(*sheets.rails(surfaces, curves), order=order, form="exact")
    sheets.examine(blend, surfaces, curves, orders, kind=kind)


@pytest.mark.parametrize("order", [2, 4, 6])
@pytest.mark.parametrize("name", ["straight", "rational"])
def test_the_interior_is_the_solution_but_for_what_the_rails_missed(name, order):
    """And no nearer to it than to the Hermite blend: the equations do change the interior."""
    rails = sheets.rails(sheets.pair(), sheets.RAILS[name])
    blend = cqblend.pde_blend(*rails, order=order, form="exact", crease=0.1)
    hermite = cqblend.hermite_blend(*rails, continuity=FOLLOWS[order], form="exact", crease=0.1)
    t, v = np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 21), indexing="ij")
    missed = np.abs(blend.surface(t, v) - blend.solution(t, v)).max()
    changed = np.abs(blend.surface(t, v) - hermite.surface(t, v)).max()
    assert missed < 0.5 * changed
    assert changed > 0.01
    smooth = np.abs(blend.surface(t, v) - hermite.surface(t, v) - bubbles_of(blend.solution, t, v)).max()
    assert smooth < 2e-5 * sheets.SIZE


def bubbles_of(solution, t, v):
    """Return the solution less the polynomials that carry its boundary data, from its own derivatives at the rails."""
    half = solution.halves[0]
    ends = np.array([[solution(t[:, 0], e, kv=k) for k in range(half)] for e in (0.0, 1.0)])  # (2, half, n, 3)
    matrix = np.array(
        [
            [[math.perm(i, k) * e ** max(i - k, 0) * (i >= k) for i in range(2 * half)] for k in range(half)]
            for e in (0, 1)
        ]
    )
    powers = np.linalg.solve(matrix.reshape(2 * half, 2 * half), ends.reshape(2 * half, -1)).reshape(2 * half, -1, 3)
    carried = sum(powers[i][:, None] * v[..., None] ** i for i in range(2 * half))
    return solution(t, v) - carried


def test_end_sections_of_open_blends_are_hermites():
    rails = sheets.rails(sheets.pair(), sheets.RAILS["straight"])
    v = np.linspace(0, 1, 33)
    for order, continuity in FOLLOWS.items():
        blend = cqblend.pde_blend(*rails, order=order, form="exact")
        hermite = cqblend.hermite_blend(*rails, continuity=continuity, form="exact")
        for t in (0.0, 1.0):
            np.testing.assert_allclose(blend.surface(t, v), hermite.surface(t, v), atol=2e-5 * sheets.SIZE)


@pytest.mark.parametrize("order", [4, 6])
def test_the_middle_of_open_blends_converges(order):
    """With spans along and terms across, on rails whose solutions are singular at the corners."""
    rails = sheets.rails(sheets.pair(), sheets.RAILS["straight"])
    fine = cqblend.pde_blend(*rails, order=order, modes=20, terms=10, tolerance=1e-3).solution(0.5, 0.5)
    for modes, terms in ((8, 3), (12, 4), (16, 6)):
        coarse = cqblend.pde_blend(*rails, order=order, modes=modes, terms=terms, tolerance=1e-3).solution(0.5, 0.5)
        assert np.abs(coarse - fine).max() < 1.5e-3
    misled = cqblend.pde_blend(*rails, order=order, modes=8, terms=6, minimise="residual", tolerance=1e-3)
    assert np.abs(misled.solution(0.5, 0.5) - fine).max() > 4e-3


def test_what_comes_out_does_not_depend_on_how_rails_are_parametrised():
    rails = sheets.rails(sheets.pair(), sheets.RAILS["straight"])
    change = cqblend.change_of_parameter(0.3, 0.6)
    other = [cqblend.Rail(rail.surface, cqblend.reparameterise(rail.curve, change)) for rail in rails]
    first, second = (cqblend.pde_blend(*some, order=4, form="exact", modes=12, terms=6) for some in (rails, other))
    s = np.linspace(0, 1, 21)
    t = change(s)[:, 0]
    apart = first.solution(t[:, None], np.linspace(0, 1, 9)) - second.solution(s[:, None], np.linspace(0, 1, 9))
    assert np.abs(apart).max() < 2e-3 * sheets.SIZE  # directions are fitted on other stations


def test_a_closed_blend_closes_with_its_derivatives():
    ground = sheets.sheet(sheets.FLOOR)
    pipe = cqblend.to_surface(
        cq.Solid.makeCylinder(1.5, 6, cq.Vector(5, 5, 3), cq.Vector(0.1, 0, 1)).faces("%CYLINDER")
    )
    circle = cqblend.Curve.from_bspline(2, np.repeat(np.arange(5) / 4, [3, 2, 2, 2, 3]), *ring((0.5, 0.5), 0.27))
    foot = cqblend.Rail(cqblend.Surface.from_bspline(*ground), circle, "right")
    (u0, u1), (v0, _) = pipe.domain
    rim = cqblend.Rail(pipe, cqblend.Curve.bezier([(u0, v0), (u1, v0)]), "left")
    foot = (
        foot if np.linalg.norm(foot.curve3d()(0.25) - rim.reparametrized(0, 1).curve3d()(0.25)) < 3 else foot.reverse()
    )
    blend = cqblend.pde_blend(rim, foot.reparametrized(u0, u1), order=4, form="exact")
    v = np.linspace(0, 1, 17)
    for k in (0, 1):
        first, last = (blend.surface(at, v, k, 0) for at in blend.surface.domain[0])
        np.testing.assert_allclose(first, last, atol=1e-10 * 100.0**k)
    assert blend.certificate.angle <= 1e-10
    assert type(blend.solution.basis).__name__ == "Waves"


def ring(centre, radius):
    half = math.sqrt(0.5)
    corners = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)])
    return np.array(centre) + radius * corners, np.array([1, half] * 4 + [1])


# In solids.


def box():
    solid = cq.Solid.makeBox(30, 20, 10)
    return solid, solid.edges("|Z and >X and >Y"), {"radius": 4}


def rim():
    part = cq.Workplane().cylinder(20, 10)
    return part.val(), part.edges(">Z"), {"radius": 3}


def boss():
    pin = cq.Solid.makeCylinder(4.5, 20, cq.Vector(0, 0, 0), cq.Vector(1, -0.15, 0.1))
    body = cq.Workplane().sphere(10).union(cq.Workplane(pin))
    return body.val(), body.edges(cq.NearestToPointSelector((9, -4, 0))), {"radius": 2.5}


def pipes():
    body = cq.Workplane().cylinder(40, 6).union(cq.Workplane("YZ").cylinder(30, 3.5).translate((15, 0, 0)))
    return body.val(), body.edges(cq.NearestToPointSelector((5, 0, 3.5))), {"radius": 1.2}


def ellipse():
    body = cq.Workplane().ellipse(12, 7).extrude(10)
    return body.val(), body.edges(">Z"), {"width": (1.5, 2.5)}


BODIES = [box, rim, boss, pipes, ellipse]


@pytest.mark.parametrize("order", [2, 4, 6, (4, 4, 6)])
@pytest.mark.parametrize("make", BODIES)
def test_in_a_solid(make, order):
    solid, edge, size = make()
    result = cqblend.blend_edges(solid, edge, section="pde", order=order, form="exact", **size)
    certificate = result.certificate
    report = cqblend.verify(result.shape, result.faces)
    assert report.ok, report
    assert certificate.gap <= 1e-10
    assert certificate.residual is not None
    if lowest(order) >= 4:
        assert certificate.angle <= 1e-10
    if lowest(order) == 6:
        assert certificate.curvature_jump <= 1e-8
    for face in result.faces:  # the definition of the order, without the certificate
        for line in face.Edges():
            found = cqblend.continuity(result.shape, line)
            if lowest(order) >= 4 and found.angle < 0.1:
                assert found.angle <= 1e-10


@pytest.mark.parametrize("order", [2, 4, 6])
def test_around_an_axis_the_blend_is_a_surface_of_revolution(order):
    solid, edge, size = rim()
    result = cqblend.blend_edges(solid, edge, section="pde", order=order, form="exact", **size)
    blend = cqblend.to_surface(result.faces[0])
    points = blend.grid(np.linspace(*blend.domain[0], 101), np.linspace(0, 1, 17))
    radius = np.hypot(points[..., 0], points[..., 1])
    assert np.ptp(radius, axis=0).max() < 1e-11
    assert np.ptp(points[..., 2], axis=0).max() < 1e-11


@pytest.mark.parametrize("order", [2, 4, 6])
def test_around_an_axis_the_section_is_the_closed_form(order):
    """Radius and height solve their ODEs: the wave 1 of (d/dv)^2 - s^2, to the power of n/2, and a polynomial."""
    solid, edge, size = rim()
    result = cqblend.blend_edges(solid, edge, section="pde", order=order, parameters=0.6, form="exact", **size)
    face = result.faces[0].wrapped
    v = np.linspace(0, 1, 41)
    jets = occt_jets(face, np.full_like(v, 0.37), v)
    radius = np.hypot(jets[0][:, 0], jets[0][:, 1])
    half = order // 2

    def basis(x, k, s):
        """Return k-th derivatives of x^p e^(+-s x), or of powers for s = 0: (n, 2 half)."""
        columns = []
        if s == 0:
            return np.stack([math.perm(p, k) * x ** max(p - k, 0) if p >= k else 0 * x for p in range(2 * half)], -1)
        for sign in (1, -1):
            for p in range(half):
                terms = [
                    math.comb(k, i) * math.perm(p, i) * x ** (p - i) * (sign * s) ** (k - i)
                    for i in range(min(k, p) + 1)
                ]
                columns.append(sum(terms) * np.exp(sign * s * x))
        return np.stack(columns, -1)

    along = jets[0][:, :2] / radius[:, None]
    rate = (jets[2][:, :2] * along).sum(1)
    bend = (jets[4][:, :2] * along).sum(1) + ((jets[2][:, :2] ** 2).sum(1) - rate**2) / radius
    for values, s in (([radius, rate, bend], 0.6), ([jets[0][:, 2], jets[2][:, 2], jets[4][:, 2]], 0)):
        ends = np.array([0.0, 1.0])
        matrix = np.concatenate([basis(ends, k, s) for k in range(half)])
        data = np.concatenate([values[k][[0, -1]] for k in range(half)])
        exact = basis(v, 0, s) @ np.linalg.solve(matrix, data)
        np.testing.assert_allclose(values[0], exact, atol=1e-5 * 4)


@pytest.mark.slow
def test_the_teapot_in_both_forms():
    pot = demo.sharp()
    for form, angle_, poles in (("exact", 1e-10, 4000), ("compact", 1e-5, 500)):
        result = cqblend.blend_edges(pot, demo.joint(pot), width=demo.WIDTH, section="pde", form=form)
        assert result.certificate.angle <= angle_
        assert result.certificate.poles[0] <= poles
        assert cqblend.verify(result.shape, result.faces).ok
        assert result.certificate.inner_crease < 1e-9


@pytest.mark.skipif(not CASES.is_dir(), reason="the STEP cases are not at hand")
@pytest.mark.parametrize("order", [4, 6])
@pytest.mark.parametrize(("name", "number"), [(SCREW, 37), (SCREW, 9), (PART, 113), (PART, 264)])
def test_a_real_edge_on_which_native_fillet_fails(name, number, order):
    from OCP.TopoDS import TopoDS

    shape, edges = part(name)
    radius = next(trial["radius"] for trial in listed(name, number)["trials"] if trial["native"] != "ok")
    edge = TopoDS.Edge_s(edges.FindKey(number))
    result = cqblend.blend_edges(shape, edge, radius, section="pde", order=order, ends="flat", chain=False)
    assert list_problems(shape, result.shape, result.faces, tolerance=0.1) == []
    assert result.certificate.angle < 1e-6
    assert result.certificate.curvature_jump < 1e-4 or order < 6


@pytest.mark.parametrize(
    ("order", "continuity"), [(2, "G0"), (4, "G1"), (6, "G2"), ((2, 4, 6), "G0"), ((6, 4, 6), "G1")]
)
def test_order_fixes_continuity(order, continuity):
    solid, edge, size = box()
    agreed = cqblend.blend_edges(solid, edge, section="pde", order=order, continuity=continuity, **size)
    assert len(agreed.certificate.rails) == 2
    for other in {"G0", "G1", "G2", "G3"} - {continuity}:
        for asked in (other, (continuity, other)):
            with pytest.raises(InputError, match=f"continuity {other} contradicts equations of order"):
                cqblend.blend_edges(solid, edge, section="pde", order=order, continuity=asked, **size)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"section": "pde", "order": 3}, "order must be 2, 4 or 6"),
        ({"section": "pde", "order": (4, 4)}, "order must be 2, 4 or 6, or three of them"),
        ({"section": "pde", "order": True}, "order must be 2, 4 or 6"),
        ({"section": "pde", "parameters": (1, -1, 1, 1)}, "an equation of order 4 has 3 parameters"),
        ({"section": "pde", "parameters": (1, -2, 1)}, "are degenerate: a z\\^2 \\+ b z \\+ c is zero at z = 1"),
        ({"section": "pde", "parameters": (0, 1, 1)}, "are degenerate"),
        ({"section": "pde", "parameters": 0}, "parameters must be above 0"),
        ({"section": "pde", "parameters": math.nan}, "each of the parameters must be a finite number"),
        ({"section": "pde", "terms": 0}, "terms must be a whole number above 0"),
        ({"section": "pde", "terms": "many"}, "terms must be a whole number above 0"),
        ({"order": 4}, 'order is an option of section="pde"'),
        ({"parameters": 1.0}, 'parameters is an option of section="pde"'),
        ({"terms": 4}, 'terms is an option of section="pde"'),
    ],
)
def test_options_that_make_no_sense(options, message):
    solid, edge, size = box()
    with pytest.raises(InputError, match=message):
        cqblend.blend_edges(solid, edge, **size, **options)


def test_parameters_too_steep_for_the_tolerance_are_refused_and_nothing_is_lost():
    solid, edge, size = boss()
    before = solid.Volume()
    with pytest.raises(CqblendError):
        cqblend.blend_edges(solid, edge, section="pde", parameters=500.0, **size)
    assert solid.Volume() == before


# Fairness.


def test_fairness_of_known_shapes():
    from cqblend.blends.quality.fairness import bending_energy

    for face, energy in (
        (cq.Solid.makeCylinder(3, 7).faces("%CYLINDER"), 2 * math.pi * 7 / 3),
        (cq.Solid.makeSphere(4, angleDegrees1=-90).Faces()[0], 8 * math.pi),
        (cq.Solid.makeTorus(5, 2).Faces()[0], None),
    ):
        found = bending_energy(cqblend.to_surface(face))
        if energy is None:  # a torus: integrate over the angle of its tube
            u = (np.arange(400) + 0.5) / 400 * 2 * math.pi
            r = 5 + 2 * np.cos(u)
            energy = 2 * math.pi * 2 * 2 * math.pi * np.mean(r * (0.25 + (np.cos(u) / r) ** 2))
        assert found == pytest.approx(energy, rel=1e-6)


def test_fairness_in_the_certificate_is_the_integral_by_occt():
    """By D2 on a grid of the finished face of a closed blend."""
    solid, edge, size = boss()
    for options in ({"section": "arc"}, {"section": "hermite"}, {"section": "pde"}, {"section": "pde", "order": 6}):
        result = cqblend.blend_edges(solid, edge, **options, **size)
        face = result.faces[0]
        box = cqblend.to_surface(face).domain
        middles = [low + (high - low) * (np.arange(n) + 0.5) / n for (low, high), n in zip(box, (240, 60), strict=True)]
        t, v = np.meshgrid(*middles, indexing="ij")
        _, ht, hv, htt, hvv, htv = occt_jets(face.wrapped, t.ravel(), v.ravel())
        normal = np.cross(ht, hv)
        area = np.linalg.norm(normal, axis=1)
        first = np.array([[(a * b).sum(1) for b in (ht, hv)] for a in (ht, hv)]).transpose(2, 0, 1)
        second = np.array([[(a * normal).sum(1) / area for a in row] for row in ((htt, htv), (htv, hvv))]).transpose(
            2, 0, 1
        )
        shape = np.linalg.solve(first, second)
        density = np.trace(shape @ shape, axis1=1, axis2=2) * area
        assert result.certificate.fairness == pytest.approx(density.mean() * np.prod(np.diff(box)), rel=1e-3)


def test_fairness_of_an_open_blend_counts_what_is_left_of_it():
    """A fillet-like blend of a box, and the same with its end cut off by a slanted face."""
    solid, edge, size = box()
    whole = cqblend.blend_edges(solid, edge, **size).certificate.fairness
    assert whole == pytest.approx(10 / 4 * math.pi / 2, rel=1e-2)
    slanted = cq.Workplane(solid).copyWorkplane(cq.Workplane("XY", origin=(0, 0, 5))).split(keepBottom=True).val()
    short = cqblend.blend_edges(slanted, slanted.edges("|Z and >X and >Y"), **size).certificate.fairness
    assert short == pytest.approx(whole / 2, rel=1e-2)


def test_the_energy_of_the_plate_is_least_for_its_own_equation():
    """Of all s, the fairest blend of gentle data has one near that which counts in lengths."""
    low = cqblend.Boundary((lambda t: 3 * np.cos(t) + 0.4 * np.cos(3 * t), lambda t: 3 * np.sin(t), 0), (0, 0, 4))
    high = cqblend.Boundary((lambda t: 2.5 * np.cos(t), lambda t: 2.5 * np.sin(t), 4), (0, 0, 4))
    fairness = {s: cqblend.pde_blend(low, high, parameters=s).certificate.fairness for s in (None, 0.05, 4.0)}
    assert fairness[None] < min(fairness[0.05], fairness[4.0])
