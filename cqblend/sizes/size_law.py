"""A size that varies along a blend: a checked function of t, which can be scaled, shared out and continued."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from cqblend.errors import InputError
from cqblend.sizes.size_functions import FloatArray, Linear, Table
from cqblend.sizes.tolerances import LAW_TOLERANCES

LawFunction: TypeAlias = Callable[[FloatArray], FloatArray]
"""A function from parameters (n,) in [0, 1] to sizes (n,), mm."""


@dataclass(frozen=True, eq=False)
class SizeLaw:
    """A size (mm) that varies along a blend, checked: a function of t, 0 at its start and 1 at its end.

    Attributes
    ----------
    name
        What messages call it.
    function
        The size over the whole law, at parameters in [0, 1].
    measure_slope
        The derivative of the function at one parameter, 0 or 1.
    corners
        Parameters in (0, 1) at which the function is no more than C1.
    factor
        What its sizes are multiplied by.
    span
        The parameters of the whole law at t = 0 and t = 1: (0, 1) for all of it, (1, 0) for all of it backwards.
    closed
        Whether the law goes on around, with period 1.
    """

    name: str
    function: LawFunction
    measure_slope: Callable[[float], float]
    corners: tuple[float, ...] = ()
    factor: float = 1.0
    span: tuple[float, float] = (0.0, 1.0)
    closed: bool = False

    def __call__(self, t: FloatArray) -> FloatArray:
        """Return the sizes (n,) at t (n,); past the ends of an open law, it goes on with the slope that it has there.

        Where it would fall to less than half of its size there, it falls ever more slowly, and never to 0.
        """
        at = self.locate_parameters(t)
        if self.closed:
            return self.factor * self.function(at - np.floor(at))
        inside = np.clip(at, 0.0, 1.0)
        values = self.function(inside)
        past = at - inside
        for end in (0.0, 1.0):
            beyond = (past != 0) & (inside == end)
            if beyond.any():
                values = values.copy()
                values[beyond] = _continue_linearly(values[beyond], self.measure_slope(end) * past[beyond])
        return self.factor * values

    def locate_parameters(self, t: FloatArray) -> FloatArray:
        """Return the parameters of the whole law at t."""
        first, last = self.span
        return t if self.span == (0.0, 1.0) else first + (last - first) * t

    @cached_property
    def _samples(self) -> FloatArray:
        """Sizes all along, from its start to its end."""
        return self(np.linspace(0.0, 1.0, LAW_TOLERANCES.samples + 1))

    @property
    def largest(self) -> float:
        """The largest size, mm."""
        return float(self._samples.max())

    @property
    def smallest(self) -> float:
        """The smallest size, mm, but for ends at which it goes to 0."""
        shares = self._samples[self._samples > LAW_TOLERANCES.least_solved * self.largest]
        return float(shares.min()) if any(self.vanishes) else float(self._samples.min())

    @property
    def vanishes(self) -> tuple[bool, bool]:
        """Whether it goes to 0 at its start, and at its end."""
        least = LAW_TOLERANCES.same_size * self.largest
        return bool(self._samples[0] <= least), bool(self._samples[-1] <= least)

    def find_vanishing_limit(self, end: int) -> float:
        """Return the t next to an end, 0 or 1, where it goes to 0, from which its size is more than next to nothing."""
        least = LAW_TOLERANCES.least_solved * self.largest
        near, far = float(end), float(self._samples.argmax() / LAW_TOLERANCES.samples)
        for _ in range(LAW_TOLERANCES.jump_halvings):
            middle = (near + far) / 2
            near, far = (near, middle) if self(np.array([middle]))[0] > least else (middle, far)
        return far

    def locate_corners(self, domain: tuple[float, float]) -> FloatArray:
        """Return the t in a range at which it is no more than C1, ascending; so is an open law at its ends."""
        first, last = self.span
        corners = np.array(self.corners)
        if self.closed:
            ends = np.floor([first + (last - first) * t for t in domain])
            corners = np.add.outer(np.arange(ends.min(), ends.max() + 1), corners).ravel()
        elif not isinstance(self.function, Linear):
            corners = np.concatenate([[0.0], corners, [1.0]])
        t = np.sort((corners - first) / (last - first))
        return t[(t > domain[0]) & (t < domain[1])]

    def scale(self, factor: float) -> SizeLaw:
        """Return the law with all sizes times a factor."""
        return replace(self, factor=self.factor * factor)

    def restrict(self, start: float, stop: float) -> float | SizeLaw:
        """Return the law from one of its parameters to another, or the number that it is between them.

        It is backwards if ``start`` is the larger one.
        """
        part = replace(self, span=(start, stop))
        samples = part._samples
        return float(samples[0]) if (samples == samples[0]).all() else part

    def close(self) -> SizeLaw:
        """Return the law for a closed edge, around which it goes on.

        Raises
        ------
        InputError
            If its sizes at both ends are not the same, or its slopes there.
        """
        ends = self.function(np.array([0.0, 1.0])) * self.factor
        if any(self.vanishes):
            raise InputError(f"{self.name} is 0 at an end: that can only be on an open edge, and this one is closed")
        if abs(ends[1] - ends[0]) > LAW_TOLERANCES.same_size * self.largest:
            raise InputError(
                f"{self.name} is {ends[0]:g} mm at t = 0 and {ends[1]:g} mm at t = 1, which are one place on a closed "
                "edge: both must be the same"
            )
        if isinstance(self.function, Table):
            periodic = replace(self.function, periodic=True)
            nodes = (0.0, *self.corners)
            return replace(self, function=periodic, measure_slope=periodic.measure_slope, corners=nodes, closed=True)
        slopes = [self.measure_slope(end) * self.factor for end in (0.0, 1.0)]
        steepest = np.abs(np.diff(self._samples)).max() * LAW_TOLERANCES.samples
        if abs(slopes[1] - slopes[0]) > LAW_TOLERANCES.least_kink * max(steepest, *map(abs, slopes)):
            raise make_corner_error(self.name, 0.0, slopes[1], slopes[0])
        return replace(self, closed=True)


def _continue_linearly(sizes: FloatArray, changes: FloatArray) -> FloatArray:
    """Return sizes and their changes added up; below a share of the sizes, an exponential takes over with its slope."""
    least = LAW_TOLERANCES.least_continued * sizes
    added = sizes + changes
    with np.errstate(divide="ignore", invalid="ignore"):
        falling = least * np.exp((added - least) / least)
    return np.where(added >= least, added, np.where(least > 0, falling, 0.0))


def make_corner_error(name: str, t: float, before: float, after: float) -> InputError:
    """Return the error for a slope (mm for t from 0 to 1) that jumps at t."""
    return InputError(
        f"{name} has a corner at t = {t:.4g}, where its slope jumps from {before:.4g} to {after:.4g} mm: the rails "
        "would have one, too; cqblend.table goes smoothly through given sizes"
    )
