"""Outlines of pieces with their tabs: flaps that fit are joined to the loops of a piece, and their bases become scores.

Depends on flaps.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from cqblend.patterns.outline.path_by_length import PathByLength
from cqblend.patterns.outline.pieces import Place, Score
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.outline.tolerances import OUTLINE_TOLERANCES
from cqblend.patterns.stock.flaps import Flap, FlapFitter, make_flap_top


def merge_flaps(
    fitter: FlapFitter, piece: int, flaps: Sequence[Flap], *, beneath_neighbour: bool
) -> tuple[tuple[Path, ...], tuple[Score, ...]]:
    """Return the closed outlines of a piece with its flaps, and the scores along their bases.

    Parameters
    ----------
    fitter
        To which the flaps were fitted.
    piece
        Index of the piece.
    flaps
        All flaps of the piece.
    beneath_neighbour
        Whether they lie under the neighbour, and so are folded as the surface is; else to the inner side.
    """
    seams = fitter.pieces.seams
    by_run: dict[Place, list[Flap]] = defaultdict(list)
    for flap in flaps:
        by_run[seams[flap.seam].sides[flap.side]].append(flap)
    outlines, scores = [], []
    for i, loop in enumerate(fitter.pieces.pieces[piece].loops):
        parts: list[Path] = []
        for j, run in enumerate(loop):
            own = by_run.get(Place(piece, i, j))
            if own is None:
                parts.append(run.path)
                continue
            path = fitter.path_by_length(Place(piece, i, j))
            outlined, bases = _merge_run_flaps(path, own)
            parts += outlined
            fold = seams[own[0].seam].fold if beneath_neighbour else "mountain"
            if fold is not None:
                scores += [Score(base, fold) for base in bases]
        outline = Path.from_paths(parts)
        points = outline.points.copy()
        points[-1] = points[0]
        outlines.append(_remove_spikes(Path(points, outline.bulges)))
    return tuple(outlines), tuple(scores)


def _merge_run_flaps(path: PathByLength, flaps: Sequence[Flap]) -> tuple[list[Path], list[Path]]:
    """Return the outline along a run around its flaps, in parts, and the bases; those that touch are one base."""
    parts: list[Path] = []
    bases: list[list[float]] = []
    near = OUTLINE_TOLERANCES.rounding_of_stations
    done = 0.0
    for flap in sorted(flaps, key=lambda flap: flap.start):
        if flap.start > done + near * path.length:
            parts.append(path.clip_between(done, flap.start))
        if bases and flap.start <= done + near * path.length:
            bases[-1][1] = flap.stop
        else:
            bases.append([flap.start, flap.stop])
        parts += _outline_flap(path, flap)
        done = flap.stop
    if done < path.length * (1 - near):
        parts.append(path.clip_between(done, path.length))
    return parts, [path.clip_between(start, stop) for start, stop in bases]


def _outline_flap(path: PathByLength, flap: Flap) -> list[Path]:
    """Return both legs and the top of a flap, from the beginning of its base to the end."""
    top = make_flap_top(path, flap.start, flap.stop, flap.cotangents, flap.height)
    base = path.clip_between(flap.start, flap.stop).points
    return [
        Path.from_points(np.stack([base[0], top.points[0]])),
        top,
        Path.from_points(np.stack([top.points[-1], base[-1]])),
    ]


def _remove_spikes(path: Path) -> Path:
    """Return a closed path without spikes: straight segments that run back on each other, as legs on one mitre do."""
    points, bulges = list(path.points[:-1]), list(path.bulges)
    size = float(np.ptp(path.points, axis=0).max())
    k = 0
    while k < len(points) and len(points) > 3:
        before, here, after = points[k - 1], points[k], points[(k + 1) % len(points)]
        into, out = here - before, after - here
        straight = bulges[k - 1] == 0 and bulges[k] == 0
        lengths = float(np.linalg.norm(into)), float(np.linalg.norm(out))
        if straight and into @ out < -(1 - 1e-12) * lengths[0] * lengths[1] and min(lengths) > 0:
            if abs(lengths[0] - lengths[1]) <= 1e-9 * size:  # equally long: nothing is left of both segments
                del points[k], bulges[k]
                gone = k % len(points)
                del points[gone - 1 if gone else -1], bulges[gone - 1 if gone else -1]
            else:
                del points[k], bulges[k]
            k = max(k - 2, 0)
        else:
            k += 1
    return Path(np.array([*points, points[0]]), np.array(bulges))
