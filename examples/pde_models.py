"""The two blending problems of You and Zhang's paper, with constants of our own (the paper does not give its), in mm.

Each is a pair of primary surfaces, as exact NURBS, and its boundary data: position, first and second derivative by the
parameter u of the primaries, as eq. 13 and 14 have them.
"""

import math
from typing import NamedTuple

import numpy as np

import cqblend

ORDERS = {"2": 2, "2+4": (2, 2, 4), "2+6": (2, 2, 6), "4": 4, "4+6": (4, 4, 6), "6": 6}
X, Y, Z = np.eye(3)


class Model(NamedTuple):
    """Two primaries, and what a blend takes from them."""

    primaries: tuple[cqblend.Surface, cqblend.Surface]
    sides: tuple[cqblend.Boundary, cqblend.Boundary]


def around(centres, first, second, weights=(1, 1)) -> cqblend.Surface:
    """Return the NURBS of ellipses, centre + cos v first + sin v second, along one span of a profile of poles."""
    centres, first, second = (np.array(poles, dtype=float)[:, None] for poles in (centres, first, second))
    cos, sin = np.array([(1, 1, 0, -1, -1, -1, 0, 1, 1), (0, 1, 1, 1, 0, -1, -1, -1, 0)])[..., None]
    degree = len(centres) - 1
    knots = np.repeat([0, 1], degree + 1), np.repeat(np.arange(5) * math.pi / 2, [3, 2, 2, 2, 3])
    corners = np.array([1, math.sqrt(0.5)] * 4 + [1])
    return cqblend.Surface.from_bspline(
        (degree, 2), knots, centres + cos * first + sin * second, np.outer(weights, corners)
    )


def cone_with_cylinder() -> Model:
    """Join the frustum of an irregular cone, below, and an elliptic cylinder, above (eq. 13, with y = R_y u0 sin v)."""
    r, r_y, h, k = 9.0, 6.5, -13.0, -0.8  # the cone u (r cos v, r_y sin v, h), up to u0 = 1; k scales its rulings
    a, b, alpha, x0, rise, speed = 3.4, 4.4, math.radians(25), 2.5, 1.0, 11.0
    axis, across = math.sin(alpha) * X + math.cos(alpha) * Z, math.cos(alpha) * X - math.sin(alpha) * Z
    foot, still = x0 * X + rise * axis, (0.0, 0.0, 0.0)
    cone = cqblend.Boundary(
        (lambda v: r * np.cos(v), lambda v: r_y * np.sin(v), h),
        (lambda v: k * r * np.cos(v), lambda v: k * r_y * np.sin(v), k * h),
        still,
    )
    cylinder = cqblend.Boundary(
        lambda v: foot + a * np.cos(v)[:, None] * across + b * np.sin(v)[:, None] * Y, tuple(speed * axis), still
    )
    lower = around([1.4 * h * Z, h * Z], [1.4 * r * X, r * X], [1.4 * r_y * Y, r_y * Y])
    upper = around([foot, foot + 7 * axis], [a * across] * 2, [b * Y] * 2)
    return Model((lower, upper), (cone, cylinder))


def hyperboloid_with_torus() -> Model:
    """Join a one-sheeted elliptic hyperboloid, below, and a circular torus, above (eq. 14)."""
    a, b, h, h0, u0 = 7.0, 6.4, 6.0, -11.0, 0.45  # the hyperboloid (a cosh u cos v, b cosh u sin v, h0 + h sinh u)
    ring, tube, u1 = 8.5, 2.6, -0.45  # the torus ((ring + tube cos u) cos v, .. sin v, tube sin u)
    cosh, sinh, c, s = math.cosh(u0), math.sinh(u0), math.cos(u1), math.sin(u1)

    def ellipse(x: float, y: float):
        return lambda v: x * np.cos(v), lambda v: y * np.sin(v)

    hyperboloid = cqblend.Boundary(
        (*ellipse(a * cosh, b * cosh), h0 + h * sinh),
        (*ellipse(a * sinh, b * sinh), h * cosh),
        (*ellipse(a * cosh, b * cosh), h * sinh),
    )
    torus = cqblend.Boundary(
        (*ellipse(ring + tube * c, ring + tube * c), tube * s),
        (*ellipse(-tube * s, -tube * s), tube * c),
        (*ellipse(-tube * c, -tube * c), -tube * s),
    )
    # arcs of a hyperbola and of a circle: the pole in the middle is where their tangents meet, its weight the (hyper-
    # bolic) cosine of half their length
    low, half = -1.3, (u0 + 1.3) / 2
    middle, flat = (low + u0) / 2, math.cosh(half)
    x = np.array([math.cosh(low), math.cosh(middle) / flat, cosh])[:, None]
    z = h0 + h * np.array([math.sinh(low), math.sinh(middle) / flat, sinh])[:, None]
    lower = around(z * Z, a * x * X, b * x * Y, [1, flat, 1])
    top, half = 1.5, (1.5 - u1) / 2
    middle, bent = (top + u1) / 2, math.cos(half)
    r = ring + tube * np.array([c, math.cos(middle) / bent, math.cos(top)])[:, None]
    z = tube * np.array([s, math.sin(middle) / bent, math.sin(top)])[:, None]
    upper = around(z * Z, r * X, r * Y, [1, bent, 1])
    return Model((lower, upper), (hyperboloid, torus))


def table(blends: dict[str, cqblend.PdeBlend]) -> str:
    """Return what was measured on both rails of blends by their orders, as a table in Markdown."""
    lines = ["| order | side | gap, mm | angle, rad | curvature jump, 1/mm | fairness |", "|---|---|---|---|---|---|"]
    for order, blend in blends.items():
        for rail in blend.certificate.rails:
            energy = f"{blend.certificate.fairness:.2f}" if rail.side == 1 else ""
            lines.append(
                f"| {order if rail.side == 1 else ''} | {rail.side} | {rail.gap:.0e} | {rail.angle:.2g} "
                f"| {rail.curvature_jump:.2g} | {energy} |"
            )
    return "\n".join(lines)
