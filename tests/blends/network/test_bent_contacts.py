"""Contacts that are bent near the ends of a cell: what is added, and that parameters stay in one run."""

from __future__ import annotations

import numpy as np
import pytest
from rail_cases import FRAME

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.network.bent_contacts import BentContacts, EndFade, stretch_lengths, turn_field
from cqblend.blends.rails.cross_directions import RailStations
from cqblend.surfaces.quadrics import Cylinder, Plane

TURN = 2 * np.pi


@pytest.mark.parametrize("inward", [1, -1])
def test_a_fade_has_its_value_and_rate_at_the_end_and_is_smooth_where_it_ends(inward):
    fade = EndFade(0.3, inward, 0.25, np.array([2.0, -1.0]), np.array([0.7, 5.0]))
    h = 1e-5
    at, off = fade.evaluate(np.array([0.3, 0.3 + inward * h]))
    assert at == pytest.approx([2.0, -1.0], abs=1e-15)
    assert inward * (off - at) / h == pytest.approx([0.7, 5.0], abs=4e-3)
    last = 0.3 + inward * 0.25
    assert fade.evaluate(np.array([last, last + inward * 0.1])) == pytest.approx(np.zeros((2, 2)), abs=1e-15)
    h = 1e-3  # two derivatives vanish there, so that the third one leads
    assert np.abs(fade.evaluate(np.array([last - inward * h]))).max() < 50 * (h / 0.25) ** 3


def spiral(t):
    """Contacts on a plane and, two and a half times around, on a cylinder; raw parameters jump by whole turns."""
    angle = TURN * (2.5 * t + 0.1)
    first = np.stack([t, t**2], -1)
    second = np.stack([np.mod(angle + np.pi, TURN) - np.pi, t], -1)
    second[:, 0] = np.unwrap(second[:, 0])
    edge = np.stack([t, t, t], -1)
    return Contacts(t, edge, (first, second), np.stack([1 + t, 2 - t]))


def test_parameters_are_those_of_one_run_whatever_is_asked_for():
    bent = BentContacts((Plane(FRAME), Cylinder(FRAME, 2.0)), spiral, (0.0, 1.0))
    everywhere = bent(np.linspace(0, 1, 101)).uv[1]
    for some in ([0.0], [1.0], [0.55, 0.56], [0.2, 0.9]):
        index = np.round(np.array(some) * 100).astype(int)
        assert bent(np.array(some)).uv[1] == pytest.approx(everywhere[index], abs=1e-12)


def test_stations_are_shifted_and_parameters_moved_by_side():
    shift = EndFade(0.0, 1, 0.5, np.array(0.1), np.array(0.4))
    move = EndFade(1.0, -1, 0.25, np.array([0.3, 0.0]), np.array([0.0, 0.0]))
    primaries = Plane(FRAME), Cylinder(FRAME, 2.0)
    bent = BentContacts(primaries, spiral, (0.0, 1.0), ((shift,), ()), ((), (move,)))
    t = np.linspace(0, 1, 11)
    stations = t + shift.evaluate(t)
    contacts, natural = bent(t), BentContacts(primaries, spiral, (0.0, 1.0))(t)
    assert stations[0] == pytest.approx(0.1)
    assert contacts.uv[0] == pytest.approx(np.stack([stations, stations**2], -1), abs=1e-14)
    assert contacts.cross_lengths == pytest.approx(np.stack([1 + stations, 2 - t]), abs=1e-14)
    assert contacts.uv[1] - natural.uv[1] == pytest.approx(move.evaluate(t), abs=1e-12)
    assert contacts.t == pytest.approx(t)


def test_fields_are_turned_about_the_normal_and_lengths_stretched():
    t = np.array([0.0, 0.1, 0.9])
    jet = np.zeros((6, 3, 3))
    jet[1, :, 0] = jet[2, :, 1] = 1
    stations = RailStations(t, jet, np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)))
    quarter = EndFade(0.0, 1, 0.2, np.array(np.pi / 2), np.array(0.0))
    turned = turn_field(lambda _: np.tile([2.0, 0.0, 5.0], (3, 1)), (quarter,))(stations)
    assert turned[0] == pytest.approx([0, 2, 0], abs=1e-15)
    assert turned[2] == pytest.approx([2, 0, 0], abs=1e-15)
    assert np.linalg.norm(turned, axis=1) == pytest.approx([2, 2, 2])
    longer = stretch_lengths(lambda t: 3 * np.ones_like(t), (EndFade(0.0, 1, 0.2, np.array(0.5), np.array(0.0)),))
    assert longer(t)[[0, 2]] == pytest.approx([4.5, 3.0])
