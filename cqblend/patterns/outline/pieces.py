"""Pieces of flat stock and the seams between them: the result of unrolling, to which tabs, sheets and files are added.

A piece lies in the plane with the outer side of the shape towards the viewer. Its boundary is made of runs; two runs
that are joined share a seam, and have the same length to rounding. Every vertex of a run has its point in space, so
that a piece can be checked, and rolled up. Depends on plane paths only.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.outline.tolerances import OUTLINE_TOLERANCES
from cqblend.splines.bernstein import Array

RunKind = Literal["rail", "end", "trim", "cut"]
"""Along a border of a strip, along its first or last ruling, along a trimming curve, or along a cut made later."""

Fold = Literal["mountain", "valley"]
"""Seen from the outer side: a mountain is convex."""


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A stretch of a piece's boundary, with the material to its left.

    Attributes
    ----------
    path
        In the plane.
    space
        (n + 1, 3): where the vertices of the path are in space.
    kind
        What it runs along, see :data:`RunKind`.
    seam
        Index of its seam among those of the pattern; None where nothing is joined.
    """

    path: Path
    space: Array
    kind: RunKind
    seam: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """A line along which a piece is folded, not cut."""

    path: Path
    fold: Fold


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """One piece of flat stock.

    Attributes
    ----------
    name
        Short and unique, to be engraved: ``"3.2"`` is the second piece of face 3.
    loops
        Closed chains of runs: the outer boundary first, counterclockwise, then holes, clockwise.
    tabs
        Closed outlines that replace the loops when the piece is cut, if it has tabs; else None.
    scores
        Lines to be folded.
    """

    name: str
    loops: tuple[tuple[Run, ...], ...]
    tabs: tuple[Path, ...] | None = None
    scores: tuple[Score, ...] = ()

    @property
    def outlines(self) -> tuple[Path, ...]:
        """The loops as closed paths, without tabs."""
        return tuple(close_loop(loop) for loop in self.loops)

    @property
    def cuts(self) -> tuple[Path, ...]:
        """Closed outlines along which the piece is cut: the loops, or those with tabs."""
        return self.outlines if self.tabs is None else self.tabs

    @property
    def area(self) -> float:
        """Area without tabs, mm^2."""
        return sum(path.area for path in self.outlines)

    def runs(self) -> Iterator[tuple[int, int, Run]]:
        """Yield (index of the loop, index in the loop, run)."""
        for i, loop in enumerate(self.loops):
            for j, run in enumerate(loop):
                yield i, j, run

    def moved(self, turn: float, shift: Array) -> "Piece":
        """Return the piece turned about the origin by an angle (rad), then shifted; its places in space stay."""
        return replace(
            self,
            loops=tuple(tuple(replace(run, path=run.path.moved(turn, shift)) for run in loop) for loop in self.loops),
            tabs=None if self.tabs is None else tuple(path.moved(turn, shift) for path in self.tabs),
            scores=tuple(replace(score, path=score.path.moved(turn, shift)) for score in self.scores),
        )


def close_loop(loop: tuple[Run, ...]) -> Path:
    """Return the closed path of a loop of runs, its last point replaced by the first, which it equals to rounding."""
    path = Path.from_paths([run.path for run in loop])
    points = path.points.copy()
    points[-1] = points[0]
    return Path(points, path.bulges)


@dataclass(frozen=True, slots=True)
class Place:
    """Address of a run: indices of the piece, of the loop in it, and of the run in the loop."""

    piece: int
    loop: int
    run: int


@dataclass(frozen=True, slots=True)
class Seam:
    """Two runs that are joined.

    Attributes
    ----------
    label
        Short and unique, to be engraved on both sides.
    sides
        Addresses of the two runs; they may belong to one piece.
    opposed
        Whether the runs have opposite directions in space, as they do where both pieces show their outer side.
    angle
        Angle (rad) between the outer normals on both sides, in the middle of the seam: positive if the shape is convex
        seen from outside; nan where it is not known.
    """

    label: str
    sides: tuple[Place, Place]
    opposed: bool = True
    angle: float = np.nan

    @property
    def fold(self) -> Fold | None:
        """Fold of a tab across the seam: None if the surface is smooth there; a mountain if the angle is not known."""
        if abs(self.angle) < OUTLINE_TOLERANCES.fold_angle:
            return None
        return "valley" if self.angle < 0 else "mountain"


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """All pieces of a shape, and their seams."""

    pieces: tuple[Piece, ...]
    seams: tuple[Seam, ...]

    def run(self, place: Place) -> Run:
        """Return the run at an address."""
        return self.pieces[place.piece].loops[place.loop][place.run]

    def mismatch(self) -> float:
        """Return the largest difference in length between the two sides of a seam, relative to its length."""
        lengths = np.array([[self.run(side).path.length for side in seam.sides] for seam in self.seams])
        if not len(lengths):
            return 0.0
        return float((np.abs(lengths[:, 0] - lengths[:, 1]) / lengths.max(axis=1)).max())
