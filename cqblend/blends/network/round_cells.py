r"""Cells of a chain that go around a round face, where one rail is much shorter than the other, or a pole.

Where such a cell meets its neighbour, their rails run at different ratios of speed. The derivatives H_t(v) of the
neighbour's section along its cell and H_s(v) of the cell's own span the same tangent planes with the section if H_s =
(k_1 (1 - v) + k_2 v) H_t. Both are cubic in v, so that H_t has to be quadratic: of the rates C', T' of the neighbour's
ribbons at both rails, C'_1 and C'_2, T'_1 and T'_2 into the blend,

.. math:: T'_1 - T'_2 = 2 (C'_2 - C'_1) .

It has that by changing T'_1 and T'_2 within the tangent planes, where they are free. The cell itself has the rates
k_1 C'_1 and k_2 C'_2, k_1 T'_1 + (k_2 - k_1) C'_1 and k_2 T'_2 + (k_1 - k_2) C'_2; the factor at a pole is 0. Where all
rates have one direction, as between planes and around an axis, none of that is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.network.chain_cell import ChainCell, WantedEnd
from cqblend.blends.network.shared_section import SectionEnd
from cqblend.blends.network.tolerances import NETWORK_TOLERANCES
from cqblend.blends.rails.ribbon_end import EndJets, find_foot
from cqblend.errors import UnsupportedError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, normalise_vectors


def pin_pole(cell: ChainCell, point: Array) -> ChainCell:
    """Return a cell whose pole is the foot of a point (3,) on its face."""
    if cell.rails.pole is None:
        raise TypeError("the cell has no pole")
    side, solve = cell.rails.pole.side, cell.rails.solve
    foot = find_foot(cell.rails.primaries[side], point, solve(np.array([cell.domain[0]])).uv[side][0])

    def solve_pinned(t: Array) -> Contacts:
        contacts = solve(t)
        pinned = np.tile(foot, (len(t), 1))
        uv = (pinned, contacts.uv[1]) if side == 0 else (contacts.uv[0], pinned)
        return replace(contacts, uv=uv)

    return replace(cell, rails=replace(cell.rails, solve=solve_pinned))


def locate_pole(cell: ChainCell) -> Array:
    """Return the point (3,) that is the pole of a cell."""
    if cell.rails.pole is None:
        raise TypeError("the cell has no pole")
    side = cell.rails.pole.side
    uv = cell.rails.solve(np.array([cell.domain[0]])).uv[side]
    return np.asarray(cell.rails.primaries[side].jet(uv)[0, 0])


def move_rail_end(jets: Sequence[EndJets], side: int, point: Array) -> tuple[EndJets, EndJets]:
    """Return jets at the end of a cell, of which one rail ends in a point (3,)."""
    moved = list(jets)
    moved[side] = replace(jets[side], values=np.concatenate([point[None], jets[side].values[1:]]))
    return moved[0], moved[1]


def can_join_round_cell(section: SectionEnd, roughness: float) -> bool:
    """Whether a section can be that at the end of a cell around a round face."""
    if section.find_common_direction(roughness) is not None:
        return True
    if max(section.orders) > 1:
        return False
    missing, rates = _find_missing_rates(section), np.concatenate([jets.rates for jets in section.jets])
    return bool(np.abs(missing).max() <= NETWORK_TOLERANCES.parallel_rates * np.abs(rates).max())


def bend_for_round_cell(cell: ChainCell, end: int, jets: tuple[EndJets, EndJets]) -> WantedEnd:
    """Return the end of a cell with wanted jets, but that its derivative along the cell is quadratic across.

    Raises
    ------
    UnsupportedError
        If curvature is to go on.
    """
    wanted = cell.lift_end(end, jets)
    if max(wanted.section.orders) > 1:
        raise UnsupportedError(
            "the ball turns about a point, or nearly so, between faces along which curvature does not go on: take G1"
        )
    for _ in range(NETWORK_TOLERANCES.pole_rounds):
        changes = np.zeros((2, 3))
        planes = [_span_tangent_plane(cross_product(one.rates[0], one.values[1])) for one in wanted.section.jets]
        system = np.concatenate([planes[0], -planes[1]]).T
        shares = np.linalg.lstsq(system, _find_missing_rates(wanted.section))[0]
        changes[0], changes[1] = shares[:2] @ planes[0], shares[2:] @ planes[1]
        first, second = (
            replace(one, rates=np.stack([one.rates[0], one.rates[1] + change]))
            for one, change in zip(wanted.section.jets, changes, strict=True)
        )
        wanted = cell.lift_end(end, (first, second))
    return wanted


def _find_missing_rates(section: SectionEnd) -> Array:
    """Return by how much T'_1 - T'_2 must grow (3,) for the derivative of a section along its cell to be quadratic."""
    first, second = (jets.rates for jets in section.jets)
    return np.asarray(2 * (second[0] - first[0]) - (first[1] - second[1]))


def _span_tangent_plane(normal: Array) -> Array:
    """Return two unit vectors (2, 3) of the plane with a normal (3,)."""
    aside = np.eye(3)[np.abs(normal).argmin()]
    x = normalise_vectors(cross_product(normal, aside))
    return np.stack([x, normalise_vectors(cross_product(normal, x))])


def take_round_section(cell: ChainCell, end: int, given: SectionEnd, natural: Sequence[EndJets]) -> WantedEnd:
    """Return what a cell around a round face is to have at one end so that it shares a given section.

    ``natural`` are its own jets there, of which the speeds of the rails count.
    """
    pole = cell.rails.pole
    paces = [
        0.0
        if pole is not None and pole.side == side
        else float(np.linalg.norm(own.rates[0]) / np.linalg.norm(one.rates[0]))
        for side, (own, one) in enumerate(zip(natural, given.jets, strict=True))
    ]
    first, second = (
        EndJets(one.values, np.stack([pace * one.rates[0], pace * one.rates[1] + (other - pace) * one.rates[0]]))
        for one, pace, other in zip(given.jets, paces, reversed(paces), strict=True)
    )
    return cell.lift_end(end, (first, second))
