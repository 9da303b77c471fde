"""Contacts where sizes go to 0: both rails end in the edge, and what Newton's method solves for is lost in rounding.

Divided by the size, the way from the edge point to a contact is a smooth function of t up to the end. It is solved for
where sizes are large enough, continued by a polynomial to where they are not, and multiplied by the size again, so that
its error is multiplied by what is next to 0. At the end itself, contacts are the point of the edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver, Stations, SupportSurface
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.splines.local_interpolation import interpolate_locally
from cqblend.surfaces.angles import shift_to_period


@dataclass(frozen=True)
class VanishingEnd:
    """An end of an edge, t = 0 or 1, at which sizes go to 0, and the t next to it from which they are solved for."""

    end: float
    limit: float

    def select_near(self, t: Array) -> Array:
        """Return a mask of the t (n,) that are nearer to the end than the limit."""
        return np.asarray(t > self.limit if self.end > self.limit else t < self.limit)


def continue_to_ends(
    solve: ContactSolver,
    locate_on_surfaces: Callable[[Array], Stations],
    sides: tuple[SupportSurface, SupportSurface],
    measure_sizes: Callable[[Array], Array],
    ends: tuple[VanishingEnd, ...],
) -> ContactSolver:
    """Return a solver of contacts that continues another one to ends at which sizes go to 0.

    ``locate_on_surfaces`` returns stations at t (n,) that lie on both surfaces, ``measure_sizes`` the sizes on both
    sides, (2, n).
    """

    def solve_contacts(t: Array) -> Contacts:
        near = [end.select_near(t) for end in ends]
        far = ~np.any(near, axis=0)
        found = [solve(t[far])] if far.any() else []
        found += [continue_to_end(end, t[mask]) for end, mask in zip(ends, near, strict=True) if mask.any()]
        order = np.argsort(np.concatenate([np.flatnonzero(far), *map(np.flatnonzero, near)]))
        contacts = found[0]
        for more in found[1:]:
            contacts = contacts.append(more)
        return contacts.select_stations(order)

    def continue_to_end(end: VanishingEnd, t: Array) -> Contacts:
        count = CONTACT_TOLERANCES.tracing_stations
        nodes = end.end + (end.limit - end.end) * (1 + 2 * np.arange(count) / (count - 1))
        known, there = solve(np.sort(nodes)), locate_on_surfaces(np.sort(nodes))
        stations, sizes, known_sizes = locate_on_surfaces(t), measure_sizes(t), measure_sizes(known.t)
        uv, lengths = [], []
        for i, side in enumerate(sides):
            ways = known.uv[i] - there.uv[i]
            for axis, period in enumerate(side.primary.periods):
                if period is not None:
                    ways[:, axis] = shift_to_period(ways[:, axis], np.zeros(count), period)
            values = np.column_stack([ways, known.cross_lengths[i]]) / known_sizes[i][:, None]
            continued = interpolate_locally(known.t, values, t, count) * sizes[i][:, None]
            uv.append(stations.uv[i] + continued[:, :2])
            lengths.append(continued[:, 2])
        edge_uv = np.concatenate(stations.uv, axis=1)
        return Contacts(t, stations.points, (uv[0], uv[1]), np.stack(lengths), edge_uv=edge_uv)

    return solve_contacts
