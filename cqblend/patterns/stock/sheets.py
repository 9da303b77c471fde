"""Places pieces on sheets of stock, turned and without overlap, since the bed of a cutter has a size.

Pieces are packed on a grid of cells (:mod:`cqblend.patterns.stock.grid_packing`), or by spyrrow; the result is verified
with the polygons themselves. Depends on outlines only.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely

from cqblend.argument_checks import check_millimetres
from cqblend.errors import InputError, SizeError, VerificationError, shown
from cqblend.patterns.outline.overlap import to_polygon
from cqblend.patterns.outline.pieces import Piece, Pieces
from cqblend.patterns.outline.rotated_boxes import find_fitting_angle, find_flattest_angle, measure_rotated_extents
from cqblend.patterns.stock import spyrrow_packing
from cqblend.patterns.stock.grid_packing import PieceShape, pack_one_sheet, pack_sheets
from cqblend.patterns.stock.sheet_placement import SheetSize
from cqblend.patterns.stock.stock_proportions import PACKING_LIMITS

Packer = Literal["grid", "spyrrow"]
"""By what pieces are packed: the grid of cells, or the optional library."""


@dataclass(frozen=True, slots=True, eq=False)
class Sheets:
    """Pieces placed on sheets of one size.

    Attributes
    ----------
    size
        Width and height of every sheet, mm.
    pieces
        Moved to where they lie on their sheets, whose lower left corners are the origin; points in space and seams are
        unchanged.
    numbers
        Index of the sheet of each piece.
    margin, gap
        Widths kept free along the borders of the sheets and between pieces, mm.
    """

    size: SheetSize
    pieces: Pieces
    numbers: tuple[int, ...]
    margin: float
    gap: float

    @property
    def count(self) -> int:
        """Number of sheets."""
        return max(self.numbers, default=-1) + 1

    def pieces_on(self, number: int) -> tuple[Piece, ...]:
        """Return the pieces on a sheet, given by its index."""
        return tuple(piece for piece, own in zip(self.pieces.pieces, self.numbers, strict=True) if own == number)


def arrange_pieces(
    pieces: Pieces,
    sheet: SheetSize | None = None,
    *,
    margin: float = 5.0,
    gap: float = 3.0,
    packer: Packer = "grid",
    seconds: float = 30.0,
) -> Sheets:
    """Return pieces placed on sheets: no two are nearer than a gap, and none is nearer to a border than a margin.

    Parameters
    ----------
    pieces
        Wherever they lie; with their tabs, if they have any.
    sheet
        Width and height of the stock, mm; None is one sheet as large as it needs to be.
    margin, gap
        Widths kept free along the borders and between pieces, mm. Where a kerf is cut, it is part of both.
    packer
        ``"grid"`` places each piece in turn, the largest first, as low as possible. ``"spyrrow"`` calls the library of
        that name, which packs closer and takes all the time it is given; it needs to be installed.
    seconds
        Time for spyrrow, for each sheet.

    Returns
    -------
    Sheets
        Checked: no two pieces overlap, and all are on their sheets.

    Raises
    ------
    InputError
        If there are no pieces, a length is not a number, or the margins leave nothing of the sheet.
    SizeError
        If a piece is larger than the sheet, whichever way it is turned.
    InstallationError
        If spyrrow is asked for and not installed.
    VerificationError
        If pieces were placed too near to each other.
    """
    margin = check_millimetres("the margin of a sheet", margin, zero=True)
    gap = check_millimetres("the gap between pieces", gap, zero=True)
    if packer not in ("grid", "spyrrow"):
        raise InputError(f'pieces are packed by "grid" or "spyrrow", not {shown(packer)}')
    if not pieces.pieces:
        raise InputError("there are no pieces to be placed")
    shapes = [PieceShape(piece) for piece in pieces.pieces]
    if sheet is not None:
        sheet = check_sheet_size(sheet)
    usable = None if sheet is None else subtract_margins(sheet, margin)
    turns = [_choose_turn(shape, usable) for shape in shapes]
    if packer == "spyrrow":
        placed = spyrrow_packing.pack_with_spyrrow([shape.polygon for shape in shapes], turns, usable, gap, seconds)
    else:
        placed = pack_sheets(shapes, turns, usable, gap) if usable else pack_one_sheet(shapes, turns, gap)
    lower = np.full(2, margin)
    moved = [piece.moved(place.turn, place.shift + lower) for piece, place in zip(pieces.pieces, placed, strict=True)]
    numbers = tuple(place.sheet for place in placed)
    if sheet is None:
        corners = [to_polygon(piece.cuts, PACKING_LIMITS.polygon_tolerance).bounds[2:] for piece in moved]
        width, height = np.max([*corners, (0.0, 0.0)], axis=0) + margin
        sheet = float(width), float(height)
    result = Sheets(sheet, Pieces(tuple(moved), pieces.seams), numbers, margin, gap)
    verify_spacing(result)
    return result


def check_sheet_size(size: object) -> SheetSize:
    """Return width and height of a sheet, mm.

    Raises
    ------
    InputError
        If it is not a pair of positive numbers.
    """
    if not isinstance(size, Sequence) or isinstance(size, str) or len(size) != 2:
        raise InputError(f"a sheet has a width and a height, (600, 400) for example, not {shown(size)}")
    return check_millimetres("the width of a sheet", size[0]), check_millimetres("the height of a sheet", size[1])


def subtract_margins(sheet: SheetSize, margin: float) -> SheetSize:
    """Return the width and height, mm, that margins leave of a sheet.

    Raises
    ------
    InputError
        If they leave nothing.
    """
    width, height = (side - 2 * margin for side in sheet)
    if min(width, height) <= 0:
        raise InputError(f"margins of {margin:g} mm leave nothing of a sheet of {sheet[0]:g} x {sheet[1]:g} mm")
    return width, height


def verify_spacing(sheets: Sheets) -> None:
    """Check that pieces keep their gap and their margin.

    Raises
    ------
    VerificationError
        If they do not; the message names the pieces.
    """
    tolerance = PACKING_LIMITS.polygon_tolerance
    slack = 2 * tolerance
    for number in range(sheets.count):
        pieces = sheets.pieces_on(number)
        polygons = np.array([to_polygon(piece.cuts, tolerance) for piece in pieces])
        near = max(sheets.gap - slack, 0.0)
        first, second = shapely.STRtree(polygons).query(polygons, predicate="dwithin", distance=near)
        for i, k in zip(first, second, strict=True):
            if i < k and (near > 0 or shapely.intersection(polygons[i], polygons[k]).area > slack * polygons[i].length):
                names = f"{pieces[i].name} and {pieces[k].name}"
                raise VerificationError(f"pieces {names} are nearer than {sheets.gap:g} mm on sheet {number + 1}")
        bounds = shapely.bounds(polygons)
        border = np.array([*2 * [sheets.margin], *(side - sheets.margin for side in sheets.size)])
        excess = ((bounds - border) * [-1, -1, 1, 1]).max(axis=1)
        if excess.max() > slack:
            raise VerificationError(f"piece {pieces[excess.argmax()].name} leaves sheet {number + 1}")


def _choose_turn(shape: PieceShape, usable: SheetSize | None) -> float:
    """Return the angle (rad) by which a piece is turned to lie as flat as the usable size of the sheet allows."""
    if usable is None:
        return find_flattest_angle(shape.hull)
    turn = find_fitting_angle(shape.hull, usable)
    if turn is None:
        width, height = measure_rotated_extents(shape.hull, np.array([find_flattest_angle(shape.hull)]))[0]
        raise SizeError(
            f"piece {shape.name} is {width:.1f} x {height:.1f} mm and does not fit the "
            f"{usable[0]:g} x {usable[1]:g} mm within the margins of a sheet: cut it, or take larger sheets"
        )
    return turn
