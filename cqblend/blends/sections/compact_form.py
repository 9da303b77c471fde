"""The compact form: quintic splines with few knots in place of the exact jets of two ribbons.

Exact jets have a degree of 12, 18 or more and a knot of high multiplicity wherever a rail crosses a knot line. This
module replaces them by polynomial quintics on common knots, within a tolerance in position, in the tangent plane and in
curvature. Two sorts of knots make them few:

- *joints*, multiple knots, where the exact jets really jump in a low derivative. There, and at both ends, the fit takes
  over the exact values and derivatives, as many as have both sides in common, up to the second;
- single knots (C4), uniform between two joints, fitted by least squares. Their number follows from the error found.

Whether a break of the exact jets is a joint is decided by what ignoring it costs, not by its nominal continuity: a
cubic rail has a break with a tiny jump every few spans, a steered one crosses knot lines without any. A C4 quintic with
spans of length h misses a jump D of the m-th derivative by about `KINK[m]` D h^m.

It must not know where jets come from, nor how a surface is made of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice, pairwise

import numpy as np

from cqblend.blends.rails.ribbon import evaluate_space_jets
from cqblend.errors import GeometryError
from cqblend.splines import Curve, bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import align_breaks
from cqblend.splines.evaluation import BreakSide
from cqblend.splines.knots import extract_pieces
from cqblend.surfaces.vectors import cross_product

DEGREE = 5  # single knots of a higher one do not survive re-assembly, which keeps amplification of rounding below 50
MOST_SHARED_DERIVATIVES = 3  # values and derivatives taken over at a joint, at most: half the coefficients of a quintic
CURVATURE_TOLERANCE = 1e-5  # tolerance in curvature, in units of 1 / size of the rail
TOLERANCE_SHARE = 0.9  # share of the tolerances that may be used up where they are measured
MOST_SPANS = 4096  # spans
MOST_STRETCH_SPANS = 48  # spans between two joints: longer stretches are halved, so that matrices stay small
LEAST_GROWTH, MOST_GROWTH = 1.08, 4.0  # factors from one number of spans to the next
LEAST_HALF_FACTOR = 0.5  # of a half that is good enough while the other is not
JUMP_ERRORS = np.array([0.5, 0.1, 0.017, 0.005])
"""Largest error of a C4 quintic with unit spans that is fitted to a unit jump of derivative 0 .. 3 by least squares."""
HARMLESS_JUMP_SHARE = 0.05  # share of the tolerance up to which a jump is averaged away
JOINT_COST = 3  # poles that a joint costs beyond single knots
EXPLAINED_ERROR_SHARE = 0.3  # a jump explains an error if ignoring it costs this share of it
SNAP_SHARE = 0.1  # of a span: nearer breaks of the exact jets take the place of the middle of a stretch
TINY_LENGTH = 1e-100  # length of a vector that has none
COEFFICIENT_ROUNDING = 16 * float(
    np.finfo(float).eps
)  # of the coefficients of a jet, as far as it shows in what is compared
SAMPLES_PER_SPAN, TEST_POINTS_PER_SPAN = 4, 10  # samples of each span

Jets = Sequence[Curve]


@dataclass(frozen=True)
class _MultipleKnot:
    """Where two stretches meet: the Euclidean derivatives of all rows that each of them ends with."""

    t: float
    before: Array  # (rows, SHARED, 3)
    after: Array  # (rows, SHARED, 3), its first ``shared_counts`` derivatives the same numbers
    shared_counts: Array  # (rows,)


@dataclass(frozen=True)
class _UniformStretch:
    """What lies between two joints, on uniform spans."""

    start: _MultipleKnot
    end: _MultipleKnot
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


@dataclass(frozen=True)
class _ExactJets:
    """The exact jets of both ribbons, all on the same breaks, and what a fit of them may miss.

    Rows are the Euclidean jets of the first side by order, then those of the second.
    """

    sides: tuple[list[Curve], list[Curve]]
    tolerance: float
    angular: float
    sizes: tuple[float, float]  # of the rails

    @property
    def breaks(self) -> Array:
        """Breaks common to all jets."""
        return self.sides[0][0].breaks

    def evaluate_rows(self, t: Array, order: int, side: BreakSide) -> Array:
        """Return the Euclidean rows with their derivatives by t, (rows, order + 1, n, 3)."""
        return np.concatenate([evaluate_space_jets(jets, t, order, side) for jets in self.sides])

    def evaluate_sides(self, t: Array) -> list[Array]:
        """Return for each side its Euclidean jets with the derivatives that count, (orders, 2 or 3, n, 3)."""
        return [evaluate_space_jets(jets, t, _count_derivatives(jets), "right") for jets in self.sides]

    def measure_errors(self, fitted: list[Array], exact: list[Array], widths: Array) -> Array:
        """Compare what :meth:`evaluate_sides` returns: (n,), the largest error of any sort as a share of its tolerance.

        Derivatives on pieces of the ``widths`` (n,) are known to the rounding of poles over these, and no better by any
        number of spans: on short ones, that is allowed as well.
        """
        ratios = []
        step = 2 * self.sides[0][0].degree / widths
        for fit, true, size, jets in zip(fitted, exact, self.sizes, self.sides, strict=True):
            noise = [COEFFICIENT_ROUNDING * float(np.abs(jet.coefs).max()) for jet in jets]
            ratios.append(_compute_norms(fit[0, 0] - true[0, 0]) / self.tolerance)
            if len(fit) == 1:
                continue
            speed, reach = (np.maximum(_compute_norms(x), TINY_LENGTH) for x in (true[0, 1], true[1, 0]))
            ratios.append(_compute_norms(fit[1, 0] - true[1, 0]) / (reach * self.angular + noise[1]))
            n, wanted = (cross_product(x[0, 1], x[1, 0]) for x in (fit, true))
            turned = np.arctan2(_compute_norms(cross_product(n, wanted)), (n * wanted).sum(-1))
            ratios.append(turned / (self.angular + noise[0] * step / speed + noise[1] / reach))
            if len(fit) == 2:
                continue
            unsure = [noise[2] / reach**2, noise[0] * (step / speed) ** 2, noise[1] * step / (speed * reach)]
            unsure += [one * size / reach**3 for one in noise[3:]]
            bends = zip(_compute_curvatures(fit, size), _compute_curvatures(true, size), unsure, strict=True)
            ratios += [np.abs(x - y) / (CURVATURE_TOLERANCE + size * allowed) for x, y, allowed in bends]
        return np.asarray(np.max(ratios, axis=0) / TOLERANCE_SHARE)

    def estimate_jump_costs(self, jumps: Array, rows: Array) -> Array:
        """Return what ignoring jumps (rows, 4, n, 3) costs: a[r, m] h^m tolerances of row r, (rows, 4, n).

        ``rows`` are the Euclidean rows with their first derivatives, (rows, 2, n, 3). A jump counts by the slope and by
        the curvature as well, which have one derivative and two less; for these, what lies in the tangent plane does no
        harm.
        """
        out, first = np.zeros(jumps.shape[:-1]), 0
        for jets, size in zip(self.sides, self.sizes, strict=True):
            own, count = jumps[first : first + len(jets)], len(jets)
            allowed = [np.full(jumps.shape[2], self.tolerance)]
            if count > 1:
                speed, reach = (
                    np.maximum(_compute_norms(x), TINY_LENGTH) for x in (rows[first, 1], rows[first + 1, 0])
                )
                allowed += [
                    self.angular * reach,
                    *(CURVATURE_TOLERANCE * reach**k / size ** (k - 1) for k in range(2, count)),
                ]
            costs = JUMP_ERRORS[:, None] * _compute_norms(own) / np.stack(allowed)[:, None]
            if count > 1:
                normal = cross_product(rows[first, 1], rows[first + 1, 0])
                bent = np.abs((own[:2] * normal).sum(-1)) / np.maximum(_compute_norms(normal), TINY_LENGTH)
                finer = [(0, 1, self.angular * speed)]
                if count > 2:
                    bend = CURVATURE_TOLERANCE / size
                    finer += [(0, 2, bend * speed**2), (1, 1, bend * speed * reach)]
                for row, lost, limit in finer:
                    left = len(JUMP_ERRORS) - lost
                    costs[row, :left] = np.maximum(
                        costs[row, :left], JUMP_ERRORS[:left, None] * bent[row, lost:] / limit
                    )
            out[first : first + count] = costs
            first += count
        return out


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
        ones, up to 2, at joints, where the exact jets really jump; 4 at all other breaks.

    Raises
    ------
    GeometryError
        If 4096 spans do not suffice.

    Examples
    --------
    A quarter of a cylinder, from below and from a plane above it:

    >>> arc = Curve.bezier([[1.0, 0, 0, 1], [1, 1, 0, 1], [0, 2, 0, 2]])
    >>> up = Curve.bezier([[0.0, 0, 1, 0], [0, 0, 1, 0], [0, 0, 2, 0]])
    >>> (rail, field), _ = compact(((arc, up), (arc, up)), 1e-7, 1e-5)
    >>> rail.degree, rail.dim, bool(abs(rail.dot(rail)(0.3) - 1).max() < 2e-7)
    (5, 3, True)
    """
    exact = _collect_exact_jets(sides, tolerance, angular_tolerance)
    joints, kinks, influence = _choose_joints(exact)
    pieces = np.searchsorted(exact.breaks, [joint.t for joint in joints])
    waiting = [
        _UniformStretch(start, end, min(max(1, int(count) // 8), 8))
        for (start, end), count in zip(pairwise(joints), np.diff(pieces), strict=True)
    ]
    done: list[tuple[_UniformStretch, Array]] = []
    while waiting:
        if sum(stretch.spans for stretch in waiting) + sum(stretch.spans for stretch, _ in done) > MOST_SPANS:
            raise GeometryError(
                f"a compact blend of {MOST_SPANS} pieces does not reach {tolerance:g} mm and {angular_tolerance:g} "
                "rad; "
                "ask for larger tolerances, or take form='exact'"
            )
        plans = []
        for stretch, coefs, t, errors in _fit_stretches(exact, waiting):
            if errors.max() <= 1:
                done.append((stretch, coefs))
                continue
            inside = (kinks > stretch.start.t) & (kinks < stretch.end.t)
            plans.append((stretch, *_plan_refinement(stretch, t, errors, kinks[inside], influence[:, inside])))
        waiting = _divide_stretches(exact, plans)
    return _assemble_curves(sorted(done, key=lambda one: one[0].start.t), len(sides[0]))


def _compute_norms(vectors: Array) -> Array:
    return np.asarray(np.sqrt((vectors * vectors).sum(-1)))


def _collect_exact_jets(sides: tuple[Jets, Jets], tolerance: float, angular: float) -> _ExactJets:
    together = align_breaks([*sides[0], *sides[1]])
    first, second = together[: len(sides[0])], together[len(sides[0]) :]
    breaks = first[0].breaks
    sizes = []
    for rail in (first[0], second[0]):
        points = rail(np.concatenate([breaks, np.linspace(breaks[0], breaks[-1], 65)]))
        sizes.append(float(np.linalg.norm(np.ptp(points[:, :3] / points[:, 3:], axis=0))))
    return _ExactJets((first, second), tolerance, angular, (sizes[0], sizes[1]))


def _count_derivatives(jets: Jets) -> int:
    """Count the derivatives by t that errors are measured in: of second order where curvature is to agree."""
    return 1 if len(jets) < 3 else 2


def _compute_curvatures(rows: Array, size: float) -> list[Array]:
    """Return the normal curvatures along T and C', the mixed one, and the normal part of the third jet, (n,) each.

    In units of the size, from Euclidean jets with their derivatives (orders, 3, n, 3); as many as there are jets for.
    """
    if len(rows) < 3:
        return []
    normal = cross_product(rows[0, 1], rows[1, 0])
    normal = normal / _compute_norms(normal)[:, None]
    speed, reach = _compute_norms(rows[0, 1]), _compute_norms(rows[1, 0])
    bends = [(rows[2, 0], size / reach**2), (rows[0, 2], size / speed**2), (rows[1, 1], size / (speed * reach))]
    bends += [(row[0], size**2 / reach**3) for row in rows[3:]]
    return [np.asarray((vector * normal).sum(-1) * factor) for vector, factor in bends]


def _make_joints(exact: _ExactJets, t: Array, spacing: Array) -> tuple[list[_MultipleKnot], Array]:
    """Make joints at parameters t; also return the influence of the jumps there, (rows, 4, n).

    Derivatives agree up to the first whose jump is not harmless on spans of the length ``spacing``.
    """
    before, after = (exact.evaluate_rows(t, len(JUMP_ERRORS) - 1, side) for side in ("left", "right"))
    middle = (before + after) / 2
    jumps, powers = after - before, spacing ** np.arange(len(JUMP_ERRORS))[:, None]
    influence = exact.estimate_jump_costs(jumps, middle[:, :2])
    single = np.eye(len(JUMP_ERRORS))[:MOST_SHARED_DERIVATIVES, None, :, None, None] * jumps  # one derivative at a time
    costs = [(exact.estimate_jump_costs(one, middle[:, :2]) * powers).max(axis=1) for one in single]
    agreed = np.cumprod(np.stack(costs, axis=1) <= HARMLESS_JUMP_SHARE, axis=1).astype(bool)
    first, second = (
        np.where(agreed[..., None], middle[:, :MOST_SHARED_DERIVATIVES], x[:, :MOST_SHARED_DERIVATIVES])
        for x in (before, after)
    )
    count = agreed.sum(axis=1)
    joints = [_MultipleKnot(float(at), first[:, :, i], second[:, :, i], count[:, i]) for i, at in enumerate(t)]
    return joints, influence


def _choose_joints(exact: _ExactJets) -> tuple[list[_MultipleKnot], Array, Array]:
    """Decide at which breaks the jets really jump: on spans as long as the pieces around, more than is tolerated.

    Returns the joints, both ends included, the other breaks (n,), and what a smooth fit loses there: a[m] h^m
    tolerances on spans of length h, (4, n).
    """
    t = exact.breaks
    around = np.arange(len(t))[:, None] + [-3, 3]
    low, high = np.clip(around, 0, len(t) - 1).T
    spacing = (t[high] - t[low]) / (high - low)
    joints, influence = _make_joints(exact, t, spacing)
    worst = influence.max(axis=0)
    chosen = _find_harmless_lengths(worst) * JOINT_COST < spacing
    chosen[[0, -1]] = True
    return [joints[i] for i in np.flatnonzero(chosen)], t[~chosen], worst[:, ~chosen]


def _find_harmless_lengths(influence: Array) -> Array:
    """Return the longest spans on which jumps with that influence (4, n) may be ignored, (n,)."""
    orders = np.arange(1, len(influence))[:, None]
    lengths = np.maximum(influence[1:], np.finfo(float).tiny) ** (-1 / orders)
    return np.where(influence[0] > 1, 0.0, lengths.min(axis=0))


@lru_cache(maxsize=128)
def _build_fit_matrix(spans: int, first: int, last: int) -> Array:
    """Return the matrix of the least-squares quintic on [0, 1] with uniform single knots.

    From ``first`` derivatives at 0 and ``last`` at 1, which it takes over, and from the values at the samples; to
    Bernstein coefficients by piece: (spans * 6, first + last + samples).
    """
    count = spans + DEGREE
    knots = np.concatenate([np.zeros(DEGREE), np.linspace(0, 1, spans + 1), np.ones(DEGREE)])
    _, pieces, _ = extract_pieces(DEGREE, knots, np.eye(count))
    basis = Curve.from_bspline(DEGREE, knots, np.eye(count))
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
    matrix[[0, -1]] = 0.0  # the ends are the data, bit for bit
    matrix[0, 0] = matrix[-1, first] = 1.0
    matrix.setflags(write=False)
    return matrix


def _count_samples(spans: int) -> int:
    return SAMPLES_PER_SPAN * (spans + 1)


def _fit_stretches(
    exact: _ExactJets, stretches: list[_UniformStretch]
) -> Iterable[tuple[_UniformStretch, Array, Array, Array]]:
    """Fit stretches, in order: yield each with coefficients (rows, 3, 6, spans), and the errors at parameters."""
    taken = [stretch.sample_inside(_count_samples(stretch.spans)) for stretch in stretches]
    checks = [_choose_test_points(exact, stretch) for stretch in stretches]
    t = np.concatenate(taken + checks)
    values = exact.evaluate_sides(t)
    used, checked = (np.cumsum([0] + [len(one) for one in part]) for part in (taken, checks))
    rows = np.concatenate([side[:, 0] for side in values])
    coefs = _fit_coefficients(stretches, [rows[:, i:j] for i, j in pairwise(used)])

    starts, ends = (
        np.concatenate(part) for part in zip(*(stretch.compute_span_ends() for stretch in stretches), strict=True)
    )
    fit = _evaluate_fit(exact, np.concatenate(coefs, axis=-1), starts, ends, t[used[-1] :])
    at = t[used[-1] :]
    widths = [_find_span_widths(starts, ends, at), _find_span_widths(exact.breaks[:-1], exact.breaks[1:], at)]
    errors = exact.measure_errors(fit, [side[:, :, used[-1] :] for side in values], np.minimum(*widths))
    for i, stretch in enumerate(stretches):
        yield stretch, coefs[i], checks[i], errors[checked[i] : checked[i + 1]]


def _find_span_widths(starts: Array, ends: Array, t: Array) -> Array:
    """Return the lengths of the spans in which parameters lie, (n,)."""
    return np.asarray((ends - starts)[np.clip(np.searchsorted(starts, t, "right") - 1, 0, len(starts) - 1)])


def _choose_test_points(exact: _ExactJets, stretch: _UniformStretch) -> Array:
    """Choose where to measure: ten points of every span, and two of every exact piece."""
    inner = exact.breaks[(exact.breaks > stretch.start.t) & (exact.breaks < stretch.end.t)]
    ends = np.concatenate([[stretch.start.t], inner, [stretch.end.t]])
    pieces = [ends[:-1] + share * np.diff(ends) for share in (0.25, 0.75)]
    return np.concatenate([stretch.sample_inside(TEST_POINTS_PER_SPAN * stretch.spans), *pieces])


def _fit_coefficients(stretches: list[_UniformStretch], values: list[Array]) -> list[Array]:
    """Fit every row of every stretch to values (rows, samples, 3): Bernstein coefficients (rows, 3, 6, spans) each."""
    groups: dict[tuple[int, int, int], list[tuple[int, int]]] = {}
    for i, stretch in enumerate(stretches):
        shared = zip(_count_shared(stretch.start), _count_shared(stretch.end), strict=True)
        for row, (first, last) in enumerate(shared):
            groups.setdefault((stretch.spans, first, last), []).append((i, row))
    coefs = [
        np.empty((len(value), 3, DEGREE + 1, stretch.spans)) for stretch, value in zip(stretches, values, strict=True)
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
            coefs[i][row] = poles.reshape(spans, DEGREE + 1, 3).transpose(2, 1, 0)
            coefs[i][row, :, -1, :-1] = coefs[i][row, :, 0, 1:]  # equal but for rounding
    return coefs


def _count_shared(joint: _MultipleKnot) -> list[int]:
    """Count the derivatives of each row that a stretch takes over: those that agree, and its own value in any case."""
    return np.maximum(joint.shared_counts, 1).tolist()


def _evaluate_fit(exact: _ExactJets, coefs: Array, starts: Array, ends: Array, t: Array) -> list[Array]:
    """Evaluate a fit (rows, 3, 6, spans), as :meth:`_ExactJets.evaluate_sides` does the exact jets."""
    span = np.searchsorted(starts, t, "right") - 1
    length = (ends - starts)[span]
    s, x = (ends[span] - t) / length, (t - starts[span]) / length
    differences = np.moveaxis(coefs, 2, 0)[..., span]  # (6, rows, 3, n)
    derivatives = []
    for k in range(1 + max(map(_count_derivatives, exact.sides))):
        derivatives.append(
            bernstein.contract_with_basis(differences, bernstein.evaluate_basis(DEGREE - k, s, x)) / length**k
        )
        differences = bernstein.differentiate_coefs(differences)
    values = np.stack(derivatives, axis=1).swapaxes(2, 3)  # (rows, orders, n, 3)
    first, second = exact.sides
    return [
        values[: len(first), : _count_derivatives(first) + 1],
        values[len(first) :, : _count_derivatives(second) + 1],
    ]


def _plan_refinement(
    stretch: _UniformStretch, t: Array, errors: Array, kinks: Array, influence: Array
) -> tuple[Array, list[int]]:
    """Decide what takes the place of a stretch that errs: where to divide it, and the spans of each part.

    It is divided at those jumps that explain its errors and cost more as ever shorter spans than as joints. Else it
    gets more spans, uniformly or, where that takes fewer, each half with its own number.
    """
    n, width = stretch.spans, stretch.length / stretch.spans
    terms = influence * width ** np.arange(len(influence))[:, None]
    cost, order = terms.max(axis=0), terms.argmax(axis=0)
    found = np.where(np.abs(t - kinks[:, None]) <= width, errors, 0).max(axis=1)
    explained = np.flatnonzero((cost > 1) & (found > 1) & (cost > EXPLAINED_ERROR_SHARE * found))
    if len(explained):
        least, power = np.minimum(cost, found)[explained], order[explained]
        shorter = np.where(power > 0, least ** (1 / np.maximum(power, 1)), MOST_SPANS)
        worst = explained[np.argsort(-shorter)]
        counts = n * np.append(-np.sort(-shorter), 1)
        chosen = np.argmin(counts + JOINT_COST * np.arange(len(counts)))
        if chosen:
            cuts = np.sort(kinks[worst[:chosen]])
            shares = np.diff([stretch.start.t, *cuts, stretch.end.t]) / stretch.length
            return cuts, np.maximum(1, np.round(n * shares)).astype(int).tolist()
    # an error falls with the fifth power of the number of spans, that of a slope; with less if it is due to jumps
    power = 1 / (DEGREE - bool(len(explained)))
    middle = (stretch.start.t + stretch.end.t) / 2
    more = int(np.ceil(n * np.clip(errors.max() ** power, LEAST_GROWTH, MOST_GROWTH)))
    halves = [
        int(np.ceil(n / 2 * np.clip(errors[half].max() ** power, LEAST_HALF_FACTOR, MOST_GROWTH)))
        for half in (t < middle, t >= middle)
    ]
    if more > MOST_STRETCH_SPANS or sum(halves) + JOINT_COST < more:
        return np.array([middle]), halves
    return np.empty(0), [more]


def _divide_stretches(
    exact: _ExactJets, plans: list[tuple[_UniformStretch, Array, list[int]]]
) -> list[_UniformStretch]:
    """Carry out plans: stretches, where to divide them, and the spans of each part."""
    cuts = np.concatenate([np.empty(0), *(cut for _, cut, _ in plans)])
    widths = np.repeat([stretch.length / stretch.spans for stretch, _, _ in plans], [len(cut) for _, cut, _ in plans])
    after = np.searchsorted(exact.breaks, cuts)
    low, high = exact.breaks[after - 1], exact.breaks[after]
    nearest = np.where(cuts - low < high - cuts, low, high)
    cuts = np.where(np.abs(nearest - cuts) < SNAP_SHARE * widths, nearest, cuts)
    joints = iter(_make_joints(exact, cuts, widths)[0] if len(cuts) else [])
    divided = []
    for stretch, cut, counts in plans:
        ends = [stretch.start, *islice(joints, len(cut)), stretch.end]
        divided += [_UniformStretch(a, b, count) for (a, b), count in zip(pairwise(ends), counts, strict=True)]
    return divided


def _assemble_curves(done: list[tuple[_UniformStretch, Array]], first: int) -> tuple[list[Curve], list[Curve]]:
    """Put the stretches together: the first rows make up the first side."""
    breaks = np.concatenate([stretch.compute_span_ends()[0] for stretch, _ in done] + [[done[-1][0].end.t]])
    coefs = np.concatenate([rows for _, rows in done], axis=-1)
    continuity = np.full((len(coefs), len(breaks) - 2), DEGREE - 1)
    at = np.cumsum([stretch.spans for stretch, _ in done])[:-1] - 1
    for i, (stretch, _) in zip(at, done, strict=False):
        continuity[:, i] = stretch.end.shared_counts - 1
    rows = [Curve(breaks, c.swapaxes(0, 1), continuity=order) for c, order in zip(coefs, continuity, strict=True)]
    return rows[:first], rows[first:]
