"""The ribbons of all cells of a chain, made so that consecutive cells share their end section exactly.

A smooth edge at which one face goes on tangentially into another is crossed by the rail on that side. Both faces have
the same second fundamental form II(s, .) along it, s its direction. So a cross derivative that runs along s there, and
its derivative along the rail, can be the same on both faces, and the end sections of both cells, which depend on these
jets alone, then agree with a common tangent plane all along (:mod:`cqblend.blends.network.shared_section`).

Of two cells at a junction one *dictates* its jets, the other takes them: a cell whose ribbons are straight or circular
before one whose ribbons are cubic, else the one of lower rank.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cqblend.blends.network.chain_cell import CellEnd, CellRails, ChainCell, WantedEnd
from cqblend.blends.network.junction_stations import Crossings, locate_junction
from cqblend.blends.network.round_cells import (
    bend_for_round_cell,
    can_join_round_cell,
    locate_pole,
    move_rail_end,
    pin_pole,
    take_round_section,
)
from cqblend.blends.network.shared_section import (
    SectionEnd,
    SectionMismatch,
    bound_rounding,
    measure_arc_mismatch,
    measure_mismatch,
)
from cqblend.blends.network.tolerances import NETWORK_TOLERANCES
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_end import EndJets
from cqblend.blends.rails.ribbon_fit import Domain
from cqblend.errors import GeometryError, SizeError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, normalise_vectors

RibbonPair = tuple[Ribbon, Ribbon]


@dataclass(frozen=True)
class ChainRibbons:
    """The ribbons of all cells of a chain, by cell and side, and what is left between the cells at its junctions.

    ``for_arcs`` tells that nothing but arcs of one ball is to be between them.
    """

    cells: tuple[RibbonPair, ...]
    junctions: tuple[SectionMismatch, ...]
    for_arcs: bool = False


def fit_chain_ribbons(
    cells: Sequence[CellRails],
    junctions: Sequence[Crossings],
    open_domain: Domain | None,
    *,
    arcs: bool = False,
    settled: tuple[bool, bool] = (False, False),
) -> ChainRibbons:
    """Fit the ribbons of a chain.

    Parameters
    ----------
    cells
        In order; of each, the sides are those of all others.
    junctions
        What the rails cross between consecutive cells; of a closed chain also between the last cell and the first.
    open_domain
        Of an open chain, where its first cell starts and its last cell ends, in the parameter t of each. None if it is
        closed.
    arcs
        Whether the ribbons are to be such that the arcs of one ball join them, if that can be.
    settled
        Whether an open chain is to start, and to stop, in a section that is exactly that of the contacts there, and
        arrives in one direction all across.

    Raises
    ------
    SizeError
        If a cell ends before it starts, since its rails cross smooth edges at both of its ends too early, or if a rail
        turns back at a smooth edge.
    GeometryError
        If a smooth edge is so oblique that sections cannot follow it, and curvature is to go on: G1 sections still have
        one position there, and meet at an angle.
    """
    chain = _divide_chain(cells, junctions, open_domain)
    links = [(k, (k + 1) % len(cells)) for k in range(len(junctions))]
    for_arcs = _fit_for_arcs(chain, links) if arcs else None
    if for_arcs is not None:
        return for_arcs
    light = _choose_light_cells(chain, links)
    rounds = _settle_round_cells(chain, links, light)
    wanted: list[list[WantedEnd | None]] = [[None, None] for _ in chain]
    for k, end in ((0, 0), (-1, 1)):
        if settled[end] and light[k] is None:
            wanted[k][end] = dictate_section(chain[k], end)
    mismatches: list[SectionMismatch] = []
    roughness = [0.0] * len(chain)
    for before, after in links:
        first, second = light[before], light[after]
        start, stop = (None if first is None else first.sections[1]), (None if second is None else second.sections[0])
        if start is None and (stop is not None or _dictates(chain, before, after)):
            start = _settle_section(chain, wanted, (before, 1), stop, rounds.get((before, 1)))
        if stop is None:
            stop = _settle_section(chain, wanted, (after, 0), start, rounds.get((after, 0)))
        if start is None:
            start = _settle_section(chain, wanted, (before, 1), stop, rounds.get((before, 1)))
        mismatches.append(_compare_sections(start, stop, chain[before].ends[1].gap))
        given = chain[before].ends[1].roughness + chain[before].ends[1].gap / start.width
        for k in (before, after):
            roughness[k] = max(roughness[k], given)
    ribbons = [
        cell.fit_to_ends((start, stop)) if one is None else one.ribbons
        for cell, one, (start, stop) in zip(chain, light, wanted, strict=True)
    ]
    if links:
        ribbons = [
            (replace(first, joined=True, roughness=rough), replace(second, joined=True, roughness=rough))
            for (first, second), rough in zip(ribbons, roughness, strict=True)
        ]
    return ChainRibbons(tuple(ribbons), tuple(mismatches))


def _fit_for_arcs(chain: Sequence[ChainCell], links: Sequence[tuple[int, int]]) -> ChainRibbons | None:
    """Return ribbons between which the arcs of a ball go on from cell to cell; None if they do not.

    They do where the contacts of both cells, and the directions of their arcs, are the same: a ball is tangent to
    itself, so that nothing else has to agree.
    """
    pairs = []
    for cell in chain:
        pair = cell.fit_for_arcs()
        if pair is None:
            return None
        pairs.append(pair)
    mismatches = []
    for before, after in links:
        first, second = SectionEnd.from_ribbons(pairs[before], 1), SectionEnd.from_ribbons(pairs[after], 0)
        mismatch = measure_arc_mismatch(first, second)
        if max(mismatch.gap / first.width, mismatch.angle) > NETWORK_TOLERANCES.same_arc:
            return None
        mismatches.append(mismatch)
    joined = [(replace(first, joined=True), replace(second, joined=True)) for first, second in pairs]
    return ChainRibbons(tuple(joined), tuple(mismatches), for_arcs=True)


@dataclass(frozen=True)
class _RoundNeighbour:
    """A cell around a round face beyond an end of another one: the side, 0 or 1, and the place of its pole, if any."""

    pole_side: int | None
    pole: Array


def _settle_round_cells(
    chain: list[ChainCell], links: Sequence[tuple[int, int]], light: list[_LightCell | None]
) -> dict[tuple[int, int], _RoundNeighbour]:
    """Settle which cells around round faces are cubic, and where their poles are; return them as neighbours of others.

    Poles are where light neighbours end. Of these, those that cannot end there, or share a section with such a cell,
    become cubic. Keys are a cell and one of its ends.
    """
    found: dict[tuple[int, int], _RoundNeighbour] = {}
    for k, cell in enumerate(chain):
        if not cell.rails.goes_around:
            continue
        pole, own = cell.rails.pole, light[k]
        beside = [(before, 1) for before, after in links if after == k]
        beside += [(after, 0) for before, after in links if before == k]
        if own is not None and all(
            light[j] is not None or _share_direction(chain[j], end, own.sections[1 - end]) for j, end in beside
        ):
            continue
        light[k] = None
        for j, end in beside:
            one = light[j]
            if one is not None and not can_join_round_cell(one.sections[end], chain[j].ends[end].roughness):
                light[j] = None
        if pole is None:
            found |= dict.fromkeys(beside, _RoundNeighbour(None, np.zeros(3)))
            continue
        point: Array | None = None
        for j, end in sorted(beside, key=lambda place: chain[place[0]].rails.rank):
            one = light[j]
            if one is None:
                continue
            section = one.sections[end]
            there = section.jets[pole.side].values[0]
            if point is None:
                point = there
            elif np.linalg.norm(there - point) > max(NETWORK_TOLERANCES.natural_gap, bound_rounding(section)[0]):
                light[j] = None
        point = locate_pole(cell) if point is None else point
        chain[k] = pin_pole(cell, point)
        found |= dict.fromkeys(beside, _RoundNeighbour(pole.side, point))
    return found


def _dictates(chain: Sequence[ChainCell], before: int, after: int) -> bool:
    """Whether the cell before a junction dictates its section to the one after it, of two cubic ones."""
    first, second = chain[before].rails, chain[after].rails
    if first.goes_around != second.goes_around:
        return second.goes_around
    return first.rank <= second.rank


def _settle_section(
    chain: Sequence[ChainCell],
    wanted: Sequence[list[WantedEnd | None]],
    place: tuple[int, int],
    given: SectionEnd | None,
    beyond: _RoundNeighbour | None,
) -> SectionEnd:
    """Settle, and return, the section of a cubic cell at a place, cell and end: its own, or one that is given to it.

    ``beyond`` is the cell beyond the end, if that goes around a round face.
    """
    cell, end = place
    own = dictate_section(chain[cell], end, beyond) if given is None else take_section(chain[cell], end, given)
    wanted[cell][end] = own
    return own.section


def _compare_sections(start: SectionEnd, stop: SectionEnd, file_gap: float) -> SectionMismatch:
    """Compare the sections of two cells at their junction, between faces that are a given distance (mm) apart."""
    mismatch = measure_mismatch(start, stop)
    if mismatch.gap > NETWORK_TOLERANCES.torn_section + 2 * file_gap:
        raise GeometryError(
            f"where the chain passes a smooth edge, its cells are {mismatch.gap:.2g} mm apart: the edge is too oblique "
            "to the rail for curvature to go on there; take G1",
            kind="oblique",
            value=mismatch.gap,
        )
    return mismatch


def _divide_chain(
    cells: Sequence[CellRails], junctions: Sequence[Crossings], open_domain: Domain | None
) -> list[ChainCell]:
    """Find the ends of all cells."""
    start, stop = (0.0, 1.0) if open_domain is None else open_domain
    ends = [[CellEnd((start, start)), CellEnd((stop, stop))] for _ in cells]
    for k, crossed in enumerate(junctions):
        after = (k + 1) % len(cells)
        ends[k][1], ends[after][0] = locate_junction(cells[k], cells[after], crossed)
    for number, (first, last) in enumerate(ends, start=1):
        for a, b in zip(first.stations, last.stations, strict=True):
            if not a < b:
                raise SizeError(
                    f"the rails cross the smooth edge at the end of cell {number} of the chain before that at its "
                    "start: the size is too large there",
                    kind="short cell",
                    value=b - a,
                )
    return [ChainCell(rails, (first, last)) for rails, (first, last) in zip(cells, ends, strict=True)]


@dataclass(frozen=True)
class _LightCell:
    """The ribbons of a straight or circular cell, and the sections at its start and at its stop."""

    ribbons: RibbonPair
    sections: tuple[SectionEnd, SectionEnd]


def _choose_light_cells(chain: Sequence[ChainCell], links: Sequence[tuple[int, int]]) -> list[_LightCell | None]:
    """Return the cells that can stay straight or circular; None for others.

    At a junction they can if both have the same section by nature, or if the neighbour takes it: the cross derivatives
    must then run along the smooth edges.
    """
    pairs = [cell.fit_light() for cell in chain]
    light = [
        None if pair is None else _LightCell(pair, (SectionEnd.from_ribbons(pair, 0), SectionEnd.from_ribbons(pair, 1)))
        for pair in pairs
    ]
    changed = True
    while changed:
        changed = False
        for before, after in links:
            first, second = light[before], light[after]
            heavy = [
                k
                for k, one, end in ((before, first, 1), (after, second, 0))
                if one is not None and chain[k].must_turn(end, one.sections[end])
            ]
            if not heavy and first is not None and second is not None:
                mismatch = measure_mismatch(first.sections[1], second.sections[0])
                if not mismatch.is_natural(chain[before].ends[1].roughness):
                    heavy = [max(after, before, key=lambda k: chain[k].rails.rank)]
            for k in heavy:
                light[k], changed = None, True
    return light


def dictate_section(cell: ChainCell, end: int, beyond: _RoundNeighbour | None = None) -> WantedEnd:
    """Return the natural section of a cubic cell at one end, beyond which there may be a cell around a round face.

    If the derivatives of its jets along the cell nearly have one direction, normal to both surfaces' normals, they get
    it exactly: then a neighbour may have others of its own in that direction.
    """
    jets = cell.estimate_natural_end(end)
    if beyond is not None and beyond.pole_side is not None:
        jets = move_rail_end(jets, beyond.pole_side, beyond.pole)
    first, second = (cross_product(one.rates[0], one.values[1]) for one in jets)
    across = cross_product(first, second)
    sine = np.linalg.norm(across) / (np.linalg.norm(first) * np.linalg.norm(second))
    if sine > NETWORK_TOLERANCES.parallel_normals:
        direction = across / np.linalg.norm(across)
        orders = cell.rails.targets.orders
        if all(_is_nearly_parallel(one, order, direction) for one, order in zip(jets, orders, strict=True)):
            wanted = cell.lift_end(end, _project_rates(jets, direction))
            if wanted.section.find_common_direction(cell.ends[end].roughness) is not None:
                return wanted
    return cell.lift_end(end, jets) if beyond is None else bend_for_round_cell(cell, end, jets)


def _is_nearly_parallel(jets: EndJets, order: int, direction: Array) -> bool:
    rates = jets.rates[: order + 1]
    off = rates - np.multiply.outer(rates @ direction, direction)
    return bool(np.abs(off).max() <= NETWORK_TOLERANCES.nearly_parallel_rates * np.abs(rates).max())


def _project_rates(jets: tuple[EndJets, EndJets], direction: Array) -> tuple[EndJets, EndJets]:
    """Return jets whose rates are parallel to a direction."""
    first, second = (EndJets(one.values, np.multiply.outer(one.rates @ direction, direction)) for one in jets)
    return first, second


def take_section(cell: ChainCell, end: int, given: SectionEnd) -> WantedEnd:
    """Return what a cubic cell is to have at one end so that it shares a given section."""
    natural = cell.estimate_natural_end(end)
    products = [float(one.rates[0] @ own.rates[0]) for one, own in zip(given.jets, natural, strict=True)]
    for product in products:
        if product <= -NETWORK_TOLERANCES.pole_rate * max(products):  # it is 0 at a pole
            raise SizeError(
                "where the chain passes a smooth edge, a rail turns back: the size is larger than the radius of "
                "curvature there",
                kind="too large",
            )
    shared = _share_direction(cell, end, given)
    if shared is not None:
        return shared
    if cell.rails.goes_around:
        return take_round_section(cell, end, given, natural)
    speeds = [
        float(np.linalg.norm(own.rates[0]) / np.linalg.norm(one.rates[0]))
        for one, own in zip(given.jets, natural, strict=True)
    ]
    pace = float(np.sqrt(speeds[0] * speeds[1]))
    first, second = (EndJets(one.values, pace * one.rates) for one in given.jets)
    return _kink_rails(cell, end, SectionEnd((first, second), given.orders), (pace / speeds[0], pace / speeds[1]))


def _kink_rails(cell: ChainCell, end: int, given: SectionEnd, paces: tuple[float, float]) -> WantedEnd:
    """Return what a cubic cell is to have at one end so that it shares a section, with rails that may have kinks there.

    Where a rail crosses a smooth edge so obliquely that sections cannot follow it, the ball's path has a kink, since
    the curvature of its face jumps, and with that kink the tangent planes of both cells agree. The rates of cross
    derivatives are normal to the face by as much as its curvature tells; the kink is the one with which that is right.
    """
    wanted = cell.lift_end(end, given.jets, paces)
    crossed = [side for side, edge in enumerate(cell.ends[end].edge_jets) if edge is not None]
    if given.orders != (1, 1) or not crossed:
        return wanted
    trial = given.shear((1.0, 1.0))
    kinked, amounts = cell.lift_end(end, trial, paces), [0.0, 0.0]
    for side in crossed:
        off = _measure_normal_rate(wanted.section.jets[side], given.jets[side])
        if abs(off) > NETWORK_TOLERANCES.parallel_rates * np.abs(given.jets[side].rates).max():
            amounts[side] = off / (off - _measure_normal_rate(kinked.section.jets[side], trial[side]))
    return cell.lift_end(end, given.shear((amounts[0], amounts[1])), paces) if any(amounts) else wanted


def _measure_normal_rate(own: EndJets, wanted: EndJets) -> float:
    """Return by how much the rate of a cross derivative differs from a wanted one, along the normal."""
    (normal,) = normalise_vectors(cross_product(own.rates[:1], own.values[1:2]))
    return float((own.rates[1] - wanted.rates[1]) @ normal)


def _share_direction(cell: ChainCell, end: int, given: SectionEnd) -> WantedEnd | None:
    """Return what a cubic cell is to have at one end if its rates there can have the direction that those given have.

    None if they cannot, or if these have none in common.
    """
    roughness = cell.ends[end].roughness
    direction = given.find_common_direction(roughness)
    if direction is None:
        return None
    first, second = (
        EndJets(one.values, own.rates)
        for one, own in zip(given.jets, _project_rates(cell.estimate_natural_end(end), direction), strict=True)
    )
    wanted = cell.lift_end(end, (first, second))
    return wanted if wanted.section.find_common_direction(roughness) is not None else None
