r"""Convert B-splines between NumPy arrays and OCCT, bit for bit.

OCCT's own accessors copy one pole per call; a binary stream of ``BinTools`` carries a whole spline at once, 30 to 60
times faster and without rounding. This module writes and reads those streams, and nothing else; it depends
neither on faces nor on the symbolic splines of :mod:`cqblend.splines`.

Arrays follow one convention: *full* knot vectors (every knot repeated as often as it counts), poles of shape
``(n, dim)`` or ``(nu, nv, 3)`` in space (not multiplied by their weights), weights of shape ``(n,)`` or ``(nu, nv)``,
or None if polynomial.

The stream (OCCT 7.9, little endian, unpadded)::

    surface   "Surfaces 1\n", u8 9, u8[4] rational u, v, periodic u, v, i16[2] degrees,
              i32[4] nu, nv, distinct knots u, v, nu * nv * (x, y, z[, w]) f64,
              then per direction (f64 knot, i32 multiplicity) each
    curve     "Curves 1\n" or "Curve2ds 1\n", u8 7, u8[2] rational, periodic, i16 degree,
              i32[2] n, distinct knots, poles and knots as above
"""

import io
import struct
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from OCP.BinTools import BinTools_Curve2dSet, BinTools_CurveSet, BinTools_SurfaceSet
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface
from OCP.Geom2d import Geom2d_BSplineCurve

from cqblend.errors import DegreeError, InputError
from cqblend.splines.bernstein import Array

CurveArrays = tuple[int, Array, Array, Array | None]
SurfaceArrays = tuple[tuple[int, int], tuple[Array, Array], Array, Array | None]

MAX_DEGREE = 25
"""The largest degree OCCT can hold, of curves and of surfaces."""

_KNOT = np.dtype([("value", "<f8"), ("multiplicity", "<i4")])
_SURFACE_HEADER, _SURFACE_CODE, _SURFACE_LAYOUT = b"Surfaces 1\n", 9, "<5B2h4i"
_CURVE_CODE, _CURVE_LAYOUT = 7, "<3Bh2i"


class _CurveStream(NamedTuple):
    """What differs between the streams of curves in space and in the plane."""

    header: bytes
    dimension: int
    make_set: Callable[[], Any]


_CURVES = _CurveStream(b"Curves 1\n", 3, BinTools_CurveSet)
_PLANE_CURVES = _CurveStream(b"Curve2ds 1\n", 2, BinTools_Curve2dSet)


def surface_from_arrays(
    degrees: tuple[int, int],
    knots: tuple[ArrayLike, ArrayLike],
    poles: ArrayLike,
    weights: ArrayLike | None = None,
) -> Geom_BSplineSurface:
    """Build OCCT's B-spline surface.

    Parameters
    ----------
    degrees : (int, int)
        Degrees in u and v, 1 to 25.
    knots : (array, array)
        Full knot vectors, ``nu + p + 1`` and ``nv + q + 1`` long; clamped or not.
    poles : array, (nu, nv, 3)
    weights : array, (nu, nv), optional
        Positive. Equal weights make a polynomial surface, as everywhere in OCCT.

    Raises
    ------
    DegreeError
        If a degree is above 25.
    InputError
        If shapes or knots do not fit together, or a number is not finite.
    """
    table = _pack_points(poles, weights, dimension=3, axes=2)
    packed = [
        _pack_knots(vector, degree, count, f"surface, {name}")
        for vector, degree, count, name in zip(knots, degrees, table.shape, "uv", strict=False)
    ]
    rational = weights is not None
    head = struct.pack(
        _SURFACE_LAYOUT, _SURFACE_CODE, rational, rational, 0, 0, *degrees, *table.shape[:2], *map(len, packed)
    )
    sets = BinTools_SurfaceSet()
    sets.Read(io.BytesIO(b"".join([_SURFACE_HEADER, head, table.tobytes(), *(p.tobytes() for p in packed)])))
    return sets.Surface(1)


def surface_to_arrays(surface: Geom_BSplineSurface) -> SurfaceArrays:
    """Read OCCT's B-spline surface: ``(degrees, knots, poles, weights)`` as for :func:`surface_from_arrays`.

    Bit exact for clamped surfaces. A periodic or unclamped one comes back clamped over its natural bounds (one period),
    by knot insertion.
    """
    if _is_unclamped(surface, "U") or _is_unclamped(surface, "V"):
        surface = surface.Copy()
        surface.Segment(*surface.Bounds())
    sets = BinTools_SurfaceSet()
    sets.Add(surface)
    buffer = io.BytesIO()
    sets.Write(buffer)
    data, offset = buffer.getvalue(), len(_SURFACE_HEADER)
    _, u_rational, v_rational, _, _, p, q, nu, nv, *distinct = struct.unpack_from(_SURFACE_LAYOUT, data, offset)
    offset += struct.calcsize(_SURFACE_LAYOUT)
    table, offset = _unpack_points(data, offset, (nu, nv), 3, bool(u_rational or v_rational))
    knots_u, offset = _unpack_knots(data, offset, distinct[0])
    knots_v, offset = _unpack_knots(data, offset, distinct[1])
    return (p, q), (knots_u, knots_v), *table


def curve_from_arrays(
    degree: int, knots: ArrayLike, poles: ArrayLike, weights: ArrayLike | None = None
) -> Geom_BSplineCurve:
    """Build OCCT's B-spline curve in space from a full knot vector and poles of shape (n, 3).

    Raises
    ------
    DegreeError, InputError
        As :func:`surface_from_arrays`.
    """
    return _read_stream(_CURVES, degree, knots, poles, weights).Curve(1)


def curve_to_arrays(curve: Geom_BSplineCurve) -> CurveArrays:
    """Read OCCT's B-spline curve in space as ``(degree, knots, poles, weights)``, as :func:`surface_to_arrays` does."""
    return _unpack_curve(_CURVES, curve)


def curve2d_from_arrays(
    degree: int, knots: ArrayLike, poles: ArrayLike, weights: ArrayLike | None = None
) -> Geom2d_BSplineCurve:
    """Build OCCT's B-spline curve in the plane (a pcurve) from a full knot vector and poles of shape (n, 2).

    Raises
    ------
    DegreeError, InputError
        As :func:`surface_from_arrays`.
    """
    return _read_stream(_PLANE_CURVES, degree, knots, poles, weights).Curve2d(1)


def curve2d_to_arrays(curve: Geom2d_BSplineCurve) -> CurveArrays:
    """Read OCCT's B-spline curve in the plane as ``(degree, knots, poles, weights)``, clamped if it was not."""
    return _unpack_curve(_PLANE_CURVES, curve)


def _read_stream(
    stream: _CurveStream, degree: int, knots: ArrayLike, poles: ArrayLike, weights: ArrayLike | None
) -> Any:
    """Return OCCT's set of curves that holds one curve, packed as a stream."""
    table = _pack_points(poles, weights, stream.dimension, axes=1)
    packed = _pack_knots(knots, degree, len(table), "curve")
    head = struct.pack(_CURVE_LAYOUT, _CURVE_CODE, weights is not None, 0, degree, len(table), len(packed))
    sets = stream.make_set()
    sets.Read(io.BytesIO(b"".join([stream.header, head, table.tobytes(), packed.tobytes()])))
    return sets


def _unpack_curve(stream: _CurveStream, curve: Any) -> CurveArrays:
    if _is_unclamped(curve, ""):
        curve = curve.Copy()
        curve.Segment(curve.FirstParameter(), curve.LastParameter())
    sets, buffer = stream.make_set(), io.BytesIO()
    sets.Add(curve)
    sets.Write(buffer)
    data, offset = buffer.getvalue(), len(stream.header)
    _, rational, _, degree, count, distinct = struct.unpack_from(_CURVE_LAYOUT, data, offset)
    offset += struct.calcsize(_CURVE_LAYOUT)
    table, offset = _unpack_points(data, offset, (count,), stream.dimension, bool(rational))
    knots, offset = _unpack_knots(data, offset, distinct)
    return degree, knots, *table


def _is_unclamped(spline: Any, direction: str) -> bool:
    """Whether the spline is periodic or unclamped in the direction ``"U"``, ``"V"``, or ``""`` for a curve."""

    def query_spline(method: str, *index: int) -> int:
        return int(getattr(spline, method.format(direction))(*index))

    full = query_spline("{}Degree") + 1
    ends = query_spline("{}Multiplicity", 1), query_spline("{}Multiplicity", query_spline("Nb{}Knots"))
    return bool(query_spline("Is{}Periodic")) or ends != (full, full)


def _pack_points(poles: ArrayLike, weights: ArrayLike | None, dimension: int, axes: int) -> Array:
    """Check poles and weights, and lay them side by side as the stream wants them."""
    table = np.ascontiguousarray(poles, dtype="<f8")
    if table.ndim != axes + 1 or table.shape[-1] != dimension:
        expected = ("n", "nu, nv")[axes - 1]
        raise InputError(f"poles have shape {table.shape}; OCCT needs ({expected}, {dimension})")
    _require_finite(table, "poles")
    if weights is None:
        return table
    column = np.asarray(weights, dtype="<f8")
    if column.shape != table.shape[:-1]:
        raise InputError(f"weights have shape {column.shape}; the poles need {table.shape[:-1]}")
    _require_finite(column, "weights")
    if not column.min() > 0:
        raise InputError(f"the smallest weight is {column.min():g}; OCCT needs positive weights")
    return np.concatenate([table, column[..., np.newaxis]], axis=-1)


def _unpack_points(
    data: bytes, offset: int, shape: tuple[int, ...], dimension: int, rational: bool
) -> tuple[tuple[Array, Array | None], int]:
    width = dimension + rational
    table = np.frombuffer(data, "<f8", int(np.prod(shape)) * width, offset).reshape(*shape, width)
    weights = table[..., dimension].copy() if rational else None
    return (table[..., :dimension].copy(), weights), offset + table.nbytes


def _pack_knots(knots: ArrayLike, degree: int, count: int, name: str) -> NDArray[np.void]:
    """Distinct knots with their multiplicities, after every check that OCCT would make with a worse message."""
    if degree > MAX_DEGREE:
        raise DegreeError(
            f"{name}: degree {degree} is above {MAX_DEGREE}, the most OCCT can hold;"
            " use form='compact' or a rail of lower degree"
        )
    if degree < 1:
        raise InputError(f"{name}: degree {degree}; OCCT needs at least 1")
    vector = np.asarray(knots, dtype="<f8")
    if vector.shape != (count + degree + 1,):
        raise InputError(
            f"{name}: knots have shape {vector.shape}; {count} poles of degree {degree} need ({count + degree + 1},)"
        )
    _require_finite(vector, f"{name}: knots")
    steps = vector[1:] - vector[:-1]
    if (steps < 0).any():
        raise InputError(f"{name}: knot {int(np.argmax(steps < 0)) + 1} is smaller than the one before it")
    bounds = np.concatenate(((0,), steps.nonzero()[0] + 1, (len(vector),)))
    packed = np.empty(len(bounds) - 1, _KNOT)
    packed["value"] = vector[bounds[:-1]]
    packed["multiplicity"] = bounds[1:] - bounds[:-1]
    _check_multiplicities(packed, degree, name)
    return packed


def _check_multiplicities(packed: NDArray[np.void], degree: int, name: str) -> None:
    values, multiplicities = packed["value"], packed["multiplicity"]
    is_repeated = multiplicities > degree
    is_repeated[[0, -1]] = multiplicities[[0, -1]] > degree + 1
    if len(packed) < 2 or is_repeated.any():
        limit = np.full(len(packed), degree)
        limit[[0, -1]] = degree + 1
        worst = int(np.argmax(multiplicities - limit))
        raise InputError(
            f"{name}: knot {values[worst]:g} is repeated {multiplicities[worst]} times; at degree {degree} OCCT takes"
            f" {degree + 1} at the ends and {degree} inside: split the spline there"
        )
    close = values[1:] - values[:-1] <= np.spacing(np.abs(values[:-1]))
    if close.any():
        raise InputError(f"{name}: two knots at {values[:-1][close][0]!r} differ by rounding only; merge them")


def _unpack_knots(data: bytes, offset: int, distinct: int) -> tuple[Array, int]:
    packed = np.frombuffer(data, _KNOT, distinct, offset)
    return np.repeat(packed["value"].astype(np.float64), packed["multiplicity"]), offset + packed.nbytes


def _require_finite(values: Sequence[float] | Array, name: str) -> None:
    is_finite = np.isfinite(values)
    if not is_finite.all():
        bad = np.argwhere(~is_finite)
        raise InputError(f"{name}: entry {tuple(map(int, bad[0]))} is not a finite number")
