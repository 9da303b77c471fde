r"""How far from a vertex blends stop for patches to have room: their setbacks.

On a face between edges p and q that meet at the angle omega, the rails of both blends, of widths w, cross at the
distance

.. math:: t_{pq} = (w_q + w_p \cos\omega) / \sin\omega

from the vertex along p. A blend stops before its farthest crossing. Knows numbers only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cqblend.blends.corners.tolerances import CORNER_TOLERANCES
from cqblend.errors import SizeError


@dataclass(frozen=True)
class Setback:
    """How far along its edge (mm) a blend stops before the vertex: as wanted, and at least."""

    wanted: float
    least: float


def choose_setback(width: float, crossings: Sequence[float], attempt: int = 0) -> Setback:
    """Return the setback of a blend of a given width whose rails cross others at given distances from the vertex.

    Others than the first ``attempt`` are longer or shorter.
    """
    farthest, extra = max(0.0, *crossings), CORNER_TOLERANCES.setback_widths * width
    return Setback(
        CORNER_TOLERANCES.setback_factors[attempt] * farthest + extra,
        max(CORNER_TOLERANCES.least_setback_factor * farthest, extra),
    )


def fit_setback(setback: Setback, length: float) -> float:
    """Return a setback, shrunk if the edge, of a given length (mm), is too short for two of its kind.

    Raises
    ------
    SizeError
        If it is too short even for the least one.
    """
    room = CORNER_TOLERANCES.most_setback_share * length
    if setback.least > room:
        raise SizeError(
            f"the patches of the corner take {setback.least:.4g} mm of the edge, there are {room:.4g}: the size is too "
            "large",
            kind="too large",
            room=room / setback.least,
        )
    return min(setback.wanted, room)
