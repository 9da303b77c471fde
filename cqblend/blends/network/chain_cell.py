"""One cell of a chain: what it brings, where it starts and ends, its natural jets there, and its fit to given ones.

*Natural* is what the cell would do by itself, without neighbours. Near its ends, its contacts are bent and its cross
derivatives turned so that they arrive as is wanted there; the ribbons fitted to them then have the wanted jets exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cqblend.blends.contacts.contact_solver import ContactSolver
from cqblend.blends.network.bent_contacts import BentContacts, EndFade, Fades, stretch_lengths, turn_field
from cqblend.blends.network.shared_section import SectionEnd
from cqblend.blends.network.tolerances import NETWORK_TOLERANCES
from cqblend.blends.rails.cubic_ribbons import fit_cubic_ribbons
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_end import EndJets, GivenEnds, RibbonEnd, find_foot, lift_end
from cqblend.blends.rails.ribbon_fit import ContactSamples, Domain, RibbonTargets
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import cross_product, normalise_vectors, to_tangent_coordinates

LightFit = Callable[[Domain], tuple[Ribbon, Ribbon] | None]
"""A function that makes straight or circular ribbons over a domain, or returns None if they are neither."""


@dataclass(frozen=True)
class CellRails:
    """What one cell of a chain brings.

    Attributes
    ----------
    primaries
        The surfaces of both sides.
    solve
        The contacts at ascending parameters t, shares of the length of the cell's own spine; also somewhat beyond
        [0, 1].
    targets
        What the ribbons are to be. Orders are the same in all cells of a chain.
    length
        The length (mm) of the cell's spine.
    fit_light
        What makes ribbons in lighter forms, if these may be exact.
    """

    primaries: tuple[Primary, Primary]
    solve: ContactSolver
    targets: RibbonTargets
    length: float
    fit_light: LightFit | None = None

    @property
    def jet_counts(self) -> tuple[int, int]:
        """The numbers of jets of both ribbons, position included."""
        first, second = self.targets.orders
        return 1 + max(first, 1), 1 + max(second, 1)


@dataclass(frozen=True)
class CellEnd:
    """Where a cell ends: the stations of the contacts of both sides.

    Of a side that crosses a smooth edge there, ``edge_tangents`` has the unit vector (3,) along that edge, if the cross
    derivative is to run along it.
    """

    stations: tuple[float, float]
    edge_tangents: tuple[Array | None, Array | None] = (None, None)

    @property
    def t(self) -> float:
        """The parameter of the rails at this end."""
        return sum(self.stations) / 2


@dataclass(frozen=True)
class WantedEnd:
    """What the ribbons of a cell are to have at one end, by side: jets, and the pace at which stations are passed."""

    jets: tuple[EndJets, EndJets]
    paces: tuple[float, float] = (1.0, 1.0)


@dataclass(frozen=True)
class _SideSamples:
    """Contacts of one side at some parameters beside an end, that of the end first.

    ``points`` are native parameters (n, 2), ``jet`` the native jet there, and ``vectors`` (n, 3) cross derivatives;
    ``differentiate`` (n,) are the weights of the values in their derivative at the end.
    """

    uv: Array
    jet: Array
    vectors: Array
    differentiate: Array

    @property
    def rate(self) -> Array:
        """The derivative of the native parameters at the end, (2,)."""
        return self.differentiate @ self.uv

    @property
    def normals(self) -> Array:
        """Su x Sv, normalised, (n, 3)."""
        return normalise_vectors(cross_product(self.jet[1], self.jet[2]))

    def estimate_jets(self, count: int) -> EndJets:
        """Return so many jets at the end: what of them is tangent to the surface counts, the rest follows from it."""
        rs = to_tangent_coordinates(self.jet, self.vectors)
        r, s, normals = rs[:, :1], rs[:, 1:], self.normals
        bending = (normals * (self.jet[3] * r**2 + 2 * self.jet[4] * r * s + self.jet[5] * s**2)).sum(axis=1)
        slowing = self.vectors * (bending**2 / (self.vectors**2).sum(axis=1))[:, None]
        along = self.rate[0] * self.jet[1, 0] + self.rate[1] * self.jet[2, 0]
        higher = np.stack([self.vectors, normals * bending[:, None], -slowing])
        values = np.stack([self.jet[0, 0], self.vectors[0], np.zeros(3), -slowing[0]])
        rates = np.concatenate([along[None], np.einsum("n,knd->kd", self.differentiate, higher)])
        return EndJets(values[:count], rates[:count])


@dataclass(frozen=True)
class ChainCell:
    """A cell between its two ends."""

    rails: CellRails
    ends: tuple[CellEnd, CellEnd]

    @property
    def domain(self) -> Domain:
        """The range of the rails' parameter."""
        return self.ends[0].t, self.ends[1].t

    @property
    def span(self) -> float:
        """The length of that range."""
        return self.domain[1] - self.domain[0]

    @property
    def has_common_stations(self) -> bool:
        """Whether the rails of both sides end at the same stations."""
        return all(end.stations[0] == end.stations[1] for end in self.ends)

    def fit_light(self) -> tuple[Ribbon, Ribbon] | None:
        """Return straight or circular ribbons, if these are exact."""
        if self.rails.fit_light is None or not self.has_common_stations:
            return None
        return self.rails.fit_light(self.domain)

    @cached_property
    def _widths(self) -> tuple[float, float]:
        """How far (mm) the rails are from the edge at both ends."""
        contacts = self.rails.solve(np.array(self.domain))
        points = [primary.jet(uv)[0] for primary, uv in zip(self.rails.primaries, contacts.uv, strict=True)]
        first, last = np.linalg.norm(np.stack(points) - contacts.edge_points, axis=2).max(axis=0)
        return float(first), float(last)

    def _measure_fade(self, end: int) -> float:
        """Return the length, in the parameter, over which bends at an end fade."""
        wanted = NETWORK_TOLERANCES.fade_width * self._widths[end] / self.rails.length
        return min(wanted, NETWORK_TOLERANCES.most_faded * self.span)

    def _fade(self, end: int, value: Array, rate: Array) -> EndFade:
        return EndFade(self.domain[end], 1 - 2 * end, self._measure_fade(end), value, rate)

    def _bend_contacts(self, wanted: tuple[WantedEnd | None, WantedEnd | None]) -> BentContacts:
        """Return contacts whose rails have the wanted positions and rates at the ends."""

        def shift_side(side: int) -> Fades:
            fades = []
            for i, (end, given) in enumerate(zip(self.ends, wanted, strict=True)):
                shift = end.stations[side] - end.t
                pace = 1.0 if given is None else given.paces[side]
                if shift or pace != 1.0:
                    fades.append(self._fade(i, np.array(shift), np.array(pace - 1.0)))
            return tuple(fades)

        unmoved = BentContacts(self.rails.primaries, self.rails.solve, self.domain, (shift_side(0), shift_side(1)))
        moves: list[list[EndFade]] = [[], []]
        for i, given in enumerate(wanted):
            if given is None:
                continue
            for side, samples in enumerate(self._sample_end(unmoved, self.rails.targets, i)):
                jets, primary = given.jets[side], self.rails.primaries[side]
                uv = find_foot(primary, jets.values[0], samples.uv[0])
                rate = to_tangent_coordinates(primary.jet(uv[None]), jets.rates[:1])[0]
                moves[side].append(self._fade(i, uv - samples.uv[0], rate - samples.rate))
        return replace(unmoved, moves=(tuple(moves[0]), tuple(moves[1])))

    def _sample_end(
        self, contacts: BentContacts, targets: RibbonTargets, end: int
    ) -> tuple[_SideSamples, _SideSamples]:
        """Sample contacts beside an end, inside the cell."""
        step = min(
            NETWORK_TOLERANCES.probe_width * self._widths[end] / self.rails.length,
            NETWORK_TOLERANCES.probe_share * self.span,
        )
        offsets = (1 - 2 * end) * step * np.arange(NETWORK_TOLERANCES.probe_count)
        order = np.argsort(offsets)
        t = self.domain[end] + offsets
        found = contacts(t[order]).select_stations(np.argsort(order))
        samples = ContactSamples(self.rails.primaries, t, replace(found, t=t), np.ones(len(t)))
        derivatives = _differentiate_at_nodes(offsets)
        sides = []
        for side, (uv, jet) in enumerate(zip(found.uv, samples.jets, strict=True)):
            rs = derivatives @ uv
            rates = rs[:, :1] * jet[1] + rs[:, 1:] * jet[2]
            vectors = samples.compute_cross_derivatives(side, rates, targets)
            sides.append(_SideSamples(uv, jet, vectors, derivatives[0]))
        return sides[0], sides[1]

    def estimate_natural_end(self, end: int) -> tuple[EndJets, EndJets]:
        """Return what the jets at an end are by nature, by side, but that cross derivatives run along smooth edges.

        Only what of them is tangent to the surfaces counts.
        """
        contacts, targets = self._bend_contacts((None, None)), self.rails.targets
        turns: list[Fades] = []
        for samples, tangent in zip(
            self._sample_end(contacts, targets, end), self.ends[end].edge_tangents, strict=True
        ):
            angle = 0.0 if tangent is None else _measure_turn(samples, tangent)
            turns.append((self._fade(end, np.array(angle), np.array(0.0)),) if angle else ())
        fields = turn_field(targets.fields[0], turns[0]), turn_field(targets.fields[1], turns[1])
        first, second = self._sample_end(contacts, replace(targets, fields=fields), end)
        counts = self.rails.jet_counts
        return first.estimate_jets(counts[0]), second.estimate_jets(counts[1])

    def lift_end(self, end: int, jets: tuple[EndJets, EndJets]) -> tuple[tuple[RibbonEnd, RibbonEnd], SectionEnd]:
        """Return ends of ribbons with the tangent parts of wanted jets, by side, and the jets that they have."""
        near = self._bend_contacts((None, None))(np.array([self.domain[end]])).uv
        step = (1 - 2 * end) * NETWORK_TOLERANCES.lifted_step * self.span
        (first, first_jets), (second, second_jets) = (
            lift_end(primary, find_foot(primary, one.values[0], uv[0]), one, step)
            for primary, one, uv in zip(self.rails.primaries, jets, near, strict=True)
        )
        return (first, second), SectionEnd((first_jets, second_jets), self.rails.targets.orders)

    def fit_to_ends(self, wanted: tuple[WantedEnd | None, WantedEnd | None]) -> tuple[Ribbon, Ribbon]:
        """Fit cubic ribbons with wanted jets at the ends of the cell, free ones where nothing is wanted."""
        rails = self.rails
        if wanted == (None, None):
            return fit_cubic_ribbons(rails.primaries, rails.solve, self.domain, rails.targets, closed=False)
        contacts = self._bend_contacts(wanted)
        targets = self._turn_targets(contacts, wanted)
        first, second = (None if one is None else self.lift_end(i, one.jets)[0] for i, one in enumerate(wanted))
        ends: tuple[GivenEnds, GivenEnds] = (
            (None if first is None else first[0], None if second is None else second[0]),
            (None if first is None else first[1], None if second is None else second[1]),
        )
        return fit_cubic_ribbons(rails.primaries, contacts, self.domain, targets, closed=False, ends=ends)

    def _turn_targets(self, contacts: BentContacts, wanted: tuple[WantedEnd | None, WantedEnd | None]) -> RibbonTargets:
        """Return targets whose cross derivatives, and the rates of these, are the wanted ones at the ends."""
        targets = self.rails.targets
        turns: list[list[EndFade]] = [[], []]
        stretches: list[list[EndFade]] = [[], []]
        for i, given in enumerate(wanted):
            if given is None:
                continue
            values = [
                _compare_vectors(samples.vectors[0], jets.values[1], samples.normals[0])
                for samples, jets in zip(self._sample_end(contacts, targets, i), given.jets, strict=True)
            ]
            still = np.array(0.0)
            unslanted = _bend_targets(
                targets,
                [[self._fade(i, np.array(angle), still)] for angle, _ in values],
                [[self._fade(i, np.array(stretch), still)] for _, stretch in values],
            )
            for side, samples in enumerate(self._sample_end(contacts, unslanted, i)):
                vector, (angle, stretch) = samples.vectors[0], values[side]
                missing = given.jets[side].rates[1] - samples.differentiate @ samples.vectors
                square = vector @ vector
                turning = float(missing @ cross_product(samples.normals[0], vector) / square)
                growth = float(missing @ vector / square) * (1.0 + stretch)
                turns[side].append(self._fade(i, np.array(angle), np.array(turning)))
                stretches[side].append(self._fade(i, np.array(stretch), np.array(growth)))
        return _bend_targets(targets, turns, stretches)


def _bend_targets(
    targets: RibbonTargets, turns: Sequence[Sequence[EndFade]], stretches: Sequence[Sequence[EndFade]]
) -> RibbonTargets:
    """Return targets with turned and stretched cross derivatives, by side."""
    (first_field, second_field), (first_bulge, second_bulge) = targets.fields, targets.bulges
    return replace(
        targets,
        fields=(turn_field(first_field, tuple(turns[0])), turn_field(second_field, tuple(turns[1]))),
        bulges=(
            stretch_lengths(first_bulge, tuple(stretches[0])),
            stretch_lengths(second_bulge, tuple(stretches[1])),
        ),
    )


def _compare_vectors(vector: Array, wanted: Array, normal: Array) -> tuple[float, float]:
    """Return the angle (rad) about a normal from one tangent vector to another, and the relative change of length."""
    angle = np.arctan2(cross_product(vector, wanted) @ normal, vector @ wanted)
    return float(angle), float(np.linalg.norm(wanted) / np.linalg.norm(vector) - 1.0)


def _measure_turn(samples: _SideSamples, tangent: Array) -> float:
    """Return the angle (rad) from the cross derivative at an end to a smooth edge; 0 if that is too oblique."""
    vector = samples.vectors[0]
    angle, _ = _compare_vectors(vector, tangent * np.sign(tangent @ vector), samples.normals[0])
    return angle if abs(angle) <= NETWORK_TOLERANCES.largest_obliquity else 0.0


def _differentiate_at_nodes(nodes: Array) -> Array:
    """Return the matrix (n, n) that takes values at nodes (n,) to the derivatives there of their polynomial."""
    gaps = nodes[:, None] - nodes
    np.fill_diagonal(gaps, 1.0)
    weights = 1 / gaps.prod(axis=1)
    matrix = weights / weights[:, None] / gaps
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return matrix
