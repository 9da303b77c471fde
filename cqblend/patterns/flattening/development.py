r"""Maps of ruled strips to the plane that keep rulings straight, and the lengths of rulings and of both rails.

A ruled strip between C1 and C2, with rulings D = l e, moves along its rails with the velocities C_i'. Split them along
and across the ruling: C_i' = p_i e + v_i. In the plane the ruling turns by psi, and the same parts of the velocities
are kept:

.. math::

    \psi' = \frac{\|v_1\| - \|v_2\|}{l}, \qquad
    A' = e^{i \psi} \left( p_1 - i \|v_1\| \right), \qquad
    B = A + l\, e^{i \psi}

Then \|B'\| = \|C2'\|. So both rails keep their lengths, rulings keep theirs, and rails meet rulings at the angles they
have in space, whether or not the strip is developable. If it is, v_1 and v_2 are parallel, psi' is the rotation of the
ruling against parallel transport, and the map is the isometry: psi and the angle between rail and ruling together turn
by the rail's geodesic curvature. If it is not, this is the limit of strips of triangles, along either diagonal of their
quadrilaterals, and of the mean of both, as they become narrow; lengths across the rulings are then too long inside the
strip, at most by the factor 1 / cos(phi / 2), where phi is the angle between v_1 and v_2. Geodesic curvatures
themselves, which need second derivatives and fail where a rail stops, are not needed.

Planes, cylinders and cones have closed forms: an affine map, and the arc length of a section across the rulings, or of
the directions of the rulings. They hold also where rulings shrink to nothing. Points in the plane are complex numbers
in this module. Depends on nothing that samples these maps.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from cqblend.errors import GeometryError, InputError
from cqblend.patterns.flattening.arc_length import ArcLength
from cqblend.patterns.flattening.tolerances import FLATTENING_TOLERANCES
from cqblend.patterns.strips.developability import (
    RailPair,
    StripKind,
    find_apex,
    find_plane_normal,
    find_ruling_direction,
    stack_rail_and_ruling,
)
from cqblend.splines import Curve
from cqblend.splines.antiderivative import Antiderivative, gauss_rule
from cqblend.splines.bernstein import Array

RailDevelopment: TypeAlias = Callable[[Array], tuple[Array, Array]]
"""Map of parameters (m,) to the points of both rails in the plane, (m,) complex each. The first ruling points up, and
the map from (t, w) to the plane has a positive Jacobian."""


@dataclass(frozen=True, slots=True, eq=False)
class RulingState:
    """How rulings move at m parameters: the quantities of the module's formula.

    Attributes
    ----------
    length
        l, (m,), mm.
    direction
        e, (m, 3); zero where the ruling is a point.
    across_first, across_second
        v_1 and v_2, (m, 3).
    along_first
        p_1, (m,).
    """

    length: Array
    direction: Array
    across_first: Array
    across_second: Array
    along_first: Array


class RulingMotion:
    """How the rulings between two rails move, from which flat strips and areas are computed.

    Parameters
    ----------
    rails
        C1 and C2.
    refuse_crossing_rulings
        Whether rulings that meet inside the strip are an error.
    """

    __slots__ = ("rail_and_ruling", "refuse_crossing_rulings")

    def __init__(self, rails: RailPair, *, refuse_crossing_rulings: bool = True) -> None:
        self.rail_and_ruling, self.refuse_crossing_rulings = stack_rail_and_ruling(rails), refuse_crossing_rulings

    def __call__(self, t: Array) -> RulingState:
        """Return the state of the rulings at parameters t (m,).

        Raises
        ------
        GeometryError
            If rulings meet inside the strip, or the normal turns by a right angle along one; the message says where.
        """
        value, rate = self.rail_and_ruling.jet(t, 1)
        ruling = value[:, 3:]
        length = np.linalg.norm(ruling, axis=1)
        e = np.divide(ruling, length[:, None], out=np.zeros_like(ruling), where=length[:, None] > 0)
        along = (rate[:, :3] * e).sum(axis=1)
        v1 = rate[:, :3] - along[:, None] * e
        change = rate[:, 3:] - (rate[:, 3:] * e).sum(axis=1)[:, None] * e
        v2 = v1 + change
        cosine, squares = (v1 * v2).sum(axis=1), (v1 * v1).sum(axis=1) + (v2 * v2).sum(axis=1)
        is_bad = cosine < -FLATTENING_TOLERANCES.opposed_velocities * squares
        if self.refuse_crossing_rulings and is_bad.any():
            raise GeometryError(
                f"the strip cannot be laid flat at t = {t[is_bad][0]:.9g}: its rulings meet between the rails, or its "
                "normal turns by more than a right angle along a ruling; divide it into narrower strips"
            )
        return RulingState(length, e, v1, v2, along)

    def compute_area_rates(self, t: Array) -> tuple[Array, Array]:
        """Return the derivatives by t of the flat area and of that in space, (m,) each."""
        state = self(t)
        v1, v2 = state.across_first, state.across_second
        flat = state.length * (np.linalg.norm(v1, axis=1) + np.linalg.norm(v2, axis=1)) / 2
        w, weights = gauss_rule(6)
        across = np.linalg.norm(v1[:, None] + w[:, None] * (v2 - v1)[:, None], axis=2)
        return flat, state.length * (across @ weights)


def strain_from_turn(turn: float) -> float:
    r"""Return the largest relative excess of lengths inside a flat strip over those in space.

    .. math:: \frac{1}{\cos(\varphi / 2)} - 1

    Parameters
    ----------
    turn
        phi, the largest angle between the normals at the ends of a ruling, rad; infinite from a right angle on.

    Examples
    --------
    >>> round(strain_from_turn(np.arctan(0.5)), 4)
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
    """Return the affine map of a plane."""
    normal = find_plane_normal(rails)
    if normal is None:
        raise InputError("the strip was said to be planar, and is not")
    rail_and_ruling = stack_rail_and_ruling(rails)
    t = (rail_and_ruling.breaks[:-1] + gauss_rule(4)[0][:, None] * np.diff(rail_and_ruling.breaks)).ravel()
    value, rate = rail_and_ruling.jet(t, 1)
    if np.cross(2 * rate[:, :3] + rate[:, 3:], value[:, 3:]).sum(axis=0) @ normal < 0:
        normal = -normal
    up = value[np.linalg.norm(value[:, 3:], axis=1).argmax(), 3:]
    up = up - (up @ normal) * normal
    up /= np.linalg.norm(up)
    frame = np.cross(up, normal) + 1j * up
    origin = value[0, :3]

    def map_rails(t: Array) -> tuple[Array, Array]:
        value = rail_and_ruling(t)
        first = (value[:, :3] - origin) @ frame
        return first, first + value[:, 3:] @ frame

    return map_rails


def _develop_cylinder(rails: RailPair) -> RailDevelopment:
    """Return the map of a cylinder: x is the arc length of its section, y the height along the rulings."""
    direction = find_ruling_direction(rails)
    if direction is None:
        raise InputError("the strip was said to be a cylinder, and is not")
    rail_and_ruling = stack_rail_and_ruling(rails)
    across = np.linalg.svd(direction[None])[2][1:]
    section = ArcLength(_project_rail(rail_and_ruling, across))
    origin = rail_and_ruling(rail_and_ruling.domain[0])[:3] @ direction

    def map_rails(t: Array) -> tuple[Array, Array]:
        value = rail_and_ruling(t)
        first = section(t) + 1j * (value[:, :3] @ direction - origin)
        return first, first + 1j * (value[:, 3:] @ direction)

    return map_rails


def _project_rail(rail_and_ruling: Curve, frame: Array) -> Curve:
    """Return the first rail in the coordinates of k axes (k, 3)."""
    coefs = np.einsum("kc,pcn->pkn", frame, rail_and_ruling.coefs[:, :3])
    if rail_and_ruling.rational:
        coefs = np.concatenate([coefs, rail_and_ruling.coefs[:, 6:]], axis=1)
    return Curve(
        rail_and_ruling.breaks, coefs, rational=rail_and_ruling.rational, continuity=rail_and_ruling.continuity
    )


def _develop_cone(rails: RailPair) -> RailDevelopment:
    """Return the map of a cone to polar coordinates about its apex: distance, arc length of the ruling directions."""
    apex = find_apex(rails)
    if apex is None:
        raise InputError("the strip was said to be a cone, and is not")
    rail_and_ruling = stack_rail_and_ruling(rails)

    def apex_distances(value: Array) -> tuple[Array, Array]:
        """Return the distances of both rails from the apex, negative beyond it."""
        first = value[:, :3] - apex
        middle = first + value[:, 3:] / 2
        direction = middle / np.linalg.norm(middle, axis=1)[:, None]
        inner = (first * direction).sum(axis=1)
        return inner, inner + (value[:, 3:] * direction).sum(axis=1)

    def turning_rate(t: Array) -> Array:
        value, rate = rail_and_ruling.jet(t, 1)
        middle, change = value[:, :3] - apex + value[:, 3:] / 2, rate[:, :3] + rate[:, 3:] / 2
        return np.asarray(np.linalg.norm(np.cross(middle, change), axis=1) / (middle * middle).sum(axis=1))

    angle = Antiderivative(turning_rate, rail_and_ruling.breaks, 1.0)
    t = np.linspace(*rail_and_ruling.domain, 64)
    first, second = apex_distances(rail_and_ruling(t))
    farthest = np.maximum(np.abs(first), np.abs(second)).max()
    is_bad = np.minimum(first, second) < -FLATTENING_TOLERANCES.behind_apex * farthest
    if is_bad.any():
        raise GeometryError(
            f"the strip cannot be laid flat at t = {t[is_bad][0]:.9g}: all its rulings pass through one point between "
            "the rails; divide it there"
        )
    outward = 1.0 if (second - first).sum() > 0 else -1.0
    origin = (
        1j * outward * apex_distances(rail_and_ruling(rail_and_ruling.breaks[:1]))[0]
    )  # the strip may be far from its apex

    def map_rails(t: Array) -> tuple[Array, Array]:
        first, second = apex_distances(rail_and_ruling(t))
        direction = 1j * outward * np.exp(-1j * outward * angle(t))
        return first * direction - origin, second * direction - origin

    return map_rails


def _develop_general(rails: RailPair) -> RailDevelopment:
    """Return the map of any strip, by integrating the velocities of the module's formula."""
    motion = RulingMotion(rails)
    breaks = motion.rail_and_ruling.breaks

    def turning_rate(t: Array) -> Array:
        state = motion(t)
        v1, v2 = state.across_first, state.across_second
        speeds = np.linalg.norm(v1, axis=1) + np.linalg.norm(v2, axis=1)
        # |v1| - |v2| without its cancellation
        difference = ((v1 - v2) * (v1 + v2)).sum(axis=1)
        divisor = speeds * state.length
        return np.divide(difference, divisor, out=np.zeros(len(t)), where=divisor > 0)

    angle = Antiderivative(turning_rate, breaks, 1.0)

    def rail_velocity(t: Array) -> Array:
        state = motion(t)
        return np.asarray(
            1j * np.exp(1j * angle(t)) * (state.along_first - 1j * np.linalg.norm(state.across_first, axis=1))
        )

    longest_ruling = np.linalg.norm(motion.rail_and_ruling(breaks)[:, 3:], axis=1).max()
    first = Antiderivative(rail_velocity, breaks, float(longest_ruling))

    def map_rails(t: Array) -> tuple[Array, Array]:
        start = first(t)
        length = np.linalg.norm(motion.rail_and_ruling(t)[:, 3:], axis=1)
        return start, start + 1j * length * np.exp(1j * angle(t))

    return map_rails
