"""The section of a blend by partial differential equations: a Hermite section, and the solution's bubbles on top of it.

What carries the boundary data is the Hermite section of the ribbons' exact jets; of the solution only the bubbles are
added, which vanish at both rails with their derivatives, so that its errors do not show there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cqblend.blends.pde.bubble_basis import evaluate_bubbles
from cqblend.blends.pde.solution import Solution
from cqblend.blends.sections.filled_section import FilledSection
from cqblend.blends.sections.hermite_section import Jets
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class PdeSection(FilledSection):
    r"""The bubbles of a solution of partial differential equations, sum of :math:`\varphi_m(v)\, q_m(w(t))`."""

    solution: Solution

    def make_interior_function(self, sides: tuple[Jets, Jets], v: Array) -> Callable[[Array], Array]:
        """Return the sum of the bubbles of the solution."""
        del sides
        inside = [evaluate_bubbles(half, self.solution.terms, v).T for half in self.conditions]

        def evaluate_bubbles_sum(t: Array) -> Array:
            parts = self.solution.evaluate_coefficients(self.solution.clock(t))
            return np.stack([q @ one for q, one in zip(parts, inside, strict=True)], axis=-1)

        return evaluate_bubbles_sum
