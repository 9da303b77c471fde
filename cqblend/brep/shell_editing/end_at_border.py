"""Ends of an open blend in the border of an open shell, where no face lies across the edge.

The two free edges there are trimmed where the rails meet them, and the blend gets a free edge between these corners. If
the border is planar there, that edge lies in its plane, so that a planar face still fits; else it leaves both corners
in the directions of the free edges, and the border has no kink. Where a support face goes on past a planar border, on
the other side of it than its free edge, it gets a free edge in the same plane.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopoDS import TopoDS_Edge

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.network.blend_plan import EdgeUse, NewEdge, PlannedPcurve, PlannedVertex
from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.selection.border_ends import BorderEnd
from cqblend.brep.shell_editing.end_curve import (
    EndCurveStart,
    fit_solved_curve,
    solve_border_in_plane,
    solve_end_curve,
)
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim, is_corner_behind
from cqblend.brep.shell_editing.strip_end import StripEnd
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import find_vertex_uv
from cqblend.errors import SizeError, TopologyError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.circle import Circle
from cqblend.surfaces.ellipse import Ellipse
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import LocalFrame, measure_lengths, normalise_vectors


def end_at_border(placement: StripPlacement, end: int, border: BorderEnd) -> StripEnd:
    """End the blend in the border of an open shell, at its start (``end`` 0) or stop (1).

    Raises
    ------
    TopologyError
        If a rail runs along the border.
    SizeError
        If a rail does not meet its free edge.
    """
    found = _cut_border_plane(placement, end, border) if border.is_planar else _continue_border(placement, border)
    first, last = found.curve(np.array(found.span))
    corners = (PlannedVertex(first), PlannedVertex(last))
    edge = NewEdge("end curve", found.curve, found.span, corners, (placement.plan_pcurve(found.on_strip),))
    parameters, vertex = found.on_strip(np.array(found.span))[:, 0], placement.keep_vertex(border.vertex)
    trims, inner = list[EdgeTrim](), list[tuple[EdgeUse, ...]]()
    for i, (free, corner, side) in enumerate(zip(border.edges, corners, placement.joint.sides, strict=True)):
        if found.plane is not None and is_corner_behind(free, border.vertex, corner.point):
            inner.append((EdgeUse(_plan_inner_border(placement, i, found.plane, (vertex, corner), parameters[i])),))
        else:
            trims.append(EdgeTrim(placement, end, free, border.vertex, corner, (side.face,)))
            inner.append(())
    return StripEnd(
        (EdgeUse(edge),),
        corners,
        (float(parameters[0]), float(parameters[1])),
        vertex,
        tuple(trims),
        cap_borders=(inner[0], inner[1]),
    )


class _FreeEnd(NamedTuple):
    """The free end of a blend: a curve from rail 1 to rail 2, in space and in the parameters of the strip."""

    curve: Curve | Circle | Ellipse
    span: tuple[float, float]
    on_strip: Curve
    plane: Plane | None = None  # that of the border, in which it lies


def _plan_inner_border(
    placement: StripPlacement,
    i: int,
    plane: Plane,
    vertices: tuple[PlannedVertex, PlannedVertex],
    at_corner: float,
) -> NewEdge:
    """Plan a free edge inside support face ``i``, from the end of the blended edge to the corner on the rail.

    That is where the face goes on past the border, on the other side of it than its free edge.
    """
    side, (vertex, corner) = placement.joint.sides[i], vertices
    edge_uv = find_vertex_uv(placement.index.vertices[vertex.number], side.face)[None]
    rail_uv = side.unwrap_near(placement.get_rail_pcurve(i)(np.array([at_corner])), edge_uv)
    border = solve_border_in_plane(side, plane, (edge_uv, rail_uv), (vertex.point, corner.point))
    on_face, points = (
        Curve(border.breaks, border.coefs[:, part], continuity=border.continuity) for part in (slice(0, 2), slice(4, 7))
    )
    return NewEdge("cap border", points, (0.0, 1.0), vertices, (PlannedPcurve(placement.face_numbers[i], on_face),))


def _cut_border_plane(placement: StripPlacement, end: int, border: BorderEnd) -> _FreeEnd:
    """Return the curve in which the blend meets the plane of the border."""
    x = normalise_vectors(np.cross(border.normal, np.eye(3)[int(np.abs(border.normal).argmin())]))
    plane = Plane(LocalFrame(border.point, np.array([x, np.cross(border.normal, x), border.normal])))
    start = EndCurveStart(end, placement.locate_edge_parameter(end), np.zeros(2), border.point)
    cut = solve_end_curve(placement.strip, plane, start)
    return _FreeEnd(cut.curve, cut.span, cut.on_strip, plane)


def _continue_border(placement: StripPlacement, border: BorderEnd) -> _FreeEnd:
    """Return the curve v -> H(s(v), v) on the blend that continues both free edges tangentially.

    s is a cubic of v between where the rails meet the free edges.
    """
    (s0, slope0), (s1, slope1) = (_meet_border(placement, i, edge) for i, edge in enumerate(border.edges))
    step = Curve.bezier([[s0], [s0 + slope0 / 3], [s1 - slope1 / 3], [s1]])

    def locate_points(v: Array, near: Array | None) -> Array:
        del near  # there is nothing to solve
        s = step(v)[:, 0]
        return np.column_stack([s, v, placement.strip(s, v)])

    def measure_error(values: Array, v: Array) -> float:
        return float(np.abs(placement.strip(values[:, 0], v) - values[:, 2:]).max())

    fitted = fit_solved_curve(locate_points, measure_error)
    on_strip, points = (
        Curve(fitted.breaks, fitted.coefs[:, part], continuity=fitted.continuity) for part in (slice(0, 2), slice(2, 5))
    )
    return _FreeEnd(points, fitted.domain, on_strip)


def _meet_border(placement: StripPlacement, i: int, edge: TopoDS_Edge) -> tuple[float, float]:
    """Return the s at which rail ``i`` meets a free edge of its face, and ds/dv of the blend's curve along that edge.

    Raises
    ------
    TopologyError
        If the rail runs along the edge there.
    SizeError
        If it does not meet it.
    """
    free = CurveEvaluator(BRep_Tool.Curve_s(edge, 0.0, 0.0))
    first, last = BRep_Tool.Range_s(edge)
    (low, high), count = placement.domain, SHELL_EDIT_TOLERANCES.free_edge_samples
    stations, places = np.linspace(low, high, count), np.linspace(first, last, count)
    apart = np.linalg.norm(placement.strip(stations, np.full(count, float(i)))[:, None] - free(places)[0].T, axis=2)
    k, m = np.unravel_index(int(apart.argmin()), apart.shape)

    def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
        """Return the distance of both points along both tangents, which vanishes where they are nearest."""
        jet = placement.strip.jet(x[:, 0], np.full(len(x), float(i)), 1)
        point, rate = free(x[:, 1], 1).transpose(0, 2, 1)
        speeds = np.stack([measure_lengths(jet[1, 0]), measure_lengths(rate)], axis=1)
        tangents = np.stack([jet[1, 0], rate], axis=1) / speeds[..., None]  # (n, 2, 3)
        residual = np.einsum("nij,nj->ni", tangents, jet[0, 0] - point)
        jacobian = np.einsum("nij,nkj->nik", tangents, np.stack([jet[1, 0], -rate], axis=1))
        return residual, jacobian, speeds

    size = float(apart.max())
    x, good = solve_damped_newton(evaluate_system, np.array([[stations[k], places[m]]]), size, size)
    s, at = x[0].tolist()
    if not good.all() or not first <= at <= last:
        raise SizeError("the rail does not meet the border there: the size is too large for it", kind="too large")
    jet = placement.strip.jet(np.array([s]), np.array([float(i)]), 1)
    along, rates = free(np.array([at]), 1)[1, :, 0], np.column_stack([jet[1, 0, 0], jet[0, 1, 0]])
    (by_s, by_v), *_ = np.linalg.lstsq(rates, along)
    if abs(by_v) * np.linalg.norm(rates[:, 1]) < SHELL_EDIT_TOLERANCES.least_border_sine * np.linalg.norm(along):
        raise TopologyError("the border runs along the rail there")
    return s, float(by_s / by_v)
