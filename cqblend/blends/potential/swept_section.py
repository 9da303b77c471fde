"""From a swept surface to a blend: what its ribbons are to be, and what fills the section between them up to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeVar

import numpy as np

from cqblend.blends.fit_errors import TooManySpansError
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_fit import RibbonTargets
from cqblend.blends.sections.blend_surface import BlendSurface, blend_ribbons
from cqblend.blends.sections.hermite_section import Jets, build_section
from cqblend.blends.sections.interior import FilledSection
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array

RAIL_TOLERANCE_SHARE = 1 / 16  # of a tolerance inside, that of the rails
POINTS_ACROSS = 24  # points at which the swept surface is read
LOOSENING_FACTORS = (1.0, 10.0, 100.0)  # factors on a tolerance that nobody asked for
MEASURING_GRID = (149, 33)  # points along and across, at which a blend is measured

Made = TypeVar("Made")

NO_KINKS = np.empty(0), np.empty(0, dtype=int)


class SweptSurface(Protocol):
    """A swept surface: what :class:`SweptSection` needs of it."""

    @property
    def domain(self) -> tuple[float, float]:
        """The range of t."""
        ...

    def evaluate_points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,)."""
        ...


def make_ribbon_targets(tolerance: float, width: float) -> RibbonTargets:
    """Return what ribbons are to be so that what is between them can be within a tolerance (mm) of a swept surface."""
    return RibbonTargets(position=RAIL_TOLERANCE_SHARE * tolerance, length=tolerance / width, given_derivatives=True)


@dataclass(frozen=True)
class SweptSection(FilledSection):
    """Fills the section between two ribbons up to a swept surface."""

    swept: SweptSurface

    kinks_are_certain: ClassVar[bool] = True
    most_spans_along: ClassVar[int] = 256
    advice: ClassVar[tuple[str, str]] = ("a relation that is less sharp", "a larger skin")

    @classmethod
    def from_sweep(
        cls, swept: SweptSurface, closed: bool, tolerance: float, kinks: tuple[Array, Array] = NO_KINKS
    ) -> SweptSection:
        """Return what fills G1 sections within a tolerance (mm)."""
        return cls((2, 2, 2), POINTS_ACROSS, tolerance, closed, *kinks, swept)

    def make_interior_function(self, sides: tuple[Jets, Jets], v: Array) -> Callable[[Array], Array]:
        """Return how far the swept surface is from the section."""
        plain = build_section(sides)
        return lambda t: self.swept.evaluate_points(t, 1 - v) - plain.grid(t, v)

    def blend_ribbons(
        self, ribbons: tuple[Ribbon, Ribbon], form: str, tolerance: float, angular_tolerance: float
    ) -> BlendSurface:
        """Blend two ribbons up to the swept surface, with compact joints so near that it can be within the tolerance.

        Raises
        ------
        CqblendError
            As :func:`cqblend.blends.sections.blend_surface.blend_ribbons`, and TooFine.
        """
        return blend_ribbons(ribbons, form, min(tolerance, self.tolerance / 8), angular_tolerance, self)

    def measure_deviation(self, surface: Surface) -> float:
        """Return how far a blend surface is from the curves at most (mm), between where these were read."""
        (low, high), (along, across) = self.swept.domain, MEASURING_GRID
        t, v = low + (high - low) * (np.arange(along) + 0.37) / along, np.linspace(0, 1, across)
        return float(np.linalg.norm(surface.grid(t, v) - self.swept.evaluate_points(t, 1 - v), axis=2).max())


def loosen_until_feasible(make: Callable[[float], Made], tolerance: float) -> Made:
    """Return what is made within a tolerance inside (mm), or within ten or a hundred times that if it is too fine.

    That is where surfaces are so rough, or relations so sharp, that it would take too many spans.

    Raises
    ------
    CqblendError
        As ``make``.
    """
    for factor in LOOSENING_FACTORS:
        try:
            return make(factor * tolerance)
        except TooManySpansError as error:
            last = error
    raise last
