"""Compensates the kerf: cuts are moved outwards by half of it.

Offset curves have round convex corners, so that the corners of the part that is left stay sharp. Depends on plane paths
only.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from cqblend.argument_checks import check_millimetres
from cqblend.errors import SizeError
from cqblend.patterns.outline.arc_fit import fit_arcs
from cqblend.patterns.outline.overlap import to_polygon
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.stock_proportions import CUTTING_LIMITS


def compensate_kerf(outlines: Sequence[Path], kerf: float, tolerance: float, *, name: str) -> tuple[Path, ...]:
    """Return the paths along which a beam as wide as the kerf cuts a piece with given outlines.

    Parameters
    ----------
    outlines
        Closed: the outer one first, counterclockwise, then holes, clockwise.
    kerf
        Width of the beam, mm.
    tolerance
        Of the arcs of the result, mm; 0 takes :attr:`CuttingLimits.least_arc_tolerance`.
    name
        Of the piece, for messages.

    Returns
    -------
    tuple of Path
        In the same order and orientation: the outer outline is further out, holes are smaller, by kerf / 2.

    Raises
    ------
    InputError
        If the kerf or the tolerance is negative or not a number.
    SizeError
        If a hole, a slit or a notch is narrower than the kerf, so that the beam cannot go round it: it would vanish, or
        too much of its depth would not be cut (:attr:`CuttingLimits.uncut_per_kerf`).

    Examples
    --------
    >>> square = Path.from_points([[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]])
    >>> (line,) = compensate_kerf([square], 0.2, 1e-3, name="1")
    >>> round(line.area, 2), round(100 + 4 * 10 * 0.1 + np.pi * 0.1**2, 2)
    (104.03, 104.03)
    """
    kerf = check_millimetres("the kerf", kerf, zero=True)
    tolerance = check_millimetres("the tolerance of fitted arcs", tolerance, zero=True)
    tolerance = tolerance or CUTTING_LIMITS.least_arc_tolerance
    if kerf == 0:
        return tuple(fit_arcs(path, tolerance) for path in outlines)
    polygon = to_polygon(outlines, tolerance / 4)
    # a quarter of a circle of radius kerf / 2 is divided until the sagitta of the parts is a quarter of the tolerance
    parts = int(np.ceil(np.pi / 4 / np.arccos(max(1 - tolerance / (2 * kerf), 0.0))))
    outside = shapely.buffer(polygon, kerf / 2, quad_segs=parts)
    allowed = float(
        np.clip(CUTTING_LIMITS.uncut_per_kerf * kerf, CUTTING_LIMITS.least_uncut, CUTTING_LIMITS.most_uncut)
    )
    if (
        outside.geom_type != "Polygon"
        or len(outside.interiors) != len(outlines) - 1
        or _measure_uncut(outlines, shapely.buffer(outside, -kerf / 2, quad_segs=parts), tolerance) > allowed
    ):
        raise SizeError(
            f"piece {name} has a hole or a slit that is narrower than the kerf of {kerf:g} mm: "
            "lower the kerf, or divide the face the other way with direction="
        )
    outside = shapely.orient_polygons(outside)
    rings = [outside.exterior, *outside.interiors]
    holes = [shapely.Polygon(ring) for ring in rings[1:]]
    order = [0]
    for path in outlines[1:]:
        inner = shapely.Polygon(path.sampled(tolerance / 4))
        order.append(1 + next(k for k, hole in enumerate(holes) if inner.contains(hole.representative_point())))
    return tuple(fit_arcs(Path.from_points(shapely.get_coordinates(rings[k])), tolerance / 2) for k in order)


def _measure_uncut(outlines: Sequence[Path], left: Any, tolerance: float) -> float:
    """Return the largest distance, mm, from outlines to the border of the polygon that is left when they are cut."""
    points = np.concatenate([path.sampled(tolerance / 4) for path in outlines])
    border = shapely.boundary(left)
    shapely.prepare(border)
    return float(shapely.distance(shapely.points(points), border).max())
