"""Fits quintics with uniform single knots to exact jets, between one pair of multiple knots and the next.

The compact form (:mod:`cqblend.blends.sections.compact_form`) consists of such stretches.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from cqblend.blends.sections.exact_jets import ExactJets, count_derivatives
from cqblend.blends.sections.tolerances import COMPACT_TOLERANCES
from cqblend.splines import Curve, bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.knots import extract_pieces

COMPACT_DEGREE = 5
"""Degree of the compact form: single knots of a higher one do not survive when curves are assembled of pieces, and the
amplification of rounding stays below 50."""

MOST_SHARED_DERIVATIVES = 3
"""Values and derivatives taken over at a multiple knot, at most: half the coefficients of a quintic."""


@dataclass(frozen=True)
class MultipleKnot:
    """Where two stretches meet: the Euclidean derivatives of all rows that each of them ends with.

    ``before`` and ``after`` are (rows, MOST_SHARED_DERIVATIVES, 3); the first ``shared_counts`` (rows,) derivatives are
    the same numbers in both.
    """

    t: float
    before: Array
    after: Array
    shared_counts: Array


@dataclass(frozen=True)
class UniformStretch:
    """The part of the rail between two multiple knots, divided into equal spans."""

    start: MultipleKnot
    end: MultipleKnot
    spans: int

    @property
    def length(self) -> float:
        """Length in the parameter."""
        return self.end.t - self.start.t

    def compute_span_ends(self) -> tuple[Array, Array]:
        """Return the starts and the ends of its spans, (spans,) each."""
        inner = self.start.t + self.length / self.spans * np.arange(1, self.spans)
        return np.concatenate([[self.start.t], inner]), np.concatenate([inner, [self.end.t]])

    def sample_inside(self, count: int) -> Array:
        """Return ``count`` parameters spread evenly over its inside."""
        return self.start.t + self.length * (np.arange(count) + 0.5) / count


@lru_cache(maxsize=128)
def _build_fit_matrix(spans: int, first: int, last: int) -> Array:
    """Return the matrix of the least-squares quintic on [0, 1] with uniform single knots.

    It maps ``first`` derivatives at 0 and ``last`` at 1, which the quintic interpolates, and its values at the samples
    to Bernstein coefficients by piece: (spans * 6, first + last + samples).
    """
    count = spans + COMPACT_DEGREE
    knots = np.concatenate([np.zeros(COMPACT_DEGREE), np.linspace(0, 1, spans + 1), np.ones(COMPACT_DEGREE)])
    _, pieces, _ = extract_pieces(COMPACT_DEGREE, knots, np.eye(count))
    basis = Curve.from_bspline(COMPACT_DEGREE, knots, np.eye(count))
    samples = basis((np.arange(_count_samples(spans)) + 0.5) / _count_samples(spans))
    fixed = np.r_[:first, count - last : count]
    free = np.arange(first, count - last)
    ends = np.concatenate([basis.jet(0.0, first - 1), basis.jet(1.0, last - 1)])[:, fixed]
    solution = np.zeros((count, first + last + len(samples)))
    solution[fixed, : first + last] = np.linalg.inv(ends)
    if len(free):
        q, r = np.linalg.qr(samples[:, free])
        inverse = np.linalg.solve(r, q.T)
        solution[free, first + last :] = inverse
        solution[free, : first + last] = -inverse @ samples[:, fixed] @ solution[fixed, : first + last]
    matrix = np.einsum("icn,cd->nid", pieces, solution).reshape(-1, solution.shape[1])
    matrix[[0, -1]] = 0.0  # the end coefficients are the values given there, bit for bit
    matrix[0, 0] = matrix[-1, first] = 1.0
    matrix.setflags(write=False)
    return matrix


def _count_samples(spans: int) -> int:
    """Return how many samples the fit of a stretch is made of."""
    return COMPACT_TOLERANCES.samples_per_span * (spans + 1)


def fit_stretches(
    exact: ExactJets, stretches: list[UniformStretch]
) -> Iterable[tuple[UniformStretch, Array, Array, Array]]:
    """Fit stretches; yield each, in order, with coefficients (rows, 3, 6, spans), test points (n,) and errors there."""
    samples = [stretch.sample_inside(_count_samples(stretch.spans)) for stretch in stretches]
    tests = [_choose_test_points(exact, stretch) for stretch in stretches]
    t = np.concatenate(samples + tests)
    values = exact.evaluate_sides(t)
    sample_ends, test_ends = (np.cumsum([0] + [len(x) for x in part]) for part in (samples, tests))
    rows = np.concatenate([side[:, 0] for side in values])
    coefs = _fit_coefficients(stretches, [rows[:, i:j] for i, j in pairwise(sample_ends)])

    starts, ends = (
        np.concatenate(part) for part in zip(*(stretch.compute_span_ends() for stretch in stretches), strict=True)
    )
    at = t[sample_ends[-1] :]
    fit = _evaluate_fit(exact, np.concatenate(coefs, axis=-1), (starts, ends), at)
    widths = [_find_span_widths(starts, ends, at), _find_span_widths(exact.breaks[:-1], exact.breaks[1:], at)]
    errors = exact.measure_errors(fit, [side[:, :, sample_ends[-1] :] for side in values], np.minimum(*widths))
    for i, stretch in enumerate(stretches):
        yield stretch, coefs[i], tests[i], errors[test_ends[i] : test_ends[i + 1]]


def _find_span_widths(starts: Array, ends: Array, t: Array) -> Array:
    """Return the lengths of the spans in which parameters lie, (n,)."""
    return np.asarray((ends - starts)[np.clip(np.searchsorted(starts, t, "right") - 1, 0, len(starts) - 1)])


def _choose_test_points(exact: ExactJets, stretch: UniformStretch) -> Array:
    """Return the parameters at which errors are measured: ten in every span, and two in every exact piece."""
    inner = exact.breaks[(exact.breaks > stretch.start.t) & (exact.breaks < stretch.end.t)]
    ends = np.concatenate([[stretch.start.t], inner, [stretch.end.t]])
    pieces = [ends[:-1] + share * np.diff(ends) for share in (0.25, 0.75)]
    return np.concatenate([stretch.sample_inside(COMPACT_TOLERANCES.test_points_per_span * stretch.spans), *pieces])


def _fit_coefficients(stretches: list[UniformStretch], values: list[Array]) -> list[Array]:
    """Fit every row of every stretch to values (rows, samples, 3): Bernstein coefficients (rows, 3, 6, spans) each."""
    groups: dict[tuple[int, int, int], list[tuple[int, int]]] = {}
    for i, stretch in enumerate(stretches):
        shared = zip(_count_shared(stretch.start), _count_shared(stretch.end), strict=True)
        for row, (first, last) in enumerate(shared):
            groups.setdefault((stretch.spans, first, last), []).append((i, row))
    coefs = [
        np.empty((len(value), 3, COMPACT_DEGREE + 1, stretch.spans))
        for stretch, value in zip(stretches, values, strict=True)
    ]
    powers = np.arange(MOST_SHARED_DERIVATIVES)[:, None]
    for (spans, first, last), members in groups.items():
        data = []
        for i, row in members:
            stretch, scale = stretches[i], stretches[i].length ** powers
            ends = (scale * stretch.start.after[row])[:first], (scale * stretch.end.before[row])[:last]
            data.append(np.concatenate([*ends, values[i][row]]))
        solved = _build_fit_matrix(spans, first, last) @ np.concatenate(data, axis=1)
        for (i, row), poles in zip(members, np.split(solved, len(members), axis=1), strict=True):
            coefs[i][row] = poles.reshape(spans, COMPACT_DEGREE + 1, 3).transpose(2, 1, 0)
            coefs[i][row, :, -1, :-1] = coefs[i][row, :, 0, 1:]  # the same points, but for rounding
    return coefs


def _count_shared(knot: MultipleKnot) -> list[int]:
    """Return how many derivatives of each row a stretch takes over at an end: those that agree, its value always."""
    return np.maximum(knot.shared_counts, 1).tolist()


def _evaluate_fit(exact: ExactJets, coefs: Array, spans: tuple[Array, Array], t: Array) -> list[Array]:
    """Evaluate a fit (rows, 3, 6, spans) at t, as :meth:`ExactJets.evaluate_sides` does the exact jets.

    ``spans`` are the starts and the ends of its spans.
    """
    starts, ends = spans
    span = np.searchsorted(starts, t, "right") - 1
    length = (ends - starts)[span]
    s, x = (ends[span] - t) / length, (t - starts[span]) / length
    differences = np.moveaxis(coefs, 2, 0)[..., span]  # (6, rows, 3, n)
    derivatives = []
    for k in range(1 + max(map(count_derivatives, exact.sides))):
        derivatives.append(
            bernstein.contract_with_basis(differences, bernstein.evaluate_basis(COMPACT_DEGREE - k, s, x)) / length**k
        )
        differences = bernstein.differentiate_coefs(differences)
    values = np.stack(derivatives, axis=1).swapaxes(2, 3)  # (rows, orders, n, 3)
    first, second = exact.sides
    return [
        values[: len(first), : count_derivatives(first) + 1],
        values[len(first) :, : count_derivatives(second) + 1],
    ]
