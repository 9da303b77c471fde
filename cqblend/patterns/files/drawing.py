"""Drawings of sheets: paths on layers for cutting, scoring, engraving and guidance, the same for all file formats.

Writers convert entities to their format and decide nothing. Lengths are in mm, the origin is the lower left corner of
the sheet. Depends on sheets of placed pieces, not on file formats.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import shapely

from cqblend.argument_checks import check_millimetres
from cqblend.errors import PatternWarning, VerificationError, warn
from cqblend.patterns.files.page_dimensions import DRAWING_LAYOUT
from cqblend.patterns.outline.arc_fit import fit_arcs
from cqblend.patterns.outline.overlap import find_winding_errors
from cqblend.patterns.outline.pieces import Piece, Seam, close_loop
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.kerf import compensate_kerf
from cqblend.patterns.stock.labels import place_labels
from cqblend.patterns.stock.sheets import Sheets
from cqblend.patterns.stock.stock_proportions import LABEL_LIMITS
from cqblend.patterns.stock.stroke_font import make_text_strokes, measure_text_width
from cqblend.splines.bernstein import Array

TRIED_NOTE_HEIGHTS = (LABEL_LIMITS.height, 3.0, 2.0, 1.5, 1.0)
"""Heights of capitals that are tried for notes, mm."""


class Layer(StrEnum):
    """The operation along a path."""

    CUT = "CUT"
    SCORE_MOUNTAIN = "SCORE_MOUNTAIN"
    SCORE_VALLEY = "SCORE_VALLEY"
    ENGRAVE = "ENGRAVE"
    GUIDE = "GUIDE"


@dataclass(frozen=True, slots=True)
class LayerStyle:
    """How the lines of a layer are drawn.

    Attributes
    ----------
    colour
        Red, green, blue, 0 to 255.
    aci
        The colour as an index of AutoCAD's palette (AutoCAD Color Index).
    dashes
        Lengths of strokes and gaps in turn, mm; none is continuous.
    width
        Of the line on paper, mm.
    meaning
        Text for the legend.
    """

    colour: tuple[int, int, int]
    aci: int
    dashes: tuple[float, ...]
    width: float
    meaning: str


STYLES = {
    Layer.CUT: LayerStyle((255, 0, 0), 1, (), 0.25, "cut"),
    Layer.SCORE_MOUNTAIN: LayerStyle((0, 0, 255), 5, (3.0, 1.5), 0.2, "fold: mountain"),
    Layer.SCORE_VALLEY: LayerStyle((0, 128, 0), 94, (3.0, 1.0, 0.3, 1.0), 0.2, "fold: valley"),
    Layer.ENGRAVE: LayerStyle((0, 0, 0), 7, (), 0.15, "engrave"),
    Layer.GUIDE: LayerStyle((128, 128, 128), 8, (0.5, 1.0), 0.1, "guide"),
}
"""Style of each layer; mountains are dashed and valleys dash-dotted, as in origami."""


@dataclass(frozen=True, slots=True, eq=False)
class Entity:
    """A path on a layer."""

    layer: Layer
    path: Path


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """The drawing of one sheet.

    Attributes
    ----------
    size
        Width and height, mm.
    entities
        In the order in which they are cut: labels, scores, holes, and the outer outline last, piece by piece.
    notes
        Lines of text: labels for which there is no room on their pieces.
    stretch
        Largest relative change in length of a run by the fitting of arcs.
    """

    size: tuple[float, float]
    entities: tuple[Entity, ...]
    notes: tuple[str, ...] = ()
    stretch: float = 0.0

    def paths_on(self, layer: Layer) -> tuple[Path, ...]:
        """Return the paths on a layer."""
        return tuple(entity.path for entity in self.entities if entity.layer == layer)


def draw_sheets(
    sheets: Sheets,
    *,
    kerf: float = 0.0,
    arc_tolerance: float = DRAWING_LAYOUT.arc_tolerance,
    label_height: float | None = LABEL_LIMITS.height,
) -> tuple[Drawing, ...]:
    """Return the drawings of sheets.

    Parameters
    ----------
    sheets
        Pieces at their places.
    kerf
        Width of what the cutter takes away, mm. Unless it is 0, outlines on CUT are moved outwards by half of it, holes
        inwards, and the outline of the piece itself is on GUIDE.
    arc_tolerance
        How far the arcs that replace chains of short segments may be from them, mm; 0 keeps all segments. Corners and
        the ends of seams stay.
    label_height
        Height of the capitals of labels, mm; None draws none.

    Returns
    -------
    tuple of Drawing
        One for each sheet. Outlines are closed and ordered, outer ones counterclockwise, holes clockwise, each once.

    Raises
    ------
    InputError
        If a length is negative or not a number.
    SizeError
        If a hole or a slit is narrower than the kerf.
    VerificationError
        If a line along which is cut crosses itself.
    """
    kerf = check_millimetres("the kerf", kerf, zero=True)
    arc_tolerance = check_millimetres("the tolerance of fitted arcs", arc_tolerance, zero=True)
    drawings = []
    for number in range(sheets.count):
        entities: list[Entity] = []
        notes: list[str] = []
        stretch = 0.0
        for piece in sheets.pieces_on(number):
            strokes, missing = _draw_labels(piece, sheets.pieces.seams, label_height)
            entities.extend(strokes)
            if missing:
                notes.append(f"{piece.name}: {', '.join(missing)}")
            entities.extend(Entity(Layer(f"SCORE_{score.fold.upper()}"), score.path) for score in piece.scores)
            outlines, change = _fit_outlines(piece, arc_tolerance)
            if arc_tolerance and find_winding_errors(outlines):  # arcs may cross in narrow places
                outlines, change = _fit_outlines(piece, 0.0)
            stretch = max(stretch, change)
            if kerf:
                entities.extend(Entity(Layer.GUIDE, path) for path in outlines)
                outlines = compensate_kerf(piece.cuts, kerf, arc_tolerance, name=piece.name)
            _refuse_crossing(piece, outlines)
            entities.extend(Entity(Layer.CUT, path) for path in (*outlines[1:], outlines[0]))
        drawings.append(Drawing(sheets.size, tuple(entities), tuple(notes), stretch))
    return tuple(drawings)


def join_drawings(drawings: Sequence[Drawing], *, gap: float = DRAWING_LAYOUT.sheet_gap) -> Drawing:
    """Return one drawing of several, for formats that have one page: in a row, framed on GUIDE, notes written above.

    It is at least as wide as its notes. A single drawing without notes stays as it is. The gap between sheets is in mm.
    """
    if len(drawings) == 1 and not drawings[0].notes:
        return drawings[0]
    entities: list[Entity] = []
    left = 0.0
    for drawing in drawings:
        width, height = drawing.size
        shift = np.array([left, 0.0])
        entities.extend(Entity(entity.layer, entity.path.moved(0.0, shift)) for entity in drawing.entities)
        corners = np.array([[0, 0], [width, 0], [width, height], [0, height], [0, 0]]) + shift
        entities.append(Entity(Layer.GUIDE, Path.from_points(corners)))
        left += width + gap
    top = max(drawing.size[1] for drawing in drawings)
    lines = [note for drawing in drawings for note in drawing.notes]
    text_height, spacing = LABEL_LIMITS.height, DRAWING_LAYOUT.note_line_spacing
    for k, line in enumerate(reversed(lines)):
        foot = np.array([0.0, top + gap + k * spacing * text_height])
        entities.extend(Entity(Layer.GUIDE, stroke.moved(0.0, foot)) for stroke in make_text_strokes(line, text_height))
    width = max(left - gap, *(measure_text_width(line, text_height) for line in lines), 0.0)
    height = top + (gap + len(lines) * spacing * text_height if lines else 0.0)
    return Drawing((width, height), tuple(entities), stretch=max(drawing.stretch for drawing in drawings))


def write_notes(drawing: Drawing) -> Drawing:
    """Return a drawing with its notes written on GUIDE, inside the sheet and clear of pieces, as high as there is room.

    Warns
    -----
    PatternWarning
        There is no room, not even for low letters; the message has the notes.
    """
    if not drawing.notes:
        return drawing
    for height in TRIED_NOTE_HEIGHTS:
        width = max(measure_text_width(line, height) for line in drawing.notes)
        spacing = DRAWING_LAYOUT.note_line_spacing * height
        corner = find_free_corner(drawing, (width, spacing * len(drawing.notes)))
        if corner is not None:
            strokes = [
                Entity(Layer.GUIDE, stroke.moved(0.0, corner + np.array([0.0, spacing * k])))
                for k, line in enumerate(reversed(drawing.notes))
                for stroke in make_text_strokes(line, height)
            ]
            return replace(drawing, entities=(*drawing.entities, *strokes), notes=())
    warn(PatternWarning(f"the sheet has no room to write labels that their pieces have none for: {drawing.notes}"))
    return replace(drawing, notes=())


def find_free_corner(drawing: Drawing, size: tuple[float, float]) -> Array | None:
    """Return the lower left corner of the lowest, then leftmost free box of a size on a sheet; None if there is none.

    It keeps :attr:`DrawingLayout.note_clearance` from cuts and from the border of the sheet.
    """
    clearance, count = DRAWING_LAYOUT.note_clearance, DRAWING_LAYOUT.tried_places
    play = np.array(drawing.size) - np.array(size) - 2 * clearance
    if (play < 0).any():
        return None
    places = np.stack(np.meshgrid(*(np.linspace(0.0, side, count) for side in play), indexing="ij"), axis=-1)
    corners = places.transpose(1, 0, 2).reshape(-1, 2) + clearance
    boxes = shapely.box(*(corners - clearance).T, *(corners + size + clearance).T)
    outlines = [shapely.Polygon(path.sampled(DRAWING_LAYOUT.box_tolerance)) for path in drawing.paths_on(Layer.CUT)]
    taken = np.zeros(len(boxes), dtype=bool)
    taken[shapely.STRtree(boxes).query(outlines, predicate="intersects")[1]] = True
    free = np.flatnonzero(~taken)
    return corners[free[0]] if len(free) else None


def _draw_labels(piece: Piece, seams: Sequence[Seam], height: float | None) -> tuple[list[Entity], list[str]]:
    """Return the strokes of a piece's labels, and the texts of those that have no room."""
    strokes: list[Entity] = []
    missing: list[str] = []
    for label in () if height is None else place_labels(piece, seams, height=height):
        if label.is_engraved:
            strokes.extend(Entity(Layer.ENGRAVE, stroke) for stroke in label.strokes)
        else:
            missing.append(f"{label.text} (name)" if label.seam is None else label.text)
    return strokes, missing


def _refuse_crossing(piece: Piece, outlines: Sequence[Path]) -> None:
    """Raise VerificationError if the lines along which a piece is cut cross each other or themselves."""
    crossing = find_winding_errors(outlines)
    if crossing.place is not None:
        x, y = crossing.place
        raise VerificationError(
            f"what is to be cut of piece {piece.name} crosses itself: {crossing.area:.2g} mm2 about ({x:.1f}, {y:.1f}) "
            "on its sheet"
        )


def _fit_outlines(piece: Piece, tolerance: float) -> tuple[tuple[Path, ...], float]:
    """Return the outlines of a piece with few arcs, and the largest relative change in length of a run.

    Outlines with tabs are not made of runs: their change counts as 0.
    """
    if piece.tabs is not None:
        return tuple(_fit_path(path, tolerance) for path in piece.tabs), 0.0
    loops, change = [], 0.0
    for loop in piece.loops:
        runs = []
        for run in loop:
            path = _fit_path(run.path, tolerance)
            change = max(change, abs(path.length / run.path.length - 1) if run.path.length else 0.0)
            runs.append(replace(run, path=path))
        loops.append(close_loop(tuple(runs)))
    return tuple(loops), change


def _fit_path(path: Path, tolerance: float) -> Path:
    """Return a path with few arcs; one of length 0 as it is."""
    return fit_arcs(path, tolerance) if path.length else path
