"""From an edge to the contact points of a blend: where a rolling ball, or a given width, touches the two faces.

All stations along the edge are solved at once by a damped Newton iteration on the surfaces' own derivatives. The
unknowns are the native parameters (u1, v1, u2, v2) of the two contacts; the station's plane, through the edge point and
normal to the edge, fixes the parameter that the two rails share. Pure NumPy: the edge arrives as a function, the
surfaces as primaries.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.errors import GeometryError, SizeError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary import Primary
from cqblend.surfaces.vectors import cross_product, normalise_vectors, to_tangent_coordinates

SMOOTH_EDGE_SINE = 1e-3  # sine of the angle between the faces below which it does not tell convex from concave
NEWTON_STEPS = 40  # Newton iterations; four suffice next to the solution, the rest is for damped starts
FIRST_SIZE_SHARE = (
    1 / 128
)  # of a size: at this share of it a ball that is to grow starts, and by less it is not made to grow
BOTH_SIDES = (0, 1)


@dataclass(frozen=True)
class SupportSurface:
    """One side of the edge: the surface, and where its material is.

    ``outward`` is +1 where Su x Sv points out of the solid, else -1.
    """

    primary: Primary
    outward: float


@dataclass(frozen=True)
class Stations:
    """Cross-sections of the joint at parameters ``t`` (n,): edge points and directions, both faces' parameters."""

    t: Array
    points: Array
    tangents: Array
    uv: tuple[Array, Array]


@dataclass(frozen=True)
class Contacts:
    """Contact parameters (n, 2) on both sides, edge points between them, the cross derivatives' lengths (2, n).

    ``vectors`` (2, n, 3) are these derivatives, into the blend, where more is known of them than their lengths.
    """

    t: Array
    edge_points: Array
    uv: tuple[Array, Array]
    cross_lengths: Array
    cross_vectors: Array | None = None

    def select_stations(self, index: Array) -> Contacts:
        """Return some of the contacts."""
        return Contacts(
            self.t[index],
            self.edge_points[index],
            (self.uv[0][index], self.uv[1][index]),
            self.cross_lengths[:, index],
            None if self.cross_vectors is None else self.cross_vectors[:, index],
        )

    def merge_with(self, others: Contacts) -> Contacts:
        """Return these contacts and others, in the order of t."""
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
"""What finds the contacts at parameters t (n,), any number of them."""


def cache_contacts(solve: ContactSolver) -> ContactSolver:
    """Return a solver that solves no station twice: rails are refined by adding stations to those that there are."""
    known: list[Contacts] = []

    def solve_missing_stations(t: Array) -> Contacts:
        wanted = np.unique(t)
        missing = wanted if not known else np.setdiff1d(wanted, known[0].t, assume_unique=True)
        if len(missing):
            found = solve(missing)
            known[:] = [known[0].merge_with(found) if known else found]
        return known[0].select_stations(np.searchsorted(known[0].t, t))

    return solve_missing_stations


def differentiate_normal(jet: Array) -> tuple[Array, Array, Array]:
    """Return the unit normal and its two derivatives, each (n, 3), of a native jet."""
    if not np.all(np.linalg.norm(cross_product(jet[1], jet[2]), axis=1) > 0):
        raise GeometryError("a face is singular under the blend: its partial derivatives span no tangent plane")
    return _differentiate_normal_unchecked(jet)


def _differentiate_normal_unchecked(jet: Array) -> tuple[Array, Array, Array]:
    """As :func:`differentiate_normal`, but nan where the surface is singular: an iteration may pass by there."""
    outer = cross_product(jet[1], jet[2])
    length = np.linalg.norm(outer, axis=1, keepdims=True)

    def normalise_rate(change: Array) -> Array:
        return (change - (change * n).sum(1, keepdims=True) * n) / length

    n = outer / length
    du = normalise_rate(cross_product(jet[3], jet[2]) + cross_product(jet[1], jet[4]))
    dv = normalise_rate(cross_product(jet[4], jet[2]) + cross_product(jet[1], jet[5]))
    return n, du, dv


def solve_damped_newton(
    system: Callable[[Array], tuple[Array, Array, Array]], start: Array, scale: float | Array, stride: float | Array
) -> tuple[Array, Array]:
    """Solve F(x) = 0 for all stations at once.

    ``system`` returns F (n, m), its Jacobian (n, m, m) and the length (n, m) of a unit step of each unknown in space.
    Steps are held to ``stride`` in space, F to rounding of ``scale``: numbers, or one for each station (n,). Returns x
    and a mask of the stations that converged to rounding.
    """
    x = start.copy()
    best, settled = np.full(len(x), np.inf), np.zeros(len(x), dtype=bool)
    for _ in range(NEWTON_STEPS):
        residual, jacobian, metric = system(x)
        size = np.abs(residual).max(1) / scale
        settled |= (size < 1e-15) | ((size < 1e-11) & (size >= best / 2))  # rounding alone moves it from here on
        lost = ~(np.isfinite(residual).all(axis=1) & np.isfinite(jacobian).all(axis=(1, 2)))
        settled |= lost  # they stay where they are and do not disturb the others
        if settled.all():
            break
        best = np.minimum(best, size)
        jacobian[lost], residual[lost] = np.eye(x.shape[1]), 0.0
        try:
            step = np.linalg.solve(jacobian, -residual[..., None])[..., 0]
        except np.linalg.LinAlgError:
            step = np.stack([np.linalg.lstsq(j, -r)[0] for j, r in zip(jacobian, residual, strict=True)])
        length = (np.abs(step) * metric).max(1)
        damping = np.minimum(1.0, stride / np.maximum(length, 1e-300))
        following = x + step * damping[:, None]
        x = np.where(np.isfinite(following).all(axis=1, keepdims=True), following, x)
    good = np.abs(system(x)[0]).max(1) < 1e-9 * scale
    return x, good


def _measure_unit_steps(jets: tuple[Array, ...]) -> Array:
    return np.concatenate([np.linalg.norm(j[1:3], axis=2).T for j in jets], axis=1)


def project_to_intersection(sides: tuple[SupportSurface, SupportSurface], stations: Stations, scale: float) -> Stations:
    """Move the stations onto the true intersection of the two surfaces, within their planes, and take its direction.

    Edges of CAD files lie on their faces to a tolerance only; the surfaces themselves are exact.
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
    x, good = solve_damped_newton(evaluate_system, start, scale, 0.1 * scale)
    if not good.all():
        where = stations.t[~good][0]
        raise GeometryError(f"the two surfaces do not cross cleanly at t = {where:.4g} of the edge")
    uv = (x[:, :2], x[:, 2:])
    point = sides[0].primary.jet(uv[0])[0]
    outer = cross_product(sides[0].primary.evaluate_normals(uv[0]), sides[1].primary.evaluate_normals(uv[1]))
    tau = normalise_vectors(outer) * np.sign((outer * stations.tangents).sum(1, keepdims=True))
    return Stations(stations.t, point, tau, uv)


def compute_inward_directions(
    sides: tuple[SupportSurface, SupportSurface], stations: Stations
) -> tuple[Array, Array, Array]:
    """Return the unit directions from the edge into both faces, (n, 3), and the sine of the turn: > 0 where convex.

    The stations run as the boundary of face 1 does: seen from outside, face 1 lies to their left.
    """
    n1, n2 = (side.outward * side.primary.evaluate_normals(uv) for side, uv in zip(sides, stations.uv, strict=True))
    into1 = cross_product(n1, stations.tangents)
    into2 = -cross_product(n2, stations.tangents)
    return into1, into2, -(into1 * n2).sum(1)


ContactAttempt = Callable[[Array, Array, Array], tuple[Array, Array]]
"""What tries to find contacts: from the indices of stations (m,), a size for each (m,) and where to start (m, k), the
contacts' parameters (m, k), and which of them are right."""


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of iterations that go astray
def grow_contacts(attempt: ContactAttempt, foot: Array, way: Array, metric: Array, size: float) -> tuple[Array, Array]:
    """Find contacts of the given size at all stations; return their parameters (n, k) and the sizes (n,) reached.

    Most are found at the first attempt, straight from the edge point ``foot`` (n, k) along the tangents ``way``, (n, k)
    for a unit of size. Where that fails the contacts grow: from a size so small that the faces are nearly flat, in
    steps of which each is expected to go on as the one before did. Those that cannot be followed to the end, as where a
    ball leaps over a dent, start from those of the next station.
    ``metric`` (n, k) is the length of a unit of each parameter in space.
    """
    x, good = attempt(np.arange(len(foot)), np.full(len(foot), size), foot + size * way)
    reached = np.where(good, size, 0.0)
    if good.all():
        return x, reached

    def correct_prediction(i: Array, sizes: Array, expected: Array, before: Array) -> Array:
        """Try stations i; take what is found next to what was expected."""
        found, fine = attempt(i, sizes, expected)
        moved, missed = (np.linalg.norm(step * metric[i], axis=1) for step in (expected - before, found - expected))
        fine &= missed <= moved / 2
        x[i[fine]], reached[i[fine]] = found[fine], sizes[fine]
        return fine

    growing = np.flatnonzero(~good)
    small = np.full(len(growing), size * FIRST_SIZE_SHARE)
    growing = growing[correct_prediction(growing, small, foot[growing] + small[:, None] * way[growing], foot[growing])]
    before, at, factor = foot.copy(), np.zeros(len(foot)), np.full(len(foot), 2.0)
    while len(growing):
        here, had = x[growing], reached[growing]
        sizes = np.minimum(factor[growing] * had, size)
        slope = (here - before[growing]) / (had - at[growing])[:, None]
        fine = correct_prediction(growing, sizes, here + slope * (sizes - had)[:, None], here)
        before[growing[fine]], at[growing[fine]] = here[fine], had[fine]
        factor[growing] = np.where(fine, np.minimum(factor[growing] ** 1.5, 2.0), factor[growing] ** 0.25)
        growing = growing[(reached[growing] < size) & (factor[growing] > 1 + FIRST_SIZE_SHARE)]
    spread = True
    while spread:
        spread = False
        for side in (-1, 1):
            i = np.flatnonzero(reached < size)
            i = i[(i + side >= 0) & (i + side < len(foot))]
            i = i[reached[i + side] == size]
            if len(i):
                beside = foot[i] + x[i + side] - foot[i + side]
                spread |= bool(correct_prediction(i, np.full(len(i), size), beside, foot[i]).any())
    return x, reached


def _make_size_error(what: str, stations: Stations, reached: Array, size: float) -> SizeError:
    """Return the error for contacts that were not found."""
    short = np.flatnonzero(reached < size)
    first = short[reached[short].argmin()]
    most = f", one of {reached[first]:.3g} does" if reached[first] > 0 else ""
    return SizeError(f"{what} at t = {stations.t[first]:.4g} of the edge{most}")


def _express_in_parameters(
    sides: tuple[SupportSurface, SupportSurface], stations: Stations, vectors: Sequence[Array]
) -> tuple[Array, Array, Array]:
    """Return the edge points in both faces' parameters, vectors (n, 3) of each side in them, and the metric: (n, 4)."""
    jets = tuple(side.primary.jet(uv) for side, uv in zip(sides, stations.uv, strict=True))
    ways = [to_tangent_coordinates(jet, vector) for jet, vector in zip(jets, vectors, strict=True)]
    return np.concatenate(stations.uv, axis=1), np.concatenate(ways, axis=1), _measure_unit_steps(jets)


def solve_ball_contacts(sides: tuple[SupportSurface, SupportSurface], stations: Stations, radius: float) -> Contacts:
    """Return where a ball of the given radius, its centre in each station's plane, touches both surfaces.

    Solves S1 + R m1 = S2 + R m2 with (centre - X).tau = 0, m the unit normals towards the ball: into the material at a
    convex edge, out of it at a concave one. The length of the cross derivatives is 4 R tan(theta/4), theta the opening
    of the arc, which makes a cubic Hermite section the best-known approximation of the arc.
    """
    into1, into2, turn = compute_inward_directions(sides, stations)
    on_edge = (stations.t >= 0) & (stations.t <= 1)  # past an end at which it fades out, convexity may change
    turns = turn[on_edge] if on_edge.any() else turn
    if turns.max() > SMOOTH_EDGE_SINE and turns.min() < -SMOOTH_EDGE_SINE:
        raise GeometryError("the edge changes between convex and concave; a ball cannot roll along it")
    sign = np.array([-np.sign(turns.sum()) * side.outward for side in sides])
    half = np.arccos(np.clip(-(into1 * into2).sum(1), -1, 1)) / 2

    def attempt_ball_contacts(index: Array, sizes: Array, start: Array) -> tuple[Array, Array]:
        point, tau, r = stations.points[index], stations.tangents[index], sizes[:, None]

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            jets = (sides[0].primary.jet(x[:, :2]), sides[1].primary.jet(x[:, 2:]))
            centre, rates = [], []
            for i in BOTH_SIDES:
                n, nu, nv = _differentiate_normal_unchecked(jets[i])
                centre.append(jets[i][0] + r * sign[i] * n)
                rates += [jets[i][1] + r * sign[i] * nu, jets[i][2] + r * sign[i] * nv]
            middle = (centre[0] + centre[1]) / 2 - point
            residual = np.concatenate([centre[0] - centre[1], (middle * tau).sum(1, keepdims=True)], 1)
            jacobian = np.zeros((len(x), 4, 4))
            for column, rate in enumerate(rates):
                jacobian[:, :3, column] = rate if column < 2 else -rate
                jacobian[:, 3, column] = (rate * tau).sum(1) / 2
            return residual, jacobian, _measure_unit_steps(jets)

        x, good = solve_damped_newton(evaluate_system, start, sizes, sizes)
        normals = []
        for i, into in ((0, into1), (1, into2)):
            jet = sides[i].primary.jet(x[:, 2 * i : 2 * i + 2])
            normals.append(sign[i] * _differentiate_normal_unchecked(jet)[0])
            good &= ((jet[0] - point) * into[index]).sum(1) > 0
        good &= measure_opening(*normals) > 1e-9
        return x, good

    def measure_opening(m1: Array, m2: Array) -> Array:
        return np.arctan2(np.linalg.norm(cross_product(m1, m2), axis=1), (m1 * m2).sum(1))

    foot, way, metric = _express_in_parameters(
        sides, stations, (into1 * np.tan(half)[:, None], into2 * np.tan(half)[:, None])
    )
    x, reached = grow_contacts(attempt_ball_contacts, foot, way, metric, radius)
    if reached.min() < radius:
        smooth = (reached == 0) & (np.abs(turn) < SMOOTH_EDGE_SINE)
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
    foot, way, metric = _express_in_parameters(sides, stations, into)
    found = []
    for i, (side, width) in enumerate(zip(sides, widths, strict=True)):
        primary, direction, mine = side.primary, into[i], slice(2 * i, 2 * i + 2)

        def attempt_setback_contacts(
            index: Array, sizes: Array, start: Array, primary: Primary = primary, direction: Array = direction
        ) -> tuple[Array, Array]:
            point, tau = stations.points[index], stations.tangents[index]

            def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
                jet = primary.jet(x)
                offset = jet[0] - point
                distance = np.linalg.norm(offset, axis=1, keepdims=True)
                residual = np.concatenate([distance - sizes[:, None], (offset * tau).sum(1, keepdims=True)], 1)
                radial = offset / distance
                rows = [np.stack([(jet[1] * w).sum(1), (jet[2] * w).sum(1)], -1) for w in (radial, tau)]
                return residual, np.stack(rows, 1), _measure_unit_steps((jet,))

            x, good = solve_damped_newton(evaluate_system, start, sizes, sizes)
            good &= ((primary.jet(x)[0] - point) * direction[index]).sum(1) > 0
            return x, good

        x, reached = grow_contacts(attempt_setback_contacts, foot[:, mine], way[:, mine], metric[:, mine], width)
        if reached.min() < width:
            raise _make_size_error(
                f"no point of the face lies at width {width:g} from the edge", stations, reached, width
            )
        found.append(x)
    chord = sides[1].primary.jet(found[1])[0] - sides[0].primary.jet(found[0])[0]
    shares = 2 * np.array(widths) / sum(widths)
    return Contacts(
        stations.t, stations.points, (found[0], found[1]), np.multiply.outer(shares, np.linalg.norm(chord, axis=1))
    )
