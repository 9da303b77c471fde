"""Trimmed parameter domains cut along parameter lines: the cells that strips keep of a trimmed face.

Exists because a trimming curve is carried onto strips in the parameter plane (Elber 1995, section 3), where the borders
of strips are straight. Every crossing of a loop and a line is a vertex of the loop already, so cutting makes no new
points: each side of a cell is known to be a stretch of a loop or of a line, and neighbours get the very same numbers.
Must not know space, nor what edges mean.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """A side of a trimming loop: points (n + 1, 2) along one use of an edge, in the parameter plane."""

    use: int
    points: Array


@dataclass(frozen=True, slots=True)
class Step:
    """From one vertex of a cell to the next.

    Attributes
    ----------
    start, stop
        The vertices (u, v).
    use
        Of the edge that is followed, None on a line.
    places
        On an edge, the indices of both vertices among the points of its side.
    line
        On a line, its axis (0 for u = const, 1 for v = const) and its index among the lines of that axis.
    """

    start: Point
    stop: Point
    use: int | None = None
    places: tuple[int, int] = (0, 0)
    line: tuple[int, int] = (0, 0)


@dataclass(frozen=True, slots=True)
class Cell:
    """A connected part of a trimmed domain between neighbouring lines.

    Attributes
    ----------
    column, row
        Between which lines u = const and v = const: the i-th is between lines i - 1 and i.
    loops
        The outer boundary, counterclockwise, then holes, clockwise.
    """

    column: int
    row: int
    loops: tuple[tuple[Step, ...], ...]


def cut(loops: Sequence[Sequence[Side]], lines: tuple[Array, Array]) -> list[Cell]:
    """Cut a trimmed domain along lines u = const and v = const.

    Parameters
    ----------
    loops
        Closed chains of sides; the outer one first, each side starts where the one before ends. Where a loop crosses a
        line it has a vertex with exactly that parameter.
    lines
        The cuts in u and in v, increasing.

    Raises
    ------
    GeometryError
        The loops cross each other or themselves.

    Examples
    --------
    >>> corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0], [0.0, 2.0], [0.0, 1.0], [0.0, 0.0]])
    >>> cells = cut([[Side(0, corners)]], (np.empty(0), np.array([1.0])))
    >>> [len(cell.loops[0]) for cell in cells]
    [4, 4]
    """
    rings = [np.concatenate([side.points[:-1] for side in loop]) for loop in loops]
    known = {
        (start, stop): (side.use, k)
        for loop, ring in zip(loops, rings, strict=True)
        for (side, k), (start, stop) in zip(
            ((side, k) for side in loop for k in range(len(side.points) - 1)),
            pairwise(map(tuple, [*ring.tolist(), ring[0].tolist()])),
            strict=True,
        )
    }
    domain = shapely.Polygon(rings[0], rings[1:])
    if not domain.is_valid:
        raise GeometryError(f"the trimming loops are not simple: {shapely.is_valid_reason(domain)} (u, v)")
    return list(_cells(domain, known, lines))


def _cells(
    domain: shapely.Polygon, known: dict[tuple[Point, Point], tuple[int, int]], lines: tuple[Array, Array]
) -> Iterator[Cell]:
    u0, v0, u1, v1 = domain.bounds
    edges = [
        [low - (high - low), *values.tolist(), high + (high - low)]
        for low, high, values in ((u0, u1, lines[0]), (v0, v1, lines[1]))
    ]
    least = 1e-13 * (u1 - u0) * (v1 - v0)
    whole = len(edges[0]) == len(edges[1]) == 2
    for row, (bottom, top) in enumerate(pairwise(edges[1])):
        for column, (left, right) in enumerate(pairwise(edges[0])):
            part = domain if whole else domain.intersection(shapely.box(left, bottom, right, top))
            for polygon in shapely.get_parts(part):
                if isinstance(polygon, shapely.Polygon) and polygon.area > least:
                    yield _cell(polygon, column, row, known, lines)


def _cell(
    polygon: shapely.Polygon,
    column: int,
    row: int,
    known: dict[tuple[Point, Point], tuple[int, int]],
    lines: tuple[Array, Array],
) -> Cell:
    oriented = shapely.geometry.polygon.orient(polygon)
    around = ((0, column - 1), (0, column), (1, row - 1), (1, row))
    borders = [(axis, i, lines[axis][i]) for axis, i in around if 0 <= i < len(lines[axis])]
    loops = []
    for ring in (oriented.exterior, *oriented.interiors):
        steps = []
        for start, stop in pairwise(map(tuple, shapely.get_coordinates(ring).tolist())):
            if (start, stop) in known:
                use, k = known[start, stop]
                steps.append(Step(start, stop, use, (k, k + 1)))
            elif (stop, start) in known:
                use, k = known[stop, start]
                steps.append(Step(start, stop, use, (k + 1, k)))
            else:
                line = [(axis, i) for axis, i, value in borders if start[axis] == stop[axis] == value]
                if not line:
                    raise GeometryError(f"a trimming loop touches itself between (u, v) = {start} and {stop}")
                steps.append(Step(start, stop, line=line[0]))
        loops.append(tuple(steps))
    return Cell(column, row, tuple(loops))
