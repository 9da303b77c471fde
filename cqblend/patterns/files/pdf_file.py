"""Writes drawings as PDF in true size, on paper: sheets larger than a page are tiled, since most printers are small.

Tiles join at crosses in their corners; each page has a caption with its row and column, a bar to measure and a legend
of the lines. Depends on drawings only.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

import numpy as np

from cqblend.argument_checks import check_millimetres
from cqblend.errors import InputError, PatternWarning, shown, warn
from cqblend.patterns.files.drawing import STYLES, Drawing, Layer, find_free_corner, write_notes
from cqblend.patterns.files.page_dimensions import DRAWING_LAYOUT, PAGE_LAYOUT
from cqblend.patterns.outline.path_by_length import rotate_vectors
from cqblend.patterns.outline.plane_path import Path
from cqblend.splines.bernstein import Array

PaperSize = tuple[float, float]
"""Width and height, mm."""

PaperFormat = str | PaperSize
"""A name of :data:`PAPERS`, upright or on its side as takes fewer pages, or width and height in mm as they are."""

PAPERS: dict[str, PaperSize] = {
    "a0": (841.0, 1189.0),
    "a1": (594.0, 841.0),
    "a2": (420.0, 594.0),
    "a3": (297.0, 420.0),
    "a4": (210.0, 297.0),
    "a5": (148.0, 210.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
    "tabloid": (279.4, 431.8),
}
"""Width and height of papers, upright, mm."""


def resolve_paper_size(page: PaperFormat | None) -> PaperSize | None:
    """Return width and height of paper in mm, upright if it has a name; None stays None.

    Raises
    ------
    InputError
        If there is no paper of that name, or it is not a pair of positive numbers.
    """
    if page is None:
        return None
    if isinstance(page, str):
        if page.lower() not in PAPERS:
            raise InputError(f"paper is one of {', '.join(PAPERS)}, or a width and a height in mm, not {shown(page)}")
        return PAPERS[page.lower()]
    if not isinstance(page, Sequence) or len(page) != 2:
        raise InputError(f"paper has a width and a height in mm, or a name as 'a4', not {shown(page)}")
    return check_millimetres("the width of the paper", page[0]), check_millimetres("the height of the paper", page[1])


def write_pdf(
    drawings: Sequence[Drawing],
    path: File,
    *,
    page: PaperFormat | None = "a4",
    margin: float = PAGE_LAYOUT.margin,
    page_is_sheet: bool = False,
) -> None:
    """Write drawings in true size, each beginning on a new page. Pages on which nothing would be are left out.

    Parameters
    ----------
    drawings
        One for each sheet.
    path
        Of the file. The same drawings give the same file, byte for byte, with the same version of reportlab.
    page
        Paper. None takes pages as large as the sheets are.
    margin
        Of the pages, mm.
    page_is_sheet
        Whether pages as large as the sheets are exactly the sheets, without margins, with the legend where the sheet is
        free.

    Raises
    ------
    InputError
        If the paper is unknown, or its margins leave too little.

    Warns
    -----
    PatternWarning
        There is no room for the legend inside a sheet.
    """
    from reportlab.pdfgen.canvas import Canvas

    margin = check_millimetres("the margin of a page", margin, zero=True)
    size = resolve_paper_size(page)
    _embed_font()
    canvas = Canvas(str(path), invariant=1, initialFontName=PAGE_LAYOUT.font)
    canvas.setTitle("cqblend pattern")
    if page_is_sheet and size is None:
        drawings = [write_notes(drawing) for drawing in drawings]
        for drawing in drawings:
            _draw_whole_sheet(canvas, drawing)
    for number, drawing in enumerate(() if page_is_sheet and size is None else drawings):
        if size is None:
            width, height = (max(pair) + 2 * margin for pair in zip(drawing.size, PAGE_LAYOUT.least_tile, strict=True))
            tiling = _PageTiling.from_drawing(drawing, (width, height + PAGE_LAYOUT.footer_height), margin)
        else:
            formats = [size, size[::-1]] if isinstance(page, str) else [size]
            tilings = [_PageTiling.from_drawing(drawing, one, margin) for one in formats]
            tiling = min(tilings, key=lambda tiling: len(tiling.tiles))
        for tile in tiling.tiles:
            caption = f"sheet {number + 1} of {len(drawings)}"
            if tiling.rows * tiling.columns > 1:
                caption += f", row {tile[0] + 1} of {tiling.rows}, column {tile[1] + 1} of {tiling.columns}"
            _draw_tile_page(canvas, drawing, tiling, tile, caption)
    notes = [note for drawing in drawings for note in drawing.notes]
    if notes:
        _draw_note_pages(canvas, notes, size or PAPERS["a4"], margin)
    canvas.save()


def _compute_tile_size(size: PaperSize, margin: float) -> PaperSize:
    """Return the width and height, mm, that margins and footer leave of a page.

    Raises
    ------
    InputError
        If that is less than the scale bar and the legend need.
    """
    footer, least_tile = PAGE_LAYOUT.footer_height, PAGE_LAYOUT.least_tile
    width, height = size[0] - 2 * margin, size[1] - 2 * margin - footer
    if width < least_tile[0] or height < least_tile[1]:
        least = [side + 2 * margin + foot for side, foot in zip(least_tile, (0.0, footer), strict=True)]
        raise InputError(
            f"a page of {size[0]:g} x {size[1]:g} mm is too small for the scale bar and the legend "
            f"within margins of {margin:g} mm: take at least {least[0]:g} x {least[1]:g} mm"
        )
    return width, height


@dataclass(frozen=True, slots=True)
class _PageTiling:
    """How a drawing is divided into tiles, one a page.

    Attributes
    ----------
    page, tile
        Width and height of a page, and of the tile on it, mm.
    margin
        Of the pages, mm.
    rows, columns
        Numbers of tiles in both directions.
    tiles
        (row from above, column) of those on which anything is drawn.
    """

    page: PaperSize
    margin: float
    tile: PaperSize
    rows: int
    columns: int
    tiles: tuple[tuple[int, int], ...]

    @classmethod
    def from_drawing(cls, drawing: Drawing, page: PaperSize, margin: float) -> "_PageTiling":
        """Return the tiling of a drawing on pages."""
        tile = _compute_tile_size(page, margin)
        columns, rows = (max(int(np.ceil(s / t - 1e-9)), 1) for s, t in zip(drawing.size, tile, strict=True))
        tiling = cls(page, margin, tile, rows, columns, ())
        boxes = np.array([_bounding_box(entity.path) for entity in drawing.entities]).reshape(-1, 4)
        used = []
        for row in range(rows):
            for column in range(columns):
                low = tiling.corner_of((row, column))
                if ((boxes[:, :2] <= low + tile) & (boxes[:, 2:] >= low)).all(axis=1).any():
                    used.append((row, column))
        return cls(page, margin, tile, rows, columns, tuple(used) or ((0, 0),))

    def corner_of(self, tile: tuple[int, int]) -> Array:
        """Return the lower left corner of a tile in the drawing; the lowest row begins at 0."""
        return np.array([tile[1] * self.tile[0], (self.rows - 1 - tile[0]) * self.tile[1]])


def _bounding_box(path: Path) -> Array:
    """Return (x0, y0, x1, y1) of a box that holds a path, to a tolerance."""
    tolerance = DRAWING_LAYOUT.box_tolerance
    points = path.sampled(tolerance)
    return np.concatenate([points.min(axis=0) - tolerance, points.max(axis=0) + tolerance])


def _embed_font() -> None:
    """Register the font whose letters are embedded: print shops refuse files without their fonts."""
    from reportlab.pdfbase.pdfmetrics import getRegisteredFontNames, registerFont
    from reportlab.pdfbase.ttfonts import TTFont

    if PAGE_LAYOUT.font not in getRegisteredFontNames():
        registerFont(TTFont(PAGE_LAYOUT.font, f"{PAGE_LAYOUT.font}.ttf"))  # comes with reportlab


def _draw_whole_sheet(canvas: Any, drawing: Drawing) -> None:
    """Draw a sheet as one page without margins, the scale bar and the legend where it is free."""
    _begin_page(canvas, drawing.size)
    for layer in Layer:
        _set_layer_pen(canvas, layer)
        for path in drawing.paths_on(layer):
            canvas.drawPath(_append_path(canvas.beginPath(), path), stroke=1, fill=0)
    _set_black_pen(canvas)
    canvas.setFont(PAGE_LAYOUT.font, PAGE_LAYOUT.text_size)
    footer = (PAGE_LAYOUT.least_tile[0], PAGE_LAYOUT.footer_height)
    column = (PAGE_LAYOUT.legend_width, PAGE_LAYOUT.line_height * len(Layer))
    if (corner := find_free_corner(drawing, footer)) is not None:
        _draw_footer(canvas, corner, "")
    elif (corner := find_free_corner(drawing, column)) is not None:
        for row, layer in enumerate(Layer):
            _draw_legend_entry(canvas, layer, *(corner + np.array([0.0, row * PAGE_LAYOUT.line_height])))
    else:
        warn(PatternWarning(f"a sheet of {drawing.size[0]:g} x {drawing.size[1]:g} mm has no room for the legend"))
    canvas.showPage()


def _draw_legend_entry(canvas: Any, layer: Layer, x: float, y: float) -> float:
    """Draw a line of a layer and write its meaning beside it; return the x coordinate of the end of the text."""
    _set_layer_pen(canvas, layer)
    level = y + PAGE_LAYOUT.text_size / 3
    canvas.line(x, level, x + PAGE_LAYOUT.legend_line, level)
    start = x + (PAGE_LAYOUT.legend_line + PAGE_LAYOUT.legend_gap)
    canvas.drawString(start, y, STYLES[layer].meaning)
    return start + float(canvas.stringWidth(STYLES[layer].meaning, PAGE_LAYOUT.font, PAGE_LAYOUT.text_size))


def _draw_tile_page(canvas: Any, drawing: Drawing, tiling: _PageTiling, tile: tuple[int, int], caption: str) -> None:
    """Draw a page with one tile (row, column) of a drawing."""
    _begin_page(canvas, tiling.page)
    origin = np.array([tiling.margin, tiling.margin + PAGE_LAYOUT.footer_height])
    tiled = tiling.rows * tiling.columns > 1
    bleed = min(PAGE_LAYOUT.bleed, tiling.margin) if tiled else tiling.margin
    canvas.saveState()
    clip = canvas.beginPath()
    clip.rect(*(origin - bleed), *(np.array(tiling.tile) + 2 * bleed))
    canvas.clipPath(clip, stroke=0, fill=0)
    low = tiling.corner_of(tile)
    canvas.translate(*(origin - low))
    for layer in Layer:
        _set_layer_pen(canvas, layer)
        for path in drawing.paths_on(layer):
            box = _bounding_box(path)
            if (box[:2] <= low + tiling.tile + bleed).all() and (box[2:] >= low - bleed).all():
                canvas.drawPath(_append_path(canvas.beginPath(), path), stroke=1, fill=0)
    canvas.restoreState()
    if tiled:
        _set_black_pen(canvas)
        for x, y in (origin + np.array(tiling.tile) * corner for corner in ((0, 0), (1, 0), (0, 1), (1, 1))):
            canvas.line(x - PAGE_LAYOUT.cross_arm, y, x + PAGE_LAYOUT.cross_arm, y)
            canvas.line(x, y - PAGE_LAYOUT.cross_arm, x, y + PAGE_LAYOUT.cross_arm)
    _draw_footer(canvas, np.full(2, tiling.margin), caption)
    canvas.showPage()


def _begin_page(canvas: Any, page: PaperSize) -> None:
    """Begin a page of given size, and set the unit of lengths on it to mm."""
    canvas.setPageSize((page[0] / PAGE_LAYOUT.mm_per_point, page[1] / PAGE_LAYOUT.mm_per_point))
    canvas.scale(1 / PAGE_LAYOUT.mm_per_point, 1 / PAGE_LAYOUT.mm_per_point)


def _set_layer_pen(canvas: Any, layer: Layer) -> None:
    style = STYLES[layer]
    canvas.setStrokeColorRGB(*(part / 255 for part in style.colour))
    canvas.setLineWidth(style.width)
    canvas.setDash(list(style.dashes))


def _set_black_pen(canvas: Any) -> None:
    canvas.setStrokeColorRGB(0, 0, 0)
    canvas.setLineWidth(PAGE_LAYOUT.line_width)
    canvas.setDash([])


def _append_path(pen: Any, path: Path) -> Any:
    """Append a path to a path object of reportlab, arcs as cubics, and return that."""
    pen.moveTo(*path.points[0])
    for command in _convert_to_cubics(path):
        if len(command) == 1:
            pen.lineTo(*command[0])
        else:
            pen.curveTo(*command.ravel())
    if path.closed:
        pen.close()
    return pen


def _convert_to_cubics(path: Path) -> Iterator[Array]:
    """Yield the ends (1, 2) of straight segments, and the last three poles (3, 2) of cubics for arcs.

    The handles of an arc over a chord d with the half angle h are as long as d / (3 cos(h / 2)^2).
    """
    for k, bulge in enumerate(path.bulges):
        if bulge == 0:
            yield path.points[k + 1 : k + 2]
            continue
        angle = 4 * np.arctan(bulge)
        count = max(int(np.ceil(abs(angle) / PAGE_LAYOUT.cubic_angle)), 1)
        points = path.at(np.full(count + 1, k), np.arange(count + 1) / count)
        points[-1] = path.points[k + 1]
        half = angle / count / 2
        handles = np.diff(points, axis=0) / (3 * np.cos(half / 2) ** 2)
        first, second = points[:-1] + rotate_vectors(handles, -half), points[1:] - rotate_vectors(handles, half)
        yield from np.stack([first, second, points[1:]], axis=1)


def _draw_footer(canvas: Any, corner: Array, caption: str) -> None:
    """Draw the scale bar, the caption of the page and the legend, from a lower left corner (2,) on."""
    _set_black_pen(canvas)
    canvas.setFont(PAGE_LAYOUT.font, PAGE_LAYOUT.text_size)
    x, y = corner.tolist()
    length, parts = PAGE_LAYOUT.scale_bar_length, PAGE_LAYOUT.scale_bar_parts
    bar = y + PAGE_LAYOUT.line_height + 2.0
    canvas.line(x, bar, x + length, bar)
    for k in range(parts + 1):
        tick = PAGE_LAYOUT.long_tick if k % (parts // 2) == 0 else PAGE_LAYOUT.short_tick
        canvas.line(x + k * length / parts, bar, x + k * length / parts, bar + tick)
    canvas.drawString(x, bar + 3.0, f"{length:g} mm: print at 100 %, then measure    {caption}")
    for layer in Layer:
        x = _draw_legend_entry(canvas, layer, x, y) + 2.0


def _draw_note_pages(canvas: Any, notes: Sequence[str], page: PaperSize, margin: float) -> None:
    """Write the labels for which there is no room on their pieces, as pages of text."""
    heading = "Labels without room on their pieces (piece: seams)"
    lines = max(int((page[1] - 2 * margin) / PAGE_LAYOUT.line_height) - 2, 1)
    for start in range(0, len(notes), lines):
        _begin_page(canvas, page)
        canvas.setFont(PAGE_LAYOUT.font, PAGE_LAYOUT.text_size)
        for k, note in enumerate([heading, "", *notes[start : start + lines]]):
            canvas.drawString(margin, page[1] - margin - (k + 1) * PAGE_LAYOUT.line_height, note)
        canvas.showPage()
