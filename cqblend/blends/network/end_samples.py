"""Contacts beside an end of a cell, from which its jets there are found: by differences, and by what surfaces tell.

Only what is tangent to a surface is found by differences: in jets, all else follows from it exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.rails.ribbon_end import EndJets
from cqblend.splines.bernstein import Array
from cqblend.splines.local_interpolation import tabulate_node_derivatives
from cqblend.surfaces.vectors import cross_product, normalise_vectors, to_tangent_coordinates


@dataclass(frozen=True)
class EndProbe:
    """Natural contacts beside an end of a cell, those of the end first, at the same ``offsets`` (n,) on both sides.

    The offsets are from the station of each side, so that stations may differ. In between, contacts are polynomials.
    """

    offsets: Array
    contacts: Contacts

    @cached_property
    def differentiate(self) -> Array:
        """The matrix (n, n) that takes values at the offsets to their derivatives there."""
        return tabulate_node_derivatives(self.offsets)

    def bend(self, t: Array, shifts: tuple[Array, Array], moves: tuple[Array, Array]) -> Contacts:
        """Return contacts at t (n,), whose stations are shifted (n,), and native parameters moved (n, 2), by side."""
        natural = self.contacts
        tables = [self._tabulate_interpolation(self.offsets + shift - shift[0]) for shift in shifts]
        first, second = (table @ uv + move for table, uv, move in zip(tables, natural.uv, moves, strict=True))
        return Contacts(
            t,
            natural.edge_points,
            (first, second),
            np.stack([table @ lengths for table, lengths in zip(tables, natural.cross_lengths, strict=True)]),
            None
            if natural.cross_vectors is None
            else np.stack([table @ vectors for table, vectors in zip(tables, natural.cross_vectors, strict=True)]),
        )

    def _tabulate_interpolation(self, at: Array) -> Array:
        """Return the matrix (m, n) that takes values at the offsets to those of their polynomial at (m,)."""
        nodes, others = self.offsets, ~np.eye(len(self.offsets), dtype=bool)
        ratios = (at[:, None, None] - nodes) / np.where(others, nodes[:, None] - nodes, 1.0)
        return np.asarray(np.where(others, ratios, 1.0).prod(axis=2))


@dataclass(frozen=True)
class SideSamples:
    """Contacts of one side beside an end of a cell, that of the end first.

    ``uv`` are native parameters (n, 2), ``jet`` the native jet there, and ``vectors`` (n, 3) cross derivatives;
    ``differentiate`` (n,) are the weights of values in their derivative at the end.
    """

    uv: Array
    jet: Array
    vectors: Array
    differentiate: Array

    @property
    def normals(self) -> Array:
        """Su x Sv, normalised, (n, 3)."""
        return normalise_vectors(cross_product(self.jet[1], self.jet[2]))

    @property
    def rail_rate(self) -> Array:
        """The derivative of the rail at the end, (3,)."""
        rate = self.differentiate @ self.uv
        return np.asarray(rate[0] * self.jet[1, 0] + rate[1] * self.jet[2, 0])

    def estimate_jets(self, count: int, edge: Array | None) -> EndJets:
        """Return so many jets at the end: what of them is tangent to the surface counts, the rest follows from it.

        Sections leave the end at constant speed, along a smooth edge with derivatives ``edge`` (3, 3), if there is one.
        """
        rs = to_tangent_coordinates(self.jet, self.vectors)
        r, s, normals = rs[:, :1], rs[:, 1:], self.normals
        bending = (normals * (self.jet[3] * r**2 + 2 * self.jet[4] * r * s + self.jet[5] * s**2)).sum(axis=1)
        slowing = self.vectors * (bending**2 / (self.vectors**2).sum(axis=1))[:, None]
        higher = np.stack([self.vectors, normals * bending[:, None], -slowing])
        values = np.stack([self.jet[0, 0], self.vectors[0], np.zeros(3), -slowing[0]])
        if edge is not None:
            length = self.vectors[0] @ edge[0]
            values[2:] = length**2 * edge[1], length**3 * edge[2]
        rates = np.concatenate([self.rail_rate[None], np.einsum("n,knd->kd", self.differentiate, higher)])
        return EndJets(values[:count], rates[:count])
