"""Creases inside a blend: how sharp they are, what they come from, and how sharp they may be.

A crease is where the normal jumps from one piece of a blend to the next, along a whole section. What surfaces have of
their own where a rail crosses them is theirs; more than that, or than the tolerance, is refused unless it is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cqblend.blends.rails.ribbon import BREAK_SIDES, Ribbon, evaluate_space_jets
from cqblend.blends.rails.steering import find_required_turns
from cqblend.blends.rails.steering_advice import round_up_to_two_digits, suggest_remedy
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.errors import GeometryError
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide
from cqblend.surfaces.vectors import cross_product

ROUNDING_ANGLE = 1e-9  # rad: below that a crease is rounding, even where none is allowed
SECTION_POINTS = 33  # points of each section, at which normals are compared
THIN_SECTION_SHARE = 1e-6  # of the largest |H_t x H_v|: where a section shrinks to a point, it has no normal
CLOSED_BLEND_SHARE = 1e-9  # of the size of a blend: ends that are nearer meet
SMOOTH_ANGLE = 1e-6  # rad: the kink of a closed rail where it meets itself, up to which it has none


class CreaseLimit(NamedTuple):
    """How sharp creases may be: ``crease`` (rad) if it is given, else ``tolerance`` (rad) or what surfaces have."""

    tolerance: float
    crease: float | None = None

    @property
    def uniform_limit(self) -> float:
        """What is allowed wherever it is, rad."""
        return self.tolerance if self.crease is None else max(self.crease, ROUNDING_ANGLE)

    def find_limit(self, ribbons: Sequence[Ribbon]) -> float:
        """Return the most that is allowed somewhere along ribbons, rad."""
        own = [one.crease for ribbon in ribbons for one in ribbon.primary.find_knot_crossings(ribbon.c, 0)]
        return max([self.uniform_limit, *(own if self.crease is None else [])])


def measure_creases(surface: Surface) -> tuple[Array, Array]:
    """Return the parameters t (n,) of sections at which a blend may have a crease, and the largest there (n,), rad."""
    breaks, v = surface.breaks[0], (np.arange(SECTION_POINTS) + 0.5) / SECTION_POINTS
    kinks = breaks[1:-1][surface.continuity[0] < 1]
    before = after = kinks
    ends = np.stack([surface(np.full(SECTION_POINTS, t), v) for t in breaks[[0, -1]]])
    if np.abs(ends[0] - ends[1]).max() <= CLOSED_BLEND_SHARE * np.abs(ends).max() and _has_periodic_boundaries(surface):
        before, after = np.append(before, breaks[-1]), np.append(after, breaks[0])
    one, two = _evaluate_normals(surface, before, v, "left"), _evaluate_normals(surface, after, v, "right")
    angle = np.arctan2(np.linalg.norm(cross_product(one, two), axis=-1), (one * two).sum(axis=-1))
    lengths = np.minimum(np.linalg.norm(one, axis=-1), np.linalg.norm(two, axis=-1))
    angle[lengths <= THIN_SECTION_SHARE * lengths.max(initial=0.0)] = 0.0
    return after, angle.max(axis=1, initial=0.0)


def _evaluate_normals(surface: Surface, t: Array, v: Array, side: BreakSide) -> Array:
    """Return H_t x H_v on one side, (n, m, 3)."""
    tt, vv = np.meshgrid(t, v, indexing="ij")
    return cross_product(surface(tt, vv, 1, 0, side=side), surface(tt, vv, 0, 1, side=side))


def _has_periodic_boundaries(surface: Surface) -> bool:
    """Whether both boundaries of a closed blend end in the direction in which they start."""
    (low, high), v = surface.domain[0], np.array([0.0, 1.0])
    first, last = (surface(np.full(2, t), v, 1, 0) for t in (low, high))
    sine = np.linalg.norm(cross_product(first, last), axis=1)
    return bool(np.all(np.arctan2(sine, (first * last).sum(axis=1)) <= SMOOTH_ANGLE))


def check_creases(
    blend: BlendSurface,
    allowed: CreaseLimit,
    names: tuple[str, str] = ("surface 1", "surface 2"),
    *,
    steers: bool = True,
) -> None:
    """Check that a blend has no crease inside that is sharper than allowed.

    ``names`` are those of its surfaces; ``steers`` tells whether a larger ``steer`` can be asked for.

    Raises
    ------
    GeometryError
        If it has; the message has the angle, where and why it is, and what helps.
    """
    t, angle = measure_creases(blend.surface)
    over = angle > allowed.uniform_limit
    if not over.any():
        return
    t, angle = t[over], angle[over]
    slack = RAIL_TOLERANCES.sliver_share * (blend.surface.breaks[0][-1] - blend.surface.breaks[0][0])
    known = [
        (name, one)
        for name, ribbon in zip(names, blend.ribbons, strict=True)
        for one in find_required_turns(ribbon, len(ribbon.directions))
    ]
    lines = [[pair for pair in known if abs(pair[1].crossing.t - at) <= slack] for at in t.tolist()]
    if allowed.crease is None:
        own = np.array([max((one.crossing.crease for _, one in some), default=0.0) for some in lines])
        keep = np.flatnonzero(angle > own)
        t, angle, lines = t[keep], angle[keep], [lines[i] for i in keep]
        if not len(t):
            return
    worst = int(angle.argmax())
    where = f"at t = {t[worst]:.6g}, where "
    if lines[worst]:
        name, (one, *_) = min(lines[worst], key=lambda pair: pair[1].crossing.shape_continuity)
        where += (
            f"the rail crosses the knot line {'uv'[one.axis]} = {one.value:.6g} of {name}, which is only "
            f"G{one.shape_continuity} "
            "there"
        )
    else:
        jumps = [
            f"the speed of the rail on {name} jumps (cqblend.reparameterise changes it)"
            for name, ribbon in zip(names, blend.ribbons, strict=True)
            if _has_speed_jump(ribbon, t[worst : worst + 1])
        ]
        where += jumps[0] if jumps else "the directions into it have a kink"
    places = [[one for owner, one in some if owner == name] for some in lines for name in {name for name, _ in some}]
    ways = [suggest_remedy(places if all(lines) else [])] if steers else []
    ways.append(f"crease={round_up_to_two_digits(float(angle.max())):.2g}, which allows it")
    raise GeometryError(
        f"the blend has a crease of {angle[worst]:.2g} rad inside, over {allowed.uniform_limit:.2g}, {where}: "
        f"take {'; or '.join(ways)}"
    )


def _has_speed_jump(ribbon: Ribbon, t: Array) -> bool:
    """Whether the speed of a rail jumps at t (1,)."""
    before, after = (
        evaluate_space_jets([ribbon.primary.compose_position(ribbon.c)], t, 1, side)[0, 1] for side in BREAK_SIDES
    )
    return bool(np.abs(after - before).max() > SMOOTH_ANGLE * np.abs(before).max())
