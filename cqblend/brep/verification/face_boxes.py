"""Bounding boxes of many faces at once, and of the pieces of one."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.TopoDS import TopoDS_Face

from cqblend.brep.topology import CONFUSION
from cqblend.splines.bernstein import Array


class FaceBoxes:
    """Boxes around faces, in the order of the faces: 6 microseconds each.

    Attributes
    ----------
    low, high : ndarray, shape (n, 3)
        Their corners.
    """

    def __init__(self, faces: Iterable[TopoDS_Face]) -> None:
        corners = []
        for face in faces:
            box = Bnd_Box()
            BRepBndLib.Add_s(face, box, False)
            corners.append(box.Get() if not box.IsVoid() else (0.0,) * 6)
        table = np.array(corners).reshape(-1, 6)
        self.low, self.high = table[:, :3] - 2 * CONFUSION, table[:, 3:] + 2 * CONFUSION

    def find_overlaps(self, chosen: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Tell which boxes (n) overlap each of some chosen by index (m): (m, n)."""
        below = (self.low[chosen, None] <= self.high[None]).all(axis=-1)
        return np.asarray(below & (self.high[chosen, None] >= self.low[None]).all(axis=-1))

    def find_hits(self, point: Array, directions: Array) -> NDArray[np.bool_]:
        """Tell which boxes (n) each of some rays (m, 3) from a point meets: (m, n)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack((self.low - point, self.high - point)) / directions[:, None, None]
        enter, leave = np.nanmin(ends, axis=1).max(axis=-1), np.nanmax(ends, axis=1).min(axis=-1)
        return np.asarray((enter <= leave) & (leave >= 0.0))
