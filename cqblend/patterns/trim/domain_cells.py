"""Trimmed parameter domains cut along parameter lines: the cells that strips keep of a trimmed face.

Exists because a trimming curve is carried onto strips in the parameter plane (Elber 1995, section 3), where the borders
of strips are straight. Every crossing of a loop and a line is a vertex of the loop already, so cutting makes no new
points: each side of a cell is known to be a stretch of a loop or of a line, and neighbours get the very same numbers.
Must not know space, nor what edges mean.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely

from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array

MIN_CORNERS = 3
"""Vertices of a loop at least: fewer enclose nothing."""

ParameterPoint = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class DomainSide:
    """A side of a trimming loop: points (n + 1, 2) along one use of an edge, in the parameter plane."""

    use: int
    points: Array


@dataclass(frozen=True, slots=True, eq=False)
class CutLines:
    """Parameter lines to cut along.

    Attributes
    ----------
    axis
        The parameter that is constant on the lines between rows.
    rows
        Its values, increasing.
    cuts
        By row: values of the other parameter, increasing, at which that row is cut across.
    """

    axis: int
    rows: Array
    cuts: Mapping[int, Sequence[float]] = field(default_factory=dict)

    def list_values(self, axis: int) -> Array:
        """Return all values at which one parameter is constant on a line, increasing."""
        return self.rows if axis == self.axis else np.unique([x for row in self.cuts.values() for x in row])


@dataclass(frozen=True, slots=True)
class BoundaryStep:
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

    start: ParameterPoint
    stop: ParameterPoint
    use: int | None = None
    places: tuple[int, int] = (0, 0)
    line: tuple[int, int] = (0, 0)


@dataclass(frozen=True, slots=True)
class DomainCell:
    """A connected part of a trimmed domain between neighbouring lines.

    Attributes
    ----------
    row
        Between which lines: the i-th row is between lines i - 1 and i.
    loops
        The outer boundary, counterclockwise, then holes, clockwise.
    """

    row: int
    loops: tuple[tuple[BoundaryStep, ...], ...]


def cut_domain(loops: Sequence[Sequence[DomainSide]], lines: CutLines) -> list[DomainCell]:
    """Cut a trimmed domain along lines of one parameter, and the rows between them along lines of the other.

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
        The loops cross each other or themselves.

    Examples
    --------
    >>> corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0], [0.0, 2.0], [0.0, 1.0], [0.0, 0.0]])
    >>> cells = cut([[Side(0, corners)]], Lines(1, np.array([1.0])))
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
    low, high = np.reshape(domain.bounds, (2, 2))
    least = 1e-13 * float(np.prod(high - low))
    reach = (low - (high - low), high + (high - low))
    axis = lines.axis
    values = (lines.list_values(0).tolist(), lines.list_values(1).tolist())
    rows = [reach[0][axis], *lines.rows, reach[1][axis]]
    for row, (bottom, top) in enumerate(pairwise(rows)):
        columns = [reach[0][1 - axis], *lines.cuts.get(row, ()), reach[1][1 - axis]]
        for left, right in pairwise(columns):
            corners = ((left, bottom), (right, top)) if axis == 1 else ((bottom, left), (top, right))
            whole = len(rows) == len(columns) == 2
            part = domain if whole else domain.intersection(shapely.box(*corners[0], *corners[1]))
            borders = [(i, values[i].index(end[i]), end[i]) for end in corners for i in (0, 1) if end[i] in values[i]]
            for polygon in shapely.get_parts(part):
                if isinstance(polygon, shapely.Polygon) and polygon.area > least:
                    yield DomainCell(row, tuple(_label_loops(polygon, known, borders)))


def _label_loops(
    polygon: shapely.Polygon,
    known: dict[tuple[ParameterPoint, ParameterPoint], tuple[int, int]],
    borders: Sequence[tuple[int, int, float]],
) -> Iterator[tuple[BoundaryStep, ...]]:
    """Tell what each side of a cell is; borders are lines: axis, index, value."""
    oriented = shapely.geometry.polygon.orient(polygon)
    for ring in (oriented.exterior, *oriented.interiors):
        steps = []
        for start, stop in pairwise(map(tuple, shapely.get_coordinates(ring).tolist())):
            if (start, stop) in known:
                use, k = known[start, stop]
                steps.append(BoundaryStep(start, stop, use, (k, k + 1)))
            elif (stop, start) in known:
                use, k = known[stop, start]
                steps.append(BoundaryStep(start, stop, use, (k + 1, k)))
            else:
                line = [(axis, i) for axis, i, value in borders if start[axis] == stop[axis] == value]
                if not line:
                    raise GeometryError(f"a trimming loop touches itself between (u, v) = {start} and {stop}")
                steps.append(BoundaryStep(start, stop, line=line[0]))
        yield tuple(steps)
