"""A fuzz of proofs and certificates: no bound below any measurement, no certificate that overlooks the worst.

Random surfaces and rails: rational, of degrees up to 9, far from the origin, with knots close together on one surface
and on both, all orders of continuity, both forms, and what fills blends. ``PROOF_FUZZ=680 pytest
tests/blends/quality/test_proof_fuzz.py`` runs as many seeds, about half of which make a blend; the others are refused.
By default a few run at which proofs or certificates once failed.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
import pytest
from potential_pairs import PAIRS, SIZES
from proof_witness import LongCurve, LongSurface, Measured, measure

import cqblend
from cqblend.errors import CqblendError
from cqblend.splines import Curve, Surface

COUNT = int(os.environ.get("PROOF_FUZZ", "0"))
ONCE = (2, 6, 32, 34, 36, 45)
SIZE = 10.0
NOISE = Measured(1e-12, 1e-10, np.inf)  # above which a certificate may not overlook more than a tenth
FAR = (0.0, 1.0, 10.0, 1e2, 1e3, 1e4, 1e5)
CLOSE = (1e-10, 2e-9, 1e-8, 1e-7, 5e-7, 1e-6, 3e-6, 1e-5, 1e-4)
ORDERS = ("G0", "G1", "G1", "G1", "G2", "G2", "G3")


def knots(rng: np.random.Generator, degree: int, shared: np.ndarray) -> np.ndarray:
    """Return a clamped knot vector: some knots of its own, some next to shared ones, some multiple, some in pairs."""
    inner = rng.uniform(0.1, 0.9, rng.integers(0, 4)).tolist()
    inner += (shared + rng.choice([0.0, *CLOSE], len(shared)) * rng.choice([-1, 1], len(shared))).tolist()
    if inner and rng.random() < 0.25:
        inner.append(inner[0] + rng.choice(CLOSE))
    repeats = [int(rng.integers(1, max(1, degree - 1) + 1)) if rng.random() < 0.4 else 1 for _ in inner]
    if degree == 1:
        inner, repeats = [], []
    return np.concatenate([np.zeros(degree + 1), np.sort(np.repeat(inner, repeats)), np.ones(degree + 1)])


def sheet(rng: np.random.Generator, shared: np.ndarray, at: np.ndarray) -> Surface:
    """Return a wavy sheet, ten millimetres wide."""
    high = rng.random() < 0.25
    degrees = tuple(int(x) for x in rng.integers(2, 10 if high else 4, 2))
    rational = rng.random() < 0.4
    both = [knots(rng, degrees[0], shared), knots(rng, degrees[1], shared[:1] if rng.random() < 0.5 else shared[:0])]
    greville = [
        np.array([k[i + 1 : i + p + 1].mean() for i in range(len(k) - p - 1)])
        for k, p in zip(both, degrees, strict=True)
    ]
    u, v = np.meshgrid(*greville, indexing="ij")
    a, b, c, d = rng.uniform(1, 4, 4)
    height = rng.uniform(0.02, 0.2) * np.sin(a * u + c) * np.cos(b * v + d)
    weights = 1 + rng.uniform(0, 0.5) * np.sin(b * u + a * v) if rational else None
    return Surface.from_bspline(degrees, tuple(both), SIZE * np.stack([u, v, height], -1) + at, weights)


def rail(rng: np.random.Generator, across: float) -> Curve:
    """Return a rail that runs through most of u, with v about ``across``."""
    degree = int(rng.integers(1, 4))
    u = np.linspace(0.05, 0.95, degree + 1)
    points = np.stack([u, across + rng.uniform(-0.05, 0.05, degree + 1)], -1)
    if rng.random() < 0.25:
        weights = rng.uniform(0.7, 1.4, degree + 1)
        return Curve.from_bspline(degree, np.repeat([0.0, 1.0], degree + 1), points, weights)
    if rng.random() < 0.3:
        k = np.concatenate([np.zeros(4), np.sort(rng.uniform(0.2, 0.8, 2)), np.ones(4)])
        u = np.array([k[i + 1 : i + 4].mean() for i in range(6)]) * 0.9 + 0.05
        return Curve.from_bspline(3, k, np.stack([u, across + rng.uniform(-0.04, 0.04, 6)], -1))
    return Curve.from_bspline(degree, np.repeat([0.0, 1.0], degree + 1), points)


@dataclass
class Case:
    """A blend of the fuzz, and what it was asked for."""

    blend: object
    told: str


def case(seed: int) -> Case | None:
    """Make a blend of a seed, None if it is refused."""
    rng = np.random.default_rng(seed)
    shared = np.sort(rng.uniform(0.2, 0.8, rng.integers(0, 3)))
    at = rng.normal(size=3)
    at *= rng.choice(FAR) / np.linalg.norm(at)
    surfaces = sheet(rng, shared, at), sheet(rng, shared, at + np.array([0, 11, 4]))
    rails = rail(rng, 0.85), rail(rng, 0.15)
    orders = (str(rng.choice(ORDERS)), str(rng.choice(ORDERS)))
    form = str(rng.choice(["exact", "compact", "auto"]))
    tangents = str(rng.choice(["perpendicular", "parametric", "chord"]))
    kind = str(rng.choice(["hermite", "hermite", "hermite", "hermite", "pde"]))
    told = f"seed {seed}: {kind} {orders} {form} {tangents}, {surfaces[0]}, {surfaces[1]}, at {np.linalg.norm(at):g}"
    try:
        pair = cqblend.Rail(surfaces[0], rails[0]), cqblend.Rail(surfaces[1], rails[1])
        if kind == "pde":
            blend = cqblend.pde_blend(
                *pair, order=int(rng.choice([4, 6])), form=form, tangents=tangents, terms=6, crease=1.5
            )
        else:
            blend = cqblend.hermite_blend(*pair, continuity=orders, form=form, tangents=tangents, crease=1.5)
    except CqblendError:
        return None
    return Case(blend, told)


def judged(one: Case) -> list[str]:
    """Return what is wrong with the proof and the certificate of a blend."""
    blend, wrong = one.blend, []
    surface = LongSurface(*blend.surface.to_bspline())
    certificate = blend.certificate
    # two evaluations of a point differ by the rounding of its coordinates
    noise = NOISE._replace(gap=NOISE.gap + 4 * np.finfo(float).eps * float(np.abs(blend.surface.to_bspline()[2]).max()))
    for end, (other, curve) in enumerate(blend.traces):
        proof, record = certificate.proof.sides[end], certificate.rails[end]
        found = measure(surface, end, LongCurve(*curve.to_bspline()), LongSurface(*other.to_bspline()))
        for who, measured in zip(("long double", "OCCT"), found, strict=True):
            for name in Measured._fields:
                bound, seen, value = getattr(proof, name), getattr(record, name), getattr(measured, name)
                if bound is not None and value > bound:
                    wrong.append(f"side {end + 1}: {name} proven {bound:.3g}, {who} {value:.3g}")
                if name != "curvature_jump" and value > getattr(noise, name) and seen < 0.9 * value:
                    wrong.append(f"side {end + 1}: {name} certified {seen:.3g}, {who} {value:.3g}")
    return wrong


@pytest.mark.parametrize("seed", range(COUNT) if COUNT else ONCE)
def test_no_proof_and_no_certificate_is_below_what_is_measured(seed):
    one = case(seed)
    assert one is not None or COUNT
    if one is not None:
        wrong = judged(one)
        assert not wrong, f"{one.told}: " + "; ".join(wrong)


@pytest.mark.parametrize("form", ["exact", "compact"] if COUNT else ["exact"])
@pytest.mark.parametrize("name", list(PAIRS) if COUNT else ["a plate from a reference"])
def test_potential_blends_are_proven_as_well(name, form):
    make, _ = PAIRS[name]
    a, b = SIZES.get(name, (1.0, 1.0))
    one = Case(cqblend.potential_blend(*make(), cqblend.Conic(a, b, -3 * a * b), form=form), name)
    assert not judged(one)
