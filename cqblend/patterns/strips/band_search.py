"""Bands of a surface that become strips: searched for longest first or by halving, and their bounds.

The end of a strip is searched for with sampled deviations, many candidates at once; what is found is then bounded from
coefficients. Depends on :mod:`cqblend.patterns.strips.ruled_deviation`.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cqblend.errors import GeometryError
from cqblend.patterns.strips.ruled_deviation import BezierPieces, IsocurveSamples, SurfaceBands
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.splines.bernstein import Array

RulingDirection = Literal["u", "v"]
"""The parameter that runs along the rulings."""

_LENGTH_FACTORS = np.geomspace(0.5, 2.8, 13)
"""Of a guessed length of a strip: candidates for its length."""

_BRACKET_FRACTIONS = np.linspace(0.0, 1.0, 13)
"""Of the interval between two candidates: candidates of the second round."""


@dataclass(frozen=True, slots=True, eq=False)
class BoundedBand:
    """A band of the surface that becomes a strip.

    Attributes
    ----------
    band
        The band.
    bound
        Of its distance from the ruled surface, mm; infinite if there is none.
    row_fractions
        Fractions w of its rows of control points; None if points of the surface are compared with their feet on the
        rulings.
    """

    band: SurfaceBands
    bound: float
    row_fractions: Array | None

    @property
    def end(self) -> float:
        """Where it ends in v."""
        return float(self.band.ends[0])

    @property
    def width(self) -> float:
        """Length of its longest ruling, mm."""
        return float(self.band.measure_widths()[0])


def find_kinks(pieces: BezierPieces, samples: IsocurveSamples) -> list[int]:
    """Return the breaks in v across which the tangents of isoparametric curves turn, or the surface is discontinuous.

    A tangent is the direction from the control point at the break to the first one that differs from it: speeds do not
    matter.
    """
    small = STRIP_TOLERANCES.coincident_points * pieces.size
    found = []
    for j in range(1, len(pieces.breaks[1]) - 1):
        left, right = samples.poles[j - 1, ::-1], samples.poles[j]  # (q+1, 3, u), from the break on
        if np.abs(left[0] - right[0]).max() > small:
            found.append(j)
            continue
        backward, forward = _find_end_tangents(left, small), _find_end_tangents(right, small)
        sine = np.linalg.norm(np.cross(backward, forward, axis=0), axis=0)
        turn = np.arctan2(sine, -(backward * forward).sum(axis=0))
        is_regular = (backward != 0).any(axis=0) & (forward != 0).any(axis=0)
        if turn[is_regular].max(initial=0.0) > STRIP_TOLERANCES.kink_angle:
            found.append(j)
    return found


def _find_end_tangents(poles: Array, small: float) -> Array:
    """Vectors (3, n) from the first control point (q+1, 3, n) to the next one that is not in the same place, else 0."""
    steps = poles[1:] - poles[0]
    is_away = np.linalg.norm(steps, axis=1) > small
    first = is_away.argmax(axis=0)
    return np.where(is_away.any(axis=0), steps[first, :, np.arange(poles.shape[2])].T, 0.0)


def too_many_strips_error(tolerance: float, direction: RulingDirection) -> GeometryError:
    """Return the error that a tolerance takes too many strips."""
    return GeometryError(
        f"tolerance={tolerance:g} takes more than {STRIP_TOLERANCES.max_strips} strips in {direction}: choose a larger "
        "one, or the other direction"
    )


def _tolerance_unreachable_error(tolerance: float, direction: RulingDirection, at: float) -> GeometryError:
    return GeometryError(
        f"no strip from {direction} = {at:.9g} on keeps to tolerance={tolerance:g}: choose a larger one"
    )


def bisect_domain(pieces: BezierPieces, tolerance: float, direction: RulingDirection) -> list[tuple[float, float]]:
    """Return the intervals of v by Elber's Algorithm 1, which halves all that are too long at once."""
    start, end = pieces.domain
    low, high = np.array([start]), np.array([end])
    found: list[tuple[float, float]] = []
    while len(low):
        bands = pieces.cut_bands(low, high)
        bounds = bands.bound_mesh_deviation(bands.fit_row_fractions(middle_column=True)) + pieces.slack
        is_good = (bounds < tolerance) & bands.is_spannable()
        found += zip(low[is_good].tolist(), high[is_good].tolist(), strict=True)
        low, high = low[~is_good], high[~is_good]
        if len(low) and (high - low).min() < STRIP_TOLERANCES.shortest_strip * (end - start):
            raise _tolerance_unreachable_error(tolerance, direction, float(low[0]))
        if len(low) + len(found) > STRIP_TOLERANCES.max_strips:
            raise too_many_strips_error(tolerance, direction)
        middle = (low + high) / 2
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return sorted(found)


def bound_bisected_bands(pieces: BezierPieces, intervals: list[tuple[float, float]]) -> list[BoundedBand]:
    """Return the strips of Elber's Algorithm 1 over its intervals."""
    found = []
    for interval in intervals:
        band = pieces.cut_bands(*interval)
        fractions = band.fit_row_fractions(middle_column=True)
        found.append(BoundedBand(band, float(band.bound_mesh_deviation(fractions)[0]) + pieces.slack, fractions))
    return found


def prove_band(pieces: BezierPieces, start: float, end: float, tolerance: float) -> BoundedBand:
    """Return the strip from one v to another with its bound: infinite if there is no ruled surface."""
    band = pieces.cut_bands(start, end)
    if not band.is_spannable()[0]:
        return BoundedBand(band, np.inf, None)
    bound = band.bound_deviation(tolerance)
    if np.isfinite(bound):
        return BoundedBand(band, bound, None)
    fractions = band.fit_row_fractions()
    return BoundedBand(band, band.bound_deviation(tolerance, fractions), fractions)


class LongestFirstSearch:
    """The longest strip first, over a part of a surface without kinks."""

    def __init__(
        self, pieces: BezierPieces, samples: IsocurveSamples, tolerance: float, direction: RulingDirection
    ) -> None:
        self.pieces, self.samples, self.tolerance, self.direction = pieces, samples, tolerance, direction
        self.target = STRIP_TOLERANCES.sampled_deviation * tolerance

    def find_bands(self, guess: float, max_count: int = STRIP_TOLERANCES.max_strips) -> list[BoundedBand]:
        """Return the strips, the first of about a guessed length; none if there would be more than `max_count`."""
        start, end = self.pieces.domain
        found: list[BoundedBand] = []
        while start < end:
            if len(found) == max_count:
                return []
            band = self._find_longest_band(start, end, guess)
            found.append(band)
            guess = band.end - start
            start = band.end
        return found

    def _find_longest_band(self, start: float, end: float, guess: float) -> BoundedBand:
        """Return the longest strip from `start` that keeps to the tolerance."""
        shortest = STRIP_TOLERANCES.shortest_strip * (end - self.pieces.domain[0])
        length = self._estimate_length(start, end, guess)
        shrink = 1.0
        while length > shortest:
            stop = min(start + length, end) if start + length < end - shortest else end
            band = prove_band(self.pieces, start, stop, self.tolerance)
            if band.bound <= self.tolerance:
                return band
            # deviations grow with the square of the length; where they do not, lengths shrink ever faster
            shrink *= STRIP_TOLERANCES.length_shrink
            length = (band.end - start) * min(max(np.sqrt(self.tolerance / band.bound), 0.5), 1.0) * shrink
        raise _tolerance_unreachable_error(self.tolerance, self.direction, start)

    def _estimate_length(self, start: float, end: float, guess: float) -> float:
        """Length of the longest strip from `start` that keeps to the tolerance where it is sampled."""
        rest = end - start
        guess = min(guess, rest)
        while guess > STRIP_TOLERANCES.shortest_strip * rest:
            lengths = np.unique(np.append(np.minimum(guess * _LENGTH_FACTORS, rest), rest))
            deviations = self.samples.sample_deviations(start, np.minimum(start + lengths, end))
            passed = np.flatnonzero(deviations <= self.target)
            if len(passed):
                return self._refine_length(start, lengths, int(passed[-1]))
            guess /= 4
        return 0.0

    def _refine_length(self, start: float, lengths: Array, last: int) -> float:
        """Find the length, between the last candidate that passed and the next, at which the tolerance is reached."""
        if last == len(lengths) - 1:
            return float(lengths[last])
        lengths = lengths[last] + _BRACKET_FRACTIONS * (lengths[last + 1] - lengths[last])
        deviations = self.samples.sample_deviations(start, start + lengths)
        i = int(np.flatnonzero(deviations <= self.target)[-1])
        if i == len(lengths) - 1 or not np.isfinite(deviations[i + 1]):
            return float(lengths[i])
        roots = np.sqrt(deviations[i : i + 2])  # nearly linear in the length
        share = (np.sqrt(self.target) - roots[0]) / (roots[1] - roots[0])
        length = float(lengths[i] + min(share, 1.0) * (lengths[i + 1] - lengths[i]))
        return length * (1 - STRIP_TOLERANCES.length_margin)

    def equalise_bounds(self, bands: list[BoundedBand]) -> list[BoundedBand]:
        """Return as many strips whose bounds are about the same: those for the smallest tolerance that allows it."""
        start, end = self.pieces.domain
        low, high = np.mean([np.sqrt(band.bound) for band in bands]) ** 2, self.tolerance
        trial = low * STRIP_TOLERANCES.even_start
        for _ in range(10):
            if not self.pieces.slack * 4 < trial < high:
                break
            search = LongestFirstSearch(self.pieces, self.samples, trial, self.direction)
            found = search.find_bands((end - start) / len(bands), len(bands))
            if len(found) == len(bands):
                bands, high = found, trial
            else:
                low = trial
            if high < STRIP_TOLERANCES.even_stop * low:
                break
            trial = np.sqrt(low * high)
        return bands
