"""Contacts along closed edges: native parameters go on without jumps, lap after lap."""

from __future__ import annotations

import numpy as np
from kernel_surfaces import pairs
from rail_cases import FRAME, TURN

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.contacts.parameter_unwrapping import unwrap_closed_solver
from cqblend.surfaces.quadrics import Plane


def test_closed_rails_are_followed_through_the_seam_for_any_number_of_laps():
    pair = pairs()["cylinder"]
    primaries = (Plane(FRAME), pair.primary)

    def solve(t):
        u = TURN * np.asarray(t)
        winding = np.stack([(u + 2) % TURN, np.sin(u)], -1)
        flat = np.stack([np.cos(u), np.sin(u)], -1)
        return Contacts(t, np.column_stack([flat, 0 * u]), (flat, winding), np.ones((2, len(u))))

    t = np.linspace(-1, 2, 121)
    uv = unwrap_closed_solver(solve, primaries)(t).uv[1]
    assert np.abs(np.diff(uv[:, 0]) - TURN / 40).max() < 1e-12
