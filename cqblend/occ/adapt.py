"""A face of a solid as a primary surface, and rails as pcurves on that face.

Analytic faces stay analytic: the primary is their closed form, and a rail's pcurve in their angles is fitted to 1e-11 rad.
Everything else is read as a B-spline in the face's own parameters, where the rail is its own pcurve.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools
from OCP.Geom import (
    Geom_BezierSurface,
    Geom_BSplineSurface,
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_ElementarySurface,
    Geom_OffsetSurface,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_Surface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
)
from OCP.GeomConvert import GeomConvert, GeomConvert_ApproxSurface
from OCP.GeomAbs import GeomAbs_C1
from OCP.gp import gp_Ax3
from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopoDS import TopoDS, TopoDS_Face

from cqblend.blends.contact import Side
from cqblend.blends.primaries import (
    Array,
    Cone,
    Cylinder,
    Frame,
    Plane,
    Primary,
    Quadric,
    Revolution,
    Sphere,
    Tensor,
    Torus,
    tangent_coordinates,
)
from cqblend.blends.rails import Rail
from cqblend.errors import GeometryError, UnsupportedError
from cqblend.occ import bulk
from cqblend.splines import Curve, Surface, fit

PCURVE = 1e-11  # error of a fitted pcurve in its angles: it turns normals by as much
OFFSET_TOLERANCE = 1e-9  # mm, of the B-spline that stands in for an offset surface


@dataclass(frozen=True)
class FaceSide(Side):
    """A face next to the blended edge: its primary, and how to get back to its own parameters.

    ``native`` is the primary in the face's own parameters, ``bounds`` their window ((u0, u1), (v0, v1)). It differs from ``primary`` on spheres, where solving takes
    another axis so that poles stay out of the way, and shares its lifted parameters.
    """

    face: TopoDS_Face
    native: Primary
    bounds: Array

    def working(self, uv: Array) -> Array:
        """Turn the face's own parameters (n, 2) into those of ``primary``."""
        if self.native is self.primary:
            return uv
        lifted = self.native.lift(uv)
        near = self.primary.unlift(lifted, np.zeros((len(uv), 2)))
        return np.stack([np.unwrap(near[:, 0]), near[:, 1]], -1)


def face_side(face: TopoDS_Face, edge_points: Array, *, around: bool = False) -> FaceSide:
    """Read a face; ``edge_points`` (n, 3) tell which part of a cone or sphere is meant.

    ``around`` says that they run around something: closed, or along an arc of a circle.
    """
    forward = TopoDS.Face_s(face.Oriented(TopAbs_FORWARD))
    outward = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    surface = BRep_Tool.Surface_s(face)
    while isinstance(surface, Geom_RectangularTrimmedSurface):
        surface = surface.BasisSurface()
    native = _primary(surface, forward, edge_points)
    bounds = np.array(BRepTools.UVBounds_s(forward)).reshape(2, 2)
    if not isinstance(native, Sphere) or len(edge_points) < 2:
        return FaceSide(native, outward, forward, native, bounds)
    working = _turned(native, edge_points, around=around)
    return FaceSide(working, outward, forward, replace(native, pole=working.pole), bounds)


def _frame(position: gp_Ax3) -> Frame:
    p = position.Location()
    axes = [position.XDirection(), position.YDirection(), position.Direction()]
    return Frame(np.array([p.X(), p.Y(), p.Z()]), np.array([[a.X(), a.Y(), a.Z()] for a in axes]))


def _primary(surface: Geom_Surface, face: TopoDS_Face, points: Array) -> Primary:
    if isinstance(surface, Geom_ElementarySurface):
        return _elementary(surface, points)
    if isinstance(surface, Geom_SurfaceOfRevolution):
        revolved = _revolution(surface)
        if revolved is not None:
            return revolved
    return Tensor.of(*_spline(surface, face))


def _elementary(surface: Geom_ElementarySurface, points: Array) -> Primary:
    frame = _frame(surface.Position())
    if isinstance(surface, Geom_Plane):
        return Plane(frame)
    if isinstance(surface, Geom_CylindricalSurface):
        return Cylinder(frame, surface.Radius())
    if isinstance(surface, Geom_ConicalSurface):
        radius, angle = surface.RefRadius(), surface.SemiAngle()
        height = (points - frame.origin) @ frame.axes[2]
        nappe = np.sign((radius + height * np.tan(angle)).mean())
        return Cone(frame, radius, angle, float(nappe))
    if isinstance(surface, Geom_SphericalSurface):
        middle = points.mean(axis=0) - frame.origin
        return Sphere(frame, surface.Radius(), middle / np.linalg.norm(middle))
    assert isinstance(surface, Geom_ToroidalSurface)
    return Torus.placed(frame, surface.MajorRadius(), surface.MinorRadius())


def _turned(sphere: Sphere, points: Array, *, around: bool) -> Sphere:
    """Give a sphere the axis on which the edge runs clear of the poles.

    That is the edge's own axis, and the pole of the lift, if the edge runs ``around`` (closed, or an arc of a circle), else
    one across it.
    """
    axis = sphere.pole
    if around:
        normal = np.linalg.svd(points - points.mean(axis=0))[2][-1]
        flat = np.abs((points - points[0]) @ normal).max() < 1e-9 * sphere.radius
        if flat or np.linalg.norm(points.mean(axis=0) - sphere.frame.origin) < 0.1 * sphere.radius:
            axis = normal * (np.sign(normal @ axis) or 1.0)
    else:
        axis = np.cross(axis, points[-1] - points[0])
        axis /= np.linalg.norm(axis)
    x = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    x /= np.linalg.norm(x)
    y = np.cross(axis, x) * np.linalg.det(sphere.frame.axes)  # of the same handedness, so that normals agree
    frame = Frame(sphere.frame.origin, np.array([x, y, axis]))
    return replace(sphere, frame=frame, pole=axis if around else sphere.pole, spinning=around)


def _revolution(surface: Geom_SurfaceOfRevolution) -> Revolution | None:
    """Read a revolved B-spline; None if the profile is of another kind, whose parameter a B-spline would not keep."""
    basis = surface.BasisCurve()
    if basis.DynamicType().Name() not in {"Geom_BSplineCurve", "Geom_BezierCurve"}:
        return None
    spline = GeomConvert.CurveToBSplineCurve_s(basis)
    axis = surface.Axis()
    frame = _frame(gp_Ax3(axis.Location(), axis.Direction()))
    degree, knots, poles, weights = bulk.curve_to_arrays(spline)
    profile = Curve.from_bspline(degree, knots, (poles - frame.origin) @ frame.axes.T, weights)
    return Revolution.turning(frame, profile, closed=bool(basis.IsClosed()))


def _spline(surface: Geom_Surface, face: TopoDS_Face) -> tuple[Surface, tuple[bool, bool]]:
    """Return the surface as a spline in its own parameters, and in which directions it is closed."""
    closed = (bool(surface.IsUClosed()), bool(surface.IsVClosed()))
    if isinstance(surface, Geom_BezierSurface):
        surface = GeomConvert.SurfaceToBSplineSurface_s(surface)
    elif isinstance(surface, Geom_SurfaceOfLinearExtrusion):
        u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
        if closed[0]:
            u0, u1 = surface.BasisCurve().FirstParameter(), surface.BasisCurve().LastParameter()
        if surface.BasisCurve().DynamicType().Name() not in {"Geom_BSplineCurve", "Geom_BezierCurve", "Geom_Line"}:
            raise UnsupportedError("an extruded conic is not yet a face that can be blended; rebuild it as a B-spline")
        margin = v1 - v0
        trimmed = Geom_RectangularTrimmedSurface(surface, u0, u1, v0 - margin, v1 + margin)
        surface = GeomConvert.SurfaceToBSplineSurface_s(trimmed)
    elif isinstance(surface, Geom_OffsetSurface):
        trimmed = Geom_RectangularTrimmedSurface(surface, *BRepTools.UVBounds_s(face))
        approximation = GeomConvert_ApproxSurface(trimmed, OFFSET_TOLERANCE, GeomAbs_C1, GeomAbs_C1, 14, 14, 100, 0)
        if not approximation.HasResult() or approximation.MaxError() > 10 * OFFSET_TOLERANCE:
            raise GeometryError(f"the offset surface could not be approximated to {OFFSET_TOLERANCE:g} mm")
        surface = approximation.Surface()
    if not isinstance(surface, Geom_BSplineSurface):
        kind = surface.DynamicType().Name()
        raise UnsupportedError(f"a face of type {kind} cannot be blended yet")
    return Surface.from_bspline(*bulk.surface_to_arrays(surface)), closed


def pcurve(side: FaceSide, rail: Rail) -> Curve:
    """Return the rail as a curve (u, v)(t) in the face's own parameters, continuous through seams.

    Exact on planes and splines. On analytic faces a C2 quintic through value, first and second derivative, the derivatives
    solved from the rail's in space, refined until it holds to 1e-11.

    Raises
    ------
    GeometryError
        If it does not: the rail runs too near to a pole or an apex.
    """
    c = rail.c
    if side.native.is_native():
        return _native_pcurve(side.native, c)
    native = side.native
    position = native.position(c)
    breaks = c.breaks
    inner = (np.arange(1, 4) / 4)[:, None]
    dense = np.unique(np.concatenate([breaks, np.linspace(breaks[0], breaks[-1], 257)]))
    guide = native.unlift(c(dense), np.zeros((len(dense), 2)))
    for axis, period in enumerate(native.periods):
        if period is not None:
            guide[:, axis] = np.unwrap(guide[:, axis], period=period)

    def parameters(t: Array) -> Array:
        near = np.stack([np.interp(t, dense, column) for column in guide.T], -1)
        return native.unlift(c(t), near)

    for _ in range(12):
        uv = parameters(breaks)
        starts = _parameter_jets(native, uv[:-1], position, breaks[:-1], "right")
        stops = _parameter_jets(native, uv[1:], position, breaks[1:], "left")
        same = np.abs(stops[:, :-1] - starts[:, 1:]) <= 1e-9 * (1 + np.abs(starts[:, 1:]))
        stops[:, :-1] = np.where(same, starts[:, 1:], stops[:, :-1])
        curve = fit.hermite(breaks, np.stack([starts, stops], axis=2))
        t = (breaks[:-1] + inner * np.diff(breaks)).ravel()
        error = np.abs(curve(t) - parameters(t)).max(axis=1)
        bad = (error > PCURVE).reshape(len(inner), -1).any(axis=0)
        if not bad.any():
            return curve
        breaks = np.sort(np.concatenate([breaks, (breaks[:-1] + breaks[1:])[bad] / 2]))
    raise GeometryError(f"a rail cannot be followed in the angles of its face to {PCURVE:g}: it runs too near to a pole")


def _native_pcurve(native: Primary, c: Curve) -> Curve:
    """Return lifted parameters as plain ones: (u, v, w) of a plane, barycentric pairs of a spline."""
    if isinstance(native, Quadric):
        u, v, w = c.coefs[:, 0], c.coefs[:, 1], c.coefs[:, 2]
    else:
        u, v, w = c.coefs[:, 1], c.coefs[:, 3], c.coefs[:, 0] + c.coefs[:, 1]
    if np.abs(w - 1).max() <= 1e-14:
        return Curve(c.breaks, np.stack([u, v], 1), continuity=c.continuity)
    return Curve(c.breaks, np.stack([u, v, w], 1), rational=True, continuity=c.continuity)


def _parameter_jets(native: Primary, uv: Array, position: Curve, t: Array, side: Literal["left", "right"]) -> Array:
    """Return parameters and their first two derivatives (3, n, 2) along a rail whose homogeneous spline is given."""
    x, dx, ddx = position.jet(t, 2, side=side)
    w = x[:, 3:]
    point = x[:, :3] / w
    rate = (dx[:, :3] - point * dx[:, 3:]) / w
    second = (ddx[:, :3] - 2 * rate * dx[:, 3:] - point * ddx[:, 3:]) / w
    jet = native.jet(uv)
    du = tangent_coordinates(jet, rate)
    a, b = du[:, :1], du[:, 1:]
    ddu = tangent_coordinates(jet, second - a**2 * jet[3] - 2 * a * b * jet[4] - b**2 * jet[5])
    return np.stack([uv, du, ddu])
