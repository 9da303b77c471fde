"""From a swept surface to a blend: what its ribbons are to be, and what fills the section between them up to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, TypeAlias

import numpy as np

from cqblend.blends.checks import TooFine
from cqblend.blends.filling import Filling
from cqblend.blends.fitting import Wanted
from cqblend.blends.hermite import Blend, hermite
from cqblend.blends.primaries import Array
from cqblend.blends.ribbons import Ribbon
from cqblend.blends.sections import Jets, section
from cqblend.splines import Surface

SHARE = 1 / 16  # of a tolerance inside, that of the rails
ACROSS = 24  # points at which the swept surface is read
LOOSER = (1.0, 10.0, 100.0)  # factors on a tolerance that nobody asked for
MEASURED = (149, 33)  # points along and across, at which a blend is measured

NOWHERE = np.empty(0), np.empty(0, dtype=int)

Ends: TypeAlias = tuple[tuple[Array, Array], tuple[Array, Array]]


class Swept(Protocol):
    """A swept surface: what :class:`Skin` needs of it, and what ribbons are fitted to."""

    @property
    def domain(self) -> tuple[float, float]:
        """The range of t."""
        ...

    def points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,)."""
        ...

    def ends(self, t: Array) -> Ends:
        """Return parameters (n, 2) and cross derivatives (n, 3), into the blend, on rail 1 (x = 1) and 2 (x = 0)."""
        ...


def tied(swept: Swept, tolerance: float, width: float) -> Wanted:
    """Return what ribbons are to be so that what is between them can be within a tolerance (mm) of a swept surface."""
    return Wanted(
        position=SHARE * tolerance,
        length=tolerance / width,
        vectors=(lambda t: swept.ends(t)[0][1], lambda t: swept.ends(t)[1][1]),
    )


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

    @property
    def compact(self) -> float:
        """What compact joints may be off (mm), so that what is between them can be within the tolerance."""
        return self.tolerance / 8

    def missed(self, surface: Surface) -> float:
        """Return how far a blend surface is from the curves at most (mm), between where these were read."""
        (low, high), (along, across) = self.swept.domain, MEASURED
        t, v = low + (high - low) * (np.arange(along) + 0.37) / along, np.linspace(0, 1, across)
        return float(np.linalg.norm(surface.grid(t, v) - self.swept.points(t, 1 - v), axis=2).max())


def skinned(
    ribbons: tuple[Ribbon, Ribbon], form: str, tolerance: float, angular_tolerance: float, skin: Skin, *, patient: bool
) -> tuple[Blend, Skin]:
    """Blend two ribbons up to a swept surface; also return what was filled in.

    A ``patient`` caller takes a tolerance inside of ten or a hundred times as much, where surfaces are so rough that it
    would take too many spans.

    Raises
    ------
    CqblendError
        As :func:`cqblend.blends.hermite.hermite`, and where the tolerance takes too many spans.
    """
    for factor in LOOSER if patient else (1.0,):
        looser = replace(skin, tolerance=factor * skin.tolerance)
        try:
            return hermite(ribbons, form, min(tolerance, looser.compact), angular_tolerance, looser), looser
        except TooFine as error:
            last = error
    raise last
