r"""How far from a vertex blends stop for patches to have room: their setbacks.

On a face between edges p and q that meet at the angle omega, the rails of both blends, of widths w, cross at the
distance

.. math:: t_{pq} = (w_q + w_p \cos\omega) / \sin\omega

from the vertex along p. A blend stops before its farthest crossing. Knows numbers only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.blends.corners.tolerances import CORNER_TOLERANCES
from cqblend.errors import SizeError


@dataclass(frozen=True)
class Setback:
    """How far along its edge (mm) a blend stops before the vertex: as wanted, and at least."""

    wanted: float
    least: float


def locate_crossing(own_width: float, other_width: float, angle: float) -> float:
    """Return the distance from the vertex at which the rails of two blends cross, of widths on the face between them.

    ``angle`` (rad) is that of the face at the vertex, more than pi if it is reflex.

    Examples
    --------
    >>> round(locate_crossing(1.0, 2.0, np.pi / 2), 12)
    2.0
    """
    sine = np.sin(angle)
    return float((other_width + own_width * np.cos(angle)) / sine) if sine else np.inf


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
