r"""What fills a blend between its two joints, whatever it is, as a spline that leaves them as exact as they are.

All that carries boundary data is the Hermite section of the ribbons' own jets. What is added,

.. math:: H(t, v) = \text{section}(t, v) + I(t, v),

vanishes at both rails with its derivatives, and so may whatever approximates it. Here these are splines in v of a
degree that OCCT evaluates well, and in t. In homogeneous coordinates they approximate the product with the section's
weight. A solution of partial differential equations adds its bubbles; what the functions along missed on the rails is
made good by that, too.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cqblend.blends.pde.rail_basis import LEAST_SPLINE_DEGREE
from cqblend.blends.pde.solution import Solution
from cqblend.blends.rails.fit_errors import TooManySpansError
from cqblend.blends.sections.cross_basis import evaluate_bubbles
from cqblend.blends.sections.hermite_section import Jets, SectionInterior, build_section, evaluate_weights
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface, bernstein
from cqblend.splines.approximation import approximate_curve
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import align_breaks
from cqblend.splines.knots import extract_pieces

MOST_DEGREE_ACROSS = 7  # across, at most: OCCT's rounding grows with it, by a factor of 2.4 for each
LEAST_POINTS_ACROSS = 72  # points across, at least, at which solutions are read
FINER_POINTS_FACTOR = 3  # times as many, where these are not enough
SPANS_PER_POINT = 2 / np.pi  # spans for each point, at most: there are points in every one of them
SAME_VALUE_SHARE = 1e-13  # of the interior: as near as that, it is the same
POLYNOMIAL_TOLERANCE_SHARE = 1e-4  # of the tolerance: as near as that, polynomials on the section's own pieces will do
MOST_SMOOTH_SPANS = 128  # along, at most, before an interior gets kinks that it could do without
MOST_SIMPLE_DEGREE = 4  # degree along of sections that may be simple: between planes, around axes


@dataclass(frozen=True)
class FilledSection(ABC):
    """Fills the section between jets with something, within a tolerance (mm).

    ``halves`` is how many jets x, y and z take from each rail, ``points`` at how many points across the interior is
    read. ``kinks`` are the parameters t at which it is not smooth, ``orders`` its continuity there.
    """

    halves: tuple[int, int, int]
    points: int
    tolerance: float
    closed: bool
    kinks: Array
    orders: Array

    kinks_are_certain: ClassVar[bool] = False  # whether the kinks are sure to be there
    most_spans_along: ClassVar[int] = 512  # spans along
    advice: ClassVar[tuple[str, str]] = (
        "fewer terms, or parameters whose layers along the rails are less thin (a smaller b)",
        "fewer modes",
    )  # what to do about too many spans across and along

    @abstractmethod
    def make_interior_function(self, sides: tuple[Jets, Jets], v: Array) -> Callable[[Array], Array]:
        """Return what is added to the section at v (m,), as a function of t (n,) to (n, m, 3)."""

    def __call__(self, sides: tuple[Jets, Jets]) -> Surface:
        """Return the blend surface between the jets of both ribbons.

        Raises
        ------
        GeometryError
            If the tolerance takes more spans than there may be.
        """
        taken = min(map(len, sides))
        return build_section(sides, None if min(self.halves) == taken else self.halves, self.fit_interior(sides))

    def fit_interior(self, sides: tuple[Jets, Jets]) -> SectionInterior | None:
        """Return what is added as splines, None if it is within the tolerance."""
        for points in (self.points, FINER_POINTS_FACTOR * self.points):
            v = (1 - np.cos(np.pi * (np.arange(points) + 0.5) / points)) / 2
            values, plain = self._make_weighted_sampler(sides, v), self.make_interior_function(sides, v)
            jets = align_breaks([*sides[0], *sides[1]])
            breaks, degree = jets[0].breaks, max(jet.degree for jet in jets)
            found = values(np.union1d(np.linspace(breaks[0], breaks[-1], 257), (breaks[:-1] + breaks[1:]) / 2))
            size = float(np.abs(found).max())
            if size <= self.tolerance / 4:
                return None
            across = self._choose_across_basis(v, found)
            if across is not None:
                break
        else:
            raise TooManySpansError(
                f"the interior, {size:.2g} mm away from a Hermite section, takes more than "
                f"{int(SPANS_PER_POINT * points)} spans across",
                f"ask for a larger tolerance, or {self.advice[0]}",
            )

        def sample_coefficients(t: Array) -> Array:
            assert across is not None
            return across.fit_coefficients(values(t))

        curve = _fit_on_pieces(
            sample_coefficients,
            breaks,
            degree,
            max(SAME_VALUE_SHARE * size, POLYNOMIAL_TOLERANCE_SHARE * self.tolerance),
        )
        if curve is None:
            weight, fitted = _common_weight(sides), across.fit_coefficients
            if weight is None:
                curve = self._fit_along(sample_coefficients, breaks, None if _has_unit_weight(sides) else jets)
            else:  # whose kinks would be approximated: multiplied by it, what is smooth in space stays so
                curve = self._fit_along(lambda t: fitted(plain(t)), breaks, None) * weight
        return SectionInterior(curve, across.tables, across.breaks, across.continuity)

    def _make_weighted_sampler(self, sides: tuple[Jets, Jets], v: Array) -> Callable[[Array], Array]:
        """Return the interior at all v times the section's weight, as a function of t (n,): (n, m, 3)."""
        added = self.make_interior_function(sides, v)

        def evaluate_weighted(t: Array) -> Array:
            out = added(t)
            weight = None if _has_unit_weight(sides) else evaluate_weights(sides, t, v)
            return out if weight is None else out * weight[..., None]

        return evaluate_weighted

    def _fit_along(self, sample: Callable[[Array], Array], breaks: Array, weighted: list[Curve] | None) -> Curve:
        """Approximate the interior along: C4 if that goes, else with the kinks of rails and weights, C1 at least."""
        kinks, orders = self.kinks, self.orders
        if weighted is not None:
            kinks = np.concatenate([kinks, breaks[1:-1]])
            orders = np.concatenate([orders, np.min([jet.continuity for jet in weighted], axis=0)])
        smooth, soft = orders >= LEAST_SPLINE_DEGREE - 1, np.maximum(orders, 1)
        ways = [
            (kinks[smooth], orders[smooth], MOST_SMOOTH_SPANS),
            (kinks, soft, MOST_SMOOTH_SPANS),
            (kinks, orders, self.most_spans_along),
        ]
        if self.kinks_are_certain:
            ways = [(kinks, soft, self.most_spans_along), (kinks, orders, self.most_spans_along)]
        if (soft == orders).all():
            ways = [*ways[:-2], ways[-1]]
        for at, allowed, most in ways:
            try:
                return approximate_curve(
                    sample, breaks, self.tolerance / 4, kinks=at, orders=allowed, closed=self.closed, most=most
                )
            except GeometryError as error:
                last = error
        raise TooManySpansError(
            "the interior between the rails cannot be approximated along them",
            f"{last}; ask for a larger tolerance, or {self.advice[1]}",
        ) from last

    def _choose_across_basis(self, v: Array, found: Array) -> _AcrossBasis | None:
        """Choose the fewest functions across that hold the interior within a quarter of the tolerance; None if none."""
        for degree, spans in _iterate_spaces(self.halves, SPANS_PER_POINT * len(v)):
            across = _AcrossBasis.from_spans(self.halves, degree, spans, v)
            if np.abs(across.evaluate_at_points(across.fit_coefficients(found)) - found).max() <= self.tolerance / 4:
                return across
        return None


@dataclass(frozen=True)
class PdeSection(FilledSection):
    r"""The bubbles of a solution of partial differential equations, sum of :math:`\varphi_m(v)\, q_m(w(t))`."""

    solution: Solution

    def make_interior_function(self, sides: tuple[Jets, Jets], v: Array) -> Callable[[Array], Array]:
        """Return the sum of the bubbles."""
        del sides
        inside = [evaluate_bubbles(half, self.solution.terms, v).T for half in self.halves]

        def evaluate_bubbles_sum(t: Array) -> Array:
            parts = self.solution.evaluate_coefficients(self.solution.clock(t))
            return np.stack([q @ one for q, one in zip(parts, inside, strict=True)], axis=-1)

        return evaluate_bubbles_sum


def _iterate_spaces(halves: tuple[int, int, int], most: float) -> Iterator[tuple[int, int]]:
    """Yield degrees across and numbers of spans: polynomials first, then splines."""
    least = 2 * max(halves)
    yield from ((degree, 1) for degree in range(least, MOST_DEGREE_ACROSS + 1))
    spans = 2
    while spans <= most:
        yield MOST_DEGREE_ACROSS, spans
        spans += max(1, spans // 2)


@dataclass(frozen=True)
class _AcrossBasis:
    """B-splines across that vanish at both ends, as often as each component needs it.

    ``tables`` (3, degree + 1, m, spans) are their Bernstein coefficients, m of all components together.
    """

    tables: Array
    breaks: Array
    continuity: Array
    point_values: Array  # values of all at the points v, (n, m)
    least_squares: Array  # least squares, (m, n)
    components: Array  # the component of each, (m,)

    @classmethod
    def from_spans(cls, halves: tuple[int, int, int], degree: int, spans: int, v: Array) -> _AcrossBasis:
        breaks = np.linspace(0, 1, spans + 1)
        knots = np.concatenate([np.zeros(degree), breaks, np.ones(degree)])
        _, coefs, continuity = extract_pieces(degree, knots, np.eye(spans + degree))
        values = Curve(breaks, coefs)(v)
        kept = [np.arange(half, spans + degree - half) for half in halves]
        owner = np.repeat([0, 1, 2], [len(one) for one in kept])
        chosen = np.concatenate(kept)
        tables = np.where(owner[:, None] == np.arange(3)[:, None, None, None], coefs[:, chosen], 0.0)
        back = np.concatenate([np.linalg.pinv(values[:, one]) for one in kept])
        return cls(tables, breaks, continuity, values[:, chosen], back, owner)

    def fit_coefficients(self, found: Array) -> Array:
        """Return coefficients (n, m) for values (n, points, 3)."""
        parts = [found[..., i] @ self.least_squares[self.components == i].T for i in range(3)]
        return np.concatenate(parts, axis=1)

    def evaluate_at_points(self, coefs: Array) -> Array:
        """Return values (n, points, 3) of coefficients (n, m)."""
        parts = [coefs[:, self.components == i] @ self.point_values[:, self.components == i].T for i in range(3)]
        return np.stack(parts, axis=-1)


def _has_unit_weight(sides: tuple[Jets, Jets]) -> bool:
    """Whether the weight of a section is one."""
    if sides[0][0].dim == 3:
        return True
    return all(
        bool(np.abs(jet.coefs[:, 3] - (k == 0)).max() <= SAME_VALUE_SHARE)
        for jets in sides
        for k, jet in enumerate(jets)
    )


def _common_weight(sides: tuple[Jets, Jets]) -> Curve | None:
    """Return the weight of a section if it is the same at all v, and not one."""
    if _has_unit_weight(sides):
        return None
    first, *others = (jet[3] for jets in sides for jet in jets[:1])
    higher = [jet.coefs[:, 3] for jets in sides for jet in jets[1:]]
    same = all(np.array_equal(one.breaks, first.breaks) and one.degree == first.degree for one in others)
    if not same or any(np.abs(one.coefs - first.coefs).max() > SAME_VALUE_SHARE for one in others):
        return None
    return first if all(np.abs(one).max() <= SAME_VALUE_SHARE for one in higher) else None


def _fit_on_pieces(sample: Callable[[Array], Array], breaks: Array, degree: int, tolerance: float) -> Curve | None:
    """Return the interior as polynomials of a low degree on the section's own pieces, where that is what it is.

    As between planes, and around axes; else None.
    """
    if degree > MOST_SIMPLE_DEGREE:
        return None
    nodes = (1 - np.cos(np.pi * np.arange(degree + 1) / degree)) / 2
    steps = np.diff(breaks)
    values = sample((breaks[:-1] + nodes[:, None] * steps).ravel()).reshape(degree + 1, len(steps), -1)
    matrix = np.linalg.inv(bernstein.evaluate_basis(degree, 1 - nodes, nodes).T)
    values[-1, :-1] = values[0, 1:]  # the same points, but for rounding
    coefs = np.einsum("pk,knd->pdn", matrix, values)
    coefs[0], coefs[-1] = values[0].T, values[-1].T
    curve = Curve(breaks, coefs, continuity=np.zeros(len(steps) - 1, dtype=int))
    between = (breaks[:-1] + np.array([0.13, 0.41, 0.77])[:, None] * steps).ravel()
    return curve if np.abs(curve(between) - sample(between)).max() <= tolerance else None
