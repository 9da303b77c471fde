"""Which sizes fit: what contacts tell of one before it is tried, and how the end of those that fit is found."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from cqblend.blend_options import BlendRequest
from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver
from cqblend.brep.select.edge_joint import Joint
from cqblend.brep.select.rail_obstacles import describe_obstacle, find_leaving_contact
from cqblend.errors import CqblendError, SizeError
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import bisect_interval

ContactSolverFactory = Callable[[Joint, BlendRequest], ContactSolver]
"""What finds the contacts of a blend."""

CHECK_STATIONS = 25  # at which contacts are looked at
MIN_TOLERANCE_RATIO = 3.0  # of the edge's tolerance: no size is smaller
TRIAL_START_RATIO = (
    1 / 8
)  # of the size that contacts allow: where trials start, and by which they go down where that fails
MAX_TRIAL_STARTS = 3  # times
TRIAL_GROWTH = 1.25  # by which they go up
CHEAP_TRIAL_GROWTH, CHEAP_TRIAL_COUNT = (
    1.1,
    90,
)  # the same of trials that look at contacts alone: over nearly four decades


def _space_stations(joint: Joint) -> Array:
    """Return the t at which contacts are looked at: all around a closed edge, inside an open one."""
    count = np.arange(CHECK_STATIONS)
    return count / (CHECK_STATIONS - 1) if joint.spine.closed else (count + 0.5) / CHECK_STATIONS


def _measure_rail_distances(joint: Joint, contacts: Contacts) -> Array:
    """Return how far the contacts on both sides are from the edge, (2, n), mm."""
    points = [primary.jet(uv)[0] for primary, uv in zip(joint.primaries, contacts.uv, strict=True)]
    return np.linalg.norm(np.stack(points) - contacts.edge_points, axis=2)


def measure_reach(joint: Joint, request: BlendRequest, solver: ContactSolverFactory) -> float:
    """Return how far the rails are from the edge at most (mm)."""
    return float(_measure_rail_distances(joint, solver(joint, request)(_space_stations(joint))).max())


def check_size(joint: Joint, request: BlendRequest, solver: ContactSolverFactory) -> None:
    """Raise SizeError if contacts turn back, leave their faces, or are too near to the edge.

    The edge as it is drawn runs up to its tolerance beside the surfaces' true intersection, from which contacts are
    solved: a rail that is nearer than that cannot be told from it, however obtuse the angle between the faces. New
    edges may have twice that tolerance, so that sizes below three times lose themselves in it.
    """
    size, least = max(request.lengths), min(request.lengths)
    if size > joint.extent:
        raise SizeError(f"size {size:g} is larger than the whole solid, {joint.extent:.4g}")
    contacts = solver(joint, request)(_space_stations(joint))
    for primary, uv in zip(joint.primaries, contacts.uv, strict=True):
        ahead = (np.diff(primary.jet(uv)[0], axis=0) * np.diff(contacts.edge_points, axis=0)).sum(1)
        if not np.all(ahead > 0):
            raise SizeError(
                f"size {size:g} is too large: the rail turns back at t = {contacts.t[np.argmin(ahead)]:.3g}, where the "
                "edge bends more sharply than that"
            )
    left = find_leaving_contact(joint, contacts)
    if left is not None:
        side, index = left
        raise SizeError(
            f"size {size:g} is too large: {describe_obstacle(joint, contacts, side, index)}, and at t = "
            f"{contacts.t[index]:.3g} the rail reaches the end of face {joint.face_numbers[side]}"
        )
    nearest = float(_measure_rail_distances(joint, contacts).min())
    short = max(MIN_TOLERANCE_RATIO * joint.tolerance / least, joint.tolerance / nearest)
    if short > 1:
        raise SizeError(
            f"size {least:g} is too small: it must be three times the edge's own tolerance, {joint.tolerance:.2g}, and "
            f"the rails, which run {nearest:.2g} from the edge, further off than that: take at least "
            f"{1.01 * short * least:.3g}"
        )


def is_possible_size(joint: Joint, request: BlendRequest, solver: ContactSolverFactory) -> bool:
    """Whether :func:`check_size` lets a request pass."""
    try:
        check_size(joint, request, solver)
    except CqblendError:
        return False
    return True


def suggest_size(joint: Joint, request: BlendRequest, solver: ContactSolverFactory) -> str:
    """Say which size may fit instead, as far as contacts and faces tell, and what finds out."""
    finds = "cqblend.max_size finds what does" if request.relation is None else "try less"
    size = max(request.lengths)
    if size <= joint.extent and is_possible_size(joint, request, solver):
        return f"; less than {size:g} may fit: {finds}"
    most = size * _bisect_largest(
        lambda factor: is_possible_size(joint, request.with_scaled_lengths(factor), solver),
        min(1.0, joint.extent / size),
    )
    return f"; at most about {_round_down(most):g} fits, as far as the two faces tell: {finds}" if most else ""


def _bisect_largest(works: Callable[[float], bool], high: float) -> float:
    """Return the largest value up to ``high`` that works, by halving, to a part in 4096 of it; 0 if none does."""
    return bisect_interval(works, 0.0, high, steps=12)[0]


def find_working_limit(
    works: Callable[[float], bool], promising: Callable[[float], bool], high: float, tolerance: float
) -> float:
    """Return the end of the first interval from 0 in which sizes work, within a relative tolerance; 0 if there is none.

    ``works`` is the trial proper, ``promising`` a cheap one, which lets all pass that work. The cheap one goes up in
    small steps to where it ends; from well below, trials proper go up in larger ones, then halve between the last that
    works and the first that does not. The result less the tolerance has worked, too.
    """
    start, end = _find_first_interval(promising, high)
    trials = dict.fromkeys(max(start, end * TRIAL_START_RATIO**k) for k in range(1, MAX_TRIAL_STARTS + 1))
    low = next((size for size in trials if size and works(size)), 0.0)
    if not low:
        return 0.0
    high = end
    while low < high:
        following = min(low * TRIAL_GROWTH, high)
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


def _find_first_interval(promising: Callable[[float], bool], high: float) -> tuple[float, float]:
    """Return where the first interval of sizes that promise to work starts and ends; zeros if there is none."""
    first = last = 0.0
    for size in (high * CHEAP_TRIAL_GROWTH ** -np.arange(CHEAP_TRIAL_COUNT, -1.0, -1.0)).tolist():
        if promising(size):
            first, last = first or size, size
        elif first:
            return first, last + _bisect_largest(partial(_is_promising_beyond, promising, last), size - last)
    return first, last


def _is_promising_beyond(promising: Callable[[float], bool], size: float, more: float) -> bool:
    return promising(size + more)


def _round_down(value: float) -> float:
    """Round down to three digits."""
    digit = 10.0 ** (np.floor(np.log10(value)) - 2)
    return float(np.floor(value / digit) * digit)
