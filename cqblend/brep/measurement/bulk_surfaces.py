"""Surfaces of OCCT evaluated at many parameters at once, with OCCT as the witness.

As :mod:`cqblend.brep.measurement.bulk_curves` does with curves: planes, quadrics, tori, surfaces of revolution and of
extrusion, and splines are read off OCCT once and evaluated in NumPy, by formulas that share nothing with
:mod:`cqblend.splines` and :mod:`cqblend.surfaces`; OCCT evaluates some of the same points each time the surface is met
in a new region. Offset surfaces and all others, and those on which the two do not agree, are evaluated by OCCT.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Literal

import numpy as np
from OCP.Geom import (
    Geom_BezierSurface,
    Geom_BSplineSurface,
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_ElementarySurface,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_Surface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
)
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax2, gp_Pnt, gp_Vec

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.spline_basis import LocalBasis, count_knots, evaluate_basis
from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.brep.measurement.witnesses import EVALUATION_FAILURES, WitnessedRange, choose_witnesses
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array

Order = Literal[0, 1, 2]
SurfaceFormula = Callable[[Array, Array, Order], list[Array]]
"""Jets of a surface, each (3, n), at parameters u (n,) and v (n,): S; Su, Sv; Suu, Svv, Suv."""

_ORDERS_IN_U_AND_V = ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1))
"""How often the jets S, Su, Sv, Suu, Svv, Suv are differentiated by u and by v."""

_JET_COUNTS = (1, 3, 6)
"""Number of jets up to order 0, 1, 2."""


class SurfaceEvaluator:
    """Evaluates one surface of OCCT: its points and its first and second derivatives.

    Attributes
    ----------
    surface : Geom_Surface
    is_analytic : bool
        Whether it is a plane, a cylinder, a cone, a sphere or a torus, which is smooth everywhere.
    """

    def __init__(self, surface: Geom_Surface) -> None:
        self.surface = surface
        while isinstance(surface, Geom_RectangularTrimmedSurface):
            surface = surface.BasisSurface()
        self._basis = surface
        self.is_analytic = isinstance(surface, Geom_ElementarySurface)
        self._witnessed = WitnessedRange()
        self._is_contradicted = False

    @property
    def is_in_bulk(self) -> bool:
        """Whether there is a formula, which OCCT has not contradicted."""
        return self._formula is not None and not self._is_contradicted

    @property
    def is_single_patch(self) -> bool:
        """Whether there is no knot line in it, and no period after which it starts anew, but that of an angle."""
        basis = self._basis
        if isinstance(basis, Geom_BSplineSurface):
            is_patch = basis.NbUKnots() == 2 and basis.NbVKnots() == 2
            return bool(is_patch and not basis.IsUPeriodic() and not basis.IsVPeriodic())
        if isinstance(basis, Geom_SurfaceOfRevolution | Geom_SurfaceOfLinearExtrusion):
            return CurveEvaluator(basis.BasisCurve()).is_single_span
        return self.is_analytic or isinstance(basis, Geom_BezierSurface)

    @cached_property
    def spline(self) -> SplineSurface | None:
        """The surface's poles and knots if it is a spline."""
        is_spline = isinstance(self._basis, Geom_BSplineSurface | Geom_BezierSurface)
        return SplineSurface(self._basis) if is_spline else None

    @cached_property
    def _formula(self) -> SurfaceFormula | None:
        """The formula of the surface, if there is one."""
        return self.spline.compute_jets if self.spline else _find_formula(self._basis)

    def __call__(self, uv: Array, order: Order) -> Array:
        """Return jets S, Su, Sv and, to order 2, Suu, Svv, Suv, as (1, 3 or 6, 3, n), at parameters (2, n).

        Raises
        ------
        GeometryError
            If OCCT cannot evaluate the surface.
        """
        formula = None if uv.shape[1] < MEASURE_TOLERANCES.fewest_in_bulk else self._formula
        if formula is None or self._is_contradicted:
            return self.evaluate_by_occt(uv, order)
        found = np.stack(formula(uv[0], uv[1], order))
        if not self._witnessed.covers(uv):
            at = choose_witnesses(uv.shape[1])
            if not _agrees(found.take(at, axis=-1), self.evaluate_by_occt(uv.take(at, axis=1), order)):
                self._is_contradicted = True
                return self.evaluate_by_occt(uv, order)
            self._witnessed.extend(uv)
        return found

    def evaluate_by_occt(self, uv: Array, order: Order) -> Array:
        """Return the same from OCCT, point by point.

        Raises
        ------
        GeometryError
            If OCCT cannot evaluate the surface.
        """
        evaluate = (self.surface.D0, self.surface.D1, self.surface.D2)[order]
        point, vectors = gp_Pnt(), [gp_Vec() for _ in range(_JET_COUNTS[order] - 1)]
        readers = [point.Coord, *(vector.Coord for vector in vectors)]
        flat: list[float] = []
        for u, v in uv.T.tolist():
            try:
                evaluate(u, v, point, *vectors)
            except EVALUATION_FAILURES as error:
                raise GeometryError(f"OCCT cannot differentiate the surface at (u, v) = ({u:.9g}, {v:.9g})") from error
            for read in readers:
                flat += read()
        return np.array(flat).reshape(-1, len(readers), 3).transpose(1, 2, 0)


def _agrees(found: Array, witnessed: Array) -> bool:
    """Whether jets (1, 3 or 6, 3, n) are those of OCCT, but for rounding.

    What is allowed of a derivative is relative to the largest of its order; a second one may vanish, and counts then
    beside the curvature of a surface as large as its coordinates.
    """
    sizes, errors = (np.abs(part).max(axis=(1, 2)).tolist() for part in (witnessed, found - witnessed))
    slope = max(sizes[1:3], default=0.0)
    bend = max([*sizes[3:], slope**2 / sizes[0] if sizes[0] else 0.0])
    position, derivative = MEASURE_TOLERANCES.witness_position, MEASURE_TOLERANCES.witness_derivative
    return (
        errors[0] <= position * sizes[0]
        and all(error <= derivative * slope for error in errors[1:3])
        and all(error <= derivative * bend for error in errors[3:])
    )


class SplineSurface:
    """A B-spline or Bezier surface as arrays.

    Attributes
    ----------
    degrees : (int, int)
    knots : (ndarray, ndarray)
        Full knot vectors over one period where it is periodic.
    is_periodic : (bool, bool)
    breaks, multiplicities : (ndarray, ndarray)
        The distinct knots in both directions, and how often each is repeated.
    """

    def __init__(self, surface: Geom_BSplineSurface | Geom_BezierSurface) -> None:
        if isinstance(surface, Geom_BezierSurface):
            surface = GeomConvert.SurfaceToBSplineSurface_s(surface)
        self.degrees, self.knots, poles, weights = spline_arrays.surface_to_arrays(surface)
        self.is_periodic = (surface.IsUPeriodic(), surface.IsVPeriodic())
        breaks, multiplicities = zip(*map(count_knots, self.knots), strict=True)
        self.breaks, self.multiplicities = breaks, multiplicities
        self._shape = poles.shape[:2]
        if weights is not None:
            poles = np.concatenate((poles * weights[..., None], weights[..., None]), axis=-1)
        self._is_rational = weights is not None
        self._columns = np.ascontiguousarray(poles.reshape(-1, poles.shape[-1]).T)  # (3 or 4, nu * nv)

    def compute_jets(self, u: Array, v: Array, order: Order) -> list[Array]:
        """Return the jets up to an order, each (3, n).

        Along an isoparameter the poles are first reduced to those of the curves of points and cross derivatives.
        """
        along_u, along_v = (self._evaluate_basis(axis, t, order) for axis, t in enumerate((u, v)))
        table = self._columns.reshape(-1, *self._shape)
        if along_v.poles.shape[1] == 1:
            curves = np.stack(along_v.combine(table[:, :, along_v.poles[:, 0], None]))[..., 0]
            found = along_u.combine(curves.take(along_u.poles, axis=2))
            return self._order_jets(lambda i, j: found[i][j], order)
        if along_u.poles.shape[1] == 1:
            curves = np.stack(along_u.combine(table[:, along_u.poles[:, 0]].swapaxes(1, 2)[..., None]))[..., 0]
            found = along_v.combine(curves.take(along_v.poles, axis=2))
            return self._order_jets(lambda i, j: found[j][i], order)
        picked = self._columns.take(along_u.poles[:, None] * self._shape[1] + along_v.poles, axis=1)
        mixed = [along_u.combine(row) for row in along_v.combine(picked)]
        return self._order_jets(lambda i, j: mixed[j][i], order)

    def compute_normals_on_grid(self, u: Array, v: Array) -> Array:
        """Return vectors (3, n, m) along the normals Su x Sv at all pairs of parameters u (n,) and v (m,)."""
        along_u, along_v = (
            evaluate_basis(knots, degree, t, 1)
            for knots, degree, t in zip(self.knots, self.degrees, (u, v), strict=True)
        )
        table = self._columns.reshape(-1, *self._shape)
        rows = [row.transpose(0, 2, 1) for row in along_v.combine(table[:, :, along_v.poles])]  # (d, m, nu)
        points, su = along_u.combine(rows[0].take(along_u.poles, axis=2))
        sv = along_u.combine(rows[1].take(along_u.poles, axis=2))[0]
        if self._is_rational:
            su, sv = (part[:-1] * points[-1] - part[-1] * points[:-1] for part in (su, sv))
        (a, b, c), (x, y, z) = su, sv
        return np.stack((b * z - c * y, c * x - a * z, a * y - b * x)).transpose(0, 2, 1)

    def _evaluate_basis(self, axis: int, t: Array, order: Order) -> LocalBasis:
        """Return the basis in one direction at parameters (n,), at one of them if they are all the same."""
        knots = self.knots[axis]
        if self.is_periodic[axis]:
            t = t - np.floor((t - knots[0]) / (knots[-1] - knots[0])) * (knots[-1] - knots[0])
        return evaluate_basis(knots, self.degrees[axis], t[:1] if (t == t[0]).all() else t, order)

    def _order_jets(self, get_derivative: Callable[[int, int], Array], order: Order) -> list[Array]:
        """Return the jets in their order, of homogeneous coordinates divided by their weights."""
        jets = [get_derivative(i, j) for i, j in _ORDERS_IN_U_AND_V[: _JET_COUNTS[order]]]
        if not self._is_rational:
            return jets
        weight, parts = [jet[-1] for jet in jets], [jet[:-1] for jet in jets]
        s = parts[0] / weight[0]
        quotients = [s]
        for k in range(1, min(len(jets), 3)):
            quotients.append((parts[k] - weight[k] * s) / weight[0])
        for k, (a, b) in zip(range(3, len(jets)), ((1, 1), (2, 2), (1, 2)), strict=False):
            rest = parts[k] - weight[a] * quotients[b] - weight[b] * quotients[a] - weight[k] * s
            quotients.append(rest / weight[0])
        return quotients


def _find_formula(surface: Geom_Surface) -> SurfaceFormula | None:
    """Return the formula of a surface that is no spline; None if there is none."""
    if isinstance(surface, Geom_Plane):
        return _read_plane(surface)
    if isinstance(surface, Geom_SurfaceOfLinearExtrusion):
        return _read_extrusion(surface)
    if isinstance(surface, Geom_SurfaceOfRevolution):
        axis = surface.Axis()
        frame = _read_frame(gp_Ax2(axis.Location(), axis.Direction()))
        curve = CurveEvaluator(surface.BasisCurve())
        origin, axes = frame[0], np.stack(frame[1:])

        def locate_meridian(v: Array, order: Order) -> Array:
            found = curve(v, order).copy()
            found[0] -= origin[:, None]
            return np.asarray(axes @ found)

        return _make_revolution_formula(frame, locate_meridian)
    profile = _find_profile(surface)
    return None if profile is None else _make_revolution_formula(_read_frame(surface.Position()), profile)


def _read_frame(position: gp_Ax2) -> tuple[Array, Array, Array, Array]:
    """Return the origin and the three axes of a frame, which may be left-handed."""
    parts = (position.Location(), position.XDirection(), position.YDirection(), position.Direction())
    origin, x, y, z = (np.array(part.Coord()) for part in parts)
    return origin, x, y, z


def _read_plane(plane: Geom_Plane) -> SurfaceFormula:
    """Return the formula of a plane."""
    origin, x, y, _ = (part[:, None] for part in _read_frame(plane.Position()))

    def evaluate_plane(u: Array, v: Array, order: Order) -> list[Array]:
        zero = np.zeros((3, len(u)))
        return [origin + x * u + y * v, x + zero, y + zero, zero, zero, zero][: _JET_COUNTS[order]]

    return evaluate_plane


def _read_extrusion(surface: Geom_SurfaceOfLinearExtrusion) -> SurfaceFormula:
    """Return the formula of a surface of extrusion: a curve in u, moved by v."""
    curve = CurveEvaluator(surface.BasisCurve())
    direction = np.array(surface.Direction().Coord())[:, None]

    def evaluate_extrusion(u: Array, v: Array, order: Order) -> list[Array]:
        found = curve(u, order)
        zero = np.zeros((3, len(u)))
        jets = [found[0] + direction * v, *found[1:2], direction + zero, *found[2:], zero, zero]
        return jets[: _JET_COUNTS[order]]

    return evaluate_extrusion


Profile = Callable[[Array, Order], Array]
"""A meridian in the frame of its axis, which is the third: coordinates and derivatives (order + 1, 3, n) at v (n,)."""


def _find_profile(surface: Geom_ElementarySurface) -> Profile | None:
    """Return the meridian of a cylinder, cone, sphere or torus; None of any other surface."""
    if isinstance(surface, Geom_CylindricalSurface):
        return _make_straight_profile(surface.Radius(), 0.0)
    if isinstance(surface, Geom_ConicalSurface):
        return _make_straight_profile(surface.RefRadius(), surface.SemiAngle())
    if isinstance(surface, Geom_SphericalSurface):
        return _make_round_profile(0.0, surface.Radius())
    if isinstance(surface, Geom_ToroidalSurface):
        return _make_round_profile(surface.MajorRadius(), surface.MinorRadius())
    return None


def _make_straight_profile(radius: float, half_angle: float) -> Profile:
    """Return a straight meridian that starts at a radius and leans away from the axis."""
    sine, cosine = float(np.sin(half_angle)), float(np.cos(half_angle))

    def evaluate_line(v: Array, order: Order) -> Array:
        found = np.zeros((order + 1, 3, len(v)))
        found[0, 0], found[0, 2] = radius + v * sine, v * cosine
        found[1:2, 0], found[1:2, 2] = sine, cosine
        return found

    return evaluate_line


def _make_round_profile(distance: float, radius: float) -> Profile:
    """Return a circular meridian whose centre is at a distance from the axis."""

    def evaluate_circle(v: Array, order: Order) -> Array:
        found = np.zeros((order + 1, 3, len(v)))
        cosines, sines = radius * np.cos(v), radius * np.sin(v)
        found[0, 0], found[0, 2] = distance + cosines, sines
        found[1:2, 0], found[1:2, 2] = -sines, cosines
        found[2:3, 0], found[2:3, 2] = -cosines, -sines
        return found

    return evaluate_circle


def _make_revolution_formula(frame: tuple[Array, Array, Array, Array], profile: Profile) -> SurfaceFormula:
    """Return the formula of a meridian turned by the angle u about the third axis of a frame."""
    origin, x, y, z = (part[:, None] for part in frame)

    def evaluate_revolution(u: Array, v: Array, order: Order) -> list[Array]:
        v = v[:1] if (v == v[0]).all() else v  # along a circle, one point of the meridian tells
        cosines, sines = np.cos(u), np.sin(u)
        outwards, around = cosines * x + sines * y, cosines * y - sines * x
        (a, b, c), *rates = profile(v, order)
        from_axis = a * outwards + b * around
        jets = [origin + from_axis + c * z]
        if order:
            a1, b1, c1 = rates[0]
            jets += [a * around - b * outwards, a1 * outwards + b1 * around + c1 * z]
        if order == 2:
            a2, b2, c2 = rates[1]
            jets += [-from_axis, a2 * outwards + b2 * around + c2 * z, a1 * around - b1 * outwards]
        return jets

    return evaluate_revolution
