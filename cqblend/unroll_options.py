"""The options of a pattern: one record that ``cqblend.unroll``, ``Workplane.unroll`` and the command line share.

Names, defaults and documentation of the options stand in `UnrollOptions`, and nowhere else. Depends on
`cqblend.argument_checks` only: it is loaded by ``import cqblend``.
"""

import math
from dataclasses import KW_ONLY, dataclass, replace
from typing import Literal, get_args

from cqblend.argument_checks import check_choice, check_flag, check_positive, refuse_ignored_options

Method = Literal["longest", "elber", "curvature"]
Direction = Literal["auto", "rings", "u", "v"]
Layout = Literal["smooth", "triangles"]

FLAT_TOLERANCE_RATIO = 10.0
"""Quotient of `tolerance` and the default of `flat_tolerance`. A fine flat tolerance costs vertices only, no pieces."""


@dataclass(frozen=True, slots=True)
class UnrollOptions:
    """The options of `cqblend.unroll`, ``Workplane.unroll`` and ``cqblend unroll``.

    Attributes
    ----------
    tolerance : float
        Largest distance between the shape and the strips, both ways, mm.
    method : {"longest", "elber", "curvature"}, default "longest"
        How freeform faces are divided: longest strip first against a certified bound; by the paper's algorithm 1; or at
        the ridges of the normal curvature first (equations 5 to 7).
    direction : {"auto", "rings", "u", "v"}, default "auto"
        Parameter that the rulings run along: the one with fewer strips, or with less strain if both take as many; the
        one that makes rings of a closed face; or a given one. Where the first way fails, ``"auto"`` tries the other
        one, then narrower strips, then triangles; see ``report.detours``.
    layout : {"smooth", "triangles"}, default "smooth"
        How strips are laid flat: so that rails and rulings keep their lengths, or as the paper's triangles along one
        diagonal. Triangles keep chords, so seams between different faces match to `flat_tolerance` only.
    strain : float, default 0.01
        Largest change of lengths inside a strip when it is laid flat, relative: a strip that twists is made narrower
        until they change by less. By default what paper, leather and thin metal take. Not with ``method="elber"``,
        which is the paper's.
    developable : bool, default False
        Whether rulings of twisted strips are paired anew, so that the strips are truly developable, wherever such a
        pairing exists within the tolerance; it is an error if there is none. Not with ``method="elber"`` or
        ``layout="triangles"``.
    even : bool, default False
        Whether the strips of a face share its error evenly, instead of leaving the rest to the last one. Not with
        ``method="elber"``.
    least_width : float, optional
        Smallest width of a piece, mm, measured as twice its area over the length of its outlines. Thinner pieces are
        merged into a neighbour of the same face where that keeps the tolerance; ``report.unmerged`` names those that
        could not be. A face of which no piece can be that wide is refused.
    flat_tolerance : float, optional
        Largest distance between strips in space and flat pieces rolled, mm; by default a tenth of `tolerance`.
    """

    tolerance: float
    _: KW_ONLY
    method: Method = "longest"
    direction: Direction = "auto"
    layout: Layout = "smooth"
    strain: float = 0.01
    developable: bool = False
    even: bool = False
    least_width: float | None = None
    flat_tolerance: float | None = None

    @property
    def flat(self) -> float:
        """Largest distance between strips in space and flat pieces rolled, mm."""
        return self.tolerance / FLAT_TOLERANCE_RATIO if self.flat_tolerance is None else self.flat_tolerance

    def check(self) -> "UnrollOptions":
        """Return the same options with numbers as floats.

        Raises
        ------
        InputError
            An option is of the wrong type, not finite, out of range or unknown, or has no effect beside another one.

        Examples
        --------
        >>> UnrollOptions(1).check().flat
        0.1
        """
        tolerance = check_positive("tolerance", self.tolerance)
        flat = None if self.flat_tolerance is None else check_positive("flat_tolerance", self.flat_tolerance)
        checked = replace(
            self,
            tolerance=tolerance,
            flat_tolerance=flat,
            method=check_choice("method", self.method, get_args(Method)),
            direction=check_choice("direction", self.direction, get_args(Direction)),
            strain=check_positive("strain", self.strain),
            layout=check_choice("layout", self.layout, get_args(Layout)),
            developable=check_flag("developable", self.developable),
            even=check_flag("even", self.even),
            least_width=None if self.least_width is None else check_positive("least_width", self.least_width),
        )
        developable = self.developable, UNROLL_DEFAULTS.developable
        if checked.method == "elber":
            refuse_ignored_options(
                'on method="elber", which is the paper\'s',
                even=(self.even, UNROLL_DEFAULTS.even),
                developable=developable,
                strain=(self.strain, UNROLL_DEFAULTS.strain),
            )
        if checked.layout == "triangles":
            refuse_ignored_options('on layout="triangles", which is flat along diagonals', developable=developable)
        return checked


UNROLL_DEFAULTS = UnrollOptions(math.nan)
"""The options if none is given: the source of every default. The tolerance has none."""
