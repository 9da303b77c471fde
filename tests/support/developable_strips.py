"""Strips whose flat form is known, for the tests of developability, flattening and pairing."""

import numpy as np

from cqblend.splines import Curve, hermite


def moved(curve, shift):
    """Translate a curve."""
    return curve + np.array(shift, dtype=float)


ROOT = np.sqrt(0.5)
QUARTER = Curve.bezier([[1.0, 0, 0], [1, 1, 0], [0, 1, 0]], [1.0, ROOT, 1.0])
APEX = Curve.bezier([[0.0, 0, 2]] * 3, [1.0, ROOT, 1.0])
CYLINDER = QUARTER, moved(QUARTER, [0, 0, 2])
CONE = QUARTER, moved(QUARTER * 2, [0, 0, 1])  # apex at (0, 0, -1)
SADDLE = Curve.bezier([[0.0, 0, 0], [4, 0, 0]]), Curve.bezier([[0.0, 1, 0], [4, 1, 0.5]])

# a cubic of constant slope: |E'| = 3 sqrt(2) (1 + t^2), and the curvature is 1 / (3 (1 + t^2)^2)
EDGE = Curve.bezier([[0.0, 0, 0], [1, 0, 1], [2, 1, 2], [2, 3, 4]])


def tangent_strip(first, second):
    """Strip of the tangent developable of EDGE, at given multiples of E'."""
    return EDGE + EDGE.derivative() * first, EDGE + EDGE.derivative() * second


def circle(radius, height, turns=1.0):
    """Full circle or less, as quarters."""
    count = 4
    angle = 2 * np.pi * turns * np.arange(2 * count + 1) / (2 * count)
    half = np.pi * turns / count
    poles = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    weights = np.where(np.arange(2 * count + 1) % 2, np.cos(half), 1.0)
    poles[1::2] /= np.cos(half)
    poles = np.concatenate([poles, np.full((len(poles), 1), height)], axis=1)
    knots = np.repeat(np.arange(count + 1.0), [3] + [2] * (count - 1) + [3])
    return Curve.from_bspline(2, knots, poles, weights)


def helix_strip(radius, rise, first, second, end=4.0, pieces=96):
    """Strip of the tangent developable of a helix, fitted to 1e-13, at given multiples of h'."""
    t = np.linspace(0, end, pieces + 1)

    def jets(multiple):
        cycle = [np.cos(t), -np.sin(t), -np.cos(t), np.sin(t)]
        x = [radius * cycle[k % 4] for k in range(5)]
        y = [radius * cycle[(k + 3) % 4] for k in range(5)]
        z = [rise * t, np.full(len(t), rise), *[np.zeros(len(t))] * 3]
        h = np.stack([np.stack(row, axis=-1) for row in zip(x, y, z, strict=True)])
        return h[:4] + multiple * h[1:]

    return hermite(t, jets(first)), hermite(t, jets(second))


def ruled(rails, t, w):
    """Points (1 - w) C1(t) + w C2(t)."""
    w = np.asarray(w)[..., None]
    return (1 - w) * rails[0](t) + w * rails[1](t)


def random_strip(seed, rational=False):
    """Cubic rails close to each other, of no special kind."""
    rng = np.random.default_rng(seed)
    poles = np.array([[0.0, 0, 0], [1, 0.5, 0], [2, 0, 0.5], [3, 0.5, 0]]) + 0.3 * rng.normal(size=(4, 3))
    other = poles + [0, 0.2, 0.5] + 0.1 * rng.normal(size=(4, 3))
    weights = rng.uniform(0.6, 1.6, 4) if rational else None
    return Curve.bezier(poles, weights), Curve.bezier(other, None if weights is None else weights[::-1])


DEVELOPABLE = {
    "cylinder": CYLINDER,
    "oblique cylinder": (EDGE, moved(EDGE, [1, -3, 2])),
    "cone": CONE,
    "cone of a cubic": (moved(EDGE, [0, 0, 3]), moved(EDGE * 1.5, [0, 0, 4.5])),
    "ring of a cone": (circle(2, 0), circle(1, 1)),
    "fan": (QUARTER, APEX),
    "fan upside down": (APEX, QUARTER),
    "tangent": tangent_strip(0.5, 1.5),
    "edge of regression": tangent_strip(0.0, 1.0),
    "helix": helix_strip(1.0, 0.4, 0.5, 2.0, pieces=64),
}
TWISTED = {"saddle": SADDLE, "cubics": random_strip(3), "rational": random_strip(8, True)}


def grid(rails, count=33, across=5):
    """Parameters t and w of a grid on a strip."""
    t = np.linspace(*rails[0].domain, count)
    return (f.ravel() for f in np.meshgrid(t, np.linspace(0, 1, across), indexing="ij"))
