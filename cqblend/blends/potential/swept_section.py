"""The section of a potential blend: the Hermite section of its ribbons, corrected so that it is the swept surface.

The correction vanishes at both rails with its derivatives, so the joints stay those of the ribbons.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, TypeVar

import numpy as np

from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.blends.potential.section_table import SectionTable
from cqblend.blends.potential.tolerances import POTENTIAL_LIMITS, POTENTIAL_TOLERANCES
from cqblend.blends.rails.fit_exceptions import TooManySpansError
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_fit import RibbonTargets
from cqblend.blends.sections.blend_surface import BlendSurface, blend_ribbons
from cqblend.blends.sections.filled_section import FilledSection
from cqblend.blends.sections.hermite_section import Jets, build_section
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array

Result = TypeVar("Result")

NO_KINKS = np.empty(0), np.empty(0, dtype=int)


class SweptSurface(Protocol):
    """What :class:`SweptSection` needs of a swept surface."""

    @property
    def domain(self) -> tuple[float, float]:
        """The range of t."""
        ...

    def evaluate_points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,)."""
        ...


def make_ribbon_targets(tolerance: float, width: float) -> RibbonTargets:
    """Return tolerances of ribbons with which the interior can be within a tolerance (mm) of a swept surface.

    ``width`` is the distance of the rails (mm).
    """
    return RibbonTargets(
        position=POTENTIAL_TOLERANCES.rail_fit * tolerance, length=tolerance / width, given_derivatives=True
    )


@dataclass(frozen=True)
class SweptSection(FilledSection):
    """The interior of the section between two ribbons of a swept surface."""

    swept: SweptSurface

    has_joint_sections: ClassVar[bool] = True
    kinks_are_certain: ClassVar[bool] = True
    most_spans_along: ClassVar[int] = 256
    advice: ClassVar[tuple[str, str]] = ("a relation that is less sharp", "a larger skin")

    @classmethod
    def from_sweep(
        cls,
        swept: SweptSurface,
        closed: bool,
        tolerance: float,
        kinks: tuple[Array, Array] = NO_KINKS,
        *,
        joined: bool = False,
    ) -> SweptSection:
        """Return the interior of G1 sections, within a tolerance (mm)."""
        return cls((2, 2, 2), POTENTIAL_LIMITS.points_across, tolerance, closed, *kinks, joined=joined, swept=swept)

    def make_interior_function(self, sides: tuple[Jets, Jets], v: Array) -> Callable[[Array], Array]:
        """Return the difference of the swept surface from the Hermite section, as a function of t (n,): (n, m, 3)."""
        hermite, x = build_section(sides), 1 - v
        sections = SectionTable(
            lambda t: self.swept.evaluate_points(t, x),
            self.swept.domain,
            self.closed,
            POTENTIAL_TOLERANCES.table_fit * self.tolerance,
            self._list_rough_kinks(),
        )
        return lambda t: sections(t) - hermite.grid(t, v)

    def _list_rough_kinks(self) -> Array:
        """Return the kinks (k,) across which sections cannot be interpolated, ascending."""
        low, high = self.swept.domain
        margin = POTENTIAL_TOLERANCES.kink_parameter * (high - low)
        rough = np.unique(self.kinks[self.orders < CONTACT_TOLERANCES.rough_continuity])
        inside = (rough > low + margin) & (rough < high - margin)
        return rough[inside | (rough == low) if self.closed else inside]

    def blend_ribbons(
        self, ribbons: tuple[Ribbon, Ribbon], form: str, tolerance: float, angular_tolerance: float
    ) -> BlendSurface:
        """Blend two ribbons along the swept surface, with joints near enough for the tolerance of the interior.

        Raises
        ------
        CqblendError
            As :func:`cqblend.blends.sections.blend_surface.blend_ribbons`, and TooManySpansError.
        """
        blend = blend_ribbons(ribbons, form, min(tolerance, self.tolerance / 8), angular_tolerance, self)
        return replace(blend, kind="potential")

    def measure_deviation(self, surface: Surface) -> float:
        """Return the largest distance (mm) of a blend surface from the curves, at points off those of the fit."""
        (low, high), (along, across) = self.swept.domain, POTENTIAL_LIMITS.measuring_grid
        t, v = low + (high - low) * (np.arange(along) + 0.37) / along, np.linspace(0, 1, across)
        return float(np.linalg.norm(surface.grid(t, v) - self.swept.evaluate_points(t, 1 - v), axis=2).max())


def loosen_until_feasible(make: Callable[[float], Result], tolerance: float) -> Result:
    """Return the result of ``make`` for a tolerance (mm), or for 10 or 100 times that if it takes too many spans.

    That happens where a surface has little continuity, or a relation is sharp.

    Raises
    ------
    CqblendError
        As ``make``.
    """
    for factor in POTENTIAL_LIMITS.loosening_factors:
        try:
            return make(factor * tolerance)
        except TooManySpansError as error:
            last = error
    raise last
