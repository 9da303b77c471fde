"""From a swept surface to a blend: what its ribbons are to be, and what fills the section between them up to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeVar

import numpy as np

from cqblend.blends.checks import TooFine
from cqblend.blends.rails.rail_fit import Wanted
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.sections.blend_surface import Blend, hermite
from cqblend.blends.sections.hermite_section import Jets, section
from cqblend.blends.sections.interior import Filling
from cqblend.splines import Surface
from cqblend.surfaces.primaries import Array

SHARE = 1 / 16  # of a tolerance inside, that of the rails
ACROSS = 24  # points at which the swept surface is read
LOOSER = (1.0, 10.0, 100.0)  # factors on a tolerance that nobody asked for
MEASURED = (149, 33)  # points along and across, at which a blend is measured

Made = TypeVar("Made")

NOWHERE = np.empty(0), np.empty(0, dtype=int)


class Swept(Protocol):
    """A swept surface: what :class:`Skin` needs of it."""

    @property
    def domain(self) -> tuple[float, float]:
        """The range of t."""
        ...

    def points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,)."""
        ...


def tied(tolerance: float, width: float) -> Wanted:
    """Return what ribbons are to be so that what is between them can be within a tolerance (mm) of a swept surface."""
    return Wanted(position=SHARE * tolerance, length=tolerance / width, tied=True)


@dataclass(frozen=True)
class Skin(Filling):
    """Fills the section between two ribbons up to a swept surface."""

    swept: Swept

    firm: ClassVar[bool] = True
    most: ClassVar[int] = 256
    advice: ClassVar[tuple[str, str]] = ("a relation that is less sharp", "a larger skin")

    @classmethod
    def over(cls, swept: Swept, closed: bool, tolerance: float, kinks: tuple[Array, Array] = NOWHERE) -> Skin:
        """Return what fills G1 sections within a tolerance (mm)."""
        return cls((2, 2, 2), ACROSS, tolerance, closed, *kinks, swept)

    def added(self, sides: tuple[Jets, Jets], v: Array) -> Callable[[Array], Array]:
        """Return how far the swept surface is from the section."""
        plain = section(sides)
        return lambda t: self.swept.points(t, 1 - v) - plain.grid(t, v)

    def blend(self, ribbons: tuple[Ribbon, Ribbon], form: str, tolerance: float, angular_tolerance: float) -> Blend:
        """Blend two ribbons up to the swept surface, with compact joints so near that it can be within the tolerance.

        Raises
        ------
        CqblendError
            As :func:`cqblend.blends.sections.blend_surface.hermite`, and TooFine.
        """
        return hermite(ribbons, form, min(tolerance, self.tolerance / 8), angular_tolerance, self)

    def missed(self, surface: Surface) -> float:
        """Return how far a blend surface is from the curves at most (mm), between where these were read."""
        (low, high), (along, across) = self.swept.domain, MEASURED
        t, v = low + (high - low) * (np.arange(along) + 0.37) / along, np.linspace(0, 1, across)
        return float(np.linalg.norm(surface.grid(t, v) - self.swept.points(t, 1 - v), axis=2).max())


def loosened(make: Callable[[float], Made], tolerance: float) -> Made:
    """Return what is made within a tolerance inside (mm), or within ten or a hundred times that if it is too fine.

    That is where surfaces are so rough, or relations so sharp, that it would take too many spans.

    Raises
    ------
    CqblendError
        As ``make``.
    """
    for factor in LOOSER:
        try:
            return make(factor * tolerance)
        except TooFine as error:
            last = error
    raise last
