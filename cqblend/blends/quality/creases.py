"""Creases inside a blend: how sharp they are, what they come from, and how sharp they may be.

A crease is where the normal jumps from one piece of a blend to the next, along a whole section. What surfaces have of
their own where a rail crosses them is theirs; more than that, or than the tolerance, is refused unless it is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cqblend.blends.rails.ribbon import Ribbon, along
from cqblend.blends.rails.steering import SLIVER, Turn, turns
from cqblend.errors import GeometryError
from cqblend.splines import Surface
from cqblend.splines.evaluation import Side
from cqblend.surfaces.primaries import Array, cross

if TYPE_CHECKING:
    from cqblend.blends.sections.blend_surface import Blend

ROUNDING = 1e-9  # rad: below that a crease is rounding, even where none is allowed
ACROSS = 33  # points of each section, at which normals are compared
THIN = 1e-6  # of the largest |H_t x H_v|: where a section shrinks to a point, it has no normal
CLOSED = 1e-9  # of the size of a blend: ends that are nearer meet
SMOOTH = 1e-6  # rad: the kink of a closed rail where it meets itself, up to which it has none
BESIDE = 0.05  # rad: directions so near to their rail span no tangent plane to speak of with it
FAR, MOST = 0.8, 1.57  # rad, of a turn: what seldom goes well, and what can be asked for
SPARE = 0.01  # rad, on top of a turn that would do: it depends a little on what is turned


class Allowed(NamedTuple):
    """How sharp creases may be: ``crease`` (rad) if it is given, else ``tolerance`` (rad) or what surfaces have."""

    tolerance: float
    crease: float | None = None

    @property
    def anywhere(self) -> float:
        """What is allowed wherever it is, rad."""
        return self.tolerance if self.crease is None else max(self.crease, ROUNDING)

    def along(self, ribbons: Sequence[Ribbon]) -> float:
        """Return the most that is allowed somewhere along ribbons, rad."""
        own = [one.crease for ribbon in ribbons for one in ribbon.primary.crossings(ribbon.c, 0)]
        return max([self.anywhere, *(own if self.crease is None else [])])


def creases(surface: Surface) -> tuple[Array, Array]:
    """Return the parameters t (n,) of sections at which a blend may have a crease, and the largest there (n,), rad."""
    breaks, v = surface.breaks[0], (np.arange(ACROSS) + 0.5) / ACROSS
    kinks = breaks[1:-1][surface.continuity[0] < 1]
    before = after = kinks
    ends = np.stack([surface(np.full(ACROSS, t), v) for t in breaks[[0, -1]]])
    if np.abs(ends[0] - ends[1]).max() <= CLOSED * np.abs(ends).max() and _returns(surface):
        before, after = np.append(before, breaks[-1]), np.append(after, breaks[0])
    one, two = _normals(surface, before, v, "left"), _normals(surface, after, v, "right")
    angle = np.arctan2(np.linalg.norm(cross(one, two), axis=-1), (one * two).sum(axis=-1))
    lengths = np.minimum(np.linalg.norm(one, axis=-1), np.linalg.norm(two, axis=-1))
    angle[lengths <= THIN * lengths.max(initial=0.0)] = 0.0
    return after, angle.max(axis=1, initial=0.0)


def _normals(surface: Surface, t: Array, v: Array, side: Side) -> Array:
    """Return H_t x H_v on one side, (n, m, 3)."""
    tt, vv = np.meshgrid(t, v, indexing="ij")
    return cross(surface(tt, vv, 1, 0, side=side), surface(tt, vv, 0, 1, side=side))


def _returns(surface: Surface) -> bool:
    """Whether both boundaries of a closed blend end in the direction in which they start."""
    (low, high), v = surface.domain[0], np.array([0.0, 1.0])
    first, last = (surface(np.full(2, t), v, 1, 0) for t in (low, high))
    sine = np.linalg.norm(cross(first, last), axis=1)
    return bool(np.all(np.arctan2(sine, (first * last).sum(axis=1)) <= SMOOTH))


def check_creases(
    blend: Blend, allowed: Allowed, names: tuple[str, str] = ("surface 1", "surface 2"), *, steers: bool = True
) -> None:
    """Check that a blend has no crease inside that is sharper than allowed.

    ``names`` are those of its surfaces; ``steers`` tells whether a larger ``steer`` can be asked for.

    Raises
    ------
    GeometryError
        If it has; the message has the angle, where and why it is, and what helps.
    """
    t, angle = creases(blend.surface)
    over = angle > allowed.anywhere
    if not over.any():
        return
    t, angle = t[over], angle[over]
    slack = SLIVER * (blend.surface.breaks[0][-1] - blend.surface.breaks[0][0])
    known = [
        (name, one)
        for name, ribbon in zip(names, blend.ribbons, strict=True)
        for one in turns(ribbon, len(ribbon.directions))
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
        name, (one, *_) = min(lines[worst], key=lambda pair: pair[1].crossing.shape)
        where += (
            f"the rail crosses the knot line {'uv'[one.axis]} = {one.value:.6g} of {name}, which is only G{one.shape} "
            "there"
        )
    else:
        jumps = [
            f"the speed of the rail on {name} jumps (cqblend.reparameterise changes it)"
            for name, ribbon in zip(names, blend.ribbons, strict=True)
            if _jumps(ribbon, t[worst : worst + 1])
        ]
        where += jumps[0] if jumps else "the directions into it have a kink"
    places = [[one for owner, one in some if owner == name] for some in lines for name in {name for name, _ in some}]
    ways = [way_out(places if all(lines) else [])] if steers else []
    ways.append(f"crease={_above(float(angle.max())):.2g}, which allows it")
    raise GeometryError(
        f"the blend has a crease of {angle[worst]:.2g} rad inside, over {allowed.anywhere:.2g}, {where}: "
        f"take {'; or '.join(ways)}"
    )


def _jumps(ribbon: Ribbon, t: Array) -> bool:
    """Whether the speed of a rail jumps at t (1,)."""
    sides: tuple[Side, Side] = ("left", "right")
    before, after = (along([ribbon.primary.position(ribbon.c)], t, 1, side)[0, 1] for side in sides)
    return bool(np.abs(after - before).max() > SMOOTH * np.abs(before).max())


def way_out(needed: Sequence[Sequence[Turn]]) -> str:
    """Return what helps at places on rails where directions would have to turn: a larger ``steer``, if one would do.

    Of each place, the turns that the lines of a surface ask for: there is none where they are not one.
    """
    single = all(len(place) == 1 for place in needed)
    steer = max((abs(one.angle) for place in needed for one in place), default=np.inf) + SPARE
    if not single or steer > MOST or any(one.clear < BESIDE for place in needed for one in place):
        return "other tangents, or less continuity: no steer= would do"
    doubt = ", so far that the blend may fold" if steer > FAR else ""
    return f"steer={min(_above(steer), MOST):.3g}, which turns the directions along the line{doubt}"


def _above(value: float) -> float:
    """Round up to two digits."""
    digit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(np.ceil(value / digit) * digit)
