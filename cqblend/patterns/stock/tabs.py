"""Tabs along seams, by which pieces are glued, welded or stitched together: the stubs of Elber's paper.

Elber (1995), section 3 and figure 6: stubs are made by offsetting the boundary curves of the flat pieces; or they are
separate strips that span two pieces from underneath, which leaves no stair. A tab that is glued under the neighbour has
to lie inside the neighbour's outline, else it would show. Tabs that do not fit are reported. Depends on the layout of
flaps, on their outlines, and on connecting strips.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cqblend.errors import InputError
from cqblend.patterns.outline.overlap import find_winding_errors
from cqblend.patterns.outline.pieces import Pieces
from cqblend.patterns.stock.connecting_strips import add_connecting_strips
from cqblend.patterns.stock.flaps import Flap, FlapFitter
from cqblend.patterns.stock.tab_layout import lay_out_flaps
from cqblend.patterns.stock.tab_options import TabOptions
from cqblend.patterns.stock.tab_outlines import merge_flaps
from cqblend.splines.bernstein import Array


@dataclass(frozen=True, slots=True, eq=False)
class Tabs:
    """Pieces with tabs, and how far the tabs are what was asked for.

    Attributes
    ----------
    pieces
        The pieces with their cut outlines and scores; connecting strips are appended as pieces of their own.
    coverage
        (seams,), the part of each seam's length that carries tabs; of both sides, where both should have some.
    heights
        (seams,), height of the lowest tab of each seam, mm; 0 where there is none.
    width
        The width asked for, mm.
    """

    pieces: Pieces
    coverage: Array
    heights: Array
    width: float

    @property
    def missing(self) -> tuple[str, ...]:
        """Labels of the seams that have no tab at all, for want of room."""
        return tuple(self.pieces.seams[k].label for k in np.flatnonzero(self.coverage == 0))

    @property
    def narrowed(self) -> tuple[str, ...]:
        """Labels of the seams whose tabs are partly missing or lower than the width."""
        short = (self.coverage > 0) & ((self.coverage < 1 - 1e-9) | (self.heights < self.width * (1 - 1e-9)))
        return tuple(self.pieces.seams[k].label for k in np.flatnonzero(short))


def fit_tabs(pieces: Pieces, options: TabOptions) -> Tabs:
    """Return pieces with tabs along their seams, and which tabs did not fit.

    A tab's base is its run, its top the offset curve of the run at the tab's height (arcs stay arcs). Its legs stand at
    the taper, flatter in corners: at most half of the neighbour's corner, so that two tabs glued into it do not meet.
    Where the seam is curved, in the plane or in space, the tab is cut into teeth.

    Styles
        ``"one"``: on the side where more of it fits, the seam's first side if both are alike; glued under the other
        piece. ``"alternating"``: congruent teeth on either side in turn, which interlock. ``"both"``: flanges on both
        sides, folded inwards and joined face to face; only the plane limits them. ``"strips"``: separate strips
        underneath, half under each piece, without the stair that a tab makes; of one part where both sides of the
        seam have the same curve in the plane, else straight stubs one after another. ``"allowance"``: both sides,
        without teeth, mitred at corners.

    Folds
        A tab lies underneath its neighbour, so it is folded as the surface is: a mountain where the seam is convex
        (also where its angle is unknown), a valley where it is concave, and not at all where the surface goes on
        smoothly, see :attr:`Seam.fold`. Flanges and allowances turn by (pi + angle) / 2 to the inner side: always a
        mountain.

    Parameters
    ----------
    pieces
        The pieces, without tabs. One that overlaps itself gets none.
    options
        Style and sizes.

    Raises
    ------
    InputError
        If a piece has tabs already, or there would be more than :attr:`TabLimits.most_teeth` teeth.

    Examples
    --------
    >>> from cqblend.patterns.outline.pieces import Piece, Place, Run, Seam
    >>> from cqblend.patterns.outline.plane_path import Path
    >>> corners = np.array([[0, 0], [40, 0], [40, 40], [0, 40], [0, 0]])
    >>> edges = [Run(Path.from_points(corners[k : k + 2]), np.full((2, 3), np.nan), "trim") for k in range(4)]
    >>> left = Piece("1", ((*edges[:1], replace(edges[1], seam=0), *edges[2:]),))
    >>> right = Piece("2", ((*edges[:3], replace(edges[3], seam=0)),))
    >>> seam = Seam("1", (Place(0, 0, 1), Place(1, 0, 3)))
    >>> tabs = fit_tabs(Pieces((left, right), (seam,)), TabOptions(width=5))
    >>> tabs.pieces.pieces[0].cuts[0].points.round(9).tolist()
    [[0.0, 0.0], [40.0, 0.0], [45.0, 5.0], [45.0, 35.0], [40.0, 40.0], [0.0, 40.0], [0.0, 0.0]]
    """
    for piece in pieces.pieces:
        if piece.tabs is not None:
            raise InputError(f"piece {piece.name} has tabs already")
    fitter = FlapFitter(pieces, options)
    flaps = lay_out_flaps(fitter)
    if options.style == "strips":
        connected, used = add_connecting_strips(fitter, flaps)
        return _measure_coverage(fitter, used, 1, connected)
    by_piece: dict[int, list[Flap]] = defaultdict(list)
    for flap in flaps:
        by_piece[pieces.seams[flap.seam].sides[flap.side].piece].append(flap)
    cut, used = list(pieces.pieces), []
    beneath_neighbour = options.style in ("one", "alternating")
    for k, own in by_piece.items():
        outlines, scores = merge_flaps(fitter, k, own, beneath_neighbour=beneath_neighbour)
        if not find_winding_errors(outlines):  # else the piece overlaps itself without tabs
            cut[k] = replace(cut[k], tabs=outlines, scores=cut[k].scores + scores)
            used += own
    tabbed_sides = 2 if options.style in ("both", "allowance") else 1
    return _measure_coverage(fitter, used, tabbed_sides, Pieces(tuple(cut), pieces.seams))


def _measure_coverage(fitter: FlapFitter, flaps: Sequence[Flap], tabbed_sides: int, pieces: Pieces) -> Tabs:
    """Return the pieces with the coverage and the least heights of the tabs on them.

    Parameters
    ----------
    fitter
        With the pieces without tabs.
    flaps
        Those that became tabs.
    tabbed_sides
        Number of sides (1 or 2) of a seam that should carry tabs.
    pieces
        With tabs.
    """
    count = len(pieces.seams)
    covered, heights = np.zeros(count), np.full(count, np.inf)
    for flap in flaps:
        length = fitter.path_by_length(pieces.seams[flap.seam].sides[flap.side]).length
        covered[flap.seam] += flap.length / length / tabbed_sides
        heights[flap.seam] = min(heights[flap.seam], flap.height)
    return Tabs(pieces, covered, np.where(covered > 0, heights, 0.0), fitter.options.width)
