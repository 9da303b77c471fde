"""Labels as single strokes: the seams' on both of their sides, the pieces' names in their midst.

Exists because a laser or a pen engraves a stroke once, while the letters of a font are outlines. A seam's label stands
on its run: its foot is towards the seam, so that the two sides are told apart; what would read as another number
upside down is underlined, as 6 and 9. A label that does not fit at the least height has no strokes: it is to be listed
in the legend, at the piece's name. Leader lines to the outside are not drawn, since what lies outside a piece on a
sheet is another piece. Must not know sheets or files.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from cqblend.checks import check_millimetres
from cqblend.errors import InputError
from cqblend.patterns.outline.overlap import to_polygon
from cqblend.patterns.outline.parallel_path import PathByLength, rotate_vectors
from cqblend.patterns.outline.pieces import Piece, Seam
from cqblend.patterns.outline.plane_path import Path
from cqblend.splines.bernstein import Array

CAPITAL_UNITS = 6
"""Height of the capitals in the grid of the glyphs."""

GLYPH_GAP = 2
"""Space between two glyphs in their grid."""

GLYPHS = {
    "0": "103041453616050110 0145",
    "1": "042620",
    "2": "05163645440040",
    "3": "0516364544334241301001 1333",
    "4": "30360242",
    "5": "460603334241301001",
    "6": "453616050110304142331302",
    "7": "064610",
    "8": "13040516364544331302011030414233",
    "9": "011030414536160504133344",
    "A": "0004264440 0242",
    "B": "00063645443303 3342413000",
    "C": "4536160501103041",
    "D": "00062644422000",
    "E": "46060040 0333",
    "F": "460600 0333",
    "G": "45361605011030414323",
    "H": "0006 4046 0343",
    "I": "0020 0626 1016",
    "J": "0110304146",
    "K": "0006 460340",
    "L": "060040",
    "M": "0006234640",
    "N": "00064046",
    "O": "103041453616050110",
    "P": "00063645443303",
    "Q": "103041453616050110 2240",
    "R": "00063645443303 2340",
    "S": "453616050413334241301001",
    "T": "0646 2620",
    "U": "060110304146",
    "V": "062046",
    "W": "0610243046",
    "X": "0046 0640",
    "Y": "062346 2320",
    "Z": "06460040",
    ".": "0010110100",
    ",": "1100",
    ":": "0001 0304",
    "-": "0333",
    "+": "0343 2125",
    "=": "0242 0444",
    "/": "0046",
    "(": "16050110",
    ")": "06151100",
    " ": "",
}
"""Strokes of each character: digits x, y in turn on a grid 4 wide and 6 high, a blank lifts the pen."""

TRIED_FRACTIONS = (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9)
"""Where along its run a label is tried, the middle first."""

TRIED_LIFTS = (0.5, 1.2, 2.5)
"""How far above its run a label is tried, in heights."""

LABEL_MARGIN = 0.25
"""Space kept free around a label, in heights."""

HEIGHT_RATIO = 0.8
"""Ratio of the heights that are tried one after another."""

UPSIDE_DOWN = str.maketrans("69", "96")
"""What digits read as when they are turned by half a turn; 0, 1 and 8 read as themselves."""

UNDERLINE_DROP = 1
"""How far below its foot line a text is underlined, in the grid of the glyphs."""

NAME_HEIGHT_RATIO = 1.5
"""Height of a piece's name beside that of the seams' labels, where there is room."""


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """A text in the plane.

    Attributes
    ----------
    text
        What it says.
    place
        (2,): where the text begins, on its foot line; the middle of the run, or of the piece, if it did not fit.
    angle
        Direction in which it reads (rad).
    height
        Of the capitals, mm; 0.0 if it did not fit.
    strokes
        What is engraved; none if it did not fit.
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


def measure_text_width(text: str, height: float) -> float:
    """Return the width of a text whose capitals have a height, mm.

    Examples
    --------
    >>> text_width("10", 6.0)  # two units, a gap of two, four units
    8.0
    """
    widths = [max(map(int, glyph.replace(" ", "")[::2]), default=2) for glyph in _find_glyphs(text)]
    return (sum(widths) + GLYPH_GAP * max(len(widths) - 1, 0)) * height / CAPITAL_UNITS


def make_text_strokes(text: str, height: float) -> tuple[Path, ...]:
    """Return open polylines that write a text along the x axis, its capitals from y = 0 to a height.

    Small letters are written as capitals.

    Raises
    ------
    InputError
        If a character has no glyph.

    Examples
    --------
    >>> [path.points.tolist() for path in text_strokes("T", 6.0)]
    [[[0.0, 6.0], [4.0, 6.0]], [[2.0, 6.0], [2.0, 0.0]]]
    """
    strokes, x = [], 0
    for glyph in _find_glyphs(text):
        for stroke in glyph.split():
            points = np.array([[int(c) for c in stroke[0::2]], [int(c) for c in stroke[1::2]]], dtype=np.float64).T
            strokes.append(Path.from_points((points + np.array([x, 0])) * (height / CAPITAL_UNITS)))
        x += max(map(int, glyph.replace(" ", "")[::2]), default=2) + GLYPH_GAP
    return tuple(strokes)


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
    >>> [text for text in ("6", "16", "69", "68.1", "80", "26") if underlined(text)]
    ['6', '16', '68.1']
    """
    turned_over = text[::-1].translate(UPSIDE_DOWN)
    return set(text) <= set("01689.") and not set(text).isdisjoint("69") and turned_over != text


def _find_glyphs(text: str) -> list[str]:
    try:
        return [GLYPHS[letter] for letter in text.upper()]
    except KeyError as error:
        raise InputError(
            f"no stroke is known for {error.args[0]!r} in the label {text!r}: use letters A to Z, digits and .,:-+=/()"
        ) from None


def place_labels(
    piece: Piece, seams: Sequence[Seam], *, height: float = 4.0, least: float | None = None
) -> tuple[Label, ...]:
    """Return a piece's name and the labels of its seams, inside its outline and clear of each other.

    The name is written where most room is, level or else along the nearest border, up to :data:`NAME_HEIGHT_RATIO`
    times as high, or lower if seams' labels find no room beside it. A seam's label stands on its run, near the run's
    middle; if there is no room it is moved along the run, then away from it, then made smaller, down to the least
    height. What does not fit then is returned without strokes.

    Parameters
    ----------
    piece
        The piece, placed anywhere.
    seams
        All seams of the pattern, as runs count them.
    height
        Of the capitals, mm.
    least
        Least height, mm; a quarter of the height if not given.

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
    ...     Run(Path.straight(corners[:2]), np.zeros((2, 3)), "rail", 0),
    ...     Run(Path.straight(corners[1:]), np.zeros((4, 3)), "end"),
    ... )
    >>> seam = Seam("12", (Place(0, 0, 0), Place(1, 0, 0)))
    >>> [(label.text, label.height, label.angle) for label in labels(Piece("3.1", (runs,)), [seam])]
    [('3.1', 6.0, 0.0), ('12', 4.0, 0.0)]
    """
    height = check_millimetres("the height of labels", height)
    least = height / 4 if least is None else check_millimetres("the least height of labels", least)
    if least > height:
        raise InputError(f"the least height of labels, {least:g} mm, exceeds the height, {height:g} mm")
    polygon = to_polygon(piece.outlines, height / 50)
    tried: list[tuple[Label, ...]] = []
    for largest in (NAME_HEIGHT_RATIO * height, height, least):  # a lower name may leave room for seams
        room = _FreeSpace(polygon)
        found = (
            _place_name_label(piece.name, room, largest, least),
            *(
                _place_seam_label(run.path, seams[run.seam].label, run.seam, room, height, least)
                for *_, run in piece.runs()
                if run.seam is not None
            ),
        )
        if all(label.is_engraved for label in found):
            return found
        tried.append(found)
    return max(tried, key=lambda found: sum(label.is_engraved for label in found))


class _FreeSpace:
    """The inside of a piece, and the boxes of labels that take it up."""

    def __init__(self, polygon: Any) -> None:
        self.polygon = polygon
        shapely.prepare(polygon)
        self.taken: list[Any] = []

    def claim_free_box(self, boxes: Array) -> int | None:
        """Return the first of boxes (m, 4, 2) that is free, and take it; None if there is none."""
        candidates = shapely.polygons(boxes)
        free = shapely.contains(self.polygon, candidates)
        for k in np.flatnonzero(free):
            if not shapely.intersects(candidates[k], self.taken).any():
                self.taken.append(candidates[k])
                return int(k)
        return None


def _list_heights(largest: float, least: float) -> Array:
    """Return the heights to be tried."""
    count = int(np.floor(np.log(least / largest) / np.log(HEIGHT_RATIO) * (1 + 1e-12)))
    return np.unique([*(largest * HEIGHT_RATIO ** np.arange(count + 1)), least])[::-1]


def _make_text_boxes(text: str, places: Array, ahead: Array, heights: Array) -> Array:
    """Return the corners (m, 4, 2) of a text that begins at places and reads along unit vectors, with its margins."""
    widths, drop = (
        measure_text_width(text, 1.0) * heights,
        UNDERLINE_DROP / CAPITAL_UNITS if is_underlined(text) else 0.0,
    )
    up = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    margin = LABEL_MARGIN * heights
    x = np.stack([-margin, widths + margin, widths + margin, -margin], axis=1)
    y = np.stack([-margin - drop * heights, -margin - drop * heights, heights + margin, heights + margin], axis=1)
    return places[:, None] + x[:, :, None] * ahead[:, None] + y[:, :, None] * up[:, None]


def _write_label(text: str, place: Array, ahead: Array, height: float, seam: int | None) -> Label:
    angle = float(np.arctan2(ahead[1], ahead[0]))
    strokes = tuple(path.moved(angle, place) for path in make_label_strokes(text, height))
    return Label(text, place, angle, float(height), strokes, seam)


def _place_seam_label(path: Path, text: str, seam: int, room: _FreeSpace, height: float, least: float) -> Label:
    """Return a seam's label, standing on its run."""
    if path.length == 0:
        return Label(text, path.points[0], 0.0, 0.0, (), seam)
    track = PathByLength.from_path(path)
    width = measure_text_width(text, 1.0)
    for size in _list_heights(height, least):
        station = np.array(TRIED_FRACTIONS) * track.length
        half = min(width * size, track.length / 4) / 2
        ahead = track.points_at(np.minimum(station + half, track.length)) - track.points_at(
            np.maximum(station - half, 0.0)
        )
        ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1), np.finfo(np.float64).tiny)[:, None]
        up = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        foot = track.points_at(station) - ahead * (width * size / 2)
        places = np.concatenate([foot + lift * size * up for lift in TRIED_LIFTS])
        aheads = np.tile(ahead, (len(TRIED_LIFTS), 1))
        sizes = np.full(len(places), size)
        chosen = room.claim_free_box(_make_text_boxes(text, places, aheads, sizes))
        if chosen is not None:
            return _write_label(text, places[chosen], aheads[chosen], size, seam)
    middle = track.points_at(track.length / 2)
    return Label(text, middle, 0.0, 0.0, (), seam)


def _place_name_label(text: str, room: _FreeSpace, largest: float, least: float) -> Label:
    """Return the name of a piece, in the midst of it."""
    if not room.polygon.area > 0:
        return Label(text, np.array(room.polygon.centroid.coords[0]), 0.0, 0.0, ())
    arrow = shapely.maximum_inscribed_circle(room.polygon, tolerance=largest / (10 * NAME_HEIGHT_RATIO))
    centre, border = shapely.get_coordinates(arrow)
    out = (border - centre) / max(float(np.linalg.norm(border - centre)), np.finfo(np.float64).tiny)
    aheads = np.array([[1.0, 0.0], [-out[1], out[0]], [0.0, 1.0]])
    aheads[1] *= 1.0 if aheads[1, 0] > 0 or (aheads[1, 0] == 0 and aheads[1, 1] > 0) else -1.0
    ups = np.stack([-aheads[:, 1], aheads[:, 0]], axis=1)
    width = measure_text_width(text, 1.0)
    for size in _list_heights(largest, least):
        places = centre - aheads * (width * size / 2) - ups * (size / 2)
        sizes = np.full(len(places), size)
        chosen = room.claim_free_box(_make_text_boxes(text, places, aheads, sizes))
        if chosen is not None:
            return _write_label(text, places[chosen], aheads[chosen], size, None)
    return Label(text, centre, 0.0, 0.0, ())
