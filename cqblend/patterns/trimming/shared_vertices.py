"""Vertices along the edges that faces share: one set for both faces, so that their pieces meet at the same points.

There is a vertex wherever the edge passes from one strip to another, on either side, and enough of them in between for
circular arcs to follow the edge. Depends on trimmed patches and on cut lines only.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import GeometryError
from cqblend.patterns.trimming.domain_cells import CutLines
from cqblend.patterns.trimming.tolerances import TRIM_TOLERANCES
from cqblend.patterns.trimming.trimmed_patch import CurveFunction, EdgeUse, PatchEdge
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import solve_in_brackets

_POLE_SAMPLES = 257
"""Samples along an edge that is a point in space, between which it crosses a line once at most."""


@dataclass(frozen=True, slots=True, eq=False)
class CutEdgeUse:
    """A use of an edge, and the lines that it may cross.

    Attributes
    ----------
    use
        By a loop of a patch.
    lines
        That the patch is cut at.
    extent
        Of the patch's parameters u and v.
    """

    use: EdgeUse
    lines: CutLines
    extent: tuple[float, float]


def snap_to_lines(uv: Array, lines: CutLines, extent: tuple[float, float]) -> Array:
    """Return points (n, 2) of the parameter plane, those next to a line exactly on it.

    That is, closer to it than a billionth of the extent of that parameter.
    """
    result = uv.copy()
    for axis in (0, 1):
        values = lines.list_values(axis)
        if len(values):
            nearest = values[np.abs(uv[:, axis, None] - values).argmin(axis=1)]
            is_near = np.abs(nearest - uv[:, axis]) <= TRIM_TOLERANCES.line_snap * extent[axis]
            result[:, axis] = np.where(is_near, nearest, uv[:, axis])
    return result


def find_crossings(cut_use: CutEdgeUse, t: Array) -> tuple[Array, Array, Array]:
    """Find where an edge crosses lines of a patch.

    Parameters
    ----------
    cut_use
        The use of the edge, with the lines.
    t
        (n,) increasing samples between which the edge crosses each line once at most.

    Returns
    -------
    t, axis, value
        (k,) each, unsorted: parameters of the edge, the axes of the lines, and the values of u or v on them.
    """
    pcurve, lines = cut_use.use.pcurve, cut_use.lines
    uv = snap_to_lines(pcurve(t), lines, cut_use.extent)
    found = [(np.empty(0), np.empty(0, dtype=int), np.empty(0))]
    for axis in (0, 1):
        values = lines.list_values(axis)
        signs = np.sign(uv[:, axis, None] - values)
        sample, line = np.nonzero((signs == 0) & ~(signs == 0).all(axis=0))
        found.append((t[sample], np.full(len(sample), axis), values[line]))
        sample, line = np.nonzero(signs[:-1] * signs[1:] < 0)
        if not len(sample):
            continue
        value = values[line]

        def measure_distances(t: Array, axis: int = axis, value: Array = value) -> Array:
            return np.asarray(pcurve(t)[:, axis] - value)

        brackets, distances = (t[sample], t[sample + 1]), (uv[sample, axis] - value, uv[sample + 1, axis] - value)
        rounding = TRIM_TOLERANCES.crossing_distance * np.maximum(np.abs(value), cut_use.extent[axis])
        crossings = solve_in_brackets(measure_distances, brackets, distances, rounding)
        found.append((crossings, np.full(len(sample), axis), value))
    parameters, axes, line_values = zip(*found, strict=True)
    return np.concatenate(parameters), np.concatenate(axes), np.concatenate(line_values)


def merge_parameters(t: Array, merge_distance: float, fixed: Array) -> Array:
    """Return sorted parameters without those that are within a distance of the last kept one or of a fixed one."""
    result = list(fixed)
    for value in np.sort(t):
        if min(abs(value - other) for other in result) > merge_distance:
            result.append(value)
    return np.sort(result)


def refine_parameters(points: CurveFunction, t: Array, tolerance: float, sagitta: float) -> Array:
    """Insert parameters, in the middle between neighbours, until circular arcs between neighbours follow a curve.

    Parameters
    ----------
    points
        The curve in space.
    t
        (n,) parameters that are kept.
    tolerance
        Largest distance of the curve from an arc, mm.
    sagitta
        Largest distance of the curve from its chord, mm.

    Raises
    ------
    GeometryError
        If more than 20,000 parameters would be needed.
    """
    limit = TRIM_TOLERANCES.max_edge_vertices
    done = np.zeros(len(t) - 1, dtype=bool)
    while not done.all():
        if len(t) > limit:
            raise GeometryError(
                f"the edge needs more than {limit} vertices for {tolerance:.3g} mm; loosen the tolerance"
            )
        untested = np.flatnonzero(~done)
        start, width = t[untested], np.diff(t)[untested]
        five_points = points((start[:, None] + width[:, None] * np.arange(5) / 4).ravel()).reshape(len(untested), 5, 3)
        is_short = width <= TRIM_TOLERANCES.shortest_segment * (t[-1] - t[0])
        done[untested] = _is_near_arc(five_points, tolerance, sagitta) | is_short
        split = np.flatnonzero(~done)
        middle = (t[split] + t[split + 1]) / 2
        # both halves of what is split are tested next
        t, done = np.insert(t, split + 1, middle), np.insert(done, split + 1, False)
    return t


def _is_near_arc(five_points: Array, tolerance: float, sagitta: float) -> Array:
    r"""Whether curves through five points each (n, 5, 3) keep to a circular arc, and to their chord.

    The arc goes through the first, the middle and the last point. In units of the chord, let x be the place of a point
    along it and y its height above it, in the direction of the middle point. With the middle point at (m, h),

    .. math:: x^2 + y^2 - x - b y = 0, \qquad b h = h^2 - m (1 - m)

    is the circle, so that y / h = 2 x (1 - x) / (a + sqrt(a^2 + 4 h^2 x (1 - x))) with a = m (1 - m) - h^2.
    """
    chord = five_points[:, 4] - five_points[:, 0]
    square = np.maximum((chord**2).sum(axis=-1), 1e-300)
    arm = five_points[:, 1:4] - five_points[:, :1]
    along = np.einsum("nki,ni->nk", arm, chord) / square[:, None]
    heights = arm - along[..., None] * chord[:, None]
    x, middle_height = along[:, [0, 2]], heights[:, 1]
    height_square = np.minimum((middle_height**2).sum(axis=-1) / square, 1e6)  # a closed edge has no chord
    a = along[:, 1] * (1 - along[:, 1]) - height_square
    product = x * (1 - x)
    denominator = a[:, None] + np.sqrt(np.maximum(a[:, None] ** 2 + 4 * height_square[:, None] * product, 0))
    y = np.divide(2 * product, denominator, out=np.zeros_like(product), where=denominator > 0)
    distance = np.linalg.norm(heights[:, [0, 2]] - y[..., None] * middle_height[:, None], axis=-1).max(axis=-1)
    largest_height = np.linalg.norm(heights, axis=-1).max(axis=-1)
    is_inside = ((along > 0) & (along < 1)).all(axis=-1) & (a > 0)
    allowed_height = np.minimum(sagitta, TRIM_TOLERANCES.max_sagitta_ratio * np.sqrt(square))
    return (distance <= tolerance) & (largest_height <= allowed_height) & is_inside


@dataclass(frozen=True, slots=True, eq=False)
class EdgeVertices:
    """The vertices along an edge.

    Attributes
    ----------
    t
        (n,) parameters of the edge, increasing, its ends included.
    strip_breaks
        Indices of the vertices at which a strip begins or ends on either side, the ends of the edge included.
    uv
        For every use, the vertices (n, 2) in the parameter plane of its patch, those on lines exactly on them.
    """

    t: Array
    strip_breaks: Array
    uv: tuple[Array, ...]


def sample_edge(
    edge: PatchEdge,
    uses: Sequence[CutEdgeUse],
    tolerance: float,
    sagitta: float,
    min_segments: int = 1,
    required_parameters: ArrayLike = (),
) -> EdgeVertices:
    """Choose the vertices along an edge.

    Parameters
    ----------
    edge
        The edge.
    uses
        Its uses, with the lines that they may cross.
    tolerance, sagitta
        See :func:`refine_parameters`. Crossings of the two neighbours that are closer together than a thousandth of the
        tolerance are made one.
    min_segments
        Least number of segments: a loop of one or two edges encloses nothing if each of them is a chord.
    required_parameters
        That are to be among the vertices.
    """
    ends = edge.breaks[[0, -1]]
    first, last = float(ends[0]), float(ends[1])
    if edge.degenerate:
        t = np.linspace(first, last, _POLE_SAMPLES)
        merge_distance = TRIM_TOLERANCES.line_snap * (last - first)
    else:
        t = np.unique(np.concatenate([edge.breaks, required_parameters]))
        t = refine_parameters(edge.points, t, tolerance, sagitta)
        length = float(np.linalg.norm(np.diff(edge.points(t), axis=0), axis=1).sum())
        merged_share = TRIM_TOLERANCES.line_crossing_merge * tolerance / max(length, 1e-300)
        merge_distance = max(TRIM_TOLERANCES.line_snap, merged_share) * (last - first)
    crossings = [find_crossings(cut_use, t) for cut_use in uses]
    stops = merge_parameters(np.concatenate([at for at, _, _ in crossings]), merge_distance, ends)
    if edge.degenerate:
        t = stops
    else:
        between = t[(np.abs(t[:, None] - stops) > merge_distance).all(axis=1)]
        t = refine_parameters(edge.points, np.sort(np.concatenate([stops, between])), tolerance, sagitta)
        if len(t) <= min_segments:
            t = np.sort(np.concatenate([stops, np.linspace(first, last, min_segments + 1)[1:-1]]))
    uv = []
    for cut_use, (at, axis, value) in zip(uses, crossings, strict=True):
        points = snap_to_lines(cut_use.use.pcurve(t), cut_use.lines, cut_use.extent)
        points[np.abs(t[:, None] - at).argmin(axis=0), axis] = value
        uv.append(points)
    return EdgeVertices(t, np.searchsorted(t, stops), tuple(uv))
