"""Does a flat piece cover itself: a cone developed beyond a full turn, a saddle's ring, a hole outside its outline.

Exists because a layout that overlaps itself cannot be cut, and looks right in every other figure. Told by winding
numbers, so that an outline that goes round twice is found although it may not cross itself where one looks. Must not
know how the outline came about, nor what is done about it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from cqblend.errors import GeometryError
from cqblend.patterns.outline.pieces import Piece
from cqblend.patterns.outline.plane_path import Path
from cqblend.splines.bernstein import Array

FINE_CHORDS = 1e-6
"""Arcs are replaced by chords this close to them, relative to the size."""

COARSE_CHORDS = 1e-3
"""The same for a first look."""

SLIVER = 1e-9
"""Areas that are thinner than this, relative to the size, are rounding of touching borders."""


@dataclass(frozen=True, slots=True, eq=False)
class Overlap:
    """Where outlines cover the plane more than once, or less than not at all. False if nowhere.

    Attributes
    ----------
    area
        mm^2, each region counted as often as it is covered too much; 0.0 if there is none.
    place
        (2,), a point well inside the largest region; None if there is none.
    regions
        (m, 2) each: outlines of the regions, the largest first.
    """

    area: float = 0.0
    place: Array | None = None
    regions: tuple[Array, ...] = ()

    def __bool__(self) -> bool:
        return self.area > 0


def find_overlap(piece: Piece) -> Overlap:
    """Return where a piece covers itself; its tabs are not looked at.

    Raises
    ------
    GeometryError
        If a coordinate is not finite.

    Examples
    --------
    >>> from cqblend.patterns.outline.pieces import Run
    >>> path = Path.straight([[0, 0], [2, 0], [2, 2], [1, 2], [1, -1], [0, -1], [0, 0]])
    >>> crossing = overlap(Piece("1", ((Run(path, np.zeros((7, 3)), "trim"),),)))
    >>> bool(crossing), crossing.area, crossing.place
    (True, 1.0, array([ 0.5, -0.5]))
    """
    if not all(np.isfinite(run.path.points).all() and np.isfinite(run.path.bulges).all() for *_, run in piece.runs()):
        raise GeometryError(f"piece {piece.name} has coordinates that are not finite")
    return find_winding_errors(piece.outlines)


def has_overlap(piece: Piece) -> bool:
    """Return whether a piece covers itself anywhere: soon where it does so for the most part, as coils do."""
    paths = piece.outlines
    size = float(np.linalg.norm(np.ptp(np.concatenate([path.points for path in paths]), axis=0)))
    blurred = 2 * COARSE_CHORDS * size * sum(path.length for path in paths)
    return find_winding_errors(paths, COARSE_CHORDS).area > blurred or bool(find_overlap(piece))


def find_winding_errors(paths: Sequence[Path], fineness: float = FINE_CHORDS) -> Overlap:
    """Return where closed paths do not wind once or not at all.

    Arcs are replaced by chords that are as close as the fineness says, relative to the size. With outlines
    counterclockwise and holes clockwise, a point of the piece has winding number 1, one outside it or in a hole 0.
    More is covered twice; less is a hole outside the outline, or an outline that runs the wrong way.
    """
    corners = np.concatenate([path.points for path in paths])
    size = float(np.linalg.norm(np.ptp(corners, axis=0)))
    if size == 0:
        return Overlap()
    loops = [_close_exactly(path.sampled(fineness * size)) for path in paths]
    if _is_valid_polygon(loops):
        return Overlap()
    lines = shapely.linestrings(np.concatenate(loops), indices=np.repeat(np.arange(len(loops)), [*map(len, loops)]))
    cells = shapely.get_parts(shapely.polygonize([shapely.unary_union(lines)]))
    areas, perimeters = shapely.area(cells), shapely.length(cells)
    cells = cells[areas > SLIVER * size * perimeters]
    inside = shapely.point_on_surface(cells)
    turns = _count_windings(np.column_stack([shapely.get_x(inside), shapely.get_y(inside)]), loops)
    excess = np.maximum(turns - 1, -turns)
    wrong = np.flatnonzero(excess > 0)
    if not len(wrong):
        return Overlap()
    areas = shapely.area(cells[wrong])
    order = np.argsort(-areas, kind="stable")
    place = inside[wrong[order[0]]]
    return Overlap(
        float((areas * excess[wrong]).sum()),
        np.array([place.x, place.y]),
        tuple(shapely.get_coordinates(cells[wrong[k]].exterior) for k in order),
    )


def to_polygon(paths: Sequence[Path], tolerance: float) -> Any:
    """Return the shapely polygon that closed paths bound, the first of them outside, to a tolerance."""
    shell, *holes = (_close_exactly(path.sampled(tolerance)) for path in paths)
    return shapely.make_valid(shapely.Polygon(shell, holes))


def _close_exactly(points: Array) -> Array:
    """Return points of a loop, its end made its beginning exactly."""
    points = points.copy()
    points[-1] = points[0]
    return points


def _is_valid_polygon(loops: list[Array]) -> bool:
    """Return whether loops are the border of a polygon as it should be: the common case, told fast."""
    if min(map(len, loops)) < 4:
        return False
    rings = shapely.linearrings(np.concatenate(loops), indices=np.repeat(np.arange(len(loops)), [*map(len, loops)]))
    turns_left = shapely.is_ccw(rings)
    return bool(
        turns_left[0] and not turns_left[1:].any() and shapely.is_valid(shapely.polygons(rings[0], holes=rings[1:]))
    )


def _count_windings(points: Array, loops: list[Array]) -> Array:
    """Return how often loops wind round points (m,): the crossings of a ray to the right, upwards minus downwards."""
    start = np.concatenate([loop[:-1] for loop in loops])
    stop = np.concatenate([loop[1:] for loop in loops])
    step = stop - start
    turns = np.empty(len(points), dtype=int)
    for k, (x, y) in enumerate(points):
        up = (start[:, 1] <= y) & (y < stop[:, 1])
        down = (stop[:, 1] <= y) & (y < start[:, 1])
        left = step[:, 0] * (y - start[:, 1]) - step[:, 1] * (x - start[:, 0])  # above 0 if the point is to the left
        turns[k] = np.count_nonzero(up & (left > 0)) - np.count_nonzero(down & (left < 0))
    return turns
