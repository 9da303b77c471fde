"""Which sizes fit: a check of contacts before a size is tried, and the search for the largest size that works."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from cqblend.brep.selection.rail_obstacles import describe_obstacle
from cqblend.errors import CqblendError, SizeError
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.strip_context import StripContext
from cqblend.solid_blends.tolerances import SIZE_SEARCH, SOLID_BLEND_TOLERANCES
from cqblend.splines.bracketing import bisect_interval


def check_size(context: StripContext) -> None:
    """Raise SizeError if contacts turn back, leave their faces, or are too near to the edge.

    The edge's curve runs up to its tolerance beside the surfaces' true intersection, from which contacts are solved: a
    rail that is nearer than that cannot be told from it, however obtuse the angle between the faces. New edges may have
    twice that tolerance, so that the least size is three times it.
    """
    joint, method = context.joint, context.method
    size, least = method.size, method.sizes.least
    if size > joint.extent:
        raise SizeError(
            f"size {size:g} is larger than the whole solid, {joint.extent:.4g}", kind="too large", value=size
        )
    contacts = context.checked_contacts
    for points, is_point in zip(context.contact_points, context.has_point_rails, strict=True):
        if is_point:
            continue
        ahead = (np.diff(points, axis=0) * np.diff(contacts.edge_points, axis=0)).sum(1)
        if not np.all(ahead > 0):
            t = float(contacts.t[np.argmin(ahead)])
            here = method.sizes.measure_largest(t)
            raise SizeError(
                f"size {here:g} is too large: the rail turns back at t = {t:.3g}, where the edge bends more sharply "
                f"than that{', or the size changes too fast' if method.sizes.laws else ''}",
                kind="too large",
                place=t,
                value=here,
            )
    left = context.leaving_contact
    if left is not None and not _goes_on_smoothly(context):
        side, index = left
        t = float(contacts.t[index])
        here = method.sizes.measure_largest(t)
        raise SizeError(
            f"size {here:g} is too large: {describe_obstacle(joint, contacts, side, index)}, and at t = "
            f"{t:.3g} the rail reaches the end of face {joint.face_numbers[side]}",
            kind="too large",
            place=t,
            value=here,
        )
    nearest = float(context.rail_distances.max() if any(context.vanishes) else context.rail_distances.min())
    short = max(SOLID_BLEND_TOLERANCES.min_tolerance_ratio * joint.tolerance / least, joint.tolerance / nearest)
    if short > 1:
        raise SizeError(
            f"size {least:g} is too small: it must be three times the edge's own tolerance, {joint.tolerance:.2g}, and "
            f"the rails, which run {nearest:.2g} from the edge, further off than that: take at least "
            f"{1.01 * short * least:.3g}",
            kind="too small",
            value=least,
        )


def _goes_on_smoothly(context: StripContext) -> bool:
    """Whether rails that leave the faces at the edge go on over smooth edges."""
    try:
        return bool(context.stretches)
    except CqblendError:
        return False


def check_chain_size(context: ChainContext) -> None:
    """Raise SizeError if the size does not fit at one of the cells of a chain; see :func:`check_size`."""
    for cell in context.cells:
        try:
            check_size(cell)
        except CqblendError as error:
            raise error.with_details(shape=cell.joint.name) from error


def is_possible_size(context: ChainContext) -> bool:
    """Whether :func:`check_chain_size` lets a blend pass."""
    try:
        check_chain_size(context)
    except CqblendError:
        return False
    return True


def suggest_size(context: ChainContext, error: SizeError) -> str:
    """Return advice which size may fit in place of one that failed, as far as can be told, and how to find out."""
    advice, size, extent = context.method.size_advice, context.largest_size, context.index.extent
    if error.room:
        return f"; at most about {_round_down(error.room * size):g} fits there: {advice}"
    if size <= extent and is_possible_size(context):
        return f"; less than {size:g} may fit: {advice}"
    largest = size * _bisect_largest(lambda factor: is_possible_size(context.scale(factor)), min(1.0, extent / size))
    if not largest:
        return ""
    factor = f"{_round_down(largest / size):g} times as much" if context.varies else f"{_round_down(largest):g}"
    return f"; at most about {factor} fits, as far as the two faces tell: {advice}"


def _bisect_largest(is_working: Callable[[float], bool], high: float) -> float:
    """Return the largest value up to ``high`` that works, by halving, to a part in 4096 of it; 0 if none does."""
    return bisect_interval(is_working, 0.0, high, steps=12)[0]


def find_working_limit(
    is_working: Callable[[float], bool], is_promising: Callable[[float], bool], high: float, tolerance: float
) -> float:
    """Return the end of the first interval from 0 in which sizes work, within a relative tolerance; 0 if there is none.

    ``is_working`` is the full trial, which makes a blend; ``is_promising`` checks contacts only, and passes all sizes
    that work. Sizes are factors on the request, up to ``high``. Cheap trials go up in small steps to where they end;
    from well below, full trials go up in larger steps, and then halve the interval between the last that works and the
    first that does not. The result less the tolerance has worked, too.
    """
    start, end = _find_first_interval(is_promising, high)
    trials = dict.fromkeys(max(start, end * SIZE_SEARCH.start_ratio**k) for k in range(1, SIZE_SEARCH.max_starts + 1))
    low = next((size for size in trials if size and is_working(size)), 0.0)
    if not low:
        return 0.0
    high = end
    while low < high:
        following = min(low * SIZE_SEARCH.growth, high)
        if not is_working(following):
            high = following
            break
        low = following
    while high - low > tolerance / 2 * low:
        middle = (low + high) / 2
        low, high = (middle, high) if is_working(middle) else (low, middle)
    while not is_working((1 - tolerance) * low):  # sizes work here and there: the interval ends before
        low *= (1 - tolerance) ** 2
    return low


def _find_first_interval(is_promising: Callable[[float], bool], high: float) -> tuple[float, float]:
    """Return where the first interval of sizes that promise to work starts and ends; zeros if there is none."""
    first = last = 0.0
    for size in (high * SIZE_SEARCH.cheap_growth ** -np.arange(SIZE_SEARCH.cheap_count, -1.0, -1.0)).tolist():
        if is_promising(size):
            first, last = first or size, size
        elif first:
            return first, last + _bisect_largest(partial(_is_promising_beyond, is_promising, last), size - last)
    return first, last


def _is_promising_beyond(is_promising: Callable[[float], bool], size: float, more: float) -> bool:
    """Whether a size that is larger by some more promises to work."""
    return is_promising(size + more)


def _round_down(value: float) -> float:
    """Round down to three digits, but for rounding."""
    digit = 10.0 ** (np.floor(np.log10(value)) - 2)
    return float(np.floor(value / digit * (1 + 1e-9)) * digit)
