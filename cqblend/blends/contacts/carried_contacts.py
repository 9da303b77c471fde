"""Contacts along edges at which one station tells all: those that a translation or a rotation maps onto themselves.

Between two planes, at a ruling of a cylinder, or around an axis that both surfaces have, the contacts of all stations
are those of one, moved. That is decided from the surfaces, not from samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, Stations, SupportSurface
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.surfaces.motions import Motion
from cqblend.surfaces.quadrics import Cone, Cylinder, Plane, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse, RevolvedSpline
from cqblend.surfaces.vectors import cross_product


@dataclass(frozen=True)
class EdgeMotion:
    """A motion along an edge that maps both surfaces onto themselves.

    It moves the point of the edge at t to that at t + 1 by the amount ``rate`` (mm or rad).
    """

    motion: Motion
    rate: float

    def carry_contacts(self, one: Contacts, sides: tuple[SupportSurface, SupportSurface], t: Array) -> Contacts:
        """Return the contacts at parameters t (n,), of those at a single one."""
        if one.edge_uv is None:
            raise TypeError("these contacts do not tell the parameters of the points of the edge")
        amounts = self.rate * (t - one.t[0])
        points = np.concatenate([one.uv[0], one.uv[1], one.edge_uv.reshape(2, 2)])
        first, second, *edge = (
            _carry_parameters(sides[i % 2], uv, self.motion, amounts) for i, uv in enumerate(points)
        )
        return Contacts(
            t,
            self.motion.move_point(one.edge_points[0], amounts),
            (first, second),
            one.cross_lengths.repeat(len(t), axis=1),
            edge_uv=np.concatenate(edge, axis=1),
        )


def find_edge_motion(
    sides: tuple[SupportSurface, SupportSurface], station: Stations, length: float
) -> EdgeMotion | None:
    """Return the motion along an edge of that length (mm) that maps both surfaces onto themselves, if there is one.

    ``station`` is a single one, on both surfaces.
    """
    point, tangent = station.points[0], station.tangents[0]
    motion = Motion(tangent)
    if not _maps_both(sides, station, motion):
        axis = _find_common_axis(sides)
        if axis is None or not _maps_both(sides, station, axis) or axis.centre is None:
            return None
        velocity = cross_product(axis.direction, point - axis.centre)
        radius = float(np.linalg.norm(velocity))
        if radius == 0:
            return None
        turn = length / radius
        if abs(turn - 2 * np.pi) < CONTACT_TOLERANCES.full_turn_slack:
            turn = 2 * np.pi
        return EdgeMotion(axis, float(turn * np.sign(velocity @ tangent)))
    return EdgeMotion(motion, length)


def _carry_parameters(side: SupportSurface, uv: Array, motion: Motion, amounts: Array) -> Array:
    """Return the native parameters (n, 2) of a moved point, on a surface that is mapped onto itself."""
    carried = side.primary.carry_parameters(uv, motion, amounts)
    if carried is None:
        raise ValueError("the motion does not map the surface onto itself")
    return carried


def _maps_both(sides: tuple[SupportSurface, SupportSurface], station: Stations, motion: Motion) -> bool:
    """Whether a motion is known to map both surfaces onto themselves."""
    still = np.zeros(1)
    return all(
        side.primary.carry_parameters(uv[0], motion, still) is not None
        for side, uv in zip(sides, station.uv, strict=True)
    )


def _find_common_axis(sides: tuple[SupportSurface, SupportSurface]) -> Motion | None:
    """Return the only rotation that may map both surfaces onto themselves."""
    first, second = (side.primary for side in sides)
    for one in (first, second):
        if isinstance(one, Cylinder | Cone | RevolvedEllipse | RevolvedSpline):
            axis = one.frame.axes[2]
            return Motion(axis / np.linalg.norm(axis), one.frame.origin)
    for one, other in ((first, second), (second, first)):
        if isinstance(one, Sphere):
            if isinstance(other, Plane):
                return Motion(other.frame.axes[2], one.frame.origin)
            if isinstance(other, Sphere):
                line = other.frame.origin - one.frame.origin
                distance = np.linalg.norm(line)
                return Motion(line / distance, one.frame.origin) if distance > 0 else None
    return None
