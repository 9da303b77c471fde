r"""Cross derivatives along the sides of a hole: all that patches may have there, and whether their corners allow it.

Where side i starts, at the end of side i - 1, a patch has one point, both of its derivatives and one twist. With the
parameter of a patch c times that of its sides, that asks for

.. math:: D_i(0) = -c\, b_{i-1}'(1), \quad D_{i-1}(1) = c\, b_i'(0), \quad c\, D_i'(0) = -c\, D_{i-1}'(1),

b the curves and D the cross derivatives. The first two say that both sides have a common tangent plane; the last one
restricts what is normal to it: both sides can agree if, and only if, the second fundamental forms of the surfaces
beyond agree on the directions of the two sides. They do wherever one of these runs along the smooth edge of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.blends.corners.affine_curves import Unknowns, interpolate_jets
from cqblend.blends.corners.corner_side import CornerSide
from cqblend.blends.corners.tolerances import CORNER_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide

MIDDLE = 0.5
"""Where the scalar functions of a side have a knot."""


@dataclass(frozen=True)
class _SideEnd:
    """A side at its start or its stop: what its fields span there, and the factors on them that a patch asks for.

    ``span`` (D, K) has the fields as columns, ``twist`` (D,) is the derivative of the cross derivative as it is with
    constant factors, times that of the patch's parameter, in the directions of the corner.
    """

    span: Array
    inverse: Array
    factors: Array
    twist: Array
    off_plane: float


@dataclass(frozen=True)
class SideCorner:
    """Where one side starts and the one before stops, and by how much they fail to agree there (relative)."""

    start: _SideEnd
    stop: _SideEnd
    off_plane: float
    twist_gap: float


def compare_sides(side: CornerSide, before: CornerSide, pace: float) -> SideCorner:
    """Compare a side at its start with the one before at its stop; ``pace`` is c."""
    leaving, arriving = _evaluate_end(side.curve, 0.0)[1], _evaluate_end(before.curve, 1.0)[1]
    size = float(np.linalg.norm(leaving))
    start = _make_end(side, 0.0, -pace * arriving, pace)
    stop = _make_end(before, 1.0, pace * leaving, -pace)
    left, values, _ = np.linalg.svd(start.span, full_matrices=False)
    basis = left[:, values > CORNER_TOLERANCES.span_rank * values[0]]
    gap = start.twist - stop.twist
    gap = gap - basis @ (basis.T @ gap)
    return SideCorner(start, stop, (start.off_plane + stop.off_plane) / size, float(np.linalg.norm(gap)) / size)


def _evaluate_end(curve: Curve, t: float) -> Array:
    """Return a curve and its derivative, (2, D), at one of its ends."""
    side: BreakSide = "right" if t < 1 else "left"
    return np.asarray(curve.jet(np.array([t]), 1, side=side)[:, 0])


def _make_end(side: CornerSide, t: float, wanted: Array, pace: float) -> _SideEnd:
    jets = np.array([_evaluate_end(field, t) for field in side.fields])  # (K, 2, D)
    span, rates = jets[:, 0].T, jets[:, 1].T
    inverse = np.linalg.pinv(span, rcond=CORNER_TOLERANCES.span_rank)
    factors = inverse @ wanted
    off = float(np.linalg.norm(span @ factors - wanted))
    return _SideEnd(span, inverse, factors, pace * (rates @ factors), off)


def check_corners(corners: Sequence[SideCorner], roughness: float = 0.0) -> None:
    """Raise GeometryError if no patch can meet the sides of a hole with common tangent planes, but for a roughness."""
    for number, corner in enumerate(corners, start=1):
        if not corner.off_plane <= CORNER_TOLERANCES.tangent_plane + roughness:
            raise GeometryError(
                f"two sides of a corner patch leave point {number} of its outline in different tangent planes, "
                f"{corner.off_plane:.2g} apart",
                kind="tangent plane",
                value=corner.off_plane,
            )
        if not corner.twist_gap <= CORNER_TOLERANCES.twist + roughness:
            raise GeometryError(
                f"two sides of a corner patch ask for different twists at point {number} of its outline, "
                f"{corner.twist_gap:.2g} apart: a side must leave in the direction of a rail",
                kind="twist",
                value=corner.twist_gap,
            )


def count_unknowns(sides: Sequence[CornerSide]) -> int:
    """Return how many unknowns cross derivatives have: values and slopes in the middle of sides, and twists."""
    return 3 * sum(len(side.fields) for side in sides)


def build_cross_fields(
    sides: Sequence[CornerSide], corners: Sequence[SideCorner], pace: float, unknowns: Unknowns
) -> list[Curve]:
    """Return the cross derivatives along all sides, affine curves on [0, 1]."""
    twists = [
        unknowns.hold((corner.start.twist + corner.stop.twist) / 2)
        + np.tensordot(corner.start.span, unknowns.take(corner.start.span.shape[1]), 1)
        for corner in corners
    ]
    fields = []
    for i, side in enumerate(sides):
        k = (i + 1) % len(sides)
        start, stop = corners[i].start, corners[k].stop
        slopes = (
            np.tensordot(start.inverse, twists[i] - unknowns.hold(start.twist), 1) / pace,
            np.tensordot(stop.inverse, twists[k] - unknowns.hold(stop.twist), 1) / -pace,
        )
        middle = unknowns.take(2, len(side.fields))
        values = np.stack([unknowns.hold(start.factors), middle[0], unknowns.hold(stop.factors)])
        rates = np.stack([slopes[0], middle[1], slopes[1]])
        factors = interpolate_jets(np.array([0.0, MIDDLE, 1.0]), np.stack([values, rates]))
        fields.append(unknowns.combine_fields(factors, side.fields))
    return fields
