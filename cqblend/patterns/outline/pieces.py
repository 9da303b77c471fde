"""Pieces of flat stock and the seams between them: what a shape is unrolled to, before tabs, sheets and files.

A piece lies in the plane with the outer side of the shape towards the viewer. Its boundary is made of runs; a run that
is joined to another one shares a seam with it, and both have the same length to rounding. Every vertex of a run knows
its place in space, so that a piece can be checked, and rolled back. Must not know how pieces come about, nor how they
are drawn.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cqblend.patterns.outline.plane_path import Path
from cqblend.splines.bernstein import Array

RunKind = Literal["rail", "end", "trim", "cut"]
"""Along a border of a strip, along its first or last ruling, along a trimming curve, or along a cut made later."""

Fold = Literal["mountain", "valley"]
"""Seen from the outer side: a mountain is convex."""

SMOOTH_ANGLE = np.radians(1.0)
"""A seam across which the surface turns by less is no fold: what lies flat beneath both pieces stays flat."""


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
        What it runs along.
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
        """What is cut: the loops, or the outlines with tabs."""
        return self.outlines if self.tabs is None else self.tabs

    @property
    def area(self) -> float:
        """Area without tabs, mm^2."""
        return sum(path.area for path in self.outlines)

    def runs(self) -> Iterator[tuple[int, int, Run]]:
        """Yield (loop, place in the loop, run)."""
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
    """Return the closed path of a loop of runs; its end is made its beginning exactly."""
    path = Path.from_paths([run.path for run in loop])
    points = path.points.copy()
    points[-1] = points[0]
    return Path(points, path.bulges)


@dataclass(frozen=True, slots=True)
class Place:
    """Where a run is: piece, loop, place in the loop."""

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
        The two runs; they may belong to one piece.
    opposed
        Whether the runs go against each other in space, as they do where both pieces show their outer side.
    angle
        By how much the surface turns across the seam in the middle of it (rad), positive if it is convex seen from the
        outer side; nan where it is not known.
    """

    label: str
    sides: tuple[Place, Place]
    opposed: bool = True
    angle: float = np.nan

    @property
    def fold(self) -> Fold | None:
        """How what connects both pieces is folded: None across a smooth seam; a mountain where that is not known."""
        if abs(self.angle) < SMOOTH_ANGLE:
            return None
        return "valley" if self.angle < 0 else "mountain"


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """All pieces of a shape, and their seams."""

    pieces: tuple[Piece, ...]
    seams: tuple[Seam, ...]

    def run(self, place: Place) -> Run:
        """Return the run at a place."""
        return self.pieces[place.piece].loops[place.loop][place.run]

    def mismatch(self) -> float:
        """Return the largest difference in length between the two sides of a seam, relative to its length."""
        lengths = np.array([[self.run(side).path.length for side in seam.sides] for seam in self.seams])
        if not len(lengths):
            return 0.0
        return float((np.abs(lengths[:, 0] - lengths[:, 1]) / lengths.max(axis=1)).max())
