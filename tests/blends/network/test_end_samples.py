"""Jets at the end of a cell, estimated from contacts beside it."""

from __future__ import annotations

import numpy as np
import pytest
from rail_cases import FRAME

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.network.end_samples import EndProbe, SideSamples
from cqblend.surfaces.quadrics import Cylinder


def probe_of(offsets):
    uv = np.stack([np.sin(offsets), np.exp(offsets)], -1)
    edge = np.stack([offsets] * 3, -1)
    return EndProbe(offsets, Contacts(offsets, edge, (uv, 2 * uv), np.stack([np.cos(offsets), offsets])))


@pytest.mark.parametrize("inward", [1, -1])
def test_shifted_contacts_are_those_of_the_polynomials_between(inward):
    offsets = inward * 0.01 * np.arange(6)
    probe = probe_of(offsets)
    shift, flat = 0.2 + 0.1 * offsets, np.zeros((6, 2))
    bent = probe.bend(offsets, (shift, 0 * offsets), (flat, flat + 3))
    local = offsets + shift - shift[0]  # the first contact is that of the shifted station
    assert bent.uv[0] == pytest.approx(np.stack([np.sin(local), np.exp(local)], -1), abs=1e-11)
    assert bent.uv[1] == pytest.approx(2 * np.stack([np.sin(offsets), np.exp(offsets)], -1) + 3, abs=1e-13)
    assert bent.cross_lengths[0] == pytest.approx(np.cos(local), abs=1e-11)


@pytest.mark.parametrize("inward", [1, -1])
def test_derivatives_at_the_end_are_those_of_the_contacts(inward):
    probe = probe_of(inward * 0.01 * np.arange(6))
    assert probe.differentiate[0] @ probe.contacts.uv[0] == pytest.approx([1, 1], abs=1e-9)


def test_sections_leave_a_cylinder_at_constant_speed_or_along_an_edge():
    """Around the cylinder by 0.5 rad along its axis: K is centripetal, and J tangential, against the way."""
    offsets = 0.01 * np.arange(6)
    uv = np.stack([0.3 + 0 * offsets, offsets], -1)
    primary = Cylinder(FRAME, 2.0)
    jet = primary.jet(uv)
    samples = SideSamples(uv, jet, 0.5 * jet[1], EndProbe(offsets, probe_of(offsets).contacts).differentiate[0])
    jets = samples.estimate_jets(4, None)
    around = jet[1, 0] / 2
    assert samples.rail_rate == pytest.approx(jet[2, 0], abs=1e-10)
    assert jets.values[1] == pytest.approx(around)
    assert jets.values[2] == pytest.approx(np.zeros(3))
    assert jets.values[3] == pytest.approx(-around / 4)
    assert jets.rates[1:] == pytest.approx(np.zeros((3, 3)), abs=1e-9)
    edge = np.stack([-around, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    along = samples.estimate_jets(4, edge)
    assert along.values[2:] == pytest.approx(edge[1:] * np.array([[1.0], [-1.0]]))
