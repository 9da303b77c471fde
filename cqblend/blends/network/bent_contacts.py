"""Contacts of a cell that are bent near its ends, so that its rails arrive there as its neighbours' do.

Two things are done to them, by side, over a length at each end, and fade out smoothly: stations are shifted and run
through at another pace, which keeps the rail where it is; and native parameters are moved, which rounds the kink that
the rail of a ball has where it crosses an oblique smooth edge. Cross derivatives are turned and scaled likewise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver
from cqblend.blends.rails.cross_directions import CrossField, RailStations
from cqblend.blends.rails.ribbon_fit import Domain, LengthFactor
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import cross_product


@dataclass(frozen=True)
class EndFade:
    """What is added to a function near one end of a cell: ``value`` there, with the slope ``rate`` along the cell.

    It is added over ``length`` from ``t``, in the direction ``inward`` (1 or -1), and fades with two vanishing
    derivatives. Both may be arrays (k,).
    """

    t: float
    inward: int
    length: float
    value: Array
    rate: Array

    def evaluate(self, t: Array) -> Array:
        """Return what is added at t (n,), (n, k) or (n,)."""
        x = np.clip(self.inward * (t - self.t) / self.length, 0.0, 1.0)
        near = (1 - x) ** 3
        rate = self.inward * self.length * self.rate
        return np.asarray(np.multiply.outer(near * (1 + 3 * x), self.value) + np.multiply.outer(near * x, rate))


Fades = tuple[EndFade, ...]
"""Those at the ends of one side of a cell."""


def sum_fades(fades: Fades, t: Array) -> Array | float:
    """Return all that is added at t (n,)."""
    return sum((fade.evaluate(t) for fade in fades), 0.0)


@dataclass(frozen=True)
class BentContacts:
    """A solver of contacts over the domain of a cell: those of another solver, with shifts and moves, by side.

    ``shifts`` are added to the parameters at which contacts are looked for, ``moves`` to native parameters. Whatever
    range is asked for, native parameters are those of one continuous run over the domain.
    """

    primaries: tuple[Primary, Primary]
    solve: ContactSolver
    domain: Domain
    shifts: tuple[Fades, Fades] = ((), ())
    moves: tuple[Fades, Fades] = ((), ())

    def __call__(self, t: Array) -> Contacts:
        """Return the bent contacts at ascending t (n,)."""
        stations = [t + sum_fades(shifts, t) for shifts in self.shifts]
        together = np.unique(np.concatenate([self._skeleton, *stations]))
        contacts = self.solve(together)
        start = np.searchsorted(together, self._skeleton[0])
        first, second = (
            contacts.uv[side]
            + _measure_laps(self.primaries[side], self._start_parameters[side] - contacts.uv[side][start])
            for side in (0, 1)
        )
        contacts = replace(contacts, uv=(first, second))
        both = merge_sides(*(contacts.select_stations(np.searchsorted(together, at)) for at in stations))
        moved = tuple(uv + sum_fades(moves, t) for uv, moves in zip(both.uv, self.moves, strict=True))
        return replace(both, t=t, uv=(moved[0], moved[1]))

    @cached_property
    def _skeleton(self) -> Array:
        """Stations all over the domain, those that a fit starts with."""
        return np.linspace(*self.domain, RAIL_TOLERANCES.initial_spans + 1)

    @cached_property
    def _start_parameters(self) -> tuple[Array, Array]:
        """The native parameters (2,) of both contacts at the start of the domain."""
        first, second = self.solve(self._skeleton).uv
        return first[0], second[0]


def _measure_laps(primary: Primary, offset: Array) -> Array:
    """Return the whole periods of a surface next to an offset of native parameters, (2,)."""
    laps = np.zeros(2)
    for axis, period in enumerate(primary.periods):
        if period is not None:
            laps[axis] = period * np.round(offset[axis] / period)
    return laps


def merge_sides(first: Contacts, second: Contacts) -> Contacts:
    """Return contacts of which the first side is that of some, and the second one that of others, in the same order."""
    return Contacts(
        first.t,
        (first.edge_points + second.edge_points) / 2,
        (first.uv[0], second.uv[1]),
        np.stack([first.cross_lengths[0], second.cross_lengths[1]]),
        None if first.cross_vectors is None else np.stack([first.get_cross_vectors(0), second.get_cross_vectors(1)]),
    )


def turn_field(field: CrossField, turns: Fades) -> CrossField:
    """Return a cross field turned in the tangent planes, about Su x Sv, by angles (rad)."""

    def evaluate_turned(stations: RailStations) -> Array:
        vectors, normals = field(stations), stations.normals
        flat = vectors - (vectors * normals).sum(axis=1, keepdims=True) * normals
        angle = np.asarray(sum_fades(turns, stations.t))[:, None]
        return np.asarray(np.cos(angle) * flat + np.sin(angle) * cross_product(normals, flat))

    return evaluate_turned if turns else field


def stretch_lengths(factor: LengthFactor, stretches: Fades) -> LengthFactor:
    """Return a factor on lengths with relative changes of them."""
    return lambda t: np.asarray(factor(t) * (1.0 + sum_fades(stretches, t)))
