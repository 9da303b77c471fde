"""Every edge of random bodies in one call: what comes of it, and of OCCT's native fillet of the same edges.

Run ``python -m benchmarks.random_corners`` from the project's folder; ``--count`` and ``--family`` choose draws. For
each family of `benchmarks.corner_bodies`: how many draws come back complete, as `benchmarks.corner_scores` judges it,
and what became of the rest; the largest gap (mm) and angle (rad) of their smooth edges, how many faces they have and
how long they took (s), beside native. "Tight" are draws that are refused and in which rails use up an edge
by the angles at the vertices alone. Every draw has a line on stderr, with the family and the number that draw it again.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import cqblend
from benchmarks.attempts import EXACT, Made, Outcome, attempt, native
from benchmarks.blend_scores import Blended, Limits
from benchmarks.corner_bodies import FAMILIES, CornerCase, Family, draw_corners
from benchmarks.corner_scores import CornerScore, check_crossings, measure_volume, score_corners, score_fillet
from benchmarks.corner_volumes import Volume, expect_volume
from benchmarks.tables import Table

LIMITS = Limits(gap=1e-9, angle=1e-8)
"""What joints of exact blends are to reach."""
VERDICTS = ("complete", "tight", "incomplete", "refused", "failed", "unsound")
DRAWS = 30
"""Draws of each family that make three hundred in all."""


@dataclass(frozen=True)
class CornerOutcome:
    """What became of a draw by cqblend and by OCCT's native fillet."""

    case: CornerCase
    verdict: str
    ours: Outcome
    theirs: Outcome

    @property
    def scores(self) -> tuple[CornerScore | None, CornerScore | None]:
        """The scores of both, where there is one."""
        ours, theirs = self.ours.score, self.theirs.score
        return ours if isinstance(ours, CornerScore) else None, theirs if isinstance(theirs, CornerScore) else None

    @property
    def volume_difference(self) -> float:
        """By how much the volumes differ, as a share of the change by native, if that is valid."""
        ours, theirs = self.scores
        if ours is None or theirs is None or theirs.verdict != "complete":
            return math.nan
        return (ours.volume - theirs.volume) / abs(theirs.volume - measure_volume(self.case.body.wrapped))

    def __str__(self) -> str:
        ours, theirs = self.scores
        one = f"{self.case.name:20s} {len(self.case.edges):3d} edges, r = {self.case.radius:<7.4g} {self.verdict:10s}"
        made = f" {ours.faces} faces, {ours.angle:.1e} rad, {ours.gap:.1e} mm" if ours else ""
        other = f"{self.theirs.verdict} {theirs.faces} faces, {theirs.sharp} sharp" if theirs else self.theirs.status
        times = f"{self.ours.ms / 1e3:.2f} s, native {self.theirs.ms / 1e3:.2f} s {other}"
        difference = self.volume_difference
        volume = "" if math.isnan(difference) else f", volumes differ by {difference:.1e} of the change"
        tight = f" [{self.case.tight}]" if self.case.tight else ""
        return f"{one}{made} {times}{volume}{tight} {self.ours.reason}"


def run_draw(family: Family, number: int, timeout: float, *, crossings: bool = False) -> CornerOutcome:
    """Draw a body, blend all its edges both ways, and judge what comes out."""
    case = draw_corners(family, number)
    shape, edges = case.body.wrapped, [edge.wrapped for edge in case.edges]
    expected = expect_volume(shape, edges, case.radius)
    ours = attempt(
        shape, lambda: blend_all(case), timeout, lambda made: judge(case, made, expected, crossings=crossings)
    )

    def judge_native(made: Made) -> CornerScore:
        return score_fillet(Blended(shape, edges, case.radius, made.shape, made.faces), expected)

    theirs = attempt(shape, native(shape, edges, case.radius), timeout, judge_native)
    verdict = "tight" if ours.verdict == "refused" and case.tight else ours.verdict
    return CornerOutcome(case, verdict, ours, theirs)


def blend_all(case: CornerCase) -> Made:
    """Blend every edge of a body, smooth ones and seams among them."""
    result = cqblend.blend_edges(case.body, case.body.Edges(), case.radius)
    if abs(result.certificate.coverage - 1) > 1e-12:
        raise AssertionError(f"the certificate has a coverage of {result.certificate.coverage}")
    promise = EXACT if result.certificate.form == "exact" else 1e-5
    return Made(result.shape.wrapped, [face.wrapped for face in result.faces], promise)


def judge(case: CornerCase, made: Made, expected: Volume, *, crossings: bool) -> CornerScore:
    """Return the score of a blend of all edges of a drawn body."""
    shape, edges = case.body.wrapped, [edge.wrapped for edge in case.edges]
    limits = LIMITS if made.promise <= EXACT else Limits(angle=made.promise)
    score = score_corners(Blended(shape, edges, case.radius, made.shape, made.faces), limits, expected)
    if crossings:
        return replace(score, unsound=(*score.unsound, *check_crossings(made.shape)))
    return score


def tabulate_families(timeout: float) -> Iterator[Table]:
    """Yield the table of all families, three hundred draws."""
    drawn = [(family, number) for family in FAMILIES for number in range(DRAWS)]
    yield tabulate(list(sweep(drawn, timeout)))


def sweep(
    draws: Sequence[tuple[Family, int]], timeout: float, jobs: int = 1, *, crossings: bool = False
) -> Iterator[CornerOutcome]:
    """Yield what becomes of some draws; tell on stderr of each."""
    with ThreadPoolExecutor(jobs) as pool:
        for outcome in pool.map(lambda draw: run_draw(*draw, timeout, crossings=crossings), draws):
            print(outcome, file=sys.stderr, flush=True)
            yield outcome


def tabulate(outcomes: Sequence[CornerOutcome]) -> Table:
    """Return how many draws of each family have which verdict."""
    families = dict.fromkeys(one.case.family for one in outcomes)
    rows = [_summarise(name.replace("_", " "), [x for x in outcomes if x.case.family == name]) for name in families]
    columns = ("all edges of", "draws", *VERDICTS, "native complete", "gap, mm", "angle, rad", "faces", "native faces")
    return Table("corners", (*columns, "s", "native s"), [*rows, _summarise("all", outcomes)])


def _summarise(title: str, outcomes: Sequence[CornerOutcome]) -> list[str | float]:
    counts = [sum(one.verdict == verdict for one in outcomes) for verdict in VERDICTS]
    whole = [one for one in outcomes if one.verdict == "complete"]
    gap, angle = (
        f"{max((getattr(one.ours, name) for one in whole), default=math.nan):.0e}"
        for name in ("joint_gap", "joint_angle")
    )
    both = [one.scores for one in whole if one.theirs.verdict == "complete"]
    faces = [sum(pair[n].faces for pair in both if pair[n] is not None) for n in (0, 1)]  # type: ignore[union-attr]
    times = [
        statistics.median(getattr(one, who).ms / 1e3 for one in whole) if whole else math.nan
        for who in ("ours", "theirs")
    ]
    theirs = sum(one.theirs.verdict == "complete" for one in outcomes)
    return [title, len(outcomes), *counts, theirs, gap, angle, *faces, *times]


def main() -> None:
    parser = argparse.ArgumentParser(description="Blend every edge of random bodies.")
    parser.add_argument("--count", type=int, default=DRAWS, help="draws of each family")
    parser.add_argument("--first", type=int, default=0, help="number of the first draw")
    parser.add_argument("--family", default="", help="only families whose name contains this")
    parser.add_argument("--timeout", type=float, default=120.0, help="s, of one attempt")
    parser.add_argument("--jobs", type=int, default=1, help="attempts at the same time")
    parser.add_argument("--crossings", action="store_true", help="ask OCCT's Boolean operations, too: slow")
    options = parser.parse_args()
    families = [family for family in FAMILIES if options.family in family.__name__]
    numbers = range(options.first, options.first + options.count)
    draws = [(family, number) for family in families for number in numbers]
    print(tabulate(list(sweep(draws, options.timeout, options.jobs, crossings=options.crossings))))


if __name__ == "__main__":
    main()
