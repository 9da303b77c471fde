"""The curves and surfaces of a plan as OCCT's own."""

from __future__ import annotations

import numpy as np
from OCP.Geom import (
    Geom_Circle,
    Geom_Curve,
    Geom_CylindricalSurface,
    Geom_Ellipse,
    Geom_Line,
    Geom_Plane,
    Geom_SphericalSurface,
    Geom_Surface,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
)
from OCP.Geom2d import Geom2d_Circle, Geom2d_Curve, Geom2d_Ellipse, Geom2d_Line
from OCP.gp import gp_Ax1, gp_Ax2, gp_Ax3, gp_Ax22d, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d

from cqblend.blends.network.blend_plan import PlannedPcurve, PlannedSurface
from cqblend.blends.network.strip_surface import PlaneCurve, RailCurve
from cqblend.blends.sections.revolved_section import RevolvedSection
from cqblend.brep.conversion import spline_arrays
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.splines import Surface
from cqblend.surfaces.circle import Circle, PlanarCircle
from cqblend.surfaces.ellipse import Ellipse, PlanarEllipse
from cqblend.surfaces.line import Line
from cqblend.surfaces.quadrics import Cylinder, Plane
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse
from cqblend.surfaces.vectors import LocalFrame


def make_curve(curve: RailCurve | Ellipse) -> Geom_Curve:
    """Return a curve as one of OCCT's."""
    if isinstance(curve, Line):
        return Geom_Line(gp_Pnt(*curve.origin.tolist()), gp_Dir(*curve.direction.tolist()))
    if isinstance(curve, Circle | Ellipse):
        origin, x, _, z = _to_points(curve.frame)
        position = gp_Ax2(gp_Pnt(*origin), gp_Dir(*z), gp_Dir(*x))
        return (
            Geom_Circle(position, curve.radius) if isinstance(curve, Circle) else Geom_Ellipse(position, *curve.radii)
        )
    return spline_arrays.curve_from_arrays(*curve.to_bspline())


def make_surface(surface: PlannedSurface) -> Geom_Surface:
    """Return a planned surface as one of OCCT's."""
    geometry = surface.geometry
    if isinstance(geometry, Surface):
        return spline_arrays.surface_from_arrays(*geometry.to_bspline())
    origin, x, y, z = _to_points(geometry.frame)
    if isinstance(geometry, RevolvedSection):
        return Geom_SurfaceOfRevolution(make_curve(geometry.place_profile(0.0)), gp_Ax1(gp_Pnt(*origin), gp_Dir(*z)))
    position = gp_Ax3(gp_Pnt(*origin), gp_Dir(*z), gp_Dir(*x))
    if np.cross(x, y) @ z < 0:
        position.YReverse()
    if isinstance(geometry, RevolvedEllipse):
        return Geom_ToroidalSurface(position, geometry.ellipse[0, 0], geometry.ellipse[1, 0])
    if isinstance(geometry, Cylinder):
        return Geom_CylindricalSurface(position, geometry.radius)
    return Geom_Plane(position) if isinstance(geometry, Plane) else Geom_SphericalSurface(position, geometry.radius)


def _to_points(frame: LocalFrame) -> tuple[list[float], ...]:
    """Return origin and axes of a frame as lists."""
    return frame.origin.tolist(), *frame.axes.tolist()


def make_pcurves(pcurve: PlannedPcurve) -> list[Geom2d_Curve]:
    """Return the pcurves of the FORWARD and, at a seam, of the REVERSED use of an edge."""
    return [make_pcurve(curve) for curve in (pcurve.curve, pcurve.reversed_curve) if curve is not None]


def make_pcurve(curve: PlaneCurve) -> Geom2d_Curve:
    """Return a curve in a parameter plane as one of OCCT's: a line where it is one that runs at unit speed."""
    if isinstance(curve, PlanarCircle | PlanarEllipse):
        centre, (x, y) = curve.centre.tolist(), curve.axes.tolist()
        axes = gp_Ax22d(gp_Pnt2d(*centre), gp_Dir2d(*x), gp_Dir2d(*y))
        if isinstance(curve, PlanarCircle):
            return Geom2d_Circle(axes, curve.radius)
        return Geom2d_Ellipse(axes, *curve.radii)
    degree, knots, poles, weights = curve.to_bspline()
    if degree == 1 and len(poles) == 2 and weights is None:
        (low, high), step = curve.domain, poles[1] - poles[0]
        slack = SHELL_EDIT_TOLERANCES.unit_speed * (np.abs(poles).max(axis=0) + high - low)
        direction = np.where(np.abs(step) <= slack, 0.0, step)
        length = float(np.linalg.norm(direction))
        if abs(length - (high - low)) <= slack.max():
            direction /= length
            return Geom2d_Line(gp_Pnt2d(*(poles[0] - low * direction).tolist()), gp_Dir2d(*direction.tolist()))
    return spline_arrays.curve2d_from_arrays(degree, knots, poles, weights)
