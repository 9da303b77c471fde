r"""From a solution of partial differential equations to a blend surface that is exact at its boundary.

A solution meets its boundary data as far as the functions along hold them. What they missed is made good by a Hermite
interpolant of the difference; of the sum, all that carries boundary data is the Hermite section of the ribbons' own
jets, and what is left of the solution are its bubbles,

.. math:: H(t, v) = \text{section}(t, v) + \sum_m \varphi_m(v)\, q_m(w(t)),

so whatever approximates the coefficients q_m(w(t)) leaves the joints as exact as they are. In homogeneous coordinates
the bubbles are those of the product with the section's weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.across import bubble_poles, bubbles, heights
from cqblend.blends.breaks import aligned
from cqblend.blends.pde import Solution
from cqblend.blends.primaries import Array
from cqblend.blends.sections import Interior, Jets, section, weights
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface, bernstein
from cqblend.splines.fit import approximate

WEIGHTED = 4  # further bubbles for the product with a weight
SAME = 1e-13  # of the size: an interior nearer to that of the solution is that of the solution
LARGEST_DEGREE = 25  # of OCCT's B-splines


@dataclass(frozen=True)
class Filling:
    """Fills the section between jets with a solution, within a tolerance (mm)."""

    solution: Solution
    tolerance: float
    closed: bool
    kinks: Array  # parameters t at which the functions along are not smooth

    def __call__(self, sides: tuple[Jets, Jets]) -> Surface:
        """Return the blend surface between the jets of both ribbons.

        Raises
        ------
        GeometryError
            If the tolerance takes a degree across that OCCT cannot hold, or too many spans along.
        """
        halves = self.solution.halves
        taken = min(map(len, sides))
        return section(sides, None if min(halves) == taken else halves, self.interior(sides))

    def interior(self, sides: tuple[Jets, Jets]) -> Interior | None:
        """Return the bubbles as splines along, None if they are nothing but rounding or within the tolerance."""
        jets = aligned([*sides[0], *sides[1]])
        breaks, degree = jets[0].breaks, max(jet.degree for jet in jets)
        product = _Product.of(self.solution, sides)
        t = np.union1d(np.linspace(breaks[0], breaks[-1], 513), (breaks[:-1] + breaks[1:]) / 2)
        reach = np.abs(product(t)).max(axis=0)
        kept = [self._kept(part) for part in np.split(reach, 3)]
        count = max(kept)
        if not count:
            return None
        self._check_degree(count, kept)
        half = self.solution.halves
        chosen = np.concatenate([i * product.terms + np.arange(n) for i, n in enumerate(kept)])
        size = heights_of(half, product.terms)[chosen]

        def sample(at: Array) -> Array:
            return product(at)[:, chosen]

        curve = _simple(sample, breaks, degree, SAME * max(float(reach.max()), self.tolerance))
        if curve is None:
            curve = approximate(sample, breaks, self.tolerance / 2, closed=self.closed, kinks=self.kinks)
        table = np.zeros((3, max(2 * h + n for h, n in zip(half, kept, strict=True)), len(chosen)))
        start = 0
        for i, (h, n) in enumerate(zip(half, kept, strict=True)):
            if n:
                poles = bubble_poles(h, n)
                table[i, :, start : start + n] = bernstein.elevate(poles[..., None], table.shape[1] - len(poles))[
                    ..., 0
                ]
            start += n
        return Interior(curve, table / size)

    def _kept(self, reach: Array) -> int:
        """Count the bubbles of a component that cannot be left out within half the tolerance."""
        tail = np.cumsum(reach[::-1])[::-1]  # what is lost without a bubble and all after it
        return int((3 * tail > self.tolerance / 2).sum())

    def _check_degree(self, count: int, kept: list[int]) -> None:
        degree = max(2 * h + n - 1 for h, n in zip(self.solution.halves, kept, strict=True) if n)
        if degree > LARGEST_DEGREE:
            raise GeometryError(
                f"the interior takes {count} terms and degree {degree} across to be within {self.tolerance:.2g} mm, "
                f"OCCT holds {LARGEST_DEGREE}: ask for a larger tolerance, fewer terms, or parameters whose boundary "
                "layers are less thin (a smaller b)"
            )


def heights_of(halves: tuple[int, int, int], terms: int) -> Array:
    """Return the heights of the bubbles of all components, (3 terms,)."""
    return np.concatenate([heights(half, terms) for half in halves])


@dataclass(frozen=True)
class _Product:
    """The bubbles of a solution, times the weight of a section, each divided by its height: t (n,) to (n, 3 terms)."""

    solution: Solution
    sides: tuple[Jets, Jets]
    terms: int
    back: tuple[Array, ...] | None  # from values at the nodes to bubbles, by component
    nodes: Array

    @classmethod
    def of(cls, solution: Solution, sides: tuple[Jets, Jets]) -> _Product:
        """Prepare it."""
        v = (1 - np.cos(np.pi * (np.arange(64) + 0.5) / 64)) / 2
        if _even(sides):
            return cls(solution, sides, solution.terms, None, v)
        terms = solution.terms + WEIGHTED
        return cls(solution, sides, terms, tuple(np.linalg.pinv(bubbles(h, terms, v)) for h in solution.halves), v)

    def __call__(self, t: Array) -> Array:
        inside = self.solution.inside(self.solution.clock(t))
        if self.back is not None:
            weight = weights(self.sides, t, self.nodes)
            pairs = zip(inside, self.solution.halves, self.back, strict=True)
            inside = [(q @ bubbles(h, q.shape[1], self.nodes).T * weight) @ back.T for q, h, back in pairs]
        return np.asarray(np.concatenate(inside, axis=1) * heights_of(self.solution.halves, self.terms))


def _even(sides: tuple[Jets, Jets]) -> bool:
    """Whether the weight of a section is one."""
    if sides[0][0].dim == 3:
        return True
    return all(bool(np.abs(jet.coefs[:, 3] - (k == 0)).max() <= 1e-13) for jets in sides for k, jet in enumerate(jets))


def _simple(sample: object, breaks: Array, degree: int, tolerance: float) -> Curve | None:
    """Return the interior as polynomials of a low degree on the section's own pieces, where that is what it is.

    As between planes, and around axes; else None.
    """
    if degree > 4:
        return None
    nodes = (1 - np.cos(np.pi * np.arange(degree + 1) / degree)) / 2
    steps = np.diff(breaks)
    t = breaks[:-1] + nodes[:, None] * steps
    values = sample(t.ravel())  # type: ignore[operator]
    values = values.reshape(degree + 1, len(steps), -1)
    matrix = np.linalg.inv(bernstein.basis(degree, 1 - nodes, nodes).T)
    curve = Curve(breaks, np.einsum("pk,knd->pdn", matrix, values))
    between = (breaks[:-1] + np.array([0.13, 0.41, 0.77])[:, None] * steps).ravel()
    if np.abs(curve(between) - sample(between)).max() > tolerance:  # type: ignore[operator]
        return None
    return curve
