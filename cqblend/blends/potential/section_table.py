"""A table of swept sections: exact ones at few stations, others interpolated from these within a tolerance.

The interior of a blend is fitted to thousands of sections. Most of a swept surface is so smooth that a few dozen exact
ones tell all others. Known kinks are stations, across which nothing is interpolated; around others, stations are
halved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from cqblend.blends.potential.tolerances import POTENTIAL_LIMITS, POTENTIAL_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.splines.local_interpolation import interpolate_locally


@dataclass(frozen=True)
class SectionTable:
    """Sections of a swept surface at any t of a domain, as exact as ``tolerance`` (mm).

    Attributes
    ----------
    evaluate : callable
        The exact sections (n, m, 3) at t (n,).
    domain : pair of float
        The range of t; ``closed`` sections are periodic in it.
    closed : bool
    tolerance : float
        Largest error of a coordinate (mm).
    kinks : numpy.ndarray
        (k,) ascending parameters at which the sections are known not to be smooth: inside, or the lower end if that is
        the seam of closed sections.
    """

    evaluate: Callable[[Array], Array]
    domain: tuple[float, float]
    closed: bool
    tolerance: float
    kinks: Array

    def __call__(self, t: Array) -> Array:
        """Return the sections (n, m, 3) at t (n,): exact ones if these are fewer than the table would take."""
        if len(t) <= 2 * POTENTIAL_LIMITS.table_cells:
            return self.evaluate(t)
        nodes, values, rough = self._tabulated
        sections = self._interpolate(nodes, values, t)
        if len(rough):
            inside = np.searchsorted(rough.ravel(), t) % 2 == 1
            if inside.any():
                sections[inside] = self.evaluate(t[inside])
        return sections

    @cached_property
    def _tabulated(self) -> tuple[Array, Array, Array]:
        """Nodes (k,), sections there, and the intervals (r, 2) in which these do not tell the others.

        Every cell between two nodes is checked at its middle, which becomes a node, too.
        """
        low, high = self.domain
        nodes = self._place_nodes()
        values = self.evaluate(nodes)
        cells = np.stack([nodes[:-1], nodes[1:]], axis=-1)
        shortest = (high - low) / POTENTIAL_LIMITS.table_shortest_cell
        rough = np.empty((0, 2))
        while len(cells):
            middles = cells.mean(axis=1)
            exact = self.evaluate(middles)
            error = np.abs(self._interpolate(*self._extend_period(nodes, values), middles) - exact).max(axis=(1, 2))
            order = np.argsort(np.concatenate([nodes, middles]))
            nodes, values = np.concatenate([nodes, middles])[order], np.concatenate([values, exact])[order]
            bad = error > self.tolerance
            halves = np.stack([cells[bad, 0], middles[bad], middles[bad], cells[bad, 1]], axis=-1).reshape(-1, 2)
            is_short = halves[:, 1] - halves[:, 0] < shortest
            rough = np.concatenate([rough, halves[is_short]])
            cells = halves[~is_short]
        return *self._extend_period(nodes, values), rough[np.argsort(rough[:, 0])]

    def _place_nodes(self) -> Array:
        """Return the first nodes (k,): even ones between ends and kinks, enough in each stretch for a polynomial."""
        low, high = self.domain
        ends = np.union1d(self.domain, self.kinks)
        even = np.ceil(
            POTENTIAL_LIMITS.table_cells * np.diff(ends) / (high - low) - POTENTIAL_TOLERANCES.kink_parameter
        )
        counts = np.maximum(even, POTENTIAL_LIMITS.table_stencil - 1).astype(int)
        stretches = [np.linspace(a, b, n + 1)[:-1] for (a, b), n in zip(pairwise(ends), counts.tolist(), strict=True)]
        return np.append(np.concatenate(stretches), high)

    def _interpolate(self, nodes: Array, values: Array, t: Array) -> Array:
        """Interpolate sections (n, m, 3) at t (n,) from nodes that go past both ends if the sections are closed."""
        kinks, period = self.kinks, self.domain[1] - self.domain[0]
        if self.closed:
            kinks = np.unique(np.concatenate([kinks - period, kinks, kinks + period]))
        kinks = kinks[(kinks > nodes[0]) & (kinks < nodes[-1])]
        return interpolate_locally(nodes, values, t, POTENTIAL_LIMITS.table_stencil, kinks)

    def _extend_period(self, nodes: Array, values: Array) -> tuple[Array, Array]:
        """Return nodes and values of closed sections, repeated past both ends so that the seam is no end."""
        if not self.closed:
            return nodes, values
        count, period = POTENTIAL_LIMITS.table_stencil, self.domain[1] - self.domain[0]
        return (
            np.concatenate([nodes[-1 - count : -1] - period, nodes, nodes[1 : count + 1] + period]),
            np.concatenate([values[-1 - count : -1], values, values[1 : count + 1]]),
        )
