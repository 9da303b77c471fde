"""What becomes of chains on parts as people draw them: a line for each part of `benchmarks.everyday_parts`."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.attempts import EXACT, Made, attempt, blended
from benchmarks.blend_scores import Blended, Limits, Score, score_blend
from benchmarks.everyday_parts import PARTS, Maker
from benchmarks.tables import Table


def tabulate(timeout: float) -> Iterator[Table]:
    """Yield the table of all parts."""
    rows = [_try_part(maker, timeout) for maker in PARTS]
    yield Table("everyday", ("part", "cells", "radius, mm", "ms", "verdict", "why"), rows)


def _try_part(maker: Maker, timeout: float) -> list[str | float]:
    part = maker()
    body, edges = part.body.val().wrapped, [edge.wrapped for edge in part.edges]

    def judge(made: Made) -> Score:
        limits = Limits(gap=1e-9, angle=1e-10) if made.promise <= EXACT else Limits(angle=made.promise)
        return score_blend(Blended(body, edges, part.radius, made.shape, made.faces), limits)

    outcome = attempt(body, blended(body, edges, part.radius), timeout, judge)
    name = maker.__name__.replace("_", " ")
    return [name, part.cells, part.radius, outcome.ms, outcome.verdict, outcome.reason]
