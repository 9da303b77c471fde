"""Curves on a support face from the rail of one blend to that of another, which round off the corner between them.

They leave each rail in its direction: only so can patches beside them be smooth with both blends. Knows primary
surfaces and splines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.corners.tolerances import CORNER_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import to_tangent_coordinates


@dataclass(frozen=True)
class CurveEnd:
    """One end of a curve on a face: native parameters (2,), velocity (3,), and homogeneous weight there."""

    uv: Array
    velocity: Array
    weight: float = 1.0


def build_face_curve(primary: Primary, start: CurveEnd, stop: CurveEnd) -> Curve:
    """Return the cubic curve of lifted parameters on [0, 1] with given ends, whose weight does not change there."""
    ends = (start, stop)
    uv = np.stack([end.uv for end in ends])
    points = primary.scale_weight(primary.lift_points(uv), np.array([end.weight for end in ends]))
    rs = to_tangent_coordinates(primary.jet(uv), np.stack([end.velocity for end in ends]))
    rates = primary.lift_directions(uv, points, rs)
    return Curve.bezier(np.stack([points[0], points[0] + rates[0] / 3, points[1] - rates[1] / 3, points[1]]))


def choose_velocities(points: Array, directions: Array, *, is_reflex: bool) -> Array:
    """Return the velocities (2, 3) of a face curve at its ends.

    Parameters
    ----------
    points
        Where it starts and stops, (2, 3).
    directions
        The unit vectors (2, 3) in which it leaves the first rail and arrives on the second.
    is_reflex
        Whether the angle of the face at the vertex is more than 180 degrees.

    Notes
    -----
    The speeds are shares of the distances to where the rails cross; where these are no measure, of the chord.
    """
    step = points[1] - points[0]
    chord = float(np.linalg.norm(step))
    share = CORNER_TOLERANCES.reflex_speed if is_reflex else CORNER_TOLERANCES.end_speed
    distances, *_ = np.linalg.lstsq(directions.T, step, rcond=None)
    low, high = CORNER_TOLERANCES.crossing_distances
    if low * chord <= distances.min() and distances.max() <= high * chord:
        return np.asarray(share * distances[:, None] * directions)
    return chord * directions
