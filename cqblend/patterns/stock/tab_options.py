"""Options of tabs, checked once and passed on as one record."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from cqblend.argument_checks import check_millimetres
from cqblend.errors import InputError, shown
from cqblend.patterns.stock.stock_proportions import TAB_LIMITS

TabStyle = Literal["one", "alternating", "both", "strips", "allowance"]
"""Tabs on one side of each seam, teeth on either side in turn, flanges on both sides, separate connecting strips from
below, or a plain seam allowance on both sides."""


@dataclass(frozen=True, slots=True)
class TabOptions:
    """How tabs are wanted.

    Attributes
    ----------
    width
        Height of tabs above their base, mm; of connecting strips, on either side of the seam.
    style
        See :func:`cqblend.patterns.stock.tabs.fit_tabs`.
    taper
        Angle between base and legs (rad), above 0, at most pi / 2. Legs are made steeper where a tab is short.
    pitch
        Length of teeth along the base, mm; three widths if None.
    least
        Least height, mm: lower tabs are dropped. If None, a quarter of the width, but at most
        :attr:`TabLimits.least_height`.

    Raises
    ------
    InputError
        If a length or the taper is out of range, or the style is unknown.

    Examples
    --------
    >>> TabOptions(10).tooth_length, TabOptions(10).least_height, TabOptions(4).least_height
    (30.0, 2.0, 1.0)
    """

    width: float
    style: TabStyle = "one"
    taper: float = float(np.pi / 4)
    pitch: float | None = None
    least: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.style, str) or self.style not in get_args(TabStyle):
            raise InputError(f"the style of tabs is one of {', '.join(get_args(TabStyle))}, not {shown(self.style)}")
        object.__setattr__(self, "width", check_millimetres("the width of tabs", self.width))
        if self.pitch is not None:
            object.__setattr__(self, "pitch", check_millimetres("the pitch of tabs", self.pitch))
        if self.least is not None:
            object.__setattr__(self, "least", check_millimetres("the least height of tabs", self.least))
        if self.least_height > self.width:
            raise InputError(
                f"the least height of tabs, {self.least_height:g} mm, exceeds their width, {self.width:g} mm"
            )
        taper = self.taper
        if isinstance(taper, bool) or not isinstance(taper, int | float) or not 0 < taper <= np.pi / 2 + 1e-12:
            raise InputError(f"the taper of tabs is an angle above 0, at most pi/2 (rad), not {shown(taper)}")

    @property
    def tooth_length(self) -> float:
        """Length of teeth along the base, mm."""
        return 3 * self.width if self.pitch is None else self.pitch

    @property
    def least_height(self) -> float:
        """Height below which tabs are dropped, mm."""
        if self.least is not None:
            return self.least
        return min(TAB_LIMITS.least_height_ratio * self.width, TAB_LIMITS.least_height)

    @property
    def leg_cotangent(self) -> float:
        """Cotangent of the angle of legs between teeth: how far they lean in per mm of height."""
        return float(1 / np.tan(min(self.taper, TAB_LIMITS.steepest_leg)))
