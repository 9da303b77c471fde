"""A trimmed parameter domain cut along parameter lines into the cells that strips keep of a trimmed face.

A trimming curve is mapped to the strips in the parameter plane (Elber 1995, section 3), where the borders of strips are
straight. Every crossing of a loop and a line is a vertex of the loop already, so cutting makes no new points on loops:
each side of a cell is a stretch of a loop or of a line, and neighbouring cells get the very same numbers. Depends on
arrays only.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely

from cqblend.errors import GeometryError
from cqblend.patterns.trimming.tolerances import TRIM_TOLERANCES
from cqblend.splines.bernstein import Array

MIN_CORNERS = 3
"""Least number of vertices of a loop: fewer enclose nothing."""

ParameterPoint = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class DomainSide:
    """A side of a trimming loop.

    Attributes
    ----------
    use_index
        Number of the use of an edge that the side is, counted over all loops of the patch.
    points
        (n + 1, 2) vertices (u, v) along it.
    """

    use_index: int
    points: Array


@dataclass(frozen=True, slots=True, eq=False)
class CutLines:
    """Parameter lines to cut along.

    Attributes
    ----------
    axis
        The parameter that is constant on the lines between strips: 0 for u, 1 for v.
    strip_borders
        Its values there, increasing.
    cross_cuts
        By index of the strip: values of the other parameter, increasing, at which that strip is cut across.
    """

    axis: int
    strip_borders: Array
    cross_cuts: Mapping[int, Sequence[float]] = field(default_factory=dict)

    def list_values(self, axis: int) -> Array:
        """Return the values, increasing, of one parameter (0 for u, 1 for v) on the lines on which it is constant."""
        if axis == self.axis:
            return self.strip_borders
        return np.unique([value for cuts in self.cross_cuts.values() for value in cuts])


@dataclass(frozen=True, slots=True)
class EdgeStep:
    """From one vertex of a cell to the next along an edge.

    Attributes
    ----------
    start, stop
        The vertices (u, v).
    use_index
        Number of the use of the edge, as of :class:`DomainSide`.
    point_indices
        Indices of both vertices among the points of that side.
    """

    start: ParameterPoint
    stop: ParameterPoint
    use_index: int
    point_indices: tuple[int, int]


@dataclass(frozen=True, slots=True)
class LineStep:
    """From one vertex of a cell to the next along a cut line.

    Attributes
    ----------
    start, stop
        The vertices (u, v).
    axis
        The parameter that is constant on the line: 0 for u, 1 for v.
    line_index
        Index of the line among those of its axis.
    """

    start: ParameterPoint
    stop: ParameterPoint
    axis: int
    line_index: int


BoundaryStep = EdgeStep | LineStep


@dataclass(frozen=True, slots=True)
class DomainCell:
    """A connected part of a trimmed domain between neighbouring lines.

    Attributes
    ----------
    strip_index
        Of the strip that it is part of: the i-th one is between borders i - 1 and i.
    loops
        The outer boundary, counterclockwise, then holes, clockwise.
    """

    strip_index: int
    loops: tuple[tuple[BoundaryStep, ...], ...]


def cut_domain(loops: Sequence[Sequence[DomainSide]], lines: CutLines) -> list[DomainCell]:
    """Cut a trimmed domain along the borders of strips, and strips across, into connected cells.

    Parameters
    ----------
    loops
        Closed chains of sides; the outer one first, each side starts where the one before ends. Where a loop crosses a
        line it has a vertex with exactly that parameter.
    lines
        Where to cut.

    Raises
    ------
    GeometryError
        If the loops cross each other or themselves, or one has fewer than three vertices.

    Examples
    --------
    >>> corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0], [0.0, 2.0], [0.0, 1.0], [0.0, 0.0]])
    >>> cells = cut_domain([[DomainSide(0, corners)]], CutLines(1, np.array([1.0])))
    >>> [len(cell.loops[0]) for cell in cells]
    [4, 4]
    """
    rings = [np.concatenate([side.points[:-1] for side in loop]) for loop in loops]
    known = {
        (start, stop): (side.use_index, k)
        for loop, ring in zip(loops, rings, strict=True)
        for (side, k), (start, stop) in zip(
            ((side, k) for side in loop for k in range(len(side.points) - 1)),
            pairwise(map(tuple, [*ring.tolist(), ring[0].tolist()])),
            strict=True,
        )
    }
    for ring in rings:
        if len(ring) < MIN_CORNERS or not np.isfinite(ring).all():
            raise GeometryError(
                f"a trimming loop of {len(ring)} vertices, the first at (u, v) = {tuple(ring[0].tolist())}, encloses "
                "nothing: the face is a sliver; repair it, or take a smaller tolerance"
            )
    domain = shapely.Polygon(rings[0], rings[1:])
    if not domain.is_valid:
        raise GeometryError(f"the trimming loops are not simple: {shapely.is_valid_reason(domain)} (u, v)")
    try:
        return list(_generate_cells(domain, known, lines))
    except shapely.errors.GEOSException as error:
        raise GeometryError(f"the trimming loops cannot be cut along parameter lines: {error}") from error


def _generate_cells(
    domain: shapely.Polygon, known: dict[tuple[ParameterPoint, ParameterPoint], tuple[int, int]], lines: CutLines
) -> Iterator[DomainCell]:
    """Intersect the domain with the rectangle of each strip, or part of it between cross cuts.

    `known` gives the side, by its use index, and the place of the segment in it for every segment of the loops.
    """
    low, high = np.reshape(domain.bounds, (2, 2))
    smallest = TRIM_TOLERANCES.smallest_cell * float(np.prod(high - low))
    outside = (low - (high - low), high + (high - low))
    axis = lines.axis
    values = (lines.list_values(0).tolist(), lines.list_values(1).tolist())
    borders = [outside[0][axis], *lines.strip_borders, outside[1][axis]]
    for strip_index, (bottom, top) in enumerate(pairwise(borders)):
        cuts = [outside[0][1 - axis], *lines.cross_cuts.get(strip_index, ()), outside[1][1 - axis]]
        for left, right in pairwise(cuts):
            corners = ((left, bottom), (right, top)) if axis == 1 else ((bottom, left), (top, right))
            is_whole = len(borders) == len(cuts) == 2
            part = domain if is_whole else domain.intersection(shapely.box(*corners[0], *corners[1]))
            sides = [(i, values[i].index(end[i]), end[i]) for end in corners for i in (0, 1) if end[i] in values[i]]
            for polygon in shapely.get_parts(part):
                if isinstance(polygon, shapely.Polygon) and polygon.area > smallest:
                    yield DomainCell(strip_index, tuple(_label_loops(polygon, known, sides)))


def _label_loops(
    polygon: shapely.Polygon,
    known: dict[tuple[ParameterPoint, ParameterPoint], tuple[int, int]],
    lines: Sequence[tuple[int, int, float]],
) -> Iterator[tuple[BoundaryStep, ...]]:
    """Identify each side of a cell as part of an edge or of one of the given lines: axis, index, value."""
    oriented = shapely.geometry.polygon.orient(polygon)
    for ring in (oriented.exterior, *oriented.interiors):
        steps: list[BoundaryStep] = []
        for start, stop in pairwise(map(tuple, shapely.get_coordinates(ring).tolist())):
            if (start, stop) in known:
                use_index, k = known[start, stop]
                steps.append(EdgeStep(start, stop, use_index, (k, k + 1)))
            elif (stop, start) in known:
                use_index, k = known[stop, start]
                steps.append(EdgeStep(start, stop, use_index, (k + 1, k)))
            else:
                met = [(axis, i) for axis, i, value in lines if start[axis] == stop[axis] == value]
                if not met:
                    raise GeometryError(f"a trimming loop touches itself between (u, v) = {start} and {stop}")
                steps.append(LineStep(start, stop, *met[0]))
        yield tuple(steps)
