"""Limits and proportions of what is done to pieces on flat stock, one record for each subject."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class TabLimits:
    """Proportions of tabs, and of the flaps that they are made of.

    Attributes
    ----------
    steepest_leg
        Rad: legs between teeth are at most this steep, so that two of them do not share a cut.
    shallowest_leg
        Rad: legs in pointed corners are at least this steep.
    most_tooth_bend
        Rad: largest angle by which the base of a tooth may turn.
    corner_share
        Part of the angle outside a corner of a piece that the tab on either of its sides may take.
    mitre_limit
        A seam allowance is mitred at corners of its piece: it may reach beyond the end of its run by this multiple of
        its width.
    corner_angle
        Rad: where a run turns by more at a vertex it has a corner, at which a tab ends and another begins.
    same_corner
        Relative to the length of a seam: corners on its two sides that are closer are one corner.
    least_height
        Mm: tabs that would be lower are dropped, unless a quarter of their width is less.
    least_height_ratio
        Least height of tabs relative to their width, if the caller names none.
    most_teeth
        Largest number of teeth of a pattern: a few thousand take a second.
    same_curve
        Relative to the width of tabs: curves that are closer than this are the same, or straight.
    least_top_ratio
        Least width of a flap at its top, relative to that at its base.
    lowering_ratio
        Ratio by which the height of a flap that does not fit is reduced.
    inset_ratio
        Relative to the width of tabs: inset of flaps when they are tested, so that those that touch do not overlap.
    """

    steepest_leg: float = float(np.radians(75.0))
    shallowest_leg: float = float(np.radians(3.0))
    most_tooth_bend: float = float(np.pi / 6)
    corner_share: float = 0.45
    mitre_limit: float = 2.0
    tooth_corner_angle: float = float(np.radians(20.0))
    same_corner: float = 1e-6
    least_height: float = 2.0
    least_height_ratio: float = 0.25
    most_teeth: int = 20_000
    same_curve: float = 0.02
    least_top_ratio: float = 0.25
    lowering_ratio: float = 0.8
    inset_ratio: float = 1e-3


@dataclass(frozen=True, slots=True)
class LabelLimits:
    """Sizes of labels; lengths relative to the height of their capitals if not in mm.

    Attributes
    ----------
    height
        Of the capitals, unless the caller names one, mm.
    least_height_ratio
        Least height of a label relative to the height that is wanted, if the caller names none.
    margin
        Space kept free around a label.
    height_step
        Ratio of the heights that are tried one after another.
    name_height_ratio
        Height of a piece's name relative to that of the labels of its seams, where there is room.
    chord_divisor
        The outline of a piece is replaced by a polygon within the height of the labels over this.
    """

    height: float = 4.0
    least_height_ratio: float = 0.25
    label_margin: float = 0.25
    height_step: float = 0.8
    name_height_ratio: float = 1.5
    chord_divisor: float = 50.0


@dataclass(frozen=True, slots=True)
class CuttingLimits:
    """Limits of cutting pieces that are larger than a sheet, and of cutting with a kerf.

    Attributes
    ----------
    vertex_clearance
        Least distance of a cut from the vertices of the outline, relative to the size of the piece.
    end_clearance
        Relative to the longer side of the sheet: cuts that are nearer to the ends of runs are avoided, since labels
        need room.
    most_parts
        Largest number of parts of one piece.
    hull_tolerance
        Mm: how far arcs are from the polygon that is fitted to the sheet.
    least_arc_tolerance
        Mm: tolerance of arcs along the kerf where the outline itself is not to be fitted.
    uncut_per_kerf
        How far a beam may stay away from the outline, in kerfs. A beam of width k stays (1 / sin(a / 2) - 1) k / 2 away
        from the tip of a notch with the angle a: 0.21 k if that is right.
    least_uncut, most_uncut
        Mm: bounds between which that distance is clamped.
    """

    vertex_clearance: float = 1e-6
    end_clearance: float = 0.1
    most_parts: int = 1000
    hull_tolerance: float = 1e-3
    least_arc_tolerance: float = 1e-4
    uncut_per_kerf: float = 0.25
    least_uncut: float = 0.5
    most_uncut: float = 1.5


@dataclass(frozen=True, slots=True)
class PackingLimits:
    """Resolution and effort of packing pieces on sheets.

    Attributes
    ----------
    cells_per_side
        Number of grid cells along the longer side of a sheet.
    polygon_tolerance
        Mm: how far arcs are from the polygons that are packed, and tested for overlap.
    cell_tolerance
        Relative to a cell: to what tolerance polygons are simplified before they are drawn on the grid.
    disc_safety
        Factor on the distance that pieces are grown by: discs are polygons, which lie inside their circles.
    usual_width
        Width of a sheet without given size, relative to the square root of the area of all bounding boxes.
    many_pieces
        Of more pieces than these, only the usual width is tried, and two of the four quarter turns.
    outline_tolerance
        Mm: outlines are simplified to this tolerance for spyrrow, and grown by as much.
    grace_seconds
        S: how much longer than asked spyrrow's process may take to start and to end.
    """

    cells_per_side: int = 500
    polygon_tolerance: float = 1e-3
    cell_tolerance: float = 0.01
    disc_safety: float = 1.01
    usual_width: float = 1.05
    many_pieces: int = 60
    outline_tolerance: float = 0.02
    grace_seconds: float = 30.0


TAB_LIMITS = TabLimits()
LABEL_LIMITS = LabelLimits()
CUTTING_LIMITS = CuttingLimits()
PACKING_LIMITS = PackingLimits()
