"""Fits few long arcs to a path of many short segments, within a tolerance.

Flattened rails have as many vertices as they were computed at, and a cutter that is fed short segments stutters.
Depends on paths only.
"""

from itertools import pairwise

import numpy as np

from cqblend.argument_checks import check_millimetres
from cqblend.patterns.outline.path_by_length import PathByLength, signed_angles
from cqblend.patterns.outline.plane_path import Path, solve_bulges
from cqblend.patterns.outline.tolerances import OUTLINE_TOLERANCES
from cqblend.splines.bernstein import Array

SAMPLES_PER_SEGMENT = 4
"""Samples per segment of the path, at equal steps; :func:`_extend_longest_arc` says why four are enough."""


def fit_arcs(path: Path, tolerance: float) -> Path:
    r"""Return a path of few arcs and segments that is nowhere further from a path than a tolerance.

    The ends and the corners stay. In between, each arc is as long as it can be: an arc over the chord from (-c, 0) to
    (c, 0) with the angle 2 a passes a point (x, y) within the tolerance e if

    .. math:: |\sin(\psi - a)| \le 2 c e / h, \qquad h e^{i\psi} = c^2 + e^2 - x^2 - y^2 - 2 i c y

    which bounds a from both sides for each point of the path. Within these bounds, a is chosen such that the arc is as
    long as the segments that it replaces: both sides of a seam keep their length as far as the tolerance allows.

    Parameters
    ----------
    path
        Open or closed; a closed one keeps its first point.
    tolerance
        mm. 0 returns the path as it is.

    Returns
    -------
    Path
        Of arcs of at most half a turn, unless the path has longer ones.

    Raises
    ------
    InputError
        If the tolerance is negative or not a number.

    Examples
    --------
    >>> angle = np.linspace(0, np.pi, 201)
    >>> few = fit_arcs(Path.from_points(10 * np.column_stack([np.cos(angle), np.sin(angle)])), 0.01)
    >>> len(few.bulges), few.bulges.round(2)
    (1, array([1.]))
    """
    tolerance = check_millimetres("the tolerance of fitted arcs", tolerance, zero=True)
    if tolerance == 0 or len(path.bulges) == 1:
        return path
    measured = PathByLength.from_path(path)
    path, count = measured.path, len(measured.path.bulges)
    segments, steps = np.divmod(np.arange(SAMPLES_PER_SEGMENT * count), SAMPLES_PER_SEGMENT)
    samples = np.concatenate([path.at(segments, steps / SAMPLES_PER_SEGMENT), path.points[-1:]])
    vertices, bulges = [0], []
    for begin, end in pairwise([0, *_find_corners(measured), count]):
        start = begin
        while start < end:
            stop, bulge = _extend_longest_arc(measured, samples, start, end, tolerance)
            vertices.append(stop)
            bulges.append(bulge)
            start = stop
    return Path(path.points[vertices], np.array(bulges))


def _find_corners(path: PathByLength) -> Array:
    """Return the indices of the inner vertices at which the direction changes by more than the angle of a corner."""
    at_start, at_end = path.directions
    return 1 + np.flatnonzero(np.abs(signed_angles(at_end[:-1], at_start[1:])) > OUTLINE_TOLERANCES.corner_angle)


def _extend_longest_arc(
    path: PathByLength, samples: Array, start: int, end: int, tolerance: float
) -> tuple[int, float]:
    """Return the vertex at which the longest arc from vertex `start` ends, found by doubling and bisection; its bulge.

    Samples keep 8/9 of the tolerance. Between two of them, a quarter of a segment apart, the distance from the arc
    grows by at most 1/16 of the difference of the sagittae that arc and segment have over the whole segment. That is at
    most 2 * 8/9 of the tolerance, so that the distance stays within 8/9 + 1/9.
    """
    kept = 8 / 9 * tolerance

    def samples_between(first: int, last: int) -> Array:
        return samples[SAMPLES_PER_SEGMENT * first : SAMPLES_PER_SEGMENT * last + 1]

    def has_arc_to(stop: int) -> bool:
        least, greatest = _bound_half_angles(samples_between(start, stop), kept)
        return least <= greatest

    best = start + 1
    if end > best and has_arc_to(end):
        best = end
    failed, step = end, 1
    while best < failed - 1:
        stop = min(best + step, failed - 1) if step else (best + failed) // 2
        if has_arc_to(stop):
            best, step = stop, 2 * step
        else:
            failed, step = stop, 0
    if best == start + 1:
        return best, float(path.path.bulges[start])
    length = float(path.stations[best] - path.stations[start])
    return best, _choose_bulge(samples_between(start, best), length, kept)


def _bound_half_angles(points: Array, tolerance: float) -> tuple[float, float]:
    """Return the least and the greatest half angle of arcs from the first to the last point that pass near all others.

    Points are (m, 2), angles rad, positive where the arc turns to the left. The least exceeds the greatest if no arc
    is within the tolerance of all points.
    """
    along = points[-1] - points[0]
    chord = float(np.hypot(*along))
    if chord == 0.0:
        return 0.0, -np.inf
    base = points[1:-1] - (points[0] + points[-1]) / 2
    y = base @ np.array([-along[1], along[0]]) / chord
    cos, sin = chord * chord / 4 + tolerance * tolerance - (base * base).sum(axis=1), -chord * y
    reach = chord * tolerance / np.maximum(np.hypot(cos, sin), np.finfo(float).tiny)
    slack = np.where(reach < 1, np.arcsin(np.minimum(reach, 1)), np.inf)  # near an end, every arc passes
    psi = np.arctan2(sin, cos)
    return max(float((psi - slack).max()), -np.pi / 2), min(float((psi + slack).min()), np.pi / 2)


def _choose_bulge(points: Array, length: float, tolerance: float) -> float:
    """Return the bulge of the arc within the tolerance of all points whose length is nearest to a given one."""
    least, greatest = _bound_half_angles(points, tolerance)
    along = points[-1] - points[0]
    chord = float(np.hypot(*along))
    left = np.sign(((points - points[0]) @ np.array([-along[1], along[0]])).sum())
    same = -left * 2 * np.arctan(solve_bulges(np.array([chord]), np.array([length]))[0])
    bulge = float(np.tan(np.clip(same, least, greatest) / 2))
    if least <= 0 <= greatest and chord / 2 * abs(bulge) < 1e-3 * tolerance:
        return 0.0
    return bulge
