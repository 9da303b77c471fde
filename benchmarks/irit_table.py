"""Symbolic operations on the inputs on which IRIT v11 was measured, with IRIT's figures beside ours.

Run ``python -m benchmarks.irit_table`` from the project's folder. Each row gives, for cqblend, CPU ms of the operation
on splines (best, median) and of the whole way from B-spline to B-spline (``door to door``), the error of the
coefficients against exact fractions relative to the largest value, and the number of poles of the re-assembled
B-spline. IRIT's columns (median ms, error, coefficients) are carried over: IRIT v11, C, -O2, on the same kind of
machine; its results keep C0 knots, and removing them costs it more than the operation itself. The ratios are those of
our best times to IRIT's.

Inputs: knots clamped uniform on [0, 1]. A_i = sin(.7 i) + .3 cos(1.3 i), B_i = cos(.9 i) - .2 sin(.4 i). The wavy
surface is bicubic with 10 x 10 spans: x = greville_i + .02 sin(1.1 j), y = greville_j + .02 cos(1.7 i),
z = .25 sin(.7 i) cos(.9 j). Unit length: the quadratic field (1, 0, .2), (.6, .9, -.1), (-.4, .7, .5), and the
derivative of the cubic curve of 10 spans with poles (i + .3 sin(2 i), 2 sin(.9 i), 1.5 cos(.6 i)); the error is the
distance from T/|T|, which both libraries keep below the tolerance given.
"""

import argparse
import time
from collections.abc import Callable
from fractions import Fraction
from math import comb, isqrt

import numpy as np

from benchmarks.tables import Table
from cqblend import Rail, hermite_blend
from cqblend.splines import Curve, Surface, normalise

IRIT = {  # row: median CPU ms, relative error, coefficients
    "A*B, d = 3, n = 50": (0.24, 6e-16, "301"),
    "A*B, d = 9, n = 50": (0.42, 2e-15, "901"),
    "S.S wavy": (0.94, 1e-15, "61x61"),
    "Su x Sv wavy": (3.8, 1e-15, "51x51"),
    "wavy o line": (0.19, 1.4e-13, "115"),
    "wavy o cubic Bezier": (0.55, 1.3e-10, "343"),
    "wavy o uv B-spline": (0.81, 1.4e-10, "487"),
    "wavy o rational arc": (0.32, 0.014, "87"),
    "whole blend, T1 x .3": (51, 3.5e-7, "4x343"),  # its error is 2e-5 degrees of the normal, not relative
    "unit T, quadratic, 1e-3": (3.3, 1e-3, "409"),
    "unit T, quadratic, 1e-5": (908, 1e-5, "3895"),
    "unit T, 10 spans, 1e-4": (6000, 1e-4, "7141"),
}

exact = np.vectorize(Fraction, otypes=[object])


def clamped(degree, spans):
    return np.concatenate([np.zeros(degree + 1), np.arange(1, spans) / spans, np.ones(degree + 1)])


def scalar_data(degree, spans):
    i = np.arange(spans + degree)
    a, b = np.sin(0.7 * i) + 0.3 * np.cos(1.3 * i), np.cos(0.9 * i) - 0.2 * np.sin(0.4 * i)
    return [(degree, clamped(degree, spans), poles[:, None], None) for poles in (a, b)]


def wavy_data():
    knots = clamped(3, 10)
    greville = np.array([knots[i + 1 : i + 4].mean() for i in range(13)])
    i, j = np.meshgrid(np.arange(13), np.arange(13), indexing="ij")
    x, y = greville[i] + 0.02 * np.sin(1.1 * j), greville[j] + 0.02 * np.cos(1.7 * i)
    return (3, 3), (knots, knots), np.stack([x, y, 0.25 * np.sin(0.7 * i) * np.cos(0.9 * j)], -1), None


def rails():
    i = np.arange(8)
    bezier = np.array([[0.05, 0.10], [0.40, 0.95], [0.65, 0.05], [0.95, 0.90]])
    arc = np.array([[0.9, 0.5], [0.9, 0.9], [0.5, 0.9]])
    return {
        "line": (1, clamped(1, 1), np.array([[0.03, 0.07], [0.97, 0.91]]), None),
        "cubic Bezier": (3, clamped(3, 1), bezier, None),
        "uv B-spline": (3, clamped(3, 5), np.stack([0.05 + 0.9 * i / 7, 0.5 + 0.4 * np.sin(1.3 * i)], -1), None),
        "rational arc": (2, clamped(2, 1), arc, np.array([1.0, np.sqrt(0.5), 1.0])),
    }


# -- the truth: de Boor and the definition of Bernstein polynomials, in fractions


def de_boor(degree, knots, poles, t, derivative=0):
    """Value or first derivative of a B-spline at t, exactly."""
    if derivative:
        lengths = (knots[degree + 1 : -1] - knots[1 : -degree - 1]).reshape(-1, *(1,) * (poles.ndim - 1))
        return de_boor(degree - 1, knots[1:-1], degree * (poles[1:] - poles[:-1]) / lengths, t)
    span = max(i for i in range(degree, len(poles)) if knots[i] <= t and knots[i] < knots[i + 1])
    d = [poles[span - degree + i] for i in range(degree + 1)]
    for r in range(1, degree + 1):
        for j in range(degree, r - 1, -1):
            lo, hi = knots[span - degree + j], knots[span + 1 + j - r]
            x = (t - lo) / (hi - lo)
            d[j] = (1 - x) * d[j - 1] + x * d[j]
    return d[degree]


def true_curve(data, t):
    degree, knots, poles, weights = data
    homogeneous = exact(poles)
    if weights is None:
        return de_boor(degree, exact(knots), homogeneous, t)
    w = exact(weights)[:, None]
    value = de_boor(degree, exact(knots), np.concatenate([homogeneous * w, w], axis=1), t)
    return value[:-1] / value[-1]


def true_surface(data, u, v, ku=0, kv=0):
    (p, q), (knots_u, knots_v), poles, _ = data
    return de_boor(q, exact(knots_v), de_boor(p, exact(knots_u), exact(poles), u, ku), v, kv)


def our_value(spline, *parameters):
    """Value of our coefficients, exactly: what is measured is the coefficients, not the evaluation."""
    breaks = (spline.breaks,) if isinstance(spline, Curve) else spline.breaks
    piece = [
        min(int(np.searchsorted(b, float(t), "right")) - 1, len(b) - 2) for b, t in zip(breaks, parameters, strict=True)
    ]
    value = exact(spline.coefs[(..., *piece)])
    for b, j, t in zip(breaks, piece, parameters, strict=True):
        x = (t - Fraction(b[j])) / (Fraction(b[j + 1]) - Fraction(b[j]))
        p = len(value) - 1
        value = sum(comb(p, i) * x**i * (1 - x) ** (p - i) * value[i] for i in range(p + 1))
    return value[:-1] / value[-1] if spline.rational else value


def error(spline, truth: Callable, samples: int) -> float:
    rng = np.random.default_rng(0)
    worst, scale = Fraction(0), Fraction(0)
    count = 1 if isinstance(spline, Curve) else 2
    for _ in range(samples):
        parameters = [Fraction(x) for x in rng.uniform(0, 1, count)]
        expected = truth(*parameters)
        worst = max(worst, np.abs(our_value(spline, *parameters) - expected).max())
        scale = max(scale, np.abs(expected).max())
    return float(worst / scale)


def cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def rows():
    """Name, B-spline inputs, operation, and truth of each row."""
    for degree in (3, 9):
        a, b = scalar_data(degree, 50)

        def product(t, a=a, b=b):
            return true_curve(a, t) * true_curve(b, t)

        yield f"A*B, d = {degree}, n = 50", (a, b), lambda x, y: x * y, product
    wavy = wavy_data()
    yield "S.S wavy", (wavy,), lambda s: s.dot(s), lambda u, v: (true_surface(wavy, u, v) ** 2).sum(keepdims=True)
    yield (
        "Su x Sv wavy",
        (wavy,),
        lambda s: s.derivative(1, 0).cross(s.derivative(0, 1)),
        lambda u, v: cross(true_surface(wavy, u, v, 1, 0), true_surface(wavy, u, v, 0, 1)),
    )
    for name, rail in rails().items():

        def composed(t, rail=rail):
            return true_surface(wavy, *true_curve(rail, t))

        yield f"wavy o {name}", (wavy, rail), lambda s, c: s.compose(c), composed

    moved = (wavy[0], wavy[1], wavy[2] + SHIFT, None)
    rail = rails()["cubic Bezier"]
    mirrored = (rail[0], rail[1], rail[2] * (1, -1) + (0, 1), None)
    yield (
        "whole blend, T1 x .3",
        (wavy, rail, moved, mirrored),
        blend,
        lambda t, v: true_blend((wavy, rail), (moved, mirrored), t, v),
    )

    for name, field, tolerance in unit_fields():
        yield name, (field,), lambda f, x=tolerance: normalise(f, x).field, lambda t, f=field: direction(f, t)


def unit_fields():
    quadratic = np.array([[1, 0, 0.2], [0.6, 0.9, -0.1], [-0.4, 0.7, 0.5]])
    i = np.arange(13)
    cubic = np.stack([i + 0.3 * np.sin(2 * i), 2 * np.sin(0.9 * i), 1.5 * np.cos(0.6 * i)], -1)
    velocity = Curve.from_bspline(3, clamped(3, 10), cubic).derivative().to_bspline()
    yield "unit T, quadratic, 1e-3", (2, clamped(2, 1), quadratic, None), 1e-3
    yield "unit T, quadratic, 1e-5", (2, clamped(2, 1), quadratic, None), 1e-5
    yield "unit T, 10 spans, 1e-4", velocity, 1e-4


def direction(field, t):
    """T/|T| to 60 digits."""
    value = true_curve(field, t)
    return value / Fraction(isqrt(int((value**2).sum() * 10**120)), 10**60)


SHIFT = np.array([0.3, 0.2, 1.0])


def blend(s1: Surface, c1: Curve, s2: Surface, c2: Curve) -> Surface:
    """Blend along T1 = v' Su - u' Sv, times .3: rails are checked as for any caller."""
    rails = Rail(s1, c1, "right"), Rail(s2, c2, "right")
    return hermite_blend(*rails, tangents="parametric", length="field", bulge=0.3, form="exact").surface


def true_blend(one, two, t, v):
    rows = []
    for surface, curve in (one, two):
        u = true_curve(curve, t)
        degree, knots, poles, _ = curve
        rate = de_boor(degree, exact(knots), exact(poles), t, 1)
        field = rate[1] * true_surface(surface, *u, 1, 0) - rate[0] * true_surface(surface, *u, 0, 1)
        point = true_surface(surface, *u)
        rows.append((point, point + field * Fraction(0.1)))
    (a, b), (d, c) = rows
    w = 1 - v
    return w**3 * a + 3 * w**2 * v * b + 3 * w * v**2 * c + v**3 * d


def cpu_ms(work: Callable, repeats: int) -> tuple[float, float]:
    work()
    times = []
    for _ in range(repeats):
        start = time.process_time_ns()
        work()
        times.append((time.process_time_ns() - start) / 1e6)
    return min(times), float(np.median(times))


def splines(inputs):
    return [(Curve if np.ndim(data[0]) == 0 else Surface).from_bspline(*data) for data in inputs]


COLUMNS = (
    "operation",
    "best, ms",
    "median",
    "door to door, best",
    "median",
    "error",
    "poles",
    "IRIT, ms",
    "error",
    "coefficients",
    "ratio",
    "ratio, door to door",
)


def tabulate(repeats: int = 300, samples: int = 40) -> Table:
    """Return the table of all operations; errors are measured in fractions at so many points."""
    table = []
    for name, inputs, operation, truth in rows():
        ready = splines(inputs)
        result = operation(*ready)
        best, median = cpu_ms(lambda f=operation, x=ready: f(*x), repeats)
        door, median_door = cpu_ms(lambda f=operation, x=inputs: f(*splines(x)).to_bspline(), repeats)
        poles = "x".join(map(str, result.to_bspline()[2].shape[:-1]))
        wrong = error(result, truth, samples)
        ms, irit_error, coefs = IRIT[name]
        ours = [best, median, door, median_door, f"{wrong:.0e}", poles]
        table.append([name, *ours, ms, f"{irit_error:.0e}", coefs, best / ms, door / ms])
    return Table("kernel", COLUMNS, table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=300)
    parser.add_argument("--samples", type=int, default=40, help="points at which the error is measured in fractions")
    options = parser.parse_args()
    print(tabulate(options.repeats, options.samples))


if __name__ == "__main__":
    main()
