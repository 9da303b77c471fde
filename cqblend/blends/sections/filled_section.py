r"""Adds an interior to the section between two rails, as splines that leave the joints at both rails exact.

All boundary data are in the Hermite section of the ribbons' exact jets. What is added,

.. math:: H(t, v) = \text{section}(t, v) + I(t, v),

vanishes at both rails with its derivatives, and so does any approximation of it. Here that consists of splines in v, of
a degree that OCCT evaluates well, and in t. In homogeneous coordinates they approximate the product of I with the
weight of the section. What I is, a solution of partial differential equations or the difference to a swept surface, is
up to subclasses.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import ClassVar, NamedTuple

import numpy as np

from cqblend.blends.rails.fit_exceptions import TooManySpansError
from cqblend.blends.sections.hermite_section import Jets, SectionInterior, build_section, evaluate_weights
from cqblend.blends.sections.tolerances import SECTION_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface, bernstein
from cqblend.splines.approximation import Kinks, approximate_curve
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import align_breaks
from cqblend.splines.knots import extract_pieces

Sampler = Callable[[Array], Array]
"""A function from parameters t (n,) to values there, (n, ..)."""


MOST_CLEARED = 4
"""Degree of an interior along that has coefficients left when two are cleared at either end of one piece."""

ONE_SIDED_SLOPE = np.array([-49 / 20, 6, -15 / 2, 20 / 3, -15 / 4, 6 / 5, -1 / 6])
"""Weights of values at 0, 1, .. steps from an end that give the slope there, times the step."""

PLACES_BETWEEN_NODES = np.array([0.13, 0.41, 0.77])
"""Where in a piece, as shares of it, polynomials are compared with an interior."""


class _SampledInterior(NamedTuple):
    """An interior at m points across: (n, m, 3) at t (n,), without and with the weight of the section."""

    evaluate: Sampler
    evaluate_weighted: Sampler


class _FitAttempt(NamedTuple):
    """Where splines along may have kinks, of which continuity, and how many spans."""

    kinks: Array
    orders: Array
    most_spans: int


@dataclass(frozen=True)
class FilledSection(ABC):
    """Builds the surface between jets, with an interior that is approximated within a tolerance (mm).

    ``conditions`` is how many jets x, y and z take from each rail, ``points`` at how many points across the interior is
    sampled. ``kinks`` are the parameters t at which the interior is not smooth, ``orders`` its continuity there. With
    ``joined``, the interior vanishes at both ends along, with its first derivative along, to the last digit, or is what
    it should be there: other blends go on there, which have the same sections.
    """

    conditions: tuple[int, int, int]
    points: int
    tolerance: float
    closed: bool
    kinks: Array
    orders: Array
    joined: bool

    has_joint_sections: ClassVar[bool] = False
    """Whether the interior at joined ends is not 0: then it has its own value and first derivative along there."""

    kinks_are_certain: ClassVar[bool] = False
    """Whether the kinks are known to exist, so that smooth splines need not be tried."""

    most_spans_along: ClassVar[int] = 512

    advice: ClassVar[tuple[str, str]] = (
        "fewer terms, or parameters whose layers along the rails are less thin (a smaller b)",
        "fewer modes",
    )
    """What the caller can do about too many spans across, and along."""

    @abstractmethod
    def make_interior_function(self, sides: tuple[Jets, Jets], v: Array) -> Sampler:
        """Return what is added to the section at v (m,), as a function of t (n,) to (n, m, 3)."""

    def __call__(self, sides: tuple[Jets, Jets]) -> Surface:
        """Return the blend surface between the jets of both ribbons.

        Raises
        ------
        GeometryError
            If the tolerance takes more spans than there may be.
        """
        taken = min(map(len, sides))
        return build_section(
            sides, None if min(self.conditions) == taken else self.conditions, self.fit_interior(sides)
        )

    def fit_interior(self, sides: tuple[Jets, Jets]) -> SectionInterior | None:
        """Return the interior as splines, None if it is within the tolerance of zero.

        It is sampled at as many points across as its splines take. Where the rails meet, it is 0.
        """
        interior = self._approximate_interior(sides)
        return None if interior is None else replace(interior, curve=_close_at_points(interior.curve, sides))

    def _approximate_interior(self, sides: tuple[Jets, Jets]) -> SectionInterior | None:
        jets = align_breaks([*sides[0], *sides[1]])
        breaks, degree = jets[0].breaks, max(jet.degree for jet in jets)
        finer = SECTION_TOLERANCES.finer_points_factor * self.points
        exact_joints = [True, False] if self.joined and self.has_joint_sections else [False]
        for exact, points in product(exact_joints, (self.points, finer)):
            sampled = self._sample_across(sides, points)
            joints = sampled.evaluate_weighted(breaks[[0, -1]])[: 2 * exact]
            if degree <= SECTION_TOLERANCES.most_simple_degree:
                interior = self._fit_on_pieces(sampled, breaks, degree, joints)
                if interior is not None:
                    is_zero = np.abs(interior.curve.coefs).max(initial=0.0) <= self.tolerance / 4
                    return None if is_zero else interior
            spread = np.linspace(breaks[0], breaks[-1], SECTION_TOLERANCES.size_samples)
            values = sampled.evaluate_weighted(np.union1d(spread, (breaks[:-1] + breaks[1:]) / 2))
            size = float(np.abs(values).max())
            if size <= self.tolerance / 4:
                return None
            across = self._choose_across_basis(values, joints)
            if across is not None:
                return self._hold_ends(self._fit_splines(sampled, across, sides, jets), across, sampled)
        raise TooManySpansError(
            f"the interior, {size:.2g} mm away from a Hermite section, takes more than "
            f"{int(SECTION_TOLERANCES.spans_per_point * points)} spans across",
            f"ask for a larger tolerance, or {self.advice[0]}",
        )

    def _hold_ends(self, curve: Curve, across: _AcrossBasis, sampled: _SampledInterior) -> SectionInterior:
        """Return the interior with fitted coefficients; at joined ends without what the fit has missed there.

        There it vanishes, or has its own value and first derivative along.
        """
        if not self.joined:
            return across.make_interior(curve)
        if curve.degree < MOST_CLEARED:
            curve = curve.elevate(MOST_CLEARED)
        coefs = curve.coefs.copy()
        coefs[:2, :, 0] = coefs[-2:, :, -1] = 0.0
        if self.has_joint_sections:
            low, high = curve.domain
            for inwards, piece in ((1, 0), (-1, -1)):
                step = inwards * SECTION_TOLERANCES.joint_step * (high - low)
                t = (low if inwards == 1 else high) + step * np.arange(len(ONE_SIDED_SLOPE))
                found = across.fit_coefficients(sampled.evaluate_weighted(t))
                reach = inwards * np.diff(curve.breaks)[piece] / curve.degree
                first, second = (0, 1) if inwards == 1 else (-1, -2)
                coefs[first, :, piece] = found[0]
                coefs[second, :, piece] = found[0] + reach * (ONE_SIDED_SLOPE @ found) / step
        # two coefficients at one end of a piece do not change its lower derivatives at the other
        continuity = np.minimum(curve.continuity, curve.degree - 2)
        return across.make_interior(Curve(curve.breaks, coefs, continuity=continuity))

    def _sample_across(self, sides: tuple[Jets, Jets], points: int) -> _SampledInterior:
        """Return the interior at so many points across."""
        v = _space_points_across(points)
        evaluate = self.make_interior_function(sides, v)
        return _SampledInterior(
            evaluate, evaluate if _has_unit_weight(sides) else _multiply_by_weight(evaluate, sides, v)
        )

    def _fit_on_pieces(
        self, sampled: _SampledInterior, breaks: Array, degree: int, joints: Array
    ) -> SectionInterior | None:
        """Return an interior as polynomials on the section's own pieces, of its degree; None if it is not that.

        It is that between planes, and around axes. A few samples of each piece tell.
        """
        nodes = (1 - np.cos(np.pi * np.arange(degree + 1) / degree)) / 2
        steps = np.diff(breaks)
        places = np.concatenate([nodes, PLACES_BETWEEN_NODES])
        values = sampled.evaluate_weighted((breaks[:-1] + places[:, None] * steps).ravel())
        across = self._choose_across_basis(values, joints)
        if across is None:
            return None
        found, between = np.split(across.fit_coefficients(values).reshape(len(places), len(steps), -1), [degree + 1])
        matrix = np.linalg.inv(bernstein.evaluate_basis(degree, 1 - nodes, nodes).T)
        found[-1, :-1] = found[0, 1:]  # the same points, but for rounding
        coefs = np.einsum("pk,knd->pdn", matrix, found)
        coefs[0], coefs[-1] = found[0].T, found[-1].T
        curve = Curve(breaks, coefs, continuity=np.zeros(len(steps) - 1, dtype=int))
        t = breaks[:-1] + PLACES_BETWEEN_NODES[:, None] * steps
        tolerance = max(
            SECTION_TOLERANCES.coefficient_share * float(np.abs(values).max()),
            SECTION_TOLERANCES.polynomial_share * self.tolerance,
        )
        error = np.abs(curve(t.ravel()).reshape(between.shape) - between).max()
        return self._hold_ends(curve, across, sampled) if error <= tolerance else None

    def _fit_splines(
        self, sampled: _SampledInterior, across: _AcrossBasis, sides: tuple[Jets, Jets], jets: list[Curve]
    ) -> Curve:
        """Approximate the coefficients of an interior along, without its weight if that is the same at all v."""
        breaks, weight = jets[0].breaks, _common_weight(sides)
        if weight is None:
            weighted_jets = None if _has_unit_weight(sides) else jets
            return self._fit_along(
                lambda t: across.fit_coefficients(sampled.evaluate_weighted(t)), breaks, weighted_jets
            )
        return self._fit_along(lambda t: across.fit_coefficients(sampled.evaluate(t)), breaks, None) * weight

    def _fit_along(self, sample: Sampler, breaks: Array, weighted_jets: list[Curve] | None) -> Curve:
        """Approximate coefficients of the interior along: C4 if possible, else with C1 kinks, else with all kinks.

        Jets with a weight add their own breaks to the kinks.
        """
        kinks, orders = self.kinks, self.orders
        if weighted_jets is not None:
            kinks = np.concatenate([kinks, breaks[1:-1]])
            orders = np.concatenate([orders, np.min([jet.continuity for jet in weighted_jets], axis=0)])
        smooth, at_least_c1 = orders >= SECTION_TOLERANCES.smooth_continuity, np.maximum(orders, 1)
        most_smooth, most = SECTION_TOLERANCES.most_smooth_spans, self.most_spans_along
        with_c1_kinks = _FitAttempt(kinks, at_least_c1, most if self.kinks_are_certain else most_smooth)
        attempts = [] if self.kinks_are_certain else [_FitAttempt(kinks[smooth], orders[smooth], most_smooth)]
        if not (at_least_c1 == orders).all():
            attempts.append(with_c1_kinks)
        attempts.append(_FitAttempt(kinks, orders, most))
        for attempt in attempts:
            try:
                return approximate_curve(
                    sample,
                    breaks,
                    self.tolerance / 4,
                    kinks=Kinks(attempt.kinks, attempt.orders),
                    closed=self.closed,
                    most=attempt.most_spans,
                )
            except GeometryError as error:
                last = error
        raise TooManySpansError(
            "the interior between the rails cannot be approximated along them",
            f"{last}; ask for a larger tolerance, or {self.advice[1]}",
        ) from last

    def _choose_across_basis(self, values: Array, joints: Array) -> _AcrossBasis | None:
        """Choose the fewest functions across that hold values (n, m, 3) at m points within a quarter of the tolerance.

        And ``joints`` (k, m, 3), sections that another blend shares, to rounding. None if none do.
        """
        rounding = SECTION_TOLERANCES.joint_share * float(np.abs(joints).max(initial=0.0))
        for degree, spans in _iterate_spaces(self.conditions, SECTION_TOLERANCES.spans_per_point * values.shape[1]):
            across = _AcrossBasis.from_spans(self.conditions, degree, spans, values.shape[1])
            fitted = across.evaluate_at_points(across.fit_coefficients(values))
            if np.abs(fitted - values).max() > self.tolerance / 4:
                continue
            fitted = across.evaluate_at_points(across.fit_coefficients(joints))
            if np.abs(fitted - joints).max(initial=0.0) <= rounding:
                return across
        return None


def _close_at_points(curve: Curve, sides: tuple[Jets, Jets]) -> Curve:
    """Return the coefficients of an interior with a value of 0 at ends where the rails meet in a point."""
    ends = np.array(curve.domain)
    first, second = (jets[0](ends) for jets in sides)
    if first.shape[1] == 4:
        first, second = (points[:, :3] / points[:, 3:] for points in (first, second))
    gaps, size = np.linalg.norm(first - second, axis=1), np.abs(first).max()
    is_point = gaps <= SECTION_TOLERANCES.coefficient_share * size
    if not is_point.any():
        return curve
    coefs = curve.coefs.copy()
    if is_point[0]:
        coefs[0, :, 0] = 0.0
    if is_point[1]:
        coefs[-1, :, -1] = 0.0
    return Curve(curve.breaks, coefs, continuity=curve.continuity)


def _space_points_across(points: int) -> Array:
    """Return the Chebyshev points (m,) across at which interiors are sampled."""
    return (1 - np.cos(np.pi * (np.arange(points) + 0.5) / points)) / 2


def _multiply_by_weight(evaluate: Sampler, sides: tuple[Jets, Jets], v: Array) -> Sampler:
    """Return an interior at v (m,) multiplied by the weight of the section."""

    def evaluate_weighted(t: Array) -> Array:
        values, weight = evaluate(t), evaluate_weights(sides, t, v)
        return values if weight is None else values * weight[..., None]

    return evaluate_weighted


def _iterate_spaces(conditions: tuple[int, int, int], most_spans: float) -> Iterator[tuple[int, int]]:
    """Yield degrees across and numbers of spans: polynomials first, then splines."""
    most_degree = SECTION_TOLERANCES.most_interior_degree
    yield from ((degree, 1) for degree in range(2 * max(conditions), most_degree + 1))
    spans = 2
    while spans <= most_spans:
        yield most_degree, spans
        spans += max(1, spans // 2)


@dataclass(frozen=True)
class _AcrossBasis:
    """B-splines across that vanish at both ends, as often as each component needs it.

    ``tables`` (3, degree + 1, m, spans) are the Bernstein coefficients of the m functions of all components together,
    on the spans between ``breaks``; ``components`` (m,) says which component each of them belongs to. ``point_values``
    (n, m) are their values at n points, and ``least_squares`` (m, n) the matrix from values there to coefficients.
    """

    tables: Array
    breaks: Array
    continuity: Array
    point_values: Array
    least_squares: Array
    components: Array

    @classmethod
    @lru_cache(maxsize=128)
    def from_spans(cls, conditions: tuple[int, int, int], degree: int, spans: int, points: int) -> _AcrossBasis:
        """Return the B-splines on equal spans, without those that do not vanish as often as ``conditions`` asks for.

        All blends share them, so that their arrays are not to be written to.
        """
        v = _space_points_across(points)
        breaks = np.linspace(0, 1, spans + 1)
        knots = np.concatenate([np.zeros(degree), breaks, np.ones(degree)])
        _, coefs, continuity = extract_pieces(degree, knots, np.eye(spans + degree))
        values = Curve(breaks, coefs)(v)
        kept = [np.arange(count, spans + degree - count) for count in conditions]
        components = np.repeat([0, 1, 2], [len(indices) for indices in kept])
        chosen = np.concatenate(kept)
        tables = np.where(components[:, None] == np.arange(3)[:, None, None, None], coefs[:, chosen], 0.0)
        least_squares = np.concatenate([np.linalg.pinv(values[:, indices]) for indices in kept])
        return cls(tables, breaks, continuity, values[:, chosen], least_squares, components)

    def fit_coefficients(self, values: Array) -> Array:
        """Return the coefficients (n, m) of the fit to values (n, points, 3)."""
        parts = [values[..., i] @ self.least_squares[self.components == i].T for i in range(3)]
        return np.concatenate(parts, axis=1)

    def make_interior(self, curve: Curve) -> SectionInterior:
        """Return the interior whose coefficients are a curve."""
        return SectionInterior(curve, self.tables, self.breaks, self.continuity)

    def evaluate_at_points(self, coefs: Array) -> Array:
        """Return values (n, points, 3) of coefficients (n, m)."""
        parts = [coefs[:, self.components == i] @ self.point_values[:, self.components == i].T for i in range(3)]
        return np.stack(parts, axis=-1)


def _has_unit_weight(sides: tuple[Jets, Jets]) -> bool:
    """Whether the weight of a section is 1, or there is none."""
    if sides[0][0].dim == 3:
        return True
    return all(
        bool(np.abs(jet.coefs[:, 3] - (k == 0)).max() <= SECTION_TOLERANCES.coefficient_share)
        for jets in sides
        for k, jet in enumerate(jets)
    )


def _common_weight(sides: tuple[Jets, Jets]) -> Curve | None:
    """Return the weight of a section if it is the same at all v, and not 1."""
    if _has_unit_weight(sides):
        return None
    first, *others = (jet[3] for jets in sides for jet in jets[:1])
    higher = [jet.coefs[:, 3] for jets in sides for jet in jets[1:]]
    same = all(np.array_equal(one.breaks, first.breaks) and one.degree == first.degree for one in others)
    if not same or any(np.abs(one.coefs - first.coefs).max() > SECTION_TOLERANCES.coefficient_share for one in others):
        return None
    return first if all(np.abs(one).max() <= SECTION_TOLERANCES.coefficient_share for one in higher) else None
