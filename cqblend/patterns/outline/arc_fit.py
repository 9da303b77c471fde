"""Few arcs for many: a path of hundreds of short segments becomes the longest arcs that stay within a tolerance.

Exists because flattened rails come with as many points as they were computed at, and a cutter that is fed short
segments stutters. Must not know what the paths bound.
"""

from itertools import pairwise

import numpy as np

from cqblend.checks import check_millimetres
from cqblend.patterns.outline.parallel_path import PathByLength, signed_angles
from cqblend.patterns.outline.plane_path import Path, solve_bulges
from cqblend.splines.bernstein import Array

CORNER_ANGLE = 0.2
"""Vertices at which a path turns by more than this (rad) are kept."""
SAMPLES_PER_SEGMENT = 4  # samples per segment, see `_longest`


def fit_arcs(path: Path, tolerance: float) -> Path:
    r"""Return a path of few arcs and segments that is nowhere further from a path than a tolerance.

    The ends and the corners stay. In between, each arc is as long as it can be: an arc over the chord from (-c, 0) to
    (c, 0) with the angle 2 a passes a point (x, y) within the tolerance e if

    .. math:: |\sin(\psi - a)| \le 2 c e / h, \qquad h e^{i\psi} = c^2 + e^2 - x^2 - y^2 - 2 i c y

    which bounds a from both sides for each point of the path. Within these bounds, a is chosen such that the arc is as
    long as what it replaces, so that the two sides of a seam stay as long as they were as far as possible.

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
    >>> few = fitted(Path.straight(10 * np.column_stack([np.cos(angle), np.sin(angle)])), 0.01)
    >>> len(few.bulges), few.bulges.round(2)
    (1, array([1.]))
    """
    tolerance = check_millimetres("the tolerance of fitted arcs", tolerance, zero=True)
    if tolerance == 0 or len(path.bulges) == 1:
        return path
    track = PathByLength.from_path(path)
    path, count = track.path, len(track.path.bulges)
    which, part = np.divmod(np.arange(SAMPLES_PER_SEGMENT * count), SAMPLES_PER_SEGMENT)
    samples = np.concatenate([path.at(which, part / SAMPLES_PER_SEGMENT), path.points[-1:]])
    vertices, found = [0], []
    for begin, end in pairwise([0, *_find_corners(track), count]):
        start = begin
        while start < end:
            stop, bulge = _extend_longest_arc(track, samples, start, end, tolerance)
            vertices.append(stop)
            found.append(bulge)
            start = stop
    return Path(path.points[vertices], np.array(found))


def _find_corners(track: PathByLength) -> Array:
    """Return the inner vertices at which the direction changes by more than `CORNER`."""
    ahead, behind = track.directions
    return 1 + np.flatnonzero(np.abs(signed_angles(behind[:-1], ahead[1:])) > CORNER_ANGLE)


def _extend_longest_arc(
    track: PathByLength, samples: Array, start: int, end: int, tolerance: float
) -> tuple[int, float]:
    """Return where the longest arc from a vertex ends, by doubling and bisection, and its bulge.

    Samples are held to 8/9 of the tolerance. Between two of them, a quarter of a segment apart, the distance changes as
    that of two arcs does, by 1/16 of what their sagittae differ by over the whole segment, which is at most twice 8/9.
    """

    def has_arc_to(stop: int) -> bool:
        least, greatest = _bound_half_angles(
            samples[SAMPLES_PER_SEGMENT * start : SAMPLES_PER_SEGMENT * stop + 1], 8 / 9 * tolerance
        )
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
        return best, float(track.path.bulges[start])
    length = float(track.stations[best] - track.stations[start])
    return best, _choose_bulge(
        samples[SAMPLES_PER_SEGMENT * start : SAMPLES_PER_SEGMENT * best + 1], length, 8 / 9 * tolerance
    )


def _bound_half_angles(points: Array, tolerance: float) -> tuple[float, float]:
    """Return least and greatest half angle of the arcs from the first to the last point that pass all others.

    The least exceeds the greatest if there are none.
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
    """Return the bulge of the arc that passes all points, as nearly as it may be of a length."""
    least, greatest = _bound_half_angles(points, tolerance)
    along = points[-1] - points[0]
    chord = float(np.hypot(*along))
    left = np.sign(((points - points[0]) @ np.array([-along[1], along[0]])).sum())
    same = -left * 2 * np.arctan(solve_bulges(np.array([chord]), np.array([length]))[0])
    bulge = float(np.tan(np.clip(same, least, greatest) / 2))
    if least <= 0 <= greatest and chord / 2 * abs(bulge) < 1e-3 * tolerance:
        return 0.0
    return bulge
