"""Where two reshaped surfaces meet: all branches of their intersection, each followed from end to end.

Candidates come from halving both surfaces wherever the boxes of their control points overlap: a spline lies in the hull
of its control points, so no branch is lost that is longer than a last part. Newton brings them onto both surfaces; from
there a branch is marched along its tangent, corrected at every step, until it closes or leaves a surface. Numbers are
those of the families themselves; splines of offsets serve for the boxes only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.potential.continuation import (
    TOUCHING_SINE,
    CutCondition,
    IntersectionCurves,
    IsoparametricCut,
    PlaneCut,
)
from cqblend.blends.potential.family_pair import DOMAIN_TOLERANCE, FamilyPair, format_point
from cqblend.errors import GeometryError
from cqblend.splines import Surface, bernstein
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, normalise_vectors, to_tangent_coordinates

BOX_TOLERANCE = 1e-4  # of the size, by which the splines of offsets, whose boxes are tested, may be off
SUBDIVISION_LIMIT = 48  # of the common box of both surfaces: as large, at most, is a last part
MOST_PAIRS = 60_000  # of parts that may meet: more are surfaces that touch along an area
STEP_TURN = 0.25  # rad, by which a branch turns in a step, about
SHORTEST_STEP, LONGEST_STEP = 1e-7, 1 / 12  # steps, of the size
MIDPOINT_TOLERANCE = 0.01  # of a step: by as much a point half-way may be off the smooth curve between both ends
MOST_STEPS = 5_000
SAME_BRANCH_DISTANCE = 0.07  # of a step: as near to a branch, a point lies on it


@dataclass(frozen=True)
class IntersectionBranch:
    """One intersection curve: points (n, 3), parameters (n, 4) on both surfaces, continuous along it.

    The first and the last point of a ``closed`` one are the same.
    """

    points: Array
    parameters: Array
    closed: bool


def trace_branches(meeting: FamilyPair, x: float) -> list[IntersectionBranch]:
    """Return all branches of the intersection at x, the longest first.

    Raises
    ------
    GeometryError
        The surfaces touch, or coincide, somewhere.
    """
    first, second = _approximate_surfaces(meeting, x)
    tracer = _BranchTracer(meeting, x)
    seeds = tracer.project_candidates(*_find_candidates(first, second, BOX_TOLERANCE * meeting.scale))
    found: list[IntersectionBranch] = []
    while len(seeds):
        branch = tracer.trace_branch(seeds[0])
        found.append(branch)
        points = meeting.evaluate_jets(seeds, np.full(len(seeds), x))[0][0]
        off = _is_off_chain(points, branch.points)
        off[0] = False
        seeds = seeds[off]
    return sorted(found, key=lambda one: -float(np.linalg.norm(np.diff(one.points, axis=0), axis=1).sum()))


def _approximate_surfaces(meeting: FamilyPair, x: float) -> list[Surface]:
    """Return both surfaces as splines, nearly."""
    off = BOX_TOLERANCE * meeting.scale
    return [family(s, off) for family, s in zip(meeting.families, meeting.s(x).tolist(), strict=True)]


@dataclass(frozen=True)
class _BranchTracer:
    """Follows branches of the intersection at one x."""

    family_pair: FamilyPair
    x: float

    @property
    def _x_array(self) -> Array:
        return np.array([self.x])

    def project_candidates(self, start: Array, half: Array) -> Array:
        """Bring candidates (n, 4) onto both surfaces, along shortest ways; leave out those that do not get there."""
        q = start.copy()
        for _ in range(25):
            first, second = self.family_pair.evaluate_jets(q, np.full(len(q), self.x))
            missed = first[0] - second[0]
            matrix = np.stack([first[1], first[2], -second[1], -second[2]], axis=-1) * half[:, None]
            step = -np.einsum("nij,nj->ni", np.linalg.pinv(matrix, rcond=1e-9), missed)
            q = q + np.clip(step, -2, 2) * half
            if np.linalg.norm(missed, axis=1).max(initial=0) <= 1e-14 * self.family_pair.scale:
                break
        first, second = self.family_pair.evaluate_jets(q, np.full(len(q), self.x))
        good = np.linalg.norm(first[0] - second[0], axis=1) <= 1e-10 * self.family_pair.scale
        good &= (self.family_pair.measure_outside(q) <= DOMAIN_TOLERANCE).all(axis=1) & (
            np.abs(q - start) <= 6 * half
        ).all(axis=1)
        return np.asarray(q[good])

    def _evaluate_tangent(self, q: Array) -> Array:
        """Return the direction (3,) of the intersection at one point."""
        first, second = self.family_pair.evaluate_jets(q[None], self._x_array)
        across = cross_product(
            normalise_vectors(cross_product(first[1], first[2])), normalise_vectors(cross_product(second[1], second[2]))
        )[0]
        sine = float(np.linalg.norm(across))
        if sine < TOUCHING_SINE:
            raise GeometryError(
                f"the surfaces touch, at an angle of {sine:.2g} rad, at "
                f"{self.family_pair.describe_place(q, self.x)}: there, their "
                "intersection has no direction; move one of them, or choose other a and b"
            )
        return across / sine

    def _intersect_plane(self, q: Array, target: Array, normal: Array, stride: float) -> Array | None:
        """Return the point of the intersection in a plane next to q; None if there is none."""
        return self._solve_cut(PlaneCut(lambda _: (target[None], normal[None])), q, stride)

    def _intersect_domain_end(self, inside: Array, outside: Array) -> Array | None:
        """Return the point of the intersection, between two others, at the end of a domain."""
        over = self.family_pair.measure_outside(outside[None])[0]
        axis = int(over.argmax())
        low, high = self.family_pair.bounds[axis].tolist()
        value = low if outside[axis] < low else high
        scale = self.family_pair.scale
        share = (value - inside[axis]) / (outside[axis] - inside[axis])
        line = IsoparametricCut(axis, value, value, scale / (high - low))
        made = self._solve_cut(line, inside + share * (outside - inside), scale)
        if made is None or self.family_pair.measure_outside(made[None]).max() > DOMAIN_TOLERANCE:
            return None
        made[axis] = value
        return made

    def _solve_cut(self, phase: CutCondition, q: Array, stride: float) -> Array | None:
        """Return the solution of a phase next to q; None if there is none."""
        made, good = IntersectionCurves(self.family_pair, phase).correct_solutions(
            q[None], np.zeros(1), self._x_array, stride
        )
        return made[0] if good[0] else None

    def _find_midpoint(
        self, ends: tuple[Array, Array], points: tuple[Array, Array], ways: tuple[Array, Array]
    ) -> Array | None:
        """Return the point half-way between two of a branch; None if it is not where a smooth curve between them is.

        Then the second one is of another branch, or the step too long.
        """
        chord = points[1] - points[0]
        length = float(np.linalg.norm(chord))
        middle = (points[0] + points[1]) / 2 + length / 8 * (ways[0] - ways[1])
        half = self._intersect_plane((ends[0] + ends[1]) / 2, middle, chord / length, length)
        if half is None or self.family_pair.measure_outside(half[None]).max() > DOMAIN_TOLERANCE:
            return None
        at = self.family_pair.evaluate_jets(half[None], self._x_array)[0][0, 0]
        return half if np.linalg.norm(at - middle) <= MIDPOINT_TOLERANCE * length else None

    def trace_branch(self, seed: Array) -> IntersectionBranch:
        """Follow the branch through a point of it."""
        ahead, closed = self._march_branch(seed, 1.0)
        q = ahead
        if not closed:
            back, _ = self._march_branch(seed, -1.0)
            q = np.concatenate([back[:0:-1], ahead])
        points = self.family_pair.evaluate_jets(q, np.full(len(q), self.x))[0][0]
        return IntersectionBranch(points, q, closed)

    def _march_branch(self, seed: Array, sense: float) -> tuple[Array, bool]:
        """Go from a point of a branch until it leaves a surface, or is back."""
        chain = [seed]
        start = here = self.family_pair.evaluate_jets(seed[None], self._x_array)[0][0, 0]
        first_way = way = sense * self._evaluate_tangent(seed)
        q, step, length = seed, LONGEST_STEP * self.family_pair.scale / 4, 0.0
        for _ in range(MOST_STEPS):
            if step < SHORTEST_STEP * self.family_pair.scale:
                break
            first, second = self.family_pair.evaluate_jets(q[None], self._x_array)
            rate = np.concatenate([to_tangent_coordinates(jet[:3], way[None])[0] for jet in (first, second)])
            made = self._intersect_plane(q + step * rate, here + step * way, way, step)
            ended = False
            if made is not None and self.family_pair.measure_outside(made[None]).max() > DOMAIN_TOLERANCE:
                made, ended = self._intersect_domain_end(q, made), True
            if made is None:
                step /= 2
                continue
            there = self.family_pair.evaluate_jets(made[None], self._x_array)[0][0, 0]
            moved = float(np.linalg.norm(there - here))
            if ended and moved <= SHORTEST_STEP * self.family_pair.scale:
                return np.stack(chain), False
            direction = self._evaluate_tangent(made)
            direction *= np.sign(direction @ way) or 1.0
            turned = float(np.arccos(np.clip(direction @ way, -1, 1)))
            half = (
                None
                if turned > 1.5 * STEP_TURN or moved > 2 * step
                else self._find_midpoint((q, made), (here, there), (way, direction))
            )
            if half is None:
                step /= 2
                continue
            passed = (start - here) @ first_way > 0 >= (start - there) @ first_way and direction @ first_way > 0.5
            if passed and length > 3 * moved and np.linalg.norm(start - here) < 2 * moved:
                chain.append(self._unwrap_start(seed, made))
                return np.stack(chain), True
            chain += [half, made]
            if ended:
                return np.stack(chain), False
            q, here, way, length = made, there, direction, length + moved
            step = min(
                step * float(np.clip(STEP_TURN / max(turned, 1e-3), 0.5, 2.0)), LONGEST_STEP * self.family_pair.scale
            )
        raise GeometryError(
            f"the intersection of the surfaces cannot be followed past {self.family_pair.describe_place(q, self.x)}"
        )

    def _unwrap_start(self, seed: Array, last: Array) -> Array:
        """Return the parameters of the start as they are after going round, next to the last ones."""
        out = seed.copy()
        periods = [period for family in self.family_pair.families for period in family.primary.periods]
        for axis, period in enumerate(periods):
            if period is not None:
                out[axis] += period * np.round((last[axis] - seed[axis]) / period)
        return out


def find_nearest_approach(meeting: FamilyPair, x: float) -> tuple[float, Array]:
    """Return how near two surfaces that do not meet come to each other at x, about, and where."""
    grids = []
    for surface in _approximate_surfaces(meeting, x):
        u, v = (np.linspace(low, high, 48) for low, high in surface.domain)
        grids.append(surface.grid(u, v).reshape(-1, 3))
    best, place = np.inf, grids[0][0]
    for block in np.array_split(grids[0], 24):
        apart = np.linalg.norm(block[:, None] - grids[1], axis=2)
        i, j = np.unravel_index(int(apart.argmin()), apart.shape)
        if apart[i, j] < best:
            best, place = float(apart[i, j]), (block[i] + grids[1][j]) / 2
    return best, place


def _is_off_chain(points: Array, chain: Array) -> Array:
    """Tell which points (n, 3) are off a chain of points: more than a share of its steps from its nearest segment."""
    start, along = chain[:-1], np.diff(chain, axis=0)
    square = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    apart = points[:, None] - start
    share = np.clip((apart * along).sum(axis=2) / square, 0, 1)
    distance = np.linalg.norm(apart - share[..., None] * along, axis=2) / np.sqrt(square)
    return np.asarray(distance.min(axis=1) > SAME_BRANCH_DISTANCE)


def _find_candidates(first: Surface, second: Surface, off: float) -> tuple[Array, Array]:
    """Return middles (n, 4) and half widths (n, 4) of the parts of both surfaces whose boxes overlap, halved enough.

    The surfaces may be ``off`` by so much (mm).
    """
    sides = [_SurfaceParts.from_surface(first), _SurfaceParts.from_surface(second)]
    i, j = (grid.ravel() for grid in np.indices((len(sides[0].windows), len(sides[1].windows))))
    common = [
        np.maximum(*(side.low.min(axis=0) for side in sides)),
        np.minimum(*(side.high.max(axis=0) for side in sides)),
    ]
    limit = float(np.linalg.norm(np.maximum(common[1] - common[0], 0))) / SUBDIVISION_LIMIT
    while True:
        low = np.maximum(sides[0].low[i], sides[1].low[j])
        high = np.minimum(sides[0].high[i], sides[1].high[j])
        meet = (low <= high + 2 * off).all(axis=1)
        i, j = i[meet], j[meet]
        if len(i) > MOST_PAIRS:
            middle = (low[meet] + high[meet]).mean(axis=0) / 2
            raise GeometryError(
                f"the surfaces touch, or coincide, over an area around {format_point(middle)}: move one of them"
            )
        large = [side.diagonals > limit for side in sides]
        if not any(big[index].any() for big, index in zip(large, (i, j), strict=True)):
            break
        i, j = _subdivide_pairs(sides, large, i, j)
    windows = np.concatenate([sides[0].windows[i], sides[1].windows[j]], axis=1)
    return windows.mean(axis=2), np.ptp(windows, axis=2) / 2


def _subdivide_pairs(sides: list[_SurfaceParts], large: list[Array], i: Array, j: Array) -> tuple[Array, Array]:
    """Quarter the large parts among those that are still in question; return the pairs of what is left."""
    children = []
    for k, index in enumerate((i, j)):
        used, inverse = np.unique(index, return_inverse=True)
        sides[k], offsets, counts = sides[k].quarter_large_parts(used, large[k][used])
        children.append((offsets[inverse], counts[inverse]))
    (start1, count1), (start2, count2) = children
    total = count1 * count2
    pair = np.repeat(np.arange(len(i)), total)
    k = np.arange(total.sum()) - np.repeat(np.cumsum(total) - total, total)
    return start1[pair] + k // count2[pair], start2[pair] + k % count2[pair]


@dataclass(frozen=True)
class _SurfaceParts:
    """Parts of a surface: homogeneous coefficients (p + 1, q + 1, 4, n), windows (n, 2, 2), boxes."""

    coefs: Array
    windows: Array
    low: Array
    high: Array

    @classmethod
    def from_surface(cls, surface: Surface) -> _SurfaceParts:
        coefs = surface.coefs
        if not surface.rational:
            coefs = np.concatenate([coefs, np.ones_like(coefs[:, :, :1])], axis=2)
        bu, bv = surface.breaks
        u = np.stack([bu[:-1], bu[1:]], axis=-1)[:, None].repeat(len(bv) - 1, axis=1)
        v = np.stack([bv[:-1], bv[1:]], axis=-1)[None].repeat(len(bu) - 1, axis=0)
        return cls.from_coefficients(coefs.reshape(*coefs.shape[:3], -1), np.stack([u, v], axis=2).reshape(-1, 2, 2))

    @classmethod
    def from_coefficients(cls, coefs: Array, windows: Array) -> _SurfaceParts:
        points = coefs[:, :, :3] / coefs[:, :, 3:]
        return cls(coefs, windows, points.min(axis=(0, 1)).T, points.max(axis=(0, 1)).T)

    @property
    def diagonals(self) -> Array:
        """Diagonals (n,) of the boxes."""
        return np.asarray(np.linalg.norm(self.high - self.low, axis=1))

    def quarter_large_parts(self, used: Array, large: Array) -> tuple[_SurfaceParts, Array, Array]:
        """Return the used parts, the large ones quartered; and for each where its own start, and how many they are."""
        coefs, windows = self.coefs[..., used], self.windows[used]
        counts = np.where(large, 4, 1)
        offsets = np.cumsum(counts) - counts
        parts = [coefs[..., ~large]]
        places = [windows[~large]]
        quarters = coefs[..., large]
        halves = [
            bernstein.restrict_pieces(np.eye(n)[..., None], np.array([a]), np.array([a + 0.5]))[..., 0]
            for n in quarters.shape[:2]
            for a in (0.0, 0.5)
        ]
        for iu in (0, 1):
            for iv in (0, 1):
                parts.append(np.einsum("ap,bq,pqdn->abdn", halves[iu], halves[2 + iv], quarters, optimize=True))
                window = windows[large].copy()
                middle = window.mean(axis=2)
                window[:, 0, 1 - iu] = middle[:, 0]
                window[:, 1, 1 - iv] = middle[:, 1]
                places.append(window)
        order = np.concatenate([offsets[~large], *(offsets[large] + k for k in range(4))])
        back = np.argsort(order, kind="stable")
        return (
            _SurfaceParts.from_coefficients(np.concatenate(parts, axis=-1)[..., back], np.concatenate(places)[back]),
            offsets,
            counts,
        )
