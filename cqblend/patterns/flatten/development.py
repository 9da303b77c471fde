r"""Maps that lay a ruled strip flat with every ruling straight and of its length, and both rails of theirs.

A ruled strip between C1 and C2, with rulings D = l e, moves along its rails with the velocities C_i'. Split them along
and across the ruling: C_i' = p_i e + v_i. In the plane the ruling turns by psi, and the same parts of the velocities
are kept in it:

.. math::

    \psi' = \frac{\|v_1\| - \|v_2\|}{l}, \qquad
    A' = e^{i \psi} \left( p_1 - i \|v_1\| \right), \qquad
    B = A + l\, e^{i \psi}

Then \|B'\| = \|C2'\|. So both rails keep their lengths, rulings keep theirs, and rails meet rulings at the angles they
have in space, whatever the strip is. If it is developable, v_1 and v_2 are parallel, psi' is the rotation of the ruling
against parallel transport, and the map is the isometry: psi and the angle between rail and ruling together turn by
the rail's geodesic curvature. If it is not, this is the limit of strips of triangles, along either diagonal of their
quadrilaterals, and of the mean of both, as they become narrow; lengths across the rulings are then too long inside the
strip, at most by the factor 1 / cos(phi / 2), where phi is the angle between v_1 and v_2. Geodesic curvatures
themselves, which need second derivatives and fail where a rail stops, are not needed.

Planes, cylinders and cones have closed forms: an affine map, and the arc length of a section across the rulings, or of
the directions of the rulings. They hold also where rulings shrink to nothing. Points in the plane are complex numbers
in this module. It must not know how maps are sampled, nor what for.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from cqblend.errors import GeometryError, InputError
from cqblend.patterns.flatten.arc_length import ArcLength
from cqblend.patterns.strips.developability import (
    RailPair,
    StripKind,
    find_apex,
    find_plane_normal,
    find_ruling_direction,
    stack_rail_and_ruling,
)
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.integral import Antiderivative, gauss_rule

RailDevelopment: TypeAlias = Callable[[Array], tuple[Array, Array]]
"""Where the two rails are in the plane, (m,) complex each, at parameters (m,). The first ruling points up, and the map
from (t, w) to the plane has a positive Jacobian."""


class RulingMotion:
    """How the rulings between two rails move: what both laying them flat and areas are made of.

    Attributes
    ----------
    both
        (C1, D) as a curve of dim 6.
    checked
        Whether rulings that meet inside the strip are refused.
    """

    __slots__ = ("both", "checked")

    def __init__(self, rails: RailPair, *, checked: bool = True) -> None:
        self.both, self.checked = stack_rail_and_ruling(rails), checked

    def __call__(self, t: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return l (m,), e (m, 3), v_1 and v_2 (m, 3), and p_1 (m,).

        Raises
        ------
        GeometryError
            If rulings meet inside the strip, or the normal turns by a right angle along one; the message says where.
        """
        value, rate = self.both.jet(t, 1)
        ruling = value[:, 3:]
        length = np.linalg.norm(ruling, axis=1)
        e = np.divide(ruling, length[:, None], out=np.zeros_like(ruling), where=length[:, None] > 0)
        along = (rate[:, :3] * e).sum(axis=1)
        v1 = rate[:, :3] - along[:, None] * e
        change = rate[:, 3:] - (rate[:, 3:] * e).sum(axis=1)[:, None] * e
        v2 = v1 + change
        cosine, reach = (v1 * v2).sum(axis=1), (v1 * v1).sum(axis=1) + (v2 * v2).sum(axis=1)
        bad = cosine < -1e-9 * reach
        if self.checked and bad.any():
            raise GeometryError(
                f"the strip cannot be laid flat at t = {t[bad][0]:.9g}: its rulings meet between the rails, or its "
                "normal turns by more than a right angle along a ruling; divide it into narrower strips"
            )
        return length, e, v1, v2, along

    def compute_area_rates(self, t: Array) -> tuple[Array, Array]:
        """Return by what the areas grow with t, flat and in space, (m,) each."""
        length, _, v1, v2, _ = self(t)
        flat = length * (np.linalg.norm(v1, axis=1) + np.linalg.norm(v2, axis=1)) / 2
        w, weights = gauss_rule(6)
        across = np.linalg.norm(v1[:, None] + w[:, None] * (v2 - v1)[:, None], axis=2)
        return flat, length * (across @ weights)


def strain_from_turn(turn: float) -> float:
    r"""Return by how much lengths inside a strip are too long in the plane at most, relative to those in space.

    .. math:: \frac{1}{\cos(\varphi / 2)} - 1

    Parameters
    ----------
    turn
        phi, the largest angle between the normals at the ends of a ruling, rad; infinite from a right angle on.

    Examples
    --------
    >>> round(max_strain(np.arctan(0.5)), 4)
    0.0275
    """
    return float(2 * np.sin(turn / 4) ** 2 / np.cos(turn / 2)) if np.isfinite(turn) else np.inf


def develop_rails(rails: RailPair, kind: StripKind) -> RailDevelopment:
    """Return the map of a strip of a known kind.

    Raises
    ------
    InputError
        If the strip is not of that kind.
    GeometryError
        If rulings meet inside it; the message says at which parameter.

    References
    ----------
    Elber (1995), section 2, where the strip is approximated by triangles.
    """
    maps = {
        "plane": _develop_plane,
        "cylinder": _develop_cylinder,
        "cone": _develop_cone,
        "tangent": _develop_general,
        "twisted": _develop_general,
    }
    return maps[kind](rails)


def _develop_plane(rails: RailPair) -> RailDevelopment:
    normal = find_plane_normal(rails)
    if normal is None:
        raise InputError("the strip was said to be planar, and is not")
    both = stack_rail_and_ruling(rails)
    t = (both.breaks[:-1] + gauss_rule(4)[0][:, None] * np.diff(both.breaks)).ravel()
    value, rate = both.jet(t, 1)
    if np.cross(2 * rate[:, :3] + rate[:, 3:], value[:, 3:]).sum(axis=0) @ normal < 0:
        normal = -normal
    up = value[np.linalg.norm(value[:, 3:], axis=1).argmax(), 3:]
    up = up - (up @ normal) * normal
    up /= np.linalg.norm(up)
    frame = np.cross(up, normal) + 1j * up
    origin = value[0, :3]

    def map_rails(t: Array) -> tuple[Array, Array]:
        value = both(t)
        first = (value[:, :3] - origin) @ frame
        return first, first + value[:, 3:] @ frame

    return map_rails


def _develop_cylinder(rails: RailPair) -> RailDevelopment:
    direction = find_ruling_direction(rails)
    if direction is None:
        raise InputError("the strip was said to be a cylinder, and is not")
    both = stack_rail_and_ruling(rails)
    across = np.linalg.svd(direction[None])[2][1:]
    section = ArcLength(_project_rail(both, across))
    origin = both(both.domain[0])[:3] @ direction

    def map_rails(t: Array) -> tuple[Array, Array]:
        value = both(t)
        first = section(t) + 1j * (value[:, :3] @ direction - origin)
        return first, first + 1j * (value[:, 3:] @ direction)

    return map_rails


def _project_rail(both: Curve, frame: Array) -> Curve:
    """First rail in a frame (k, 3)."""
    coefs = np.einsum("kc,pcn->pkn", frame, both.coefs[:, :3])
    if both.rational:
        coefs = np.concatenate([coefs, both.coefs[:, 6:]], axis=1)
    return Curve(both.breaks, coefs, rational=both.rational, continuity=both.continuity)


def _develop_cone(rails: RailPair) -> RailDevelopment:
    point = find_apex(rails)
    if point is None:
        raise InputError("the strip was said to be a cone, and is not")
    both = stack_rail_and_ruling(rails)

    def apex_distances(value: Array) -> tuple[Array, Array]:
        """Distances of the rails from the apex, negative beyond it."""
        first = value[:, :3] - point
        middle = first + value[:, 3:] / 2
        direction = middle / np.linalg.norm(middle, axis=1)[:, None]
        inner = (first * direction).sum(axis=1)
        return inner, inner + (value[:, 3:] * direction).sum(axis=1)

    def turning_rate(t: Array) -> Array:
        value, rate = both.jet(t, 1)
        middle, change = value[:, :3] - point + value[:, 3:] / 2, rate[:, :3] + rate[:, 3:] / 2
        return np.asarray(np.linalg.norm(np.cross(middle, change), axis=1) / (middle * middle).sum(axis=1))

    angle = Antiderivative(turning_rate, both.breaks, 1.0)
    t = np.linspace(*both.domain, 64)
    first, second = apex_distances(both(t))
    reach = np.maximum(np.abs(first), np.abs(second)).max()
    bad = np.minimum(first, second) < -1e-9 * reach
    if bad.any():
        raise GeometryError(
            f"the strip cannot be laid flat at t = {t[bad][0]:.9g}: all its rulings pass through one point between the "
            "rails; divide it there"
        )
    outward = 1.0 if (second - first).sum() > 0 else -1.0
    origin = 1j * outward * apex_distances(both(both.breaks[:1]))[0]  # the strip may be far from its apex

    def map_rails(t: Array) -> tuple[Array, Array]:
        first, second = apex_distances(both(t))
        direction = 1j * outward * np.exp(-1j * outward * angle(t))
        return first * direction - origin, second * direction - origin

    return map_rails


def _develop_general(rails: RailPair) -> RailDevelopment:
    motion = RulingMotion(rails)
    breaks = motion.both.breaks

    def turning_rate(t: Array) -> Array:
        length, _, v1, v2, _ = motion(t)
        speeds = np.linalg.norm(v1, axis=1) + np.linalg.norm(v2, axis=1)
        # |v1| - |v2| without its cancellation
        difference = ((v1 - v2) * (v1 + v2)).sum(axis=1)
        return np.divide(difference, speeds * length, out=np.zeros(len(t)), where=speeds * length > 0)

    angle = Antiderivative(turning_rate, breaks, 1.0)

    def rail_velocity(t: Array) -> Array:
        _, _, v1, _, along = motion(t)
        return np.asarray(1j * np.exp(1j * angle(t)) * (along - 1j * np.linalg.norm(v1, axis=1)))

    first = Antiderivative(rail_velocity, breaks, float(np.linalg.norm(motion.both(breaks)[:, 3:], axis=1).max()))

    def map_rails(t: Array) -> tuple[Array, Array]:
        start = first(t)
        length = np.linalg.norm(motion.both(t)[:, 3:], axis=1)
        return start, start + 1j * length * np.exp(1j * angle(t))

    return map_rails
