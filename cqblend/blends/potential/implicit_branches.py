"""The branches along which a reshaped surface meets a level set, found as contours on a grid of its parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.potential.continuation import PlaneCut
from cqblend.blends.potential.implicit_pair import ImplicitCurves, ImplicitPair
from cqblend.blends.potential.intersection_branches import IntersectionBranch
from cqblend.blends.potential.tolerances import POTENTIAL_LIMITS
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import unwrap_parameters
from cqblend.surfaces.vectors import normalise_vectors

Crossing = tuple[int, int, int]
"""An edge of the grid that a contour crosses: the axis that it runs along, and its first node."""


def trace_contours(pair: ImplicitPair, x: float) -> list[IntersectionBranch]:
    """Return all branches at x that are longer than a few cells of the grid, the longest first; parameters are (n, 2).

    Raises
    ------
    GeometryError
        A branch cannot be refined: the surface touches the level set, or nearly.
    """
    grid = _sample_grid(pair, x)
    branches = [
        _refine_branch(pair, x, grid.locate(chain), closed)
        for chain, closed in grid.list_chains()
        if len(chain) >= POTENTIAL_LIMITS.shortest_contour
    ]
    return sorted(branches, key=lambda one: -float(np.linalg.norm(np.diff(one.points, axis=0), axis=1).sum()))


@dataclass(frozen=True)
class _ContourGrid:
    """Values (n, m) at nodes ``axes`` of the parameters; in periodic directions the last node is the first again."""

    axes: tuple[Array, Array]
    values: Array
    periods: tuple[float | None, float | None]

    def list_chains(self) -> list[tuple[list[Crossing], bool]]:
        """Return the chains of crossings that follow each other, and whether they are closed."""
        neighbours: dict[Crossing, list[Crossing]] = {}
        positive = self.values > 0
        corners = np.stack([positive[:-1, :-1], positive[1:, :-1], positive[1:, 1:], positive[:-1, 1:]])
        for i, j in np.argwhere(corners.any(axis=0) & ~corners.all(axis=0)).tolist():
            edges = [(0, i, j), (1, i + 1, j), (0, i, j + 1), (1, i, j)]  # around the cell
            signs = corners[:, i, j]
            crossed = [self._wrap(edge) for k, edge in enumerate(edges) if signs[k] != signs[(k + 1) % 4]]
            if len(crossed) == 4 and (self.values[i : i + 2, j : j + 2].mean() > 0) == signs[0]:
                crossed = crossed[1:] + crossed[:1]
            for first, second in zip(crossed[::2], crossed[1::2], strict=True):
                neighbours.setdefault(first, []).append(second)
                neighbours.setdefault(second, []).append(first)
        chains = []
        left = set(neighbours)
        for start in sorted(neighbours, key=lambda edge: len(neighbours[edge])):  # ends of open chains first
            if start not in left:
                continue
            chain, closed = [start], False
            left.discard(start)
            while not closed:
                following = [edge for edge in neighbours[chain[-1]] if edge in left]
                if not following:
                    closed = len(chain) > 2 and start in neighbours[chain[-1]] and len(neighbours[start]) == 2
                    break
                chain.append(following[0])
                left.discard(following[0])
            chains.append((chain, closed))
        return chains

    def _wrap(self, edge: Crossing) -> Crossing:
        """Return the edge of the grid that is the same one where it is periodic."""
        axis, i, j = edge
        n, m = self.values.shape
        if self.periods[0] is not None:
            i %= n - 1
        if self.periods[1] is not None:
            j %= m - 1
        return axis, i, j

    def locate(self, chain: list[Crossing]) -> Array:
        """Return the parameters (n, 2) of crossings, continuous over periods."""
        axis, i, j = np.array(chain).T
        i1, j1 = i + (axis == 0), j + (axis == 1)
        first, second = self.values[i, j], self.values[i1, j1]
        share = first / (first - second)
        u, v = self.axes
        uv = np.stack([u[i] + share * (u[i1] - u[i]), v[j] + share * (v[j1] - v[j])], axis=1)
        return unwrap_parameters(uv, self.periods)


def _sample_grid(pair: ImplicitPair, x: float) -> _ContourGrid:
    (family,) = pair.families
    u, v = (np.linspace(*domain, POTENTIAL_LIMITS.contour_cells + 1) for domain in family.surface.domain)
    uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    at = np.full(len(uv), x)
    values = pair.evaluate_level(pair.evaluate_jets(uv, at)[0][0], at)[0].reshape(len(u), len(v))
    first, second = family.primary.periods
    if first is not None:
        values[-1] = values[0]
    if second is not None:
        values[:, -1] = values[:, 0]
    return _ContourGrid((u, v), values, (first, second))


def _refine_branch(pair: ImplicitPair, x: float, uv: Array, closed: bool) -> IntersectionBranch:
    """Return a branch at points of equal distance, about, which are on both surfaces to rounding."""
    count, (family,) = POTENTIAL_LIMITS.branch_points, pair.families
    if closed:
        uv = unwrap_parameters(np.concatenate([uv, uv[:1]]), family.primary.periods)
    for _ in range(POTENTIAL_LIMITS.branch_rounds):
        points = pair.evaluate_jets(uv, np.full(len(uv), x))[0][0]
        length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        even = np.linspace(0, length[-1], count + 1)
        start = np.stack([np.interp(even, length, column) for column in uv.T], axis=1)
        places = np.stack([np.interp(even, length, column) for column in points.T], axis=1)
        slopes = np.gradient(places, axis=0)
        if closed:
            slopes[0] = slopes[-1] = places[1] - places[-2]
        tangents = normalise_vectors(slopes)
        index = np.arange(count + 1.0)
        cut = PlaneCut(lambda t, p=places, n=tangents: (p[t.astype(int)], n[t.astype(int)]))  # type: ignore[misc]
        uv, converged = ImplicitCurves(pair, cut).correct_solutions(start, index, np.full(count + 1, x))
        if not converged.all():
            i = int((~converged).argmax())
            raise GeometryError(
                f"the curve in which the reshaped surface meets f = {pair.s(x)[1]:.4g} cannot be followed past "
                f"{pair.describe_place(start, np.full(count + 1, x), i)}: they touch there, or nearly"
            )
    if closed:
        uv[-1] = uv[0] + np.round((uv[-1] - uv[0]) / [p or np.inf for p in family.primary.periods]) * [
            p or 0.0 for p in family.primary.periods
        ]
    return IntersectionBranch(pair.evaluate_jets(uv, np.full(len(uv), x))[0][0], uv, closed)
