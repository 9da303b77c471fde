"""The section that two consecutive cells of a chain share: whether they have it in common, and their tangent planes.

The end section of a cell and its derivative along the cell depend on the jets of both ribbons there, and on nothing
else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.network.tolerances import NETWORK_TOLERANCES
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_end import EndJets
from cqblend.blends.sections.hermite_section import tabulate_hermite
from cqblend.splines import bernstein
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, measure_lengths


@dataclass(frozen=True)
class SectionEnd:
    """The jets of both ribbons of a cell at one of its ends, and their orders of continuity."""

    jets: tuple[EndJets, EndJets]
    orders: tuple[int, int]

    @classmethod
    def from_ribbons(cls, ribbons: tuple[Ribbon, Ribbon], end: int) -> SectionEnd:
        """Evaluate the ribbons of a cell where it starts (``end`` 0) or stops (1)."""
        first, second = ribbons
        return cls((EndJets.from_ribbon(first, end), EndJets.from_ribbon(second, end)), (first.order, second.order))

    @property
    def width(self) -> float:
        """The distance (mm) of both rails."""
        return float(np.linalg.norm(self.jets[1].values[0] - self.jets[0].values[0]))

    def evaluate_section(self, v: Array) -> Array:
        """Return the points of the section at v (n,), its tangents, and its derivatives along the cell, (3, n, 3)."""
        counts = self.orders[0] + 1, self.orders[1] + 1
        degree = sum(counts) - 1
        table = tabulate_hermite(counts, counts, degree)
        values, rates = (
            table @ np.concatenate([rows[:count] for rows, count in zip(pair, counts, strict=True)])
            for pair in ([one.values for one in self.jets], [one.rates for one in self.jets])
        )
        basis = bernstein.evaluate_basis(degree, 1 - v, v).T
        slopes = bernstein.evaluate_basis(degree - 1, 1 - v, v).T
        return np.stack([basis @ values, slopes @ (degree * np.diff(values, axis=0)), basis @ rates])

    def shear(self, amounts: tuple[float, float]) -> tuple[EndJets, EndJets]:
        """Return jets whose rates are changed so that sections move within their own tangents, by side.

        The derivative H_t along the cell becomes H_t + m(v) H_v, m linear, so that tangent planes stay as they are.
        Rails get kinks, by these ``amounts`` of their cross derivatives. Both sides are of order 1.
        """
        rows = tabulate_hermite((2, 2), (2, 2), 3) @ np.concatenate([one.values[:2] for one in self.jets])
        bends = 6 * np.diff(rows, 2, axis=0)  # H_vv at both ends
        first, second = (
            EndJets(
                one.values,
                one.rates + np.stack([amount * one.values[1], amount * bend - sum(amounts) * one.values[1]]),
            )
            for one, amount, bend in zip(self.jets, amounts, bends, strict=True)
        )
        return first, second

    def find_common_direction(self, roughness: float = 0.0) -> Array | None:
        """Return the unit vector (3,) to which all rates are parallel; None if there is none.

        Then the derivative of the section along the cell has that direction everywhere, and so has that of any cell
        whose rates are parallel to it, however long they are. They may be off it by the ``roughness`` (rad) of the
        smooth edge that is crossed.
        """
        rates = np.concatenate([jets.rates[: order + 1] for jets, order in zip(self.jets, self.orders, strict=True)])
        longest = rates[measure_lengths(rates).argmax()]
        direction = longest / np.linalg.norm(longest)
        off = rates - np.multiply.outer(rates @ direction, direction)
        limit = (NETWORK_TOLERANCES.parallel_rates + 2 * roughness) * np.abs(rates).max()
        return direction if np.abs(off).max() <= limit else None


@dataclass(frozen=True)
class SectionMismatch:
    """What two cells have not in common at their junction.

    ``gap`` is the largest distance (mm) of their sections at equal parameters, ``angle`` the largest angle (rad)
    between their tangent planes along them; ``rounding`` is what is rounding in either, by their distance from the
    origin.
    """

    gap: float
    angle: float
    rounding: tuple[float, float]

    def is_natural(self, roughness: float) -> bool:
        """Whether the cells meet but for rounding, and for the ``roughness`` (rad) of the smooth edge between them."""
        return self.gap <= self.rounding[0] and self.angle <= self.rounding[1] + roughness


def measure_arc_mismatch(before: SectionEnd, after: SectionEnd) -> SectionMismatch:
    """Compare the arcs of a ball at the end of a cell with those at the start of the next: where and how they leave."""
    gap = angle = 0.0
    for first, second in zip(before.jets, after.jets, strict=True):
        gap = max(gap, float(np.linalg.norm(first.values[0] - second.values[0])))
        sine, cosine = (
            np.linalg.norm(cross_product(first.values[1], second.values[1])),
            first.values[1] @ second.values[1],
        )
        angle = max(angle, float(np.arctan2(sine, cosine)))
    return SectionMismatch(gap, angle, bound_rounding(before))


def bound_rounding(section: SectionEnd) -> tuple[float, float]:
    """Return what is rounding in a section, by its distance from the origin: a distance (mm) and an angle (rad)."""
    distance = NETWORK_TOLERANCES.section_rounding * max(float(np.abs(one.values[0]).max()) for one in section.jets)
    return (
        max(NETWORK_TOLERANCES.natural_gap, distance),
        max(NETWORK_TOLERANCES.natural_angle, distance / section.width),
    )


def measure_mismatch(before: SectionEnd, after: SectionEnd) -> SectionMismatch:
    """Compare the end of a cell with the start of the one after it."""
    v = np.linspace(0, 1, NETWORK_TOLERANCES.section_samples)
    first, second = before.evaluate_section(v), after.evaluate_section(v)
    normals = [cross_product(section[2], section[1]) for section in (first, second)]
    sine, cosine = measure_lengths(cross_product(*normals)), (normals[0] * normals[1]).sum(axis=1)
    lengths = [measure_lengths(one) for one in normals]
    # a cell has no normal where its rail is one point
    is_regular = np.all([one > NETWORK_TOLERANCES.least_normal_share * one.max() for one in lengths], axis=0)
    angles = np.arctan2(sine, cosine)[is_regular]
    gap = float(measure_lengths(first[0] - second[0]).max())
    return SectionMismatch(gap, float(angles.max()), bound_rounding(before))
