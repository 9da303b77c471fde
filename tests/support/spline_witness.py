"""B-splines evaluated from plain arrays, and how smoothly two surfaces meet: a witness that asks nothing of cqblend.

A spline is a tuple (degrees, full knot vectors, poles, weights or None), which is what ``to_bspline()`` returns. It is
evaluated in any number type: in ``np.longdouble``, derivatives of degree 18 keep the digits that doubles lose on short
spans; in ``fractions.Fraction``, everything is exact. OCCT evaluates the same arrays in doubles.
"""

from __future__ import annotations

from fractions import Fraction
from math import comb

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_BSplineSurface, Geom_Surface
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TColgp import TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal, TColStd_Array2OfReal

Array = np.ndarray
Jet = dict[tuple[int, int], Array]
"""Partial derivatives (n, 3) by their orders in u and v."""

_D3 = ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1), (3, 0), (0, 3), (2, 1), (1, 2))


def wide(array, kind) -> Array:
    """Convert doubles to a wider type, without rounding."""
    array = np.asarray(array)
    if kind is not Fraction or array.dtype == object:
        return array.astype(kind if kind is not Fraction else object)
    return np.array([Fraction(x) for x in array.ravel().tolist()], object).reshape(array.shape)


def _value(degree: int, knots: Array, poles: Array, t: Array, side: str) -> Array:
    """De Boor's recursion for poles (count, ...), or (n, count, ...) of their own for each of the parameters (n,)."""
    span = np.searchsorted(knots.astype(float), t.astype(float), side=side) - 1
    span = np.clip(span, degree, poles.shape[1] - 1)
    at = np.arange(len(t)) % len(poles)
    d = [poles[at, span - degree + j] for j in range(degree + 1)]
    for r in range(1, degree + 1):
        for j in range(degree, r - 1, -1):
            low, high = knots[span - degree + j], knots[span + 1 + j - r]
            share = ((t - low) / (high - low)).reshape(-1, *(1,) * (poles.ndim - 2))
            d[j] = d[j - 1] + share * (d[j] - d[j - 1])
    return d[degree]


def _derived(degree: int, knots: Array, poles: Array) -> tuple[int, Array, Array]:
    """Differentiate a B-spline."""
    if degree == 0:
        return 0, knots, 0 * poles
    width = knots[degree + 1 : -1] - knots[1 : -degree - 1]
    width = np.where(width == 0, 1, width).reshape(1, -1, *(1,) * (poles.ndim - 2))
    return degree - 1, knots[1:-1], np.diff(poles, axis=1) * degree / width


def _weighted(poles, weights, kind) -> Array:
    """Return homogeneous poles."""
    weights = np.ones(np.shape(poles)[:-1]) if weights is None else weights
    weights = wide(weights, kind)[..., None]
    return np.concatenate([wide(poles, kind) * weights, weights], -1)


def _divided(homogeneous: Jet) -> Jet:
    """Divide by the weight, order by order."""
    found: Jet = {}
    for (i, j), value in homogeneous.items():
        rest = 0 * value[:, :-1]
        for a, b in np.ndindex(i + 1, j + 1):
            if a or b:
                rest = rest + comb(i, a) * comb(j, b) * homogeneous[a, b][:, -1:] * found[i - a, j - b]
        found[i, j] = (value[:, :-1] - rest) / homogeneous[0, 0][:, -1:]
    return found


def curve_jet(curve, t, order: int, kind=float) -> Array:
    """Return the derivatives (order + 1, n, dim) of a B-spline curve at t (n,)."""
    degree, knots, poles, weights = curve
    knots, t, rows = wide(knots, kind), wide(t, kind), _weighted(poles, weights, kind)[None]
    homogeneous: Jet = {}
    for k in range(order + 1):
        homogeneous[k, 0] = _value(degree, knots, rows, t, "right")
        degree, knots, rows = _derived(degree, knots, rows)
    return np.array(list(_divided(homogeneous).values()))


def surface_jet(surface, uv, order: int, kind=float, side: str = "right") -> Jet:
    """Return all partial derivatives up to a total order of a B-spline surface at uv (n, 2), from one side in u."""
    (p, q), (ku, kv), poles, weights = surface
    u, v = wide(uv, kind).T
    ku, kv, rows = wide(ku, kind), wide(kv, kind), _weighted(poles, weights, kind)[None]
    homogeneous: Jet = {}
    for i in range(order + 1):
        across = q, kv, _value(p, ku, rows, u, side)
        for j in range(order + 1 - i):
            homogeneous[i, j] = _value(*across, v, "right")
            across = _derived(*across)
        p, ku, rows = _derived(p, ku, rows)
    return _divided(homogeneous)


def kernel(surface) -> Geom_BSplineSurface:
    """Return OCCT's surface of the same arrays, pole by pole."""
    degrees, knots, poles, weights = surface
    points = TColgp_Array2OfPnt(1, poles.shape[0], 1, poles.shape[1])
    factors = TColStd_Array2OfReal(1, poles.shape[0], 1, poles.shape[1])
    for i, j in np.ndindex(*poles.shape[:2]):
        points.SetValue(i + 1, j + 1, gp_Pnt(*poles[i, j].tolist()))
        factors.SetValue(i + 1, j + 1, 1.0 if weights is None else float(weights[i, j]))
    values, counts = [], []
    for vector in knots:
        distinct, times = np.unique(vector, return_counts=True)
        reals, integers = TColStd_Array1OfReal(1, len(distinct)), TColStd_Array1OfInteger(1, len(distinct))
        for i, (value, count) in enumerate(zip(distinct.tolist(), times.tolist(), strict=True), 1):
            reals.SetValue(i, value)
            integers.SetValue(i, count)
        values.append(reals)
        counts.append(integers)
    return Geom_BSplineSurface(points, factors, *values, *counts, *degrees)


def kernel_jet(surface: Geom_Surface, uv) -> Jet:
    """Return OCCT's partial derivatives up to a total order of three."""
    rows = []
    for u, v in np.asarray(uv, float).tolist():
        point, vectors = gp_Pnt(), [gp_Vec() for _ in range(9)]
        surface.D3(u, v, point, *vectors)
        rows.append([x.Coord() for x in (point, *vectors)])
    return dict(zip(_D3, np.array(rows).swapaxes(0, 1), strict=True))


def dot(a: Array, b: Array) -> Array:
    return (a * b).sum(axis=-1)


def norm(a: Array) -> Array:
    return np.sqrt(dot(a, a))


def angle(a: Array, b: Array) -> Array:
    """Return the angles (rad) between vectors (n, 3)."""
    return np.arctan2(norm(np.cross(a, b)), dot(a, b))


def normal(jet: Jet) -> Array:
    return np.cross(jet[1, 0], jet[0, 1])


def sections(jet: Jet, along: Array, across: Array, turns) -> tuple[Array, Array]:
    """Return the second and third derivatives by arc length, (turns, n), of a surface's sections at given points.

    The sections are cut by planes along the normal ``along`` x ``across`` (unit vectors, (n, 3)); ``turns`` are the
    angles between ``along`` and their tangents. The surface's partial derivatives are needed up to third order.
    """
    plane, up = (along, across), np.cross(along, across)
    (a, b), (c, d) = ((dot(jet[1, 0], e), dot(jet[0, 1], e)) for e in plane)
    det = a * d - b * c

    def coordinates(vector: Array) -> Array:
        x, y = (dot(vector, e) for e in plane)
        return np.stack([d * x - b * y, a * y - c * x], -1) / det[:, None]

    def form(*ways: Array) -> Array:
        """The derivative of this order, a symmetric multilinear form in parameter directions (n, 2)."""
        total = np.zeros_like(along)
        for picks in np.ndindex(*(2,) * len(ways)):
            factor = np.prod([way[:, pick] for way, pick in zip(ways, picks, strict=True)], axis=0)
            total = total + factor[:, None] * jet[len(picks) - sum(picks), sum(picks)]
        return total

    bends, rates = [], []
    for turn in turns:
        first = coordinates(np.cos(turn) * along + np.sin(turn) * across)
        bend = form(first, first)
        second = -coordinates(bend)
        rate = form(first, first, first) + 3 * form(first, second)
        bends.append(dot(up, bend + form(second)))
        rates.append(dot(up, rate - form(coordinates(rate))))
    return np.array(bends), np.array(rates)


TURNS = np.pi * np.arange(5) / 5


def meeting(one: Jet, other: Jet) -> tuple[Array, Array, Array, Array]:
    """Return gap, angle, and the jumps of second and third derivatives of sections in five directions, (n,) each."""
    up = normal(other)
    along = other[1, 0] / norm(other[1, 0])[:, None]
    across = np.cross(up / norm(up)[:, None], along)
    (bend, rate), (bend_, rate_) = (sections(jet, along, across, TURNS) for jet in (one, other))
    turned = np.minimum(angle(normal(one), up), angle(-normal(one), up))
    return norm(one[0, 0] - other[0, 0]), turned, np.abs(bend - bend_).max(axis=0), np.abs(rate - rate_).max(axis=0)


def along_edge(face, edge, parameters) -> tuple[Array, Array]:
    """Return OCCT's points and unit normals (n, 3) of a face at parameters of one of its edges, through its pcurve."""
    curve = BRep_Tool.CurveOnSurface_s(edge.wrapped, face.wrapped, 0.0, 0.0)
    surface = BRep_Tool.Surface_s(face.wrapped)
    points, normals = [], []
    for t in parameters:
        u, v = curve.Value(t).Coord()
        n = np.cross(surface.DN(u, v, 1, 0).Coord(), surface.DN(u, v, 0, 1).Coord())
        points.append(surface.Value(u, v).Coord())
        normals.append(n / np.linalg.norm(n))
    return np.array(points), np.array(normals)
