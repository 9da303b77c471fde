"""A damped Newton method that solves one small system of equations for every station at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.splines.bernstein import Array


def solve_damped_newton(
    system: Callable[[Array], tuple[Array, Array, Array]],
    start: Array,
    scale: float | Array,
    longest_step: float | Array,
) -> tuple[Array, Array]:
    """Solve F(x) = 0 for all stations at once.

    ``system`` returns F (n, m), its Jacobian (n, m, m) and the length (n, m) of a unit step of each unknown in space.
    Steps are at most ``longest_step`` long in space; residuals are measured relative to ``scale``: both are numbers, or
    one for each station (n,). Returns x and a mask of the stations that converged to rounding.
    """
    x = start.copy()
    best, settled = np.full(len(x), np.inf), np.zeros(len(x), dtype=bool)
    for _ in range(CONTACT_TOLERANCES.newton_steps):
        residual, jacobian, metric = system(x)
        size = np.abs(residual).max(1) / scale
        stalled = (size < CONTACT_TOLERANCES.stalled_residual) & (size >= best / 2)  # only rounding moves it from here
        settled |= (size < CONTACT_TOLERANCES.exact_residual) | stalled
        lost = ~(np.isfinite(residual).all(axis=1) & np.isfinite(jacobian).all(axis=(1, 2)))
        settled |= lost  # they stay where they are and do not disturb the others
        if settled.all():
            break
        best = np.minimum(best, size)
        jacobian[lost], residual[lost] = np.eye(x.shape[1]), 0.0
        try:
            step = np.linalg.solve(jacobian, -residual[..., None])[..., 0]
        except np.linalg.LinAlgError:
            step = np.stack([np.linalg.lstsq(j, -r)[0] for j, r in zip(jacobian, residual, strict=True)])
        length = (np.abs(step) * metric).max(1)
        damping = np.minimum(1.0, longest_step / np.maximum(length, 1e-300))
        following = x + step * damping[:, None]
        x = np.where(np.isfinite(following).all(axis=1, keepdims=True), following, x)
    converged = np.abs(system(x)[0]).max(1) < CONTACT_TOLERANCES.converged_residual * scale
    return x, converged
