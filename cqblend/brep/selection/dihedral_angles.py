"""At what angles the two faces at an edge meet: whether it is smooth, or sharp, and which way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Edge

from cqblend.brep.measurement.edge_samples import SideSampler, read_edge_curve
from cqblend.brep.measurement.edge_sides import EdgeSide
from cqblend.brep.measurement.surface_evaluation import (
    compute_cross_products,
    compute_dot_products,
    measure_lengths,
)
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.splines.bernstein import Array


@dataclass(frozen=True, eq=False)
class DihedralAngles:
    """Angles (n,), rad, between the outward normals of the faces at an edge, above 0 where it is convex.

    They are those at samples from one end of the edge to the other, in the sense of its curve; those without a normal
    on both sides are left out, and at least one is left. ``ends`` are the angles at both ends themselves.
    """

    inner: Array
    ends: tuple[float, float]

    @property
    def is_smooth(self) -> bool:
        """Whether the faces meet smoothly all along the edge."""
        return bool(max(np.abs(self.inner).max(), *np.abs(self.ends)) < SELECT_TOLERANCES.smooth_angle)

    @property
    def middle(self) -> Array:
        """The inner angles but for those near an end at which the faces become tangent that are as small as there."""
        is_smooth = np.abs(self.inner) < SELECT_TOLERANCES.smooth_angle
        if is_smooth.all():
            return self.inner
        start, stop = is_smooth.argmin(), len(self.inner) - is_smooth[::-1].argmin()
        fades = np.abs(self.ends) < SELECT_TOLERANCES.smooth_angle
        return self.inner[start if fades[0] else None : stop if fades[1] else None]

    @property
    def is_sharp(self) -> bool:
        """Whether the edge is convex, or concave, all along, and no knife edge; at its ends it may fade."""
        least, most = SELECT_TOLERANCES.smooth_angle, np.pi - SELECT_TOLERANCES.smooth_angle
        angles, size = self.middle, np.abs(self.middle)
        return bool(size.min() >= least and size.max() <= most and (angles > 0).all() == (angles > 0).any())

    @property
    def is_convex(self) -> bool:
        """Whether the edge is convex where that is clearest."""
        return bool(self.inner[np.abs(self.inner).argmax()] > 0)

    def find_end_angle(self, use: TopoDS_Edge, end: int) -> float:
        """Return the angle at the start (``end`` 0) or stop (1) of the edge, as it is used."""
        return self.ends[1 - end if use.Orientation() == TopAbs_REVERSED else end]


def measure_dihedral_angles(sides: tuple[EdgeSide, EdgeSide]) -> DihedralAngles | None:
    """Measure the angles between the two faces at an edge; None if there are no normals anywhere on it."""
    edge = sides[0][1]
    low, high = BRep_Tool.Range_s(edge)
    margin = SELECT_TOLERANCES.dihedral_margin
    shares = np.concatenate([[0.0], np.linspace(margin, 1 - margin, SELECT_TOLERANCES.dihedral_samples), [1.0]])
    ts = low + shares * (high - low)
    first, second = (SideSampler(side).sample(ts, 1).normals for side in sides)
    tangents = read_edge_curve(edge)(ts, 1)[1]
    cross = compute_cross_products(first, second)
    sign = np.sign(compute_dot_products(cross, tangents)) * (-1.0 if edge.Orientation() == TopAbs_REVERSED else 1.0)
    angles = np.arctan2(measure_lengths(cross), compute_dot_products(first, second)) * np.where(sign < 0, -1.0, 1.0)
    inner = angles[1:-1][np.isfinite(angles[1:-1])]
    if not len(inner):
        return None
    start, stop = np.where(np.isfinite(angles[[0, -1]]), angles[[0, -1]], inner[[0, -1]]).tolist()
    return DihedralAngles(inner, (start, stop))
