"""A bare surface made a shell of one patch, so that it is unrolled like the faces of a solid.

Its four sides become edges; opposite sides that coincide become one edge, and sides may be points (poles). Depends on
splines only.
"""

import numpy as np

from cqblend.errors import InputError
from cqblend.patterns.trimming.tolerances import TRIM_TOLERANCES
from cqblend.patterns.trimming.trimmed_patch import CurveFunction, EdgeUse, Patch, PatchEdge, PatchShell
from cqblend.splines import Surface
from cqblend.splines.antiderivative import gauss_rule
from cqblend.splines.bernstein import Array


def make_surface_shell(surface: Surface) -> PatchShell:
    """Return a surface, bounded by its parameter domain, as one patch whose outer side is that of Su x Sv.

    Raises
    ------
    InputError
        If the surface is not of dim 3.

    Examples
    --------
    >>> knots = [0, 0, 1, 1]
    >>> sheet = Surface.from_bspline((1, 1), (knots, knots), [[[0, 0, 0], [0, 2, 0]], [[3, 0, 0], [3, 2, 1]]])
    >>> len(make_surface_shell(sheet).edges)
    4
    """
    if surface.dim != 3:
        raise InputError(f"a surface to be unrolled is in space; this one has dimension {surface.dim}")
    (u0, u1), (v0, v1) = surface.domain
    sides = [(1, v0, True), (0, u1, True), (1, v1, False), (0, u0, False)]  # counterclockwise: axis, value, forward
    curves = [surface.isoparametric(**{"uv"[axis]: value}) for axis, value, _ in sides]
    samples = [curve(np.linspace(*curve.domain, 65)) for curve in curves]
    size = float(np.ptp(np.concatenate(samples), axis=0).max())
    is_point = [float(np.abs(sample - sample[0]).max()) <= TRIM_TOLERANCES.closed_side_gap * size for sample in samples]
    numbers = [1, 2, 3, 4]
    for here, there in ((0, 2), (1, 3)):
        if (
            float(np.abs(samples[here] - samples[there]).max()) <= TRIM_TOLERANCES.closed_side_gap * size
            and not is_point[here]
        ):
            numbers[there] = numbers[here]
    uses = []
    for number, (axis, value, forward), curve, point in zip(numbers, sides, curves, is_point, strict=True):
        uses.append(EdgeUse(number, forward, _make_parameter_line(axis, value), curve.breaks, point))
    edges = {
        number: PatchEdge(
            index=number,
            points=curve,
            breaks=curve.breaks,
            curve=None if point else curve,
            parameter=_identity_map,
            vertices=(0, 0),
            faces=(1,) * numbers.count(number),
            angle=_seam_angle(surface, sides[number - 1][0]) if numbers.count(number) == 2 else np.nan,
            gap=0.0,
            degenerate=point,
        )
        for number, curve, point in reversed(list(zip(numbers, curves, is_point, strict=True)))
    }
    patch = Patch((1,), "freeform", surface, True, (tuple(uses),), area=_measure_area(surface))
    return PatchShell((patch,), edges, {0: curves[0](curves[0].domain[0])})


def _measure_area(surface: Surface) -> float:
    """Return the area, by 16-point Gauss in every piece."""
    nodes, weights = gauss_rule(16)
    u, v = ((breaks[:-1, None] + np.diff(breaks)[:, None] * nodes).ravel() for breaks in surface.breaks)
    along, across = ((np.diff(breaks)[:, None] * weights).ravel() for breaks in surface.breaks)
    normals = np.cross(surface.grid(u, v, 1, 0), surface.grid(u, v, 0, 1))
    return float(along @ np.linalg.norm(normals, axis=-1) @ across)


def _seam_angle(surface: Surface, axis: int) -> float:
    """Return the signed angle (rad) between the normals on both sides of a seam, in its middle; nan at a pole.

    The seam is the side on which u (axis 0) or v (axis 1) begins; the angle is positive if the surface is convex there.
    """
    middle = [sum(domain) / 2 for domain in surface.domain]
    seam_points = ((end, middle[1]) if axis == 0 else (middle[0], end) for end in surface.domain[axis])
    after, before = (surface.jet(u, v, 1) for u, v in seam_points)
    normals = np.array([np.cross(jet[1, 0], jet[0, 1]) for jet in (before, after)])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if not lengths.all():
        return np.nan
    first, second = normals / lengths
    across = after[(1, 0) if axis == 0 else (0, 1)]
    angle = np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)
    return float(np.copysign(angle, (second - first) @ across))


def _identity_map(t: Array) -> Array:
    return t


def _make_parameter_line(axis: int, value: float) -> CurveFunction:
    """Return the parameter line on which u (axis 0) or v (axis 1) is fixed."""

    def evaluate_line(t: Array) -> Array:
        fixed = np.full(np.shape(t), value)
        return np.stack([fixed, t] if axis == 0 else [t, fixed], axis=-1)

    return evaluate_line
