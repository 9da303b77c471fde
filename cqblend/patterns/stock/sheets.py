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

from cqblend.errors import InputError, SizeError, VerificationError, shown
from cqblend.patterns.checks import millimetres
from cqblend.patterns.outline.bounding_boxes import extents, fitting_turn, hull, least_turn
from cqblend.patterns.outline.overlap import region
from cqblend.patterns.outline.pieces import Piece, Pieces
from cqblend.patterns.stock import nesting
from cqblend.splines.bernstein import Array

Packer = Literal["grid", "spyrrow"]

Size = tuple[float, float]

CELLS = 500
"""How many cells the longer side of a sheet has."""

FINE = 1e-3
"""Arcs are replaced by polygons within this tolerance to see whether pieces overlap, mm."""

WIDTHS = (0.7, 0.85, 1.05, 1.25)
"""Widths that are tried of a sheet without given size, relative to the square of the area of all boxes."""

MANY = 60
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

    size: Size
    pieces: Pieces
    numbers: tuple[int, ...]
    margin: float
    gap: float

    @property
    def count(self) -> int:
        """Number of sheets."""
        return max(self.numbers, default=-1) + 1

    def on(self, number: int) -> tuple[Piece, ...]:
        """Return the pieces on a sheet."""
        return tuple(p for p, where in zip(self.pieces.pieces, self.numbers, strict=True) if where == number)

    @property
    def used(self) -> float:
        """Part of the stock that ends up in pieces, tabs included."""
        cut = sum(path.area for piece in self.pieces.pieces for path in piece.cuts)
        return cut / max(self.count * self.size[0] * self.size[1], np.finfo(float).tiny)


def arrange(
    pieces: Pieces,
    sheet: Size | None = None,
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
    margin = millimetres("the margin of a sheet", margin, zero=True)
    gap = millimetres("the gap between pieces", gap, zero=True)
    if packer not in ("grid", "spyrrow"):
        raise InputError(f'pieces are packed by "grid" or "spyrrow", not {shown(packer)}')
    if not pieces.pieces:
        raise InputError("there are no pieces to be placed")
    shapes = [_Shape(piece) for piece in pieces.pieces]
    if sheet is not None:
        sheet = checked_size(sheet)
    inner = None if sheet is None else usable(sheet, margin)
    turns = [_turn(shape, inner) for shape in shapes]
    if packer == "spyrrow":
        placed = nesting.packed([shape.polygon for shape in shapes], turns, inner, gap, seconds)
    else:
        placed = _packed(shapes, turns, inner, gap) if inner else _packed_freely(shapes, turns, gap)
    lower = np.full(2, margin)
    moved = [piece.moved(turn, shift + lower) for piece, (_, turn, shift) in zip(pieces.pieces, placed, strict=True)]
    numbers = tuple(number for number, _, _ in placed)
    if sheet is None:
        corners = [region(piece.cuts, FINE).bounds[2:] for piece in moved]
        width, height = np.max([*corners, (0.0, 0.0)], axis=0) + margin
        sheet = float(width), float(height)
    result = Sheets(sheet, Pieces(tuple(moved), pieces.seams), numbers, margin, gap)
    verify(result)
    return result


def checked_size(size: object) -> Size:
    """Return width and height of a sheet, mm.

    Raises
    ------
    InputError
        If it is not a pair of positive numbers.
    """
    if not isinstance(size, Sequence) or isinstance(size, str) or len(size) != 2:
        raise InputError(f"a sheet has a width and a height, (600, 400) for example, not {shown(size)}")
    return millimetres("the width of a sheet", size[0]), millimetres("the height of a sheet", size[1])


def usable(sheet: Size, margin: float) -> Size:
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


def verify(sheets: Sheets) -> None:
    """Check that pieces keep their gap and their margin.

    Raises
    ------
    VerificationError
        If they do not; the message names the pieces.
    """
    slack = 2 * FINE
    for number in range(sheets.count):
        pieces = sheets.on(number)
        polygons = np.array([region(piece.cuts, FINE) for piece in pieces])
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


class _Shape:
    """What a piece covers."""

    def __init__(self, piece: Piece) -> None:
        self.name = piece.name
        self.polygon = region(piece.cuts, FINE)
        self.hull = hull(piece.cuts, FINE)

    @cached_property
    def size(self) -> float:
        """Largest distance between two of its points, or nearly."""
        return float(np.linalg.norm(np.ptp(self.hull, axis=0)))


def _turn(shape: _Shape, inner: Size | None) -> float:
    """Return by which angle a piece is turned to lie as flat as it can, and on the sheet."""
    if inner is None:
        return least_turn(shape.hull)
    turn = fitting_turn(shape.hull, inner)
    if turn is None:
        width, height = extents(shape.hull, np.array([least_turn(shape.hull)]))[0]
        raise SizeError(
            f"piece {shape.name} is {width:.1f} x {height:.1f} mm and does not fit the {inner[0]:g} x {inner[1]:g} mm "
            f"within the margins of a sheet: cut it, or take larger sheets"
        )
    return turn


_Spots = list[tuple[int, float, Array]]
"""Sheet, turn (rad) and shift of each shape; shifts are from the lower left corner within the margins."""


def _packed_freely(shapes: Sequence[_Shape], turns: Sequence[float], gap: float) -> _Spots:
    """Return shapes packed on one sheet, of the width among some that gives the least area, and not far from square."""
    flat = np.array([extents(shape.hull, np.array([turn]))[0] for shape, turn in zip(shapes, turns, strict=True)])
    square = float(np.sqrt((flat + gap).prod(axis=1).sum()))

    def cost(spots: _Spots) -> float:
        corners = [
            shape.hull @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + shift
            for shape, (_, turn, shift) in zip(shapes, spots, strict=True)
        ]
        width, height = np.concatenate(corners).max(axis=0)
        return float(width * height + (width - height) ** 2 / 10)

    tried = WIDTHS if len(shapes) <= MANY else (1.05,)
    widths = {max(float(flat.max()), square * width) for width in tried}
    return min((_packed(shapes, turns, (width, np.inf), gap) for width in sorted(widths)), key=cost)


def _packed(shapes: Sequence[_Shape], turns: Sequence[float], inner: Size, gap: float) -> _Spots:
    """Return shapes packed on sheets, the largest first; a sheet may be open upwards."""
    flat = np.array([extents(shape.hull, np.array([turn]))[0] for shape, turn in zip(shapes, turns, strict=True)])
    cell = max(side for side in inner if np.isfinite(side)) / CELLS
    # a cell that touches a piece has its centre within half a diagonal of it; 1.01 makes up for the polygons of buffers
    around = 1.01 * (gap / 2 + cell / np.sqrt(2))
    grids: list[_Grid] = []
    placed: _Spots = [(0, 0.0, np.zeros(2))] * len(shapes)
    for k in sorted(range(len(shapes)), key=lambda k: (-shapes[k].size, k)):
        shape, turn = shapes[k], turns[k]
        masks = []
        for quarter in range(4 if len(shapes) <= MANY else 2):
            extent = flat[k][:: -1 if quarter % 2 else 1]
            if (extent <= np.asarray(inner) * (1 + 1e-12)).all():
                masks.append(_Mask(shape.polygon, turn + quarter * np.pi / 2, around, cell))
        for number in count():
            if number == len(grids):
                grids.append(_Grid(inner, around, cell))
            found = grids[number].take(masks)
            if found is not None:
                mask, place = found
                placed[k] = number, mask.turn, place * cell - mask.corner - around
                break
    return placed


class _Mask:
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
        self.runs = _runs(blown, self.corner, cell, int(max(np.ceil(self.extent[1] / cell - 1e-9), 1)))


def _runs(polygon: Any, corner: Array, cell: float, rows: int) -> list[list[tuple[int, int]]]:
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


class _Grid:
    """The cells of a sheet that are taken; one integer per row, from below."""

    def __init__(self, inner: Size, around: float, cell: float) -> None:
        self.cell = cell
        self.extent = np.array(inner) + 2 * around
        self.rows: list[int] = []

    def take(self, masks: Sequence[_Mask]) -> tuple[_Mask, Array] | None:
        """Put the mask whose upper border comes lowest where it is lowest, then leftmost; None if none has room."""
        best: tuple[int, int, int] | None = None
        for k, mask in enumerate(masks):
            tallest = None if best is None else best[0]
            place = self._place(mask, tallest)
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

    def _place(self, mask: _Mask, top: int | None) -> tuple[int, int] | None:
        """Return column and row of the lowest, then leftmost free place of a mask whose upper border is below a row."""
        columns, rows = np.floor((self.extent - mask.extent) / self.cell + 1e-9)
        last = int(min(rows, len(self.rows), np.inf if top is None else top - len(mask.runs)))
        everywhere = (1 << (int(columns) + 1)) - 1
        for row in range(last + 1):
            blocked = 0
            for taken, runs in zip(self.rows[row:], mask.runs, strict=False):
                if taken:
                    for start, length in runs:
                        blocked |= _smeared(taken >> start, length)
                    if blocked & everywhere == everywhere:
                        break
            free = everywhere & ~blocked
            if free:
                return (free & -free).bit_length() - 1, row
        return None


def _smeared(bits: int, length: int) -> int:
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
