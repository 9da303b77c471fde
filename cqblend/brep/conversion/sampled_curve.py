"""Evaluate curves of OCCT, in space or in a parameter plane, at their own parameters by arrays.

Exists because an edge of a shape and its pcurves share one parameter, which the rational form of a conic does not
keep: so a :class:`SampledCurve` is a symbolic curve together with the map of its parameter. Depends on curves only,
neither on edges nor on faces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from OCP.Geom import (
    Geom_BezierCurve,
    Geom_BSplineCurve,
    Geom_Conic,
    Geom_Curve,
    Geom_Hyperbola,
    Geom_Line,
    Geom_Parabola,
    Geom_TrimmedCurve,
)
from OCP.Geom2d import (
    Geom2d_BezierCurve,
    Geom2d_BSplineCurve,
    Geom2d_Conic,
    Geom2d_Curve,
    Geom2d_Hyperbola,
    Geom2d_Line,
    Geom2d_Parabola,
    Geom2d_TrimmedCurve,
)
from OCP.Geom2dConvert import Geom2dConvert
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.conversion.spline_conversion import ConicArcs, split_into_arcs
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array


@dataclass(frozen=True, slots=True, eq=False)
class SampledCurve:
    """A curve over a range of its own parameter t.

    Attributes
    ----------
    geom_curve
        The curve of OCCT.
    parameter_range
        First and last t.
    curve
        The symbolic curve, with ``curve(to_curve_parameter(t))`` the point at t; exact. None for offset curves, which
        are no splines.
    arcs
        The map of t, the angle of a conic, to the curve's parameter; None if both are the same.
    breaks
        (k,) t at which pieces of the curve meet, the ends of the range included.
    """

    geom_curve: Geom_Curve | Geom2d_Curve
    parameter_range: tuple[float, float]
    curve: Curve | None
    arcs: ConicArcs | None
    breaks: Array

    def __call__(self, t: Array) -> Array:
        """Return the points (n, dim) at parameters (n,)."""
        if self.curve is None:
            return np.array([self.geom_curve.Value(float(one)).Coord() for one in t])
        return self.curve(self.to_curve_parameter(t))

    def to_curve_parameter(self, t: Array) -> Array:
        """Return the parameters (n,) of the symbolic curve."""
        return t if self.arcs is None else self.arcs.to_spline(t)


def read_sampled_curve(curve: Geom_Curve | Geom2d_Curve, first: float, last: float) -> SampledCurve:
    """Return a curve over a part of its range.

    Examples
    --------
    >>> from OCP.Geom2d import Geom2d_Circle
    >>> from OCP.gp import gp_Ax2d
    >>> circle = Geom2d_Circle(gp_Ax2d(gp_Pnt2d(1.0, 0.0), gp_Dir2d(1.0, 0.0)), 1.0)
    >>> quarter = read_sampled_curve(circle, 0.0, np.pi / 2)
    >>> (quarter(np.array([np.pi / 6])) - [1 + np.cos(np.pi / 6), 0.5]).round(12) + 0.0
    array([[0., 0.]])
    """
    geom_curve, parameter_range = curve, (first, last)
    while isinstance(curve, Geom_TrimmedCurve | Geom2d_TrimmedCurve):
        curve = curve.BasisCurve()
    if isinstance(curve, Geom_Line | Geom2d_Line):
        ends = np.array([curve.Value(first).Coord(), curve.Value(last).Coord()])
        return _make_sampled_curve(geom_curve, parameter_range, Curve.bezier(ends, domain=parameter_range))
    if isinstance(curve, Geom_Conic | Geom2d_Conic) and not isinstance(curve, Geom_Parabola | Geom2d_Parabola):
        return _read_conic(curve, parameter_range)
    return _make_sampled_curve(geom_curve, parameter_range, _read_spline(curve, first, last))


def _make_sampled_curve(
    geom_curve: Geom_Curve | Geom2d_Curve,
    parameter_range: tuple[float, float],
    curve: Curve | None,
    arcs: ConicArcs | None = None,
) -> SampledCurve:
    inner = curve.breaks[1:-1] if curve is not None else np.array([])
    breaks = np.concatenate([parameter_range[:1], inner, parameter_range[1:]])
    return SampledCurve(geom_curve, parameter_range, curve, arcs, breaks)


def _read_conic(curve: Geom_Conic | Geom2d_Conic, parameter_range: tuple[float, float]) -> SampledCurve:
    """Read the conic centre + cos t x + sin t y, or the hyperbola centre + cosh t x + sinh t y."""
    hyperbolic = isinstance(curve, Geom_Hyperbola | Geom2d_Hyperbola)
    radii = (curve.Radius(),) * 2 if hasattr(curve, "Radius") else (curve.MajorRadius(), curve.MinorRadius())
    frame = curve.Position()
    centre, x, y = map(_to_array, (curve.Location(), frame.XDirection(), frame.YDirection()))
    arcs = split_into_arcs(parameter_range, hyperbolic=hyperbolic)
    unit = arcs.build_unit_conic()
    poles = unit @ np.stack([radii[0] * x, radii[1] * y, centre])
    weights = unit[:, 2]
    spline = Curve.from_bspline(2, arcs.build_knots(), poles / weights[:, None], weights)
    return _make_sampled_curve(curve, parameter_range, spline, arcs)


def _read_spline(curve: Geom_Curve | Geom2d_Curve, first: float, last: float) -> Curve | None:
    """Read a parabola, Bezier or B-spline curve over its own parameter; None for any other curve."""
    if isinstance(curve, Geom_Parabola):
        curve = Geom_TrimmedCurve(curve, first, last)
    elif isinstance(curve, Geom2d_Parabola):
        curve = Geom2d_TrimmedCurve(curve, first, last)
    if isinstance(curve, Geom_BezierCurve | Geom_TrimmedCurve):
        curve = GeomConvert.CurveToBSplineCurve_s(curve)
    elif isinstance(curve, Geom2d_BezierCurve | Geom2d_TrimmedCurve):
        curve = Geom2dConvert.CurveToBSplineCurve_s(curve)
    if not isinstance(curve, Geom_BSplineCurve | Geom2d_BSplineCurve):
        return None
    start, stop = curve.FirstParameter(), curve.LastParameter()
    if curve.IsPeriodic() and not start <= first < last <= stop:
        curve = curve.Copy()
        curve.Segment(first, last)
        start, stop = first, last
    read = spline_arrays.curve_to_arrays if isinstance(curve, Geom_BSplineCurve) else spline_arrays.curve2d_to_arrays
    spline = Curve.from_bspline(*read(curve))
    inside = max(first, start), min(last, stop)
    return spline if inside == (start, stop) else spline.clip(*inside)


def _to_array(triple: gp_Pnt | gp_Dir | gp_Pnt2d | gp_Dir2d) -> Array:
    return np.array(triple.Coord())
