"""Tolerances and limits of plane outlines."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class OutlineTolerances:
    """Tolerances of paths, of pieces and of the test for overlap.

    Attributes
    ----------
    corner_angle
        Rad: vertices at which a path turns by more are corners, which the fitting of arcs keeps.
    fold_angle
        Rad: a seam across which the surface turns by less is no fold; what lies flat beneath both pieces stays flat.
    least_mitre_cosine
        Least cosine of half the angle by which a path turns at a vertex that the offset of this vertex is computed
        with. Mitred corners of offset curves lie at most the inverse of it, four offset distances, from the vertex.
    rounding_of_stations
        Relative to the length of a path: stations along it that are closer than this are one.
    rounding_of_boxes
        Relative to the size of a sheet: by how much a box that fits may exceed it.
    arc_error_margin
        Factor on the largest sampled distance between a curve and the arc it is replaced by: it covers what lies
        between the samples, and that a strip may be stretched when it is rolled.
    fine_chords
        Relative to the size of a piece: how far arcs are from the chords that replace them in the test for overlap.
    coarse_chords
        The same in the quick test that finds the gross overlaps of coils.
    sliver_width
        Relative to the size of a piece: regions that are thinner are rounding of borders that touch.
    """

    corner_angle: float = 0.2
    fold_angle: float = float(np.radians(1.0))
    least_mitre_cosine: float = 0.25
    rounding_of_stations: float = 1e-9
    rounding_of_boxes: float = 1e-12
    arc_error_margin: float = 1.25
    fine_chords: float = 1e-6
    coarse_chords: float = 1e-3
    sliver_width: float = 1e-9


OUTLINE_TOLERANCES = OutlineTolerances()
