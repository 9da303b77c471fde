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
from cqblend.blends.network.bent_contacts import (
    BentContacts,
    EndFade,
    Fades,
    merge_sides,
    stretch_lengths,
    sum_fades,
    turn_field,
)
from cqblend.blends.network.end_samples import EndProbe, SideSamples
from cqblend.blends.network.shared_section import SectionEnd
from cqblend.blends.network.tolerances import NETWORK_TOLERANCES
from cqblend.blends.rails.cubic_ribbons import NO_CORNERS, fit_cubic_ribbons
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_end import EndJets, GivenEnds, RibbonEnd, find_foot, lift_end
from cqblend.blends.rails.ribbon_fit import ContactSamples, Domain, RibbonTargets
from cqblend.errors import SizeError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import cross_product, measure_lengths, normalise_vectors, to_tangent_coordinates

LightFit = Callable[[Domain], tuple[Ribbon, Ribbon] | None]
"""A function that makes straight or circular ribbons over a domain, or returns None if they are neither."""


def _locate_no_corners(domain: Domain) -> Array:
    """Return no corners, those of contacts that are smooth."""
    del domain
    return NO_CORNERS


@dataclass(frozen=True)
class CellPole:
    """The side, 0 or 1, on which all contacts of a cell are one point, and how far that is off the ball (mm)."""

    side: int
    deviation: float


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
    fit_turning
        What makes light ribbons about a ball that turns in place, between which nothing but its arcs is smooth.
    goes_around
        Whether the ball goes around a round face, so that one rail is much shorter than the other.
    pole
        Where it then turns about one point, if it does.
    locate_corners
        What returns the parameters in a range at which contacts are known to be no more than C1.
    rank
        Of two like cells, the one of lower rank dictates; so the result does not depend on the sense of the chain.
    window
        About where the cell starts and ends.
    """

    primaries: tuple[Primary, Primary]
    solve: ContactSolver
    targets: RibbonTargets
    length: float
    fit_light: LightFit | None = None
    fit_turning: LightFit | None = None
    goes_around: bool = False
    pole: CellPole | None = None
    locate_corners: Callable[[Domain], Array] = _locate_no_corners
    rank: int = 0
    window: Domain = (0.0, 1.0)

    @property
    def width(self) -> float:
        """How much of t that is."""
        return self.window[1] - self.window[0]

    @property
    def jet_counts(self) -> tuple[int, int]:
        """The numbers of jets of both ribbons, position included."""
        first, second = self.targets.orders
        return 1 + max(first, 1), 1 + max(second, 1)


@dataclass(frozen=True)
class CellEnd:
    """Where a cell ends: the stations of the contacts of both sides.

    Of a side that crosses a smooth edge there, ``edge_jets`` has the first three derivatives (3, 3) of that edge by its
    arc length, if cross derivatives are to run along it. ``roughness`` (rad) is the largest angle between the faces at
    such edges, ``gap`` (mm) the largest distance.
    """

    stations: tuple[float, float]
    edge_jets: tuple[Array | None, Array | None] = (None, None)
    roughness: float = 0.0
    gap: float = 0.0

    @property
    def t(self) -> float:
        """The parameter of the rails at this end."""
        return sum(self.stations) / 2


@dataclass(frozen=True)
class WantedEnd:
    """What the ribbons of a cell are to have at one end.

    ``section`` has their jets, and ``lifted``, by side, what curves have these jets. Stations are passed at ``paces``,
    by side: derivatives of the stations by the parameter of the rails.
    """

    section: SectionEnd
    lifted: tuple[RibbonEnd, RibbonEnd]
    paces: tuple[float, float]


WantedEnds = tuple[WantedEnd | None, WantedEnd | None]
"""Those at the start and at the stop of a cell; None where its ribbons are free."""


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
        differences = [abs(end.stations[0] - end.stations[1]) for end in self.ends]
        return max(differences) <= NETWORK_TOLERANCES.common_stations

    def fit_light(self) -> tuple[Ribbon, Ribbon] | None:
        """Return straight or circular ribbons, if these are exact."""
        if self.rails.fit_light is None or not self.has_common_stations:
            return None
        return self.rails.fit_light(self.domain)

    def fit_for_arcs(self) -> tuple[Ribbon, Ribbon] | None:
        """Return ribbons between which a ball's arcs may be exact; None if they are neither straight nor circles."""
        light = self.fit_light()
        if light is None and self.rails.fit_turning is not None and self.has_common_stations:
            return self.rails.fit_turning(self.domain)
        return light

    @cached_property
    def _natural(self) -> BentContacts:
        """The natural contacts, of one run over the domain."""
        return BentContacts(self.rails.primaries, self.rails.solve, self.domain)

    @cached_property
    def _widths(self) -> tuple[float, float]:
        """How far (mm) the rails are from the edge at both ends."""
        contacts = self._natural(np.array(self.domain))
        points = [primary.jet(uv)[0] for primary, uv in zip(self.rails.primaries, contacts.uv, strict=True)]
        first, last = np.linalg.norm(np.stack(points) - contacts.edge_points, axis=2).max(axis=0)
        return float(first), float(last)

    @cached_property
    def _probes(self) -> tuple[EndProbe, EndProbe]:
        """Natural contacts beside both ends."""
        numbers = np.arange(NETWORK_TOLERANCES.probe_count)
        offsets = [
            inward
            * numbers
            * min(
                NETWORK_TOLERANCES.probe_width * width / self.rails.length, NETWORK_TOLERANCES.probe_share * self.span
            )
            for inward, width in zip((1, -1), self._widths, strict=True)
        ]
        stations = np.stack(
            [np.add.outer(end.stations, steps) for end, steps in zip(self.ends, offsets, strict=True)]
        )  # (ends, sides, n)
        t, index = np.unique(stations, return_inverse=True)
        found, index = self._natural(t), index.reshape(stations.shape)

        def probe_end(end: int) -> EndProbe:
            first, second = (found.select_stations(index[end, side]) for side in (0, 1))
            return EndProbe(offsets[end], merge_sides(first, second))

        return probe_end(0), probe_end(1)

    def _make_fade(self, end: int, value: Array, rate: Array, *, widths: float) -> EndFade:
        """Return what is added to a function at one end: ``value``, with a slope ``rate``. It fades out."""
        wanted = widths * self._widths[end] / self.rails.length
        length = min(wanted, NETWORK_TOLERANCES.most_faded * self.span)
        return EndFade(self.domain[end], 1 - 2 * end, length, value, rate)

    def _make_number_fade(self, end: int, value: float, rate: float = 0.0) -> EndFade:
        """Return what is added to a station, an angle or a relative length."""
        return self._make_fade(end, np.array(value), np.array(rate), widths=NETWORK_TOLERANCES.turning_widths)

    def _shift_stations(self, end: int, paces: tuple[float, float]) -> tuple[Fades, Fades]:
        """Return what is added to stations at an end so that they are those of both sides, passed at these paces."""
        first, second = (
            (self._make_number_fade(end, station - self.ends[end].t, pace - 1.0),)
            if station != self.ends[end].t or pace != 1.0
            else ()
            for station, pace in zip(self.ends[end].stations, paces, strict=True)
        )
        return first, second

    def _sample_end(
        self, end: int, shifts: tuple[Fades, Fades], moves: tuple[Fades, Fades], targets: RibbonTargets
    ) -> tuple[SideSamples, SideSamples]:
        """Sample bent contacts beside an end, inside the cell, and cross derivatives there."""
        probe = self._probes[end]
        t, flat = self.domain[end] + probe.offsets, np.zeros((len(probe.offsets), 2))
        contacts = probe.bend(
            t,
            (flat[:, 0] + sum_fades(shifts[0], t), flat[:, 0] + sum_fades(shifts[1], t)),
            (flat + sum_fades(moves[0], t), flat + sum_fades(moves[1], t)),
        )
        samples = ContactSamples(self.rails.primaries, t, contacts, np.ones(len(t)))
        sides = []
        for side, (uv, jet) in enumerate(zip(contacts.uv, samples.jets, strict=True)):
            rs = probe.differentiate @ uv
            rates = rs[:, :1] * jet[1] + rs[:, 1:] * jet[2]
            vectors = samples.compute_cross_derivatives(side, rates, targets)
            sides.append(SideSamples(uv, jet, vectors, probe.differentiate[0]))
        return sides[0], sides[1]

    def must_turn(self, end: int, section: SectionEnd) -> bool:
        """Whether a section at an end is to follow smooth edges that its sides cross, and does not."""
        for jets, edge, order in zip(section.jets, self.ends[end].edge_jets, section.orders, strict=True):
            if edge is None or not _is_steep(edge, jets.rates[0]):
                continue
            vector, normal = jets.values[1], cross_product(jets.rates[0], jets.values[1])
            square = vector @ vector
            if np.linalg.norm(cross_product(vector, edge[0])) > NETWORK_TOLERANCES.along_edge * np.sqrt(square):
                return True
            if order >= 2:
                off = jets.values[2] - square * edge[1]
                off -= normal * ((off @ normal) / (normal @ normal))
                if np.linalg.norm(off) > NETWORK_TOLERANCES.edge_curvature * square:
                    return True
        return False

    def estimate_natural_end(self, end: int) -> tuple[EndJets, EndJets]:
        """Return what the jets at an end are by nature, by side, but that they follow smooth edges.

        Only what of them is tangent to the surfaces counts.
        """
        shifts, targets = self._shift_stations(end, (1.0, 1.0)), self.rails.targets
        natural = self._sample_end(end, shifts, ((), ()), targets)
        edges = [
            None if edge is None or not _is_steep(edge, samples.rail_rate) else edge
            for samples, edge in zip(natural, self.ends[end].edge_jets, strict=True)
        ]
        angles = [
            0.0 if edge is None else _measure_turn(samples, edge[0])
            for samples, edge in zip(natural, edges, strict=True)
        ]
        if any(angles):
            turns = [[self._make_number_fade(end, angle)] for angle in angles]
            natural = self._sample_end(end, shifts, ((), ()), _bend_targets(targets, turns, ((), ())))
        first, second = (
            samples.estimate_jets(count, edge)
            for samples, count, edge in zip(natural, self.rails.jet_counts, edges, strict=True)
        )
        return first, second

    def lift_end(self, end: int, jets: tuple[EndJets, EndJets], paces: tuple[float, float] = (1.0, 1.0)) -> WantedEnd:
        """Return an end of ribbons with the tangent parts of wanted jets, by side."""
        step = (1 - 2 * end) * NETWORK_TOLERANCES.lifted_step * self.span
        (first, first_jets), (second, second_jets) = (
            lift_end(primary, find_foot(primary, one.values[0], uv[0]), one, step)
            for primary, one, uv in zip(self.rails.primaries, jets, self._probes[end].contacts.uv, strict=True)
        )
        fade = self._make_number_fade(end, 0.0).length
        first, second = replace(first, fade=fade), replace(second, fade=fade)
        return WantedEnd(SectionEnd((first_jets, second_jets), self.rails.targets.orders), (first, second), paces)

    def fit_to_ends(self, wanted: WantedEnds) -> tuple[Ribbon, Ribbon]:
        """Fit cubic ribbons with wanted jets at the ends of the cell, free ones where nothing is wanted."""
        rails = self.rails
        corners = rails.locate_corners(self.domain)
        if wanted == (None, None):
            ribbons = fit_cubic_ribbons(
                rails.primaries, rails.solve, self.domain, rails.targets, closed=False, corners=corners
            )
            return self._record_deviation(ribbons)
        shifts, moves = self._bend_contacts(wanted)
        targets = self._turn_targets(wanted, shifts, moves)
        contacts = replace(self._natural, shifts=shifts, moves=moves)
        first, second = (tuple(None if one is None else one.lifted[side] for one in wanted) for side in (0, 1))
        ends: tuple[GivenEnds, GivenEnds] = ((first[0], first[1]), (second[0], second[1]))
        ribbons = fit_cubic_ribbons(
            rails.primaries, contacts, self.domain, targets, closed=False, corners=corners, ends=ends
        )
        bends = self._measure_bend(0, shifts, moves[0]), self._measure_bend(1, shifts, moves[1])
        return self._record_deviation((replace(ribbons[0], bend=bends[0]), replace(ribbons[1], bend=bends[1])))

    def _record_deviation(self, ribbons: tuple[Ribbon, Ribbon]) -> tuple[Ribbon, Ribbon]:
        """Return ribbons of which that of a pole tells how far it is off the ball, if it is more than rails are."""
        pole = self.rails.pole
        if pole is None or pole.deviation <= self.rails.targets.position:
            return ribbons
        recorded = list(ribbons)
        recorded[pole.side] = replace(ribbons[pole.side], bend=max(pole.deviation, ribbons[pole.side].bend))
        return recorded[0], recorded[1]

    def _measure_bend(self, side: int, shifts: tuple[Fades, Fades], moves: Fades) -> float:
        """Return the largest distance (mm) by which moves bring a rail off its natural course; 0 within tolerance."""
        primary = self.rails.primaries[side]

        def measure_steps(uv: Array, steps: Array) -> Array:
            jet = primary.jet(uv)
            return measure_lengths(steps[:, :1] * jet[1] + steps[:, 1:] * jet[2])

        starts = [self._probes[0 if fade.inward > 0 else 1].contacts.uv[side][:1] for fade in moves]
        reach = [
            measure_steps(uv, np.stack([fade.value, fade.rate * fade.length])).max()
            for uv, fade in zip(starts, moves, strict=True)
        ]
        if max(reach, default=0.0) <= self.rails.targets.position:
            return 0.0
        shares = np.linspace(0, 1, NETWORK_TOLERANCES.bend_samples)
        t = np.unique(np.concatenate([fade.t + fade.inward * fade.length * shares for fade in moves]))
        uv = replace(self._natural, shifts=shifts)(t).uv[side]
        points, moved = primary.jet(uv)[0], primary.jet(uv + sum_fades(moves, t))[0]
        along = normalise_vectors(np.gradient(points, t, axis=0))
        return float(measure_lengths(cross_product(moved - points, along)).max())

    def _bend_contacts(self, wanted: WantedEnds) -> tuple[tuple[Fades, Fades], tuple[Fades, Fades]]:
        """Return shifts of stations and moves of native parameters, by side, that lead to wanted ends."""
        shifts: list[list[EndFade]] = [[], []]
        moves: list[list[EndFade]] = [[], []]
        for end, given in enumerate(wanted):
            if given is None:
                continue
            probe = self._probes[end]
            for side, fades in enumerate(self._shift_stations(end, given.paces)):
                uv, primary = probe.contacts.uv[side], self.rails.primaries[side]
                at = given.lifted[side].uv
                rate = to_tangent_coordinates(primary.jet(at[None]), given.section.jets[side].rates[:1])[0]
                natural = given.paces[side] * (probe.differentiate[0] @ uv)
                shifts[side] += fades
                bend = self._make_fade(end, at - uv[0], rate - natural, widths=NETWORK_TOLERANCES.bending_widths)
                moves[side].append(bend)
        for shifted in shifts:
            self._check_stations(tuple(shifted))
        return (tuple(shifts[0]), tuple(shifts[1])), (tuple(moves[0]), tuple(moves[1]))

    def _check_stations(self, shifts: Fades) -> None:
        """Raise SizeError if shifted stations do not all follow one another."""
        t = np.linspace(*self.domain, NETWORK_TOLERANCES.checked_stations)
        if not (np.diff(t + sum_fades(shifts, t)) > 0).all():
            raise SizeError(
                "a cell of the chain is too short for the size: its rails run at different speeds, or end at smooth "
                "edges at different places, which it has no room to even out",
                kind="short cell",
            )

    def _turn_targets(
        self, wanted: WantedEnds, shifts: tuple[Fades, Fades], moves: tuple[Fades, Fades]
    ) -> RibbonTargets:
        """Return targets whose cross derivatives, and the rates of these, are the wanted ones at the ends."""
        targets = self.rails.targets
        turns: list[list[EndFade]] = [[], []]
        stretches: list[list[EndFade]] = [[], []]
        for end, given in enumerate(wanted):
            if given is None:
                continue
            jets = given.section.jets
            values = [
                _compare_vectors(samples.vectors[0], one.values[1], samples.normals[0])
                for samples, one in zip(self._sample_end(end, shifts, moves, targets), jets, strict=True)
            ]
            steady = _bend_targets(
                targets,
                [[self._make_number_fade(end, angle)] for angle, _ in values],
                [[self._make_number_fade(end, stretch)] for _, stretch in values],
            )
            for side, samples in enumerate(self._sample_end(end, shifts, moves, steady)):
                vector, (angle, stretch) = samples.vectors[0], values[side]
                missing = jets[side].rates[1] - samples.differentiate @ samples.vectors
                square = vector @ vector
                turning = float(missing @ cross_product(samples.normals[0], vector) / square)
                growth = float(missing @ vector / square) * (1.0 + stretch)
                turns[side].append(self._make_number_fade(end, angle, turning))
                stretches[side].append(self._make_number_fade(end, stretch, growth))
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


def _measure_turn(samples: SideSamples, tangent: Array) -> float:
    """Return the angle (rad) from the cross derivative at an end to a smooth edge."""
    vector = samples.vectors[0]
    return _compare_vectors(vector, tangent * np.sign(tangent @ vector), samples.normals[0])[0]


def _is_steep(edge: Array, rate: Array) -> bool:
    """Whether a rail crosses a smooth edge, with derivatives (3, 3), so steeply that sections can follow it."""
    cosine = abs(float(edge[0] @ rate)) / float(np.linalg.norm(rate))
    return cosine <= np.sin(NETWORK_TOLERANCES.largest_obliquity)
