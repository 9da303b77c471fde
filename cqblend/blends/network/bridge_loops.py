"""The two closed rails of a bridge: pieces on faces one after the other, each known by its length.

A loop runs over the faces that stay, along the border of what goes. Where it passes from face to face, or has a corner,
the bridge is cut into cells. Depends on surfaces and splines only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from cqblend.blends.contacts.contact_solver import SupportSurface
from cqblend.blends.network.tolerances import BRIDGE_TOLERANCES
from cqblend.splines import Curve, interpolate
from cqblend.splines.antiderivative import Antiderivative
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, measure_lengths, normalise_vectors, to_tangent_coordinates

JoinKind = Literal["through", "smooth", "sharp"]
"""How a loop passes from one piece to the next: on one face and without a corner; over a smooth edge from one face to
another, without a corner; or else."""


@dataclass(frozen=True)
class LoopPiece:
    """A part of a closed rail on one face.

    Attributes
    ----------
    support
        The surface of the face.
    curve
        The piece in space, in the sense of the loop, on the surface but for the tolerance of an edge.
    guide
        Parameters (k,) of the curve, and native parameters (k, 2) of the surface near to it there, continuous.
    """

    support: SupportSurface
    curve: Curve
    guide: tuple[Array, Array]

    @property
    def length(self) -> float:
        """The length of the piece (mm)."""
        return float(self._lengths.values[-1])

    @cached_property
    def _lengths(self) -> Antiderivative:
        """The length as a function of the curve's parameter."""
        return Antiderivative(lambda t: measure_lengths(self.curve(t, 1)), self.curve.breaks)

    def find_parameters(self, s: Array) -> Array:
        """Return the parameters (n,) of the curve at lengths (n,) from its start."""
        low, high = self.curve.domain
        t = np.interp(s, self._lengths.values, self._lengths.cells)
        for _ in range(BRIDGE_TOLERANCES.most_newton_steps):
            step = (s - self._lengths(t)) / measure_lengths(self.curve(t, 1))
            t = np.clip(t + step, low, high)
            if np.abs(step).max(initial=0.0) <= BRIDGE_TOLERANCES.exact_step * (high - low):
                break
        return t

    def evaluate(self, s: Array) -> Array:
        """Return points and unit tangents (2, n, 3) at lengths (n,) from the start."""
        t = self.find_parameters(s)
        return np.stack([self.curve(t), normalise_vectors(self.curve(t, 1))])

    def locate(self, s: Array) -> Array:
        """Return the native parameters (n, 2) of the feet of the points at lengths (n,) from the start."""
        t = self.find_parameters(s)
        points = self.curve(t)
        uv = np.stack([np.interp(t, self.guide[0], column) for column in self.guide[1].T], axis=-1)
        exact = BRIDGE_TOLERANCES.exact_step * np.abs(points).max(initial=0.0)
        for _ in range(BRIDGE_TOLERANCES.most_newton_steps):
            jet = self.support.primary.jet(uv)
            step = to_tangent_coordinates(jet, points - jet[0])
            uv = uv + step
            if measure_lengths(step[:, :1] * jet[1] + step[:, 1:] * jet[2]).max(initial=0.0) <= exact:
                break
        return uv


@dataclass(frozen=True)
class LoopJoin:
    """Where a piece of a loop starts, and the one before it stops.

    Attributes
    ----------
    kind
        How the loop goes on there.
    edge_jets
        But for a loop that goes straight through: the first three derivatives (3, 3), by its length, of the curve along
        which the bridge is to leave there: it lies on both faces, or at least in their tangent planes.
    on_edge
        Whether that curve goes on along an edge between the faces, so that it lies on both of them to any order.
    bends
        Whether the curvature of a loop that goes straight through jumps there.
    roughness
        Angle (rad) between the faces at a smooth edge.
    name
        What messages call the place.
    """

    kind: JoinKind
    edge_jets: Array | None = None
    on_edge: bool = False
    bends: bool = False
    roughness: float = 0.0
    name: str = ""


@dataclass(frozen=True)
class RailLoop:
    """A closed rail: its pieces in order, and the joins at which they start.

    ``outward`` is +1 where the bridge leaves to the left of the loop, seen from outside, and -1 where to the right.
    """

    pieces: tuple[LoopPiece, ...]
    joins: tuple[LoopJoin, ...]
    outward: float

    @cached_property
    def starts(self) -> Array:
        """The lengths (n + 1,) from the start of the loop at which pieces start, and at which the last one stops."""
        return np.concatenate([[0.0], np.cumsum([piece.length for piece in self.pieces])])

    @property
    def length(self) -> float:
        """The length of the loop (mm)."""
        return float(self.starts[-1])

    @property
    def breaks(self) -> Array:
        """The lengths (m,) from the start at which cells of the bridge must end."""
        return self.starts[:-1][[join.kind != "through" for join in self.joins]]

    def find_join(self, s: float) -> LoopJoin | None:
        """Return the join at a length from the start; None if there is none."""
        apart = np.abs((self.starts[:-1] - s + self.length / 2) % self.length - self.length / 2)
        k = int(apart.argmin())
        return self.joins[k] if apart[k] <= BRIDGE_TOLERANCES.same_place * self.length else None

    def evaluate(self, s: Array) -> Array:
        """Return points and unit tangents (2, n, 3) at lengths (n,), any number of times around."""
        s = np.mod(s, self.length)
        index = np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self.pieces) - 1)
        out = np.empty((2, len(s), 3))
        for k in np.unique(index).tolist():
            out[:, index == k] = self.pieces[k].evaluate(s[index == k] - self.starts[k])
        return out

    @cached_property
    def _sampled_lengths(self) -> Array:
        """Lengths (n,) from the start, at equal distances."""
        count = BRIDGE_TOLERANCES.loop_samples
        return np.arange(count) / count * self.length

    @cached_property
    def samples(self) -> Array:
        """Points (n, 3) at equal distances."""
        return np.asarray(self.evaluate(self._sampled_lengths)[0])

    @cached_property
    def tightness(self) -> Curve:
        """How little room (1/mm) a bridge has that leaves into the opening, over the length of the loop.

        That is about the curvature of the largest circle there that touches the loop and the side of the opening that
        faces it, or a share of that of the loop itself, if it is more. Where a loop has corners, in which no circle
        fits, it is nowhere less than of the largest circle of all. It is smooth, and never much below these.
        """
        step, tangents, away = self.length / BRIDGE_TOLERANCES.loop_samples, *self._sampled_directions
        rates = (np.roll(tangents, -1, axis=0) - np.roll(tangents, 1, axis=0)) / (2 * step)
        bends = BRIDGE_TOLERANCES.bend_weight * (rates * away).sum(axis=1)
        corners = np.round(self.breaks / step).astype(int)
        bends[np.mod(np.add.outer(corners, [-1, 0, 1]), len(bends))] = 0.0
        arms, cosines = self.samples[None] - self.samples[:, None], tangents @ tangents.T
        depths, squares = 2 * np.einsum("ijk,ik->ij", arms, away), (arms**2).sum(axis=-1)

        def measure_circles(facing: Array) -> Array:
            """Return the curvatures (n,) of the circles that touch parts of the loop that face the points."""
            return np.asarray((depths / np.where(facing, squares, np.inf)).max(axis=1))

        facing = cosines < BRIDGE_TOLERANCES.facing_cosine
        tight = np.maximum(bends, measure_circles(facing & ~self._sampled_neighbours))
        if len(self.breaks):
            everywhere = measure_circles(squares > 0)
            inside = everywhere[everywhere > 0]
            tight = np.maximum(tight, inside.min() if len(inside) else 0.0)
        return self._smooth(np.maximum(tight, 0.0))

    @property
    def _sampled_directions(self) -> tuple[Array, Array]:
        """Tangents (n, 3) at equal distances, and the directions (n, 3) square to them in which the bridge leaves."""
        s = self._sampled_lengths
        tangents, away = self.evaluate(s)[1], np.empty((len(s), 3))
        index = np.searchsorted(self.starts, s, side="right") - 1
        for k in np.unique(index).tolist():
            here, support = index == k, self.pieces[k].support
            normals = support.primary.evaluate_normals(self.pieces[k].locate(s[here] - self.starts[k]))
            away[here] = self.outward * support.outward * cross_product(normals, tangents[here])
        return tangents, away

    @property
    def _sampled_neighbours(self) -> Array:
        """Which points (n, n) at equal distances are on two parts of the loop that meet in a corner."""
        count = len(self.breaks)
        part = np.searchsorted(self.breaks, self._sampled_lengths, side="right") % max(count, 1)
        apart = np.mod(part[:, None] - part[None], max(count, 1))
        return np.asarray(((apart == 1) | (apart == count - 1)) & (apart != 0))

    def _smooth(self, values: Array) -> Curve:
        """Return values (n,) at equal distances as a smooth function that is about the largest of those nearby."""
        count, reach = len(values), BRIDGE_TOLERANCES.tightness_reach
        shifts = range(-round(reach * count), round(reach * count) + 1)
        largest = np.max([np.roll(values, shift) for shift in shifts], axis=0)
        decay = np.exp(-2 * (np.pi * reach * np.arange(count // 2 + 1)) ** 2)
        smooth = np.maximum(np.fft.irfft(np.fft.rfft(largest) * decay, count), 0.0)
        s = np.append(self._sampled_lengths, self.length)
        return interpolate(s, np.append(smooth, smooth[0])[:, None], periodic=True)

    @cached_property
    def centre(self) -> Array:
        """The centre (3,) of the loop."""
        return np.asarray(self.samples.mean(axis=0))

    @cached_property
    def direction(self) -> Array:
        """The unit vector (3,) in which the bridge leaves on the whole, out of what bounds the opening."""
        arms = self.samples - self.centre
        return normalise_vectors(self.outward * cross_product(arms, np.roll(arms, -1, axis=0)).sum(axis=0))


@dataclass(frozen=True)
class RailRun:
    """The part of a loop between two lengths, all on one face, with native parameters that are continuous.

    ``pieces`` start at the lengths ``starts`` (n,), any number of times around, with native parameters that are their
    own plus ``shifts`` (n, 2). A run all ``closed`` goes on beyond its ``span``, with a ``lap`` (2,) more each time.
    """

    pieces: tuple[LoopPiece, ...]
    starts: Array
    shifts: Array
    span: tuple[float, float]
    closed: bool
    lap: Array

    @classmethod
    def from_loop(cls, loop: RailLoop, span: tuple[float, float], closed: bool) -> RailRun:
        """Take a part of a loop, up to once around."""
        slack = BRIDGE_TOLERANCES.same_place * loop.length
        found = [
            (loop.pieces[k], float(loop.starts[k]) + lap * loop.length)
            for lap in range(int(np.floor(span[0] / loop.length)) - 1, int(np.ceil(span[1] / loop.length)) + 1)
            for k in range(len(loop.pieces))
        ]
        found = [
            (piece, start)
            for piece, start in found
            if start + piece.length > span[0] + slack and start < span[1] - slack
        ]
        pieces, starts = tuple(piece for piece, _ in found), np.array([start for _, start in found])
        periods = np.array([0.0 if period is None else period for period in pieces[0].support.primary.periods])
        shifts = [np.zeros(2)]
        for before, after in pairwise(pieces):
            jump = before.guide[1][-1] + shifts[-1] - after.guide[1][0]
            shifts.append(_round_to_periods(jump, periods))
        lap = _round_to_periods(pieces[-1].guide[1][-1] + shifts[-1] - pieces[0].guide[1][0], periods)
        if closed and starts[0] < span[0] - slack:  # its first piece starts before it, and ends after it
            lap = _round_to_periods(shifts[-1] + pieces[-1].guide[1][0] - pieces[0].guide[1][0], periods)
        return cls(pieces, starts, np.array(shifts), span, closed, lap)

    @property
    def support(self) -> SupportSurface:
        """The surface that the run is on."""
        return self.pieces[0].support

    def locate(self, s: Array) -> tuple[Array, Array]:
        """Return native parameters (n, 2), and unit tangents (n, 3) of the loop, at lengths (n,)."""
        laps = np.zeros(len(s))
        if self.closed:
            laps = np.floor((s - self.span[0]) / (self.span[1] - self.span[0]))
            s = s - laps * (self.span[1] - self.span[0])
        index = np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self.pieces) - 1)
        uv, tangents = np.empty((len(s), 2)), np.empty((len(s), 3))
        for k in np.unique(index).tolist():
            piece, here = self.pieces[k], index == k
            own = np.clip(s[here] - self.starts[k], 0.0, piece.length)
            uv[here], tangents[here] = piece.locate(own) + self.shifts[k], piece.evaluate(own)[1]
        return uv + laps[:, None] * self.lap, tangents


def _round_to_periods(jump: Array, periods: Array) -> Array:
    """Return the whole periods next to a difference of native parameters (2,); a period of 0 is none."""
    whole = np.where(periods > 0, periods, 1.0)
    return np.asarray(np.where(periods > 0, whole * np.round(jump / whole), 0.0))
