"""How many strips a surface takes, and how long that takes: ours, Elber's number at the same tolerance, and N*.

Run ``python -m benchmarks.strips`` from the project's folder for three tables in Markdown. For each model, tolerance
(as a share of the diagonal of its box) and direction of the rulings: the number of strips, Elber's (Algorithm 1), N*,
the proven bound over the tolerance, CPU ms, and ms a strip. Below it the geometric means of Elber's number over ours,
by direction and of the better direction of each, and the least of them. Then the same of the 32 patches of the teapot,
divided together, and CPU seconds of `cqblend.unroll` of the teapot as a solid, whose pieces cover themselves at the
coarser tolerance. Times are medians.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

import cqblend
from benchmarks.tables import Table
from benchmarks.timing import run_timed
from cqblend import teapot
from cqblend.patterns.strips.surface_division import SurfaceDivision, divide_surface, divide_surfaces
from cqblend.splines import Surface

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))

import unroll_models

Array = NDArray[np.float64]

WAYS: tuple[Literal["u", "v"], ...] = ("u", "v")

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


def tabulate_models() -> Table:
    """Return the table of the models, and in its last rows the ratios."""
    rows: list[list[str | float]] = []
    each: list[float] = []
    best: list[float] = []
    for name, surface in models().items():
        size = diagonal(surface)
        for share in TOLERANCES:
            found = []
            for way in WAYS:
                one, ms = run_timed(partial(divide_surface, surface, share * size, direction=way))
                n, bound = len(one.strips), f"{one.bound / (share * size):.4f}"
                rows.append([name, f"{share:g}", way, n, one.elber_count, f"{one.ideal_count:.2f}", bound, ms, ms / n])
                found.append((n, one.elber_count))
            each += [elber / n for n, elber in found]
            best.append(min(elber for _, elber in found) / min(n for n, _ in found))
    for title, ratios in (("Elber over N, all", each), ("Elber over N, better of u and v", best)):
        rows.append([title, "", "", "", f"{mean(ratios):.3f}, least {min(ratios):.3f}", "", "", "", ""])
    columns = ("model", "tolerance", "rulings", "N", "Elber", "N*", "bound", "ms", "ms a strip")
    return Table("division", columns, rows)


def tabulate_teapot_patches() -> Table:
    """Return the table of the teapot's patches; in the direction "auto" both are divided, and the better one counts."""
    teapots = patches()
    size = float(np.linalg.norm(np.ptp(teapot.poles().reshape(-1, 3), axis=0)))
    rows: list[list[str | float]] = []
    for share in (1e-1, *TOLERANCES):
        for way in (*WAYS, "auto"):
            found, ms = run_timed(partial(divide_surfaces, teapots, share * size, direction=way))
            divisions = [one for one in found if isinstance(one, SurfaceDivision)]
            n, elber = sum(len(one.strips) for one in divisions), sum(one.elber_count for one in divisions)
            rows.append([f"{share:g}", way, n, elber, ms, ms / n])
    return Table("teapot_patches", ("tolerance", "rulings", "N", "Elber", "ms", "ms a strip"), rows)


def tabulate_teapot_solid() -> Table:
    """Return the table of the teapot as a solid, unrolled."""
    solid = unroll_models.teapot()
    size = solid.BoundingBox().DiagonalLength
    rows: list[list[str | float]] = []
    for share in (1e-2, 3e-3, 1e-3):
        pattern, ms = run_timed(partial(cqblend.unroll, solid, share * size))
        rows.append([f"{share:g}", pattern.report.strips, len(pattern.strips), f"{ms / 1e3:.2f}"])
    return Table("teapot_solid", ("tolerance", "N", "pieces", "s"), rows)


def tabulate() -> Iterator[Table]:
    """Yield all three tables."""
    yield tabulate_models()
    yield tabulate_teapot_patches()
    yield tabulate_teapot_solid()


if __name__ == "__main__":
    for table in tabulate():
        print(f"\n{table}", flush=True)
