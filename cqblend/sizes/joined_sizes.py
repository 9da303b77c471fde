"""Joins sizes that hold on one part of a blend each to one size of the whole, with gradual changes between them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from cqblend.errors import InputError
from cqblend.sizes.law_checks import check_law
from cqblend.sizes.size_functions import FloatArray
from cqblend.sizes.size_law import SizeLaw
from cqblend.sizes.tolerances import LAW_TOLERANCES


def join_sizes(
    name: str,
    sizes: Sequence[float | SizeLaw | None],
    stops: Sequence[float],
    taper: float | None,
    name_place: Callable[[int], str],
    *,
    closed: bool,
) -> float | SizeLaw:
    """Return the size that is one of several on each part of a blend, as one law, or a number if it is one.

    Parameters
    ----------
    name
        What messages call it.
    sizes
        The sizes, by part; laws are functions of the t of the whole. Of a part without one, None, the size changes all
        along from that of the part before to that of the part after, with two vanishing derivatives at both ends. The
        first part has one, and so has the last, unless the first one follows it.
    stops
        The t at which the parts end; the last one is 1.
    taper
        Length, in t, over which sizes change that differ where two parts meet: there, the size is a mean of both with
        weights that are quintic polynomials of t, so that it is C2.
    name_place
        What messages call the place at which part k ends.
    closed
        Whether the last part goes on in the first one.

    Raises
    ------
    InputError
        Sizes differ where two parts meet, and there is no taper, or not enough room for it; or as :func:`check_law`.
    """
    first = sizes[0]
    if first is not None and all(size is first or size == first for size in sizes):
        return first
    count, steps = len(sizes), list[tuple[float, int]]()  # where sizes differ, and the part before

    def evaluate_part(k: int, t: FloatArray) -> FloatArray:
        size = sizes[k % count]
        if size is None:
            return change_gradually(k % count, t)
        return size(np.clip(t, 0.0, 1.0)) if isinstance(size, SizeLaw) else np.full(len(t), size)

    def change_gradually(k: int, t: FloatArray) -> FloatArray:
        before = max(j for j in range(k) if sizes[j] is not None)
        after = next((j for j in range(k, count) if sizes[j] is not None), count)
        start, stop = stops[before], stops[after - 1]
        first = evaluate_part(before, np.array([start]))[0]
        last = evaluate_part(after, np.array([stop if after < count else 0.0]))[0]
        share = _fade_in(np.clip((t - start) / (stop - start), 0.0, 1.0))
        return np.asarray(first + (last - first) * share)

    for k in range(count if closed else count - 1):
        before = float(evaluate_part(k, np.array([stops[k]]))[0])
        after = float(evaluate_part(k + 1, np.array([stops[k] % 1.0 if k + 1 == count else stops[k]]))[0])
        if abs(before - after) <= LAW_TOLERANCES.same_size * max(before, after):
            continue
        if taper is None:
            raise InputError(
                f"{name} is {before:g} mm before {name_place(k)} and {after:g} mm after it: sizes must agree where a "
                "blend goes on, unless taper= says over what length, in mm, they change"
            )
        steps.append((stops[k], k))
    half = 0.0 if taper is None else taper / 2
    places = [place for place, _ in steps]
    bounds = [places[-1] - 1, *places, places[0] + 1] if closed and places else [-half, *places, 1 + half]
    for before, after in itertools.pairwise(bounds):
        if places and after - before < 2 * half * (1 - LAW_TOLERANCES.same_size):
            k = steps[min(bounds.index(after), len(steps)) - 1][1]
            raise InputError(f"taper is too long: at {name_place(k)}, there is no room for it along the edges")

    def evaluate_whole(t: FloatArray) -> FloatArray:
        number = np.minimum(np.searchsorted(stops, t, side="right"), count - 1)
        values = np.empty(len(t))
        for k in range(count):
            values[number == k] = evaluate_part(k, t[number == k])
        for place, k in steps:
            offset = t - place
            if closed:
                offset = offset - np.round(offset)
            near = np.abs(offset) < half
            x = offset[near] / (2 * half) + 0.5
            share = _fade_in(x)
            values[near] = (1 - share) * evaluate_part(k, place + offset[near]) + share * evaluate_part(
                k + 1, place + offset[near] - (place == 1.0)
            )
        return values

    joined = check_law(name, lambda t: evaluate_whole(np.atleast_1d(t)))
    if not isinstance(joined, SizeLaw):
        return joined
    corners = {corner for size in sizes if isinstance(size, SizeLaw) for corner in size.corners}
    joined = replace(joined, corners=tuple(sorted(corners)))
    if any(place == 1.0 for place in places):
        return joined

    def measure_slope(end: float) -> float:
        part = sizes[-1 if end else 0]
        return part.measure_slope(end) * part.factor if isinstance(part, SizeLaw) else 0.0

    return replace(joined, measure_slope=measure_slope)  # differences do not tell it beside a short part


def _fade_in(x: FloatArray) -> FloatArray:
    """Return the quintic from 0 at x = 0 to 1 at x = 1 of which two derivatives vanish at both ends."""
    return np.asarray(x**3 * (10 - 15 * x + 6 * x**2))
