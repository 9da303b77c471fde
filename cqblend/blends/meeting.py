"""Where two reshaped surfaces meet: all branches of their intersection, each followed from end to end.

Candidates come from halving both surfaces wherever the boxes of their control points overlap: a spline lies in the hull
of its control points, so no branch is lost that is longer than a last part. Newton brings them onto both surfaces; from
there a branch is marched along its tangent, corrected at every step, until it closes or leaves a surface. Numbers are
those of the families themselves; splines of offsets serve for the boxes only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.contact import newton
from cqblend.blends.families import Course, Family
from cqblend.blends.primaries import Array, cross, tangent_coordinates, unit
from cqblend.blends.relations import Relation
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface, bernstein

ROUGH = 1e-4  # of the size, by which the splines of offsets, whose boxes are tested, may be off
PARTS = 48  # of the common box of both surfaces: as large, at most, is a last part
MOST_PAIRS = 60_000  # of parts that may meet: more are surfaces that touch along an area
TURN = 0.25  # rad, by which a branch turns in a step, about
SHORTEST, LONGEST = 1e-7, 1 / 12  # steps, of the size
ASTRAY = 0.01  # of a step: by as much a point half-way may be off the smooth curve between both ends
MOST_STEPS = 5_000
OUTSIDE = 1e-9  # of a domain, by which a point may be outside
TANGENTIAL = 1e-5  # sine of the angle between surfaces, below which they touch
NEAR = 0.07  # of a step: as near to a branch, a point lies on it


@dataclass(frozen=True)
class Branch:
    """One intersection curve: points (n, 3), parameters (n, 4) on both surfaces, continuous along it.

    The first and the last point of a ``closed`` one are the same.
    """

    points: Array
    q: Array
    closed: bool


@dataclass(frozen=True)
class Meeting:
    """Two families, reshaped together.

    ``s`` are the (s1, s2) at x in [0, 1], eased, ``courses`` what the families are there.
    """

    families: tuple[Family, Family]
    s: Curve
    courses: tuple[Course, Course]
    bounds: Array  # (4, 2) of u1, v1, u2, v2; infinite where a surface goes on periodically
    scale: float  # of the surfaces in space, mm

    @classmethod
    def of(cls, families: tuple[Family, Family], relation: Relation) -> Meeting:
        """Prepare two families, that of surface 1 first."""
        first, second = families
        s = relation.eased
        courses = first.course(s[0], "1"), second.course(s[1], "2")
        bounds = np.concatenate([family.bounds() for family in families])
        return cls(families, s, courses, bounds, min(family.size() for family in families))

    def jets(self, q: Array, x: Array) -> tuple[Array, Array]:
        """Return S, Su, Sv, Sx, (4, n, 3), of both surfaces at parameters (n, 4) and x (n,)."""
        (first, second), (one, two) = self.families, self.courses
        return first.jet(q[:, :2], one(x)), second.jet(q[:, 2:], two(x))

    def place(self, q: Array, x: float) -> str:
        """Say where a point is: s on both surfaces, and its coordinates."""
        s1, s2 = self.s(x)
        at = self.jets(q[None], np.array([x]))[0][0, 0]
        return f"s = ({s1:.4g}, {s2:.4g}), at " + point(at)

    def outside(self, q: Array) -> Array:
        """Return how far (n, 4) parameters are out of the surfaces, in shares of their domains; 0 inside."""
        width = np.where(np.isfinite(self.bounds[:, 1]), self.bounds[:, 1] - self.bounds[:, 0], 1.0)
        return np.asarray(np.maximum(np.maximum(self.bounds[:, 0] - q, q - self.bounds[:, 1]) / width, 0.0))

    # -- branches

    def branches(self, x: float) -> list[Branch]:
        """Return all branches of the intersection at x, the longest first.

        Raises
        ------
        GeometryError
            The surfaces touch, or coincide, somewhere.
        """
        rough = ROUGH * self.scale
        first, second = (family(s, rough) for family, s in zip(self.families, self.s(x).tolist(), strict=True))
        start, half = _candidates(first, second, rough)
        seeds = self._onto(start, half, x)
        found: list[Branch] = []
        while len(seeds):
            branch = self._follow(seeds[0], x)
            found.append(branch)
            points = self.jets(seeds, np.full(len(seeds), x))[0][0]
            seeds = seeds[_distance(points, branch.points) > np.append(True, np.zeros(len(seeds) - 1))]
        return sorted(found, key=lambda one: -float(np.linalg.norm(np.diff(one.points, axis=0), axis=1).sum()))

    def _onto(self, start: Array, half: Array, x: float) -> Array:
        """Bring candidates (n, 4) onto both surfaces, along shortest ways; leave out those that do not get there."""
        q, good = start.copy(), np.ones(len(start), bool)
        for _ in range(25):
            first, second = self.jets(q, np.full(len(q), x))
            missed = first[0] - second[0]
            matrix = np.stack([first[1], first[2], -second[1], -second[2]], axis=-1) * half[:, None]
            step = -np.einsum("nij,nj->ni", np.linalg.pinv(matrix, rcond=1e-9), missed)
            q = q + np.clip(step, -2, 2) * half
            if np.linalg.norm(missed, axis=1).max(initial=0) <= 1e-14 * self.scale:
                break
        first, second = self.jets(q, np.full(len(q), x))
        good &= np.linalg.norm(first[0] - second[0], axis=1) <= 1e-10 * self.scale
        good &= (self.outside(q) <= OUTSIDE).all(axis=1) & (np.abs(q - start) <= 6 * half).all(axis=1)
        return np.asarray(q[good])

    def _tangent(self, q: Array, x: float) -> Array:
        """Return the direction (3,) of the intersection at one point."""
        first, second = self.jets(q[None], np.array([x]))
        across = cross(unit(cross(first[1], first[2])), unit(cross(second[1], second[2])))[0]
        sine = float(np.linalg.norm(across))
        if sine < TANGENTIAL:
            raise GeometryError(
                f"the surfaces touch, at an angle of {sine:.2g} rad, at {self.place(q, x)}: there, their intersection "
                "has no direction; move one of them, or choose other a and b"
            )
        return across / sine

    def _corrected(self, q: Array, x: float, target: Array, normal: Array, stride: float) -> Array | None:
        """Return the point of the intersection in a plane next to q; None if there is none."""

        def system(z: Array) -> tuple[Array, Array, Array]:
            first, second = self.jets(z, np.full(len(z), x))
            residual = np.concatenate(
                [first[0] - second[0], ((first[0] - target) * normal).sum(axis=1, keepdims=True)], axis=1
            )
            matrix = np.zeros((len(z), 4, 4))
            matrix[:, :3] = np.stack([first[1], first[2], -second[1], -second[2]], axis=-1)
            matrix[:, 3, :2] = np.stack([(first[k] * normal).sum(axis=1) for k in (1, 2)], axis=-1)
            return residual, matrix, np.linalg.norm(matrix[:, :3], axis=1)

        made, good = newton(system, q[None], self.scale, stride)
        return made[0] if good[0] else None

    def _at_bound(self, inside: Array, outside: Array, x: float) -> Array | None:
        """Return the point of the intersection, between two others, at the end of a domain."""
        over = self.outside(outside[None])[0]
        axis = int(over.argmax())
        low, high = self.bounds[axis]
        value = float(low if outside[axis] < low else high)

        def system(z: Array) -> tuple[Array, Array, Array]:
            first, second = self.jets(z, np.full(len(z), x))
            matrix = np.zeros((len(z), 4, 4))
            matrix[:, :3] = np.stack([first[1], first[2], -second[1], -second[2]], axis=-1)
            size = np.linalg.norm(matrix[:, :3, axis], axis=1)
            matrix[:, 3, axis] = size
            residual = np.concatenate([first[0] - second[0], ((z[:, axis] - value) * size)[:, None]], axis=1)
            return residual, matrix, np.linalg.norm(matrix[:, :3], axis=1)

        share = (value - inside[axis]) / (outside[axis] - inside[axis])
        made, good = newton(system, (inside + share * (outside - inside))[None], self.scale, self.scale)
        if not good[0] or self.outside(made).max() > OUTSIDE:
            return None
        made[0, axis] = value
        return made[0]

    def _half_way(
        self, ends: tuple[Array, Array], points: tuple[Array, Array], ways: tuple[Array, Array], x: float
    ) -> Array | None:
        """Return the point half-way between two of a branch; None if it is not where a smooth curve between them is.

        Then the second one is of another branch, or the step too long.
        """
        chord = points[1] - points[0]
        length = float(np.linalg.norm(chord))
        middle = (points[0] + points[1]) / 2 + length / 8 * (ways[0] - ways[1])
        half = self._corrected((ends[0] + ends[1]) / 2, x, middle, chord / length, length)
        if half is None or self.outside(half[None]).max() > OUTSIDE:
            return None
        at = self.jets(half[None], np.array([x]))[0][0, 0]
        return half if np.linalg.norm(at - middle) <= ASTRAY * length else None

    def _follow(self, seed: Array, x: float) -> Branch:
        """Follow the branch through a point of it."""
        ahead, closed = self._march(seed, x, 1.0)
        q = ahead
        if not closed:
            back, _ = self._march(seed, x, -1.0)
            q = np.concatenate([back[:0:-1], ahead])
        points = self.jets(q, np.full(len(q), x))[0][0]
        return Branch(points, q, closed)

    def _march(self, seed: Array, x: float, sense: float) -> tuple[Array, bool]:
        """Go from a point of a branch until it leaves a surface, or is back."""
        chain = [seed]
        start = here = self.jets(seed[None], np.array([x]))[0][0, 0]
        first_way = way = sense * self._tangent(seed, x)
        q, step, length = seed, LONGEST * self.scale / 4, 0.0
        for _ in range(MOST_STEPS):
            if step < SHORTEST * self.scale:
                break
            first, second = self.jets(q[None], np.array([x]))
            rate = np.concatenate([tangent_coordinates(jet[:3], way[None])[0] for jet in (first, second)])
            made = self._corrected(q + step * rate, x, here + step * way, way, step)
            ended = False
            if made is not None and self.outside(made[None]).max() > OUTSIDE:
                made, ended = self._at_bound(q, made, x), True
            if made is None:
                step /= 2
                continue
            there = self.jets(made[None], np.array([x]))[0][0, 0]
            moved = float(np.linalg.norm(there - here))
            if ended and moved <= SHORTEST * self.scale:
                return np.stack(chain), False
            direction = self._tangent(made, x)
            direction *= np.sign(direction @ way) or 1.0
            turned = float(np.arccos(np.clip(direction @ way, -1, 1)))
            half = (
                None
                if turned > 1.5 * TURN or moved > 2 * step
                else self._half_way((q, made), (here, there), (way, direction), x)
            )
            if half is None:
                step /= 2
                continue
            passed = (start - here) @ first_way > 0 >= (start - there) @ first_way and direction @ first_way > 0.5
            if passed and length > 3 * moved and np.linalg.norm(start - here) < 2 * moved:
                chain.append(self._around(seed, made))
                return np.stack(chain), True
            chain += [half, made]
            if ended:
                return np.stack(chain), False
            q, here, way, length = made, there, direction, length + moved
            step = min(step * float(np.clip(TURN / max(turned, 1e-3), 0.5, 2.0)), LONGEST * self.scale)
        raise GeometryError(f"the intersection of the surfaces cannot be followed past {self.place(q, x)}")

    def _around(self, seed: Array, last: Array) -> Array:
        """Return the parameters of the start as they are after going round, next to the last ones."""
        out = seed.copy()
        periods = [period for family in self.families for period in family.primary.periods]
        for axis, period in enumerate(periods):
            if period is not None:
                out[axis] += period * np.round((last[axis] - seed[axis]) / period)
        return out


def nearest_approach(meeting: Meeting, x: float) -> tuple[float, Array]:
    """Return how near two surfaces that do not meet come to each other at x, about, and where."""
    s = meeting.s(x)
    grids = []
    for family, amount in zip(meeting.families, s.tolist(), strict=True):
        surface = family(amount, ROUGH * meeting.scale)
        u, v = (np.linspace(low, high, 48) for low, high in surface.domain)
        grids.append(surface.grid(u, v).reshape(-1, 3))
    best, place = np.inf, grids[0][0]
    for block in np.array_split(grids[0], 24):
        apart = np.linalg.norm(block[:, None] - grids[1], axis=2)
        i, j = np.unravel_index(int(apart.argmin()), apart.shape)
        if apart[i, j] < best:
            best, place = float(apart[i, j]), (block[i] + grids[1][j]) / 2
    return best, place


def point(at: Array) -> str:
    """Write a point as messages do."""
    return "(" + ", ".join(f"{x:.5g}" for x in at) + ")"


def _distance(points: Array, chain: Array) -> Array:
    """Tell which points (n, 3) are off a chain of points: more than a share of its steps from its nearest segment."""
    start, along = chain[:-1], np.diff(chain, axis=0)
    square = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    apart = points[:, None] - start
    share = np.clip((apart * along).sum(axis=2) / square, 0, 1)
    distance = np.linalg.norm(apart - share[..., None] * along, axis=2) / np.sqrt(square)
    return np.asarray(distance.min(axis=1) > NEAR, dtype=float)


def _candidates(first: Surface, second: Surface, off: float) -> tuple[Array, Array]:
    """Return middles (n, 4) and half widths (n, 4) of the parts of both surfaces whose boxes overlap, halved enough.

    The surfaces may be ``off`` by so much (mm).
    """
    sides = [_Parts.of(first), _Parts.of(second)]
    i, j = (grid.ravel() for grid in np.indices((len(sides[0].windows), len(sides[1].windows))))
    common = [
        np.maximum(*(side.low.min(axis=0) for side in sides)),
        np.minimum(*(side.high.max(axis=0) for side in sides)),
    ]
    limit = float(np.linalg.norm(np.maximum(common[1] - common[0], 0))) / PARTS
    while True:
        low = np.maximum(sides[0].low[i], sides[1].low[j])
        high = np.minimum(sides[0].high[i], sides[1].high[j])
        meet = (low <= high + 2 * off).all(axis=1)
        i, j = i[meet], j[meet]
        if len(i) > MOST_PAIRS:
            middle = (low[meet] + high[meet]).mean(axis=0) / 2
            raise GeometryError(
                f"the surfaces touch, or coincide, over an area around {point(middle)}: move one of them"
            )
        large = [side.size > limit for side in sides]
        if not any(big[index].any() for big, index in zip(large, (i, j), strict=True)):
            break
        i, j = _halved(sides, large, i, j)
    windows = np.concatenate([sides[0].windows[i], sides[1].windows[j]], axis=1)
    return windows.mean(axis=2), np.ptp(windows, axis=2) / 2


def _halved(sides: list[_Parts], large: list[Array], i: Array, j: Array) -> tuple[Array, Array]:
    """Quarter the large parts among those that are still in question; return the pairs of what is left."""
    children = []
    for k, index in enumerate((i, j)):
        used, inverse = np.unique(index, return_inverse=True)
        sides[k], offsets, counts = sides[k].quartered(used, large[k][used])
        children.append((offsets[inverse], counts[inverse]))
    (start1, count1), (start2, count2) = children
    total = count1 * count2
    pair = np.repeat(np.arange(len(i)), total)
    k = np.arange(total.sum()) - np.repeat(np.cumsum(total) - total, total)
    return start1[pair] + k // count2[pair], start2[pair] + k % count2[pair]


@dataclass(frozen=True)
class _Parts:
    """Parts of a surface: homogeneous coefficients (p + 1, q + 1, 4, n), windows (n, 2, 2), boxes."""

    coefs: Array
    windows: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, surface: Surface) -> _Parts:
        coefs = surface.coefs
        if not surface.rational:
            coefs = np.concatenate([coefs, np.ones_like(coefs[:, :, :1])], axis=2)
        bu, bv = surface.breaks
        u = np.stack([bu[:-1], bu[1:]], axis=-1)[:, None].repeat(len(bv) - 1, axis=1)
        v = np.stack([bv[:-1], bv[1:]], axis=-1)[None].repeat(len(bu) - 1, axis=0)
        return cls.made(coefs.reshape(*coefs.shape[:3], -1), np.stack([u, v], axis=2).reshape(-1, 2, 2))

    @classmethod
    def made(cls, coefs: Array, windows: Array) -> _Parts:
        points = coefs[:, :, :3] / coefs[:, :, 3:]
        return cls(coefs, windows, points.min(axis=(0, 1)).T, points.max(axis=(0, 1)).T)

    @property
    def size(self) -> Array:
        """Diagonals (n,) of the boxes."""
        return np.asarray(np.linalg.norm(self.high - self.low, axis=1))

    def quartered(self, used: Array, large: Array) -> tuple[_Parts, Array, Array]:
        """Return the used parts, the large ones quartered; and for each where its own start, and how many they are."""
        coefs, windows = self.coefs[..., used], self.windows[used]
        counts = np.where(large, 4, 1)
        offsets = np.cumsum(counts) - counts
        parts = [coefs[..., ~large]]
        places = [windows[~large]]
        quarters = coefs[..., large]
        halves = [
            bernstein.restrict(np.eye(n)[..., None], np.array([a]), np.array([a + 0.5]))[..., 0]
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
        return _Parts.made(np.concatenate(parts, axis=-1)[..., back], np.concatenate(places)[back]), offsets, counts
