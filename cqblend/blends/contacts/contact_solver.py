"""Solves for the contact points of a blend: where a rolling ball, or points at a given width, lie on the two faces.

All stations along the edge are solved at once by a damped Newton method on the surfaces' own derivatives. The unknowns
are the native parameters (u1, v1, u2, v2) of the two contacts; the plane of the station, through the edge point and
normal to the edge, makes both rails share one parameter. Depends on primary surfaces only, never on OCCT: edges come as
arrays of stations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.contacts.surface_normals import differentiate_normal_unchecked
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.errors import GeometryError, SizeError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import cross_product, normalise_vectors, to_tangent_coordinates

BOTH_SIDES = (0, 1)


@dataclass(frozen=True)
class SupportSurface:
    """The surface of one face at the edge; ``outward`` is +1 where Su x Sv points out of the solid, else -1."""

    primary: Primary
    outward: float


@dataclass(frozen=True)
class Stations:
    """Points along an edge, each with a plane normal to the edge in which a cross-section of the blend is constructed.

    Parameters ``t`` (n,) of the edge, its ``points`` (n, 3) and unit ``tangents`` (n, 3), and the native parameters of
    these points on both faces, ``uv``, (n, 2) each.
    """

    t: Array
    points: Array
    tangents: Array
    uv: tuple[Array, Array]


@dataclass(frozen=True)
class Contacts:
    """Contacts at parameters ``t`` (n,): the points at which a blend meets its two surfaces.

    ``uv`` are their native parameters on both surfaces, (n, 2) each, ``edge_points`` (n, 3) the points of the edge that
    they belong to, ``cross_lengths`` (2, n) the lengths that the cross derivatives of the blend should have. Where
    these derivatives are known as vectors into the blend, ``cross_vectors`` (2, n, 3) has them.
    """

    t: Array
    edge_points: Array
    uv: tuple[Array, Array]
    cross_lengths: Array
    cross_vectors: Array | None = None

    def select_stations(self, index: Array) -> Contacts:
        """Return the contacts with the given indices, or of a mask."""
        return Contacts(
            self.t[index],
            self.edge_points[index],
            (self.uv[0][index], self.uv[1][index]),
            self.cross_lengths[:, index],
            None if self.cross_vectors is None else self.cross_vectors[:, index],
        )

    def get_cross_vectors(self, side: int) -> Array:
        """Return the cross derivatives (n, 3) of one side, of contacts that have them."""
        if self.cross_vectors is None:
            raise TypeError("these contacts have no cross vectors, only their lengths")
        return np.asarray(self.cross_vectors[side])

    def merge_with(self, others: Contacts) -> Contacts:
        """Return these contacts and others, sorted by t."""
        order = np.argsort(np.concatenate([self.t, others.t]))
        both = Contacts(
            np.concatenate([self.t, others.t]),
            np.concatenate([self.edge_points, others.edge_points]),
            (np.concatenate([self.uv[0], others.uv[0]]), np.concatenate([self.uv[1], others.uv[1]])),
            np.concatenate([self.cross_lengths, others.cross_lengths], axis=1),
            None
            if self.cross_vectors is None or others.cross_vectors is None
            else np.concatenate([self.cross_vectors, others.cross_vectors], axis=1),
        )
        return both.select_stations(order)


ContactSolver = Callable[[Array], Contacts]
"""A function from parameters t (n,) to the contacts there."""


def cache_contacts(solve: ContactSolver) -> ContactSolver:
    """Return a solver that remembers contacts: a rail is refined by stations in addition to those already solved."""
    known: Contacts | None = None

    def solve_missing_stations(t: Array) -> Contacts:
        nonlocal known
        wanted = np.unique(t)
        if known is None:
            known = solve(wanted)
        else:
            missing = np.setdiff1d(wanted, known.t, assume_unique=True)
            if len(missing):
                known = known.merge_with(solve(missing))
        return known.select_stations(np.searchsorted(known.t, t))

    return solve_missing_stations


def _measure_unit_steps(jets: tuple[Array, ...]) -> Array:
    """Return |Su|, |Sv| of every jet, side by side, (n, 2 or 4)."""
    return np.concatenate([np.linalg.norm(j[1:3], axis=2).T for j in jets], axis=1)


def project_to_intersection(sides: tuple[SupportSurface, SupportSurface], stations: Stations, scale: float) -> Stations:
    """Move the stations onto the true intersection of the two surfaces, within their planes, with its tangents.

    Edges of CAD files lie on their faces to a tolerance only; the surfaces themselves are exact. ``scale`` is the
    length of the edge.
    """

    def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
        a, b = sides[0].primary.jet(x[:, :2]), sides[1].primary.jet(x[:, 2:])
        tau = stations.tangents
        residual = np.concatenate([a[0] - b[0], ((a[0] - stations.points) * tau).sum(1, keepdims=True)], 1)
        jacobian = np.zeros((len(x), 4, 4))
        for column, rate in enumerate((a[1], a[2], -b[1], -b[2])):
            jacobian[:, :3, column] = rate
            if column < 2:
                jacobian[:, 3, column] = (rate * tau).sum(1)
        return residual, jacobian, _measure_unit_steps((a, b))

    start = np.concatenate(stations.uv, axis=1)
    x, converged = solve_damped_newton(
        evaluate_system, start, scale, CONTACT_TOLERANCES.longest_projection_step * scale
    )
    if not converged.all():
        where = stations.t[~converged][0]
        raise GeometryError(f"the two surfaces do not cross cleanly at t = {where:.4g} of the edge")
    uv = (x[:, :2], x[:, 2:])
    point = sides[0].primary.jet(uv[0])[0]
    outer = cross_product(sides[0].primary.evaluate_normals(uv[0]), sides[1].primary.evaluate_normals(uv[1]))
    tau = normalise_vectors(outer) * np.sign((outer * stations.tangents).sum(1, keepdims=True))
    return Stations(stations.t, point, tau, uv)


def compute_inward_directions(
    sides: tuple[SupportSurface, SupportSurface], stations: Stations
) -> tuple[Array, Array, Array]:
    """Return the unit directions from the edge into both faces, (n, 3), and the sine (n,) of the turn between them.

    The sine is positive where the edge is convex. The stations run as the boundary of face 1 does: seen from outside,
    face 1 lies to their left.
    """
    n1, n2 = (side.outward * side.primary.evaluate_normals(uv) for side, uv in zip(sides, stations.uv, strict=True))
    into1 = cross_product(n1, stations.tangents)
    into2 = -cross_product(n2, stations.tangents)
    return into1, into2, -(into1 * n2).sum(1)


ContactAttempt = Callable[[Array, Array, Array], tuple[Array, Array]]
"""A function from the indices of stations (m,), a size for each (m,) and start parameters (m, k) to the contacts'
parameters (m, k) and a mask of those that are solutions."""


@dataclass(frozen=True)
class EdgeStart:
    """Where contacts of any size start from.

    ``points`` (n, k) are the edge points in native parameters, ``ways`` (n, k) the directions in which contacts leave
    them, for a unit of size, and ``metric`` (n, k) the lengths in space of a unit of each parameter.
    """

    points: Array
    ways: Array
    metric: Array

    def select_parameters(self, columns: slice) -> EdgeStart:
        """Return the start of those unknowns only."""
        return EdgeStart(self.points[:, columns], self.ways[:, columns], self.metric[:, columns])


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of iterations that go astray
def grow_contacts(attempt: ContactAttempt, edge: EdgeStart, size: float) -> tuple[Array, Array]:
    """Find contacts of the given size at all stations; return their parameters (n, k) and the sizes (n,) reached.

    Most are found at the first attempt, from the edge point straight ahead. Where that fails, the size is increased
    step by step (continuation), from one so small that the faces are nearly flat, each step being predicted from the
    one before. Stations at which the continuation breaks off, as where a ball would leap over a dent, start from the
    solution of their neighbour.
    """
    x, solved = attempt(np.arange(len(edge.points)), np.full(len(edge.points), size), edge.points + size * edge.ways)
    reached = np.where(solved, size, 0.0)
    if solved.all():
        return x, reached

    def correct_prediction(i: Array, sizes: Array, expected: Array, before: Array) -> Array:
        """Attempt stations i; accept solutions that are near to the expected ones. Return which were accepted."""
        found, accepted = attempt(i, sizes, expected)
        moved, missed = (
            np.linalg.norm(step * edge.metric[i], axis=1) for step in (expected - before, found - expected)
        )
        accepted &= missed <= moved * CONTACT_TOLERANCES.largest_prediction_error
        x[i[accepted]], reached[i[accepted]] = found[accepted], sizes[accepted]
        return accepted

    growing = np.flatnonzero(~solved)
    small = np.full(len(growing), size * CONTACT_TOLERANCES.first_size_share)
    expected = edge.points[growing] + small[:, None] * edge.ways[growing]
    growing = growing[correct_prediction(growing, small, expected, edge.points[growing])]
    previous, previous_size = edge.points.copy(), np.zeros(len(edge.points))
    factor = np.full(len(edge.points), 2.0)
    while len(growing):
        current, current_size = x[growing], reached[growing]
        sizes = np.minimum(factor[growing] * current_size, size)
        slope = (current - previous[growing]) / (current_size - previous_size[growing])[:, None]
        expected = current + slope * (sizes - current_size)[:, None]
        accepted = correct_prediction(growing, sizes, expected, current)
        previous[growing[accepted]], previous_size[growing[accepted]] = current[accepted], current_size[accepted]
        factor[growing] = np.where(accepted, np.minimum(factor[growing] ** 1.5, 2.0), factor[growing] ** 0.25)
        going_on = (reached[growing] < size) & (factor[growing] > 1 + CONTACT_TOLERANCES.first_size_share)
        growing = growing[going_on]
    spread = True
    while spread:
        spread = False
        for neighbour in (-1, 1):
            i = np.flatnonzero(reached < size)
            i = i[(i + neighbour >= 0) & (i + neighbour < len(edge.points))]
            i = i[reached[i + neighbour] == size]
            if len(i):
                expected = edge.points[i] + x[i + neighbour] - edge.points[i + neighbour]
                accepted = correct_prediction(i, np.full(len(i), size), expected, edge.points[i])
                spread |= bool(accepted.any())
    return x, reached


def _make_size_error(what: str, stations: Stations, reached: Array, size: float) -> SizeError:
    """Return the error for contacts that were not found: it names the station at which the least size was reached."""
    short = np.flatnonzero(reached < size)
    first = short[reached[short].argmin()]
    most = f", one of {reached[first]:.3g} does" if reached[first] > 0 else ""
    t = float(stations.t[first])
    return SizeError(f"{what} at t = {t:.4g} of the edge{most}", kind="too large", place=t, value=size)


def _make_edge_start(
    sides: tuple[SupportSurface, SupportSurface], stations: Stations, vectors: Sequence[Array]
) -> EdgeStart:
    """Return the start of contacts that leave the edge along vectors (n, 3) on each side; its arrays are (n, 4)."""
    jets = tuple(side.primary.jet(uv) for side, uv in zip(sides, stations.uv, strict=True))
    ways = [to_tangent_coordinates(jet, vector) for jet, vector in zip(jets, vectors, strict=True)]
    return EdgeStart(np.concatenate(stations.uv, axis=1), np.concatenate(ways, axis=1), _measure_unit_steps(jets))


def solve_ball_contacts(sides: tuple[SupportSurface, SupportSurface], stations: Stations, radius: float) -> Contacts:
    """Return where a ball of the given radius, its centre in each station's plane, touches both surfaces.

    Solves S1 + R m1 = S2 + R m2 with (centre - X).tau = 0, m the unit normals towards the ball: into the material at a
    convex edge, out of it at a concave one. The length of the cross derivatives is 4 R tan(theta/4), theta the opening
    of the arc, which makes a cubic Hermite section the best-known approximation of the arc.
    """
    into1, into2, turn = compute_inward_directions(sides, stations)
    on_edge = (stations.t >= 0) & (stations.t <= 1)  # in the extension past its ends, convexity may change
    turns = turn[on_edge] if on_edge.any() else turn
    if turns.max() > CONTACT_TOLERANCES.smooth_edge_sine and turns.min() < -CONTACT_TOLERANCES.smooth_edge_sine:
        raise GeometryError("the edge changes between convex and concave; a ball cannot roll along it")
    sign = np.array([-np.sign(turns.sum()) * side.outward for side in sides])
    half = np.arccos(np.clip(-(into1 * into2).sum(1), -1, 1)) / 2

    def attempt_ball_contacts(index: Array, sizes: Array, start: Array) -> tuple[Array, Array]:
        point, tau, r = stations.points[index], stations.tangents[index], sizes[:, None]

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            jets = (sides[0].primary.jet(x[:, :2]), sides[1].primary.jet(x[:, 2:]))
            centre, rates = [], []
            for i in BOTH_SIDES:
                n, nu, nv = differentiate_normal_unchecked(jets[i])
                centre.append(jets[i][0] + r * sign[i] * n)
                rates += [jets[i][1] + r * sign[i] * nu, jets[i][2] + r * sign[i] * nv]
            middle = (centre[0] + centre[1]) / 2 - point
            residual = np.concatenate([centre[0] - centre[1], (middle * tau).sum(1, keepdims=True)], 1)
            jacobian = np.zeros((len(x), 4, 4))
            for column, rate in enumerate(rates):
                jacobian[:, :3, column] = rate if column < 2 else -rate
                jacobian[:, 3, column] = (rate * tau).sum(1) / 2
            return residual, jacobian, _measure_unit_steps(jets)

        x, solved = solve_damped_newton(evaluate_system, start, sizes, sizes)
        normals = []
        for i, into in ((0, into1), (1, into2)):
            jet = sides[i].primary.jet(x[:, 2 * i : 2 * i + 2])
            normals.append(sign[i] * differentiate_normal_unchecked(jet)[0])
            solved &= ((jet[0] - point) * into[index]).sum(1) > 0
        solved &= measure_opening(*normals) > CONTACT_TOLERANCES.least_ball_opening
        return x, solved

    def measure_opening(m1: Array, m2: Array) -> Array:
        """Return the angles (n,) between the normals at both contacts."""
        return np.arctan2(np.linalg.norm(cross_product(m1, m2), axis=1), (m1 * m2).sum(1))

    edge = _make_edge_start(sides, stations, (into1 * np.tan(half)[:, None], into2 * np.tan(half)[:, None]))
    x, reached = grow_contacts(attempt_ball_contacts, edge, radius)
    if reached.min() < radius:
        smooth = (reached == 0) & (np.abs(turn) < CONTACT_TOLERANCES.smooth_edge_sine)
        if smooth.any():
            raise SizeError(f"the two faces are tangent to each other at t = {stations.t[smooth][0]:.4g} of the edge")
        raise _make_size_error(f"no ball of radius {radius:g} touches both faces", stations, reached, radius)
    uv = x[:, :2], x[:, 2:]
    theta = measure_opening(*(sign[i] * sides[i].primary.evaluate_normals(uv[i]) for i in BOTH_SIDES))
    return Contacts(stations.t, stations.points, uv, np.tile(4 * radius * np.tan(theta / 4), (2, 1)))


def solve_setback_contacts(
    sides: tuple[SupportSurface, SupportSurface], stations: Stations, widths: tuple[float, float]
) -> Contacts:
    """Return the points of each face at a straight distance from the edge point, within the station's plane.

    The length of the cross derivatives is the chord between them, divided between the sides as the widths are: a third
    of it, where the section's inner control points stand, never reaches the edge.
    """
    into = compute_inward_directions(sides, stations)[:2]
    edge = _make_edge_start(sides, stations, into)
    first, second = (
        _solve_setback_points(side.primary, stations, direction, edge.select_parameters(columns), width)
        for side, direction, columns, width in zip(sides, into, (slice(0, 2), slice(2, 4)), widths, strict=True)
    )
    chord = sides[1].primary.jet(second)[0] - sides[0].primary.jet(first)[0]
    shares = 2 * np.array(widths) / sum(widths)
    cross_lengths = np.multiply.outer(shares, np.linalg.norm(chord, axis=1))
    return Contacts(stations.t, stations.points, (first, second), cross_lengths)


def _solve_setback_points(primary: Primary, stations: Stations, into: Array, edge: EdgeStart, width: float) -> Array:
    """Return the native parameters (n, 2) of the points of one face at a distance ``width`` from the edge points.

    ``into`` (n, 3) are the directions from the edge into the face.
    """

    def attempt_setback_contacts(index: Array, sizes: Array, start: Array) -> tuple[Array, Array]:
        point, tau = stations.points[index], stations.tangents[index]

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            jet = primary.jet(x)
            offset = jet[0] - point
            distance = np.linalg.norm(offset, axis=1, keepdims=True)
            residual = np.concatenate([distance - sizes[:, None], (offset * tau).sum(1, keepdims=True)], 1)
            radial = offset / distance
            rows = [np.stack([(jet[1] * w).sum(1), (jet[2] * w).sum(1)], -1) for w in (radial, tau)]
            return residual, np.stack(rows, 1), _measure_unit_steps((jet,))

        x, solved = solve_damped_newton(evaluate_system, start, sizes, sizes)
        solved &= ((primary.jet(x)[0] - point) * into[index]).sum(1) > 0
        return x, solved

    x, reached = grow_contacts(attempt_setback_contacts, edge, width)
    if reached.min() < width:
        raise _make_size_error(f"no point of the face lies at width {width:g} from the edge", stations, reached, width)
    return x
