"""How long blends of surfaces along given rails take, and potential blends beside Hermite ones.

Run ``python -m benchmarks.surface_blends`` from the project's folder. The first table is of `cqblend.hermite_blend`
between two wavy bicubics of 10 x 10 spans, along cubic rails that cross many of their knot lines: rails that mirror
each other, and pairs of which one is moved at random by up to a share of the surface's size. The second is of edges of
random bodies, blended with the Hermite and with the potential section, which reach as far on faces at a right angle.
CPU times, medians of several runs.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.bodies import (
    angle_bracket,
    box,
    cylinder_cap,
    draw,
    freeform_top,
    loft,
    sphere_and_boss,
    sphere_with_hole,
)
from benchmarks.irit_table import SHIFT, rails, wavy_data
from benchmarks.tables import Table
from benchmarks.timing import measure_cpu
from cqblend import Rail, hermite_blend
from cqblend.blend_options import BlendOptions
from cqblend.errors import CqblendError
from cqblend.solid_blends.blend_pipeline import blend_shape
from cqblend.splines import Curve, Surface

MOVES = (0.0, 0.05, 0.1, 0.2)
PAIRS = 6  # of rails for each move
SHAPES = (box, angle_bracket, cylinder_cap, sphere_and_boss, sphere_with_hole, loft, freeform_top)
DRAWS = 2


def rail_pair(move: float, number: int) -> tuple[Rail, Rail]:
    """Return two rails that mirror each other, the second one with its poles moved at random."""
    degree, knots, poles, _ = wavy_data()
    bezier = rails()["cubic Bezier"][2]
    shifts = move * np.random.default_rng(number).uniform(-1, 1, bezier.shape)
    mirrored = np.clip(bezier * (1, -1) + (0, 1) + shifts, 0.02, 0.98)
    below, above = (Surface.from_bspline(degree, knots, poles + shift) for shift in (0.0, SHIFT))
    return Rail(below, Curve.bezier(bezier), "right"), Rail(above, Curve.bezier(mirrored), "right")


def tabulate_moved_rails() -> Table:
    """Return the times of Hermite blends along rails, by how far one of them is moved."""
    rows: list[list[str | float]] = []
    every = []
    for move in MOVES:
        pairs = [rail_pair(move, number) for number in range(PAIRS if move else 1)]
        times = [measure_cpu(lambda pair=pair: hermite_blend(*pair)) for pair in pairs]  # type: ignore[misc]
        spans = [len(hermite_blend(*pair).surface.breaks[0]) - 1 for pair in pairs]
        title = f"moved by up to {move:.0%}" if move else "mirrored"
        rows.append([title, len(pairs), statistics.median(times), max(times), max(spans)])
        every += times
    rows.append(["all", len(every), statistics.median(every), max(every), ""])
    return Table("moved_rails", ("one rail", "pairs", "median, ms", "worst, ms", "spans, at most"), rows)


def tabulate_potential() -> Table:
    """Return the times of both sections on the same edges."""
    rows: list[list[str | float]] = []
    for family in SHAPES:
        both = [pair for number in range(DRAWS) if (pair := _time_sections(family, number)) is not None]
        medians = [statistics.median(times) for times in zip(*both, strict=True)] if both else [np.nan, np.nan]
        ratios = [potential / hermite for hermite, potential in both]
        median, worst = (statistics.median(ratios), max(ratios)) if both else (np.nan, np.nan)
        rows.append([family.__name__.replace("_", " "), len(both), *medians, median, worst])
    columns = ("one edge of a", "edges", "Hermite, ms", "potential, ms", "ratio", "largest")
    return Table("potential", columns, rows)


def _time_sections(family: Callable[..., object], number: int) -> tuple[float, float] | None:
    """Return the times of the Hermite and the potential section on a random body, ms; None if one is refused."""
    case = draw(family, number)  # type: ignore[arg-type]
    wanted = BlendOptions(case.radius), BlendOptions(section="potential", a=case.radius, b=case.radius)

    def blend(options: BlendOptions) -> object:
        return blend_shape(case.body.wrapped, [case.edge.wrapped], options.to_request())

    try:
        hermite, potential = (measure_cpu(lambda one=one: blend(one), 3) for one in wanted)  # type: ignore[misc]
    except CqblendError:
        return None
    return hermite, potential


def tabulate() -> Iterator[Table]:
    """Yield both tables."""
    yield tabulate_moved_rails()
    yield tabulate_potential()


if __name__ == "__main__":
    for table in tabulate():
        print(f"\n{table}", flush=True)
