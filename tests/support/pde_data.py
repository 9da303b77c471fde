"""Boundary data of PDE blends whose solutions have closed forms, and the blends between them.

Nothing of cqblend but its public interface is used: closed forms, differences and OCCT's derivatives are those of
``pde_witness``.
"""

from functools import cache

import numpy as np
from pde_witness import Waves, contact, hyperboloid_with_torus, occt_jets, symbol

import cqblend

SYMBOLS = {
    "2, Laplace": symbol(((1,), 1)),
    "2, root 2": symbol(((4,), 1)),
    "2, negative": symbol(((0.25,), 1), leading=-3),
    "4, distinct": symbol(((1,), 1), ((4,), 1)),
    "4, double": symbol(((1,), 2)),
    "4, complex": symbol(((1, 1), 1)),
    "4, beam": symbol(((0, 1), 1)),
    "4, b = -0.5": symbol(((-0.5, 1), 1)),
    "4, b = -1.5": symbol(((-1.5, 1), 1), leading=2),
    "6, distinct": symbol(((0.25,), 1), ((1,), 1), ((4,), 1)),
    "6, double": symbol(((1,), 2), ((4,), 1)),
    "6, triple": symbol(((1,), 3)),
    "6, complex": symbol(((1,), 1), ((1, 1), 1)),
    "6, negative": symbol(((0.5,), 1), ((-1, 1), 1)),
}
LAPLACE = {2: SYMBOLS["2, Laplace"], 4: SYMBOLS["4, double"], 6: SYMBOLS["6, triple"]}
MIXED = {
    (2, 2, 4): ("2, Laplace", "2, root 2", "4, complex"),
    (2, 2, 6): ("2, negative", "2, Laplace", "6, double"),
    (4, 4, 6): ("4, b = -0.5", "4, double", "6, triple"),
    (2, 4, 6): ("2, root 2", "4, distinct", "6, complex"),
    (6, 4, 2): ("6, negative", "4, beam", "2, Laplace"),
}
ORDERS = [2, 4, 6, (2, 4, 6)]
T = np.linspace(0.1, 6.2, 11)
V = np.array([0, 0.004, 0.03, 0.2, 0.45, 0.5, 0.71, 0.93, 0.99, 1])
INSIDE = np.linspace(0, 1, 21)


def boundary(waves, side, half=3, domain=None):
    """Return the data of side 0 or 1 with so many derivatives."""
    return cqblend.Boundary(*(lambda t, k=k: waves.data(side, k, t) for k in range(half)), domain=domain)


def blend_of(waves, equations, domain=None, **options):
    """Blend the data by equations, each with its parameters."""
    half = max(one.half for one in equations)
    return cqblend.pde_blend(
        boundary(waves, 0, half, domain),
        boundary(waves, 1, half, domain),
        order=tuple(one.order for one in equations),
        parameters=[one.parameters for one in equations],
        **options,
    )


def laplacians(order):
    """Return the powers of Laplace's operator for x, y and z."""
    return [LAPLACE[n] for n in np.broadcast_to(order, 3).tolist()]


def error(blend, waves, equations, t=T, v=V):
    """Return the largest distance of the solution from the closed form."""
    return np.linalg.norm(blend.solution(t[:, None], v) - waves.solution(equations, t, v), axis=-1).max()


@cache
def wavy(apart=4.0):
    """Return data of a few waves, different on both sides, with a circle among them, so that they span a surface."""
    waves = Waves.random(3, (0, 1, 2, 3), apart=apart, sizes=(0.5, 0.3, 0.1, 0.1))
    coefs = waves.coefs.copy()
    coefs[:, 0, 0, 1, 0] += 3
    coefs[:, 0, 1, 1, 1] += 2
    coefs[:, 1, 2, 0, 0] += apart
    return Waves(waves.frequencies, coefs)


DATA = {"waves": wavy, "hyperboloid with torus": hyperboloid_with_torus}


OPEN = (0.0, 1.0)
ALONG = np.linspace(0, 1, 9)


@cache
def open_waves():
    """Return data whose solutions separate, but not into waves that are periodic on the domain."""
    waves = Waves.random(8, (0, 1.3, 2.7, 3.4), apart=2, sizes=(0.5, 0.7, 0.3, 0.2))
    coefs = waves.coefs.copy()
    coefs[:, 0, 0, 1] += np.array([[0.0, 3.0]])  # something that goes on
    return Waves(waves.frequencies, coefs)


def ends_of(waves, equations, orders=None):
    """Return the closed form's own sections at both ends, with its derivatives along."""
    half = max(one.half for one in equations) if orders is None else orders
    return tuple(
        cqblend.Boundary(*(lambda v, k=k, w=w: waves.section(equations, w, v, k) for k in range(half)), domain=OPEN)
        for w in OPEN
    )


def measured(blend, waves, side, t):
    """Return gap, angle and jump of the normal curvature of the face against what the data say."""
    c, ct, ctt = (waves.data(side, 0, t, k) for k in range(3))
    d, dt = (waves.data(side, 1, t, k) for k in range(2))
    wanted = np.stack([c, ct, d, ctt, waves.data(side, 2, t), dt])
    return contact(occt_jets(blend.face(), t, np.full_like(t, float(side))), wanted)
