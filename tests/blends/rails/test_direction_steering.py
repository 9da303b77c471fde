"""Steering: the angle to turn by, where it is exact and how it fades, and which crossings get a pin."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from kernel_surfaces import clamped

from cqblend.blends.rails.direction_steering import Steering, SteeringPin, drop_hasty_pins, find_pins
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface
from cqblend.surfaces.tensor_surface import TensorSurface

PINS = (
    SteeringPin(0.2, 0, 0.5, 0.3, second_order=False),
    SteeringPin(0.26, 1, 0.4, -0.1, second_order=True),
    SteeringPin(0.97, 1, 0.6, 0.2, second_order=False),
)


def slopes(f, t, h=1e-5):
    """First and second derivatives by differences."""
    return (f(t + h) - f(t - h)) / (2 * h), (f(t + h) - 2 * f(t) + f(t - h)) / h**2


@pytest.mark.parametrize("closed", [False, True])
def test_the_angle_is_that_of_the_pins_and_zero_far_away(closed):
    steering = Steering(PINS, (0.0, 1.0), closed)
    assert steering.evaluate_angle(np.array([pin.t for pin in PINS])) == pytest.approx(
        [pin.angle for pin in PINS], abs=1e-15
    )
    assert (
        np.abs(
            steering.evaluate_angle(
                np.linspace(0.26 + RAIL_TOLERANCES.fade_length_share, 0.97 - RAIL_TOLERANCES.fade_length_share, 50)
            )
        ).max()
        < 1e-15
    )
    assert (steering.evaluate_angle(np.array([0.03]))[0] != 0) == closed
    assert (
        steering.evaluate_angle(np.array([0.0]))[0] == pytest.approx(steering.evaluate_angle(np.array([1.0]))[0])
        or not closed
    )


def test_the_angle_is_flat_and_unbent_at_pins_and_where_it_ends():
    steering = Steering(PINS, (0.0, 1.0), False)
    t = np.array(
        [
            0.2,
            0.26,
            0.97,
            0.2 - RAIL_TOLERANCES.fade_length_share,
            0.26 + RAIL_TOLERANCES.fade_length_share,
            0.97 - RAIL_TOLERANCES.fade_length_share,
        ]
    )
    first, second = slopes(steering.evaluate_angle, t)
    assert np.abs(first).max() < 1e-3
    assert np.abs(second).max() < 0.5  # beside 1000 in between


def test_turned_vectors_keep_their_length_and_turn_by_the_angle():
    rng = np.random.default_rng(2)
    normals = rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    vectors = np.cross(normals, rng.normal(size=(40, 3)))
    steering, t = Steering(PINS, (0.0, 1.0), False), np.linspace(0.1, 0.4, 40)
    turned = steering.turn_vectors(vectors, normals, t)
    assert np.abs(np.linalg.norm(turned, axis=1) - np.linalg.norm(vectors, axis=1)).max() < 1e-14
    sine = (np.cross(vectors, turned) * normals).sum(1) / (vectors**2).sum(1)
    assert np.abs(np.arcsin(sine) - steering.evaluate_angle(t)).max() < 1e-14


def test_components_across_the_line_vanish_exactly_at_pins():
    steering = Steering(PINS, (0.0, 1.0), False)
    t = np.union1d(np.linspace(0, 1, 21), [pin.t for pin in PINS])
    rs = np.ones((len(t), 2))
    first, second = steering.zero_at_pins(rs, t), steering.align_second_directions(rs, t)
    for pin in PINS:
        at = np.flatnonzero(t == pin.t)
        assert first[at, pin.axis] == 0
        assert (second[at, pin.axis] == 0) == pin.second_order
    assert (first == 0).sum() == len(PINS)
    assert (np.abs(second[:, 0] - 1) == 0).all()
    assert (second[np.abs(t - 0.26) >= RAIL_TOLERANCES.fade_length_share, 1] == 1).all()


def test_a_fit_has_slack_about_pins_only():
    steering = Steering(PINS, (0.0, 1.0), False)
    t = np.linspace(0, 1, 201)
    slack = steering.evaluate_slack(t)
    assert set(slack.tolist()) == {0.0, RAIL_TOLERANCES.fade_fit_share * 0.3}
    near = np.abs(t[:, None] - [pin.t for pin in PINS]).min(axis=1)
    assert (slack[near <= RAIL_TOLERANCES.fade_length_share] > 0).all()
    assert (slack[near > 2 * RAIL_TOLERANCES.fade_length_share + 0.01] == 0).all()
    assert (Steering((), (0.0, 1.0), False).evaluate_slack(t) == 0).all()
    assert (Steering((), (0.0, 1.0), False).evaluate_angle(t) == 0).all()


def slanted(turn, order, multiplicity=2):
    """A ribbon on a bent sheet that crosses the line v = 0.5 of a bicubic, with d at ``turn`` to it."""
    knots = clamped(3, []), clamped(3, [0.5] * multiplicity)
    greville = [np.array([k[i + 1 : i + 4].mean() for i in range(len(k) - 4)]) for k in knots]
    u, v = np.meshgrid(*greville, indexing="ij")
    bump = np.zeros_like(v)
    bump[:, 1], bump[:, 3] = 0.2, 0.3
    surface = Surface.from_bspline((3, 3), knots, np.stack([u, v, bump], -1))
    c = Curve.bezier([[0.5, 0.5, 0.9, 0.1], [0.5, 0.5, 0.1, 0.9]])
    r, s = math.cos(turn), math.sin(turn)
    directions = tuple(Curve.bezier([[-r, r, -s, s]]) for _ in range(max(order, 1)))
    return Ribbon(TensorSurface.from_spline(surface), c, directions, np.array([[0.5, 0.1], [0.5, 0.9]]), order)


@pytest.mark.parametrize("turn", [0.2, -0.3, math.pi - 0.2])
def test_pins_turn_the_direction_onto_the_knot_line(turn):
    ribbon = slanted(turn, 1)
    (pin,) = find_pins(ribbon, 0.5)
    assert (pin.axis, pin.value, pin.second_order) == (1, 0.5, False)
    assert pin.t == pytest.approx(0.5, abs=1e-12)
    uv = ribbon.find_native_parameters(np.array([pin.t]))
    jet = ribbon.primary.jet(uv)
    vector = math.cos(turn) * jet[1] + math.sin(turn) * jet[2]
    normal = np.cross(jet[1], jet[2])
    normal /= np.linalg.norm(normal)
    turned = Steering((pin,), (0.0, 1.0), False).turn_vectors(vector, normal, np.array([pin.t]))
    assert np.linalg.norm(np.cross(turned, jet[1])) < 1e-12


def test_pins_only_where_the_surface_is_too_rough_and_the_turn_allowed():
    assert find_pins(slanted(0.3, 1), 0.1) == []
    assert find_pins(slanted(0.3, 0), 0.5) == []
    assert find_pins(slanted(0.3, 1, multiplicity=1), 0.5) == []
    (on_c2,), (on_c1,) = find_pins(slanted(0.3, 2, multiplicity=1), 0.5), find_pins(slanted(0.3, 2), 0.5)
    assert not on_c2.second_order
    assert on_c1.second_order


def test_third_order_says_where_the_surface_is_not_c3():
    with pytest.raises(GeometryError, match=r"v = 0\.5, where one is only C2, at t = 0\.5; use G2"):
        find_pins(slanted(0.1, 3, multiplicity=1), 0.5)


def test_turns_fade_before_ends_at_which_directions_are_given():
    pin = SteeringPin(0.03, 0, 0.5, 0.2, second_order=True)
    free, fixed = Steering((pin,), (0.0, 1.0), False), Steering((pin,), (0.0, 1.0), False, (True, False))
    t = np.array([0.0, 0.03, 0.08])
    assert free.evaluate_angle(t)[0] > 0.05
    assert fixed.evaluate_angle(t)[0] == 0
    assert fixed.evaluate_angle(t)[1:] == pytest.approx(free.evaluate_angle(t)[1:])
    second = fixed.align_second_directions(np.ones((3, 2)), t)
    assert second[0].tolist() == [1.0, 1.0]
    assert second[1, 0] == 0


def test_pins_too_near_to_a_given_end_for_their_turn_are_dropped():
    """Half-way along the rail, there is room for any turn; close to its end, for small ones."""
    ribbon = slanted(0.2, 1)
    (pin,) = find_pins(ribbon, 0.5)
    assert drop_hasty_pins(ribbon, [pin], (True, True)) == [pin]
    near, slow = replace(pin, t=0.99), replace(pin, t=0.99, angle=1e-3)
    assert drop_hasty_pins(ribbon, [near], (False, True)) == []
    assert drop_hasty_pins(ribbon, [near], (True, False)) == [near]
    assert drop_hasty_pins(ribbon, [slow], (False, True)) == [slow]
