"""Contacts of a ball that rolls along a given curve and touches one surface: where a rail is held on that curve.

The ball has the given radius, passes through a point p of the curve, and touches the curve there: with its centre c,
|c - p| = R and (c - p) . p' = 0. It touches the surface at S(u, v) = c + R n. All points are solved at once by a damped
Newton method for (u, v).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cqblend.blends.contacts.contact_solver import SupportSurface
from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.contacts.surface_normals import differentiate_normals
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.errors import SizeError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, measure_lengths, normalise_vectors, to_tangent_coordinates


@dataclass(frozen=True)
class HeldPoints:
    """Points (n, 3) of the curve, its unit tangents there, and points (n, 3) of the surface near by.

    ``near_uv`` (n, 2) are the parameters of these points, ``into_face`` (n, 3) unit vectors from there into the face,
    away from the edge that is blended.
    """

    points: Array
    tangents: Array
    near_points: Array
    near_uv: Array
    into_face: Array


@dataclass(frozen=True)
class HeldContacts:
    """Where balls touch the surface, ``uv`` (n, 2), and their arcs from there to the points of the curve.

    ``directions`` (n, 3) are the unit tangents of these arcs at the curve, ``angles`` (n,) how far they turn (rad).
    """

    uv: Array
    directions: Array
    angles: Array


def solve_held_contacts(side: SupportSurface, held: HeldPoints, radius: float, *, is_convex: bool) -> HeldContacts:
    """Solve for the contacts of balls of a radius (mm), inside the solid if the edge ``is_convex``, else outside.

    Raises
    ------
    SizeError
        If a ball does not reach from the curve to the surface.
    """
    inner = -side.outward if is_convex else side.outward  # from the surface to the centre, times Su x Sv
    jet = side.primary.jet(held.near_uv)
    normal = inner * normalise_vectors(cross_product(jet[1], jet[2]))
    height = ((held.points - held.near_points) * normal).sum(1)
    reach = radius**2 - (radius - height) ** 2
    if not np.all((reach > 0) & (height > 0)):
        least = float(np.max(height)) / 2
        raise SizeError(
            f"radius {radius:g} does not reach from the held edge to the face: it must be above about {least:.4g}",
            kind="too small",
            value=radius,
        )
    start = held.near_uv + to_tangent_coordinates(
        jet, held.points - height[:, None] * normal + np.sqrt(reach)[:, None] * held.into_face - held.near_points
    )
    uv, good = _solve_from(side, held, np.full(len(start), radius), start, inner)
    if not good.all():
        uv, good = _grow_balls(side, held, radius, height, inner)
    if not good.all():
        raise SizeError(f"radius {radius:g}: no ball rolls along the held edge and touches the face", value=radius)
    jet = side.primary.jet(uv)
    centre = jet[0] + inner * radius * normalise_vectors(cross_product(jet[1], jet[2]))
    arm, far = (held.points - centre) / radius, (jet[0] - centre) / radius
    cosine = (arm * far).sum(1)
    across = far - cosine[:, None] * arm
    return HeldContacts(uv, normalise_vectors(across), np.arctan2(measure_lengths(across), cosine))


def _solve_from(
    side: SupportSurface, held: HeldPoints, radii: Array, start: Array, inner: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Solve for the contacts (n, 2) of balls of given radii (n,), starting from some; also tell which were found."""

    def evaluate_system(uv: Array) -> tuple[Array, Array, Array]:
        jets = side.primary.jet(uv)
        normals, by_u, by_v = differentiate_normals(jets[None])[:, 0]
        arms = inner * radii[:, None]
        from_point = jets[0] + arms * normals - held.points
        steps = [jets[1] + arms * by_u, jets[2] + arms * by_v]
        residual = np.stack([((from_point**2).sum(1) / radii - radii) / 2, (from_point * held.tangents).sum(1)], axis=1)
        jacobian = np.stack(
            [np.stack([(from_point * step).sum(1) / radii, (step * held.tangents).sum(1)], axis=1) for step in steps],
            axis=2,
        )
        return residual, jacobian, measure_lengths(jets[1:3]).T

    return solve_damped_newton(evaluate_system, start, radii, radii)


def _grow_balls(
    side: SupportSurface, held: HeldPoints, radius: float, height: Array, inner: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Solve for the contacts by balls that grow, from little more than the least that reach the surface."""
    least = np.minimum(CONTACT_TOLERANCES.least_held_radius * height, radius)
    jet = side.primary.jet(held.near_uv)
    uv = held.near_uv + to_tangent_coordinates(jet, height[:, None] * held.into_face / 2)
    good = np.zeros(len(uv), dtype=bool)
    for share in np.linspace(0, 1, CONTACT_TOLERANCES.held_growth_steps + 1):
        uv, good = _solve_from(side, held, least * (radius / least) ** share, uv, inner)
    return uv, good
