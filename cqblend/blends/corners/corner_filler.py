r"""Fills holes where blends meet by tensor-product patches, exactly smooth with all that is around, and between them.

A hole of m sides gets m quads around a centre; one of four sides may get a single Coons patch. Quad i sits in corner i:
u runs along the first half of side i, v back along the second half of side i - 1, and (1, 1) is the centre. With the
surface at the centre F over a plane in which spoke i leaves in the direction a_i, phi the angle between spokes,

- spoke i is the quartic s_i(v) with b_i(1/2), D_i(1/2) at 0 and F, -F'(a_i), F''(a_i, a_i) at 1;
- the derivative across it is e_i + cos(phi) lambda s_i' in quad i and -e_i + cos(phi) lambda s_i' in quad i + 1, with
  lambda = 3 v^2 - 2 v^3 and a cubic e_i: the sum of both is along s_i', so that the quads have a common tangent plane
  there, whatever the unknowns are.

All is linear in the unknowns: factors in the middle of sides, twists, and F with its derivatives. The least energy
tells them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.blends.corners.affine_curves import Unknowns, interpolate_between
from cqblend.blends.corners.coons_patch import AffinePatch, CoonsBoundary
from cqblend.blends.corners.corner_side import CornerFrame, CornerSide
from cqblend.blends.corners.cross_fields import (
    MIDDLE,
    SideCorner,
    build_cross_fields,
    check_corners,
    compare_sides,
    count_unknowns,
)
from cqblend.blends.corners.tolerances import CORNER_TOLERANCES
from cqblend.errors import GeometryError, InputError
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array

_RAMP = Curve.bezier([[0.0], [0.0], [1.0], [1.0]])
"""lambda."""


@dataclass(frozen=True)
class CornerFill:
    """The patches of a hole, and by how much its sides failed to agree at its corners (relative)."""

    patches: tuple[Surface, ...]
    off_plane: float
    twist_gap: float


def fill_with_quads(sides: Sequence[CornerSide], roughness: float = 0.0) -> CornerFill:
    """Fill a hole by one quad for each of its corners.

    Parameters
    ----------
    sides
        Three at least, head to tail around the hole.
    roughness
        By how much, beyond rounding and relative to the size of the hole, they may fail to agree where they meet. Then
        so do the quads.

    Raises
    ------
    InputError
        If the sides do not close, or are too few.
    GeometryError
        If their tangent planes, or twists, do not agree where they meet.
    """
    frame, own = _bring_into_frame(sides, roughness)
    corners = _compare_all(own, MIDDLE, roughness)
    dim, m = own[0].dim, len(own)
    unknowns = Unknowns(count_unknowns(own) + 6 * dim)
    fields = build_cross_fields(own, corners, MIDDLE, unknowns)
    centre = _CentreJet(unknowns.take(6, dim), m)
    halves = [_halve_side(side, field, unknowns) for side, field in zip(own, fields, strict=True)]
    spokes = [_build_spoke(half, centre, i) for i, half in enumerate(halves)]
    boundaries = []
    for i in range(m):
        before, after = spokes[i - 1], spokes[i]
        rows = (*halves[i].first, before.after, before.curve)
        columns = (*halves[i - 1].second, after.before, after.curve)
        boundaries.append(CoonsBoundary(rows, columns))
    return _settle_patches(boundaries, unknowns, corners, frame)


def fill_with_one_patch(sides: Sequence[CornerSide], roughness: float = 0.0) -> CornerFill:
    """Fill a hole of four sides by a single patch, u along side 0, v along side 1; see :func:`fill_with_quads`.

    Raises
    ------
    InputError
        If the sides do not close, or are not four.
    GeometryError
        If their tangent planes, or twists, do not agree where they meet.
    """
    if len(sides) != 4:
        raise InputError(f"one patch has four sides, not {len(sides)}")
    frame, own = _bring_into_frame(sides, roughness)
    corners = _compare_all(own, 1.0, roughness)
    unknowns = Unknowns(count_unknowns(own))
    fields = build_cross_fields(own, corners, 1.0, unknowns)
    bottom, right, top, left = (unknowns.hold_curve(side.curve) for side in own)
    rows = (bottom, fields[0], -fields[2].reverse(), top.reverse())
    columns = (left.reverse(), fields[3].reverse(), -fields[1], right)
    return _settle_patches([CoonsBoundary(rows, columns)], unknowns, corners, frame)


def _bring_into_frame(sides: Sequence[CornerSide], roughness: float) -> tuple[CornerFrame, list[CornerSide]]:
    """Return the frame of a hole, and its sides there."""
    if len(sides) < 3:
        raise InputError(f"a hole has three sides at least, not {len(sides)}")
    frame = CornerFrame.around_sides(sides)
    ends = [side.evaluate_ends() for side in sides]
    gaps = [float(np.linalg.norm(ends[i][0] - ends[i - 1][1])) for i in range(len(sides))]
    if not max(gaps) <= (CORNER_TOLERANCES.closed_sides + roughness) * frame.size:
        raise InputError(f"the sides of a hole are {max(gaps):.2g} mm apart where they should meet")
    return frame, [frame.bring_in(side) for side in sides]


def _compare_all(sides: Sequence[CornerSide], pace: float, roughness: float) -> list[SideCorner]:
    corners = [compare_sides(side, sides[i - 1], pace) for i, side in enumerate(sides)]
    check_corners(corners, roughness)
    return corners


class _CentreJet:
    """The surface F at the centre of m quads, to the second order over a plane: jet (6, D, columns)."""

    def __init__(self, jet: Array, m: int) -> None:
        self.jet = jet
        angles = 2 * np.pi / m * np.arange(m)
        self.directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        self.cosine = float(np.cos(2 * np.pi / m))

    @property
    def point(self) -> Array:
        return np.asarray(self.jet[0])

    def differentiate(self, a: Array) -> Array:
        """Return F'(a)."""
        return np.asarray(a[0] * self.jet[1] + a[1] * self.jet[2])

    def differentiate_twice(self, a: Array, b: Array) -> Array:
        """Return F''(a, b)."""
        mixed = a[0] * b[1] + a[1] * b[0]
        return np.asarray(a[0] * b[0] * self.jet[3] + mixed * self.jet[4] + a[1] * b[1] * self.jet[5])


@dataclass(frozen=True)
class _HalvedSide:
    """A side and its cross derivative, affine, by halves on [0, 1].

    ``first`` runs from the start to the middle, ``second`` back from the stop to the middle. ``middle`` is the jet
    there: point, cross derivative, and the derivatives of both along the side, by the parameter of a half.
    """

    first: tuple[Curve, Curve]
    second: tuple[Curve, Curve]
    middle: tuple[Array, Array, Array, Array]


def _halve_side(side: CornerSide, field: Curve, unknowns: Unknowns) -> _HalvedSide:
    curve = unknowns.hold_curve(side.curve)
    first = curve.clip(0.0, MIDDLE).reparametrized(0.0, 1.0), field.clip(0.0, MIDDLE).reparametrized(0.0, 1.0)
    second = (
        curve.clip(MIDDLE, 1.0).reparametrized(0.0, 1.0).reverse(),
        field.clip(MIDDLE, 1.0).reparametrized(0.0, 1.0).reverse(),
    )
    values = [unknowns.evaluate(one, 1.0, side="left") for one in first]
    rates = [unknowns.evaluate(one, 1.0, 1, side="left") for one in first]
    return _HalvedSide(first, second, (values[0], values[1], rates[0], rates[1]))


@dataclass(frozen=True)
class _Spoke:
    """A spoke, from its side to the centre, and the derivatives across it in the quads before and after it."""

    curve: Curve
    before: Curve
    after: Curve


def _build_spoke(half: _HalvedSide, centre: _CentreJet, i: int) -> _Spoke:
    """Build spoke i; quad i, which is on the first half of side i, is before it."""
    a, last, following = (centre.directions[k % len(centre.directions)] for k in (i, i - 1, i + 1))
    point, inward, along, twist = half.middle
    curve = interpolate_between(
        [point, inward], [centre.point, -centre.differentiate(a), centre.differentiate_twice(a, a)]
    )
    difference = last - following
    across = interpolate_between(
        [along, twist],
        [-centre.differentiate(difference) / 2, centre.differentiate_twice(a, difference) / 2],
    )
    sheared = (centre.cosine * _RAMP) * curve.derivative()
    return _Spoke(curve, across + sheared, sheared - across)


def _settle_patches(
    boundaries: Sequence[CoonsBoundary], unknowns: Unknowns, corners: Sequence[SideCorner], frame: CornerFrame
) -> CornerFill:
    """Return the patches of least energy."""
    patches = [AffinePatch.from_boundary(boundary, unknowns) for boundary in boundaries]
    solution = _minimise_energy(np.sum([patch.measure_energy() for patch in patches], axis=0))
    surfaces = tuple(_make_surface(patch, solution, frame) for patch in patches)
    return CornerFill(
        surfaces, max(corner.off_plane for corner in corners), max(corner.twist_gap for corner in corners)
    )


def _minimise_energy(energy: Array) -> Array:
    """Return the constant 1 and the unknowns for which a quadratic energy (columns, columns) is least."""
    matrix, right = energy[1:, 1:], -energy[1:, 0]
    diagonal = np.diag(matrix)
    live = diagonal > CORNER_TOLERANCES.unused_unknown
    scale = np.sqrt(diagonal[live])
    scaled = matrix[np.ix_(live, live)] / scale / scale[:, None]
    scaled += CORNER_TOLERANCES.regularisation * np.eye(len(scaled))
    out = np.zeros(len(energy))
    out[0] = 1.0
    out[1:][live] = np.linalg.solve(scaled, right[live] / scale) / scale
    return out


def _make_surface(patch: AffinePatch, solution: Array, frame: CornerFrame) -> Surface:
    """Return a patch in space for a solution."""
    coefs = frame.bring_back(np.einsum("pqdcmn,c->pqdmn", patch.coefs, solution))
    is_rational = coefs.shape[2] == 4
    if is_rational and not coefs[:, :, 3].min() > 0:
        raise GeometryError("a corner patch has a weight that is not positive", kind="weight")
    smooth = [np.ones(len(breaks) - 2, dtype=int) for breaks in patch.breaks]
    return Surface(patch.breaks, coefs, rational=is_rational, continuity=smooth)
