"""Flat strips against closed forms, rolled back by other means, and against triangles."""

import numpy as np
import pytest
from developable_strips import (
    APEX,
    CONE,
    CYLINDER,
    EDGE,
    QUARTER,
    SADDLE,
    circle,
    helix_strip,
    moved,
    random_strip,
    ruled,
    tangent_strip,
)

from cqblend.errors import GeometryError, InputError
from cqblend.patterns.flatten.development import RulingMotion, develop_rails
from cqblend.patterns.flatten.flat_strip import flatten_rails
from cqblend.patterns.outline.plane_path import Path
from cqblend.splines import Curve, Surface, change_of_parameter, hermite, reparameterise
from cqblend.teapot import poles

DEVELOPABLE = {
    "cylinder": CYLINDER,
    "oblique cylinder": (EDGE, moved(EDGE, [1, -3, 2])),
    "cone": CONE,
    "cone of a cubic": (moved(EDGE, [0, 0, 3]), moved(EDGE * 1.5, [0, 0, 4.5])),
    "ring of a cone": (circle(2, 0), circle(1, 1)),
    "fan": (QUARTER, APEX),
    "fan upside down": (APEX, QUARTER),
    "tangent": tangent_strip(0.5, 1.5),
    "edge of regression": tangent_strip(0.0, 1.0),
    "helix": helix_strip(1.0, 0.4, 0.5, 2.0, pieces=64),
}
TWISTED = {"saddle": SADDLE, "cubics": random_strip(3), "rational": random_strip(8, True)}


def grid(rails, count=33, across=5):
    t = np.linspace(*rails[0].domain, count)
    return (f.ravel() for f in np.meshgrid(t, np.linspace(0, 1, across), indexing="ij"))


def stretched(flat, rails, t, w, direction, h=1e-5):
    """Ratio of lengths, flat to space, of short steps from (t, w) in a direction of the parameters."""
    dt, dw = h * direction[0], h * direction[1]
    plane = flat(t + dt, w + dw) - flat(t - dt, w - dw)
    space = ruled(rails, t + dt, w + dw) - ruled(rails, t - dt, w - dw)
    return np.linalg.norm(plane, axis=-1) / np.linalg.norm(space, axis=-1)


@pytest.mark.parametrize("name", DEVELOPABLE)
def test_developables_are_laid_flat_isometrically(name):
    rails = DEVELOPABLE[name]
    flat = flatten_rails(rails, 1e-3)
    start, end = rails[0].domain
    rng = np.random.default_rng(1)
    t, w = rng.uniform(start + 1e-3, end - 1e-3, 300), rng.uniform(0.1, 0.9, 300)
    for direction in ((1, 0), (0, 1), (1, 1), (1, -2)):
        assert np.abs(stretched(flat, rails, t, w, direction) - 1).max() < 1e-8
    assert flat.ruling < 1e-14
    assert flat.strain == 0
    assert flat.area_flat == flat.area_space


@pytest.mark.parametrize("name", DEVELOPABLE | TWISTED)
def test_lengths_areas_and_outline(name):
    rails = (DEVELOPABLE | TWISTED)[name]
    flat = flatten_rails(rails, 1e-4)
    first, second = flat.make_rail_path(0), flat.make_rail_path(1)
    np.testing.assert_array_equal(first.points, flat.first)
    np.testing.assert_allclose([first.lengths, second.lengths], flat.lengths, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(flat(flat.nodes, 1.0), flat.second, rtol=0, atol=1e-13)
    # arc lengths by many chords, extrapolated
    for side in (0, 1):
        for curve in (rails[side], lambda t, side=side: flat(t, float(side))):
            sums = [
                np.linalg.norm(np.diff(curve(np.linspace(*rails[0].domain, n + 1)), axis=0), axis=1).sum()
                for n in (4 * 768, 8 * 768)
            ]
            assert abs((4 * sums[1] - sums[0]) / 3 - flat.lengths[side].sum()) <= 1e-11 * sums[1] + 1e-12
    outline = Path.from_paths([first, Path.from_points(np.stack([flat.first[-1], flat.second[-1]])), second.reversed()])
    closing = np.concatenate([outline.points, outline.points[:1]])
    area = Path(closing, np.append(outline.bulges, 0.0)).area
    assert abs(area - flat.area_flat) <= flat.error * flat.lengths.sum() + 1e-12 * abs(area)
    t = np.linspace(*rails[0].domain, 1001)
    for side, path in enumerate((first, second)):
        polygon = path.sampled(1e-7)
        a, step = polygon[:-1], np.diff(polygon, axis=0)
        on = flat(t[::10], float(side))[:, None] - a
        part = np.clip((on * step).sum(axis=2) / np.maximum((step**2).sum(axis=1), 1e-300), 0, 1)
        off = np.linalg.norm(on - part[..., None] * step, axis=2).min(axis=1)
        assert off.max() <= 1.5 * 1e-4 + 1e-7  # of samples between those that the nodes were chosen by


def test_closed_forms():
    flat = flatten_rails(CYLINDER, 0.1)
    assert abs(flat.area_flat / np.pi - 1) < 1e-15
    np.testing.assert_allclose(flat.second[-1], [np.pi / 2, 2], atol=1e-15)
    # a whole cone: apex 2 above the larger ring of radius 2, slant 2 sqrt(2); it winds by less than a turn
    rails = DEVELOPABLE["ring of a cone"]
    flat = flatten_rails(rails, 1e-3)
    np.testing.assert_allclose(flat.lengths.sum(axis=1), [4 * np.pi, 2 * np.pi], rtol=1e-14)
    assert abs(flat.area_space / (np.pi * 3 * np.sqrt(2)) - 1) < 1e-14
    # a flat one winds by almost a full turn: its chord is that of an arc of 2 pi cos
    low = circle(2, 0), circle(1, 0.1)
    flat = flatten_rails(low, 1e-3)
    slant = np.hypot(1, 0.1)
    np.testing.assert_allclose(
        np.linalg.norm(flat.first[-1] - flat.first[0]), abs(2 * (2 * slant) * np.sin(np.pi / slant)), rtol=1e-11
    )
    # tangent developable of a cubic of constant slope: dpsi = kappa ds = sqrt(2) / (1 + t^2)
    for a, b in ((0.5, 1.5), (0.0, 1.0)):
        strip = tangent_strip(a, b)
        flat = flatten_rails(strip, 1e-3)
        assert flat.kind == "tangent"
        assert abs(flat.area_space / (12 * np.sqrt(2) * (b * b - a * a)) - 1) < 1e-12
        turn = flat([0.0, 1.0], 1.0) - flat([0.0, 1.0], 0.0)
        angles = np.arctan2(turn[:, 1], turn[:, 0])
        assert abs(abs(angles[1] - angles[0]) - np.sqrt(2) * np.arctan(1)) < 1e-12
    # tangent developable of a helix: rings about a circle of radius 1 / kappa
    radius, rise, a, b = 1.0, 0.4, 0.5, 2.0
    speed = np.hypot(radius, rise)
    kappa, s = radius / speed**2, 4 * speed
    flat = flatten_rails(DEVELOPABLE["helix"], 1e-3)
    assert flat.kind == "tangent"
    np.testing.assert_allclose(
        flat.lengths.sum(axis=1), [s * np.sqrt(1 + (kappa * k * speed) ** 2) for k in (a, b)], rtol=1e-11
    )
    assert abs(flat.area_flat / (kappa * s * ((b * speed) ** 2 - (a * speed) ** 2) / 2) - 1) < 1e-11


@pytest.mark.parametrize("name", ["cylinder", "cone", "fan", "tangent"])
def test_one_formula_for_all(name):
    """The general integration agrees with the closed forms; a developable treated as twisted is still isometric."""
    rails = DEVELOPABLE[name]
    t, w = grid(rails)
    known, general = flatten_rails(rails, 1e-3)(t, w), flatten_rails(rails, 1e-3, kind="twisted")(t, w)
    assert np.abs(known - general - (known - general)[0]).max() < 1e-12


def test_windings_of_more_than_a_turn():
    """Three turns of a nearly flat cone, angles beyond pi included."""
    t = np.linspace(0, 1, 200)
    jets = []
    for radius, height in ((2.0, 0.0), (1.0, 0.3)):
        angle = 6 * np.pi * t
        rates = [
            np.stack([radius * np.cos(angle + k * np.pi / 2), radius * np.sin(angle + k * np.pi / 2)], 1)
            * (6 * np.pi) ** k
            for k in range(4)
        ]
        jets.append([np.column_stack([r, np.full(len(t), height if k == 0 else 0.0)]) for k, r in enumerate(rates)])
    rails = tuple(hermite(t, np.array(j)) for j in jets)
    flat = flatten_rails(rails, 1e-3, kind="cone")
    assert abs(flat.lengths[0].sum() / (12 * np.pi) - 1) < 1e-9
    slant = np.hypot(1.0, 0.3)
    centre = flat.first[0] + (flat.second[0] - flat.first[0]) * 2
    radii = np.linalg.norm(flat.first - centre, axis=1)
    np.testing.assert_allclose(radii, 2 * slant, rtol=1e-9)
    turned = np.unwrap(np.arctan2(*(flat(np.linspace(0, 1, 400), 0.0) - centre).T[::-1]))
    assert abs(abs(turned[-1] - turned[0]) - 6 * np.pi / slant) < 1e-8


# -- orientation, nodes


def test_the_side_that_is_shown():
    for rails in (DEVELOPABLE | TWISTED).values():
        start, end = rails[0].domain
        t, w, h = (start + end) / 2, 0.5, 1e-6
        for flip, sense in ((False, 1), (True, -1)):
            flat = flatten_rails(rails, 1e-2, flip=flip)
            du, dv = flat(t + h, w) - flat(t - h, w), flat(t, w + h) - flat(t, w - h)
            assert sense * (du[0] * dv[1] - du[1] * dv[0]) > 0
        np.testing.assert_allclose(flat.first, flatten_rails(rails, 1e-2).first * [-1, 1], atol=1e-14)


def test_nodes():
    flat = flatten_rails(CYLINDER, 1e-3, nodes=[0.3, 0.3 + 1e-15, 1.0, 0.77])
    assert flat.nodes.tolist() == [0, 0.3, 0.77, 1]
    assert len(flatten_rails(CYLINDER, 1e-3).nodes) == 2  # its rails are straight
    assert len(flatten_rails(CONE, 1e-3).nodes) <= 3  # and these are arcs
    rough, fine = (len(flatten_rails(TWISTED["cubics"], e).nodes) for e in (1e-2, 1e-6))
    assert rough < fine < 100
    assert set(circle(2, 0).breaks) <= set(flatten_rails(DEVELOPABLE["ring of a cone"], 1e-3).nodes)


# -- twisted strips


@pytest.mark.parametrize("name", TWISTED)
def test_rails_and_rulings_of_twisted_strips_keep_their_lengths(name):
    rails = TWISTED[name]
    flat = flatten_rails(rails, 1e-3)
    assert flat.kind == "twisted"
    t, w = grid(rails)
    h = 1e-5
    inner = (t > 0) & (t < 1)
    for side in (0.0, 1.0):
        assert np.abs(stretched(flat, rails, t[inner], np.full(inner.sum(), side), (1, 0)) - 1).max() < 1e-8
    rulings = np.linalg.norm(flat(t, 1.0) - flat(t, 0.0), axis=1) / np.linalg.norm(rails[1](t) - rails[0](t), axis=1)
    assert np.abs(rulings - 1).max() < 1e-13
    # inside, lengths along the rails grow, by what the strain says at most; areas likewise
    grown = stretched(flat, rails, t[inner], w[inner], (1, 0), h) - 1
    assert grown.min() > -1e-8
    excess = flat.area_flat / flat.area_space - 1
    assert 0 < excess <= flat.strain / (1 - flat.strain)


def both_triangulations(rails, n):
    """Lay out by both diagonals, average the turning angles of both, and keep the chords."""
    t = np.linspace(*rails[0].domain, n + 1)
    a, b = rails[0](t), rails[1](t)

    def angle(at, x, y):
        x, y = x - at, y - at
        return np.arctan2(np.linalg.norm(np.cross(x, y), axis=-1), (x * y).sum(axis=-1))

    out = []
    for diagonal in (0, 1):
        if diagonal == 0:  # a[i] - b[i+1]
            at_a = angle(a[:-1], b[:-1], b[1:]) + angle(a[:-1], b[1:], a[1:])
            at_b, next_a = angle(b[:-1], a[:-1], b[1:]), angle(a[1:], a[:-1], b[1:])
        else:
            at_a = angle(a[:-1], b[:-1], a[1:])
            at_b = angle(b[:-1], a[:-1], a[1:]) + angle(b[:-1], a[1:], b[1:])
            next_a = angle(a[1:], a[:-1], b[:-1]) + angle(a[1:], b[:-1], b[1:])
        out.append((at_a, at_b, next_a))
    results = []
    for at_a, at_b, next_a in (out[0], np.mean(out, axis=0)):
        # the ruling turns by what the angles at a[i], and at a[i+1], leave of pi
        ruling = np.pi / 2 + np.concatenate([[0], np.cumsum(np.pi - at_a - next_a)])
        steps = np.linalg.norm(np.diff(a, axis=0), axis=1) * np.exp(1j * (ruling[:-1] - at_a))
        first = np.concatenate([[0], np.cumsum(steps)])
        start = 1j * np.linalg.norm(b[0] - a[0])
        steps = np.linalg.norm(np.diff(b, axis=0), axis=1) * np.exp(1j * (ruling[:-1] - np.pi + at_b))
        results.append((first, np.concatenate([[start], start + np.cumsum(steps)])))
    return t, results


@pytest.mark.parametrize("name", TWISTED)
def test_triangles_along_both_diagonals_converge_to_the_flat_strip(name):
    rails = TWISTED[name]
    flat = flatten_rails(rails, 1e-3)
    errors = []
    for n in (64, 128, 256):
        t, results = both_triangulations(rails, n)
        expected = [flat(t, side) - flat(t[0], 0.0) for side in (0.0, 1.0)]
        errors.append(
            [max(np.abs(p - q @ [1, 1j]).max() for p, q in zip(result, expected, strict=True)) for result in results]
        )
    single, mean = np.array(errors).T
    assert (single[:-1] / single[1:] > 1.8).all()  # of first order
    assert (mean[:-1] / mean[1:] > 3.6).all()  # of second order
    assert mean[-1] < 1e-4


def to_triangles(points, corners):
    """Distances of points (m, 3) from triangles (k, 3, 3): to a grid of points on them."""
    x, y = (f.ravel() for f in np.meshgrid(*[np.linspace(0, 1, 25)] * 2))
    inside = x + y <= 1 + 1e-12
    x, y = x[inside, None], y[inside, None]
    cloud = (
        corners[:, None, 0]
        + x * (corners[:, 1] - corners[:, 0])[:, None]
        + y * (corners[:, 2] - corners[:, 0])[:, None]
    )
    cloud = cloud.reshape(-1, 3)
    return np.array([np.linalg.norm(cloud - p, axis=1).min() for p in points])


@pytest.mark.parametrize("name", ["saddle", "cubics", "rational"])
def test_the_error_of_triangles_is_a_bound(name):
    rails = TWISTED[name]
    flat = flatten_rails(rails, 0.02, layout="triangles")
    a, b = rails[0](flat.nodes), rails[1](flat.nodes)
    corners = np.concatenate([np.stack([a[:-1], a[1:], b[1:]], axis=1), np.stack([a[:-1], b[1:], b[:-1]], axis=1)])
    t, w = grid(rails, 41, 9)
    off = to_triangles(ruled(rails, t, w), corners)
    spacing = np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2).max() / 24
    assert np.sqrt(np.maximum(off.max() ** 2 - spacing**2, 0)) <= flat.error <= 0.02
    assert off.max() > flat.error / 30 or flat.error < spacing


def test_teapot():
    """Strips of handle, spout and body: nothing is lost on any of them."""
    kinds, grown = set(), []
    for patch in poles()[12:20]:
        surface = Surface(([0, 1], [0, 1]), patch[..., None, None])
        for rails in (
            (surface.isoparametric(v=0.4), surface.isoparametric(v=0.6)),
            (surface.isoparametric(u=0.4), surface.isoparametric(u=0.6)),
        ):
            flat = flatten_rails(rails, 1e-3)
            kinds.add(flat.kind)
            grown.append(flat.area_flat / flat.area_space - 1)
            assert flat.error <= 1e-3
            assert flat.ruling < 1e-13
            for side, path in enumerate((flat.make_rail_path(0), flat.make_rail_path(1))):
                np.testing.assert_allclose(path.lengths, flat.lengths[side], rtol=1e-12)
    assert "twisted" in kinds
    assert -1e-12 < min(grown) <= max(grown) < 2e-3


# -- the paper's triangles


def test_elber():
    rails = TWISTED["cubics"]
    flat = flatten_rails(rails, 5e-3, layout="triangles")
    n = len(flat.nodes)
    assert np.ptp(np.diff(flat.nodes)) < 1e-15
    a, b = rails[0](flat.nodes), rails[1](flat.nodes)
    for found, points in ((flat.first, a), (flat.second, b)):
        np.testing.assert_allclose(
            np.linalg.norm(np.diff(found, axis=0), axis=1), np.linalg.norm(np.diff(points, axis=0), axis=1), rtol=1e-12
        )
    np.testing.assert_allclose(flat.lengths[0], np.linalg.norm(np.diff(a, axis=0), axis=1), rtol=1e-14)
    np.testing.assert_allclose(
        np.linalg.norm(flat.second[1:] - flat.first[:-1], axis=1), np.linalg.norm(b[1:] - a[:-1], axis=1), rtol=1e-12
    )
    assert flat.ruling < 1e-14
    assert not flat.make_rail_path(0).bulges.any()
    triangles = (
        np.linalg.norm(np.cross(a[1:] - a[:-1], b[1:] - a[:-1]), axis=1).sum()
        + np.linalg.norm(np.cross(b[1:] - a[:-1], b[:-1] - a[:-1]), axis=1).sum()
    ) / 2
    assert abs(flat.area_flat / triangles - 1) < 1e-12
    np.testing.assert_allclose(flat(flat.nodes, 0.0), flat.first, atol=1e-13)
    np.testing.assert_allclose(flat(flat.nodes, 1.0), flat.second, atol=1e-13)
    mirrored = flatten_rails(rails, 5e-3, layout="triangles", flip=True)
    np.testing.assert_allclose(mirrored.first, flat.first * [-1, 1], atol=1e-15)
    assert mirrored.area_flat == pytest.approx(flat.area_flat)
    assert n == 2 ** int(np.log2(n - 1)) + 1


# -- rolled back


@pytest.mark.parametrize("name", DEVELOPABLE | TWISTED)
@pytest.mark.parametrize("layout", ["smooth", "triangles"])
@pytest.mark.parametrize("flip", [False, True])
def test_fold(name, layout, flip):
    rails = (DEVELOPABLE | TWISTED)[name]
    flat = flatten_rails(rails, 3e-2, layout=layout, flip=flip)
    if layout == "smooth":
        t, w = grid(rails)
        assert np.abs(flat.fold(flat(t, w)) - ruled(rails, t, w)).max() < 1e-9
    for side, points in ((0, flat.first), (1, flat.second)):
        assert np.abs(flat.fold(points) - rails[side](flat.nodes)).max() < 1e-9
    assert flat.fold(flat.first[0]).shape == (3,)


def test_cylinders_and_cones_rolled_by_hand():
    flat = flatten_rails(CYLINDER, 1e-2)
    t, w = grid(CYLINDER)
    x, y = flat(t, w).T
    np.testing.assert_allclose(np.stack([np.cos(x), np.sin(x), y], axis=1), ruled(CYLINDER, t, w), atol=1e-13)
    # the cone with its apex at (0, 0, -1) has the slant sqrt(2) times the radius: angles are divided by it
    flat = flatten_rails(CONE, 1e-2)
    t, w = grid(CONE)
    apex = 2 * flat.first[0] - flat.second[0]
    x, y = (flat(t, w) - apex).T
    slant, angle = np.hypot(x, y), np.arctan2(x, y) * np.sqrt(2)
    radius = slant / np.sqrt(2)
    rolled = np.stack([radius * np.cos(angle), radius * np.sin(angle), radius - 1], axis=1)
    np.testing.assert_allclose(rolled, ruled(CONE, t, w), atol=1e-13)


@pytest.mark.parametrize("name", ["saddle", "cubics", "cone", "tangent"])
def test_triangles_rolled_by_their_dihedral_angles(name):
    rails = (DEVELOPABLE | TWISTED)[name]
    flat = flatten_rails(rails, 3e-2, layout="triangles")
    strip, plane = np.empty((2 * len(flat.nodes), 3)), np.zeros((2 * len(flat.nodes), 3))
    # b0, a0, b1, a1, ..: every three of them are a triangle
    strip[::2], strip[1::2] = rails[1](flat.nodes), rails[0](flat.nodes)
    plane[::2, :2], plane[1::2, :2] = flat.second, flat.first

    def normal(p, k):
        n = np.cross(p[k + 1] - p[k], p[k + 2] - p[k]) * (-1) ** k
        return n / np.linalg.norm(n)

    def frame(p):
        x = (p[1] - p[0]) / np.linalg.norm(p[1] - p[0])
        n = normal(p, 0)
        return np.stack([x, np.cross(n, x), n])

    turn, origin = frame(plane).T @ frame(strip), strip[0]
    rolled = [origin + (p - plane[0]) @ turn for p in plane[:3]]
    for k in range(1, len(plane) - 2):
        axis = strip[k + 2 - 1] - strip[k]
        axis /= np.linalg.norm(axis)
        before, after = normal(strip, k - 1), normal(strip, k)
        angle = np.arctan2(np.cross(before, after) @ axis, before @ after)
        # rotate what follows about the edge k, k + 1, where it lies now
        here = (plane[k + 1] - plane[k]) @ turn
        here /= np.linalg.norm(here)
        cross = np.array([[0, -here[2], here[1]], [here[2], 0, -here[0]], [-here[1], here[0], 0]])
        turn = turn @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross).T
        rolled.append(rolled[k] + (plane[k + 2] - plane[k]) @ turn)
    assert np.abs(np.array(rolled) - strip).max() < 1e-9


# -- degenerate and refused


def test_rails_that_meet_or_stop():
    rise = Curve.bezier([[0.0, 0, 1], [1, 0, 1], [1, 0, 0]])
    other = Curve.bezier([[0.0, 0, 1], [0.8, 0.4, 1.1], [0.9, 0.6, 0]])
    flat = flatten_rails((rise, other), 1e-4)
    np.testing.assert_allclose(flat.first[0], flat.second[0], atol=1e-15)
    assert abs(np.linalg.norm(flat.second[-1] - flat.first[-1]) - np.hypot(0.1, 0.6)) < 1e-13
    slow = change_of_parameter(0.0, 0.0)
    rails = TWISTED["cubics"]
    t = slow(0.37).item()
    stopped = flatten_rails(tuple(reparameterise(rail, slow) for rail in rails), 1e-3)
    plain = flatten_rails(rails, 1e-3)
    np.testing.assert_allclose(stopped(0.37, [0.0, 0.4, 1.0]), plain(t, [0.0, 0.4, 1.0]), atol=1e-12)


def test_motion_of_a_saddle():
    length, e, v1, v2, along = RulingMotion(SADDLE)(np.array([0.0, 0.5]))
    np.testing.assert_allclose(length, [1, np.hypot(1, 0.25)])
    np.testing.assert_allclose(e[0], [0, 1, 0])
    np.testing.assert_allclose([v1[0], v2[0]], [[4, 0, 0], [4, 0, 0.5]])
    assert along[0] == 0


def test_what_is_refused():
    for tolerance in (0, -1.0, np.nan, np.inf, "1"):
        with pytest.raises(InputError, match="tolerance"):
            flatten_rails(CYLINDER, tolerance)
    with pytest.raises(InputError, match="layout"):
        flatten_rails(CYLINDER, 1.0, layout="lscm")
    for nodes in ([1.5], [np.nan]):
        with pytest.raises(InputError, match="nodes"):
            flatten_rails(CYLINDER, 1.0, nodes=nodes)
    with pytest.raises(InputError, match="cone"):
        flatten_rails(CYLINDER, 1.0, kind="cone")
    with pytest.raises(GeometryError, match="same curve"):
        flatten_rails((QUARTER, QUARTER), 1.0)
    with pytest.raises(GeometryError, match="more than 20000"):
        flatten_rails(SADDLE, 1e-9, layout="triangles")
    assert 1e-9 < flatten_rails(SADDLE, 1e-9).error < 2e-4  # with as many triangles as are taken
    through = QUARTER, moved(QUARTER * -1, [0, 0, 2])  # all rulings meet at (0, 0, 1)
    with pytest.raises(GeometryError, match=r"t = .*rulings meet"):
        flatten_rails(through, 1e-2)
    with pytest.raises(GeometryError, match=r"t = .*one point"):
        develop_rails(through, "cone")
    with pytest.raises(GeometryError, match=r"t = .*narrower"):
        flatten_rails((SADDLE[0], Curve.bezier([[4.0, 1, 1], [0, 1, 1]])), 1e-2)
    with pytest.raises(InputError, match="plan"):
        develop_rails(CYLINDER, "plane")
