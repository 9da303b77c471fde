"""Two ribbons whose rails cross many knot lines: what proofs and compact forms are measured on."""

import numpy as np

from cqblend.blends.rails.ribbon import Ribbon
from cqblend.splines import Curve, Surface
from cqblend.surfaces.tensor_surface import TensorSurface


def wavy_pair() -> tuple[Ribbon, Ribbon]:
    """Two wavy bicubics one above the other, with cubic rails that cross many knot lines."""
    knots = np.concatenate([np.zeros(3), np.linspace(0, 1, 11), np.ones(3)])
    greville = np.array([knots[i + 1 : i + 4].mean() for i in range(13)])
    i, j = np.meshgrid(np.arange(13), np.arange(13), indexing="ij")
    poles = [
        greville[i] + 0.02 * np.sin(1.1 * j),
        greville[j] + 0.02 * np.cos(1.7 * i),
        0.25 * np.sin(0.7 * i) * np.cos(0.9 * j),
    ]
    below = Surface.from_bspline((3, 3), (knots, knots), np.stack(poles, -1))
    plan = np.array([[0.05, 0.10], [0.40, 0.95], [0.65, 0.05], [0.95, 0.90]])

    def side(surface, plan, sign):
        def lifted(x, one):
            u, v = x.coefs[:, 0], x.coefs[:, 1]
            return Curve(x.breaks, np.stack([one - u, u, one - v, v], 1), continuity=x.continuity)

        c = Curve.bezier(plan)
        rate = c.derivative()
        d = Curve.stack([rate[1], rate[0] * -1.0]) * (0.3 * sign)
        return Ribbon(TensorSurface.from_spline(surface), lifted(c, 1.0), (lifted(d, 0.0),), c(c.breaks))

    above = below + np.array([0.3, 0.2, 1.0])
    return side(below, plan, 1), side(above, plan * [1, -1] + [0, 1], -1)
