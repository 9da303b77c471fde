"""Read a face of a solid as a support surface of a blend, and build the pcurves of rails on that face.

The support surface is a *primary*: an exact surface model (plane, quadric, surface of revolution or spline) on which
rails are solved. Analytic faces keep their closed form, and a rail's pcurve in their angles is fitted to 1e-11 rad.
Everything else is read as a B-spline in the face's own parameters, in which the rail is its pcurve. *Lifted* parameters
are homogeneous coordinates of a primary's parameters, in which rails are rational splines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools
from OCP.Geom import (
    Geom_BoundedCurve,
    Geom_BSplineSurface,
    Geom_Circle,
    Geom_ConicalSurface,
    Geom_Curve,
    Geom_CylindricalSurface,
    Geom_ElementarySurface,
    Geom_Ellipse,
    Geom_Line,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_Surface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_SweptSurface,
    Geom_ToroidalSurface,
    Geom_TrimmedCurve,
)
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax3
from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopoDS import TopoDS, TopoDS_Face

from cqblend.blends.contacts.contact_solver import SupportSurface
from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.brep.conversion import spline_arrays
from cqblend.brep.conversion.pcurve_fit import CHECKED_SHARES, interpolate_jets
from cqblend.brep.conversion.spline_conversion import ParameterMap, to_surface_with_map
from cqblend.brep.conversion.tolerances import CONVERSION_TOLERANCES
from cqblend.errors import GeometryError, UnsupportedError
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide
from cqblend.surfaces.angles import shift_to_period, unwrap_parameters
from cqblend.surfaces.primary_surface import KnotCrossing, Primary
from cqblend.surfaces.quadrics import Cone, Cylinder, Plane, Quadric, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse, RevolvedSpline
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import LocalFrame, to_tangent_coordinates


@dataclass(frozen=True)
class SupportFace(SupportSurface):
    """A face next to the blended edge: its primary, and the conversion to its own parameters.

    ``face_primary`` is the primary in the face's own parameters, ``bounds`` their window ((u0, u1), (v0, v1)).
    ``primary``, on which rails are solved, is the same but for spheres, whose axis is turned so that poles are far from
    the edge, and for splines of surfaces with angles, whose parameters differ; both have the same lifted parameters.
    """

    face: TopoDS_Face
    face_primary: Primary
    bounds: Array

    @property
    def pcurve_tolerance(self) -> float:
        """Largest error of a rail's pcurve on the face, in its parameters; 0 if pcurves are exact."""
        return 0.0 if self.face_primary.has_exact_pcurves() else CONVERSION_TOLERANCES.pcurve

    def to_working_parameters(self, uv: Array) -> Array:
        """Convert the face's own parameters (n, 2) to those of ``primary``."""
        if self.face_primary is self.primary:
            return uv
        found = self.primary.unlift_points(self.face_primary.lift_points(uv), np.zeros((len(uv), 2)))
        return unwrap_parameters(found, self.primary.periods)

    def to_face_parameters(self, uv: Array) -> Array:
        """Convert parameters (n, 2) of ``primary`` to the face's own."""
        if self.face_primary is self.primary:
            return uv.copy()
        return self.face_primary.unlift_points(self.primary.lift_points(uv), np.zeros_like(uv))

    def unwrap_near(self, uv: Array, reference: Array) -> Array:
        """Shift the face's own parameters (n, 2) by whole periods to where they are nearest to a reference (n, 2)."""
        out = uv.copy()
        for axis, period in enumerate(self.face_primary.periods):
            if period is not None:
                out[:, axis] = shift_to_period(uv[:, axis], reference[:, axis], period)
        return out

    def is_at_seam(self, uv: Array) -> bool:
        """Whether the face's own parameters (2,), in its window, lie where a closed direction meets itself."""
        low = self.bounds[:, 0]
        return any(
            period is not None
            and abs(shift_to_period(uv[axis], low[axis], period) - low[axis]) < CONVERSION_TOLERANCES.seam * period
            for axis, period in enumerate(self.face_primary.periods)
        )

    def wrap_to_window(self, uv: Array) -> Array:
        """Shift the face's own parameters (n, 2) by whole periods into its window."""
        out = uv.copy()
        for axis, period in enumerate(self.face_primary.periods):
            if period is not None:
                out[:, axis] = self.bounds[axis, 0] + np.mod(uv[:, axis] - self.bounds[axis, 0], period)
        return out


def read_support_face(face: TopoDS_Face, edge_points: Array, *, edge_is_circular: bool = False) -> SupportFace:
    """Read a face as the support surface of a blend along an edge.

    ``edge_points`` (n, 3) on the edge select the nappe of a cone and the axis of a sphere; ``edge_is_circular`` if the
    edge is closed, or an arc of a circle, around whose axis the sphere is then described.
    """
    forward = TopoDS.Face_s(face.Oriented(TopAbs_FORWARD))
    outward = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    surface = BRep_Tool.Surface_s(face)
    while isinstance(surface, Geom_RectangularTrimmedSurface):
        surface = surface.BasisSurface()
    bounds = np.array(BRepTools.UVBounds_s(forward)).reshape(2, 2)
    face_primary = _read_primary(surface, forward, edge_points)
    primary = face_primary
    if isinstance(face_primary, ReparametrizedSpline):
        primary = face_primary.spline
    elif isinstance(face_primary, Sphere) and len(edge_points) > 1:
        primary = _reorient_sphere(face_primary, edge_points, edge_is_circular=edge_is_circular)
        face_primary = replace(face_primary, pole=primary.pole)
    return SupportFace(primary, outward, forward, face_primary, bounds)


def _read_local_frame(position: gp_Ax3) -> LocalFrame:
    p = position.Location()
    axes = [position.XDirection(), position.YDirection(), position.Direction()]
    return LocalFrame(np.array([p.X(), p.Y(), p.Z()]), np.array([[a.X(), a.Y(), a.Z()] for a in axes]))


def _read_primary(surface: Geom_Surface, face: TopoDS_Face, points: Array) -> Primary:
    if isinstance(surface, Geom_ElementarySurface):
        return _read_elementary_surface(surface, points)
    if isinstance(surface, Geom_SurfaceOfLinearExtrusion | Geom_SurfaceOfRevolution):
        swept = (
            _read_revolved_surface(surface, face)
            if isinstance(surface, Geom_SurfaceOfRevolution)
            else _read_extruded_ellipse(surface)
        )
        if swept is not None:
            return swept
    closed = (bool(surface.IsUClosed()), bool(surface.IsVClosed()))
    if isinstance(surface, Geom_BSplineSurface):  # all of it: rails may run past the face's end
        return TensorSurface.from_spline(Surface.from_bspline(*spline_arrays.surface_to_arrays(surface)), closed)
    spline, parameters = to_surface_with_map(face)
    whole = [
        flag and width > CONVERSION_TOLERANCES.whole_surface * (high - low)
        for flag, width, (low, high) in zip(
            closed, (b[-1] - b[0] for b in spline.breaks), np.array(surface.Bounds()).reshape(2, 2), strict=True
        )
    ]
    tensor = TensorSurface.from_spline(spline, (whole[0], whole[1]))
    return tensor if parameters == ParameterMap() else ReparametrizedSpline(tensor, parameters)


@dataclass(frozen=True)
class ReparametrizedSpline(Primary):
    """A spline in the parameters of the face that it was made of, of which at least one is the angle of a conic.

    The rational spline itself passes through a conic at another speed than the angle.
    """

    spline: TensorSurface
    parameters: ParameterMap

    @property
    def periods(self) -> tuple[float | None, float | None]:  # type: ignore[override]
        """Those of the spline: the parameters agree at the ends of every arc."""
        return self.spline.periods

    def inner_knot_lines(self, axis: int) -> Array:
        return self.spline.inner_knot_lines(axis)

    def find_knot_crossings(self, c: Curve, most: int) -> list[KnotCrossing]:
        return self.spline.find_knot_crossings(c, most)

    def _convert_parameters(self, convert: Callable[[Array], Array], uv: Array) -> Array:
        """Apply one direction of the parameter map to (n, 2), which may be any number of periods outside its range."""
        inside = self.spline.wrap_parameters(uv)
        return convert(inside) + (uv - inside)

    def jet(self, uv: Array) -> Array:
        at = self._convert_parameters(self.parameters.to_spline, uv)
        jet = self.spline.jet(at)
        at = self.spline.wrap_parameters(at)
        for axis, arcs, first, second in ((0, self.parameters.u, 1, 3), (1, self.parameters.v, 2, 5)):
            if arcs is not None:
                rate, bend = (values[:, None] for values in arcs.evaluate_conic_rates(at[:, axis]))
                jet[second] = (jet[second] - jet[first] * bend / rate) / rate**2
                jet[first], jet[4] = jet[first] / rate, jet[4] / rate
        return jet

    def lift_points(self, uv: Array) -> Array:
        return self.spline.lift_points(self._convert_parameters(self.parameters.to_spline, uv))

    def unlift_points(self, c: Array, near: Array) -> Array:
        return self._convert_parameters(self.parameters.to_face, self.spline.unlift_points(c, near))

    def lift_directions(self, uv: Array, c: Array, rs: Array) -> Array:
        at, slower = self._convert_parameters(self.parameters.to_spline, uv), rs.copy()
        for axis, arcs in enumerate((self.parameters.u, self.parameters.v)):
            if arcs is not None:
                slower[:, axis] /= arcs.evaluate_conic_rates(self.spline.wrap_parameters(at)[:, axis])[0]
        return self.spline.lift_directions(at, c, slower)

    def unlift_directions(self, c: Array, d: Array) -> Array:
        at, faster = self.spline.unlift_points(c, np.zeros((len(c), 2))), self.spline.unlift_directions(c, d)
        for axis, arcs in enumerate((self.parameters.u, self.parameters.v)):
            if arcs is not None:
                faster[:, axis] *= arcs.evaluate_conic_rates(self.spline.wrap_parameters(at)[:, axis])[0]
        return faster

    @property
    def weight_exponents(self) -> Array:
        return self.spline.weight_exponents

    def compose_jets(self, c: Curve, directions: Sequence[Curve], order: int | None = None) -> tuple[Curve, ...]:
        return self.spline.compose_jets(c, directions, order)

    def compose_normal(self, c: Curve) -> Curve:
        return self.spline.compose_normal(c)


def _read_elementary_surface(surface: Geom_ElementarySurface, points: Array) -> Primary:
    frame = _read_local_frame(surface.Position())
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
    if isinstance(surface, Geom_ToroidalSurface):
        return RevolvedEllipse.from_radii(frame, surface.MajorRadius(), surface.MinorRadius())
    raise UnsupportedError(f"a surface of type {surface.DynamicType().Name()} cannot be read")


def _reorient_sphere(sphere: Sphere, points: Array, *, edge_is_circular: bool) -> Sphere:
    """Return a sphere with its axis turned so that the poles are far from the points (n, 3) of an edge.

    The axis is that of the edge, and also the pole of the lifted parameters, if the edge is circular; else it is across
    the chord of the edge.
    """
    axis = sphere.pole
    if edge_is_circular:
        normal = np.linalg.svd(points - points.mean(axis=0))[2][-1]
        is_planar = np.abs((points - points[0]) @ normal).max() < CONVERSION_TOLERANCES.planar_edge * sphere.radius
        off_centre = np.linalg.norm(points.mean(axis=0) - sphere.frame.origin)
        if is_planar or off_centre < CONVERSION_TOLERANCES.centred_edge * sphere.radius:
            axis = normal * (np.sign(normal @ axis) or 1.0)
    else:
        axis = np.cross(axis, points[-1] - points[0])
        axis /= np.linalg.norm(axis)
    x = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    x /= np.linalg.norm(x)
    y = np.cross(axis, x) * np.linalg.det(sphere.frame.axes)  # of the same handedness, so that normals agree
    frame = LocalFrame(sphere.frame.origin, np.array([x, y, axis]))
    return replace(
        sphere, frame=frame, pole=axis if edge_is_circular else sphere.pole, follows_latitude=edge_is_circular
    )


def _find_basis_curve(surface: Geom_SweptSurface) -> Geom_Curve:
    curve = surface.BasisCurve()
    while isinstance(curve, Geom_TrimmedCurve):
        curve = curve.BasisCurve()
    return curve


def _read_ellipse(curve: Geom_Curve) -> Array | None:
    """Return centre and half-axes of a circle or ellipse, rows M, A, B with the curve M + A cos t + B sin t."""
    if not isinstance(curve, Geom_Circle | Geom_Ellipse):
        return None
    position = curve.Position()
    frame = _read_local_frame(gp_Ax3(position.Location(), position.Direction(), position.XDirection()))
    if isinstance(curve, Geom_Circle):
        major = minor = curve.Radius()
    else:
        major, minor = curve.MajorRadius(), curve.MinorRadius()
    return np.array([frame.origin, major * frame.axes[0], minor * frame.axes[1]])


def _read_extruded_ellipse(surface: Geom_SurfaceOfLinearExtrusion) -> Cylinder | None:
    """Read an extruded ellipse; None for other profiles, which are read as splines."""
    ellipse = _read_ellipse(_find_basis_curve(surface))
    if ellipse is None:
        return None
    along = surface.Direction()
    return Cylinder(LocalFrame(ellipse[0], np.array([ellipse[1], ellipse[2], [along.X(), along.Y(), along.Z()]])))


def _read_revolved_surface(surface: Geom_SurfaceOfRevolution, face: TopoDS_Face) -> TensorSurface | None:
    """Read a revolved ellipse, line or spline; None for other profiles, whose parameter a spline would not keep."""
    basis, axis = _find_basis_curve(surface), surface.Axis()
    frame = _read_local_frame(gp_Ax3(axis.Location(), axis.Direction()))
    ellipse = _read_ellipse(basis)
    if ellipse is not None:
        local = (ellipse - [frame.origin, np.zeros(3), np.zeros(3)]) @ frame.axes.T
        return RevolvedEllipse.from_ellipse(frame, local)
    if isinstance(basis, Geom_Line):
        _, _, low, high = BRepTools.UVBounds_s(face)
        basis = Geom_TrimmedCurve(basis, low, high)
    elif not isinstance(basis, Geom_BoundedCurve):
        return None
    degree, knots, poles, weights = spline_arrays.curve_to_arrays(GeomConvert.CurveToBSplineCurve_s(basis))
    profile = Curve.from_bspline(degree, knots, (poles - frame.origin) @ frame.axes.T, weights)
    return RevolvedSpline.from_profile(frame, profile, closed=bool(basis.IsClosed()))


def build_rail_pcurve(side: SupportFace, rail: Ribbon) -> Curve:
    """Return the rail as a curve (u, v)(t) in the face's own parameters, continuous across seams.

    Exact on planes and splines. On analytic faces a C2 quintic through value, first and second derivative, the
    derivatives solved from the rail's in space, refined until its error is below 1e-11.

    Raises
    ------
    GeometryError
        If it does not: the rail runs too near to a pole or an apex.
    """
    c, primary = rail.c, side.face_primary
    if primary.has_exact_pcurves():
        return _extract_exact_pcurve(primary, c)
    position = primary.compose_position(c)

    def evaluate_points(t: Array, side: BreakSide) -> Array:
        return dehomogenise_jets(position.jet(t, 2, side=side))

    return fit_rail_pcurve(primary, c, position.breaks, lambda t: t, evaluate_points)


def fit_rail_pcurve(
    primary: Primary,
    c: Curve,
    breaks: Array,
    to_rail_parameters: Callable[[Array], Array],
    evaluate_points: Callable[[Array, BreakSide], Array],
) -> Curve:
    """Fit a rail as a curve (u, v)(s) in the parameters of a primary surface, continuous across seams.

    Parameters
    ----------
    primary
        The surface.
    c
        The rail in lifted parameters, a curve of t.
    breaks
        Ends of the first spans in s, (n + 1,), which the fit keeps.
    to_rail_parameters
        The map from s to t.
    evaluate_points
        The rail in space with two derivatives by s, (3, n, 3), at parameters (n,) on one side of the breaks.

    Raises
    ------
    GeometryError
        If the error stays above 1e-11.
    """
    dense = np.unique(np.concatenate([breaks, np.linspace(breaks[0], breaks[-1], 257)]))
    lifted = c(to_rail_parameters(dense))
    guide = unwrap_parameters(primary.unlift_points(lifted, np.zeros((len(dense), 2))), primary.periods)

    def solve_parameters(s: Array) -> Array:
        near = np.stack([np.interp(s, dense, column) for column in guide.T], -1)
        return primary.unlift_points(c(to_rail_parameters(s)), near)

    def solve_jets(s: Array, side: BreakSide) -> Array:
        return _solve_parameter_jets(primary, solve_parameters(s), evaluate_points(s, side))

    speeds = np.linalg.norm(primary.jet(guide)[1:3], axis=2).min()
    rounding = 16 * np.finfo(float).eps * float(np.abs(primary.jet(guide)[0]).max() / speeds)
    aim = CONVERSION_TOLERANCES.rail_pcurve_share * CONVERSION_TOLERANCES.pcurve + rounding
    for _ in range(CONVERSION_TOLERANCES.pcurve_refinements):
        curve = interpolate_jets(breaks, solve_jets(breaks[:-1], "right"), solve_jets(breaks[1:], "left"))
        s = (breaks[:-1] + CHECKED_SHARES * np.diff(breaks)).ravel()
        error = np.abs(curve(s) - solve_parameters(s)).max(axis=1)
        bad = (error > aim).reshape(len(CHECKED_SHARES), -1).any(axis=0)
        if not bad.any():
            return curve
        breaks = np.sort(np.concatenate([breaks, (breaks[:-1] + breaks[1:])[bad] / 2]))
    raise GeometryError(
        f"a rail cannot be followed in the angles of its face to {CONVERSION_TOLERANCES.pcurve:g}: it runs too near "
        "to a pole"
    )


def _extract_exact_pcurve(primary: Primary, c: Curve) -> Curve:
    """Project lifted parameters of a rail to (u, v): they are (u, v, w) on a plane, barycentric pairs on a spline."""
    if isinstance(primary, Quadric):
        u, v, w = c.coefs[:, 0], c.coefs[:, 1], c.coefs[:, 2]
    else:
        u, v, w = c.coefs[:, 1], c.coefs[:, 3], c.coefs[:, 0] + c.coefs[:, 1]
    if np.abs(w - 1).max() <= 1e-14:
        return Curve(c.breaks, np.stack([u, v], 1), continuity=c.continuity)
    return Curve(c.breaks, np.stack([u, v, w], 1), rational=True, continuity=c.continuity)


def _solve_parameter_jets(primary: Primary, uv: Array, points: Array) -> Array:
    """Return parameters and their first two derivatives (3, n, 2) along a curve with its derivatives (3, n, 3)."""
    _, rate, second = points
    jet = primary.jet(uv)
    du = to_tangent_coordinates(jet, rate)
    a, b = du[:, :1], du[:, 1:]
    ddu = to_tangent_coordinates(jet, second - a**2 * jet[3] - 2 * a * b * jet[4] - b**2 * jet[5])
    return np.stack([uv, du, ddu])
