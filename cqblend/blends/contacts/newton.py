"""A damped Newton method that solves one small system of equations for every station at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.splines.bernstein import Array


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of iterations that go astray
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
    best, size = np.full(len(x), np.inf), np.full(len(x), np.inf)
    settled = np.zeros(len(x), dtype=bool)
    for _ in range(CONTACT_TOLERANCES.newton_steps):
        residual, jacobian, metric = system(x)
        size = np.abs(residual).max(axis=1) / scale
        stalled = (size < CONTACT_TOLERANCES.stalled_residual) & (size >= best / 2)  # only rounding moves it from here
        settled |= (size < CONTACT_TOLERANCES.exact_residual) | stalled
        if not np.isfinite(residual.sum() + jacobian.sum()):
            lost = ~(np.isfinite(residual).all(axis=1) & np.isfinite(jacobian).all(axis=(1, 2)))
            settled |= lost  # they stay where they are and do not disturb the others
            jacobian[lost], residual[lost] = np.eye(x.shape[1]), 0.0
        if settled.all():
            return x, size < CONTACT_TOLERANCES.converged_residual
        best = np.minimum(best, size)
        try:
            step = np.linalg.solve(jacobian, -residual[..., None])[..., 0]
        except np.linalg.LinAlgError:
            step = np.stack([np.linalg.lstsq(j, -r)[0] for j, r in zip(jacobian, residual, strict=True)])
        length = (np.abs(step) * metric).max(axis=1) / longest_step
        damped = length > 1
        if damped.any():
            step[damped] /= length[damped, None]
        following = x + step
        if not np.isfinite(following.sum()):
            following = np.where(np.isfinite(following).all(axis=1, keepdims=True), following, x)
        x = following
        # the next step would be about the square of this one
        solved = (length < CONTACT_TOLERANCES.quadratic_step) & (size < CONTACT_TOLERANCES.quadratic_residual)
        if (settled | solved).all():
            return x, solved | (size < CONTACT_TOLERANCES.converged_residual)
    return x, np.abs(system(x)[0]).max(axis=1) < CONTACT_TOLERANCES.kinked_residual * scale
