"""Places labels inside pieces: the name of the piece, and the label of each seam on the run that belongs to it.

The foot of a seam's label is towards the seam, so that its two sides are told apart; a text that would read as another
one upside down is underlined, as 6 and 9. A label that does not fit at the least height has no strokes: it is to be
listed in the legend, with the piece's name. Leader lines to the outside are not drawn, since another piece may lie
there. Depends on outlines, and on the font.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from cqblend.argument_checks import check_millimetres
from cqblend.errors import InputError
from cqblend.patterns.outline.overlap import to_polygon
from cqblend.patterns.outline.path_by_length import PathByLength, rotate_vectors
from cqblend.patterns.outline.pieces import Piece, Seam
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.stock_proportions import LABEL_LIMITS
from cqblend.patterns.stock.stroke_font import CAPITAL_UNITS, make_text_strokes, measure_text_width
from cqblend.splines.bernstein import Array

TRIED_FRACTIONS = (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9)
"""Fractions of the length of its run at which a label is tried, the middle first."""

TRIED_LIFTS = (0.5, 1.2, 2.5)
"""Distances from its run at which a label is tried, in heights of its capitals."""

UPSIDE_DOWN = str.maketrans("69", "96")
"""Digits that read as others when they are turned by half a turn; 0, 1 and 8 read as themselves."""

UNDERLINE_DROP = 1
"""Distance of the underline below the foot of a text, in units of the grid of the glyphs."""


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A text in the plane.

    Attributes
    ----------
    text
        Its characters.
    place
        (2,): lower left corner of the text; the middle of the run, or of the piece, if it did not fit.
    angle
        Of the line of text (rad), from the x axis.
    height
        Of the capitals, mm; 0.0 if it did not fit.
    strokes
        Paths to be engraved; none if it did not fit.
    seam
        Index of the seam it names; None for the piece's name.
    """

    text: str
    place: Array
    angle: float
    height: float
    strokes: tuple[Path, ...]
    seam: int | None = None

    @property
    def is_engraved(self) -> bool:
        """Whether there was room; if not, it belongs in the legend."""
        return self.height > 0

    def moved(self, turn: float, shift: Array) -> "Label":
        """Return the label turned about the origin by an angle (rad), then shifted."""
        return replace(
            self,
            place=rotate_vectors(self.place, turn) + shift,
            angle=self.angle + turn,
            strokes=tuple(path.moved(turn, shift) for path in self.strokes),
        )


def make_label_strokes(text: str, height: float) -> tuple[Path, ...]:
    """Return the strokes of a text, and the line under it if it would read as another one upside down."""
    strokes = make_text_strokes(text, height)
    if not is_underlined(text):
        return strokes
    ends = np.array([[0.0, -UNDERLINE_DROP], [measure_text_width(text, CAPITAL_UNITS), -UNDERLINE_DROP]])
    return *strokes, Path.from_points(ends * (height / CAPITAL_UNITS))


def is_underlined(text: str) -> bool:
    """Return whether a text is underlined, because it would read as another one upside down.

    Examples
    --------
    >>> [text for text in ("6", "16", "69", "68.1", "80", "26") if is_underlined(text)]
    ['6', '16', '68.1']
    """
    turned_over = text[::-1].translate(UPSIDE_DOWN)
    return set(text) <= set("01689.") and not set(text).isdisjoint("69") and turned_over != text


def place_labels(
    piece: Piece, seams: Sequence[Seam], *, height: float = LABEL_LIMITS.height, least: float | None = None
) -> tuple[Label, ...]:
    """Return a piece's name and the labels of its seams, inside its outline and clear of each other.

    The name is written about the centre of the largest inscribed circle, level or else along the nearest border, up to
    :attr:`LabelLimits.name_height_ratio` times as high, or lower if seams' labels find no room beside it. A seam's
    label stands on its run, near the run's middle; if there is no room it is moved along the run, then away from it,
    then made smaller, down to the least height. A label that does not fit then is returned without strokes.

    Parameters
    ----------
    piece
        The piece, placed anywhere.
    seams
        All seams of the pattern.
    height
        Of the capitals, mm.
    least
        Least height, mm; :attr:`LabelLimits.least_height_ratio` of the height if not given.

    Returns
    -------
    tuple of Label
        The name first, then one for each run with a seam, in the order of the runs.

    Raises
    ------
    InputError
        If a height is not a positive number, the least exceeds it, or a character has no glyph.

    Examples
    --------
    >>> from cqblend.patterns.outline.pieces import Place, Run
    >>> corners = [[0, 0], [40, 0], [40, 20], [0, 20], [0, 0]]
    >>> runs = (
    ...     Run(Path.from_points(corners[:2]), np.zeros((2, 3)), "rail", 0),
    ...     Run(Path.from_points(corners[1:]), np.zeros((4, 3)), "end"),
    ... )
    >>> seam = Seam("12", (Place(0, 0, 0), Place(1, 0, 0)))
    >>> [(label.text, label.height, label.angle) for label in place_labels(Piece("3.1", (runs,)), [seam])]
    [('3.1', 6.0, 0.0), ('12', 4.0, 0.0)]
    """
    height = check_millimetres("the height of labels", height)
    least = (
        LABEL_LIMITS.least_height_ratio * height
        if least is None
        else check_millimetres("the least height of labels", least)
    )
    if least > height:
        raise InputError(f"the least height of labels, {least:g} mm, exceeds the height, {height:g} mm")
    polygon = to_polygon(piece.outlines, height / LABEL_LIMITS.chord_divisor)
    heights = _list_heights(height, least)
    tried: list[tuple[Label, ...]] = []
    for largest in (LABEL_LIMITS.name_height_ratio * height, height, least):  # a lower name may leave room for seams
        free = _FreeSpace(polygon)
        placed = (
            _place_name_label(piece.name, free, _list_heights(largest, least)),
            *(
                _place_seam_label(run.path, seams[run.seam].label, run.seam, free, heights)
                for *_, run in piece.runs()
                if run.seam is not None
            ),
        )
        if all(label.is_engraved for label in placed):
            return placed
        tried.append(placed)
    return max(tried, key=lambda labels: sum(label.is_engraved for label in labels))


class _FreeSpace:
    """The inside of a piece, and the boxes of labels that are placed in it."""

    def __init__(self, polygon: Any) -> None:
        self.polygon = polygon
        shapely.prepare(polygon)
        self.taken: list[Any] = []

    def claim_free_box(self, boxes: Array) -> int | None:
        """Return the index of the first of boxes (m, 4, 2) that is free, and claim it; None if there is none."""
        candidates = shapely.polygons(boxes)
        free = shapely.contains(self.polygon, candidates)
        for k in np.flatnonzero(free):
            if not shapely.intersects(candidates[k], self.taken).any():
                self.taken.append(candidates[k])
                return int(k)
        return None


def _list_heights(largest: float, least: float) -> Array:
    """Return the heights to be tried, from the largest to the least, in a geometric sequence."""
    step = LABEL_LIMITS.height_step
    count = int(np.floor(np.log(least / largest) / np.log(step) * (1 + 1e-12)))
    return np.unique([*(largest * step ** np.arange(count + 1)), least])[::-1]


def _turn_left(vectors: Array) -> Array:
    """Return vectors (m, 2) turned by a right angle to the left."""
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)


def _make_text_boxes(text: str, places: Array, directions: Array, height: float) -> Array:
    """Return the corners (m, 4, 2) of boxes around a text, with its margins.

    Parameters
    ----------
    text
        The text.
    places
        (m, 2), lower left corners of the text.
    directions
        (m, 2), unit vectors along the line of text.
    height
        Of the capitals, mm.
    """
    heights = np.full(len(places), height)
    widths, drop = (
        measure_text_width(text, 1.0) * heights,
        UNDERLINE_DROP / CAPITAL_UNITS if is_underlined(text) else 0.0,
    )
    up = _turn_left(directions)
    margin = LABEL_LIMITS.label_margin * heights
    x = np.stack([-margin, widths + margin, widths + margin, -margin], axis=1)
    y = np.stack([-margin - drop * heights, -margin - drop * heights, heights + margin, heights + margin], axis=1)
    return places[:, None] + x[:, :, None] * directions[:, None] + y[:, :, None] * up[:, None]


def _write_label(text: str, place: Array, direction: Array, height: float, seam: int | None) -> Label:
    """Return a label with its strokes, its lower left corner at a place."""
    angle = float(np.arctan2(direction[1], direction[0]))
    strokes = tuple(path.moved(angle, place) for path in make_label_strokes(text, height))
    return Label(text, place, angle, float(height), strokes, seam)


def _place_seam_label(path: Path, text: str, seam: int, free: _FreeSpace, heights: Array) -> Label:
    """Return the label of a seam above the path of its run, at the first of heights at which there is room."""
    if path.length == 0:
        return Label(text, path.points[0], 0.0, 0.0, (), seam)
    run = PathByLength.from_path(path)
    width = measure_text_width(text, 1.0)
    for height in heights:
        stations = np.array(TRIED_FRACTIONS) * run.length
        half = min(width * height, run.length / 4) / 2
        chords = run.points_at(np.minimum(stations + half, run.length)) - run.points_at(
            np.maximum(stations - half, 0.0)
        )
        directions = chords / np.maximum(np.linalg.norm(chords, axis=1), np.finfo(np.float64).tiny)[:, None]
        up = _turn_left(directions)
        feet = run.points_at(stations) - directions * (width * height / 2)
        places = np.concatenate([feet + lift * height * up for lift in TRIED_LIFTS])
        directions = np.tile(directions, (len(TRIED_LIFTS), 1))
        chosen = free.claim_free_box(_make_text_boxes(text, places, directions, height))
        if chosen is not None:
            return _write_label(text, places[chosen], directions[chosen], height, seam)
    middle = run.points_at(run.length / 2)
    return Label(text, middle, 0.0, 0.0, (), seam)


def _place_name_label(text: str, free: _FreeSpace, heights: Array) -> Label:
    """Return the name of a piece about the centre of its largest inscribed circle: level, along the border, or upright.

    It has the first of heights at which there is room.
    """
    if not free.polygon.area > 0:
        return Label(text, np.array(free.polygon.centroid.coords[0]), 0.0, 0.0, ())
    tolerance = heights[0] / (10 * LABEL_LIMITS.name_height_ratio)
    radius = shapely.maximum_inscribed_circle(free.polygon, tolerance=tolerance)
    centre, border = shapely.get_coordinates(radius)
    out = (border - centre) / max(float(np.linalg.norm(border - centre)), np.finfo(np.float64).tiny)
    directions = np.array([[1.0, 0.0], [-out[1], out[0]], [0.0, 1.0]])
    directions[1] *= 1.0 if directions[1, 0] > 0 or (directions[1, 0] == 0 and directions[1, 1] > 0) else -1.0
    up = _turn_left(directions)
    width = measure_text_width(text, 1.0)
    for height in heights:
        places = centre - directions * (width * height / 2) - up * (height / 2)
        chosen = free.claim_free_box(_make_text_boxes(text, places, directions, height))
        if chosen is not None:
            return _write_label(text, places[chosen], directions[chosen], height, None)
    return Label(text, centre, 0.0, 0.0, ())
