"""Runs of a piece's boundary in the plane, before their segments become arcs of given lengths.

A run is one of three kinds of curve: a rail between two strips of a face, a stretch of an edge of the shape, which may
cross the strips at any angle, or a cut along a ruling. Its segments get the lengths of the curves in space that they
stand for, on both sides of a seam the same, and are bent to arcs of these lengths.
"""

from dataclasses import dataclass, replace

import numpy as np

from cqblend.patterns.outline import plane_path
from cqblend.patterns.outline.pieces import RunKind
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.trimming.boundary_run_keys import RunKey
from cqblend.patterns.trimming.tolerances import TRIM_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array


@dataclass(frozen=True, slots=True, eq=False)
class RunDraft:
    """A run of n segments before they are bent to arcs.

    Attributes
    ----------
    key
        Shared with the run on the other side of the seam; None for a pole, which is a point in space.
    kind
        Rail, trimming curve, end of a strip, or cut.
    points
        (n + 1, 2) vertices in the plane, mm.
    inner_points
        (n, ARC_SAMPLES - 1, 2) points of the exact curve in the plane inside each segment, at equal steps of its
        parameter.
    points_3d
        (n + 1, 3) vertices in space.
    parameters
        (n + 1, 2) vertices in the parameters of the strip, (r, w), or of the planar patch.
    lengths
        (n,) lengths that the segments stand for, mm.
    along_key
        Whether the run goes in the direction of increasing parameters of its edge or line.
    bow_inward
        Whether the end of a strip is bent to the inner side.
    exact_curve
        The exact curve in the parameters of a planar patch; None if there is none.
    """

    key: RunKey | None
    kind: RunKind
    points: Array
    inner_points: Array
    points_3d: Array
    parameters: Array
    lengths: Array
    along_key: bool = True
    bow_inward: bool = False
    exact_curve: Curve | None = None

    def reverse_run(self) -> "RunDraft":
        """Return the same run backwards."""
        return replace(
            self,
            points=self.points[::-1],
            inner_points=self.inner_points[::-1, ::-1],
            points_3d=self.points_3d[::-1],
            parameters=self.parameters[::-1],
            lengths=self.lengths[::-1],
            along_key=not self.along_key,
            exact_curve=self.exact_curve and self.exact_curve.reverse(),
        )

    def end_where_begins(self, following: "RunDraft") -> "RunDraft":
        """Return the run with the first vertex of another one as its last vertex."""
        return replace(
            self,
            points=np.concatenate([self.points[:-1], following.points[:1]]),
            points_3d=np.concatenate([self.points_3d[:-1], following.points_3d[:1]]),
            parameters=np.concatenate([self.parameters[:-1], following.parameters[:1]]),
        )

    def drop_inner_vertices(self) -> "RunDraft":
        """Return the run as one segment of the same length."""
        return replace(
            self,
            points=self.points[[0, -1]],
            inner_points=sample_chord(self.points[[0, -1]]),
            points_3d=self.points_3d[[0, -1]],
            parameters=self.parameters[[0, -1]],
            lengths=self.lengths.sum()[None],
        )

    def to_trim_curve(self) -> Array | Curve:
        """Return the run in the parameters of the strip or patch: its exact curve, if that ends at the vertices."""
        if self.exact_curve is not None:
            ends = self.exact_curve(self.exact_curve.breaks[[0, -1]])
            if np.abs(ends - self.parameters[[0, -1]]).max() < TRIM_TOLERANCES.joint_gap:
                return self.exact_curve
        return self.parameters

    @property
    def chord_lengths(self) -> Array:
        """Lengths of the chords (n,), mm."""
        return np.asarray(np.linalg.norm(np.diff(self.points, axis=0), axis=1))

    @property
    def curve_lengths(self) -> Array:
        """Lengths (n,) of the exact curve in the plane, mm, measured along its inner points."""
        starts, stops = self.points[:-1, None], self.points[1:, None]
        steps = np.diff(np.concatenate([starts, self.inner_points, stops], axis=1), axis=1)
        return np.asarray(np.linalg.norm(steps, axis=2).sum(axis=1))

    def to_path(self) -> Path:
        """Return the run with each segment bent to an arc of its length, to the side on which the exact curve is.

        Where that is on the chord, the arc bows outwards. Ends of strips, which are straight in the plane, bow
        outwards too, or all inwards if `bow_inward`.
        """
        is_bent = self.lengths - self.chord_lengths > TRIM_TOLERANCES.straight_excess * self.lengths
        bulges = np.where(is_bent, plane_path.solve_bulges(self.chord_lengths, self.lengths), 0.0)
        if self.kind == "end":
            return Path(self.points, -bulges if self.bow_inward else bulges)
        chord = np.diff(self.points, axis=0)
        to_middle = self.inner_points[:, plane_path.ARC_SAMPLES // 2 - 1] - self.points[:-1]
        height = chord[:, 0] * to_middle[:, 1] - chord[:, 1] * to_middle[:, 0]  # times the chord
        is_inward = height > TRIM_TOLERANCES.inward_offset * (chord**2).sum(axis=1)
        return Path(self.points, np.where(is_inward, -bulges, bulges))

    def measure_arc_error(self) -> Array:
        """Return the distance (n,) of the exact curve in the plane from each segment or arc of the path, mm.

        Zero at ends of strips: their arcs differ from the last ruling by what the edge in space does.
        """
        if self.kind == "end":
            return np.zeros(len(self.inner_points))
        return plane_path.measure_arc_deviations(self.to_path(), self.inner_points)


def sample_chord(ends: Array) -> Array:
    """Return ARC_SAMPLES - 1 points (1, .., 2) of the segment between two ends (2, 2), at equal steps."""
    part = np.arange(1, plane_path.ARC_SAMPLES)[:, None] / plane_path.ARC_SAMPLES
    return np.asarray((ends[0] + part * (ends[1] - ends[0]))[None])


def subdivide_parameters(t: Array) -> Array:
    """Return ARC_SAMPLES - 1 parameters (n, ..) at equal steps between neighbours of parameters (n + 1,)."""
    return np.asarray(
        t[:-1, None] + np.diff(t)[:, None] * np.arange(1, plane_path.ARC_SAMPLES) / plane_path.ARC_SAMPLES
    )
