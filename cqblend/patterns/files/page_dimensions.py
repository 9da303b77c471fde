"""Layout of drawings and of printed pages: the lengths that writers share."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class DrawingLayout:
    """Lengths of drawings, mm unless told otherwise.

    Attributes
    ----------
    arc_tolerance
        How far fitted arcs may be from outlines, unless the caller names a tolerance: well below what cutters hold.
    box_tolerance
        How far arcs are from the polygons by which free places and the extents of paths are found.
    note_clearance
        Distance of notes and legends from pieces and from the border of the sheet.
    note_line_spacing
        Distance of the lines of notes, in heights of their capitals.
    sheet_gap
        Distance of sheets that are drawn beside each other.
    tried_places
        Number of positions in each direction at which a free place is looked for.
    """

    arc_tolerance: float = 2e-3
    box_tolerance: float = 0.1
    note_clearance: float = 2.0
    note_line_spacing: float = 1.75
    sheet_gap: float = 10.0
    tried_places: int = 41


@dataclass(frozen=True, slots=True)
class PageLayout:
    """Lengths of printed pages, mm unless told otherwise.

    Attributes
    ----------
    mm_per_point
        PDF counts in points of 1/72 inch.
    margin
        Of pages, unless the caller names one.
    footer_height
        Height of the scale bar and the legend below the drawing.
    least_tile
        Least width and height of what margins and footer leave of a page: the bar and the legend need room.
    bleed
        How far the drawing goes on beyond the crosses at the corners of a tile.
    cross_arm
        From the middle of a cross to its ends.
    line_width
        Of the scale bar and of crosses.
    scale_bar_length, scale_bar_parts
        Length of the scale bar, and number of its parts.
    long_tick, short_tick
        Heights of the ticks of the scale bar, long at its ends and in its middle.
    font, text_size
        Name of the embedded font, and size of its letters.
    legend_line, legend_gap, legend_width
        Length of the line of each layer in the legend, distance of the text from it, and width of the legend in one
        column.
    cubic_angle
        Rad: arcs are divided into cubics of at most this angle, whose radius is right to 4e-7.
    """

    mm_per_point: float = 25.4 / 72
    margin: float = 10.0
    footer_height: float = 16.0
    least_tile: tuple[float, float] = (118.0, 40.0)
    bleed: float = 3.0
    cross_arm: float = 4.0
    line_width: float = 0.1
    scale_bar_length: float = 100.0
    scale_bar_parts: int = 10
    long_tick: float = 2.0
    short_tick: float = 1.0
    font: str = "Vera"
    text_size: float = 2.6
    legend_line: float = 8.0
    legend_gap: float = 1.0
    legend_width: float = 32.0
    cubic_angle: float = float(np.pi / 6)

    @property
    def line_height(self) -> float:
        """Distance of lines of text."""
        return 1.5 * self.text_size


DRAWING_LAYOUT = DrawingLayout()
PAGE_LAYOUT = PageLayout()
