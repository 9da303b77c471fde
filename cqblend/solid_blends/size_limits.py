"""Which sizes fit: what contacts tell of one before it is tried, and how the end of those that fit is found."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from cqblend.blend_options import BlendRequest
from cqblend.blends.contacts.contact_solver import Contacts, Solver
from cqblend.brep.select.edge_joint import Joint
from cqblend.brep.select.rail_obstacles import leaving, obstacle
from cqblend.errors import CqblendError, SizeError
from cqblend.surfaces.primaries import Array

Solving = Callable[[Joint, BlendRequest], Solver]
"""What finds the contacts of a blend."""

STATIONS = 25  # at which contacts are looked at
CLEAR = 3.0  # of the edge's tolerance: no size is smaller
BELOW = 1 / 8  # of the size that contacts allow: where trials start, and by which they go down where that fails
DOWN = 3  # times
STEP = 1.25  # by which they go up
CHEAP_STEP, CHEAP_STEPS = 1.1, 90  # the same of trials that look at contacts alone: over nearly four decades


def _along(joint: Joint) -> Array:
    """Return the t at which contacts are looked at: all around a closed edge, inside an open one."""
    count = np.arange(STATIONS)
    return count / (STATIONS - 1) if joint.spine.closed else (count + 0.5) / STATIONS


def _distances(joint: Joint, contacts: Contacts) -> Array:
    """Return how far the contacts on both sides are from the edge, (2, n), mm."""
    points = [primary.jet(uv)[0] for primary, uv in zip(joint.primaries, contacts.uv, strict=True)]
    return np.linalg.norm(np.stack(points) - contacts.point, axis=2)


def reach(joint: Joint, request: BlendRequest, solver: Solving) -> float:
    """Return how far the rails are from the edge at most (mm)."""
    return float(_distances(joint, solver(joint, request)(_along(joint))).max())


def check(joint: Joint, request: BlendRequest, solver: Solving) -> None:
    """Raise SizeError if contacts turn back, leave their faces, or are too near to the edge.

    The edge as it is drawn runs up to its tolerance beside the surfaces' true intersection, from which contacts are
    solved: a rail that is nearer than that cannot be told from it, however obtuse the angle between the faces. New
    edges may have twice that tolerance, so that sizes below three times lose themselves in it.
    """
    size, least = max(request.lengths), min(request.lengths)
    if size > joint.extent:
        raise SizeError(f"size {size:g} is larger than the whole solid, {joint.extent:.4g}")
    contacts = solver(joint, request)(_along(joint))
    for primary, uv in zip(joint.primaries, contacts.uv, strict=True):
        ahead = (np.diff(primary.jet(uv)[0], axis=0) * np.diff(contacts.point, axis=0)).sum(1)
        if not np.all(ahead > 0):
            raise SizeError(
                f"size {size:g} is too large: the rail turns back at t = {contacts.t[np.argmin(ahead)]:.3g}, where the "
                "edge bends more sharply than that"
            )
    left = leaving(joint, contacts)
    if left is not None:
        side, index = left
        raise SizeError(
            f"size {size:g} is too large: {obstacle(joint, contacts, side, index)}, and at t = "
            f"{contacts.t[index]:.3g} the rail reaches the end of face {joint.faces[side]}"
        )
    nearest = float(_distances(joint, contacts).min())
    short = max(CLEAR * joint.tolerance / least, joint.tolerance / nearest)
    if short > 1:
        raise SizeError(
            f"size {least:g} is too small: it must be three times the edge's own tolerance, {joint.tolerance:.2g}, and "
            f"the rails, which run {nearest:.2g} from the edge, further off than that: take at least "
            f"{1.01 * short * least:.3g}"
        )


def fits(joint: Joint, request: BlendRequest, solver: Solving) -> bool:
    """Whether :func:`check` lets a request pass."""
    try:
        check(joint, request, solver)
    except CqblendError:
        return False
    return True


def hint(joint: Joint, request: BlendRequest, solver: Solving) -> str:
    """Say which size may fit instead, as far as contacts and faces tell, and what finds out."""
    finds = "cqblend.max_size finds what does" if request.relation is None else "try less"
    size = max(request.lengths)
    if size <= joint.extent and fits(joint, request, solver):
        return f"; less than {size:g} may fit: {finds}"
    most = size * _last(lambda factor: fits(joint, request.scaled(factor), solver), min(1.0, joint.extent / size))
    return f"; at most about {_rounded_down(most):g} fits, as far as the two faces tell: {finds}" if most else ""


def _last(works: Callable[[float], bool], high: float) -> float:
    """Return the largest value up to ``high`` that works, by halving, to a part in 4096 of it; 0 if none does."""
    low = 0.0
    for _ in range(12):
        middle = (low + high) / 2
        low, high = (middle, high) if works(middle) else (low, middle)
    return low


def end_of_working(
    works: Callable[[float], bool], promising: Callable[[float], bool], high: float, tolerance: float
) -> float:
    """Return the end of the first interval from 0 in which sizes work, within a relative tolerance; 0 if there is none.

    ``works`` is the trial proper, ``promising`` a cheap one, which lets all pass that work. The cheap one goes up in
    small steps to where it ends; from well below, trials proper go up in larger ones, then halve between the last that
    works and the first that does not. The result less the tolerance has worked, too.
    """
    start, end = _first_interval(promising, high)
    trials = dict.fromkeys(max(start, end * BELOW**k) for k in range(1, DOWN + 1))
    low = next((size for size in trials if size and works(size)), 0.0)
    if not low:
        return 0.0
    high = end
    while low < high:
        following = min(low * STEP, high)
        if not works(following):
            high = following
            break
        low = following
    while high - low > tolerance / 2 * low:
        middle = (low + high) / 2
        low, high = (middle, high) if works(middle) else (low, middle)
    while not works((1 - tolerance) * low):  # sizes work here and there: the interval ends before
        low *= (1 - tolerance) ** 2
    return low


def _first_interval(promising: Callable[[float], bool], high: float) -> tuple[float, float]:
    """Return where the first interval of sizes that promise to work starts and ends; zeros if there is none."""
    first = last = 0.0
    for size in (high * CHEAP_STEP ** -np.arange(CHEAP_STEPS, -1.0, -1.0)).tolist():
        if promising(size):
            first, last = first or size, size
        elif first:
            return first, last + _last(partial(_beyond, promising, last), size - last)
    return first, last


def _beyond(promising: Callable[[float], bool], size: float, more: float) -> bool:
    return promising(size + more)


def _rounded_down(value: float) -> float:
    """Round down to three digits."""
    digit = 10.0 ** (np.floor(np.log10(value)) - 2)
    return float(np.floor(value / digit) * digit)
