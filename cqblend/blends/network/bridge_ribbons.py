"""The ribbons of a bridge between two closed rails: of one closed cell, or of cells that share their end sections.

A bridge leaves its rails away from the faces that stay. Where a rail passes from one of them to another, or has a
corner, it leaves in a direction that both sides have in common: along the edge between the faces, or through the middle
of the corner. Two cells that meet at a smooth place share more: their tangent planes
(:mod:`cqblend.blends.network.chain_ribbons`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.network.bridge_loops import LoopJoin, RailRun
from cqblend.blends.network.bridge_pairing import RailPairing
from cqblend.blends.network.chain_cell import CellEnd, CellRails, ChainCell, WantedEnd
from cqblend.blends.network.chain_ribbons import RibbonPair, dictate_section, take_section
from cqblend.blends.network.shared_section import SectionEnd, measure_mismatch
from cqblend.blends.network.tolerances import BRIDGE_TOLERANCES
from cqblend.blends.rails.cross_directions import RailStations, chord_field, parametric_field
from cqblend.blends.rails.cubic_ribbons import fit_cubic_ribbons
from cqblend.blends.rails.line_and_arc_ribbons import ArcLayout, fit_circular_ribbons, fit_straight_ribbons
from cqblend.blends.rails.ribbon_end import EndJets
from cqblend.blends.rails.ribbon_fit import RibbonTargets
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import cross_product, measure_lengths, normalise_vectors


@dataclass(frozen=True)
class BridgeDirections:
    """How a bridge is to leave its rails, by side: cross fields by name, factors on lengths, orders of continuity.

    ``steer`` (rad) is the largest angle by which directions are turned at knot lines.
    """

    tangents: tuple[str, str]
    bulges: tuple[float, float]
    orders: tuple[int, int]
    steer: float


@dataclass(frozen=True)
class BridgeCell:
    """One cell of a bridge: its ribbons over the range ``domain`` of t, and the parts of the loops that it is on.

    ``smooth_ends`` tell whether the bridge goes on smoothly at its start and at its stop.
    """

    ribbons: RibbonPair
    runs: tuple[RailRun, RailRun]
    domain: tuple[float, float]
    closed: bool
    smooth_ends: tuple[bool, bool]


@dataclass(frozen=True)
class _OutwardField:
    """A cross field on the side of a rail that is opposite to the face that stays.

    ``sign`` is +1 where that is to the left of the rail about Su x Sv.
    """

    name: str
    sign: float

    def __call__(self, stations: RailStations) -> Array:
        outward = self.sign * cross_product(stations.normals, stations.velocity)
        if self.name == "perpendicular":
            return outward
        if self.name == "parametric":
            field = parametric_field(stations)
            return field * (np.sign((field * outward).sum()) or 1.0)
        field = chord_field(stations)
        if not ((field * outward).sum(axis=1) > 0).all():
            raise GeometryError("the chord to the other rail points back over the face that stays: take other tangents")
        return field


@dataclass(frozen=True)
class _CellContacts:
    """The points of both rails in one cell, as contacts: a solver of t."""

    pairing: RailPairing
    runs: tuple[RailRun, RailRun]
    orders: tuple[int, int]

    @property
    def primaries(self) -> tuple[Primary, Primary]:
        """The surfaces of both sides."""
        return self.runs[0].support.primary, self.runs[1].support.primary

    def __call__(self, t: Array) -> Contacts:
        """Return the contacts at t (n,)."""
        positions = [self.pairing.find_positions(side, t) for side in (0, 1)]
        (first, first_tangents), (second, second_tangents) = (
            run.locate(s) for run, s in zip(self.runs, positions, strict=True)
        )
        jets = [primary.jet(uv) for primary, uv in zip(self.primaries, (first, second), strict=True)]
        points = np.stack([jet[0] for jet in jets])
        chord = points[1] - points[0]
        lengths = []
        for side, (jet, tangents) in enumerate(zip(jets, (first_tangents, second_tangents), strict=True)):
            loop, run = self.pairing.loops[side], self.runs[side]
            normals = normalise_vectors(cross_product(jet[1], jet[2]))
            outward = loop.outward * run.support.outward * cross_product(normals, tangents)
            tightness = np.maximum(loop.tightness(np.mod(positions[side], loop.length))[:, 0], 0.0)
            limits = tightness / BRIDGE_TOLERANCES.inset[self.orders[side]]
            lengths.append(choose_cross_lengths(outward, chord * (1 - 2 * side), limits))
        return Contacts(t, points.mean(axis=0), (first, second), np.stack(lengths))


def choose_cross_lengths(outward: Array, chords: Array, limits: Array) -> Array:
    """Return the lengths (n,) of the cross derivatives, before any bulge.

    They are about those of circular arcs that leave in the unit directions ``outward`` (n, 3) to the ends of ``chords``
    (n, 3), 2 |d| / (1 + cos); but shorter where an opening has little room for them, less than 1 over ``limits`` (n,)
    however far the other rail is.
    """
    distance = measure_lengths(chords)
    cosine = (outward * chords).sum(axis=1) / distance
    lengths = 2 * distance / np.hypot(1 + cosine, BRIDGE_TOLERANCES.turn_softening)
    return np.asarray(lengths / (1 + lengths * limits))


def fit_bridge_ribbons(pairing: RailPairing, wanted: BridgeDirections) -> list[BridgeCell]:
    """Fit the ribbons of all cells of a bridge.

    Raises
    ------
    GeometryError
        If curvature cannot go on at a corner, a direction leads back over the face that stays, or a fit fails.
    """
    breaks = pairing.breaks
    if not len(breaks):
        return [_fit_closed_cell(pairing, wanted)]
    joins = [
        [loop.find_join(pairing.find_positions(side, np.array([t]))[0]) for side, loop in enumerate(pairing.loops)]
        for t in breaks.tolist()
    ]
    for pair in joins:
        _check_orders(pair, wanted.orders)
    domains = list(zip(breaks.tolist(), [*breaks[1:].tolist(), float(breaks[0]) + 1.0], strict=True))
    cells = [_CellRun.make(pairing, domain, wanted) for domain in domains]
    chain = [
        ChainCell(cell.rails, (_make_end(domain[0], pair), _make_end(domain[1], following)))
        for cell, domain, pair, following in zip(cells, domains, joins, [*joins[1:], joins[0]], strict=True)
    ]
    smooth = [all(join is None or join.kind != "sharp" for join in pair) for pair in joins]
    ribbons = _fit_straight_cells(cells, smooth) or _fit_cubic_cells(chain, joins, smooth)
    following = [*smooth[1:], smooth[0]]
    return [
        BridgeCell(pair, cell.contacts.runs, cell.domain, False, (start, stop))
        for pair, cell, start, stop in zip(ribbons, cells, smooth, following, strict=True)
    ]


def _check_orders(joins: Sequence[LoopJoin | None], orders: tuple[int, int]) -> None:
    """Raise GeometryError where faces meet that have no edge along which curvature could go on."""
    for side, (join, order) in enumerate(zip(joins, orders, strict=True)):
        if join is not None and join.kind == "sharp" and not join.on_edge and order > 1:
            raise GeometryError(
                f"the two faces of side {side + 1} at {join.name} have no edge there along which the bridge could go "
                "on: it can be G1 there, and no more",
                shape=join.name,
            )


def _make_end(t: float, joins: Sequence[LoopJoin | None]) -> CellEnd:
    """Return the end of a cell at t, where the loops have these joins."""
    first, second = (None if join is None or join.kind == "through" else join.edge_jets for join in joins)
    roughness = max(join.roughness if join is not None else 0.0 for join in joins)
    return CellEnd((t, t), (first, second), roughness)


@dataclass(frozen=True)
class _CellRun:
    """One cell: its contacts, and what the ribbons of a chain take of it."""

    contacts: _CellContacts
    domain: tuple[float, float]
    wanted: BridgeDirections

    @classmethod
    def make(cls, pairing: RailPairing, domain: tuple[float, float], wanted: BridgeDirections) -> _CellRun:
        """Cut a cell out of both loops."""
        closed = domain[1] - domain[0] == 1.0 and not len(pairing.breaks)
        first, second = (
            RailRun.from_loop(loop, tuple(pairing.find_positions(side, np.array(domain)).tolist()), closed)
            for side, loop in enumerate(pairing.loops)
        )
        return cls(_CellContacts(pairing, (first, second), wanted.orders), domain, wanted)

    @cached_property
    def size(self) -> float:
        """The largest distance (mm) of the rails."""
        contacts = self.contacts(np.linspace(*self.domain, 17))
        points = [p.jet(uv)[0] for p, uv in zip(self.contacts.primaries, contacts.uv, strict=True)]
        return float(measure_lengths(points[1] - points[0]).max())

    @property
    def length(self) -> float:
        """The mean length (mm) of both loops, which t is a share of."""
        return sum(loop.length for loop in self.contacts.pairing.loops) / 2

    @property
    def targets(self) -> RibbonTargets:
        """What the ribbons are to be."""
        wanted, (first, second) = (
            self.wanted,
            (
                _OutwardField(name, loop.outward * run.support.outward)
                for name, loop, run in zip(
                    self.wanted.tangents, self.contacts.pairing.loops, self.contacts.runs, strict=True
                )
            ),
        )
        bulges = [partial(np.full_like, fill_value=bulge) for bulge in wanted.bulges]
        return RibbonTargets(
            position=max(BRIDGE_TOLERANCES.rail_share * self.size, BRIDGE_TOLERANCES.least_rail),
            fields=(first, second),
            bulges=(bulges[0], bulges[1]),
            orders=wanted.orders,
            steer=wanted.steer,
        )

    @property
    def rails(self) -> CellRails:
        """What the ribbons of a chain take of this cell."""
        return CellRails(
            self.contacts.primaries, self.contacts, self.targets, self.length, locate_corners=self.locate_bends
        )

    def locate_bends(self, domain: tuple[float, float]) -> Array:
        """Return the t in a range at which the curvature of a rail jumps."""
        found = [np.empty(0)]
        pairing = self.contacts.pairing
        for side, loop in enumerate(pairing.loops):
            bends = loop.starts[:-1][[join.bends for join in loop.joins]]
            positions = pairing.positions[side]
            t = np.interp(positions[0] + np.mod(bends - positions[0], loop.length), positions, pairing.anchors)
            for lap in (0, 1):
                found.append((t + lap)[(t + lap > domain[0]) & (t + lap < domain[1])])
        return np.unique(np.concatenate(found))


def _fit_closed_cell(pairing: RailPairing, wanted: BridgeDirections) -> BridgeCell:
    """Fit the ribbons of a bridge without breaks: around an axis where they are so, else cubics."""
    cell = _CellRun.make(pairing, (0.0, 1.0), wanted)
    primaries, targets = cell.contacts.primaries, cell.targets
    ribbons = fit_circular_ribbons(
        primaries, cell.contacts, ArcLayout(cell.domain, 2 * np.pi), targets, cell.length
    ) or fit_cubic_ribbons(
        primaries, cell.contacts, cell.domain, targets, closed=True, corners=cell.locate_bends(cell.domain)
    )
    return BridgeCell(ribbons, cell.contacts.runs, cell.domain, True, (True, True))


def _fit_straight_cells(cells: Sequence[_CellRun], smooth: Sequence[bool]) -> list[RibbonPair] | None:
    """Return straight ribbons if those of all cells are so, and neighbours share their sections."""
    found = []
    for cell in cells:
        pair = fit_straight_ribbons(cell.contacts.primaries, cell.contacts, cell.domain, cell.targets, cell.length)
        if pair is None:
            return None
        found.append(pair)
    for k, is_smooth in enumerate(smooth):
        mismatch = measure_mismatch(SectionEnd.from_ribbons(found[k - 1], 1), SectionEnd.from_ribbons(found[k], 0))
        if mismatch.gap > mismatch.rounding[0] or (is_smooth and not mismatch.is_natural(0.0)):
            return None
    return found


def _fit_cubic_cells(
    chain: Sequence[ChainCell], joins: Sequence[Sequence[LoopJoin | None]], smooth: Sequence[bool]
) -> list[RibbonPair]:
    """Fit cubic ribbons that share the sections at which cell k starts, with ``joins[k]`` on both sides."""
    wanted: list[list[WantedEnd | None]] = [[None, None] for _ in chain]
    for k, (pair, is_smooth) in enumerate(zip(joins, smooth, strict=True)):
        before, after = chain[k - 1], chain[k]
        if is_smooth:
            start = dictate_section(before, 1)
            wanted[k - 1][1], wanted[k][0] = start, take_section(after, 0, start.section)
        else:
            wanted[k - 1][1], wanted[k][0] = _share_corner(before, after, pair)
    return [cell.fit_to_ends((start, stop)) for cell, (start, stop) in zip(chain, wanted, strict=True)]


def _share_corner(before: ChainCell, after: ChainCell, joins: Sequence[LoopJoin | None]) -> tuple[WantedEnd, WantedEnd]:
    """Return the end of one cell and the start of the next, with one section, where they meet at an angle.

    Their jets across agree, the derivatives of these along the rails do not.
    """
    own, others = before.estimate_natural_end(1), after.estimate_natural_end(0)
    values = []
    for side, join in enumerate(joins):
        shared = own[side].values
        if join is not None and join.kind != "through" and join.edge_jets is not None:
            length = float(np.linalg.norm([own[side].values[1], others[side].values[1]], axis=1).mean())
            powers = length ** np.arange(1, 4)
            shared = np.concatenate([shared[:1], powers[:, None] * join.edge_jets])[: len(shared)]
        values.append(shared)
    ends = []
    for cell, end, natural in ((before, 1, own), (after, 0, others)):
        first, second = (EndJets(one, jets.rates) for one, jets in zip(values, natural, strict=True))
        ends.append(cell.lift_end(end, (first, second)))
    return ends[0], ends[1]
