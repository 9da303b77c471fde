"""Keys of runs: the runs on both sides of a seam have the same key, so that neighbours find each other.

Depends on nothing: a key is made of numbers only.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class EdgeRunKey:
    """A stretch of an edge of the shape.

    Attributes
    ----------
    edge
        Number of the edge.
    first, last
        Indices of its ends among the vertices along the edge; first < last.
    """

    edge: int
    first: int
    last: int


@dataclass(frozen=True, slots=True)
class LineRunKey:
    """A stretch of a parameter line that a face is cut along: of a rail between two strips, or of a ruling.

    Attributes
    ----------
    face
        Number of the patch.
    axis
        The parameter that is constant on the line: 0 for u, 1 for v.
    line_index
        Index of the line among those of its axis.
    start, stop
        The other parameter at both ends; start < stop.
    """

    face: int
    axis: int
    line_index: int
    start: float
    stop: float


RunKey = EdgeRunKey | LineRunKey
