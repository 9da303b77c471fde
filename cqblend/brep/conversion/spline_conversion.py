"""Convert faces of OCCT to symbolic spline surfaces and back.

Every analytic surface has an exact rational form; only its parameters change: a circle as a rational quadratic is not
run through at the speed of its angle. So each conversion comes with a closed-form :class:`ParameterMap` between the
face's own parameters and the spline's. The forms are built here rather than by ``GeomConvert``, so that the arcs are
known (at most 120 degrees each, knots at the angles themselves) and the map can be, too.

Notation: a spline in *homogeneous* form has poles (w x, w y, w z, w).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepTools import BRepTools
from OCP.Geom import (
    Geom_BezierCurve,
    Geom_BezierSurface,
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_Circle,
    Geom_Conic,
    Geom_ConicalSurface,
    Geom_Curve,
    Geom_CylindricalSurface,
    Geom_ElementarySurface,
    Geom_Ellipse,
    Geom_Hyperbola,
    Geom_Line,
    Geom_OffsetCurve,
    Geom_OffsetSurface,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_Surface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
    Geom_TrimmedCurve,
)
from OCP.GeomAbs import GeomAbs_Shape
from OCP.GeomConvert import GeomConvert, GeomConvert_ApproxCurve, GeomConvert_ApproxSurface
from OCP.gp import gp_Dir, gp_Pnt, gp_Trsf
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.conversion.tolerances import CONVERSION_TOLERANCES
from cqblend.brep.topology import CONFUSION
from cqblend.errors import GeometryError, InputError, UnsupportedError, with_article
from cqblend.splines.bernstein import Array
from cqblend.splines.surface import Surface

ParameterRange: TypeAlias = tuple[float, float]
"""First and last value of one parameter."""


@dataclass(frozen=True, slots=True)
class ConicArcs:
    """Reparametrisation between the angle of a conic and the parameter of its rational quadratic spline, arc by arc.

    On an arc about ``m`` of half-width ``h`` the spline's parameter ``s`` and the conic's ``a`` obey
    ``tan((a - m) / 2) = tan(h / 2) (s - m) / h``, with ``tanh`` for the hyperbola; so both agree at the breaks, and on
    a circle differ by 0.04 rad at most in between. Beyond the ends the first and last arc go on, on a circle as far as
    the point opposite their middle.

    Attributes
    ----------
    breaks : array
        Ends of the arcs, the same in both parameters.
    hyperbolic : bool
        Whether the conic is a hyperbola, with cosh and sinh of its parameter, not a circle or an ellipse.
    """

    breaks: Array
    hyperbolic: bool = False

    def to_spline(self, conic: Array) -> Array:
        """Return the spline's parameters of given angles."""
        middle, half = self._find_arc(conic)
        tan = np.tanh if self.hyperbolic else np.tan
        return np.asarray(middle + half * tan((conic - middle) / 2) / tan(half / 2))

    def to_conic(self, spline: Array) -> Array:
        """Return the angles of given parameters of the spline."""
        middle, half = self._find_arc(spline)
        tan, atan = (np.tanh, np.arctanh) if self.hyperbolic else (np.tan, np.arctan)
        return np.asarray(middle + 2 * atan(tan(half / 2) * (spline - middle) / half))

    def evaluate_conic_rates(self, spline: Array) -> tuple[Array, Array]:
        """Return the first two derivatives of :meth:`to_conic`."""
        middle, half = self._find_arc(spline)
        slope = (np.tanh if self.hyperbolic else np.tan)(half / 2) / half
        x = slope * (spline - middle)
        growth = 1 - x**2 if self.hyperbolic else 1 + x**2
        sign = 1 if self.hyperbolic else -1
        return 2 * slope / growth, sign * 4 * slope**2 * x / growth**2

    def _find_arc(self, values: Array) -> tuple[Array, Array]:
        index = np.clip(np.searchsorted(self.breaks, values, side="right") - 1, 0, len(self.breaks) - 2)
        start, stop = self.breaks[index], self.breaks[index + 1]
        return (start + stop) / 2, (stop - start) / 2

    def build_knots(self) -> Array:
        """Return the full knot vector."""
        return np.repeat(self.breaks, [3, *[2] * (len(self.breaks) - 2), 3])

    def build_unit_conic(self) -> Array:
        """Return the unit conic (w cos a, w sin a, w), or (w cosh a, w sinh a, w), as poles of shape (2n + 1, 3)."""
        cos, sin = (np.cosh, np.sinh) if self.hyperbolic else (np.cos, np.sin)
        middle, half = (self.breaks[:-1] + self.breaks[1:]) / 2, np.diff(self.breaks) / 2
        poles = np.empty((2 * len(half) + 1, 3))
        poles[::2] = np.stack([cos(self.breaks), sin(self.breaks), np.ones(len(self.breaks))], axis=1)
        poles[1::2] = np.stack([cos(middle), sin(middle), cos(half)], axis=1)
        return poles


@dataclass(frozen=True, slots=True)
class ParameterMap:
    """Map between the parameters of a face's own surface and those of its spline.

    A direction that is None has the same parameter on both.

    Examples
    --------
    >>> quarter = ParameterMap(u=ConicArcs(np.array([0.0, np.pi / 2])))
    >>> quarter.to_face(quarter.to_spline([[0.3, 5.0]])).round(12)
    array([[0.3, 5. ]])
    """

    u: ConicArcs | None = None
    v: ConicArcs | None = None

    def to_spline(self, uv: ArrayLike) -> Array:
        """Return the spline's parameters, shape (..., 2), of the face's."""
        return self._map_axes(uv, ConicArcs.to_spline)

    def to_face(self, uv: ArrayLike) -> Array:
        """Return the face's own parameters, shape (..., 2), of the spline's."""
        return self._map_axes(uv, ConicArcs.to_conic)

    def _map_axes(self, uv: ArrayLike, convert: Callable[[ConicArcs, Array], Array]) -> Array:
        result = np.array(uv, dtype=np.float64)
        for axis, arcs in enumerate((self.u, self.v)):
            if arcs is not None:
                result[..., axis] = convert(arcs, result[..., axis])
        return result


@dataclass(frozen=True, slots=True)
class _HomogeneousCurve:
    """A curve in homogeneous form, poles (n, 4), with the map of its parameter."""

    degree: int
    knots: Array
    poles: Array
    arcs: ConicArcs | None = None


@dataclass(frozen=True, slots=True)
class _SplineSurfaceData:
    """Degrees, knots, poles (nu, nv, 3) and weights of a spline surface, with the map of its parameters."""

    degrees: tuple[int, int]
    knots: tuple[Array, Array]
    poles: Array
    weights: Array | None
    parameters: ParameterMap = ParameterMap()

    @classmethod
    def from_homogeneous(
        cls, first: _HomogeneousCurve, second: _HomogeneousCurve, homogeneous: Array
    ) -> "_SplineSurfaceData":
        """Take degrees, knots and parameter maps from a curve of each direction; homogeneous poles are (nu, nv, 4)."""
        weights = homogeneous[..., 3]
        return cls(
            (first.degree, second.degree),
            (first.knots, second.knots),
            homogeneous[..., :3] / weights[..., np.newaxis],
            None if (weights == 1).all() else weights,
            ParameterMap(first.arcs, second.arcs),
        )


def to_surface(face: TopoDS_Face) -> Surface:
    """Return the surface of a face as a symbolic spline over the face's own parameter bounds, in place.

    Exact, but for offset surfaces without an exact form; the location is included. Orientation plays no part: a
    REVERSED face has the same surface, and its outward normal is ``-(Su x Sv)``.

    Parameters
    ----------
    face : TopoDS_Face
        A face on a surface of any type. The spline's parameters are the face's own on planes, Bezier, B-spline and
        offset surfaces and on extruded lines and splines; elsewhere see :func:`to_surface_with_map`.

    Raises
    ------
    InputError
        It is not a face, or is unbounded.
    GeometryError
        An offset surface could not be approximated to 1e-9 of its size.
    UnsupportedError
        The surface is of a type that OCCT itself does not store in files.
    """
    return to_surface_with_map(face)[0]


def find_outward_sign(face: TopoDS_Face) -> float:
    """Return +1 if Su x Sv of a face's surface points out of the material, -1 if into it."""
    mirrored = bool(face.Location().Transformation().IsNegative())
    return 1.0 if (face.Orientation() == TopAbs_REVERSED) == mirrored else -1.0


def to_surface_with_map(face: TopoDS_Face) -> tuple[Surface, ParameterMap]:
    """Return :func:`to_surface` of a face, and the map between the face's own parameters and the spline's."""
    if not isinstance(face, TopoDS_Face) or face.IsNull():
        raise InputError(f"{with_article(type(face).__name__)} is not a face")
    location = TopLoc_Location()
    surface = BRep_Tool.Surface_s(face, location)
    if surface is None:
        raise InputError("the face has no surface, only a triangulation")
    patch = _convert_surface(surface, *_find_face_window(face, surface))
    # The location moves the poles, not the surface: OCCT would give a scaled cylinder other parameters.
    poles = patch.poles if location.IsIdentity() else _transform_poles(patch.poles, location.Transformation())
    return Surface.from_bspline(patch.degrees, patch.knots, poles, patch.weights), patch.parameters


def to_face(surface: Surface) -> TopoDS_Face:
    """Return the face that covers the whole of a spline surface, on the B-spline of the same parametrisation.

    Closed directions get a seam, sides that shrink to a point a degenerate edge.

    Raises
    ------
    InputError
        The surface is not in space, or has a knot across which it is not even continuous.
    DegreeError
        A degree is above 25.
    GeometryError
        OCCT finds the face invalid.
    """
    if surface.dim != 3:
        raise InputError(f"a face needs a surface in space; this one has dimension {surface.dim}")
    maker = BRepBuilderAPI_MakeFace(spline_arrays.surface_from_arrays(*surface.to_bspline()), CONFUSION)
    if not maker.IsDone():
        raise GeometryError(f"OCCT cannot make a face of the surface ({maker.Error().name})")
    face = maker.Face()
    if not BRepCheck_Analyzer(face).IsValid():
        raise GeometryError(
            "OCCT finds the face of the surface invalid: does a side or a knot interval shrink below 1e-7 mm?"
        )
    return face


def _find_face_window(face: TopoDS_Face, surface: Geom_Surface) -> tuple[ParameterRange, ParameterRange]:
    """Return the face's own parameter bounds, inside those of its surface, and no more than a period wide."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    a0, a1, b0, b1 = surface.Bounds()
    return (
        _snap_range((u0, u1), (a0, a1), periodic=bool(surface.IsUPeriodic())),
        _snap_range((v0, v1), (b0, b1), periodic=bool(surface.IsVPeriodic())),
    )


def _snap_range(face_range: ParameterRange, surface_range: ParameterRange, *, periodic: bool) -> ParameterRange:
    """Return a face's parameter range, with ends that differ from its surface's by rounding put on these."""
    (start, stop), (least, most) = face_range, surface_range
    if max(abs(start), abs(stop)) > CONVERSION_TOLERANCES.unbounded:
        raise InputError("the face is unbounded; trim it first")
    slack = CONVERSION_TOLERANCES.bound_snap * (most - least)
    if periodic:
        width = stop - start
        return start, start + (most - least if width > most - least - slack else width)
    start = least if start < least + slack and least > -CONVERSION_TOLERANCES.unbounded else start
    stop = most if stop > most - slack and most < CONVERSION_TOLERANCES.unbounded else stop
    if not start < stop:
        raise InputError(f"the face has no extent: its parameters run from {start:g} to {stop:g}")
    return start, stop


def _transform_poles(poles: Array, transformation: gp_Trsf) -> Array:
    """Move poles (..., 3)."""
    matrix = np.array([[transformation.Value(row, column) for column in range(1, 5)] for row in range(1, 4)])
    return np.asarray(poles @ matrix[:, :3].T + matrix[:, 3])


def _convert_surface(surface: Geom_Surface, u: ParameterRange, v: ParameterRange) -> _SplineSurfaceData:
    if isinstance(surface, Geom_RectangularTrimmedSurface):
        return _convert_surface(surface.BasisSurface(), u, v)
    if isinstance(surface, Geom_BezierSurface):
        return _convert_bspline_surface(GeomConvert.SurfaceToBSplineSurface_s(surface), u, v)
    if isinstance(surface, Geom_BSplineSurface):
        return _convert_bspline_surface(surface, u, v)
    if isinstance(surface, Geom_ElementarySurface):
        return _convert_elementary_surface(surface, u, v)
    if isinstance(surface, Geom_SurfaceOfLinearExtrusion):
        return _extrude_curve(_convert_curve(surface.BasisCurve(), u), _to_array(surface.Direction()), v)
    if isinstance(surface, Geom_SurfaceOfRevolution):
        axis = surface.Axis()
        return _revolve_curve(
            _convert_curve(surface.BasisCurve(), v), _to_array(axis.Location()), _to_array(axis.Direction()), u
        )
    if isinstance(surface, Geom_OffsetSurface):
        return _convert_offset_surface(surface, u, v)
    raise UnsupportedError(
        f"a surface of type {surface.DynamicType().Name()} cannot be converted; rebuild it as a B-spline"
    )


def _convert_bspline_surface(surface: Geom_BSplineSurface, u: ParameterRange, v: ParameterRange) -> _SplineSurfaceData:
    if (*u, *v) != surface.Bounds():
        surface = surface.Copy()
        surface.Segment(*u, *v)
    return _SplineSurfaceData(*spline_arrays.surface_to_arrays(surface))


def _convert_elementary_surface(
    surface: Geom_ElementarySurface, u: ParameterRange, v: ParameterRange
) -> _SplineSurfaceData:
    """Convert a plane as an extruded line, any other as a line or circle of the plane (X, Z) revolved about Z."""
    frame = surface.Position()
    origin = _to_array(frame.Location())
    x, y, z = map(_to_array, (frame.XDirection(), frame.YDirection(), frame.Direction()))
    if isinstance(surface, Geom_Plane):
        return _extrude_curve(_build_line(origin, x, u), y, v)
    if isinstance(surface, Geom_CylindricalSurface):
        profile = _build_line(origin + surface.Radius() * x, z, v)
    elif isinstance(surface, Geom_ConicalSurface):
        angle = surface.SemiAngle()
        profile = _build_line(origin + surface.RefRadius() * x, math.sin(angle) * x + math.cos(angle) * z, v)
    elif isinstance(surface, Geom_SphericalSurface):
        profile = _build_conic(origin, surface.Radius() * x, surface.Radius() * z, v)
    elif isinstance(surface, Geom_ToroidalSurface):
        centre, radius = origin + surface.MajorRadius() * x, surface.MinorRadius()
        profile = _build_conic(centre, radius * x, radius * z, v)
    else:
        raise UnsupportedError(f"a surface of type {surface.DynamicType().Name()} cannot be converted")
    return _revolve_curve(profile, origin, z if frame.Direct() else -z, u)


def _convert_offset_surface(surface: Geom_OffsetSurface, u: ParameterRange, v: ParameterRange) -> _SplineSurfaceData:
    """Convert the exact surface if OCCT knows one (an offset cylinder is a cylinder), else approximate; check both."""
    exact = surface.Surface()
    if exact is not None:
        patch = _convert_surface(exact, u, v)
        if _measure_deviation(surface, patch, u, v) <= CONVERSION_TOLERANCES.offset_surface_error * _measure_extent(
            patch
        ):
            return patch
    trimmed = Geom_RectangularTrimmedSurface(surface, *u, *v)
    corners = np.array([_to_array(surface.Value(a, b)) for a in u for b in v])
    tolerance = CONVERSION_TOLERANCES.offset_surface_error * float(np.ptp(corners, axis=0).max())
    smooth = GeomAbs_Shape.GeomAbs_C1
    approximation = GeomConvert_ApproxSurface(trimmed, tolerance / 10, smooth, smooth, 14, 14, 100, 0)
    if approximation.HasResult():
        patch = _SplineSurfaceData(*spline_arrays.surface_to_arrays(approximation.Surface()))
        if _measure_deviation(surface, patch, u, v) <= tolerance:
            return patch
    raise GeometryError(
        f"the offset surface could not be approximated to {tolerance:.1e} mm over {u} x {v}; rebuild it as a B-spline"
    )


def _measure_deviation(surface: Geom_Surface, patch: _SplineSurfaceData, u: ParameterRange, v: ParameterRange) -> float:
    """Return the largest distance between a surface and the spline made of it, on a grid that avoids the knots."""
    us, vs = (start + (stop - start) * (np.arange(41) + 0.37) / 42 for start, stop in (u, v))
    spline = Surface.from_bspline(patch.degrees, patch.knots, patch.poles, patch.weights)
    uv = patch.parameters.to_spline(np.stack(np.meshgrid(us, vs, indexing="ij"), axis=-1))
    truth = np.array([[_to_array(surface.Value(a, b)) for b in vs] for a in us])
    return float(np.linalg.norm(spline(uv[..., 0], uv[..., 1]) - truth, axis=-1).max())


def _convert_curve(curve: Geom_Curve, window: ParameterRange) -> _HomogeneousCurve:
    """Return a curve of space over a window of its parameter, exactly unless it is an offset curve."""
    if isinstance(curve, Geom_TrimmedCurve):
        return _convert_curve(curve.BasisCurve(), window)
    if isinstance(curve, Geom_Line):
        return _build_line(_to_array(curve.Position().Location()), _to_array(curve.Position().Direction()), window)
    if isinstance(curve, Geom_Conic):
        return _convert_conic_curve(curve, window)
    if isinstance(curve, Geom_BezierCurve):
        curve = GeomConvert.CurveToBSplineCurve_s(curve)
    elif isinstance(curve, Geom_OffsetCurve):
        curve = _approximate_offset_curve(curve, window)
    if not isinstance(curve, Geom_BSplineCurve):
        raise UnsupportedError(
            f"a curve of type {curve.DynamicType().Name()} cannot be converted; rebuild it as a B-spline"
        )
    if window != (curve.FirstParameter(), curve.LastParameter()):
        curve = curve.Copy()
        curve.Segment(*window)
    degree, knots, poles, weights = spline_arrays.curve_to_arrays(curve)
    weights = np.ones(len(poles)) if weights is None else weights
    return _HomogeneousCurve(degree, knots, np.column_stack([poles * weights[:, np.newaxis], weights]))


def _convert_conic_curve(curve: Geom_Conic, window: ParameterRange) -> _HomogeneousCurve:
    frame = curve.Position()
    centre, x, y = map(_to_array, (frame.Location(), frame.XDirection(), frame.YDirection()))
    if isinstance(curve, Geom_Circle):
        return _build_conic(centre, curve.Radius() * x, curve.Radius() * y, window)
    if isinstance(curve, Geom_Ellipse | Geom_Hyperbola):
        hyperbolic = isinstance(curve, Geom_Hyperbola)
        return _build_conic(centre, curve.MajorRadius() * x, curve.MinorRadius() * y, window, hyperbolic=hyperbolic)
    # Parabola: centre + t^2 / (4 focal) x + t y, whose poles are its values at (t0, t0), (t0, t1), (t1, t1), polarised.
    first, second = np.array(window)[[0, 0, 1]], np.array(window)[[0, 1, 1]]
    square, linear = first * second / (4 * curve.Focal()), (first + second) / 2
    points = centre + np.outer(square, x) + np.outer(linear, y)
    return _HomogeneousCurve(2, np.repeat(window, 3), np.column_stack([points, np.ones(3)]))


def _approximate_offset_curve(curve: Geom_OffsetCurve, window: ParameterRange) -> Geom_BSplineCurve:
    trimmed = Geom_TrimmedCurve(curve, *window)
    samples = np.linspace(*window, 211)
    truth = np.array([_to_array(curve.Value(t)) for t in samples])
    tolerance = CONVERSION_TOLERANCES.offset_surface_error * float(np.ptp(truth, axis=0).max())
    approximation = GeomConvert_ApproxCurve(trimmed, tolerance / 10, GeomAbs_Shape.GeomAbs_C1, 100, 14)
    if approximation.HasResult():
        result = approximation.Curve()
        found = np.array([_to_array(result.Value(t)) for t in samples])
        if float(np.linalg.norm(found - truth, axis=1).max()) <= tolerance:
            return result
    raise GeometryError(f"the offset curve could not be approximated to {tolerance:.1e} mm over {window}")


def _build_line(origin: Array, direction: Array, window: ParameterRange) -> _HomogeneousCurve:
    points = origin + np.outer(window, direction)
    return _HomogeneousCurve(1, np.repeat(window, 2), np.column_stack([points, np.ones(2)]))


def _build_conic(
    centre: Array, major: Array, minor: Array, window: ParameterRange, *, hyperbolic: bool = False
) -> _HomogeneousCurve:
    """Return centre + cos t major + sin t minor, or cosh and sinh; the half-axes are vectors (3,) of full length."""
    arcs = split_into_arcs(window, hyperbolic=hyperbolic)
    unit = arcs.build_unit_conic()
    points = unit @ np.stack([major, minor, centre])
    return _HomogeneousCurve(2, arcs.build_knots(), np.column_stack([points, unit[:, 2]]), arcs)


def split_into_arcs(window: ParameterRange, *, hyperbolic: bool = False) -> ConicArcs:
    """Return a range of a conic's parameter as equal arcs of at most 120 degrees."""
    start, stop = window
    count = max(1, math.ceil((stop - start) / CONVERSION_TOLERANCES.largest_arc - CONVERSION_TOLERANCES.arc_count))
    return ConicArcs(np.linspace(start, stop, count + 1), hyperbolic)


def _extrude_curve(profile: _HomogeneousCurve, direction: Array, v: ParameterRange) -> _SplineSurfaceData:
    """Extrude a profile along a unit direction, by the lengths ``v``."""
    shift = np.append(direction, 0.0)
    weights = profile.poles[:, 3:]
    rows = [profile.poles + length * weights * shift for length in v]
    return _SplineSurfaceData.from_homogeneous(profile, _build_line(np.zeros(3), direction, v), np.stack(rows, axis=1))


def _revolve_curve(profile: _HomogeneousCurve, origin: Array, axis: Array, u: ParameterRange) -> _SplineSurfaceData:
    """Revolve a profile about an axis, right-handed, by the angles ``u``."""
    x, y, centre = np.eye(3)[0], np.eye(3)[1], np.zeros(3)
    turn = _build_conic(centre, x, y, u)
    cos, sin, weight = turn.poles[:, [0, 1, 3]].T[..., np.newaxis, np.newaxis]
    points, weights = profile.poles[:, :3], profile.poles[:, 3:]
    arm = points - weights * origin
    along = np.outer(arm @ axis, axis)
    arm = arm - along
    turned = cos * arm + sin * np.cross(axis, arm) + weight * (along + weights * origin)
    return _SplineSurfaceData.from_homogeneous(turn, profile, np.concatenate([turned, weight * weights], axis=-1))


def _measure_extent(patch: _SplineSurfaceData) -> float:
    return float(np.ptp(patch.poles.reshape(-1, 3), axis=0).max())


def _to_array(triple: gp_Pnt | gp_Dir) -> Array:
    return np.array([triple.X(), triple.Y(), triple.Z()])
