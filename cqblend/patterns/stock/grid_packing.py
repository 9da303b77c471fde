"""Packs pieces on a grid of cells: the largest first, each as low as possible, then as far left.

Each piece takes all cells that it touches when it is grown by half the gap. A row of cells is one integer, whose bits
are the cells, so that a piece is tried at all columns of a row at once. Depends on outlines only.
"""

from collections.abc import Sequence
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np
import shapely

from cqblend.patterns.outline.overlap import to_polygon
from cqblend.patterns.outline.pieces import Piece
from cqblend.patterns.outline.rotated_boxes import find_convex_hull, measure_rotated_extents
from cqblend.patterns.outline.tolerances import OUTLINE_TOLERANCES
from cqblend.patterns.stock.sheet_placement import Placement, SheetSize
from cqblend.patterns.stock.stock_proportions import PACKING_LIMITS
from cqblend.splines.bernstein import Array

TRIED_WIDTHS = (0.7, 0.85, 1.05, 1.25)
"""Widths that are tried of a sheet without given size, relative to the square root of the area of all boxes."""


class PieceShape:
    """The polygon of a piece with its tabs, and its convex hull (m, 2)."""

    def __init__(self, piece: Piece) -> None:
        self.name = piece.name
        self.polygon = to_polygon(piece.cuts, PACKING_LIMITS.polygon_tolerance)
        self.hull = find_convex_hull(piece.cuts, PACKING_LIMITS.polygon_tolerance)

    @cached_property
    def diameter(self) -> float:
        """Diagonal of its bounding box, mm: about the largest distance between two of its points."""
        return float(np.linalg.norm(np.ptp(self.hull, axis=0)))


def pack_one_sheet(shapes: Sequence[PieceShape], turns: Sequence[float], gap: float) -> list[Placement]:
    """Return shapes packed on one sheet, of the tried width that gives the least area, but not far from a square.

    Parameters are those of :func:`pack_sheets`.
    """
    extents = _measure_extents(shapes, turns)
    square = float(np.sqrt((extents + gap).prod(axis=1).sum()))

    def compute_cost(placed: list[Placement]) -> float:
        vertices = [
            shape.hull @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + shift
            for shape, (_, turn, shift) in zip(shapes, placed, strict=True)
        ]
        width, height = np.concatenate(vertices).max(axis=0)
        return float(width * height + (width - height) ** 2 / 10)

    ratios = TRIED_WIDTHS if len(shapes) <= PACKING_LIMITS.many_pieces else (PACKING_LIMITS.usual_width,)
    widths = {max(float(extents.max()), square * ratio) for ratio in ratios}
    return min((pack_sheets(shapes, turns, (width, np.inf), gap) for width in sorted(widths)), key=compute_cost)


def pack_sheets(shapes: Sequence[PieceShape], turns: Sequence[float], usable: SheetSize, gap: float) -> list[Placement]:
    """Return the placements of shapes, in their order, on as many sheets as that takes.

    Parameters
    ----------
    shapes
        Each of which fits the sheet.
    turns
        Angle (rad) by which each is turned to fit; quarters of a turn more are tried.
    usable
        Width and height of a sheet within its margins, mm; the height may be infinite.
    gap
        Between shapes, mm.
    """
    extents = _measure_extents(shapes, turns)
    cell = max(side for side in usable if np.isfinite(side)) / PACKING_LIMITS.cells_per_side
    # a cell that touches a piece has its centre within half a diagonal of it
    growth = PACKING_LIMITS.disc_safety * (gap / 2 + cell / np.sqrt(2))
    allowed = np.asarray(usable) * (1 + OUTLINE_TOLERANCES.rounding_of_boxes)
    grids: list[_SheetGrid] = []
    placed: dict[int, Placement] = {}
    for k in sorted(range(len(shapes)), key=lambda k: (-shapes[k].diameter, k)):
        masks = []
        for quarter in range(4 if len(shapes) <= PACKING_LIMITS.many_pieces else 2):
            extent = extents[k][:: -1 if quarter % 2 else 1]
            if (extent <= allowed).all():
                masks.append(_CellMask(shapes[k].polygon, turns[k] + quarter * np.pi / 2, growth, cell))
        for sheet in count():
            if sheet == len(grids):
                grids.append(_SheetGrid(usable, growth, cell))
            found = grids[sheet].place_lowest(masks)
            if found is not None:
                mask, place = found
                placed[k] = Placement(sheet, mask.turn, place * cell - mask.corner - growth)
                break
    return [placed[k] for k in range(len(shapes))]


def _measure_extents(shapes: Sequence[PieceShape], turns: Sequence[float]) -> Array:
    """Return width and height (n, 2) of shapes, each turned by its angle."""
    return np.array(
        [measure_rotated_extents(shape.hull, np.array([turn]))[0] for shape, turn in zip(shapes, turns, strict=True)]
    )


class _CellMask:
    """The cells that a piece takes when it is turned by an angle.

    Attributes
    ----------
    turn
        The angle, rad.
    runs
        For each row from below, the first cell and the number of cells of each uninterrupted run.
    corner, extent
        (2,), lower left corner and size of the bounding box of the piece, turned and grown, mm.
    """

    def __init__(self, polygon: Any, turn: float, growth: float, cell: float) -> None:
        cos, sin = np.cos(turn), np.sin(turn)
        turned = shapely.transform(polygon, lambda points: points @ np.array([[cos, sin], [-sin, cos]]))
        self.turn = turn
        low, high = np.reshape(turned.bounds, (2, 2))
        self.corner = low - growth
        self.extent = high - low + 2 * growth
        tolerance = PACKING_LIMITS.cell_tolerance * cell
        grown = shapely.buffer(shapely.simplify(turned, tolerance), growth + tolerance)
        self.runs = _rasterise_polygon(grown, self.corner, cell, int(max(np.ceil(self.extent[1] / cell - 1e-9), 1)))


def _rasterise_polygon(polygon: Any, corner: Array, cell: float, rows: int) -> list[list[tuple[int, int]]]:
    """Return for each row the runs of cells whose centres are in a polygon: first cell, and number of cells.

    Parameters
    ----------
    polygon
        The polygon.
    corner
        (2,), lower left corner of cell 0 of row 0.
    cell
        Side of the cells, mm.
    rows
        Number of rows.
    """
    points, ring = shapely.get_coordinates(shapely.get_rings(polygon), return_index=True)
    scaled = (points - corner) / cell - 0.5  # centres of cells are whole numbers
    edges = np.stack([scaled[:-1], scaled[1:]], axis=1)[ring[1:] == ring[:-1]]
    first, stop = np.clip(np.ceil(np.sort(edges[:, :, 1], axis=1)).astype(int).T, 0, rows)
    counts = stop - first
    edge = np.repeat(np.arange(len(edges)), counts)
    row = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts) + first[edge]
    (x0, y0), (x1, y1) = edges[edge].transpose(1, 2, 0)
    x = x0 + (row - y0) / (y1 - y0) * (x1 - x0)
    order = np.lexsort([x, row])
    row, cells = row[order][::2], np.maximum(np.ceil(x[order]).astype(int), 0)
    found: list[list[tuple[int, int]]] = [[] for _ in range(rows)]
    for r, begin, end in zip(row.tolist(), cells[::2].tolist(), cells[1::2].tolist(), strict=True):
        if end > begin:
            found[r].append((begin, end - begin))
    return found


class _SheetGrid:
    """The cells of a sheet that are taken: one integer per row, from below."""

    def __init__(self, usable: SheetSize, growth: float, cell: float) -> None:
        self.cell = cell
        self.extent = np.array(usable) + 2 * growth
        self.rows: list[int] = []

    def place_lowest(self, masks: Sequence[_CellMask]) -> tuple[_CellMask, Array] | None:
        """Place the mask whose upper border comes lowest, and return it with its column and row; None if none has room.

        Of equally low masks the leftmost is placed.
        """
        best: tuple[int, int, int] | None = None
        for k, mask in enumerate(masks):
            top = None if best is None else best[0]
            place = self._find_lowest_place(mask, top)
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
        """Return column and row of the lowest, then leftmost place at which a mask meets no taken cell, or None.

        Its upper border is not above the row `top`. All columns of a row are tried at once, by shifts of its bits.
        """
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
    """Return the columns (as bits) at which a run of so many cells would meet a set bit.

    Examples
    --------
    >>> bin(_smear_bits(0b1000, 3))
    '0b1110'
    """
    reach = 1
    while 2 * reach <= length:
        bits |= bits >> reach
        reach *= 2
    return bits | bits >> (length - reach)
