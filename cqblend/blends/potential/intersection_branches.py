"""All branches of the intersection of two reshaped surfaces, each traced from end to end.

Candidates come from :mod:`cqblend.blends.potential.box_subdivision`. Gauss-Newton steps project them onto both
surfaces; from there a branch is traced along its tangent, with a correction at every step, until it closes or leaves a
surface. Points are those of the families themselves; splines that approximate offsets serve for the boxes only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cqblend.blends.potential.box_subdivision import find_candidates
from cqblend.blends.potential.continuation import CutCondition, IntersectionCurves, IsoparametricCut, PlaneCut
from cqblend.blends.potential.family_pair import FamilyPair
from cqblend.blends.potential.tolerances import POTENTIAL_LIMITS, POTENTIAL_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, normalise_vectors, to_tangent_coordinates


@dataclass(frozen=True)
class IntersectionBranch:
    """One intersection curve: points (n, 3) and parameters q (n, 4) on both surfaces, continuous along it.

    The first and the last point of a ``closed`` one coincide.
    """

    points: Array
    parameters: Array
    closed: bool


@dataclass(frozen=True)
class _BranchPoint:
    """A point (3,) of a branch, with its parameters q (4,) and the unit tangent (3,) in the direction of tracing."""

    q: Array
    point: Array
    tangent: Array


def trace_branches(family_pair: FamilyPair, x: float) -> list[IntersectionBranch]:
    """Return all branches of the intersection at x, the longest first.

    Raises
    ------
    GeometryError
        The surfaces touch, or coincide, somewhere.
    """
    first, second = _approximate_surfaces(family_pair, x)
    tracer = _BranchTracer(family_pair, x)
    candidates = find_candidates(first, second, POTENTIAL_TOLERANCES.box_fit * family_pair.scale)
    seeds = tracer.project_candidates(*candidates)
    branches: list[IntersectionBranch] = []
    while len(seeds):
        branch = tracer.trace_branch(seeds[0])
        branches.append(branch)
        points = family_pair.evaluate_jets(seeds, np.full(len(seeds), x))[0][0]
        remaining = _is_off_chain(points, branch.points)
        remaining[0] = False
        seeds = seeds[remaining]
    return sorted(branches, key=lambda one: -float(np.linalg.norm(np.diff(one.points, axis=0), axis=1).sum()))


def _approximate_surfaces(family_pair: FamilyPair, x: float) -> list[Surface]:
    """Return both surfaces as splines, within the tolerance of the test of boxes."""
    tolerance = POTENTIAL_TOLERANCES.box_fit * family_pair.scale
    return [family(s, tolerance) for family, s in zip(family_pair.families, family_pair.s(x).tolist(), strict=True)]


@dataclass(frozen=True)
class _BranchTracer:
    """Traces branches of the intersection at one x."""

    family_pair: FamilyPair
    x: float

    @property
    def _x_array(self) -> Array:
        return np.array([self.x])

    def project_candidates(self, start: Array, half_widths: Array) -> Array:
        """Project candidates q (n, 4) onto both surfaces by least-norm steps; drop those that do not get there."""
        q, scale = start.copy(), self.family_pair.scale
        for _ in range(POTENTIAL_LIMITS.projection_steps):
            first, second = self.family_pair.evaluate_jets(q, np.full(len(q), self.x))
            gap = first[0] - second[0]
            matrix = np.stack([first[1], first[2], -second[1], -second[2]], axis=-1) * half_widths[:, None]
            inverse = np.linalg.pinv(matrix, rcond=POTENTIAL_TOLERANCES.candidate_rank)
            step = -np.einsum("nij,nj->ni", inverse, gap)
            q = q + np.clip(step, -2, 2) * half_widths
            if np.linalg.norm(gap, axis=1).max(initial=0) <= POTENTIAL_TOLERANCES.candidate_converged * scale:
                break
        first, second = self.family_pair.evaluate_jets(q, np.full(len(q), self.x))
        keep = np.linalg.norm(first[0] - second[0], axis=1) <= POTENTIAL_TOLERANCES.candidate_gap * scale
        keep &= (self.family_pair.measure_outside(q) <= POTENTIAL_TOLERANCES.domain).all(axis=1)
        keep &= (np.abs(q - start) <= 6 * half_widths).all(axis=1)
        return np.asarray(q[keep])

    def _evaluate_tangent(self, q: Array) -> Array:
        """Return the unit tangent (3,) of the intersection at one point q (4,)."""
        first, second = self.family_pair.evaluate_jets(q[None], self._x_array)
        across = cross_product(
            normalise_vectors(cross_product(first[1], first[2])), normalise_vectors(cross_product(second[1], second[2]))
        )[0]
        sine = float(np.linalg.norm(across))
        if sine < POTENTIAL_TOLERANCES.touching_sine:
            raise GeometryError(
                f"the surfaces touch, at an angle of {sine:.2g} rad, at "
                f"{self.family_pair.describe_place(q[None], self._x_array, 0)}: there, their intersection has no "
                "direction; move one of them, or choose other a and b"
            )
        return across / sine

    def _intersect_plane(self, q: Array, target: Array, normal: Array, longest_step: float) -> Array | None:
        """Return the point of the intersection in a plane, next to q; None if there is none."""
        return self._solve_cut(PlaneCut(lambda _: (target[None], normal[None])), q, longest_step)

    def _intersect_domain_end(self, inside: Array, outside: Array) -> Array | None:
        """Return the point of the intersection at the end of a domain, between a point inside and one outside."""
        axis = int(self.family_pair.measure_outside(outside[None])[0].argmax())
        low, high = self.family_pair.bounds[axis].tolist()
        value = low if outside[axis] < low else high
        scale = self.family_pair.scale
        share = (value - inside[axis]) / (outside[axis] - inside[axis])
        isoline = IsoparametricCut(axis, value, value, scale / (high - low))
        q = self._solve_cut(isoline, inside + share * (outside - inside), scale)
        if q is None or self._is_outside(q):
            return None
        q[axis] = value
        return q

    def _solve_cut(self, cut_condition: CutCondition, q: Array, longest_step: float) -> Array | None:
        """Return the point of the intersection that meets a cut condition, next to q; None if there is none."""
        curves = IntersectionCurves(self.family_pair, cut_condition)
        solutions, converged = curves.correct_solutions(q[None], np.zeros(1), self._x_array, longest_step)
        return solutions[0] if converged[0] else None

    def _is_outside(self, q: Array) -> bool:
        """Whether a point q (4,) is outside of a surface."""
        return bool(self.family_pair.measure_outside(q[None]).max() > POTENTIAL_TOLERANCES.domain)

    def _find_midpoint(self, start: _BranchPoint, end: _BranchPoint) -> Array | None:
        """Return the point q half-way between two points; None if it is not near the cubic between them.

        Then the second point lies on another branch, or the step is too long.
        """
        chord = end.point - start.point
        length = float(np.linalg.norm(chord))
        middle = (start.point + end.point) / 2 + length / 8 * (start.tangent - end.tangent)
        q = self._intersect_plane((start.q + end.q) / 2, middle, chord / length, length)
        if q is None or self._is_outside(q):
            return None
        point = self.family_pair.evaluate_jets(q[None], self._x_array)[0][0, 0]
        return q if np.linalg.norm(point - middle) <= POTENTIAL_TOLERANCES.midpoint * length else None

    def _make_branch_point(self, q: Array, tangent: Array) -> _BranchPoint:
        return _BranchPoint(q, self.family_pair.evaluate_jets(q[None], self._x_array)[0][0, 0], tangent)

    def trace_branch(self, seed: Array) -> IntersectionBranch:
        """Trace the branch through a point q (4,)."""
        forward, closed = self._march_branch(seed, 1.0)
        q = forward
        if not closed:
            backward, _ = self._march_branch(seed, -1.0)
            q = np.concatenate([backward[:0:-1], forward])
        points = self.family_pair.evaluate_jets(q, np.full(len(q), self.x))[0][0]
        return IntersectionBranch(points, q, closed)

    def _march_branch(self, seed: Array, sense: float) -> tuple[Array, bool]:
        """Trace from a point until the branch leaves a surface or closes; ``sense`` is +1 or -1 along the tangent.

        Returns the points q (n, 4), and whether the branch is closed.
        """
        chain, scale = [seed], self.family_pair.scale
        start = here = self._make_branch_point(seed, sense * self._evaluate_tangent(seed))
        step, length = POTENTIAL_TOLERANCES.longest_step * scale / 4, 0.0
        for _ in range(POTENTIAL_LIMITS.tracing_steps):
            if step < POTENTIAL_TOLERANCES.shortest_step * scale:
                break
            jets = self.family_pair.evaluate_jets(here.q[None], self._x_array)
            rates = np.concatenate([to_tangent_coordinates(jet[:3], here.tangent[None])[0] for jet in jets])
            predicted = here.point + step * here.tangent
            q = self._intersect_plane(here.q + step * rates, predicted, here.tangent, step)
            leaves = q is not None and self._is_outside(q)
            if q is not None and leaves:
                q = self._intersect_domain_end(here.q, q)
            if q is None:
                step /= 2
                continue
            there = self._make_branch_point(q, here.tangent)
            moved = float(np.linalg.norm(there.point - here.point))
            if leaves and moved <= POTENTIAL_TOLERANCES.shortest_step * scale:
                return np.stack(chain), False
            tangent = self._evaluate_tangent(q)
            tangent *= np.sign(tangent @ here.tangent) or 1.0
            there = replace(there, tangent=tangent)
            turned = float(np.arccos(np.clip(tangent @ here.tangent, -1, 1)))
            is_too_long = turned > 1.5 * POTENTIAL_TOLERANCES.step_turn or moved > 2 * step
            middle = None if is_too_long else self._find_midpoint(here, there)
            if middle is None:
                step /= 2
                continue
            if length > 3 * moved and _passes_start(start, here, there, moved):
                chain.append(self._unwrap_start(seed, q))
                return np.stack(chain), True
            chain += [middle, q]
            if leaves:
                return np.stack(chain), False
            here, length = there, length + moved
            growth = float(np.clip(POTENTIAL_TOLERANCES.step_turn / max(turned, 1e-3), 0.5, 2.0))
            step = min(step * growth, POTENTIAL_TOLERANCES.longest_step * scale)
        raise GeometryError(
            "the intersection of the surfaces cannot be followed past "
            f"{self.family_pair.describe_place(here.q[None], self._x_array, 0)}"
        )

    def _unwrap_start(self, seed: Array, last: Array) -> Array:
        """Return the parameters of the start of a closed branch, shifted by periods to be next to the last ones."""
        out = seed.copy()
        periods = [period for family in self.family_pair.families for period in family.primary.periods]
        for axis, period in enumerate(periods):
            if period is not None:
                out[axis] += period * np.round((last[axis] - seed[axis]) / period)
        return out


def _passes_start(start: _BranchPoint, here: _BranchPoint, there: _BranchPoint, moved: float) -> bool:
    """Whether a step from here to there, of length ``moved``, passes the start of the branch in its direction."""
    before, after = (start.point - here.point) @ start.tangent, (start.point - there.point) @ start.tangent
    passes = before > 0 >= after and there.tangent @ start.tangent > 0.5
    return bool(passes and np.linalg.norm(start.point - here.point) < 2 * moved)


def find_nearest_approach(family_pair: FamilyPair, x: float) -> tuple[float, Array]:
    """Return about how near two surfaces that do not meet come to each other at x (mm), and the place (3,)."""
    grids = []
    for surface in _approximate_surfaces(family_pair, x):
        u, v = (np.linspace(low, high, 48) for low, high in surface.domain)
        grids.append(surface.grid(u, v).reshape(-1, 3))
    nearest, place = np.inf, grids[0][0]
    for block in np.array_split(grids[0], 24):
        distances = np.linalg.norm(block[:, None] - grids[1], axis=2)
        i, j = np.unravel_index(int(distances.argmin()), distances.shape)
        if distances[i, j] < nearest:
            nearest, place = float(distances[i, j]), (block[i] + grids[1][j]) / 2
    return nearest, place


def _is_off_chain(points: Array, chain: Array) -> Array:
    """Tell which points (n, 3) are not on a chain of points, by their distance from its segments over their lengths."""
    start, segment = chain[:-1], np.diff(chain, axis=0)
    square = np.maximum((segment**2).sum(axis=1), np.finfo(float).tiny)
    offset = points[:, None] - start
    share = np.clip((offset * segment).sum(axis=2) / square, 0, 1)
    distance = np.linalg.norm(offset - share[..., None] * segment, axis=2) / np.sqrt(square)
    return np.asarray(distance.min(axis=1) > POTENTIAL_TOLERANCES.same_branch)
