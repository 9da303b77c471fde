"""Curves in which two surfaces meet, solved point by point and fitted: the ends of a blend, and edges around them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.contacts.surface_normals import differentiate_normal
from cqblend.blends.network.blend_plan import EdgeRole, NewEdge, PlannedPcurve, PlannedSurface, PlannedVertex
from cqblend.blends.network.strip_surface import StripCut, StripSurface
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.errors import CqblendError, TopologyError
from cqblend.splines import Curve, interpolation
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import to_tangent_coordinates


class BlendEndError(CqblendError):
    """One end of a blend cannot be built: ``end`` is 0 or 1, and ``cause`` is why."""

    def __init__(self, end: int, cause: CqblendError) -> None:
        super().__init__(str(cause), kind=cause.kind, place=float(end), value=cause.value)
        self.end = end
        self.cause = cause


PointSolver = Callable[[Array, Array | None], Array]
"""A function from parameters (n,) of a curve, and values (n, k) near the solution, if there are any, to its values."""


@dataclass(frozen=True)
class EndCurveStart:
    """Where the solution of an end curve starts: on the blend at t, on the other surface at ``uv``, which is ``point``.

    That is near the end of the edge, ``end`` 0 or 1, not exactly on the curve.
    """

    end: int
    t: float
    uv: Array  # (2,)
    point: Array  # (3,)


@dataclass(frozen=True)
class TouchPoint:
    """Where rail ``side`` (0 or 1) of a blend touches the surface of a face, and how the curve of both leaves there."""

    side: int
    t: float
    uv: Array  # (2,) on the face
    slope: float  # dt/dv


def fit_solved_curve(solve_points: PointSolver, measure_error: Callable[[Array, Array], float]) -> Curve:
    """Interpolate a curve on [0, 1]: by one cubic if that is near enough, else by C2 cubics on enough spans.

    ``measure_error`` returns how far (mm) the values of a fitted curve, at parameters (n,), are from the surfaces that
    it is to lie on. Each fit tells where to start the solution for the next one and, as the error of cubics falls with
    the fourth power of their spans, how many these must be.
    """
    refinement, curve = 1, None
    while True:
        v = np.linspace(0, 1, 6 * refinement + 1)
        values = solve_points(v, None if curve is None else curve(v))
        curve = _interpolate_cubic(values) if refinement == 1 else interpolation.interpolate(v[::2], values[::2])
        excess = measure_error(curve(v), v) / SHELL_EDIT_TOLERANCES.curve_fit
        if excess <= 1 or refinement >= SHELL_EDIT_TOLERANCES.max_fit_refinement:
            return curve
        growth = 2.0 if refinement == 1 else float(np.clip(1.1 * excess**0.25, 1.25, 8.0))
        refinement = min(int(np.ceil(refinement * growth)), SHELL_EDIT_TOLERANCES.max_fit_refinement)


def _interpolate_cubic(values: Array) -> Curve:
    """Return the cubic on [0, 1] through every other one of values (7, k) at 0, 1/6, .. 1."""
    q = values[::2]
    coefs = [
        q[0],
        (-5 * q[0] + 18 * q[1] - 9 * q[2] + 2 * q[3]) / 6,
        (2 * q[0] - 9 * q[1] + 18 * q[2] - 5 * q[3]) / 6,
        q[3],
    ]
    return Curve(np.array([0.0, 1.0]), np.stack(coefs)[..., None])


def solve_end_curve(
    blend: StripSurface, target: Primary, start: EndCurveStart, touch: TouchPoint | None = None
) -> StripCut:
    """Return the end curve, in which the blend surface H meets the surface N that it ends on.

    It is v -> (t, v, a, b, x, y, z) with H(t, v) = N(a, b) = (x, y, z), v in [0, 1]: in closed form on a plane that
    cuts a straight blend, or one around an axis along a section; else solved point by point. Where a support face is
    tangent to N, the blend touches N where its rail crosses over, at ``touch``.

    Raises
    ------
    TopologyError
        If the blend does not meet N for all v.
    """
    if isinstance(target, Plane) and touch is None:
        section = blend.cut_with_plane(target, start.t)
        if section is not None:
            return section
    first, last = blend(np.full(2, start.t), np.array([0.0, 1.0]))
    size = float(np.linalg.norm(first - last))
    slope = 0.0 if touch is None else touch.slope
    if touch is not None:
        start = EndCurveStart(start.end, touch.t, touch.uv, target.jet(touch.uv[None])[0, 0])

    def solve_curve_points(v: Array, near: Array | None) -> Array:
        """Return the curve's values (n, 7) at v (n,)."""

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            h = blend.jet(x[:, 0], v, 1)
            n = target.jet(x[:, 1:])
            jacobian = np.stack([h[1, 0], -n[1], -n[2]], axis=2)
            return h[0, 0] - n[0], jacobian, np.linalg.norm(jacobian, axis=1)

        if near is None:
            t = start.t + slope * (v - (touch.side if touch is not None else 0))
            offset = blend(t, v) - start.point
            guess = start.uv + to_tangent_coordinates(target.jet(np.tile(start.uv, (len(v), 1))), offset)
            first = np.column_stack([t, guess])
        else:
            first = near[:, [0, 2, 3]]
        x, good = solve_damped_newton(evaluate_system, first, size, size)
        if touch is not None:  # where the equations are singular, and the solution is known
            x[v == touch.side], good[v == touch.side] = (touch.t, *touch.uv), True
        if not good.all():
            raise TopologyError("the blend does not meet the face there all across: the size is too large for it")
        return np.column_stack([x[:, 0], v, x[:, 1:], target.jet(x[:, 1:])[0]])

    def measure_error(values: Array, v: Array) -> float:
        """Return how far (mm) points are from their images on both surfaces."""
        on_blend, on_target = blend(values[:, 0], v), target.jet(values[:, 2:4])[0]
        return float(max(np.abs(p - values[:, 4:]).max() for p in (on_blend, on_target)))

    return StripCut.from_solution(fit_solved_curve(solve_curve_points, measure_error))


def solve_touch_point(
    blend: StripSurface, target: Primary, start: EndCurveStart, side: int, *, into_blend: bool
) -> TouchPoint:
    """Return where rail ``side`` (0 or 1) of a blend H touches N(a, b), to which its support face is tangent.

    The distance g of H from N is stationary there, dg/dt = H_t.n = 0, and two curves in which H and N meet leave in the
    directions in which the second derivative of g vanishes: one ``into_blend``, back along the edge, one on past its
    end.

    Raises
    ------
    TopologyError
        If there is no such point, or no such curve.
    """
    v = np.array([float(side)])

    def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
        h, n = blend.jet(x[:, 0], v, 2), target.jet(x[:, 1:])
        offset, rate = h[0, 0] - n[0], h[1, 0]
        normal, normal_a, normal_b = differentiate_normal(n)
        rows = [
            [rate * n[1], offset * n[3] - n[1] * n[1], offset * n[4] - n[1] * n[2]],
            [rate * n[2], offset * n[4] - n[1] * n[2], offset * n[5] - n[2] * n[2]],
            [h[2, 0] * normal, rate * normal_a, rate * normal_b],
        ]
        residual = np.stack([(offset * n[1]).sum(1), (offset * n[2]).sum(1), (rate * normal).sum(1)], axis=1)
        jacobian = np.stack([np.stack([entry.sum(1) for entry in row], axis=1) for row in rows], axis=1)
        return residual, jacobian, np.linalg.norm(np.stack([rate, n[1], n[2]], axis=2), axis=1)

    rate = blend.jet(np.array([start.t]), v, 1)[1, 0]
    speed = float(np.linalg.norm(rate))
    x, good = solve_damped_newton(evaluate_system, np.array([[start.t, *start.uv]]), speed**2, speed)
    if not good.all():
        raise TopologyError("the blend does not run out on the face there")
    h, n = blend.jet(x[:, 0], v, 2), target.jet(x[:, 1:])
    normal = differentiate_normal(n)[0]
    tangents = [to_tangent_coordinates(n, h[1, 0])[0], to_tangent_coordinates(n, h[0, 1])[0]]
    second_form = (np.array([[n[3], n[4]], [n[4], n[5]]])[:, :, 0] * normal).sum(axis=-1)

    def evaluate_second_derivative(i: int, j: int) -> float:
        """Return the derivative of g by the i-th and j-th of (t, v)."""
        second = (h[2, 0], h[1, 1], h[0, 2])[i + j]
        return float((second * normal).sum() - tangents[i] @ second_form @ tangents[j])

    roots = np.roots(
        [evaluate_second_derivative(0, 0), 2 * evaluate_second_derivative(0, 1), evaluate_second_derivative(1, 1)]
    )
    wanted = (0.5 - side) * (0.5 - start.end) * (1.0 if into_blend else -1.0)
    slopes = [float(root) for root in roots.real if root * wanted > 0]
    if np.iscomplex(roots).any() or not slopes:
        raise TopologyError("the blend does not run out on the face there")
    return TouchPoint(side, float(x[0, 0]), x[0, 1:], min(slopes, key=abs))


def solve_border_in_plane(side: SupportFace, plane: Plane, uv: tuple[Array, Array], ends: tuple[Array, Array]) -> Curve:
    """Return the curve (u, v, x, y, point) in which a support face meets a plane, between two points (3,) of both.

    x, y are parameters of the plane; ``uv`` (1, 2) are parameters of the points on the face.

    Raises
    ------
    TopologyError
        If they do not meet all along.
    """
    (start, stop), (foot, corner) = uv, ends
    chord, normal = corner - foot, plane.frame.axes[2]
    length = float(np.linalg.norm(chord))

    def solve_curve_points(shares: Array, near: Array | None) -> Array:
        """Return (u, v, x, y on the plane, point) at shares (n,) of the chord from foot to corner."""

        def evaluate_system(uv: Array) -> tuple[Array, Array, Array]:
            jet = side.face_primary.jet(uv)
            offset = jet[0] - foot
            residual = np.stack([offset @ normal, offset @ chord / length - shares * length], -1)
            jacobian = np.stack([np.stack([rate @ normal, rate @ chord / length], -1) for rate in jet[1:3]], -1)
            return residual, jacobian, np.linalg.norm(jet[1:3], axis=2).T

        first = start + shares[:, None] * (stop - start) if near is None else near[:, :2]
        uv, good = solve_damped_newton(evaluate_system, first, length, length)
        if not good.all():
            raise TopologyError("the plane across the end of the edge does not cross its faces cleanly")
        point = side.face_primary.jet(uv)[0]
        return np.column_stack([uv, (point - foot) @ plane.frame.axes[:2].T, point])

    def measure_error(values: Array, _: Array) -> float:
        """Return how far (mm) points are from their images on the support face and on the plane."""
        on_face, on_plane = side.face_primary.jet(values[:, :2])[0], plane.jet(values[:, 2:4])[0]
        return float(max(np.abs(p - values[:, 4:]).max() for p in (on_face, on_plane)))

    return fit_solved_curve(solve_curve_points, measure_error)


def plan_end_edge(
    placement: StripPlacement, cut: StripCut, face: int | PlannedSurface
) -> tuple[NewEdge, tuple[PlannedVertex, PlannedVertex]]:
    """Plan the edge of an end curve, with its pcurves on the blend and on the face it ends on, and its two corners."""
    first, last = cut.ends
    corners = (PlannedVertex(first), PlannedVertex(last))
    return plan_cut_edge(placement, cut, corners, face), corners


def plan_cut_edge(
    placement: StripPlacement, cut: StripCut, vertices: tuple[PlannedVertex, PlannedVertex], face: int | PlannedSurface
) -> NewEdge:
    """Plan the edge of an end curve between given vertices."""
    pcurves = (placement.plan_pcurve(cut.on_strip), PlannedPcurve(face, cut.on_other))
    return NewEdge("end curve", cut.curve, cut.span, vertices, pcurves)


def plan_shared_edge(
    role: EdgeRole,
    curve: Curve,
    vertices: tuple[PlannedVertex, PlannedVertex],
    faces: tuple[int | PlannedSurface, int | PlannedSurface],
) -> NewEdge:
    """Plan the edge of a fitted curve (u1, v1, u2, v2, x, y, z) in which two faces meet."""
    first, second, points = (
        Curve(curve.breaks, curve.coefs[:, part], continuity=curve.continuity)
        for part in (slice(0, 2), slice(2, 4), slice(4, 7))
    )
    pcurves = (PlannedPcurve(faces[0], first), PlannedPcurve(faces[1], second))
    return NewEdge(role, points, (0.0, 1.0), vertices, pcurves)
