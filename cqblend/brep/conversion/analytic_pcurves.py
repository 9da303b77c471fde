"""Straight rails on support faces by their length, and circular ones by the angle about their axis.

They are lines and circles in the parameters of the face, wherever they can be.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cqblend.blends.rails.ribbon import Ribbon
from cqblend.brep.conversion.support_face import SupportFace, fit_rail_pcurve
from cqblend.brep.conversion.tolerances import CONVERSION_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.circle import Circle, PlanarCircle
from cqblend.surfaces.coaxial_surfaces import CoaxialSurface
from cqblend.surfaces.line import Line
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.quadrics import Plane


def find_analytic_pcurve(
    side: SupportFace, ribbon: Ribbon, rail: Line | Circle, stops: Array, to_rail_parameters: Callable[[Array], Array]
) -> Curve | PlanarCircle:
    """Return the parameters on its face of a rail, as a function of its length or its angle.

    ``stops`` (n + 1,) are the values of these, from 0, at the ends of the pieces of the ribbon's rail, whose parameter
    ``to_rail_parameters`` tells. Where the rail is neither a line nor a circle in the parameters of the face, it is
    fitted in them within 1e-11.

    Raises
    ------
    GeometryError
        If that cannot be.
    """
    if isinstance(rail, Circle):
        found = find_circular_pcurve(side, ribbon, rail, float(stops[-1]))
    else:
        found = _find_straight_pcurve(side, ribbon, rail, float(stops[-1]))
    if found is not None:
        return found
    return fit_rail_pcurve(
        side.face_primary, ribbon.c, stops, to_rail_parameters, lambda s, _: np.stack([rail(s, k) for k in range(3)])
    )


def _find_straight_pcurve(side: SupportFace, ribbon: Ribbon, line: Line, length: float) -> Curve | None:
    """Return the line that a straight rail is in the parameters of its face, if it is one there, over its length."""
    primary = side.face_primary
    ends = side.to_face_parameters(ribbon.find_native_parameters(ribbon.c.breaks[[0, -1]]))
    if np.abs(np.diff(ends, axis=0)).min() <= CONVERSION_TOLERANCES.parameter_line * np.abs(ends).max():
        axis = int(np.abs(ends[1] - ends[0]).argmin())
        ends[1, axis] = ends[0, axis]
    found = Curve.bezier(ends, domain=(0.0, length))
    lengths = np.linspace(0.0, length, CONVERSION_TOLERANCES.rail_angles)
    distance = np.linalg.norm(primary.jet(found(lengths))[0] - line(lengths), axis=1).max()
    return found if distance <= CONVERSION_TOLERANCES.straight_rail * float(np.abs(line(lengths)).max()) else None


def find_circular_pcurve(side: SupportFace, ribbon: Ribbon, circle: Circle, turn: float) -> Curve | PlanarCircle | None:
    """Return the parameters of a circular rail on its face as a function of the angle, from 0 to ``turn`` (rad).

    That is a circle on a plane, and a line along a parameter that is an angle about the same axis. None if it is
    neither, or not to rounding.
    """
    primary = side.face_primary
    if circle.radius <= 0:
        return None
    if isinstance(primary, Plane):
        found: Curve | PlanarCircle | None = _project_to_plane(primary, circle)
    else:
        found = _follow_angle(side, ribbon, circle, turn)
    if found is None:
        return None
    angles = np.linspace(0.0, turn, CONVERSION_TOLERANCES.rail_angles)
    distance = np.linalg.norm(primary.jet(found(angles))[0] - circle(angles), axis=1).max()
    allowed = CONVERSION_TOLERANCES.circular_rail * circle.radius
    allowed += CONVERSION_TOLERANCES.circle_position * float(np.abs(circle.frame.origin).max())
    return found if distance <= allowed else None


def _project_to_plane(plane: Plane, circle: Circle) -> PlanarCircle:
    """Return a circle in the parameters of a plane that it lies in."""
    axes = plane.frame.axes[:2]
    return PlanarCircle(
        (circle.frame.origin - plane.frame.origin) @ axes.T, circle.frame.axes[:2] @ axes.T, circle.radius
    )


def _follow_angle(side: SupportFace, ribbon: Ribbon, circle: Circle, turn: float) -> Curve | None:
    """Return the line in the face's parameters that starts where a rail does, and along which the first is the angle.

    None if that is no angle about the axis of the circle.
    """
    primary: Primary = side.face_primary
    if not isinstance(primary, CoaxialSurface):
        return None
    start = side.to_face_parameters(ribbon.find_native_parameters(ribbon.c.breaks[:1]))
    along = float(primary.jet(start)[1, 0] @ circle.frame.axes[1])
    if not np.isclose(abs(along), circle.radius, rtol=CONVERSION_TOLERANCES.circular_speed):
        return None
    return Curve.bezier([start[0], start[0] + [np.sign(along) * turn, 0.0]], domain=(0.0, turn))
