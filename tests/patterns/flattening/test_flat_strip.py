"""Flat strips against closed forms, and rolled back by other means."""

import numpy as np
import pytest
from developable_strips import (
    CONE,
    CYLINDER,
    DEVELOPABLE,
    QUARTER,
    SADDLE,
    TWISTED,
    circle,
    grid,
    moved,
    ruled,
    tangent_strip,
)

from cqblend.errors import GeometryError, InputError
from cqblend.patterns.flattening.development import develop_rails
from cqblend.patterns.flattening.flat_strip import flatten_rails
from cqblend.patterns.outline.plane_path import Path, solve_bulges
from cqblend.splines import Curve, Surface, change_of_parameter, hermite, reparameterise
from cqblend.teapot import poles


def rail_path(flat, side):
    """A flat rail as arcs of its lengths between nodes, each on the side on which the rail is."""
    points = (flat.first_rail, flat.second_rail)[side]
    chord, arm = np.diff(points, axis=0), flat((flat.nodes[:-1] + flat.nodes[1:]) / 2, float(side)) - points[:-1]
    left = np.sign(chord[:, 0] * arm[:, 1] - chord[:, 1] * arm[:, 0])
    bulges = -left * solve_bulges(np.linalg.norm(chord, axis=1), flat.lengths[side])
    return Path(points, np.where(flat.lengths[side] > 0, bulges, 0.0))


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
    assert flat.ruling_error < 1e-14
    assert flat.strain == 0
    assert flat.area_flat == flat.area_space


@pytest.mark.parametrize("name", DEVELOPABLE | TWISTED)
def test_lengths_areas_and_outline(name):
    rails = (DEVELOPABLE | TWISTED)[name]
    flat = flatten_rails(rails, 1e-4)
    first, second = rail_path(flat, 0), rail_path(flat, 1)
    np.testing.assert_array_equal(first.points, flat.first_rail)
    np.testing.assert_allclose([first.lengths, second.lengths], flat.lengths, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(flat(flat.nodes, 1.0), flat.second_rail, rtol=0, atol=1e-13)
    # arc lengths by many chords, extrapolated
    for side in (0, 1):
        for curve in (rails[side], lambda t, side=side: flat(t, float(side))):
            sums = [
                np.linalg.norm(np.diff(curve(np.linspace(*rails[0].domain, n + 1)), axis=0), axis=1).sum()
                for n in (4 * 768, 8 * 768)
            ]
            assert abs((4 * sums[1] - sums[0]) / 3 - flat.lengths[side].sum()) <= 1e-11 * sums[1] + 1e-12
    outline = Path.from_paths(
        [first, Path.from_points(np.stack([flat.first_rail[-1], flat.second_rail[-1]])), second.reversed()]
    )
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
    np.testing.assert_allclose(flat.second_rail[-1], [np.pi / 2, 2], atol=1e-15)
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
        np.linalg.norm(flat.first_rail[-1] - flat.first_rail[0]),
        abs(2 * (2 * slant) * np.sin(np.pi / slant)),
        rtol=1e-11,
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
    centre = flat.first_rail[0] + (flat.second_rail[0] - flat.first_rail[0]) * 2
    radii = np.linalg.norm(flat.first_rail - centre, axis=1)
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
        np.testing.assert_allclose(flat.first_rail, flatten_rails(rails, 1e-2).first_rail * [-1, 1], atol=1e-14)


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
            assert flat.ruling_error < 1e-13
            for side, path in enumerate((rail_path(flat, 0), rail_path(flat, 1))):
                np.testing.assert_allclose(path.lengths, flat.lengths[side], rtol=1e-12)
    assert "twisted" in kinds
    assert -1e-12 < min(grown) <= max(grown) < 2e-3


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
    for side, points in ((0, flat.first_rail), (1, flat.second_rail)):
        assert np.abs(flat.fold(points) - rails[side](flat.nodes)).max() < 1e-9
    assert flat.fold(flat.first_rail[0]).shape == (3,)


def test_cylinders_and_cones_rolled_by_hand():
    flat = flatten_rails(CYLINDER, 1e-2)
    t, w = grid(CYLINDER)
    x, y = flat(t, w).T
    np.testing.assert_allclose(np.stack([np.cos(x), np.sin(x), y], axis=1), ruled(CYLINDER, t, w), atol=1e-13)
    # the cone with its apex at (0, 0, -1) has the slant sqrt(2) times the radius: angles are divided by it
    flat = flatten_rails(CONE, 1e-2)
    t, w = grid(CONE)
    apex = 2 * flat.first_rail[0] - flat.second_rail[0]
    x, y = (flat(t, w) - apex).T
    slant, angle = np.hypot(x, y), np.arctan2(x, y) * np.sqrt(2)
    radius = slant / np.sqrt(2)
    rolled = np.stack([radius * np.cos(angle), radius * np.sin(angle), radius - 1], axis=1)
    np.testing.assert_allclose(rolled, ruled(CONE, t, w), atol=1e-13)


# -- degenerate and refused


def test_rails_that_meet_or_stop():
    rise = Curve.bezier([[0.0, 0, 1], [1, 0, 1], [1, 0, 0]])
    other = Curve.bezier([[0.0, 0, 1], [0.8, 0.4, 1.1], [0.9, 0.6, 0]])
    flat = flatten_rails((rise, other), 1e-4)
    np.testing.assert_allclose(flat.first_rail[0], flat.second_rail[0], atol=1e-15)
    assert abs(np.linalg.norm(flat.second_rail[-1] - flat.first_rail[-1]) - np.hypot(0.1, 0.6)) < 1e-13
    slow = change_of_parameter(0.0, 0.0)
    rails = TWISTED["cubics"]
    t = slow(0.37).item()
    stopped = flatten_rails(tuple(reparameterise(rail, slow) for rail in rails), 1e-3)
    plain = flatten_rails(rails, 1e-3)
    np.testing.assert_allclose(stopped(0.37, [0.0, 0.4, 1.0]), plain(t, [0.0, 0.4, 1.0]), atol=1e-12)


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
