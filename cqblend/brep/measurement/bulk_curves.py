"""Curves of OCCT, in space and in the plane, evaluated at many parameters at once, with OCCT as the witness.

Calling OCCT for each parameter costs more than all the rest of a measurement. So lines, conics and splines are read off
OCCT once and evaluated in NumPy, by formulas that share nothing with :mod:`cqblend.splines`; OCCT itself evaluates some
of the same parameters each time the curve is met in a new range. Curves for which there is no formula, and those on
which the two do not agree, are evaluated by OCCT point by point.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TypeAlias

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import (
    Geom_BezierCurve,
    Geom_BSplineCurve,
    Geom_Circle,
    Geom_Curve,
    Geom_Ellipse,
    Geom_Line,
    Geom_TrimmedCurve,
)
from OCP.Geom2d import (
    Geom2d_BezierCurve,
    Geom2d_BSplineCurve,
    Geom2d_Circle,
    Geom2d_Curve,
    Geom2d_Ellipse,
    Geom2d_Line,
    Geom2d_TrimmedCurve,
)
from OCP.Geom2dConvert import Geom2dConvert
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec, gp_Vec2d

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.measurement.spline_basis import count_knots, divide_by_weights, evaluate_basis
from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.brep.measurement.witnesses import EVALUATION_FAILURES, WitnessedRange, choose_witnesses
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array

AnyCurve: TypeAlias = Geom_Curve | Geom2d_Curve | BRepAdaptor_Curve
"""A curve in space or in the plane, or an edge that has no curve but those on its faces."""

CurveFormula = Callable[[Array, int], Array]
"""Value and derivatives up to an order of a curve, (order + 1, d, n), at parameters (n,)."""

_LINES = (Geom_Line, Geom2d_Line)
_CONICS = (Geom_Circle, Geom2d_Circle, Geom_Ellipse, Geom2d_Ellipse)


class CurveEvaluator:
    """Evaluates one curve of OCCT, in space or in the plane: its points and its first two derivatives.

    Attributes
    ----------
    curve : Geom_Curve, Geom2d_Curve or BRepAdaptor_Curve
    dimension : int
        3 in space, 2 in the plane.
    is_analytic : bool
        Whether it is a line, a circle or an ellipse, which is smooth everywhere.
    """

    def __init__(self, curve: AnyCurve) -> None:
        self.curve = curve
        self.dimension = 2 if isinstance(curve, Geom2d_Curve) else 3
        while isinstance(curve, Geom_TrimmedCurve | Geom2d_TrimmedCurve):
            curve = curve.BasisCurve()
        self._basis = curve
        self.is_analytic = isinstance(curve, _LINES + _CONICS)
        self._witnessed = WitnessedRange()
        self._is_contradicted = False

    @property
    def is_in_bulk(self) -> bool:
        """Whether there is a formula, which OCCT has not contradicted."""
        return self._reading[1] is not None and not self._is_contradicted

    @property
    def is_straight(self) -> bool:
        """Whether it is a straight line at constant speed, a spline with two poles included."""
        basis = self._basis
        if isinstance(basis, Geom_BSplineCurve | Geom2d_BSplineCurve):
            return bool(basis.Degree() == 1 and basis.NbPoles() == 2 and not basis.IsRational())
        return isinstance(basis, _LINES)

    @property
    def circle(self) -> tuple[Array, float] | None:
        """Centre and radius of a circle, of an arc all the same; None of every other curve."""
        basis = self._basis
        if not isinstance(basis, Geom_Circle | Geom2d_Circle):
            return None
        return np.array(basis.Location().Coord()), basis.Radius()

    @property
    def is_single_span(self) -> bool:
        """Whether it has no knots inside, and no period after which it starts anew."""
        basis = self._basis
        if isinstance(basis, Geom_BSplineCurve | Geom2d_BSplineCurve):
            return bool(basis.NbKnots() == 2 and not basis.IsPeriodic())
        return self.is_analytic or isinstance(basis, Geom_BezierCurve | Geom2d_BezierCurve)

    @property
    def knots(self) -> Array | None:
        """The knots of a spline, each once, within its own bounds; None of every other curve."""
        return self._reading[0]

    @cached_property
    def _reading(self) -> tuple[Array | None, CurveFormula | None]:
        """The distinct knots and the formula of the curve, as far as there are any."""
        basis = self._basis
        if self.is_straight and not isinstance(basis, _LINES):
            return _read_two_poles(basis)
        if isinstance(basis, Geom_BSplineCurve | Geom_BezierCurve | Geom2d_BSplineCurve | Geom2d_BezierCurve):
            return _read_spline(basis)
        if isinstance(basis, _LINES):
            return None, _read_line(basis)
        return None, _read_ellipse(basis) if isinstance(basis, _CONICS) else None

    def __call__(self, ts: Array, order: int = 0) -> Array:
        """Return the points and the derivatives up to an order of at most 2, (order + 1, d, n), at parameters (n,).

        Coordinates come before samples, as NumPy works through such arrays fastest.

        Raises
        ------
        GeometryError
            If OCCT cannot evaluate the curve.
        """
        formula = None if len(ts) < MEASURE_TOLERANCES.fewest_in_bulk else self._reading[1]
        if formula is None or self._is_contradicted:
            return self.evaluate_by_occt(ts, order)
        found = formula(ts, order)
        if not self._witnessed.covers(ts[None]):
            at = choose_witnesses(len(ts))
            witnessed = self.evaluate_by_occt(ts[at], order)
            if not _agrees(found.take(at, axis=-1), witnessed):
                self._is_contradicted = True
                return self.evaluate_by_occt(ts, order)
            self._witnessed.extend(ts[None])
        return found

    def evaluate_by_occt(self, ts: Array, order: int = 0) -> Array:
        """Return the same from OCCT, point by point.

        Raises
        ------
        GeometryError
            If OCCT cannot evaluate the curve.
        """
        point, make_vector = (gp_Pnt(), gp_Vec) if self.dimension == 3 else (gp_Pnt2d(), gp_Vec2d)
        vectors = [make_vector() for _ in range(order)]
        evaluate = (self.curve.D0, self.curve.D1, self.curve.D2)[order]
        readers = [point.Coord, *(vector.Coord for vector in vectors)]
        flat: list[float] = []
        for t in ts.tolist():
            try:
                evaluate(t, point, *vectors)
            except EVALUATION_FAILURES as error:
                raise GeometryError(f"OCCT cannot evaluate a curve at t = {t:.9g}") from error
            for read in readers:
                flat += read()
        return np.array(flat).reshape(-1, order + 1, self.dimension).transpose(1, 2, 0)


def _agrees(found: Array, witnessed: Array) -> bool:
    """Whether points and derivatives (order + 1, d, n) are those of OCCT, but for rounding."""
    sizes, errors = (np.abs(part).max(axis=(1, 2)).tolist() for part in (witnessed, found - witnessed))
    position, derivative = MEASURE_TOLERANCES.witness_position, MEASURE_TOLERANCES.witness_derivative
    # a derivative that ought to be nothing is rounding of what it is a difference of
    rounding = position * max(sizes)
    allowed = [position * sizes[0], *(max(derivative * size, rounding) for size in sizes[1:])]
    return all(error <= most for error, most in zip(errors, allowed, strict=True))


def _read_spline(curve: AnyCurve) -> tuple[Array, CurveFormula]:
    """Return the distinct knots and the formula of a B-spline or Bezier curve."""
    if isinstance(curve, Geom_Curve):
        spline = curve if isinstance(curve, Geom_BSplineCurve) else GeomConvert.CurveToBSplineCurve_s(curve)
        degree, knots, poles, weights = spline_arrays.curve_to_arrays(spline)
    else:
        spline = curve if isinstance(curve, Geom2d_BSplineCurve) else Geom2dConvert.CurveToBSplineCurve_s(curve)
        degree, knots, poles, weights = spline_arrays.curve2d_to_arrays(spline)
    if weights is not None:
        poles = np.column_stack((poles * weights[:, None], weights))
    columns, periodic, low, high = np.ascontiguousarray(poles.T), spline.IsPeriodic(), knots[0], knots[-1]

    def evaluate_spline(ts: Array, order: int) -> Array:
        if periodic:
            ts = ts - np.floor((ts - low) / (high - low)) * (high - low)
        basis = evaluate_basis(knots, degree, ts, order)
        found = basis.combine(columns.take(basis.poles, axis=1))
        return np.stack(found if weights is None else divide_by_weights(found))

    return count_knots(knots)[0], evaluate_spline


def _read_two_poles(spline: Geom_BSplineCurve | Geom2d_BSplineCurve) -> tuple[Array, CurveFormula]:
    """Return the knots and the formula of a B-spline that is a straight line from one pole to the other."""
    low, high = spline.Knot(1), spline.Knot(2)
    start, stop = (np.array(spline.Pole(i).Coord())[:, None] for i in (1, 2))
    step = stop - start

    def evaluate_straight_spline(ts: Array, order: int) -> Array:
        share = (ts - low) / (high - low)
        found = np.zeros((order + 1, len(start), len(ts)))
        found[0] = start * (1.0 - share) + stop * share
        found[1:2] = step / (high - low)
        return found

    return np.array([low, high]), evaluate_straight_spline


def _read_line(line: Geom_Line | Geom2d_Line) -> CurveFormula:
    """Return the formula of a straight line."""
    axis = line.Position()
    start, direction = np.array(axis.Location().Coord())[:, None], np.array(axis.Direction().Coord())[:, None]

    def evaluate_line(ts: Array, order: int) -> Array:
        found = np.zeros((order + 1, len(start), len(ts)))
        found[0] = start + direction * ts
        found[1:2] = direction
        return found

    return evaluate_line


def _read_ellipse(conic: Geom_Circle | Geom2d_Circle | Geom_Ellipse | Geom2d_Ellipse) -> CurveFormula:
    """Return the formula of a circle or an ellipse."""
    if isinstance(conic, Geom_Circle | Geom2d_Circle):
        radii = (conic.Radius(), conic.Radius())
    else:
        radii = (conic.MajorRadius(), conic.MinorRadius())
    centre = np.array(conic.Location().Coord())[:, None]
    a, b = (
        radius * np.array(axis.Direction().Coord())[:, None]
        for radius, axis in zip(radii, (conic.XAxis(), conic.YAxis()), strict=True)
    )

    def evaluate_ellipse(ts: Array, order: int) -> Array:
        cosines, sines = np.cos(ts), np.sin(ts)
        found = np.empty((order + 1, len(centre), len(ts)))
        from_centre = a * cosines + b * sines
        found[0] = centre + from_centre
        found[1:2] = b * cosines - a * sines
        found[2:3] = -from_centre
        return found

    return evaluate_ellipse
