"""Which points of the two rails of a bridge belong together: equal shares of length, without twist, corner to corner.

The start is where the circular cross-correlation of both rails, sampled at equal distances about their centres, is
largest; one fast Fourier transform tells it for all shifts at once. Before that, one rail is carried to the other along
the way of the bridge by a frame that turns no more than it must, since a bridge may arrive in quite another direction
than the one in which it leaves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cqblend.blends.network.bridge_loops import RailLoop
from cqblend.blends.network.tolerances import BRIDGE_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import normalise_vectors


@dataclass(frozen=True)
class RailPairing:
    """Two loops with a common parameter t, from 0 to 1 once around, in the sense of both.

    ``anchors`` (m,) are values of t, from 0 to 1, at which the ``positions`` (2, m) on both loops, by their length, are
    given: between them, lengths are in proportion.
    """

    loops: tuple[RailLoop, RailLoop]
    anchors: Array
    positions: Array

    def find_positions(self, side: int, t: Array) -> Array:
        """Return the lengths (n,) from the start of a loop at t (n,), any number of times around."""
        laps = np.floor(t)
        return np.interp(t - laps, self.anchors, self.positions[side]) + laps * self.loops[side].length

    @cached_property
    def breaks(self) -> Array:
        """The t (n,) in [0, 1) at which cells of the bridge must end, those of both sides; none if it has one cell."""
        found = []
        for loop, positions in zip(self.loops, self.positions, strict=True):
            s = positions[0] + np.mod(loop.breaks - positions[0], loop.length)
            found.append(np.interp(s, positions, self.anchors))
        t = np.sort(np.concatenate(found))
        t = np.where(t > 1 - BRIDGE_TOLERANCES.same_place, 0.0, t)
        t = np.sort(t)
        return t[np.diff(t, prepend=-1.0) > BRIDGE_TOLERANCES.same_place]


def pair_loops(loops: tuple[RailLoop, RailLoop], start: float | None) -> RailPairing:
    """Pair two loops, the first one from its start on.

    ``start`` is the share of the second loop's length at which t = 0 is to land; None for the one without twist. Then
    corners that are nearly opposite are brought together; with a ``start``, those that are so exactly, or all of them
    if there are as many on both sides and one lands on another.
    """
    first, second = loops
    shift = find_untwisted_start(first, second) if start is None else start
    own = np.mod(first.breaks / first.length, 1.0)
    other = second.breaks / second.length
    if start is None and len(own) and len(other):
        offsets = np.mod(other[None, :] - shift - own[:, None] + 0.5, 1.0) - 0.5
        shift += float(offsets.ravel()[np.abs(offsets).argmin()])
    reach = BRIDGE_TOLERANCES.same_place
    landed = np.sort(np.mod(other - shift, 1.0))
    landed = np.where(landed > 1 - BRIDGE_TOLERANCES.same_place, 0.0, landed)
    landed.sort()
    pairs = _match_places(own, landed, reach)
    if len(own) == len(landed) and pairs:
        turned = pairs[0][1] - pairs[0][0]
        pairs = [(i, (i + turned) % len(landed)) for i in range(len(own))]
    elif start is None and len(own) and len(landed):
        pairs = _match_places(own, landed, BRIDGE_TOLERANCES.matched_share / max(len(own), len(landed)))
    anchors, shares = list[float](), list[float]()
    for i, k in pairs:
        if shares:
            share = shares[-1] + float(np.mod(landed[k] - shares[-1], 1.0))
        else:
            share = float(landed[k]) + round(float(own[i] - landed[k]))
        anchors.append(float(own[i]))
        shares.append(share)
    if 0.0 not in anchors:
        at = 0.0
        if anchors and start is None:  # in proportion between the anchors around the start
            at = float(np.interp(0.0, [anchors[-1] - 1.0, anchors[0]], [shares[-1] - 1.0, shares[0]]))
        anchors, shares = [0.0, *anchors], [at, *shares]
    t, landed_at = np.array([*anchors, 1.0]), np.array([*shares, shares[0] + 1.0])
    positions = np.stack([t * first.length, (landed_at + shift) * second.length])
    return RailPairing(loops, t, positions)


def _match_places(own: Array, landed: Array, reach: float) -> list[tuple[int, int]]:
    """Return pairs of places on a circle of length 1, within reach: for each of the fewer the nearest of the others.

    Of several that have the same nearest one, the nearest to it has it. The pairs are in the order of ``own``.
    """
    if not len(own) or not len(landed):
        return []
    apart = np.abs(np.mod(landed[None, :] - own[:, None] + 0.5, 1.0) - 0.5)
    if len(own) > len(landed):
        return sorted((i, k) for k, i in _choose_nearest(apart.T, reach))
    return _choose_nearest(apart, reach)


def _choose_nearest(apart: Array, reach: float) -> list[tuple[int, int]]:
    """Return a pair of row and column for every row of a table of distances, but those that lose theirs to another."""
    best = apart.argmin(axis=1).tolist()
    return [
        (i, k)
        for i, k in enumerate(best)
        if apart[i, k] <= reach and i == min((j for j in range(len(best)) if best[j] == k), key=lambda j: apart[j, k])
    ]


def find_untwisted_start(first: RailLoop, second: RailLoop) -> float:
    """Return the share of the second loop's length at which the start of the first one lands with the least twist.

    That is where sum |R a_i - b_(i + k)|^2 is least, of points a and b about their centres, with the rotation R of a
    frame that is carried along the bridge.
    """
    turn = carry_frame(first.centre, first.direction, second.centre, -second.direction)
    a, b = (first.samples - first.centre) @ turn.T, second.samples - second.centre
    count = len(a)
    spectrum = (np.conj(np.fft.rfft(a, axis=0)) * np.fft.rfft(b, axis=0)).sum(axis=1)
    correlation = np.fft.irfft(spectrum, count)
    k = int(correlation.argmax())
    before, here, after = correlation[[k - 1, k, (k + 1) % count]]
    bend = before - 2 * here + after
    fine = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(np.mod((k + np.clip(fine, -0.5, 0.5)) / count, 1.0))


def carry_frame(start: Array, leaving: Array, stop: Array, arriving: Array) -> Array:
    """Return the rotation (3, 3) of a frame that is carried along a cubic from one point to another without twist.

    The cubic leaves and arrives in given unit directions. The frame is carried by double reflection (Wang et al.,
    "Computation of rotation minimizing frames", ACM TOG 27, 2008).
    """
    chord = stop - start
    speed = float(np.linalg.norm(chord))
    if speed < np.finfo(float).tiny:
        return np.eye(3)
    v = np.linspace(0.0, 1.0, BRIDGE_TOLERANCES.frame_steps + 1)[:, None]
    points = (3 * v**2 - 2 * v**3) * chord + speed * ((v - 2 * v**2 + v**3) * leaving + (v**3 - v**2) * arriving)
    rates = (6 * v - 6 * v**2) * chord + speed * ((1 - 4 * v + 3 * v**2) * leaving + (3 * v**2 - 2 * v) * arriving)
    tangents = normalise_vectors(rates)
    frame = np.eye(3)
    for k in range(len(v) - 1):
        mirrored = _mirror(points[k + 1] - points[k])
        frame = _mirror(tangents[k + 1] - mirrored @ tangents[k]) @ mirrored @ frame
    return frame


def _mirror(vector: Array) -> Array:
    """Return the reflection (3, 3) along a vector."""
    square = float(vector @ vector)
    if square < np.finfo(float).tiny:
        return np.eye(3)
    return np.eye(3) - 2 * np.outer(vector, vector) / square
