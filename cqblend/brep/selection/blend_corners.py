"""Corners: vertices of a solid at which the ends of several chains meet that are blended together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

CornerMethod = Literal["ball", "cross", "setback", "mitre"]
"""How the blends of a corner are put together: a sphere, patches (rails cross, or ends set back), or a mitre."""


@dataclass(frozen=True)
class ChainEnd:
    """One end of an open chain: its index among the chains of a network, and 0 for its start, 1 for its stop."""

    chain: int
    end: int


@dataclass(frozen=True)
class BlendCorner:
    """A vertex where ends of chains meet, by its number in the solid, and how their blends are put together there.

    ``ends`` go around the vertex counter-clockwise, seen from outside of the solid.
    """

    vertex: int
    ends: tuple[ChainEnd, ...]
    method: CornerMethod
