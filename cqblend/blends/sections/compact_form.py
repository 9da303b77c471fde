"""Replaces the exact jets of two ribbons by the compact form: quintic splines with few knots, within tolerances.

Exact jets have a degree of 12, 18 or more and a knot of high multiplicity wherever a rail crosses a knot line. The
compact form consists of polynomial quintics on common knots, within a tolerance in position, in the tangent plane and
in curvature. Two sorts of knots make them few:

- multiple knots, where the exact jets really jump in a low derivative. There, and at both ends, the fit takes over the
  exact values and derivatives, as many as both sides have in common, up to the second;
- single knots (C4), uniform between two multiple ones (a *stretch*), fitted by least squares.

Whether a break of the exact jets becomes a multiple knot is decided by what ignoring it costs, not by its nominal
continuity: a cubic rail has a break with a tiny jump every few spans, a steered one crosses knot lines without any. A
C4 quintic with spans of length h misses a jump D of the m-th derivative by about ``JUMP_ERRORS[m]`` D h^m. From these
errors, and those due to the sixth derivatives, the stretches and their spans are predicted so that they take the fewest
poles; where the errors measured are larger, stretches are divided or get more spans until they are not.
"""

from __future__ import annotations

from itertools import islice, pairwise
from typing import NamedTuple

import numpy as np

from cqblend.blends.sections.exact_jets import JUMP_ERRORS, ExactJets, collect_exact_jets
from cqblend.blends.sections.hermite_section import Jets
from cqblend.blends.sections.quintic_fit import (
    COMPACT_DEGREE,
    MOST_SHARED_DERIVATIVES,
    MultipleKnot,
    UniformStretch,
    fit_stretches,
)
from cqblend.blends.sections.tolerances import COMPACT_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array

PIECE_SHARES = np.array([0.1, 0.5, 0.9])
"""Where in a piece of the exact jets, as shares of it, the length of spans is predicted."""


class _Refinement(NamedTuple):
    """What takes the place of a stretch that errs: where to divide it, and the spans of each part."""

    stretch: UniformStretch
    cuts: Array
    spans: list[int]


def compact_jets(
    sides: tuple[Jets, Jets], tolerance: float, angular_tolerance: float
) -> tuple[list[Curve], list[Curve]]:
    r"""Replace the exact jets of two ribbons by quintic splines on common knots.

    With X_k the Euclidean jets, C = X_0 the rail and T = X_1 the field, n the unit normal of C' and T, and
    :math:`\varepsilon`, :math:`\alpha` the two tolerances, the fit (f) has at equal t

    .. math::
        |C_f - C| \le \varepsilon, \qquad
        \angle(n_f, n) \le \alpha, \qquad
        |T_f - T| \le \alpha |T|

    and, with :math:`\beta = 10^{-5}` / size, size being the diagonal of the box around the rail, of a ribbon with

    - X_2: the normal curvatures along C' and T and the mixed one, :math:`\langle C'', n\rangle / |C'|^2`,
      :math:`\langle X_2, n\rangle / |T|^2` and :math:`\langle T', n\rangle / (|C'| |T|)`, to :math:`\beta`;
    - X_3: :math:`\langle X_3, n\rangle / |T|^3` to :math:`\beta` / size.

    On pieces so short that the rounding of poles shows in derivatives, that rounding is allowed as well.

    This is measured, with a margin of a tenth, at ten points of each span of the fit and two of each piece of the exact
    jets; it is not proven in between, and narrow features where C' and T are nearly parallel may be missed. At both
    ends the rows and their first two derivatives are the exact ones.

    Parameters
    ----------
    sides
        For each ribbon its jets d^k/dv^k, k = 0 .. 0 to 3: homogeneous (dim 4, weight last, not flagged rational), on
        breaks of their own over the same domain.
    tolerance
        In position, in the unit of the coordinates.
    angular_tolerance
        Of tangent planes, in rad.

    Returns
    -------
    tuple of two lists of Curve
        For each ribbon as many Euclidean jets (dim 3), all on the same breaks. Their continuity is that of the exact
        ones, up to 2, at multiple knots, where the exact jets really jump; 4 at all other breaks.

    Raises
    ------
    GeometryError
        If 4096 spans do not suffice.

    Examples
    --------
    A quarter of a cylinder, from below and from a plane above it:

    >>> arc = Curve.bezier([[1.0, 0, 0, 1], [1, 1, 0, 1], [0, 2, 0, 2]])
    >>> up = Curve.bezier([[0.0, 0, 1, 0], [0, 0, 1, 0], [0, 0, 2, 0]])
    >>> (rail, field), _ = compact_jets(((arc, up), (arc, up)), 1e-7, 1e-5)
    >>> rail.degree, rail.dim, bool(abs(rail.dot(rail)(0.3) - 1).max() < 2e-7)
    (5, 3, True)
    """
    exact = collect_exact_jets(sides, tolerance, angular_tolerance)
    waiting, kinks, influence = _predict_stretches(exact)
    done: list[tuple[UniformStretch, Array]] = []
    while waiting:
        if (
            sum(stretch.spans for stretch in waiting) + sum(stretch.spans for stretch, _ in done)
            > COMPACT_TOLERANCES.most_spans
        ):
            raise GeometryError(
                f"a compact blend of {COMPACT_TOLERANCES.most_spans} pieces does not reach {tolerance:g} mm and "
                f"{angular_tolerance:g} rad; ask for larger tolerances, or take form='exact'"
            )
        refinements = []
        for stretch, coefs, t, errors in fit_stretches(exact, waiting):
            if errors.max() <= 1:
                done.append((stretch, coefs))
                continue
            inside = (kinks > stretch.start.t) & (kinks < stretch.end.t)
            refinements.append(_plan_refinement(stretch, (t, errors), kinks[inside], influence[:, inside]))
        waiting = _divide_stretches(exact, refinements)
    return _assemble_curves(sorted(done, key=lambda fitted: fitted[0].start.t), len(sides[0]))


def _make_multiple_knots(exact: ExactJets, t: Array, spacing: Array) -> tuple[list[MultipleKnot], Array, Array]:
    """Make multiple knots at parameters t (n,); also return what ignoring the jumps there costs, twice (4, n).

    Derivatives agree up to the first whose jump is not harmless on spans of the length ``spacing``. The second costs
    are those of what sets a jump apart from the one before or after it, if that is less: jumps of a smooth curve that
    is given as a spline with many breaks are nearly alike, and a fit with longer spans averages them away.
    """
    before, after = (exact.evaluate_rows(t, len(JUMP_ERRORS) - 1, side) for side in ("left", "right"))
    middle = (before + after) / 2
    jumps = after - before
    costs = exact.estimate_jump_costs(jumps, middle[:, :2])
    powers = spacing ** np.arange(len(JUMP_ERRORS))[:, None]
    agreed = np.ones((len(jumps), MOST_SHARED_DERIVATIVES, len(t)), dtype=bool)
    for order in range(MOST_SHARED_DERIVATIVES):
        of_one = [costs[:, k, order - k] * powers[order - k] for k in range(order + 1)]
        agreed[:, order] = np.max(of_one, axis=0) <= COMPACT_TOLERANCES.harmless_jump_share
    agreed = np.logical_and.accumulate(agreed, axis=1)
    first, second = (
        np.where(agreed[..., None], middle[:, :MOST_SHARED_DERIVATIVES], x[:, :MOST_SHARED_DERIVATIVES])
        for x in (before, after)
    )
    count = agreed.sum(axis=1)
    multiple_knots = [MultipleKnot(float(at), first[:, :, i], second[:, :, i], count[:, i]) for i, at in enumerate(t)]
    influence = costs.max(axis=(0, 1))
    steps = np.diff(jumps, axis=2)
    for unlike in (steps[:, :, :-1], steps[:, :, 1:]):
        costs[..., 1:-1] = np.minimum(costs[..., 1:-1], exact.estimate_jump_costs(unlike, middle[:, :2, 1:-1]))
    return multiple_knots, influence, costs.max(axis=(0, 1))


def _predict_stretches(exact: ExactJets) -> tuple[list[UniformStretch], Array, Array]:
    """Choose multiple knots, and the spans between them, that take the fewest poles by what errors are expected.

    Multiple knots may be where the jets jump by more than is tolerated on spans about as long as the pieces around.
    Other jumps only make spans shorter, if those next to them are unlike. Returns the stretches, the breaks (n,) that
    are no multiple knots, and the costs a (4, n) of ignoring the jumps there: a[m] h^m tolerances on spans of length h.
    """
    t = exact.breaks
    neighbours = np.arange(len(t))[:, None] + [-3, 3]
    low, high = np.clip(neighbours, 0, len(t) - 1).T
    spacing = (t[high] - t[low]) / (high - low)
    multiple_knots, influence, unlike_influence = _make_multiple_knots(exact, t, spacing)
    harmless = _find_harmless_lengths(influence)
    candidate = harmless < COMPACT_TOLERANCES.candidate_pieces * spacing
    candidate[[0, -1]] = True
    harmless = np.where(harmless < spacing, harmless, _find_harmless_lengths(unlike_influence))

    points = t[:-1] + np.diff(t) * PIECE_SHARES[:, None]
    spans_per_length = (1 / exact.estimate_span_widths(points.ravel())).reshape(points.shape).max(axis=0)
    spans_per_jump = 1 / np.maximum(harmless, np.finfo(float).tiny)
    spans_per_jump[[0, -1]] = 0.0
    ignored = np.where(candidate, 0.0, spans_per_jump)
    spans_per_length = np.maximum(spans_per_length, np.maximum(ignored[:-1], ignored[1:]))

    at = np.flatnonzero(candidate)
    extra_poles = np.array([COMPACT_DEGREE - multiple_knots[i].shared_counts.min() for i in at])
    parts, spans = _minimise_poles(
        t[at], np.maximum.reduceat(spans_per_length, at[:-1]), spans_per_jump[at], extra_poles
    )
    chosen = at[parts]
    knots = [multiple_knots[i] for i in chosen]
    stretches = [UniformStretch(start, end, n) for (start, end), n in zip(pairwise(knots), spans, strict=True)]
    return stretches, np.delete(t, chosen), np.delete(influence, chosen, axis=1)


def _minimise_poles(
    t: Array, spans_per_length: Array, spans_per_jump: Array, extra_poles: Array
) -> tuple[list[int], list[int]]:
    """Choose those of n parameters at which multiple knots make for the fewest poles, and the spans between them.

    Both ends are among them. ``spans_per_length`` (n - 1,) and ``spans_per_jump`` (n,) are what the jets between
    parameters, and jumps at those that are not chosen, ask for; ``extra_poles`` (n,) are what a multiple knot costs
    beyond a single one.
    """
    n = len(t)
    reach = min(n - 1, COMPACT_TOLERANCES.most_candidates_apart)
    last = np.arange(n - 1)[:, None] + np.arange(reach)  # last part of the stretch that starts at i and has k + 1
    beyond = last > n - 2
    last = np.minimum(last, n - 2)
    density = spans_per_length[last]
    density[:, 1:] = np.maximum(density[:, 1:], spans_per_jump[last[:, 1:]])
    density = np.maximum.accumulate(density, axis=1)
    with np.errstate(over="ignore"):
        spans = np.ceil(density * (t[last + 1] - t[:-1, None]) - COMPACT_TOLERANCES.forgiven_span_share)
    spans = np.maximum(spans, 1.0)
    spans[:, 1:][spans[:, 1:] > COMPACT_TOLERANCES.most_stretch_spans] = np.inf
    poles = np.where(beyond, np.inf, spans + extra_poles[last + 1])
    least, previous = np.full(n, np.inf), np.zeros(n, dtype=int)
    least[0] = 0.0
    for i in range(n - 1):
        ends = slice(i + 1, min(i + reach, n - 1) + 1)
        total = least[i] + poles[i, : ends.stop - ends.start]
        better = total < least[ends]
        least[ends][better] = total[better]
        previous[ends][better] = i
    chosen = [n - 1]
    while chosen[-1]:
        chosen.append(int(previous[chosen[-1]]))
    chosen.reverse()
    most = COMPACT_TOLERANCES.most_stretch_spans
    return chosen, [int(min(spans[i, j - i - 1], most)) for i, j in pairwise(chosen)]


def _find_harmless_lengths(influence: Array) -> Array:
    """Return the longest spans on which jumps of that cost (4, n) may be ignored, (n,)."""
    orders = np.arange(1, len(influence))[:, None]
    lengths = np.maximum(influence[1:], np.finfo(float).tiny) ** (-1 / orders)
    return np.where(influence[0] > 1, 0.0, lengths.min(axis=0))


def _plan_refinement(
    stretch: UniformStretch, measured: tuple[Array, Array], kinks: Array, influence: Array
) -> _Refinement:
    """Decide what takes the place of a stretch that errs, from test points and the errors ``measured`` there.

    It is divided at those jumps, at ``kinks`` (n,), that explain its errors and would take more short spans than a
    multiple knot costs. Else it gets more spans, uniformly or, where that takes fewer, each half with its own number.
    """
    t, errors = measured
    n, width = stretch.spans, stretch.length / stretch.spans
    terms = influence * width ** np.arange(len(influence))[:, None]
    cost, order = terms.max(axis=0), terms.argmax(axis=0)
    found = np.where(np.abs(t - kinks[:, None]) <= width, errors, 0).max(axis=1)
    explained = np.flatnonzero((cost > 1) & (found > 1) & (cost > COMPACT_TOLERANCES.explained_share * found))
    if len(explained):
        least, power = np.minimum(cost, found)[explained], order[explained]
        shorter = np.where(power > 0, least ** (1 / np.maximum(power, 1)), COMPACT_TOLERANCES.most_spans)
        worst = explained[np.argsort(-shorter)]
        counts = n * np.append(-np.sort(-shorter), 1)
        chosen = np.argmin(counts + COMPACT_TOLERANCES.multiple_knot_cost * np.arange(len(counts)))
        if chosen:
            cuts = np.sort(kinks[worst[:chosen]])
            shares = np.diff([stretch.start.t, *cuts, stretch.end.t]) / stretch.length
            return _Refinement(stretch, cuts, np.maximum(1, np.round(n * shares)).astype(int).tolist())
    # an error falls with the fifth power of the number of spans, that of a slope; with less if it is due to jumps
    power = 1 / (COMPACT_DEGREE - bool(len(explained)))
    middle = (stretch.start.t + stretch.end.t) / 2
    more = int(
        np.ceil(n * np.clip(errors.max() ** power, COMPACT_TOLERANCES.least_growth, COMPACT_TOLERANCES.most_growth))
    )
    halves = [
        int(
            np.ceil(
                n
                / 2
                * np.clip(
                    errors[half].max() ** power, COMPACT_TOLERANCES.least_half_factor, COMPACT_TOLERANCES.most_growth
                )
            )
        )
        for half in (t < middle, t >= middle)
    ]
    if more > COMPACT_TOLERANCES.most_stretch_spans or sum(halves) + COMPACT_TOLERANCES.multiple_knot_cost < more:
        return _Refinement(stretch, np.array([middle]), halves)
    return _Refinement(stretch, np.empty(0), [more])


def _divide_stretches(exact: ExactJets, refinements: list[_Refinement]) -> list[UniformStretch]:
    """Divide stretches as planned; cuts next to a break of the exact jets move there."""
    cuts = np.concatenate([np.empty(0), *(plan.cuts for plan in refinements)])
    widths = np.repeat(
        [plan.stretch.length / plan.stretch.spans for plan in refinements], [len(plan.cuts) for plan in refinements]
    )
    after = np.searchsorted(exact.breaks, cuts)
    low, high = exact.breaks[after - 1], exact.breaks[after]
    nearest = np.where(cuts - low < high - cuts, low, high)
    cuts = np.where(np.abs(nearest - cuts) < COMPACT_TOLERANCES.snap_share * widths, nearest, cuts)
    multiple_knots = iter(_make_multiple_knots(exact, cuts, widths)[0] if len(cuts) else [])
    divided = []
    for plan in refinements:
        ends = [plan.stretch.start, *islice(multiple_knots, len(plan.cuts)), plan.stretch.end]
        divided += [UniformStretch(a, b, count) for (a, b), count in zip(pairwise(ends), plan.spans, strict=True)]
    return divided


def _assemble_curves(done: list[tuple[UniformStretch, Array]], first_count: int) -> tuple[list[Curve], list[Curve]]:
    """Return the curves of both sides, of fitted stretches in order: the first rows are those of the first side."""
    breaks = np.concatenate([stretch.compute_span_ends()[0] for stretch, _ in done] + [[done[-1][0].end.t]])
    coefs = np.concatenate([rows for _, rows in done], axis=-1)
    continuity = np.full((len(coefs), len(breaks) - 2), COMPACT_DEGREE - 1)
    at = np.cumsum([stretch.spans for stretch, _ in done])[:-1] - 1
    for i, (stretch, _) in zip(at, done, strict=False):
        continuity[:, i] = stretch.end.shared_counts - 1
    rows = [Curve(breaks, c.swapaxes(0, 1), continuity=order) for c, order in zip(coefs, continuity, strict=True)]
    return rows[:first_count], rows[first_count:]
