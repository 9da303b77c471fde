"""Few arcs for many: a path of hundreds of short segments becomes the longest arcs that stay within a tolerance.

Exists because flattened rails come with as many points as they were computed at, and a cutter that is fed short
segments stutters. Must not know what the paths bound.
"""

from itertools import pairwise

import numpy as np

from cqblend.developables.checks import millimetres
from cqblend.developables.parallels import Track, between
from cqblend.developables.paths import Path, bulges
from cqblend.splines.bernstein import Array

CORNER = 0.2
"""Vertices at which a path turns by more than this (rad) are kept."""
PARTS = 4  # samples per segment, see `_longest`


def fitted(path: Path, tolerance: float) -> Path:
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
    tolerance = millimetres("the tolerance of fitted arcs", tolerance, zero=True)
    if tolerance == 0 or len(path.bulges) == 1:
        return path
    track = Track.of(path)
    path, count = track.path, len(track.path.bulges)
    which, part = np.divmod(np.arange(PARTS * count), PARTS)
    samples = np.concatenate([path.at(which, part / PARTS), path.points[-1:]])
    vertices, found = [0], []
    for begin, end in pairwise([0, *_corners(track), count]):
        start = begin
        while start < end:
            stop, bulge = _longest(track, samples, start, end, tolerance)
            vertices.append(stop)
            found.append(bulge)
            start = stop
    return Path(path.points[vertices], np.array(found))


def _corners(track: Track) -> Array:
    """Return the inner vertices at which the direction changes by more than `CORNER`."""
    ahead, behind = track.directions
    return 1 + np.flatnonzero(np.abs(between(behind[:-1], ahead[1:])) > CORNER)


def _longest(track: Track, samples: Array, start: int, end: int, tolerance: float) -> tuple[int, float]:
    """Return where the longest arc from a vertex ends, by doubling and bisection, and its bulge.

    Samples are held to 8/9 of the tolerance. Between two of them, a quarter of a segment apart, the distance changes as
    that of two arcs does, by 1/16 of what their sagittae differ by over the whole segment, which is at most twice 8/9.
    """

    def bulge(stop: int) -> float | None:
        inner = samples[PARTS * start : PARTS * stop + 1]
        return _bulge(inner, track.stations[stop] - track.stations[start], 8 / 9 * tolerance)

    best, found = start + 1, float(track.path.bulges[start])
    if (whole := bulge(end)) is not None and end > best:
        return end, whole
    failed, step = end, 1
    while best < failed - 1:
        stop = min(best + step, failed - 1) if step else (best + failed) // 2
        value = bulge(stop)
        if value is None:
            failed, step = stop, 0
        else:
            best, found, step = stop, value, 2 * step
    return best, found


def _bulge(points: Array, length: float, tolerance: float) -> float | None:
    """Return the bulge of the arc from the first to the last point that passes all within a tolerance, if there is."""
    along = points[-1] - points[0]
    chord = float(np.hypot(*along))
    if chord == 0.0:
        return None
    base = points[1:-1] - (points[0] + points[-1]) / 2
    c = chord / 2
    y = (base @ np.array([-along[1], along[0]])) / chord
    cos, sin = c * c + tolerance * tolerance - (base**2).sum(axis=1), -chord * y
    reach = chord * tolerance / np.maximum(np.hypot(cos, sin), np.finfo(float).tiny)
    slack = np.where(reach < 1, np.arcsin(np.minimum(reach, 1)), np.inf)  # near an end, every arc passes
    psi = np.arctan2(sin, cos)
    least, greatest = max((psi - slack).max(), -np.pi / 2), min((psi + slack).min(), np.pi / 2)
    if least > greatest:
        return None
    same = 2 * np.arctan(bulges(np.array([chord]), np.array([length]))[0]) * -np.sign(y.sum())
    half = float(np.clip(same, least, greatest))
    if c * abs(np.tan(half / 2)) < 1e-3 * tolerance and least <= 0 <= greatest:
        return 0.0
    return float(np.tan(half / 2))
