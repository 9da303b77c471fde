"""Vertices along shared edges: one set for both neighbours of each.

Exists so that the pieces on both sides of an edge have their vertices at the same places in space. There is a vertex
wherever the edge passes from one strip to another, on either side, and enough of them in between for circular arcs to
follow the edge. Must not know how strips are laid flat.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import GeometryError
from cqblend.patterns.trim.domain_cells import CutLines
from cqblend.patterns.trim.trimmed_patch import CurveFunction, EdgeUse, PatchEdge
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import bisect_intervals

LINE_SNAP_SHARE = 1e-9
"""A parameter closer to a line than this part of the lines' extent is on it."""

UseWithLines = tuple[EdgeUse, CutLines, tuple[float, float]]
"""A use of an edge, the lines that its patch is cut at, and the extent of the patch's parameters."""

_MAX_VERTICES = 20_000
_MAX_SAGITTA_RATIO = 0.13
"""Sagitta to chord of a circular arc of 60 degrees."""


def snap_to_lines(uv: Array, lines: CutLines, extent: tuple[float, float]) -> Array:
    """Return points (n, 2) of the parameter plane of which those next to a line are put on it exactly.

    Next to it is closer than a billionth of the extent of that parameter.
    """
    result = uv.copy()
    for axis in (0, 1):
        values = lines.list_values(axis)
        if len(values):
            nearest = values[np.abs(uv[:, axis, None] - values).argmin(axis=1)]
            result[:, axis] = np.where(
                np.abs(nearest - uv[:, axis]) <= LINE_SNAP_SHARE * extent[axis], nearest, uv[:, axis]
            )
    return result


def find_crossings(use: EdgeUse, lines: CutLines, extent: tuple[float, float], t: Array) -> tuple[Array, Array, Array]:
    """Find where an edge crosses lines of a patch.

    Parameters
    ----------
    t
        (n,) increasing samples between which an edge crosses a line once at most.

    Returns
    -------
    t, axis, value
        (k,) each, unsorted: parameters of the edge, and the lines.
    """
    uv = snap_to_lines(use.pcurve(t), lines, extent)
    found = [(np.empty(0), np.empty(0, dtype=int), np.empty(0))]
    for axis in (0, 1):
        values = lines.list_values(axis)
        off = np.sign(uv[:, axis, None] - values)
        place, line = np.nonzero((off == 0) & ~(off == 0).all(axis=0))
        found.append((t[place], np.full(len(place), axis), values[line]))
        place, line = np.nonzero(off[:-1] * off[1:] < 0)
        low, high, side, value = t[place], t[place + 1], off[place, line], values[line]

        def is_before_line(t: Array, axis: int = axis, side: Array = side, value: Array = value) -> Array:
            return np.asarray((use.pcurve(t)[:, axis] - value) * side > 0)

        low, high = bisect_intervals(is_before_line, low, high)
        found.append(((low + high) / 2, np.full(len(place), axis), value))
    at, axes, on = zip(*found, strict=True)
    return np.concatenate(at), np.concatenate(axes), np.concatenate(on)


def merge_parameters(t: Array, window: float, fixed: Array) -> Array:
    """Return sorted parameters of which those within a window of their predecessor, or of a fixed one, are left out."""
    result = list(fixed)
    for value in np.sort(t):
        if min(abs(value - other) for other in result) > window:
            result.append(value)
    return np.sort(result)


def refine_parameters(points: CurveFunction, t: Array, tolerance: float, sagitta: float) -> Array:
    """Insert parameters until arcs of circles between neighbours follow a curve.

    Parameters
    ----------
    points
        Of the curve in space.
    t
        (n,) parameters that are kept.
    tolerance
        For the distance of the curve from an arc, mm.
    sagitta
        For the distance of the curve from its chord, mm.

    Raises
    ------
    GeometryError
        More than 20,000 parameters would be needed.
    """
    done = np.zeros(len(t) - 1, dtype=bool)
    while not done.all():
        if len(t) > _MAX_VERTICES:
            raise GeometryError(
                f"the edge needs more than {_MAX_VERTICES} vertices for {tolerance:.3g} mm; loosen the tolerance"
            )
        open_ = np.flatnonzero(~done)
        start, width = t[open_], np.diff(t)[open_]
        five = points((start[:, None] + width[:, None] * np.arange(5) / 4).ravel()).reshape(len(open_), 5, 3)
        done[open_] = _is_near_arc(five, tolerance, sagitta) | (width <= 1e-9 * (t[-1] - t[0]))
        split = np.flatnonzero(~done)
        middle = (t[split] + t[split + 1]) / 2
        # the halves of what is split are open again
        t, done = np.insert(t, split + 1, middle), np.insert(done, split + 1, False)
    return t


def _is_near_arc(five: Array, tolerance: float, sagitta: float) -> Array:
    """Whether curves through five points each (n, 5, 3) keep to a circular arc, and to their chord."""
    chord = five[:, 4] - five[:, 0]
    square = np.maximum((chord**2).sum(axis=-1), 1e-300)
    arm = five[:, 1:4] - five[:, :1]
    along = np.einsum("nki,ni->nk", arm, chord) / square[:, None]
    off = arm - along[..., None] * chord[:, None]
    # the circle through both ends and the middle point, in terms of parts of the chord: y at x
    x, middle = along[:, [0, 2]], off[:, 1]
    sagitta_square = np.minimum((middle**2).sum(axis=-1) / square, 1e6)  # a closed edge has no chord
    span = along[:, 1] * (1 - along[:, 1]) - sagitta_square
    rise = x * (1 - x)
    below = span[:, None] + np.sqrt(np.maximum(span[:, None] ** 2 + 4 * sagitta_square[:, None] * rise, 0))
    height = np.divide(2 * rise, below, out=np.zeros_like(rise), where=below > 0)
    wrong = np.linalg.norm(off[:, [0, 2]] - height[..., None] * middle[:, None], axis=-1).max(axis=-1)
    bow = np.linalg.norm(off, axis=-1).max(axis=-1)
    inside = ((along > 0) & (along < 1)).all(axis=-1) & (span > 0)
    return (wrong <= tolerance) & (bow <= np.minimum(sagitta, _MAX_SAGITTA_RATIO * np.sqrt(square))) & inside


@dataclass(frozen=True, slots=True, eq=False)
class EdgeVertices:
    """The vertices along an edge.

    Attributes
    ----------
    t
        (n,) parameters of the edge, increasing, its ends included.
    strip_breaks
        Indices of those at which a strip begins or ends on either side, the ends included.
    uv
        For every use, its points (n, 2) in the parameter plane, those on lines exactly so.
    """

    t: Array
    strip_breaks: Array
    uv: tuple[Array, ...]


def sample_edge(
    edge: PatchEdge,
    uses: Sequence[UseWithLines],
    tolerance: float,
    sagitta: float,
    least: int = 1,
    extra: ArrayLike = (),
) -> EdgeVertices:
    """Choose the vertices along an edge.

    Parameters
    ----------
    uses
        Each with the lines of its patch, and the extent of its parameters.
    tolerance, sagitta
        See :func:`refine_parameters`. Crossings of the two neighbours that are closer together than a thousandth of the
        tolerance are made one.
    least
        Number of segments at least. A loop of one or two edges encloses nothing if each of them is a chord.
    extra
        Parameters that are wanted among the vertices.
    """
    ends = edge.breaks[[0, -1]]
    first, last = float(ends[0]), float(ends[1])
    if edge.degenerate:
        t = np.linspace(first, last, 257)
        window = LINE_SNAP_SHARE * (last - first)
    else:
        t = refine_parameters(edge.points, np.unique(np.concatenate([edge.breaks, extra])), tolerance, sagitta)
        length = float(np.linalg.norm(np.diff(edge.points(t), axis=0), axis=1).sum())
        window = max(LINE_SNAP_SHARE, 1e-3 * tolerance / max(length, 1e-300)) * (last - first)
    met = [find_crossings(use, lines, extent, t) for use, lines, extent in uses]
    stops = merge_parameters(np.concatenate([at for at, _, _ in met]), window, ends)
    if edge.degenerate:
        t = stops
    else:
        between = t[(np.abs(t[:, None] - stops) > window).all(axis=1)]
        t = refine_parameters(edge.points, np.sort(np.concatenate([stops, between])), tolerance, sagitta)
        if len(t) <= least:
            t = np.sort(np.concatenate([stops, np.linspace(first, last, least + 1)[1:-1]]))
    uv = []
    for (use, lines, extent), (at, axis, value) in zip(uses, met, strict=True):
        points = snap_to_lines(use.pcurve(t), lines, extent)
        points[np.abs(t[:, None] - at).argmin(axis=0), axis] = value
        uv.append(points)
    return EdgeVertices(t, np.searchsorted(t, stops), tuple(uv))
