"""Finds where a flat piece overlaps itself, by winding numbers: such a piece cannot be cut.

Examples are a cone that is developed beyond a full turn, the ring of a saddle, and a hole outside its outline. A
winding number above 1 is an overlap, one below 0 an inverted region; an outline that goes round twice is found although
it need not cross itself. Depends on pieces and paths only.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from cqblend.errors import GeometryError
from cqblend.patterns.outline.pieces import Piece
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.outline.tolerances import OUTLINE_TOLERANCES
from cqblend.splines.bernstein import Array


@dataclass(frozen=True, slots=True, eq=False)
class Overlap:
    """Regions where outlines have a winding number above 1 (overlap) or below 0 (inverted). False if there are none.

    Attributes
    ----------
    area
        Total, mm^2; each region counts as often as its winding number is above 1 or below 0. 0.0 if there is none.
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
    """Return where a piece overlaps itself, its tabs left aside.

    Raises
    ------
    GeometryError
        If a coordinate is not finite.

    Examples
    --------
    >>> from cqblend.patterns.outline.pieces import Run
    >>> path = Path.from_points([[0, 0], [2, 0], [2, 2], [1, 2], [1, -1], [0, -1], [0, 0]])
    >>> crossing = find_overlap(Piece("1", ((Run(path, np.zeros((7, 3)), "trim"),),)))
    >>> bool(crossing), crossing.area, crossing.place
    (True, 1.0, array([ 0.5, -0.5]))
    """
    if not all(np.isfinite(run.path.points).all() and np.isfinite(run.path.bulges).all() for *_, run in piece.runs()):
        raise GeometryError(f"piece {piece.name} has coordinates that are not finite")
    return find_winding_errors(piece.outlines)


def has_overlap(piece: Piece) -> bool:
    """Return whether a piece overlaps itself; faster than :func:`find_overlap` where it does so widely, as coils do."""
    paths = piece.outlines
    size = float(np.linalg.norm(np.ptp(np.concatenate([path.points for path in paths]), axis=0)))
    coarse = OUTLINE_TOLERANCES.coarse_chords
    uncertain_area = 2 * coarse * size * sum(path.length for path in paths)
    return find_winding_errors(paths, coarse).area > uncertain_area or bool(find_overlap(piece))


def find_winding_errors(paths: Sequence[Path], chord_tolerance: float = OUTLINE_TOLERANCES.fine_chords) -> Overlap:
    """Return the regions in which the winding number of closed paths is neither 0 nor 1.

    Arcs are replaced by chords within `chord_tolerance`, relative to the size. With outlines counterclockwise and holes
    clockwise, a point of the piece has winding number 1, one outside it or in a hole 0. A number above 1 is covered
    twice; one below 0 is a hole outside the outline, or an outline of the wrong orientation.
    """
    corners = np.concatenate([path.points for path in paths])
    size = float(np.linalg.norm(np.ptp(corners, axis=0)))
    if size == 0:
        return Overlap()
    loops = [_close_exactly(path.sampled(chord_tolerance * size)) for path in paths]
    if _is_valid_polygon(loops):
        return Overlap()
    lines = shapely.linestrings(np.concatenate(loops), indices=np.repeat(np.arange(len(loops)), [*map(len, loops)]))
    cells = shapely.get_parts(shapely.polygonize([shapely.unary_union(lines)]))
    areas, perimeters = shapely.area(cells), shapely.length(cells)
    cells = cells[areas > OUTLINE_TOLERANCES.sliver_width * size * perimeters]
    inside = shapely.point_on_surface(cells)
    windings = _count_windings(np.column_stack([shapely.get_x(inside), shapely.get_y(inside)]), loops)
    excess = np.maximum(windings - 1, -windings)
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
    """Return the shapely polygon with the first of closed paths as its shell, the others as holes, to a tolerance."""
    shell, *holes = (_close_exactly(path.sampled(tolerance)) for path in paths)
    return shapely.make_valid(shapely.Polygon(shell, holes))


def _close_exactly(points: Array) -> Array:
    """Return the points of a loop, the last replaced by the first, from which rounding may have parted it."""
    points = points.copy()
    points[-1] = points[0]
    return points


def _is_valid_polygon(loops: list[Array]) -> bool:
    """Return whether loops are a valid polygon, shell counterclockwise and holes clockwise: the common case, fast."""
    if min(map(len, loops)) < 4:
        return False
    rings = shapely.linearrings(np.concatenate(loops), indices=np.repeat(np.arange(len(loops)), [*map(len, loops)]))
    counterclockwise = shapely.is_ccw(rings)
    oriented = counterclockwise[0] and not counterclockwise[1:].any()
    return bool(oriented and shapely.is_valid(shapely.polygons(rings[0], holes=rings[1:])))


def _count_windings(points: Array, loops: list[Array]) -> Array:
    """Return the winding numbers (m,) of loops about points (m, 2): crossings of a ray to the right, up minus down."""
    start = np.concatenate([loop[:-1] for loop in loops])
    stop = np.concatenate([loop[1:] for loop in loops])
    step = stop - start
    windings = np.empty(len(points), dtype=int)
    for k, (x, y) in enumerate(points):
        up = (start[:, 1] <= y) & (y < stop[:, 1])
        down = (stop[:, 1] <= y) & (y < start[:, 1])
        left = step[:, 0] * (y - start[:, 1]) - step[:, 1] * (x - start[:, 0])  # above 0 if the point is to the left
        windings[k] = np.count_nonzero(up & (left > 0)) - np.count_nonzero(down & (left < 0))
    return windings
