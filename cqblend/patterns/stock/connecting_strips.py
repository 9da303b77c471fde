"""Connecting strips: separate pieces glued underneath both sides of a seam, without the step that a tab leaves.

A strip follows the seam where both of its sides have the same curve in the plane; else it is straight, and short.
Depends on flaps.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from cqblend.patterns.outline.overlap import find_winding_errors
from cqblend.patterns.outline.path_by_length import PathByLength
from cqblend.patterns.outline.pieces import Fold, Piece, Pieces, Run, Score, Seam
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.flaps import Flap, FlapFitter, make_flap_top
from cqblend.patterns.stock.stock_proportions import TAB_LIMITS


def has_same_curve(fitter: FlapFitter, seam: Seam) -> bool:
    """Return whether both sides of a seam have the same curve in the plane, so that one strip can follow both.

    The two are compared at 65 stations, as complex numbers about their means, after the best turn in the least-squares
    sense.
    """
    if not seam.opposed:
        return False
    first, second = (fitter.path_by_length(side) for side in seam.sides)
    part = np.linspace(0.0, 1.0, 65)
    one = first.points_at(part * first.length) @ [1, 1j]
    other = second.points_at((1 - part) * second.length) @ [1, 1j]
    one, other = one - one.mean(), other - other.mean()
    turn = np.vdot(other, one)
    largest_distance = np.abs(one - other * turn / max(abs(turn), 1e-300)).max()
    return bool(largest_distance < TAB_LIMITS.same_curve * fitter.options.width)


def add_connecting_strips(fitter: FlapFitter, flaps: Sequence[Flap]) -> tuple[Pieces, list[Flap]]:
    """Return the pieces, followed by strips named after their seams, and the flaps that became strips.

    A strip that would overlap itself, as where the seam is a hairpin, is left out.
    """
    pieces, used = list(fitter.pieces.pieces), []
    names = {piece.name for piece in pieces}
    by_seam: dict[int, list[Flap]] = defaultdict(list)
    for flap in flaps:
        by_seam[flap.seam].append(flap)
    for number, parts in by_seam.items():
        seam = fitter.pieces.seams[number]
        side = fitter.path_by_length(seam.sides[0])
        same_curve = has_same_curve(fitter, seam)
        for k, flap in enumerate(parts):
            name = f"S{seam.label}" + (f".{k + 1}" if len(parts) > 1 else "")
            while name in names:
                name += "+"
            straight = Path.from_points(np.array([[0.0, 0.0], [flap.length, 0.0]]))
            line = side.clip_between(flap.start, flap.stop) if same_curve else straight
            strip = _make_connecting_strip(name, PathByLength(line), flap, seam.fold)
            if not find_winding_errors(strip.outlines):
                names.add(name)
                pieces.append(strip)
                used.append(flap)
    return Pieces(tuple(pieces), fitter.pieces.seams), used


def _make_connecting_strip(name: str, line: PathByLength, flap: Flap, fold: Fold | None) -> Piece:
    """Return a strip along a line, as wide on both sides of it; its points in space are not known (nan)."""
    right, left = (make_flap_top(line, 0.0, line.length, flap.cotangents, sign * flap.height) for sign in (1.0, -1.0))
    start, stop = line.path.points[0], line.path.points[-1]
    outline = Path.from_paths(
        [
            Path.from_points(np.stack([start, right.points[0]])),
            right,
            Path.from_points(np.stack([right.points[-1], stop, left.points[-1]])),
            left.reversed(),
            Path.from_points(np.stack([left.points[0], start])),
        ]
    )
    run = Run(outline, np.full((len(outline.points), 3), np.nan), "cut")
    return Piece(name, ((run,),), scores=() if fold is None else (Score(line.path, fold),))
