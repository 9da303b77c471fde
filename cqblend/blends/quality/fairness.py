r"""How fair a blend is: the energy that it takes to bend a plate into its shape.

.. math:: E = \int (\kappa_1^2 + \kappa_2^2)\, dA,

with the principal curvatures: the strain energy of a thin plate of that shape, up to a factor of its material and
thickness. It does not depend on the size nor on parameters; a cylinder of radius r, length L and an opening of one
radian has L / r, a quarter of a sphere 2 pi. Depends on spline surfaces only.
"""

from __future__ import annotations

import numpy as np

from cqblend.blends.quality.tolerances import FAIRNESS_SAMPLING
from cqblend.splines import Surface
from cqblend.splines.antiderivative import gauss_rule
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product


def bending_energy(surface: Surface, outline: Array | None = None) -> float:
    r"""Return the bending energy of a surface H(t, v), of dimension one.

    Parameters
    ----------
    surface
        H.
    outline
        Ends (n, 2, 2) of the straight pieces in the parameter plane that bound the region of the integral; None for
        the whole domain.
    """
    t0, t1 = surface.domain[0]
    nodes, weights = gauss_rule(FAIRNESS_SAMPLING.points_across)
    breaks_t, breaks_v = surface.breaks
    v = (breaks_v[:-1, None] + np.diff(breaks_v)[:, None] * nodes).ravel()
    weights_v = (np.diff(breaks_v)[:, None] * weights).ravel()
    intervals = [[(t0, t1)]] * len(v) if outline is None else [_clip_line(outline, at) for at in v]
    count = FAIRNESS_SAMPLING.cells
    cells = np.union1d(np.linspace(t0, t1, count + 1), breaks_t if len(breaks_t) < 4 * count else [])
    nodes, weights = gauss_rule(FAIRNESS_SAMPLING.points_along)
    total = 0.0
    for at, factor, intervals_at in zip(v.tolist(), weights_v.tolist(), intervals, strict=True):
        for low, high in intervals_at:
            edges = np.concatenate([[low], cells[(cells > low) & (cells < high)], [high]])
            steps = np.diff(edges)[:, None]
            t = (edges[:-1, None] + steps * nodes).ravel()
            total += factor * float(_evaluate_density(surface, t, at) @ (steps * weights).ravel())
    return total


def _clip_line(outline: Array, v: float) -> list[tuple[float, float]]:
    """Return the intervals of t in which the line of a constant v is inside an outline."""
    (a, p), (b, q) = outline[:, 0].T, outline[:, 1].T
    crosses = (p <= v) != (q <= v)
    a, p, b, q = (x[crosses] for x in (a, p, b, q))
    at = np.sort(a + (b - a) * (v - p) / (q - p))
    return list(zip(at[::2].tolist(), at[1::2].tolist(), strict=False))


def _evaluate_density(surface: Surface, t: Array, v: float) -> Array:
    """Return the sum of the squared principal curvatures times the area element, (n,)."""
    jet = surface.jet(t, v, 2)
    normal = cross_product(jet[1, 0], jet[0, 1])
    area = np.linalg.norm(normal, axis=1)
    first = [(jet[a] * jet[b]).sum(axis=1) for a, b in (((1, 0), (1, 0)), ((1, 0), (0, 1)), ((0, 1), (0, 1)))]
    with np.errstate(divide="ignore", invalid="ignore"):
        second = [(jet[k] * normal).sum(axis=1) / area for k in ((2, 0), (1, 1), (0, 2))]
        (e, f, g), (x, y, z) = first, second
        gauss_curvature = (x * z - y**2) / area**2
        twice_mean = (e * z - 2 * f * y + g * x) / area**2
        density = (twice_mean**2 - 2 * gauss_curvature) * area
    return np.where(area > 0, density, 0.0)
