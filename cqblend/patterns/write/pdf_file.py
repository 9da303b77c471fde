"""Drawings as PDF in true size, on paper: sheets larger than a page are tiled.

Exists because most paper models come out of a desk printer. Tiles join at crosses in their corners, each page says
where it belongs, and has a bar to measure and a legend of the lines. Must not know pieces.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

import numpy as np

from cqblend.checks import check_millimetres
from cqblend.errors import InputError, PatternWarning, shown, warn
from cqblend.patterns.outline.parallel_path import rotate_vectors
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.write.drawing import STYLES, Drawing, Layer, find_free_corner, write_notes
from cqblend.splines.bernstein import Array

PaperSize = tuple[float, float]

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

PAGE_MARGIN = 10.0
"""Of pages, unless told otherwise, mm."""

SCALE_BAR_LENGTH = 100.0
"""Length of the scale bar, mm."""

_MM_PER_POINT = 25.4 / 72  # mm
_FOOTER_HEIGHT = 16.0  # height of what is below the drawing, mm
_LEAST_TILE = (118.0, 40.0)  # of a tile, mm: the bar and the legend need room
_BLEED = 3.0  # how far the drawing goes on beyond the crosses, mm
_CROSS_ARM = 4.0  # from the middle of a cross to its ends, mm
_CUBIC_ANGLE = np.pi / 6  # of arcs that become cubics: their radius is right to 4e-7
_TEXT_SIZE = 2.6  # size of letters, mm
_LINE_HEIGHT = 1.5 * _TEXT_SIZE
_FONT = "Vera"
_LEGEND_WIDTH = 32.0  # width of the legend in one column, mm


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


def find_printable_size(page: PaperFormat, *, margin: float = PAGE_MARGIN) -> PaperSize:
    """Return the largest sheet, mm, that goes on one page.

    Raises
    ------
    InputError
        If the paper is unknown, or its margins leave too little.

    Examples
    --------
    >>> printable("a4")
    (190.0, 261.0)
    """
    size = resolve_paper_size(page)
    assert size is not None
    return _compute_tile_size(size, check_millimetres("the margin of a page", margin, zero=True))


def write_pdf(
    drawings: Sequence[Drawing],
    path: File,
    *,
    page: PaperFormat | None = "a4",
    margin: float = PAGE_MARGIN,
    inside: bool = False,
) -> None:
    """Write drawings, in true size, each beginning on a new page. Pages on which nothing would be are left out.

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
    inside
        Whether pages as large as the sheets are have no margin, and the legend where the sheet is free.

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
    canvas = Canvas(str(path), invariant=1, initialFontName=_FONT)
    canvas.setTitle("cqblend pattern")
    if inside and size is None:
        drawings = [write_notes(drawing) for drawing in drawings]
        for drawing in drawings:
            _draw_whole_sheet(canvas, drawing)
    for number, drawing in enumerate(() if inside and size is None else drawings):
        if size is None:
            width, height = (max(pair) + 2 * margin for pair in zip(drawing.size, _LEAST_TILE, strict=True))
            tiling = _PageTiling.from_drawing(drawing, (width, height + _FOOTER_HEIGHT), margin)
        else:
            ways = [size, size[::-1]] if isinstance(page, str) else [size]
            tiling = min(
                (_PageTiling.from_drawing(drawing, way, margin) for way in ways), key=lambda tiling: len(tiling.tiles)
            )
        for tile in tiling.tiles:
            where = f"sheet {number + 1} of {len(drawings)}"
            if tiling.rows * tiling.columns > 1:
                where += f", row {tile[0] + 1} of {tiling.rows}, column {tile[1] + 1} of {tiling.columns}"
            _draw_tile_page(canvas, drawing, tiling, tile, where)
    notes = [note for drawing in drawings for note in drawing.notes]
    if notes:
        _draw_note_pages(canvas, notes, size or PAPERS["a4"], margin)
    canvas.save()


def _compute_tile_size(size: PaperSize, margin: float) -> PaperSize:
    """Return what margins and foot leave of a page."""
    width, height = size[0] - 2 * margin, size[1] - 2 * margin - _FOOTER_HEIGHT
    if width < _LEAST_TILE[0] or height < _LEAST_TILE[1]:
        least = [side + 2 * margin + foot for side, foot in zip(_LEAST_TILE, (0.0, _FOOTER_HEIGHT), strict=True)]
        raise InputError(
            f"a page of {size[0]:g} x {size[1]:g} mm is too small for the scale bar and the legend "
            f"within margins of {margin:g} mm: take at least {least[0]:g} x {least[1]:g} mm"
        )
    return width, height


@dataclass(frozen=True, slots=True)
class _PageTiling:
    """How a drawing is cut into pages: sizes, and the tiles (row from above, column) that are used."""

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
    """Return the least and the greatest coordinates of a path, and a little more."""
    points = path.sampled(0.1)
    return np.concatenate([points.min(axis=0) - 0.1, points.max(axis=0) + 0.1])


def _embed_font() -> None:
    """Make known the font whose letters are embedded: print shops refuse files that lack theirs."""
    from reportlab.pdfbase.pdfmetrics import getRegisteredFontNames, registerFont
    from reportlab.pdfbase.ttfonts import TTFont

    if _FONT not in getRegisteredFontNames():
        registerFont(TTFont(_FONT, "Vera.ttf"))  # comes with reportlab


def _draw_whole_sheet(canvas: Any, drawing: Drawing) -> None:
    """Draw a sheet as one page without margins, the legend where it is free."""
    _begin_page(canvas, drawing.size)
    for layer in Layer:
        _set_layer_pen(canvas, layer)
        for path in drawing.paths_on(layer):
            canvas.drawPath(_append_path(canvas.beginPath(), path), stroke=1, fill=0)
    _set_black_pen(canvas)
    canvas.setFont(_FONT, _TEXT_SIZE)
    if (corner := find_free_corner(drawing, (_LEAST_TILE[0], _FOOTER_HEIGHT))) is not None:
        _draw_footer(canvas, corner, "")
    elif (corner := find_free_corner(drawing, (_LEGEND_WIDTH, _LINE_HEIGHT * len(Layer)))) is not None:
        for row, layer in enumerate(Layer):
            _draw_legend_entry(canvas, layer, *(corner + np.array([0.0, row * _LINE_HEIGHT])))
    else:
        warn(PatternWarning(f"a sheet of {drawing.size[0]:g} x {drawing.size[1]:g} mm has no room for the legend"))
    canvas.showPage()


def _draw_legend_entry(canvas: Any, layer: Layer, x: float, y: float) -> float:
    """Write what a layer means beside a line of its kind; return how far that reaches."""
    _set_layer_pen(canvas, layer)
    canvas.line(x, y + _TEXT_SIZE / 3, x + 8.0, y + _TEXT_SIZE / 3)
    canvas.drawString(x + 9.0, y, STYLES[layer].meaning)
    return x + 9.0 + float(canvas.stringWidth(STYLES[layer].meaning, _FONT, _TEXT_SIZE))


def _draw_tile_page(canvas: Any, drawing: Drawing, tiling: _PageTiling, tile: tuple[int, int], where: str) -> None:
    """Draw one page, and begin the next."""
    _begin_page(canvas, tiling.page)
    origin = np.array([tiling.margin, tiling.margin + _FOOTER_HEIGHT])
    tiled = tiling.rows * tiling.columns > 1
    bleed = min(_BLEED, tiling.margin) if tiled else tiling.margin
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
            canvas.line(x - _CROSS_ARM, y, x + _CROSS_ARM, y)
            canvas.line(x, y - _CROSS_ARM, x, y + _CROSS_ARM)
    _draw_footer(canvas, np.full(2, tiling.margin), where)
    canvas.showPage()


def _begin_page(canvas: Any, page: PaperSize) -> None:
    """Begin a page; from now on lengths are in mm."""
    canvas.setPageSize((page[0] / _MM_PER_POINT, page[1] / _MM_PER_POINT))
    canvas.scale(1 / _MM_PER_POINT, 1 / _MM_PER_POINT)


def _set_layer_pen(canvas: Any, layer: Layer) -> None:
    style = STYLES[layer]
    canvas.setStrokeColorRGB(*(part / 255 for part in style.colour))
    canvas.setLineWidth(style.width)
    canvas.setDash(list(style.dashes))


def _set_black_pen(canvas: Any) -> None:
    canvas.setStrokeColorRGB(0, 0, 0)
    canvas.setLineWidth(0.1)
    canvas.setDash([])


def _append_path(pen: Any, path: Path) -> Any:
    """Return reportlab's path of a path: lines, and cubics for arcs."""
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
        count = max(int(np.ceil(abs(angle) / _CUBIC_ANGLE)), 1)
        points = path.at(np.full(count + 1, k), np.arange(count + 1) / count)
        points[-1] = path.points[k + 1]
        half = angle / count / 2
        handles = np.diff(points, axis=0) / (3 * np.cos(half / 2) ** 2)
        first, second = points[:-1] + rotate_vectors(handles, -half), points[1:] - rotate_vectors(handles, half)
        yield from np.stack([first, second, points[1:]], axis=1)


def _draw_footer(canvas: Any, corner: Array, where: str) -> None:
    """Draw the scale bar, the legend, and where the page belongs, from a lower left corner on."""
    _set_black_pen(canvas)
    canvas.setFont(_FONT, _TEXT_SIZE)
    x, y = corner.tolist()
    bar = y + _LINE_HEIGHT + 2.0
    canvas.line(x, bar, x + SCALE_BAR_LENGTH, bar)
    for tick in range(11):
        canvas.line(
            x + tick * SCALE_BAR_LENGTH / 10,
            bar,
            x + tick * SCALE_BAR_LENGTH / 10,
            bar + (2.0 if tick % 5 == 0 else 1.0),
        )
    canvas.drawString(x, bar + 3.0, f"{SCALE_BAR_LENGTH:g} mm: print at 100 %, then measure    {where}")
    for layer in Layer:
        x = _draw_legend_entry(canvas, layer, x, y) + 2.0


def _draw_note_pages(canvas: Any, notes: Sequence[str], page: PaperSize, margin: float) -> None:
    """Write the labels for which there was no room on their pieces."""
    heading = "Labels without room on their pieces (piece: seams)"
    lines = max(int((page[1] - 2 * margin) / _LINE_HEIGHT) - 2, 1)
    for start in range(0, len(notes), lines):
        _begin_page(canvas, page)
        canvas.setFont(_FONT, _TEXT_SIZE)
        for k, note in enumerate([heading, "", *notes[start : start + lines]]):
            canvas.drawString(margin, page[1] - margin - (k + 1) * _LINE_HEIGHT, note)
        canvas.showPage()
