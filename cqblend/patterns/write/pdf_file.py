"""Drawings as PDF in true size, on paper: sheets larger than a page are tiled.

Exists because most paper models come out of a desk printer. Tiles join at crosses in their corners, each page says
where it belongs, and has a bar to measure and a legend of the lines. Must not know pieces.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

import numpy as np

from cqblend.errors import InputError, PatternWarning, shown, warn
from cqblend.patterns.checks import millimetres
from cqblend.patterns.outline.parallel_path import turned
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.write.drawing import STYLES, Drawing, Layer, free_room, with_notes
from cqblend.splines.bernstein import Array

Size = tuple[float, float]

Page = str | Size
"""A name of :data:`PAPERS`, upright or on its side as takes fewer pages, or width and height in mm as they are."""

PAPERS: dict[str, Size] = {
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

MARGIN = 10.0
"""Of pages, unless told otherwise, mm."""

BAR = 100.0
"""Length of the scale bar, mm."""

_POINT = 25.4 / 72  # mm
_FOOT = 16.0  # height of what is below the drawing, mm
_LEAST = (118.0, 40.0)  # of a tile, mm: the bar and the legend need room
_BLEED = 3.0  # how far the drawing goes on beyond the crosses, mm
_CROSS = 4.0  # from the middle of a cross to its ends, mm
_STEP = np.pi / 6  # of arcs that become cubics: their radius is right to 4e-7
_TEXT = 2.6  # size of letters, mm
_LINE = 1.5 * _TEXT
_FONT = "Vera"
_COLUMN = 32.0  # width of the legend in one column, mm


def paper(page: Page | None) -> Size | None:
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
    return millimetres("the width of the paper", page[0]), millimetres("the height of the paper", page[1])


def printable(page: Page, *, margin: float = MARGIN) -> Size:
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
    size = paper(page)
    assert size is not None
    return _tile(size, millimetres("the margin of a page", margin, zero=True))


def write_pdf(
    drawings: Sequence[Drawing],
    path: File,
    *,
    page: Page | None = "a4",
    margin: float = MARGIN,
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

    margin = millimetres("the margin of a page", margin, zero=True)
    size = paper(page)
    _embed_font()
    canvas = Canvas(str(path), invariant=1, initialFontName=_FONT)
    canvas.setTitle("cqblend pattern")
    if inside and size is None:
        drawings = [with_notes(drawing) for drawing in drawings]
        for drawing in drawings:
            _sheet(canvas, drawing)
    for number, drawing in enumerate(() if inside and size is None else drawings):
        if size is None:
            width, height = (max(pair) + 2 * margin for pair in zip(drawing.size, _LEAST, strict=True))
            tiling = _Tiling.of(drawing, (width, height + _FOOT), margin)
        else:
            ways = [size, size[::-1]] if isinstance(page, str) else [size]
            tiling = min((_Tiling.of(drawing, way, margin) for way in ways), key=lambda tiling: len(tiling.tiles))
        for tile in tiling.tiles:
            where = f"sheet {number + 1} of {len(drawings)}"
            if tiling.rows * tiling.columns > 1:
                where += f", row {tile[0] + 1} of {tiling.rows}, column {tile[1] + 1} of {tiling.columns}"
            _page(canvas, drawing, tiling, tile, where)
    notes = [note for drawing in drawings for note in drawing.notes]
    if notes:
        _notes(canvas, notes, size or PAPERS["a4"], margin)
    canvas.save()


def _tile(size: Size, margin: float) -> Size:
    """Return what margins and foot leave of a page."""
    width, height = size[0] - 2 * margin, size[1] - 2 * margin - _FOOT
    if width < _LEAST[0] or height < _LEAST[1]:
        least = [side + 2 * margin + foot for side, foot in zip(_LEAST, (0.0, _FOOT), strict=True)]
        raise InputError(
            f"a page of {size[0]:g} x {size[1]:g} mm is too small for the scale bar and the legend "
            f"within margins of {margin:g} mm: take at least {least[0]:g} x {least[1]:g} mm"
        )
    return width, height


@dataclass(frozen=True, slots=True)
class _Tiling:
    """How a drawing is cut into pages: sizes, and the tiles (row from above, column) that are used."""

    page: Size
    margin: float
    tile: Size
    rows: int
    columns: int
    tiles: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, drawing: Drawing, page: Size, margin: float) -> "_Tiling":
        """Return the tiling of a drawing on pages."""
        tile = _tile(page, margin)
        columns, rows = (max(int(np.ceil(s / t - 1e-9)), 1) for s, t in zip(drawing.size, tile, strict=True))
        tiling = cls(page, margin, tile, rows, columns, ())
        boxes = np.array([_box(entity.path) for entity in drawing.entities]).reshape(-1, 4)
        used = []
        for row in range(rows):
            for column in range(columns):
                low = tiling.corner((row, column))
                if ((boxes[:, :2] <= low + tile) & (boxes[:, 2:] >= low)).all(axis=1).any():
                    used.append((row, column))
        return cls(page, margin, tile, rows, columns, tuple(used) or ((0, 0),))

    def corner(self, tile: tuple[int, int]) -> Array:
        """Return the lower left corner of a tile in the drawing; the lowest row begins at 0."""
        return np.array([tile[1] * self.tile[0], (self.rows - 1 - tile[0]) * self.tile[1]])


def _box(path: Path) -> Array:
    """Return the least and the greatest coordinates of a path, and a little more."""
    points = path.sampled(0.1)
    return np.concatenate([points.min(axis=0) - 0.1, points.max(axis=0) + 0.1])


def _embed_font() -> None:
    """Make known the font whose letters are embedded: print shops refuse files that lack theirs."""
    from reportlab.pdfbase.pdfmetrics import getRegisteredFontNames, registerFont
    from reportlab.pdfbase.ttfonts import TTFont

    if _FONT not in getRegisteredFontNames():
        registerFont(TTFont(_FONT, "Vera.ttf"))  # comes with reportlab


def _sheet(canvas: Any, drawing: Drawing) -> None:
    """Draw a sheet as one page without margins, the legend where it is free."""
    _start(canvas, drawing.size)
    for layer in Layer:
        _pen(canvas, layer)
        for path in drawing.on(layer):
            canvas.drawPath(_drawn(canvas.beginPath(), path), stroke=1, fill=0)
    _black(canvas)
    canvas.setFont(_FONT, _TEXT)
    if (corner := free_room(drawing, (_LEAST[0], _FOOT))) is not None:
        _foot(canvas, corner, "")
    elif (corner := free_room(drawing, (_COLUMN, _LINE * len(Layer)))) is not None:
        for row, layer in enumerate(Layer):
            _meaning(canvas, layer, *(corner + np.array([0.0, row * _LINE])))
    else:
        warn(PatternWarning(f"a sheet of {drawing.size[0]:g} x {drawing.size[1]:g} mm has no room for the legend"))
    canvas.showPage()


def _meaning(canvas: Any, layer: Layer, x: float, y: float) -> float:
    """Write what a layer means beside a line of its kind; return how far that reaches."""
    _pen(canvas, layer)
    canvas.line(x, y + _TEXT / 3, x + 8.0, y + _TEXT / 3)
    canvas.drawString(x + 9.0, y, STYLES[layer].meaning)
    return x + 9.0 + float(canvas.stringWidth(STYLES[layer].meaning, _FONT, _TEXT))


def _page(canvas: Any, drawing: Drawing, tiling: _Tiling, tile: tuple[int, int], where: str) -> None:
    """Draw one page, and begin the next."""
    _start(canvas, tiling.page)
    origin = np.array([tiling.margin, tiling.margin + _FOOT])
    tiled = tiling.rows * tiling.columns > 1
    bleed = min(_BLEED, tiling.margin) if tiled else tiling.margin
    canvas.saveState()
    clip = canvas.beginPath()
    clip.rect(*(origin - bleed), *(np.array(tiling.tile) + 2 * bleed))
    canvas.clipPath(clip, stroke=0, fill=0)
    low = tiling.corner(tile)
    canvas.translate(*(origin - low))
    for layer in Layer:
        _pen(canvas, layer)
        for path in drawing.on(layer):
            box = _box(path)
            if (box[:2] <= low + tiling.tile + bleed).all() and (box[2:] >= low - bleed).all():
                canvas.drawPath(_drawn(canvas.beginPath(), path), stroke=1, fill=0)
    canvas.restoreState()
    if tiled:
        _black(canvas)
        for x, y in (origin + np.array(tiling.tile) * corner for corner in ((0, 0), (1, 0), (0, 1), (1, 1))):
            canvas.line(x - _CROSS, y, x + _CROSS, y)
            canvas.line(x, y - _CROSS, x, y + _CROSS)
    _foot(canvas, np.full(2, tiling.margin), where)
    canvas.showPage()


def _start(canvas: Any, page: Size) -> None:
    """Begin a page; from now on lengths are in mm."""
    canvas.setPageSize((page[0] / _POINT, page[1] / _POINT))
    canvas.scale(1 / _POINT, 1 / _POINT)


def _pen(canvas: Any, layer: Layer) -> None:
    style = STYLES[layer]
    canvas.setStrokeColorRGB(*(part / 255 for part in style.colour))
    canvas.setLineWidth(style.width)
    canvas.setDash(list(style.dashes))


def _black(canvas: Any) -> None:
    canvas.setStrokeColorRGB(0, 0, 0)
    canvas.setLineWidth(0.1)
    canvas.setDash([])


def _drawn(pen: Any, path: Path) -> Any:
    """Return reportlab's path of a path: lines, and cubics for arcs."""
    pen.moveTo(*path.points[0])
    for command in _cubics(path):
        if len(command) == 1:
            pen.lineTo(*command[0])
        else:
            pen.curveTo(*command.ravel())
    if path.closed:
        pen.close()
    return pen


def _cubics(path: Path) -> Iterator[Array]:
    """Yield the ends (1, 2) of straight segments, and the last three poles (3, 2) of cubics for arcs.

    The handles of an arc over a chord d with the half angle h are as long as d / (3 cos(h / 2)^2).
    """
    for k, bulge in enumerate(path.bulges):
        if bulge == 0:
            yield path.points[k + 1 : k + 2]
            continue
        angle = 4 * np.arctan(bulge)
        count = max(int(np.ceil(abs(angle) / _STEP)), 1)
        points = path.at(np.full(count + 1, k), np.arange(count + 1) / count)
        points[-1] = path.points[k + 1]
        half = angle / count / 2
        handles = np.diff(points, axis=0) / (3 * np.cos(half / 2) ** 2)
        first, second = points[:-1] + turned(handles, -half), points[1:] - turned(handles, half)
        yield from np.stack([first, second, points[1:]], axis=1)


def _foot(canvas: Any, corner: Array, where: str) -> None:
    """Draw the scale bar, the legend, and where the page belongs, from a lower left corner on."""
    _black(canvas)
    canvas.setFont(_FONT, _TEXT)
    x, y = corner.tolist()
    bar = y + _LINE + 2.0
    canvas.line(x, bar, x + BAR, bar)
    for tick in range(11):
        canvas.line(x + tick * BAR / 10, bar, x + tick * BAR / 10, bar + (2.0 if tick % 5 == 0 else 1.0))
    canvas.drawString(x, bar + 3.0, f"{BAR:g} mm: print at 100 %, then measure    {where}")
    for layer in Layer:
        x = _meaning(canvas, layer, x, y) + 2.0


def _notes(canvas: Any, notes: Sequence[str], page: Size, margin: float) -> None:
    """Write the labels for which there was no room on their pieces."""
    heading = "Labels without room on their pieces (piece: seams)"
    lines = max(int((page[1] - 2 * margin) / _LINE) - 2, 1)
    for start in range(0, len(notes), lines):
        _start(canvas, page)
        canvas.setFont(_FONT, _TEXT)
        for k, note in enumerate([heading, "", *notes[start : start + lines]]):
            canvas.drawString(margin, page[1] - margin - (k + 1) * _LINE, note)
        canvas.showPage()
