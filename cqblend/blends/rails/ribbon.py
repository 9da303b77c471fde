"""Ribbons: a rail on a surface and the cross directions along it, which make a blend exactly smooth with the surface.

A ribbon is a curve c(t) of lifted parameters on a primary surface S (see :mod:`cqblend.surfaces`) and directions d(t),
e(t), .. along it, also in lifted parameters: phi(t, v) = c + v d + v^2/2 e + .. . Whatever c, d and e are, a surface
whose derivatives by v at v = 0 are those of S(phi) meets S with as many orders of continuity. So c, d and e may be
approximate; nothing after them is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide, dehomogenise_derivatives
from cqblend.surfaces.primary_surface import Primary

BREAK_SIDES: tuple[BreakSide, BreakSide] = ("left", "right")
"""Both sides of a break, that with the smaller parameters first."""


@dataclass(frozen=True)
class SampledRail:
    """A rail ``c`` of lifted parameters on a primary surface, and native parameters ``uv`` (n, 2) at ``t`` (n,).

    The parameters are those that the rail was fitted to; with ``exact``, it runs through them.
    """

    primary: Primary
    c: Curve
    uv: Array
    t: Array
    exact: bool = False

    @cached_property
    def jet(self) -> Array:
        """The native jet of the surface at the samples, (6, n, 3)."""
        return self.primary.jet(self.uv)

    @cached_property
    def lifted_jet(self) -> Array:
        """Lifted points and their derivatives by t, (2, n, k)."""
        return self.c.jet(self.t, 1)

    @property
    def lifted(self) -> Array:
        """Lifted points, (n, k)."""
        return np.asarray(self.lifted_jet[0])

    @cached_property
    def own_jet(self) -> Array:
        """The native jet of the surface at the points of the rail itself, (6, n, 3)."""
        return self.jet if self.exact else self.primary.jet(self.primary.unlift_points(self.lifted, self.uv))

    def evaluate_tangents(self, directions: Array) -> Array:
        """Return the vectors (n, 3) in space of lifted directions (n, k) at the points of the rail.

        Not where only the parametrisation of the surface has a kink: there, they differ on both sides.
        """
        rs = self.primary.unlift_directions(self.lifted, directions)
        return np.asarray(rs[:, :1] * self.own_jet[1] + rs[:, 1:] * self.own_jet[2])


@dataclass(frozen=True)
class Ribbon:
    """A rail on a primary surface, and the directions along it in which a blend leaves the surface.

    Attributes
    ----------
    primary
        The surface.
    c
        The rail, a curve of lifted parameters.
    directions
        The directions d, e, .. into the blend, curves of lifted parameters; there is a d even if the order is 0.
    uv
        Native parameters at the breaks of c, (n, 2), continuous along the rail.
    order
        Order of continuity between blend and surface.
    direction, length
        Largest deviations of the fitted d from the wanted one: the angle (rad), and the length (relative).
    light
        Whether the rail is straight or circular, in few and long pieces: then terms of its jets cancel, and these are
        reduced to lower degrees.
    fades
        Whether cross derivatives may vanish somewhere: there, the joint stays as sharp as it was.
    joined
        Whether the blend is to share the sections at its ends with others, which follow it in a chain.
    bend
        Largest distance (mm) of the rail from where its contacts alone would lead it: it is bent where it would else
        meet that of another blend at an angle.
    roughness
        Largest angle (rad) between the faces on both sides of the smooth edges where the cell of a chain ends, and gap
        between them, as a share of the width of the blend: a chain cannot be smoother than these.
    """

    primary: Primary
    c: Curve
    directions: tuple[Curve, ...]
    uv: Array
    order: int = 1
    direction: float = 0.0
    length: float = 0.0
    light: bool = False
    fades: bool = False
    joined: bool = False
    roughness: float = 0.0
    bend: float = 0.0

    def find_native_parameters(self, t: Array) -> Array:
        """Return the native parameters (n, 2) at t, continuous along the rail."""
        near = np.stack([np.interp(t, self.c.breaks, column) for column in self.uv.T], -1)
        return self.primary.unlift_points(self.c(t), near)

    @cached_property
    def is_point(self) -> bool:
        """Whether the rail is one point, around which the blend turns."""
        t = np.linspace(*self.c.domain, 2 * len(self.c.breaks) - 1)
        point, vector = dehomogenise_jets(np.stack([jet(t) for jet in self.jets[:2]]))
        return bool(np.ptp(point, axis=0).max() <= RAIL_TOLERANCES.point_rail_share * np.abs(vector).max())

    def join(self) -> Ribbon:
        """Return the same ribbon, to share its end sections with others; its jets are not composed again."""
        joined = replace(self, joined=True)
        for name in ("jets", "is_point"):
            if name in self.__dict__:  # of what these are made of, nothing changes
                joined.__dict__[name] = self.__dict__[name]
        return joined

    @cached_property
    def jets(self) -> tuple[Curve, ...]:
        """d^k/dv^k P(phi) at v = 0, k = 0 .. number of directions: exact homogeneous splines (dim 4)."""
        return self.primary.compose_jets(self.c, self.directions)


def is_faded(ribbon: Ribbon, t: Array) -> Array:
    """Return a mask of the t (n,) at which the first cross derivative is too short to span a tangent plane.

    It is False everywhere if the ribbon does not fade.
    """
    if not ribbon.fades:
        return np.zeros(len(t), dtype=bool)
    length = np.linalg.norm(dehomogenise_jets(np.stack([jet(t) for jet in ribbon.jets[:2]]))[1], axis=1)
    return np.asarray(length <= RAIL_TOLERANCES.measurable_share * length.max())


def is_periodic(ribbon: Ribbon) -> bool:
    """Whether the jets of a ribbon, but for its position, are the same at both ends."""
    ends = np.array(ribbon.c.domain)
    jets = dehomogenise_jets(np.stack([jet(ends) for jet in ribbon.jets]))
    jets[0] -= jets[0, :1]
    size = np.abs(jets).max()
    return bool(
        np.abs(jets[:, 0] - jets[:, 1]).max() <= RAIL_TOLERANCES.periodic_share * max(size, np.finfo(float).tiny)
    )


def dehomogenise_jets(jets: Array) -> Array:
    """Return derivatives in space, (k, n, 3), of homogeneous derivatives by one parameter, (k, n, 4)."""
    return dehomogenise_derivatives(jets.swapaxes(1, 2)[None])[0].swapaxes(1, 2)


def evaluate_space_jets(jets: Sequence[Curve], t: Array, order: int, side: BreakSide = "right") -> Array:
    """Return jets in space with their derivatives by t, (jets, order + 1, n, 3), of homogeneous ones."""
    homogeneous = np.stack([jet.jet(t, order, side=side) for jet in jets])  # (jets, order + 1, n, 4)
    return dehomogenise_derivatives(homogeneous.swapaxes(2, 3)).swapaxes(2, 3)
