"""Creases inside a blend: measures them, finds what causes them, and refuses those that are too sharp.

A crease is a section along which the normal jumps from one piece of a blend to the next. A crease as sharp as that of
a surface where the rail crosses it is accepted; a sharper one is refused, unless it is within the tolerance or the
caller allows it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cqblend.blends.quality.tolerances import CREASE_TOLERANCES
from cqblend.blends.rails.direction_steering import RequiredTurn, find_required_turns
from cqblend.blends.rails.ribbon import BREAK_SIDES, Ribbon, evaluate_space_jets
from cqblend.blends.rails.steering_advice import round_up_to_two_digits, suggest_remedy
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.errors import GeometryError
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide
from cqblend.surfaces.vectors import cross_product


class CreaseLimit(NamedTuple):
    """How sharp creases may be: up to ``crease`` (rad) if given, else ``tolerance`` (rad) or those of surfaces."""

    tolerance: float
    crease: float | None = None

    @property
    def uniform_limit(self) -> float:
        """The sharpest crease that is allowed everywhere, rad."""
        return self.tolerance if self.crease is None else max(self.crease, CREASE_TOLERANCES.rounding_angle)

    def find_limit(self, ribbons: Sequence[Ribbon]) -> float:
        """Return the sharpest crease that is allowed somewhere along ribbons, rad."""
        surface_creases = [
            crossing.crease for ribbon in ribbons for crossing in ribbon.primary.find_knot_crossings(ribbon.c, 0)
        ]
        return max([self.uniform_limit, *(surface_creases if self.crease is None else [])])


def measure_creases(surface: Surface) -> tuple[Array, Array]:
    """Return the parameters t (n,) of sections at which a blend may have a crease, and its largest angle (n,), rad."""
    count = CREASE_TOLERANCES.section_points
    breaks, v = surface.breaks[0], (np.arange(count) + 0.5) / count
    before = after = breaks[1:-1][surface.continuity[0] < 1]
    ends = np.stack([surface(np.full(count, t), v) for t in breaks[[0, -1]]])
    is_closed = np.abs(ends[0] - ends[1]).max() <= CREASE_TOLERANCES.closing_gap * np.abs(ends).max()
    if is_closed and _has_periodic_boundaries(surface):
        before, after = np.append(before, breaks[-1]), np.append(after, breaks[0])
    left, right = _evaluate_normals(surface, before, v, "left"), _evaluate_normals(surface, after, v, "right")
    angle = np.arctan2(np.linalg.norm(cross_product(left, right), axis=-1), (left * right).sum(axis=-1))
    lengths = np.minimum(np.linalg.norm(left, axis=-1), np.linalg.norm(right, axis=-1))
    angle[lengths <= CREASE_TOLERANCES.thin_section * lengths.max(initial=0.0)] = 0.0
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
    return bool(np.all(np.arctan2(sine, (first * last).sum(axis=1)) <= CREASE_TOLERANCES.closing_kink))


def check_creases(
    blend: BlendSurface,
    allowed: CreaseLimit,
    names: tuple[str, str] = ("surface 1", "surface 2"),
    *,
    steers: bool = True,
) -> None:
    """Raise GeometryError if a blend has a crease inside that is sharper than allowed.

    ``names`` are those of its surfaces; ``steers`` says whether the message may advise a larger option ``steer``.

    Raises
    ------
    GeometryError
        If it has; the message has the angle, the place, the cause, and what helps.
    """
    t, angle = measure_creases(blend.surface)
    over = angle > allowed.uniform_limit
    if not over.any():
        return
    t, angle = t[over], angle[over]
    causes = _find_causes(blend, names, t)
    if allowed.crease is None:
        from_surfaces = np.array([max((turn.crossing.crease for _, turn in known), default=0.0) for known in causes])
        keep = np.flatnonzero(angle > from_surfaces)
        t, angle, causes = t[keep], angle[keep], [causes[i] for i in keep]
        if not len(t):
            return
    worst = int(angle.argmax())
    place = f"at t = {t[worst]:.6g}, where {_describe_cause(blend, names, float(t[worst]), causes[worst])}"
    remedies = [suggest_remedy(_group_by_place(causes) if all(causes) else [])] if steers else []
    remedies.append(f"crease={round_up_to_two_digits(float(angle.max())):.2g}, which allows it")
    raise GeometryError(
        f"the blend has a crease of {angle[worst]:.2g} rad inside, over {allowed.uniform_limit:.2g}, {place}: "
        f"take {'; or '.join(remedies)}"
    )


class _Cause(NamedTuple):
    """A knot line of a surface, by the name of the surface, that causes a crease where a rail crosses it."""

    surface_name: str
    turn: RequiredTurn


def _find_causes(blend: BlendSurface, names: tuple[str, str], t: Array) -> list[list[_Cause]]:
    """Return, for each t, the knot lines of both surfaces that the rails cross there."""
    same_place = RAIL_TOLERANCES.sliver_share * (blend.surface.breaks[0][-1] - blend.surface.breaks[0][0])
    causes = [
        _Cause(name, turn)
        for name, ribbon in zip(names, blend.ribbons, strict=True)
        for turn in find_required_turns(ribbon, len(ribbon.directions))
    ]
    return [[cause for cause in causes if abs(cause.turn.crossing.t - at) <= same_place] for at in t.tolist()]


def _group_by_place(causes: list[list[_Cause]]) -> list[list[RequiredTurn]]:
    """Return the required turns at each place of each surface."""
    return [
        [cause.turn for cause in known if cause.surface_name == name]
        for known in causes
        for name in {cause.surface_name for cause in known}
    ]


def _describe_cause(blend: BlendSurface, names: tuple[str, str], t: float, causes: list[_Cause]) -> str:
    """Return the cause of a crease at t for the message: a knot line, a jump of a rail's speed, or the directions."""
    if causes:
        name, (crossing, *_) = min(causes, key=lambda cause: cause.turn.crossing.shape_continuity)
        return (
            f"the rail crosses the knot line {'uv'[crossing.axis]} = {crossing.value:.6g} of {name}, which is only "
            f"G{crossing.shape_continuity} there"
        )
    for name, ribbon in zip(names, blend.ribbons, strict=True):
        if _has_speed_jump(ribbon, t):
            return f"the speed of the rail on {name} jumps (cqblend.reparameterise changes it)"
    return "the directions into it have a kink"


def _has_speed_jump(ribbon: Ribbon, t: float) -> bool:
    """Whether the speed of a rail jumps at t."""
    position = ribbon.primary.compose_position(ribbon.c)
    before, after = (evaluate_space_jets([position], np.array([t]), 1, side)[0, 1] for side in BREAK_SIDES)
    return bool(np.abs(after - before).max() > CREASE_TOLERANCES.closing_kink * np.abs(before).max())
