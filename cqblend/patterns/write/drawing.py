"""Drawings: what is cut, scored, engraved and only looked at, as paths on layers, one drawing per sheet.

Exists so that all files say the same: writers turn entities into their format and decide nothing. Everything is in mm,
the origin at the lower left corner of the sheet. Must not know how pieces were placed, nor any file format.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import shapely

from cqblend.checks import check_millimetres
from cqblend.errors import PatternWarning, VerificationError, warn
from cqblend.patterns.outline.arc_fit import fit_arcs
from cqblend.patterns.outline.overlap import find_winding_errors
from cqblend.patterns.outline.pieces import Piece, Seam, close_loop
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.kerf import compensate_kerf
from cqblend.patterns.stock.labels import make_text_strokes, measure_text_width, place_labels
from cqblend.patterns.stock.sheets import Sheets
from cqblend.splines.bernstein import Array

ARC_FIT_TOLERANCE = 2e-3
"""How far fitted arcs may be from the outline, mm: well below what cutters hold."""

LABEL_HEIGHT = 4.0
"""Height of the labels' capitals, mm."""


_TRIED_NOTE_HEIGHTS = (LABEL_HEIGHT, 3.0, 2.0, 1.5, 1.0)
"""Heights of letters that are tried for notes, mm."""

_NOTE_CLEARANCE = 2.0
"""Distance of notes from pieces and borders, mm."""


class Layer(StrEnum):
    """What is done along a path."""

    CUT = "CUT"
    SCORE_MOUNTAIN = "SCORE_MOUNTAIN"
    SCORE_VALLEY = "SCORE_VALLEY"
    ENGRAVE = "ENGRAVE"
    GUIDE = "GUIDE"


@dataclass(frozen=True, slots=True)
class LayerStyle:
    """How a layer looks.

    Attributes
    ----------
    colour
        Red, green, blue, 0 to 255.
    aci
        The same in AutoCAD's index of colours.
    dashes
        Lengths of strokes and gaps in turn, mm; none is continuous.
    width
        Of the line on paper, mm.
    meaning
        For the legend.
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
"""Mountains are dashed and valleys dash-dotted, as in origami."""


@dataclass(frozen=True, slots=True, eq=False)
class Entity:
    """A path on a layer."""

    layer: Layer
    path: Path


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """What goes on one sheet.

    Attributes
    ----------
    size
        Width and height, mm.
    entities
        In the order in which they are made: labels, scores, holes, and the outer outline last, piece by piece.
    notes
        Lines of text: labels for which there was no room on their pieces.
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
    sheets: Sheets, *, kerf: float = 0.0, fit: float = ARC_FIT_TOLERANCE, height: float | None = LABEL_HEIGHT
) -> tuple[Drawing, ...]:
    """Return the drawings of sheets.

    Parameters
    ----------
    sheets
        Pieces at their places.
    kerf
        Width of what the cutter takes away, mm. Unless it is 0, outlines on CUT are moved outwards by half of it, holes
        inwards, and the outline of the piece itself is on GUIDE.
    fit
        How far the arcs that replace chains of short segments may be from them, mm; 0 keeps all segments. Corners and
        the ends of seams stay.
    height
        Of labels, mm; None draws none.

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
        If what is to be cut crosses itself.
    """
    kerf = check_millimetres("the kerf", kerf, zero=True)
    fit = check_millimetres("the tolerance of fitted arcs", fit, zero=True)
    sheaf = []
    for number in range(sheets.count):
        entities: list[Entity] = []
        notes: list[str] = []
        stretch = 0.0
        for piece in sheets.pieces_on(number):
            entities.extend(_draw_labels(piece, sheets.pieces.seams, height, notes))
            entities.extend(Entity(Layer(f"SCORE_{score.fold.upper()}"), score.path) for score in piece.scores)
            outlines, change = _fit_outlines(piece, fit)
            if fit and find_winding_errors(outlines):  # in narrow places
                outlines, change = _fit_outlines(piece, 0.0)
            stretch = max(stretch, change)
            if kerf:
                entities.extend(Entity(Layer.GUIDE, path) for path in outlines)
                outlines = compensate_kerf(piece.cuts, kerf, fit, name=piece.name)
            _refuse_crossing(piece, outlines)
            entities.extend(Entity(Layer.CUT, path) for path in (*outlines[1:], outlines[0]))
        sheaf.append(Drawing(sheets.size, tuple(entities), tuple(notes), stretch))
    return tuple(sheaf)


def join_drawings(drawings: Sequence[Drawing], *, gap: float = 10.0) -> Drawing:
    """Return one drawing of several: in a row from left to right, framed on GUIDE, notes written above.

    For formats that have one page. It is at least as wide as its notes. A single drawing without notes stays as it is.
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
    for k, line in enumerate(reversed(lines)):
        foot = np.array([0.0, top + gap + k * 1.75 * LABEL_HEIGHT])
        entities.extend(
            Entity(Layer.GUIDE, stroke.moved(0.0, foot)) for stroke in make_text_strokes(line, LABEL_HEIGHT)
        )
    width = max(left - gap, *(measure_text_width(line, LABEL_HEIGHT) for line in lines), 0.0)
    height = top + (gap + len(lines) * 1.75 * LABEL_HEIGHT if lines else 0.0)
    return Drawing((width, height), tuple(entities), stretch=max(drawing.stretch for drawing in drawings))


def write_notes(drawing: Drawing) -> Drawing:
    """Return a drawing with its notes written on GUIDE, inside the sheet, where no piece is.

    Letters are lower where there is little room.

    Warns
    -----
    PatternWarning
        There is no room, not even for low letters; the message has the notes.
    """
    if not drawing.notes:
        return drawing
    for height in _TRIED_NOTE_HEIGHTS:
        width = max(measure_text_width(line, height) for line in drawing.notes)
        corner = find_free_corner(drawing, (width, 1.75 * height * len(drawing.notes)))
        if corner is not None:
            strokes = [
                Entity(Layer.GUIDE, stroke.moved(0.0, corner + np.array([0.0, 1.75 * height * k])))
                for k, line in enumerate(reversed(drawing.notes))
                for stroke in make_text_strokes(line, height)
            ]
            return replace(drawing, entities=(*drawing.entities, *strokes), notes=())
    warn(PatternWarning(f"the sheet has no room to write labels that their pieces have none for: {drawing.notes}"))
    return replace(drawing, notes=())


def find_free_corner(drawing: Drawing, size: tuple[float, float]) -> Array | None:
    """Return the lower left corner of the lowest, then leftmost free room of a size on a sheet; None if there is none.

    It keeps a distance of 2 mm from what is drawn and from the border.
    """
    room = np.array(drawing.size) - np.array(size) - 2 * _NOTE_CLEARANCE
    if (room < 0).any():
        return None
    places = np.stack(np.meshgrid(*(np.linspace(0.0, side, 41) for side in room), indexing="ij"), axis=-1)
    corners = places.transpose(1, 0, 2).reshape(-1, 2) + _NOTE_CLEARANCE
    boxes = shapely.box(*(corners - _NOTE_CLEARANCE).T, *(corners + size + _NOTE_CLEARANCE).T)
    outlines = [shapely.Polygon(path.sampled(0.1)) for path in drawing.paths_on(Layer.CUT)]
    taken = np.zeros(len(boxes), dtype=bool)
    taken[shapely.STRtree(boxes).query(outlines, predicate="intersects")[1]] = True
    free = np.flatnonzero(~taken)
    return corners[free[0]] if len(free) else None


def _draw_labels(piece: Piece, seams: Sequence[Seam], height: float | None, notes: list[str]) -> Iterator[Entity]:
    """Yield the strokes of a piece's labels; note those that have no room."""
    if height is None:
        return
    missing = []
    for label in place_labels(piece, seams, height=height):
        if label.is_engraved:
            yield from (Entity(Layer.ENGRAVE, stroke) for stroke in label.strokes)
        else:
            missing.append(f"{label.text} (name)" if label.seam is None else label.text)
    if missing:
        notes.append(f"{piece.name}: {', '.join(missing)}")


def _refuse_crossing(piece: Piece, outlines: Sequence[Path]) -> None:
    crossing = find_winding_errors(outlines)
    if crossing.place is not None:
        x, y = crossing.place
        raise VerificationError(
            f"what is to be cut of piece {piece.name} crosses itself: {crossing.area:.2g} mm2 about ({x:.1f}, {y:.1f}) "
            "on its sheet"
        )


def _fit_outlines(piece: Piece, fit: float) -> tuple[tuple[Path, ...], float]:
    """Return what is cut with few arcs, and by how much a run changes its length at most, relatively."""
    if piece.tabs is not None:
        return tuple(_fit_path(path, fit) for path in piece.tabs), 0.0
    loops, change = [], 0.0
    for loop in piece.loops:
        runs = []
        for run in loop:
            path = _fit_path(run.path, fit)
            change = max(change, abs(path.length / run.path.length - 1) if run.path.length else 0.0)
            runs.append(replace(run, path=path))
        loops.append(close_loop(tuple(runs)))
    return tuple(loops), change


def _fit_path(path: Path, fit: float) -> Path:
    return fit_arcs(path, fit) if path.length else path
