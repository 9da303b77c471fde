"""Solutions within a tolerance: functions along and bubbles across are added until more of them change too little.

Where waves do not mix, the boundary data tell which of them there are. Elsewhere they do not: at the corners of open
blends solutions are singular, and where coefficients vary along, they have waves that the data have not. Knows no
equations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cqblend.blends.pde.solution import BoundaryProblem, PosedProblem, Solution
from cqblend.blends.pde.tolerances import PDE_LIMITS, PDE_TOLERANCES


@dataclass(frozen=True)
class _Resolution:
    """A boundary problem with its basis along, and a number of bubbles."""

    problem: BoundaryProblem
    terms: int

    @cached_property
    def posed(self) -> PosedProblem:
        return self.problem.pose(self.terms)

    def refine_along(self) -> _Resolution | None:
        """Return that with twice as many functions along; None if these are too many."""
        finer = replace(self.problem, basis=self.problem.basis.refined())
        return _Resolution(finer, self.terms)._limited()

    def refine_across(self) -> _Resolution | None:
        """Return that with the next number of bubbles; None if these are too many."""
        more = [n for n in PDE_LIMITS.term_counts if n > self.terms]
        return _Resolution(self.problem, more[0])._limited() if more else None

    def _limited(self) -> _Resolution | None:
        basis = self.problem.basis
        most = PDE_LIMITS.most_span_unknowns if basis.spans_apart > 1 else PDE_LIMITS.most_free_unknowns
        return self if basis.count * self.terms <= most else None


def solve_within(problem: BoundaryProblem, tolerance: float, terms: int | None, *, free_basis: bool) -> Solution:
    """Solve with as many bubbles and functions along as a tolerance (mm) takes, or as there may be.

    The basis of the problem is the least that is tried, and the only one unless ``free_basis``; so are ``terms``,
    unless they are None. ``Solution.change`` is what the next refinement changes.
    """
    state = _Resolution(problem, PDE_LIMITS.fewest_refined_terms if terms is None else terms)
    refinements: list[Callable[[_Resolution], _Resolution | None]] = []
    if terms is None:
        refinements.append(_Resolution.refine_across)
    if free_basis:
        refinements.append(_Resolution.refine_along)
    changes = [0.0] * len(refinements)
    settled: set[int] = set()
    while len(settled) < len(refinements):
        k = next(k for k in range(len(refinements)) if k not in settled)
        finer = refinements[k](state)
        if finer is None:
            settled.add(k)
            continue
        changes[k] = _measure_change(state.posed.unmeasured_solution, finer.posed.unmeasured_solution)
        if changes[k] <= PDE_TOLERANCES.refinement * tolerance:
            settled.add(k)
        else:
            state = finer
            settled.clear()
    return replace(state.posed.solution, change=max(changes, default=0.0))


def _measure_change(first: Solution, second: Solution) -> float:
    """Return the largest distance of two solutions of one problem (mm)."""
    w = np.linspace(*first.basis.domain, PDE_LIMITS.change_grid[0])
    v = np.linspace(0, 1, PDE_LIMITS.change_grid[1])
    return float(np.linalg.norm(first.evaluate_grid(w, v) - second.evaluate_grid(w, v), axis=2).max())
