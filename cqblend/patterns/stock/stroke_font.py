"""A font of single strokes, which a laser or a pen engraves once: the letters of other fonts are outlines.

Depends on plane paths only.
"""

import numpy as np

from cqblend.errors import InputError
from cqblend.patterns.outline.plane_path import Path

CAPITAL_UNITS = 6
"""Height of the capitals in units of the grid of the glyphs."""

GLYPH_GAP = 2
"""Space between two glyphs, in units of their grid."""

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
"""Strokes of each character: digits x, y in turn on a grid 4 wide and 6 high; a blank separates strokes."""

BLANK_UNITS = 2
"""Width of a blank, in units of the grid."""


def measure_text_width(text: str, height: float) -> float:
    """Return the width of a text whose capitals have a height, both in mm.

    Examples
    --------
    >>> measure_text_width("10", 6.0)  # two units, a gap of two, four units
    8.0
    """
    widths = [_measure_glyph(glyph) for glyph in _find_glyphs(text)]
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
    >>> [path.points.tolist() for path in make_text_strokes("T", 6.0)]
    [[[0.0, 6.0], [4.0, 6.0]], [[2.0, 6.0], [2.0, 0.0]]]
    """
    strokes, x = [], 0
    for glyph in _find_glyphs(text):
        for stroke in glyph.split():
            points = np.array([[int(c) for c in stroke[0::2]], [int(c) for c in stroke[1::2]]], dtype=np.float64).T
            strokes.append(Path.from_points((points + np.array([x, 0])) * (height / CAPITAL_UNITS)))
        x += _measure_glyph(glyph) + GLYPH_GAP
    return tuple(strokes)


def _measure_glyph(glyph: str) -> int:
    """Return the width of a glyph, in units of the grid."""
    return max(map(int, glyph.replace(" ", "")[::2]), default=BLANK_UNITS)


def _find_glyphs(text: str) -> list[str]:
    try:
        return [GLYPHS[letter] for letter in text.upper()]
    except KeyError as error:
        raise InputError(
            f"no stroke is known for {error.args[0]!r} in the label {text!r}: use letters A to Z, digits and .,:-+=/()"
        ) from None
