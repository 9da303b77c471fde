"""How often cqblend blends random chains, and how exact it is when it does.

Run ``python -m benchmarks chains`` from the project's folder, or ``python -m benchmarks.chain_sweep`` to choose draws
and families. For each family of `benchmarks.chain_bodies`: how many draws come back complete, as
`benchmarks.blend_scores` judges it and with a change of volume as estimated, the largest gap (mm) and angle (rad) of
their smooth joints, and what became of the rest. Every draw that is not complete has a line on stderr, with the family
and the number that draw it again: ``draw_chain(FAMILY, NUMBER)`` and `draw_radius`.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from benchmarks.attempts import EXACT, Made, attempt, blended
from benchmarks.blend_scores import Blended, Limits, Score, score_blend
from benchmarks.chain_bodies import FAMILIES, ChainCase, Family, draw_chain
from benchmarks.chain_sizes import estimate_largest_radius, estimate_volume_change, measure_mesh_volume
from benchmarks.tables import Table
from benchmarks.tangent_chains import EdgeLinks
from benchmarks.touching_balls import Body

EXACT_LIMITS = Limits(gap=1e-9, angle=1e-10)
"""What joints of exact blends reach on modelled bodies."""
VERDICTS = ("complete", "incomplete", "refused", "failed", "unsound")
DRAWS = 72
"""Draws of each family that make a thousand in all."""


@dataclass(frozen=True)
class ChainOutcome:
    """What became of a draw."""

    case: ChainCase
    cells: int
    radius: float
    verdict: str
    message: str
    gap: float = math.nan
    angle: float = math.nan

    def __str__(self) -> str:
        what = f"{self.case.name:20s} {self.cells:3d} cells, r = {self.radius:<8.4g}"
        return f"{what} {self.verdict:10s} {self.message}"


def draw_radius(case: ChainCase, body: Body) -> float:
    """Return the radius of a draw, between a seventh of what is estimated to fit and all of it."""
    largest = estimate_largest_radius(body, EdgeLinks(body).follow_chain(case.edge.wrapped))
    return largest * float(np.random.default_rng(case.number).uniform(0.15, 1.0))


def judge_chain(case: ChainCase, radius: float, made: Made) -> Score:
    """Return the score of a blend of a drawn chain; a wrong change of volume is unsound."""
    before = case.body.wrapped
    limits = EXACT_LIMITS if made.promise <= EXACT else Limits(angle=made.promise)
    score = score_blend(Blended(before, [case.edge.wrapped], radius, made.shape, made.faces), limits)
    body = Body(before)
    wanted, doubt = estimate_volume_change(body, EdgeLinks(body).follow_chain(case.edge.wrapped), radius)
    deflection = 1e-3 * radius
    volumes = [measure_mesh_volume(shape, deflection) for shape in (made.shape, before)]
    change, doubt = volumes[0][0] - volumes[1][0], doubt + deflection * volumes[1][1]
    if abs(change - wanted) <= doubt:
        return score
    problem = f"the volume changes by {change:.4g} mm^3, by {wanted:.4g} +- {doubt:.2g} as estimated"
    return Score((*score.unsound, problem), score.missing, score.gap, score.angle)


def run_draw(family: Family, number: int, timeout: float) -> ChainOutcome:
    """Draw a chain, blend it and judge what comes out."""
    case = draw_chain(family, number)
    body = Body(case.body.wrapped)
    cells = len(EdgeLinks(body).follow_chain(case.edge.wrapped).edges)
    radius = draw_radius(case, body)
    operation = blended(case.body.wrapped, [case.edge.wrapped], radius)
    outcome = attempt(case.body.wrapped, operation, timeout, lambda made: judge_chain(case, radius, made))
    joints = (outcome.joint_gap, outcome.joint_angle)
    return ChainOutcome(case, cells, radius, outcome.verdict, outcome.reason, *joints)


def sweep(families: Sequence[Family], draws: int, timeout: float, jobs: int) -> Iterator[ChainOutcome]:
    """Yield what becomes of the first draws of some families; tell on stderr of all that are not complete."""
    drawn = [(family, number) for family in families for number in range(draws)]
    with ThreadPoolExecutor(jobs) as pool:
        for outcome in pool.map(lambda draw: run_draw(*draw, timeout), drawn):
            if outcome.verdict != "complete":
                print(outcome, file=sys.stderr, flush=True)
            yield outcome


def tabulate_families(timeout: float) -> Iterator[Table]:
    """Yield the table of all families, a thousand draws."""
    yield tabulate(list(sweep(FAMILIES, DRAWS, timeout, jobs=1)))


def tabulate(outcomes: Sequence[ChainOutcome]) -> Table:
    """Return how many draws of each family have which verdict."""
    families = dict.fromkeys(one.case.family for one in outcomes)
    rows = [
        _count_verdicts(name.replace("_", " "), [x for x in outcomes if x.case.family == name]) for name in families
    ]
    columns = ("chain", "draws", "cells, at most", *VERDICTS, "gap, mm", "angle, rad")
    return Table("chains", columns, [*rows, _count_verdicts("all", outcomes)])


def _count_verdicts(title: str, outcomes: Sequence[ChainOutcome]) -> list[str | float]:
    counts = [sum(one.verdict == verdict for one in outcomes) for verdict in VERDICTS]
    gap, angle = (
        f"{max((getattr(one, name) for one in outcomes if one.verdict == 'complete'), default=math.nan):.0e}"
        for name in ("gap", "angle")
    )
    return [title, len(outcomes), max(one.cells for one in outcomes), *counts, gap, angle]


def main() -> None:
    parser = argparse.ArgumentParser(description="Blend random chains.")
    parser.add_argument("draws", nargs="?", type=int, default=DRAWS, help="of each family")
    parser.add_argument("--family", default="", help="only families whose name contains this")
    parser.add_argument("--timeout", type=float, default=120.0, help="s, of one attempt")
    parser.add_argument("--jobs", type=int, default=1, help="attempts at the same time")
    options = parser.parse_args()
    families = [family for family in FAMILIES if options.family in family.__name__]
    print(tabulate(list(sweep(families, options.draws, options.timeout, options.jobs))))


if __name__ == "__main__":
    main()
