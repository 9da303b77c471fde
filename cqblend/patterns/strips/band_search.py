"""Bands of surfaces that become strips: searched for longest first or by halving, and their bounds.

The end of a strip is searched for with sampled deviations, many candidates at once; what is found is then bounded from
coefficients. The bands of stacked surfaces are searched for side by side, and proven together; where few surfaces are
left, several bands of each are searched for before they are proven.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from cqblend.errors import GeometryError
from cqblend.patterns.strips.isocurve_samples import IsocurveSamples
from cqblend.patterns.strips.ruled_deviation import bound_deviation, bound_mesh_deviation
from cqblend.patterns.strips.surface_bands import PieceStack, SurfaceBands
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.splines.bernstein import Array

RulingDirection = Literal["u", "v"]
"""The parameter that runs along the rulings."""

_LENGTH_FACTORS = np.append(np.geomspace(0.5, 2.8, 13), np.inf)
"""Of a guessed length of a strip: candidates for its length, which are no longer than the rest of the surface."""

_BRACKET_FRACTIONS = np.linspace(0.0, 1.0, 13)
"""Of the interval between two candidates: candidates of the second round."""

_BATCH = 16
"""Number of bands that are proven together, if there are as many."""


@dataclass(frozen=True, slots=True, eq=False)
class BoundedBand:
    """A band of a surface that becomes a strip.

    Attributes
    ----------
    bands, index
        The bands that it was proven with, and which of them it is.
    bound
        Of its distance from the ruled surface, mm; infinite if there is none.
    row_fractions
        Fractions w (q+1, m) of the rows of control points of all these bands; None if points of the surface are
        compared with their feet on the rulings.
    """

    bands: SurfaceBands
    index: int
    bound: float
    row_fractions: Array | None

    @property
    def start(self) -> float:
        """Where it starts in v."""
        return float(self.bands.starts[self.index])

    @property
    def end(self) -> float:
        """Where it ends in v."""
        return float(self.bands.ends[self.index])

    @property
    def width(self) -> float:
        """Length of its longest ruling, mm."""
        return float(self.bands.widths[self.index])


def find_kinks(samples: IsocurveSamples, member: int) -> list[int]:
    """Return the breaks in v of a surface across which tangents of isoparametric curves turn, or it is discontinuous.

    A tangent is the direction from the control point at the break to the first one that differs from it: speeds do not
    matter.
    """
    small = STRIP_TOLERANCES.coincident_points * samples.stack.members[member].size
    poles = samples.find_poles(member)
    found = []
    for j in range(1, len(poles)):
        left, right = poles[j - 1, ::-1], poles[j]  # (q+1, 3, u), from the break on
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


def bisect_domains(
    stack: PieceStack, tolerance: float, directions: Sequence[RulingDirection]
) -> list[list[tuple[float, float]] | GeometryError]:
    """Return the intervals of v of every surface by Elber's Algorithm 1, which halves all that are too long at once.

    Of a surface for which that fails, the error is returned.
    """
    limits = STRIP_TOLERANCES
    starts, ends = stack.domains
    member, low, high = np.arange(len(starts)), starts, ends
    found: list[list[tuple[float, float]]] = [[] for _ in starts]
    errors: dict[int, GeometryError] = {}
    while len(low):
        bands = stack.cut_bands(member, low, high)
        bounds = bound_mesh_deviation(bands, bands.fit_row_fractions(middle_column=True)) + bands.slacks
        is_good = (bounds < tolerance) & bands.is_spannable()
        for i, start, end in zip(*(one[is_good].tolist() for one in (member, low, high)), strict=True):
            found[i].append((start, end))
        member, low, high = member[~is_good], low[~is_good], high[~is_good]
        is_short = (high - low) < limits.shortest_strip * (ends - starts)[member]
        counts = np.bincount(member, minlength=len(found)) + [len(intervals) for intervals in found]
        for i, at in zip(member[is_short].tolist(), low[is_short].tolist(), strict=True):
            errors.setdefault(i, _tolerance_unreachable_error(tolerance, directions[i], at))
        for i in np.flatnonzero(counts > limits.max_strips).tolist():
            errors.setdefault(i, too_many_strips_error(tolerance, directions[i]))
        is_open = ~np.isin(member, list(errors))
        member, low, high = member[is_open], low[is_open], high[is_open]
        middle = (low + high) / 2
        member, low, high = np.tile(member, 2), np.concatenate([low, middle]), np.concatenate([middle, high])
    return [errors.get(i) or sorted(intervals) for i, intervals in enumerate(found)]


def bound_bisected_bands(stack: PieceStack, member: int, intervals: Sequence[tuple[float, float]]) -> list[BoundedBand]:
    """Return the strips of Elber's Algorithm 1 over the intervals of a surface."""
    starts, ends = np.array(intervals).T
    bands = stack.cut_bands(np.full(len(starts), member), starts, ends)
    fractions = bands.fit_row_fractions(middle_column=True)
    bounds = bound_mesh_deviation(bands, fractions) + bands.slacks
    return [BoundedBand(bands, i, bound, fractions) for i, bound in enumerate(bounds.tolist())]


def prove_bands(bands: SurfaceBands, tolerance: float) -> list[BoundedBand]:
    """Return bands with their bounds: infinite if there is no ruled surface."""
    is_spannable = bands.is_spannable()
    bounds = np.full(len(is_spannable), np.inf)
    if is_spannable.any():
        bounds[is_spannable] = bound_deviation(bands.take_bands(is_spannable), tolerance)
    proven = [BoundedBand(bands, i, bound, None) for i, bound in enumerate(bounds.tolist())]
    turns_back = is_spannable & ~np.isfinite(bounds)
    if turns_back.any():
        others = bands.take_bands(turns_back)
        fractions = others.fit_row_fractions()
        bounds = bound_deviation(others, tolerance, fractions)
        for j, (i, bound) in enumerate(zip(np.flatnonzero(turns_back).tolist(), bounds.tolist(), strict=True)):
            proven[i] = BoundedBand(others, j, bound, fractions)
    return proven


@dataclass(slots=True, eq=False)
class _MemberSearch:
    """How far the search in one surface has come.

    Attributes
    ----------
    start, end
        Where the next strip starts, and where the surface ends, in v.
    guess
        About the length of the next strip.
    shortest
        Length that strips are longer than.
    found
        Proven strips.
    pending
        Ends of the next strips, found with samples, not proven yet.
    ahead
        Number of strips that are searched for before they are proven.
    shrink
        Factor on the length of the next strip, below 1 after its bound has exceeded the tolerance.
    error
        Why the search has failed, if it has.
    """

    start: float
    end: float
    guess: float
    shortest: float
    found: list[BoundedBand] = field(default_factory=list)
    pending: list[float] = field(default_factory=list)
    ahead: int = 1
    shrink: float = 1.0
    error: GeometryError | None = None

    @property
    def next_start(self) -> float:
        """Where the strip after the pending ones starts."""
        return self.pending[-1] if self.pending else self.start

    def append_pending(self, length: float) -> None:
        """Let the next strip have a length, or reach to the end if hardly anything is left."""
        start = self.next_start
        self.pending.append(start + length if start + length < self.end - self.shortest else self.end)
        self.guess = self.pending[-1] - start


class LongestFirstSearch:
    """The longest strip first, over stacked surfaces without kinks.

    Parameters
    ----------
    samples
        Of the surfaces.
    tolerance
        Largest bound of a strip, mm.
    directions
        Of the rulings on every surface, for messages.
    """

    def __init__(self, samples: IsocurveSamples, tolerance: float, directions: Sequence[RulingDirection]) -> None:
        self.stack, self.samples, self.tolerance, self.directions = samples.stack, samples, tolerance, directions
        self.target = STRIP_TOLERANCES.sampled_deviation * tolerance

    def find_bands(
        self, guesses: Sequence[float], max_count: int = STRIP_TOLERANCES.max_strips
    ) -> list[list[BoundedBand] | GeometryError]:
        """Return the strips of every surface, the first of about a guessed length.

        None if there would be more than `max_count`; the error if the tolerance cannot be kept.
        """
        limit = STRIP_TOLERANCES.shortest_strip
        searches = [
            _MemberSearch(start, end, guess, limit * (end - start))
            for start, end, guess in zip(*(one.tolist() for one in self.stack.domains), guesses, strict=True)
        ]
        active = list(range(len(searches)))
        while active:
            for _ in range(max(1, _BATCH // len(active))):
                self._search_ahead(searches, active)
            self._prove_pending(searches, active)
            active = [
                i
                for i in active
                if searches[i].error is None
                and searches[i].start < searches[i].end
                and len(searches[i].found) < max_count
            ]
        return [
            one.error or (one.found if one.start == one.end and len(one.found) <= max_count else []) for one in searches
        ]

    def _search_ahead(self, searches: Sequence[_MemberSearch], active: Sequence[int]) -> None:
        """Search for one more strip of all surfaces that may have one pending."""
        members = [
            i
            for i in active
            if len(searches[i].pending) < searches[i].ahead and searches[i].next_start < searches[i].end
        ]
        if not members:
            return
        states = [searches[i] for i in members]
        starts, ends, guesses = np.array([(one.next_start, one.end, one.guess) for one in states]).T
        lengths = self._estimate_lengths(np.array(members), starts, ends, guesses)
        for i, state, length in zip(members, states, lengths.tolist(), strict=True):
            if length > state.shortest:
                state.append_pending(length)
            elif state.pending:
                state.ahead = len(state.pending)
            else:
                state.error = _tolerance_unreachable_error(self.tolerance, self.directions[i], state.start)

    def _prove_pending(self, searches: Sequence[_MemberSearch], active: Sequence[int]) -> None:
        """Prove pending strips, and take them up to the first whose bound exceeds the tolerance: make that shorter."""
        members = [i for i in active for _ in searches[i].pending]
        if not members:
            return
        starts = [v for i in active for v in [searches[i].start, *searches[i].pending][:-1]]
        ends = [v for i in active for v in searches[i].pending]
        proven = iter(prove_bands(self.stack.cut_bands(members, starts, ends), self.tolerance))
        for i in active:
            state = searches[i]
            bands = [next(proven) for _ in state.pending]
            good = next((j for j, band in enumerate(bands) if band.bound > self.tolerance), len(bands))
            state.pending = []
            if good:
                state.start, state.shrink = bands[good - 1].end, 1.0
                state.found += bands[:good]
            if good == len(bands):
                state.ahead = min(2 * state.ahead, _BATCH)
                continue
            state.ahead = 1
            # deviations grow with the square of the length; where they do not, lengths shrink ever faster
            state.shrink *= STRIP_TOLERANCES.length_shrink
            failed = bands[good]
            ratio = min(max(float(np.sqrt(self.tolerance / failed.bound)), 0.5), 1.0)
            length = (failed.end - failed.start) * ratio * state.shrink
            if length > state.shortest:
                state.append_pending(length)
            else:
                state.error = _tolerance_unreachable_error(self.tolerance, self.directions[i], state.start)

    def _estimate_lengths(self, member: Array, starts: Array, ends: Array, guesses: Array) -> Array:
        """Lengths (k,) of the longest strips from `starts` that keep to the tolerance where they are sampled, or 0."""
        rests = ends - starts
        guesses = np.minimum(guesses, rests)
        found = np.zeros(len(starts))
        open_ones = np.arange(len(starts))
        while len(open_ones := open_ones[guesses[open_ones] > STRIP_TOLERANCES.shortest_strip * rests[open_ones]]):
            first, rest = starts[open_ones], rests[open_ones, None]
            lengths = np.minimum(guesses[open_ones, None] * _LENGTH_FACTORS, rest)
            stops = np.minimum(first[:, None] + lengths, ends[open_ones, None])
            passed = self.samples.sample_deviations(member[open_ones], first, stops) <= self.target
            has_passed, last = passed.any(axis=1), _find_last(passed)
            rows, one = open_ones[has_passed], np.flatnonzero(has_passed)
            brackets = lengths[one, last[one]], lengths[one, np.minimum(last[one] + 1, lengths.shape[1] - 1)]
            found[rows] = self._refine_lengths(member[rows], starts[rows], *brackets)
            open_ones = open_ones[~has_passed]
            guesses[open_ones] /= 4
        return found

    def _refine_lengths(self, member: Array, starts: Array, lows: Array, highs: Array) -> Array:
        """Find the lengths (k,), between those that passed and the next candidates, at which the tolerance is reached.

        Where both are the same, that is the rest of the surface.
        """
        found = lows.copy()
        rows = np.flatnonzero(highs > lows)
        if not len(rows):
            return found
        first = starts[rows]
        lengths = lows[rows, None] + _BRACKET_FRACTIONS * (highs - lows)[rows, None]
        deviations = self.samples.sample_deviations(member[rows], first, first[:, None] + lengths)
        i, k = _find_last(deviations <= self.target), np.arange(len(rows))
        after = np.minimum(i + 1, lengths.shape[1] - 1)
        is_inner = (after > i) & np.isfinite(deviations[k, after])
        roots = np.sqrt(np.where(np.isfinite(deviations), deviations, 0.0))  # nearly linear in the length
        rise = np.where(is_inner, roots[k, after] - roots[k, i], 1.0)
        share = np.minimum((np.sqrt(self.target) - roots[k, i]) / rise, 1.0)
        step = share * (lengths[k, after] - lengths[k, i])
        found[rows] = np.where(is_inner, (lengths[k, i] + step) * (1 - STRIP_TOLERANCES.length_margin), lengths[k, i])
        return found

    def equalise_bounds(self, member: int, bands: list[BoundedBand]) -> list[BoundedBand]:
        """Return as many strips of a surface whose bounds are about the same: those for the smallest tolerance."""
        part = self.stack.members[member]
        samples, directions = IsocurveSamples.from_stack(PieceStack.from_members([part])), [self.directions[member]]
        start, end = part.domain
        low, high = np.mean([np.sqrt(band.bound) for band in bands]) ** 2, self.tolerance
        trial = low * STRIP_TOLERANCES.even_start
        for _ in range(10):
            if not part.slack * 4 < trial < high:
                break
            search = LongestFirstSearch(samples, trial, directions)
            (found,) = search.find_bands([(end - start) / len(bands)], len(bands))
            if isinstance(found, GeometryError):
                raise found
            if len(found) == len(bands):
                bands, high = found, trial
            else:
                low = trial
            if high < STRIP_TOLERANCES.even_stop * low:
                break
            trial = np.sqrt(low * high)
        return bands


def _find_last(passed: Array) -> Array:
    """Return the index (k,) of the last one that passed in every row (k, n), 0 if none has."""
    n = passed.shape[1]
    return np.where(passed.any(axis=1), n - 1 - passed[:, ::-1].argmax(axis=1), 0)
