"""Ribbons: what ties a blend to one of its surfaces, and makes it exactly smooth there.

A ribbon is a curve c(t) of lifted parameters on a primary, and directions d(t), e(t), .. along it, also in lifted
parameters: phi(t, v) = c + v d + v^2/2 e + .. . Whatever c, d and e are, a surface whose v-jets at v = 0 are those of
S(phi) meets S with as many orders of continuity. Whatever approximates does so here, nothing after it does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide, dehomogenise_derivatives
from cqblend.surfaces.primary import Primary

LEAST_MEASURABLE_SHARE = (
    1e-4  # of the longest cross derivative along a rail: shorter ones make no tangent plane that can be measured
)
PERIODIC_TOLERANCE = 1e-6  # of its directions: a ribbon whose jets differ by less at both ends goes on periodically


@dataclass(frozen=True)
class Ribbon:
    """A rail ``c`` of lifted parameters on a primary, and lifted ``directions`` (d, e, ..) along it, into the blend.

    ``uv`` are the native parameters at the breaks of c, continuous along the rail; ``order`` is that of the continuity
    between blend and surface (there is a d even if it is 0), ``direction`` (rad) and ``length`` (relative) the largest
    deviations of the fitted d from the wanted one. In a ``light`` one, a straight or circular rail on few and long
    pieces, terms cancel, and its jets have lower degrees than they come with. One that ``fades`` may have directions
    that vanish: there, the joint stays as sharp as it was.
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

    def find_native_parameters(self, t: Array) -> Array:
        """Return the native parameters (n, 2) at t, continuous along the rail."""
        near = np.stack([np.interp(t, self.c.breaks, column) for column in self.uv.T], -1)
        return self.primary.unlift_points(self.c(t), near)

    def compose_jets(self) -> tuple[Curve, ...]:
        """Return d^k/dv^k P(phi) at v = 0, k = 0 .. number of directions: exact homogeneous splines (dim 4)."""
        return self.primary.compose_jets(self.c, self.directions)


def is_faded(ribbon: Ribbon, t: Array) -> Array:
    """Tell where, at t (n,), the first derivative into the blend has vanished: nowhere if the ribbon does not fade."""
    if not ribbon.fades:
        return np.zeros(len(t), dtype=bool)
    length = np.linalg.norm(dehomogenise_jets(np.stack([jet(t) for jet in ribbon.compose_jets()[:2]]))[1], axis=1)
    return np.asarray(length <= LEAST_MEASURABLE_SHARE * length.max())


def is_periodic(ribbon: Ribbon) -> bool:
    """Whether the jets of a ribbon end as they start."""
    ends = np.array(ribbon.c.domain)
    jets = dehomogenise_jets(np.stack([jet(ends) for jet in ribbon.compose_jets()]))
    jets[0] -= jets[0, :1]
    size = np.abs(jets).max()
    return bool(np.abs(jets[:, 0] - jets[:, 1]).max() <= PERIODIC_TOLERANCE * max(size, np.finfo(float).tiny))


def dehomogenise_jets(jets: Array) -> Array:
    """Return derivatives in space, (k, n, 3), of homogeneous ones by any one parameter, (k, n, 4)."""
    return np.moveaxis(dehomogenise_derivatives(np.moveaxis(jets, 2, 1)[None])[0], 1, 2)


def evaluate_space_jets(jets: Sequence[Curve], t: Array, order: int, side: BreakSide = "right") -> Array:
    """Return jets in space with their derivatives by t, (jets, order + 1, n, 3), of homogeneous ones."""
    homogeneous = np.stack([jet.jet(t, order, side=side) for jet in jets])  # (jets, order + 1, n, 4)
    return dehomogenise_derivatives(homogeneous.swapaxes(2, 3)).swapaxes(2, 3)
