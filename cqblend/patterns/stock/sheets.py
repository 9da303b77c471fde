"""Pieces on sheets of stock: turned and placed without overlap.

Exists because a cutter has a bed. Pieces are laid on a grid of cells: each takes all cells that it touches, blown up by
half the gap, and goes as low as it can, then as far left. A row of cells is one integer, whose bits are the cells, so
that a piece is tried at all places of a row at once. Must not know what is drawn on the sheets.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import Any, Literal

import numpy as np
import shapely

from cqblend.checks import check_millimetres
from cqblend.errors import InputError, SizeError, VerificationError, shown
from cqblend.patterns.outline.bounding_boxes import (
    find_convex_hull,
    find_fitting_angle,
    find_flattest_angle,
    measure_rotated_extents,
)
from cqblend.patterns.outline.overlap import to_polygon
from cqblend.patterns.outline.pieces import Piece, Pieces
from cqblend.patterns.stock import nesting
from cqblend.splines.bernstein import Array

Packer = Literal["grid", "spyrrow"]

SheetSize = tuple[float, float]

CELLS_PER_SIDE = 500
"""How many cells the longer side of a sheet has."""

POLYGON_TOLERANCE = 1e-3
"""Arcs are replaced by polygons within this tolerance to see whether pieces overlap, mm."""

TRIED_WIDTHS = (0.7, 0.85, 1.05, 1.25)
"""Widths that are tried of a sheet without given size, relative to the square of the area of all boxes."""

MANY_PIECES = 60
"""Of more pieces than these only one width is tried, and two of their four quarter turns."""


@dataclass(frozen=True, slots=True, eq=False)
class Sheets:
    """Pieces at their places.

    Attributes
    ----------
    size
        Width and height of every sheet, mm.
    pieces
        Each where it lies on its sheet, whose lower left corner is the origin; places in space and seams as they were.
    numbers
        On which sheet each piece is, from 0.
    margin, gap
        Kept free along the borders of the sheets and between pieces, mm.
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
        """Return the pieces on a sheet."""
        return tuple(p for p, where in zip(self.pieces.pieces, self.numbers, strict=True) if where == number)

    @property
    def used_fraction(self) -> float:
        """Part of the stock that ends up in pieces, tabs included."""
        cut = sum(path.area for piece in self.pieces.pieces for path in piece.cuts)
        return cut / max(self.count * self.size[0] * self.size[1], np.finfo(float).tiny)


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
        Kept free along the borders and between pieces, mm. Where a kerf is cut, it is part of both.
    packer
        ``"grid"`` places each piece in turn, the largest first, as low as it can. ``"spyrrow"`` asks the library of
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
    shapes = [_PieceShape(piece) for piece in pieces.pieces]
    if sheet is not None:
        sheet = check_sheet_size(sheet)
    inner = None if sheet is None else subtract_margins(sheet, margin)
    turns = [_choose_turn(shape, inner) for shape in shapes]
    if packer == "spyrrow":
        placed = nesting.pack_with_spyrrow([shape.polygon for shape in shapes], turns, inner, gap, seconds)
    else:
        placed = _pack_sheets(shapes, turns, inner, gap) if inner else _pack_one_sheet(shapes, turns, gap)
    lower = np.full(2, margin)
    moved = [piece.moved(turn, shift + lower) for piece, (_, turn, shift) in zip(pieces.pieces, placed, strict=True)]
    numbers = tuple(number for number, _, _ in placed)
    if sheet is None:
        corners = [to_polygon(piece.cuts, POLYGON_TOLERANCE).bounds[2:] for piece in moved]
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
    """Return what the margins leave of a sheet.

    Raises
    ------
    InputError
        If that is nothing.
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
    slack = 2 * POLYGON_TOLERANCE
    for number in range(sheets.count):
        pieces = sheets.pieces_on(number)
        polygons = np.array([to_polygon(piece.cuts, POLYGON_TOLERANCE) for piece in pieces])
        near = max(sheets.gap - slack, 0.0)
        first, second = shapely.STRtree(polygons).query(polygons, predicate="dwithin", distance=near)
        for i, k in zip(first, second, strict=True):
            if i < k and (near > 0 or shapely.intersection(polygons[i], polygons[k]).area > slack * polygons[i].length):
                names = f"{pieces[i].name} and {pieces[k].name}"
                raise VerificationError(f"pieces {names} are nearer than {sheets.gap:g} mm on sheet {number + 1}")
        bounds = shapely.bounds(polygons)
        border = np.array([*2 * [sheets.margin], *(side - sheets.margin for side in sheets.size)])
        over = ((bounds - border) * [-1, -1, 1, 1]).max(axis=1)
        if over.max() > slack:
            raise VerificationError(f"piece {pieces[over.argmax()].name} leaves sheet {number + 1}")


class _PieceShape:
    """What a piece covers."""

    def __init__(self, piece: Piece) -> None:
        self.name = piece.name
        self.polygon = to_polygon(piece.cuts, POLYGON_TOLERANCE)
        self.hull = find_convex_hull(piece.cuts, POLYGON_TOLERANCE)

    @cached_property
    def diameter(self) -> float:
        """Largest distance between two of its points, or nearly."""
        return float(np.linalg.norm(np.ptp(self.hull, axis=0)))


def _choose_turn(shape: _PieceShape, inner: SheetSize | None) -> float:
    """Return by which angle a piece is turned to lie as flat as it can, and on the sheet."""
    if inner is None:
        return find_flattest_angle(shape.hull)
    turn = find_fitting_angle(shape.hull, inner)
    if turn is None:
        width, height = measure_rotated_extents(shape.hull, np.array([find_flattest_angle(shape.hull)]))[0]
        raise SizeError(
            f"piece {shape.name} is {width:.1f} x {height:.1f} mm and does not fit the {inner[0]:g} x {inner[1]:g} mm "
            f"within the margins of a sheet: cut it, or take larger sheets"
        )
    return turn


_Placements = list[tuple[int, float, Array]]
"""Sheet, turn (rad) and shift of each shape; shifts are from the lower left corner within the margins."""


def _pack_one_sheet(shapes: Sequence[_PieceShape], turns: Sequence[float], gap: float) -> _Placements:
    """Return shapes packed on one sheet, of the width among some that gives the least area, and not far from square."""
    flat = np.array(
        [measure_rotated_extents(shape.hull, np.array([turn]))[0] for shape, turn in zip(shapes, turns, strict=True)]
    )
    square = float(np.sqrt((flat + gap).prod(axis=1).sum()))

    def compute_cost(spots: _Placements) -> float:
        corners = [
            shape.hull @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + shift
            for shape, (_, turn, shift) in zip(shapes, spots, strict=True)
        ]
        width, height = np.concatenate(corners).max(axis=0)
        return float(width * height + (width - height) ** 2 / 10)

    tried = TRIED_WIDTHS if len(shapes) <= MANY_PIECES else (1.05,)
    widths = {max(float(flat.max()), square * width) for width in tried}
    return min((_pack_sheets(shapes, turns, (width, np.inf), gap) for width in sorted(widths)), key=compute_cost)


def _pack_sheets(shapes: Sequence[_PieceShape], turns: Sequence[float], inner: SheetSize, gap: float) -> _Placements:
    """Return shapes packed on sheets, the largest first; a sheet may be open upwards."""
    flat = np.array(
        [measure_rotated_extents(shape.hull, np.array([turn]))[0] for shape, turn in zip(shapes, turns, strict=True)]
    )
    cell = max(side for side in inner if np.isfinite(side)) / CELLS_PER_SIDE
    # a cell that touches a piece has its centre within half a diagonal of it; 1.01 makes up for the polygons of buffers
    around = 1.01 * (gap / 2 + cell / np.sqrt(2))
    grids: list[_SheetGrid] = []
    placed: _Placements = [(0, 0.0, np.zeros(2))] * len(shapes)
    for k in sorted(range(len(shapes)), key=lambda k: (-shapes[k].diameter, k)):
        shape, turn = shapes[k], turns[k]
        masks = []
        for quarter in range(4 if len(shapes) <= MANY_PIECES else 2):
            extent = flat[k][:: -1 if quarter % 2 else 1]
            if (extent <= np.asarray(inner) * (1 + 1e-12)).all():
                masks.append(_CellMask(shape.polygon, turn + quarter * np.pi / 2, around, cell))
        for number in count():
            if number == len(grids):
                grids.append(_SheetGrid(inner, around, cell))
            found = grids[number].place_lowest(masks)
            if found is not None:
                mask, place = found
                placed[k] = number, mask.turn, place * cell - mask.corner - around
                break
    return placed


class _CellMask:
    """The cells that a piece takes, turned by an angle.

    Attributes
    ----------
    runs
        For each row from below, the first cell and the number of cells of each uninterrupted run.
    corner
        Lower left corner of what the cells cover, turned.
    """

    def __init__(self, polygon: Any, turn: float, around: float, cell: float) -> None:
        cos, sin = np.cos(turn), np.sin(turn)
        turned = shapely.transform(polygon, lambda points: points @ np.array([[cos, sin], [-sin, cos]]))
        self.turn = turn
        low, high = np.reshape(turned.bounds, (2, 2))
        self.corner = low - around
        self.extent = high - low + 2 * around
        blown = shapely.buffer(shapely.simplify(turned, 0.01 * cell), around + 0.01 * cell)
        self.runs = _rasterise_polygon(blown, self.corner, cell, int(max(np.ceil(self.extent[1] / cell - 1e-9), 1)))


def _rasterise_polygon(polygon: Any, corner: Array, cell: float, rows: int) -> list[list[tuple[int, int]]]:
    """Return the runs, first cell and number, of cells in each row whose centres are in a polygon."""
    points, ring = shapely.get_coordinates(shapely.get_rings(polygon), return_index=True)
    places = (points - corner) / cell - 0.5  # centres of cells are whole numbers
    edges = np.stack([places[:-1], places[1:]], axis=1)[ring[1:] == ring[:-1]]
    first, stop = np.clip(np.ceil(np.sort(edges[:, :, 1], axis=1)).astype(int).T, 0, rows)
    counts = stop - first
    which = np.repeat(np.arange(len(edges)), counts)
    row = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts) + first[which]
    (x0, y0), (x1, y1) = edges[which].transpose(1, 2, 0)
    x = x0 + (row - y0) / (y1 - y0) * (x1 - x0)
    order = np.lexsort([x, row])
    row, cells = row[order][::2], np.maximum(np.ceil(x[order]).astype(int), 0)
    found: list[list[tuple[int, int]]] = [[] for _ in range(rows)]
    for r, begin, end in zip(row.tolist(), cells[::2].tolist(), cells[1::2].tolist(), strict=True):
        if end > begin:
            found[r].append((begin, end - begin))
    return found


class _SheetGrid:
    """The cells of a sheet that are taken; one integer per row, from below."""

    def __init__(self, inner: SheetSize, around: float, cell: float) -> None:
        self.cell = cell
        self.extent = np.array(inner) + 2 * around
        self.rows: list[int] = []

    def place_lowest(self, masks: Sequence[_CellMask]) -> tuple[_CellMask, Array] | None:
        """Put the mask whose upper border comes lowest where it is lowest, then leftmost; None if none has room."""
        best: tuple[int, int, int] | None = None
        for k, mask in enumerate(masks):
            tallest = None if best is None else best[0]
            place = self._find_lowest_place(mask, tallest)
            if place is not None and (best is None or (place[1] + len(mask.runs), place[0]) < best[:2]):
                best = place[1] + len(mask.runs), place[0], k
        if best is None:
            return None
        mask = masks[best[2]]
        column, row = best[1], best[0] - len(mask.runs)
        self.rows.extend([0] * (best[0] - len(self.rows)))
        for r, runs in enumerate(mask.runs):
            for start, length in runs:
                self.rows[row + r] |= ((1 << length) - 1) << (column + start)
        return mask, np.array([column, row])

    def _find_lowest_place(self, mask: _CellMask, top: int | None) -> tuple[int, int] | None:
        """Return column and row of the lowest, then leftmost free place of a mask whose upper border is below a row."""
        columns, rows = np.floor((self.extent - mask.extent) / self.cell + 1e-9)
        last = int(min(rows, len(self.rows), np.inf if top is None else top - len(mask.runs)))
        everywhere = (1 << (int(columns) + 1)) - 1
        for row in range(last + 1):
            blocked = 0
            for taken, runs in zip(self.rows[row:], mask.runs, strict=False):
                if taken:
                    for start, length in runs:
                        blocked |= _smear_bits(taken >> start, length)
                    if blocked & everywhere == everywhere:
                        break
            free = everywhere & ~blocked
            if free:
                return (free & -free).bit_length() - 1, row
        return None


def _smear_bits(bits: int, length: int) -> int:
    """Return the places at which a run of so many cells meets a taken one.

    Examples
    --------
    >>> bin(_smeared(0b1000, 3))
    '0b1110'
    """
    reach = 1
    while 2 * reach <= length:
        bits |= bits >> reach
        reach *= 2
    return bits | bits >> (length - reach)
