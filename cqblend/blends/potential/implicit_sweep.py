"""The surface swept by the curves in which a reshaped surface meets level sets of an implicit one, and its ribbons.

On the parametric side rail and derivative by x are fitted in the parameter plane, so that the joint is exact. An
implicit surface has no parameters: rail and derivative are a strip there, which is fitted to it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver
from cqblend.blends.contacts.parameter_unwrapping import unwrap_closed_solver, unwrap_open_solver
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.blends.potential.implicit_pair import ImplicitCurves, ImplicitPair
from cqblend.blends.potential.intersection_branches import IntersectionBranch
from cqblend.blends.potential.swept_blend import Sweep, place_stations
from cqblend.blends.potential.swept_section import make_ribbon_targets
from cqblend.blends.potential.tolerances import POTENTIAL_LIMITS, POTENTIAL_TOLERANCES
from cqblend.blends.rails.cubic_ribbons import fit_cubic_ribbons
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.splines import Surface
from cqblend.splines.approximation import Kinks, approximate_curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.tensor_surface import TensorSurface


@dataclass(frozen=True)
class ImplicitSweep(Sweep):
    """The curves over a domain of t and x in [0, 1]; ``q`` (k, j, 2) are their parameters on the parametric surface."""

    curves: ImplicitCurves

    @cached_property
    def strip(self) -> Surface:
        """The strip along rail 2 with the derivative by x across it, over (t, r), r in [0, 1], 1/2 at the rail."""
        tolerance = POTENTIAL_TOLERANCES.strip_fit * self.curves.pair.scale

        def evaluate_both(t: Array) -> Array:
            return np.concatenate(self._solve_second_rail(t), axis=1)

        t, orders = self.kinks
        kinks = Kinks(t, np.maximum(orders - 1, 0))  # a derivative by x has one derivative less
        both = approximate_curve(evaluate_both, self.domain, tolerance, kinks=kinks, closed=self.closed)
        return Surface.from_rows([both[:3] - both[3:] * 0.5, both[:3] + both[3:] * 0.5])

    def _solve_second_rail(self, t: Array) -> tuple[Array, Array]:
        """Return the points (n, 3) of rail 2, on the implicit surface, and the derivatives by x there."""
        zeros = np.zeros(len(t))
        q = self.solve_parameters(t, zeros)
        system = self.curves.linearise_system(q, t, zeros)
        rates = system.differentiate_solutions()
        if rates is None:
            raise self.curves.make_lost_error(q, zeros, 0)
        (jet,) = system.jets
        return jet[0], rates[:, :1] * jet[1] + rates[:, 1:] * jet[2] + jet[3]

    def solve_contacts(self, t: Array) -> Contacts:
        """Return both rails' parameters, those of rail 2 on its strip, and cross derivatives at t (n,)."""
        ones = np.ones(len(t))
        first = self.solve_parameters(t, ones)
        half = np.full(len(t), 0.5)
        strip = self.strip(t, half, 0, 1)
        vectors = np.stack([-self.curves.evaluate_cross_derivatives(first, t, ones, 0), strip])
        middle = self.curves.pair.evaluate_jets(self._interpolate_table(t, half), half)[0][0]
        on_strip = np.stack([t, half], axis=1)
        return Contacts(t, middle, (first, on_strip), np.linalg.norm(vectors, axis=2), vectors)

    def fit_ribbons(self, tolerance: float) -> tuple[Ribbon, Ribbon]:
        """Fit ribbons to the rails and to the derivatives by x, well within the tolerance (mm) of the interior."""
        primaries = self.curves.pair.primaries[0], TensorSurface.from_spline(self.strip, (self.closed, False))
        unwrap: Callable[..., ContactSolver] = unwrap_closed_solver if self.closed else unwrap_open_solver
        # the rail on the strip needs few stations, and does not bring more of them to the other one
        finer = POTENTIAL_TOLERANCES.rail_fit * tolerance
        wanted = replace(make_ribbon_targets(finer, self.width), fades=True)
        kinks, orders = self.kinks
        return fit_cubic_ribbons(
            primaries,
            unwrap(self.solve_contacts, primaries),
            self.domain,
            wanted,
            closed=self.closed,
            corners=kinks[orders < CONTACT_TOLERANCES.rough_continuity],
        )


def sweep_contour(pair: ImplicitPair, branch: IntersectionBranch, x0: float) -> ImplicitSweep:
    """Continue one branch at x0 to all x of the relation."""
    stations = place_stations(pair, branch)
    x = np.union1d(np.linspace(0, 1, POTENTIAL_LIMITS.table_x_values), x0)
    curves = ImplicitCurves(pair, stations.cut)
    table = curves.continue_solutions(stations.start, stations.t, x0, x)
    trimmed = ImplicitSweep(curves, branch.closed, stations.t, x, table).trim_to_domains()
    return ImplicitSweep(curves, trimmed.closed, trimmed.t, trimmed.x, trimmed.q)
