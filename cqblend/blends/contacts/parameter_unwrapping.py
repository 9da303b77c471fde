"""Makes the parameters of contacts continuous along the edge, over seams and around closed edges.

Rails are fitted in the parameter plane, so a jump by a period of the surface would be taken for a part of the curve.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver
from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import unwrap_parameters
from cqblend.surfaces.primary_surface import Primary


def unwrap_open_solver(solve: ContactSolver, primaries: tuple[Primary, Primary]) -> ContactSolver:
    """Return a solver over an open edge whose native parameters are continuous, for ascending t."""

    def solve_along(t: Array) -> Contacts:
        contacts = solve(t)
        first, second = (
            unwrap_parameters(uv, primary.periods) for primary, uv in zip(primaries, contacts.uv, strict=True)
        )
        return replace(contacts, uv=(first, second))

    return solve_along


def unwrap_closed_solver(solve: ContactSolver, primaries: tuple[Primary, Primary]) -> ContactSolver:
    """Extend a solver over a closed edge, t in [0, 1), to all t, with native parameters that are continuous.

    The parameters asked for must include an integer, and follow the edge densely enough to tell which way it winds
    around a periodic surface: each lap then adds a multiple of the period.
    """

    def solve_around(t: Array) -> Contacts:
        lap = np.floor(t)
        base, index = np.unique(t - lap, return_inverse=True)
        contacts = solve(base)

        def unwrap_laps(primary: Primary, uv: Array) -> Array:
            uv = unwrap_parameters(uv, primary.periods)
            winding = np.zeros(2)
            for axis, period in enumerate(primary.periods):
                if period is not None:
                    winding[axis] = period * np.round((uv[-1, axis] - uv[0, axis]) / period)
            return np.asarray(uv[index] + lap[:, None] * winding)

        first, second = (unwrap_laps(primary, uv) for primary, uv in zip(primaries, contacts.uv, strict=True))
        return replace(contacts.select_stations(index), t=t, uv=(first, second))

    return solve_around
