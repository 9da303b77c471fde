"""Sizes of sheets, and placements of shapes on them: what the packers take and return."""

from typing import NamedTuple

from cqblend.splines.bernstein import Array

SheetSize = tuple[float, float]
"""Width and height, mm."""


class Placement(NamedTuple):
    """Where a shape is placed.

    Attributes
    ----------
    sheet
        Index of the sheet.
    turn
        Angle (rad) about the origin.
    shift
        (2,), mm, after the turn, from the lower left corner within the margins of the sheet.
    """

    sheet: int
    turn: float
    shift: Array
