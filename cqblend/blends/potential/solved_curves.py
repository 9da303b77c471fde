"""Remembers where intersection curves were solved along an edge, and predicts them at parameters in between."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cqblend.blends.potential.tolerances import POTENTIAL_LIMITS, POTENTIAL_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.splines.local_interpolation import interpolate_locally


@dataclass
class SolvedCurves:
    """Displacements (k, m, 4) of the parameters of m intersection curves from those of the edge, at known t (k,).

    Displacements, unlike parameters, do not jump where the edge crosses a seam. Those of ``closed`` edges are periodic.
    """

    closed: bool
    t: Array = field(default_factory=lambda: np.empty(0))
    displacements: Array = field(default_factory=lambda: np.empty((0, 0, 4)))

    def add_displacements(self, t: Array, displacements: Array) -> None:
        """Remember displacements (n, m, 4) at t (n,), but for those that nearly repeat others."""
        if len(self.t):
            t, displacements = np.concatenate([self.t, t]), np.concatenate([self.displacements, displacements])
        order = np.argsort(t, kind="stable")
        kept = order[np.append(True, np.diff(t[order]) > POTENTIAL_TOLERANCES.least_prediction_gap)]
        self.t, self.displacements = t[kept], displacements[kept]

    def predict_displacements(self, t: Array) -> tuple[Array, Array]:
        """Return displacements (n, m, 4) at t (n,), and which of them (n,) are near enough to known ones to be used."""
        nodes, values, count = self.t, self.displacements, POTENTIAL_LIMITS.prediction_nodes
        if len(nodes) < count:
            return np.zeros((len(t), *values.shape[1:])), np.zeros(len(t), dtype=bool)
        if self.closed:
            nodes = np.concatenate([nodes[-count:] - 1, nodes, nodes[:count] + 1])
            values = np.concatenate([values[-count:], values, values[:count]])
        after = np.clip(np.searchsorted(nodes, t), 1, len(nodes) - 1)
        gap = nodes[after] - nodes[after - 1]
        beyond = np.maximum(nodes[after - 1] - t, t - nodes[after])
        near = (gap <= POTENTIAL_TOLERANCES.prediction_gap) & (beyond <= POTENTIAL_TOLERANCES.extrapolation * gap)
        return interpolate_locally(nodes, values, t, count), near
