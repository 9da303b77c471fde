"""How many strips a surface takes: ours, Elber's at the same tolerance, and N*.

Run ``python -m benchmarks.strips`` from the project's folder. For each model, tolerance (as a share of the diagonal of
its box) and direction of the rulings: the number of strips, Elber's (Algorithm 1), N*, the proven bound over the
tolerance, and CPU ms. At the end the geometric means of Elber's number over ours, by direction and of the better
direction of each, the least of them, and the time that the 32 patches of the teapot take.
"""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cqblend import teapot
from cqblend.patterns.strips.surface_division import divide_surface
from cqblend.splines import Surface

Array = NDArray[np.float64]

TOLERANCES = (3e-2, 1e-2, 3e-3, 1e-3, 1e-4)

PAWN = np.array(
    [
        # base: a slab with a rounded rim
        *[(14.0, 0.0), (15.5, 0.6), (15.5, 3.4), (14.0, 4.0)],
        # foot, up to the neck, hollow
        *[(13.0, 4.4), (11.0, 5.0), (10.6, 6.5), (9.0, 12.0), (5.4, 17.0), (5.0, 26.0), (5.2, 30.0)],
        # collar
        *[(6.5, 30.2), (8.6, 30.6), (9.0, 31.4), (8.6, 32.2), (6.5, 32.8), (5.0, 33.2)],
        # head: nearly a ball, closed at the top
        *[(7.0, 34.6), (8.2, 38.0), (8.0, 43.5), (4.6, 47.6), (0.0, 47.6)],
    ]
)
"""Profile of a pawn, (r, z) in mm: control points of a cubic B-spline on uniform knots, sharp at both sides of the
collar (see :data:`SHARP`)."""

SHARP = (10, 16)
"""Indices of the control points that the profile passes through with a kink."""


def profile() -> tuple[Array, Array]:
    """Return the full knot vector and the poles (n, 2) of the pawn's profile."""
    ends = [0, *SHARP, len(PAWN) - 1]
    knots = [0.0] * 4
    for first, last in pairwise(ends):
        start = knots[-1]
        knots += [start + i for i in range(1, last - first - 2)]
        knots += [start + last - first - 2] * 3
    return np.array([*knots, knots[-1]]), PAWN


def revolved(degree: int, knots: Array, poles: Array, weights: Array | None = None) -> Surface:
    """Return the surface of revolution of a profile (r, z) about the z axis: four rational quadratic arcs in u."""
    around = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)], dtype=float)
    corner = np.where(np.arange(9) % 2, np.sqrt(0.5), 1.0)
    x, y = np.multiply.outer(around.T, poles[:, 0])
    z = np.broadcast_to(poles[:, 1], x.shape)
    turns = np.repeat(np.arange(5.0), [3, 2, 2, 2, 3])
    own = np.ones(len(poles)) if weights is None else weights
    return Surface.from_bspline((2, degree), (turns, knots), np.stack([x, y, z], axis=-1), np.outer(corner, own))


def sphere(radius: float = 10.0) -> Surface:
    """Return a sphere, rulings in v along meridians."""
    poles = radius * np.array([(0, -1), (1, -1), (1, 0), (1, 1), (0, 1)], dtype=float)
    weights = np.where(np.arange(5) % 2, np.sqrt(0.5), 1.0)
    return revolved(2, np.repeat(np.arange(3.0), [3, 2, 3]), poles, weights)


def torus(major: float = 30.0, minor: float = 10.0) -> Surface:
    """Return a torus, v around the tube."""
    tube = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)], dtype=float)
    weights = np.where(np.arange(9) % 2, np.sqrt(0.5), 1.0)
    return revolved(2, np.repeat(np.arange(5.0), [3, 2, 2, 2, 3]), minor * tube + [major, 0.0], weights)


def pawn() -> Surface:
    """Return the pawn, rulings in v along its profile."""
    return revolved(3, *profile())


def models() -> dict[str, Surface]:
    """Return the models by name."""
    return {"sphere": sphere(), "torus": torus(), "teapot body": teapot.surface(teapot.BODY), "pawn": pawn()}


def diagonal(surface: Surface) -> float:
    """Return the diagonal of a box around a sampled surface."""
    u, v = (np.linspace(*interval, 201) for interval in surface.domain)
    return float(np.linalg.norm(np.ptp(surface.grid(u, v).reshape(-1, surface.dim), axis=0)))


def patches() -> list[Surface]:
    """Return the 32 patches of the teapot."""
    ends = np.repeat([0.0, 1.0], 4)
    return [Surface.from_bspline((3, 3), (ends, ends), poles) for poles in teapot.poles()]


def mean(ratios: list[float]) -> float:
    return float(np.exp(np.log(ratios).mean()))


def main() -> None:
    print(f"{'':12s}{'tolerance':>10s}{'':>4s}{'N':>6s}{'Elber':>7s}{'N*':>9s}{'bound':>8s}{'ms':>8s}")
    each: list[float] = []
    best: list[float] = []
    for name, surface in models().items():
        size = diagonal(surface)
        for share in TOLERANCES:
            found = []
            for way in ("u", "v"):
                start = time.process_time()
                one = divide_surface(surface, share * size, direction=way)  # type: ignore[arg-type]
                ms = 1e3 * (time.process_time() - start)
                n, bound = len(one.strips), one.bound / (share * size)
                print(
                    f"{name:12s}{share:10g}{way:>4s}{n:6d}{one.elber_count:7d}{one.ideal_count:9.2f}{bound:8.4f}{ms:8.1f}"
                )
                found.append((n, one.elber_count))
            each += [elber / n for n, elber in found]
            best.append(min(elber for _, elber in found) / min(n for n, _ in found))
    print(f"Elber's over ours, by direction: {mean(each):.3f}, least {min(each):.3f}")
    print(f"Elber's over ours, better of each: {mean(best):.3f}, least {min(best):.3f}")
    teapots = patches()
    size = float(np.linalg.norm(np.ptp(teapot.poles().reshape(-1, 3), axis=0)))
    start, wall = time.process_time(), time.perf_counter()
    counts = {
        way: [divide_surface(patch, 1e-3 * size, direction=way) for patch in teapots]  # type: ignore[arg-type]
        for way in ("u", "v")
    }
    cpu, wall = time.process_time() - start, time.perf_counter() - wall
    text = ", ".join(
        f"{sum(len(one.strips) for one in found)} in {way} (Elber {sum(one.elber_count for one in found)})"
        for way, found in counts.items()
    )
    print(f"32 teapot patches at 0.001: {text}; {cpu:.2f} s CPU, {wall:.2f} s")


if __name__ == "__main__":
    main()
