"""Independent truth for the spline tests: textbook recursions in exact fractions, and Hypothesis strategies."""

from fractions import Fraction
from math import comb

import numpy as np
from hypothesis import strategies as st

from cqblend.splines import Curve, Surface

exact = np.vectorize(Fraction, otypes=[object])


def cox_de_boor(i, p, knots, t):
    """N_{i,p}(t) by the definition, right-continuous except at the end of the domain."""
    if p == 0:
        last = knots[i + 1] == knots[-1] and t == knots[-1] and knots[i] < knots[i + 1]
        return Fraction(int(knots[i] <= t < knots[i + 1] or last))
    total = Fraction(0)
    if knots[i + p] != knots[i]:
        total += (t - knots[i]) / (knots[i + p] - knots[i]) * cox_de_boor(i, p - 1, knots, t)
    if knots[i + p + 1] != knots[i + 1]:
        total += (knots[i + p + 1] - t) / (knots[i + p + 1] - knots[i + 1]) * cox_de_boor(i + 1, p - 1, knots, t)
    return total


def de_boor(p, knots, poles, t):
    """Value of a B-spline at t in exact arithmetic; poles (n, ..) of Fractions."""
    n = len(poles)
    span = max(i for i in range(p, n) if knots[i] <= t and knots[i] < knots[i + 1])
    d = [poles[span - p + i] for i in range(p + 1)]
    for r in range(1, p + 1):
        for j in range(p, r - 1, -1):
            lo, hi = knots[span - p + j], knots[span + 1 + j - r]
            x = (t - lo) / (hi - lo)
            d[j] = (1 - x) * d[j - 1] + x * d[j]
    return d[p]


def bernstein_value(coefs, t):
    """Value at t of Bernstein coefficients (p+1, ..), straight from the definition."""
    p = len(coefs) - 1
    return sum(comb(p, i) * t**i * (1 - t) ** (p - i) * coefs[i] for i in range(p + 1))


def piece_value(breaks, coefs, t):
    """Value at t of a piecewise Bernstein array (p+1, dim, n) of floats, exactly."""
    j = min(int(np.searchsorted(breaks, float(t), "right")) - 1, len(breaks) - 2)
    a, b = Fraction(breaks[j]), Fraction(breaks[j + 1])
    return bernstein_value(exact(coefs[..., j]), (t - a) / (b - a))


def surface_value(bspline, u, v):
    """Euclidean value of a B-spline or NURBS surface tuple at exact u, v."""
    (p, q), (ku, kv), poles, weights = bspline
    poles = exact(poles)
    if weights is not None:
        w = exact(weights)[..., None]
        poles = np.concatenate([poles * w, w], axis=-1)
    row = de_boor(p, exact(ku), poles, u)
    value = de_boor(q, exact(kv), row, v)
    return value if weights is None else value[:-1] / value[-1]


def clamped(p, spans):
    """Clamped uniform knots on [0, 1]."""
    return np.concatenate([np.zeros(p + 1), np.arange(1, spans) / spans, np.ones(p + 1)])


def greville(p, knots):
    return np.array([knots[i + 1 : i + p + 1].mean() for i in range(len(knots) - p - 1)])


def wavy(p=3, spans=10):
    """The wavy surface of the IRIT comparison, as a B-spline tuple."""
    knots = clamped(p, spans)
    g = greville(p, knots)
    i, j = np.meshgrid(np.arange(len(g)), np.arange(len(g)), indexing="ij")
    x, y = g[i] + 0.02 * np.sin(1.1 * j), g[j] + 0.02 * np.cos(1.7 * i)
    return (p, p), (knots, knots), np.stack([x, y, 0.25 * np.sin(0.7 * i) * np.cos(0.9 * j)], -1), None


def quarter_arc():
    """Quarter circle about (.5, .5) of radius .4, from (.9, .5) to (.5, .9), as a rational quadratic."""
    return Curve.bezier([[0.9, 0.5], [0.9, 0.9], [0.5, 0.9]], [1.0, np.sqrt(0.5), 1.0])


numbers = st.floats(-4, 4).map(lambda x: round(x, 6))
positive = st.floats(0.25, 4).map(lambda x: round(x, 6))


@st.composite
def breaks(draw, start=0.0, end=1.0, most=4):
    inner = draw(st.lists(st.integers(1, 63), max_size=most - 1, unique=True))
    return start + (end - start) * np.array([0, *sorted(inner), 64]) / 64


@st.composite
def curves(draw, dim=3, most=5, rational=None):
    """Curves on [0, 1], C0 at least, polynomial or rational."""
    b = draw(breaks())
    p, n = draw(st.integers(1, most)), len(b) - 1
    is_rational = draw(st.booleans()) if rational is None else rational
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    count = n * p + 1
    knots = np.concatenate([[b[0]], np.repeat(b, p), [b[-1]]])
    weights = rng.uniform(0.4, 2.5, count) if is_rational else None
    return Curve.from_bspline(p, knots, rng.uniform(-2, 2, (count, dim)), weights)


@st.composite
def surfaces(draw, dim=3, rational=None):
    """Smooth surfaces on the unit square with simple knots, polynomial or rational."""
    p, q = draw(st.integers(1, 3)), draw(st.integers(1, 3))
    bu, bv = draw(breaks()), draw(breaks())
    knots = [np.concatenate([[b[0]] * d, b, [b[-1]] * d]) for d, b in ((p, bu), (q, bv))]
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    shape = (len(knots[0]) - p - 1, len(knots[1]) - q - 1)
    is_rational = draw(st.booleans()) if rational is None else rational
    weights = rng.uniform(0.4, 2.5, shape) if is_rational else None
    return Surface.from_bspline((p, q), tuple(knots), rng.uniform(-2, 2, (*shape, dim)), weights)


parameters = st.lists(st.floats(0, 1), min_size=1, max_size=6).map(np.array)
