"""Tells the caller which larger ``steer``, if any, would remove a crease or a jump inside a blend."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cqblend.blends.rails.direction_steering import RequiredTurn
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES


def suggest_remedy(needed: Sequence[Sequence[RequiredTurn]]) -> str:
    """Return what helps at places on rails where directions would have to turn: a larger ``steer``, if one would do.

    Each place has the turns that the knot lines of its surface ask for; one direction cannot satisfy two of them.
    """
    single = all(len(place) == 1 for place in needed)
    largest = max((abs(turn.angle) for place in needed for turn in place), default=np.inf)
    steer = largest + RAIL_TOLERANCES.turn_margin
    along_rail = any(turn.angle_to_rail < RAIL_TOLERANCES.near_rail_angle for place in needed for turn in place)
    if not single or steer > RAIL_TOLERANCES.largest_turn or along_rail:
        return "other tangents, or less continuity: no steer= would do"
    doubt = ", so far that the blend may fold" if steer > RAIL_TOLERANCES.folding_turn else ""
    proposed = min(round_up_to_two_digits(steer), RAIL_TOLERANCES.largest_turn)
    return f"steer={proposed:.3g}, which turns the directions along the line{doubt}"


def round_up_to_two_digits(value: float) -> float:
    """Return the least number of two decimal digits that is not below a positive value."""
    digit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(np.ceil(value / digit) * digit)
