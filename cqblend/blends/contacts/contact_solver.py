"""Solves for the contact points of a blend: where a rolling ball, or points at a given width, lie on the two faces.

All stations along the edge are solved at once by a damped Newton method on the surfaces' own derivatives. The unknowns
are the native parameters (u1, v1, u2, v2) of the two contacts; the plane of the station, through the edge point and
normal to the edge, makes both rails share one parameter. Depends on primary surfaces only, never on OCCT: edges come as
arrays of stations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.contacts.surface_normals import differentiate_normals, normalise_unchecked
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.errors import GeometryError, SizeError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import cross_product, measure_lengths, normalise_vectors, to_tangent_coordinates


@dataclass(frozen=True)
class SupportSurface:
    """The surface of one face at the edge; ``outward`` is +1 where Su x Sv points out of the solid, else -1."""

    primary: Primary
    outward: float


@dataclass(frozen=True)
class Stations:
    """Points along an edge, each with a plane normal to the edge in which a cross-section of the blend is constructed.

    Parameters ``t`` (n,) of the edge, its ``points`` (n, 3) and unit ``tangents`` (n, 3), and the native parameters of
    these points on both faces, ``uv``, (n, 2) each. ``jets`` (2, 6, n, 3) are the native jets of both surfaces there,
    if they are known.
    """

    t: Array
    points: Array
    tangents: Array
    uv: tuple[Array, Array]
    jets: Array | None = None


@dataclass(frozen=True)
class Contacts:
    """Contacts at parameters ``t`` (n,): the points at which a blend meets its two surfaces.

    ``uv`` are their native parameters on both surfaces, (n, 2) each, ``edge_points`` (n, 3) the points of the edge that
    they belong to, ``cross_lengths`` (2, n) the lengths that the cross derivatives of the blend should have. Where
    these derivatives are known as vectors into the blend, ``cross_vectors`` (2, n, 3) has them. ``edge_uv`` (n, 4), if
    known, are the native parameters of the edge points on both surfaces.
    """

    t: Array
    edge_points: Array
    uv: tuple[Array, Array]
    cross_lengths: Array
    cross_vectors: Array | None = None
    edge_uv: Array | None = None

    def select_stations(self, index: Array) -> Contacts:
        """Return the contacts with the given indices, or of a mask."""
        return Contacts(
            self.t[index],
            self.edge_points[index],
            (self.uv[0][index], self.uv[1][index]),
            self.cross_lengths[:, index],
            None if self.cross_vectors is None else self.cross_vectors[:, index],
            None if self.edge_uv is None else self.edge_uv[index],
        )

    def get_cross_vectors(self, side: int) -> Array:
        """Return the cross derivatives (n, 3) of one side, of contacts that have them."""
        if self.cross_vectors is None:
            raise TypeError("these contacts have no cross vectors, only their lengths")
        return np.asarray(self.cross_vectors[side])

    def merge_with(self, others: Contacts) -> Contacts:
        """Return these contacts and others, sorted by t."""
        return self.append(others).select_stations(np.argsort(np.concatenate([self.t, others.t])))

    def append(self, others: Contacts) -> Contacts:
        """Return these contacts, and others after them."""
        return Contacts(
            np.concatenate([self.t, others.t]),
            np.concatenate([self.edge_points, others.edge_points]),
            (np.concatenate([self.uv[0], others.uv[0]]), np.concatenate([self.uv[1], others.uv[1]])),
            np.concatenate([self.cross_lengths, others.cross_lengths], axis=1),
            None
            if self.cross_vectors is None or others.cross_vectors is None
            else np.concatenate([self.cross_vectors, others.cross_vectors], axis=1),
            None if self.edge_uv is None or others.edge_uv is None else np.concatenate([self.edge_uv, others.edge_uv]),
        )


ContactSolver = Callable[[Array], Contacts]
"""A function from parameters t (n,) to the contacts there."""


def evaluate_both_jets(sides: tuple[SupportSurface, SupportSurface], x: Array) -> Array:
    """Return the native jets (2, 6, n, 3) of both surfaces at parameters (n, 4)."""
    jets = np.empty((2, 6, len(x), 3))
    jets[0], jets[1] = sides[0].primary.jet(x[:, :2]), sides[1].primary.jet(x[:, 2:])
    return jets


def get_edge_jets(sides: tuple[SupportSurface, SupportSurface], stations: Stations) -> Array:
    """Return the native jets (2, 6, n, 3) of both surfaces at stations."""
    if stations.jets is None:
        return evaluate_both_jets(sides, np.concatenate(stations.uv, axis=1))
    return stations.jets


def _measure_unit_steps(jets: Array) -> Array:
    """Return |Su|, |Sv| of jets (sides, 6, n, 3), side by side, (n, 2 or 4)."""
    return measure_lengths(jets[:, 1:3]).reshape(2 * len(jets), -1).T


def _assemble_columns(rates: Array) -> Array:
    """Return the Jacobian (n, 4, 4) of the distance between points of both surfaces, its last row zero.

    ``rates`` (2, 2, n, 3) are the derivatives of the points by the parameters.
    """
    jacobian = np.zeros((rates.shape[2], 4, 4))
    columns = jacobian[:, :3].transpose(2, 0, 1)
    columns[:2] = rates[0]
    np.negative(rates[1], out=columns[2:])
    return jacobian


def project_to_intersection(sides: tuple[SupportSurface, SupportSurface], stations: Stations, scale: float) -> Stations:
    """Move the stations onto the true intersection of the two surfaces, within their planes, with its tangents.

    Edges of CAD files lie on their faces to a tolerance only; the surfaces themselves are exact. ``scale`` is the
    length of the edge.
    """
    tau = stations.tangents

    def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
        jets = evaluate_both_jets(sides, x)
        residual = np.empty((len(x), 4))
        residual[:, :3] = jets[0, 0] - jets[1, 0]
        residual[:, 3] = ((jets[0, 0] - stations.points) * tau).sum(axis=1)
        jacobian = _assemble_columns(jets[:, 1:3])
        jacobian[:, 3, :2] = (jets[0, 1:3] * tau).sum(axis=2).T
        return residual, jacobian, _measure_unit_steps(jets)

    start = np.concatenate(stations.uv, axis=1)
    x, converged = solve_damped_newton(
        evaluate_system, start, scale, CONTACT_TOLERANCES.longest_projection_step * scale
    )
    if not converged.all():
        where = stations.t[~converged][0]
        raise GeometryError(f"the two surfaces do not cross cleanly at t = {where:.4g} of the edge")
    jets = evaluate_both_jets(sides, x)
    normals = normalise_vectors(cross_product(jets[:, 1], jets[:, 2]))
    outer = cross_product(normals[0], normals[1])
    direction = normalise_vectors(outer) * np.sign((outer * tau).sum(axis=1, keepdims=True))
    return Stations(stations.t, jets[0, 0], direction, (x[:, :2], x[:, 2:]), jets)


def compute_inward_directions(
    sides: tuple[SupportSurface, SupportSurface], stations: Stations
) -> tuple[Array, Array, Array]:
    """Return the unit directions from the edge into both faces, (n, 3), and the sine (n,) of the turn between them.

    The sine is positive where the edge is convex. The stations run as the boundary of face 1 does: seen from outside,
    face 1 lies to their left.
    """
    jets = get_edge_jets(sides, stations)
    n1, n2 = normalise_vectors(cross_product(jets[:, 1], jets[:, 2]))
    into1 = cross_product(sides[0].outward * n1, stations.tangents)
    into2 = cross_product(-sides[1].outward * n2, stations.tangents)
    return into1, into2, -sides[1].outward * (into1 * n2).sum(axis=1)


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


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of iterations that go astray
def grow_contacts(attempt: ContactAttempt, edge: EdgeStart, wanted: Array) -> tuple[Array, Array]:
    """Find contacts of wanted sizes (n,) at all stations; return their parameters (n, k) and the sizes (n,) reached.

    Most are found at the first attempt, from the edge point straight ahead. Where that fails, the size is increased
    step by step (continuation), from one so small that the faces are nearly flat, each step being predicted from the
    one before. Stations at which the continuation breaks off, as where a ball would leap over a dent, start from the
    solution of their neighbour.
    """
    x, solved = attempt(np.arange(len(edge.points)), wanted, edge.points + wanted[:, None] * edge.ways)
    reached = np.where(solved, wanted, 0.0)
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
    small = wanted[growing] * CONTACT_TOLERANCES.first_size_share
    expected = edge.points[growing] + small[:, None] * edge.ways[growing]
    growing = growing[correct_prediction(growing, small, expected, edge.points[growing])]
    previous, previous_size = edge.points.copy(), np.zeros(len(edge.points))
    factor = np.full(len(edge.points), 2.0)
    while len(growing):
        current, current_size = x[growing], reached[growing]
        sizes = np.minimum(factor[growing] * current_size, wanted[growing])
        slope = (current - previous[growing]) / (current_size - previous_size[growing])[:, None]
        expected = current + slope * (sizes - current_size)[:, None]
        accepted = correct_prediction(growing, sizes, expected, current)
        previous[growing[accepted]], previous_size[growing[accepted]] = current[accepted], current_size[accepted]
        factor[growing] = np.where(accepted, np.minimum(factor[growing] ** 1.5, 2.0), factor[growing] ** 0.25)
        going_on = (reached[growing] < wanted[growing]) & (factor[growing] > 1 + CONTACT_TOLERANCES.first_size_share)
        growing = growing[going_on]
    spread = True
    while spread:
        spread = False
        for neighbour in (-1, 1):
            i = np.flatnonzero(reached < wanted)
            i = i[(i + neighbour >= 0) & (i + neighbour < len(edge.points))]
            i = i[reached[i + neighbour] == wanted[i + neighbour]]
            if len(i):
                expected = edge.points[i] + x[i + neighbour] - edge.points[i + neighbour]
                accepted = correct_prediction(i, wanted[i], expected, edge.points[i])
                spread |= bool(accepted.any())
    return x, reached


def _make_size_error(what: str, stations: Stations, reached: Array, wanted: Array) -> SizeError:
    """Return the error for contacts that were not found: it names the station at which the least size was reached.

    ``what`` has a place ``{}`` for the size that was wanted there.
    """
    short = np.flatnonzero(reached < wanted)
    first = short[reached[short].argmin()]
    most = f", one of {reached[first]:.3g} does" if reached[first] > 0 else ""
    t, size = float(stations.t[first]), float(wanted[first])
    text = f"{what.format(f'{size:g}')} at t = {t:.4g} of the edge{most}"
    return SizeError(text, kind="too large", place=t, value=size)


def _make_edge_start(edge: Array, jets: Array, vectors: Sequence[Array]) -> EdgeStart:
    """Return the start of contacts that leave edge points (n, 2 s) along vectors (n, 3) on each of s sides.

    ``jets`` (s, 6, n, 3) are those of the surfaces at the edge points.
    """
    ways = [to_tangent_coordinates(jet, vector) for jet, vector in zip(jets, vectors, strict=True)]
    return EdgeStart(edge, np.concatenate(ways, axis=1), _measure_unit_steps(jets))


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def _solve_near_expected(
    attempt: ContactAttempt, expected: Array, edge: Array, jets: Array, sizes: Array
) -> Array | None:
    """Return the contacts (n, k) of sizes (n,) next to expected ones; None if not all of them are found there.

    ``edge`` (n, k) and ``jets`` are the edge points in the same parameters and the jets there.
    """
    x, solved = attempt(np.arange(len(expected)), sizes, expected)
    metric = _measure_unit_steps(jets)
    moved, missed = (np.abs(step * metric).max(axis=1) for step in (expected - edge, x - expected))
    return x if (solved & (missed <= moved * CONTACT_TOLERANCES.largest_tracing_error)).all() else None


def roll_balls(
    sides: tuple[SupportSurface, SupportSurface], planes: tuple[Array, Array], reach: Array, start: Array
) -> tuple[Array, Array]:
    """Solve for the contacts (n, 4) of balls with both surfaces by Newton's method; tell which (n,) were found.

    Their centres lie in ``planes``, given by points and normals (n, 3) each. ``reach`` (2, n, 1) are the radii, signed
    as the normals of the surfaces point to the centres.
    """
    points, tangents = planes

    def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
        jets = evaluate_both_jets(sides, x)
        normals = differentiate_normals(jets)
        centres = jets[:, 0] + reach * normals[0]
        rates = jets[:, 1:3] + reach[:, None] * normals[1:].swapaxes(0, 1)
        residual = np.empty((len(x), 4))
        residual[:, :3] = centres[0] - centres[1]
        residual[:, 3] = (((centres[0] + centres[1]) / 2 - points) * tangents).sum(axis=1)
        jacobian = _assemble_columns(rates)
        jacobian[:, 3] = (rates * tangents).sum(axis=3).reshape(4, -1).T / 2
        return residual, jacobian, _measure_unit_steps(jets)

    sizes = np.abs(reach[0, :, 0])
    return solve_damped_newton(evaluate_system, start, sizes, sizes)


def measure_ball_openings(jets: Array, signs: Array) -> Array:
    """Return the angles (n,) between the radii of balls to their contacts, by jets (2, 6, n, 3) and signs (2, 1, 1)."""
    first, second = signs * normalise_unchecked(cross_product(jets[:, 1], jets[:, 2]))
    return np.asarray(np.arctan2(measure_lengths(cross_product(first, second)), (first * second).sum(axis=1)))


def solve_ball_contacts(
    sides: tuple[SupportSurface, SupportSurface],
    stations: Stations,
    radius: float | Array,
    expected: tuple[Array, Array] | None = None,
) -> Contacts:
    """Return where a ball of the given radius, its centre in each station's plane, touches both surfaces.

    The radius (mm) is one, or one for each station (n,). Solves S1 + R m1 = S2 + R m2 with (centre - X).tau = 0, m the
    unit normals towards the ball: into the material at a convex edge, out of it at a concave one. The length of the
    cross derivatives is 4 R tan(theta/4), theta the opening of the arc, which makes a cubic Hermite section the
    best-known approximation of the arc. ``expected`` are native parameters near the contacts, if any are known.
    """
    radii = np.broadcast_to(radius, stations.t.shape)
    edge_jets, edge = get_edge_jets(sides, stations), np.concatenate(stations.uv, axis=1)
    into1, into2, turn = compute_inward_directions(sides, replace(stations, jets=edge_jets))
    on_edge = (stations.t >= 0) & (stations.t <= 1)  # in the extension past its ends, convexity may change
    turns = turn[on_edge] if on_edge.any() else turn
    if turns.max() > CONTACT_TOLERANCES.smooth_edge_sine and turns.min() < -CONTACT_TOLERANCES.smooth_edge_sine:
        raise GeometryError("the edge changes between convex and concave; a ball cannot roll along it")
    signs = -np.sign(turns.sum()) * np.array([sides[0].outward, sides[1].outward])[:, None, None]
    into, openings = np.stack([into1, into2]), np.zeros(len(turn))

    def attempt_ball_contacts(index: Array, sizes: Array, start: Array) -> tuple[Array, Array]:
        point = stations.points[index]
        x, solved = roll_balls(sides, (point, stations.tangents[index]), sizes[:, None] * signs, start)
        jets = evaluate_both_jets(sides, x)
        openings[index] = measure_ball_openings(jets, signs)
        solved &= (((jets[:, 0] - point) * into[:, index]).sum(axis=2) > 0).all(axis=0)
        solved &= openings[index] > CONTACT_TOLERANCES.least_ball_opening
        return x, solved

    found = None
    if expected is not None:
        found = _solve_near_expected(attempt_ball_contacts, np.concatenate(expected, axis=1), edge, edge_jets, radii)
    if found is None:
        leaning = np.tan(np.arccos(np.clip(-(into1 * into2).sum(axis=1), -1, 1)) / 2)[:, None]
        found, reached = grow_contacts(attempt_ball_contacts, _make_edge_start(edge, edge_jets, into * leaning), radii)
        if (reached < radii).any():
            smooth = (reached == 0) & (np.abs(turn) < CONTACT_TOLERANCES.smooth_edge_sine)
            if smooth.any():
                raise SizeError(
                    f"the two faces are tangent to each other at t = {stations.t[smooth][0]:.4g} of the edge"
                )
            raise _make_size_error("no ball of radius {} touches both faces", stations, reached, radii)
    lengths = np.tile(4 * radii * np.tan(openings / 4), (2, 1))
    return Contacts(stations.t, stations.points, (found[:, :2], found[:, 2:]), lengths, edge_uv=edge)


def solve_setback_contacts(
    sides: tuple[SupportSurface, SupportSurface],
    stations: Stations,
    widths: tuple[float | Array, float | Array],
    expected: tuple[Array, Array] | None = None,
) -> Contacts:
    """Return the points of each face at a straight distance from the edge point, within the station's plane.

    The widths (mm) of both sides are one each, or one for each station (n,).
    The length of the cross derivatives is the chord between them, divided between the sides as the widths are: a third
    of it, where the section's inner control points stand, never reaches the edge. ``expected`` are native parameters
    near the contacts, if any are known.
    """
    jets = get_edge_jets(sides, stations)
    wanted = np.stack([np.broadcast_to(width, stations.t.shape) for width in widths])
    into = compute_inward_directions(sides, replace(stations, jets=jets))[:2]
    first, second = (
        _solve_setback_points(
            sides[i].primary,
            stations,
            _FaceFeet(stations.uv[i], jets[i : i + 1], into[i], None if expected is None else expected[i]),
            wanted[i],
        )
        for i in (0, 1)
    )
    chord = sides[1].primary.jet(second)[0] - sides[0].primary.jet(first)[0]
    cross_lengths = 2 * wanted / wanted.sum(axis=0) * measure_lengths(chord)
    edge = np.concatenate(stations.uv, axis=1)
    return Contacts(stations.t, stations.points, (first, second), cross_lengths, edge_uv=edge)


class _FaceFeet(NamedTuple):
    """The edge points on one face: native parameters (n, 2), jets (1, 6, n, 3), and directions into the face (n, 3).

    ``expected`` are native parameters near the contacts, if any are known.
    """

    uv: Array
    jets: Array
    into: Array
    expected: Array | None


def _solve_setback_points(primary: Primary, stations: Stations, feet: _FaceFeet, widths: Array) -> Array:
    """Return native parameters (n, 2) of the points of one face at distances ``widths`` (n,) from the edge points."""

    def attempt_setback_contacts(index: Array, sizes: Array, start: Array) -> tuple[Array, Array]:
        point, tau = stations.points[index], stations.tangents[index]

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            jet = primary.jet(x)
            offset = jet[0] - point
            distance = measure_lengths(offset)
            residual = np.stack([distance - sizes, (offset * tau).sum(axis=1)], axis=1)
            jacobian = np.empty((len(x), 2, 2))
            jacobian[:, 0] = (jet[1:3] * (offset / distance[:, None])).sum(axis=2).T
            jacobian[:, 1] = (jet[1:3] * tau).sum(axis=2).T
            return residual, jacobian, _measure_unit_steps(jet[None])

        x, solved = solve_damped_newton(evaluate_system, start, sizes, sizes)
        solved &= ((primary.jet(x)[0] - point) * feet.into[index]).sum(axis=1) > 0
        return x, solved

    if feet.expected is not None:
        found = _solve_near_expected(attempt_setback_contacts, feet.expected, feet.uv, feet.jets, widths)
        if found is not None:
            return found
    x, reached = grow_contacts(attempt_setback_contacts, _make_edge_start(feet.uv, feet.jets, (feet.into,)), widths)
    if (reached < widths).any():
        raise _make_size_error("no point of the face lies at width {} from the edge", stations, reached, widths)
    return x
