"""A bare surface as something to unroll: its four sides are edges, and it may meet itself or have poles.

Exists so that a surface without a kernel's face goes the same way as faces of solids. Must not know what is done next.
"""

import numpy as np

from cqblend.developables.patches import Edge, EdgeUse, Mapping, Patch, Skin
from cqblend.errors import InputError
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array

_CLOSED = 1e-9
"""Sides that are closer together than this, relative to the size, are one."""


def natural(surface: Surface) -> Skin:
    """Return a surface, bounded by its parameter domain, as one patch whose outer side is that of Su x Sv.

    Raises
    ------
    InputError
        It is not in space.

    Examples
    --------
    >>> knots = [0, 0, 1, 1]
    >>> sheet = Surface.from_bspline((1, 1), (knots, knots), [[[0, 0, 0], [0, 2, 0]], [[3, 0, 0], [3, 2, 1]]])
    >>> len(natural(sheet).edges)
    4
    """
    if surface.dim != 3:
        raise InputError(f"a surface to be unrolled is in space; this one has dimension {surface.dim}")
    (u0, u1), (v0, v1) = surface.domain
    sides = [(1, v0, True), (0, u1, True), (1, v1, False), (0, u0, False)]  # counterclockwise: axis, value, rising
    curves = [surface.isoparametric(**{"uv"[axis]: value}) for axis, value, _ in sides]
    samples = [curve(np.linspace(*curve.domain, 65)) for curve in curves]
    size = float(np.ptp(np.concatenate(samples), axis=0).max())
    points = [float(np.abs(sample - sample[0]).max()) <= _CLOSED * size for sample in samples]
    numbers = [1, 2, 3, 4]
    for here, there in ((0, 2), (1, 3)):
        if float(np.abs(samples[here] - samples[there]).max()) <= _CLOSED * size and not points[here]:
            numbers[there] = numbers[here]
    uses = []
    for number, (axis, value, rising), curve, point in zip(numbers, sides, curves, points, strict=True):
        uses.append(EdgeUse(number, rising, _line(axis, value), curve.breaks, point))
    edges = {
        number: Edge(
            index=number,
            points=curve,
            breaks=curve.breaks,
            curve=None if point else curve,
            parameter=_same,
            vertices=(0, 0),
            faces=(1,) * numbers.count(number),
            angle=np.nan,
            gap=0.0,
            degenerate=point,
        )
        for number, curve, point in reversed(list(zip(numbers, curves, points, strict=True)))
    }
    patch = Patch((1,), "freeform", surface, True, (tuple(uses),))
    return Skin((patch,), edges, {0: curves[0](curves[0].domain[0])})


def _same(t: Array) -> Array:
    return t


def _line(axis: int, value: float) -> Mapping:
    """Return the parameter line on which u (axis 0) or v (axis 1) is fixed."""

    def line(t: Array) -> Array:
        fixed = np.full(np.shape(t), value)
        return np.stack([fixed, t] if axis == 0 else [t, fixed], axis=-1)

    return line
