"""What becomes of the edges of real parts: complete, incomplete, refused, impossible or unsound.

Run ``python -m benchmarks.real_scores`` from the project's folder. Every listed edge is blended with the default
options, its whole chain, in a process of its own. `benchmarks.blend_scores` judges what comes out, and where nothing
complete does, `benchmarks.impossible` looks for a witness that nothing could; neither uses the library. A line for each
edge goes to stderr, the table to stdout.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from benchmarks.attempts import Made, attempt, blended
from benchmarks.blend_scores import Blended, Limits, Score, score_blend
from benchmarks.impossible import find_witness
from benchmarks.native import DEFAULTS
from benchmarks.real_edges import RealEdge, read_listed_edges
from benchmarks.tables import Table

VERDICTS = ("complete", "impossible", "incomplete", "refused", "failed", "unsound")
"""What may become of an edge; failed are crashes, timeouts, and errors that are not the library's."""


@dataclass(frozen=True)
class ScoredEdge:
    """What became of an edge: a verdict of `VERDICTS`, and why."""

    listed: RealEdge
    verdict: str
    message: str

    def __str__(self) -> str:
        return f"{self.listed.name:20s}{self.listed.radius:10.4g}  {self.verdict:12s}{self.message}"


def score_edge(listed: RealEdge, timeout: float) -> ScoredEdge:
    """Blend an edge, judge the result, and look for a witness where it is not complete."""

    def judge(made: Made) -> Score:
        result = Blended(listed.shape, [listed.edge], listed.radius, made.shape, made.faces)
        return score_blend(result, Limits(angle=made.promise))

    outcome = attempt(listed.shape, blended(listed.shape, [listed.edge], listed.radius), timeout, judge)
    verdict, message = outcome.verdict, outcome.reason
    if verdict in ("incomplete", "refused", "failed"):
        witness = find_witness(listed.shape, listed.edge, listed.radius)
        if witness is not None:
            return ScoredEdge(listed, "impossible", f"{witness}; {message}")
    return ScoredEdge(listed, verdict, message)


def tabulate(scored: Sequence[ScoredEdge]) -> Table:
    """Return how many edges of each part have which verdict, and the share of complete ones of those that can be."""
    parts = {one.listed.part: None for one in scored}
    rows = [_count_verdicts(part, [one for one in scored if one.listed.part == part]) for part in parts]
    columns = ("edges of", "attempts", *VERDICTS, "complete of possible")
    return Table("scores", columns, [*rows, _count_verdicts("all", scored)])


def _count_verdicts(title: str, scored: Sequence[ScoredEdge]) -> Sequence[str | float]:
    counts = [sum(one.verdict == verdict for one in scored) for verdict in VERDICTS]
    possible = len(scored) - counts[VERDICTS.index("impossible")]
    return [title, len(scored), *counts, f"{counts[0] / possible:.0%}" if possible else ""]


def score_edges(edges: Iterable[RealEdge], timeout: float, jobs: int) -> list[ScoredEdge]:
    """Score edges, several at the same time, and tell on stderr what becomes of each."""
    with ThreadPoolExecutor(jobs) as pool:
        found = []
        for one in pool.map(lambda listed: score_edge(listed, timeout), edges):
            print(one, file=sys.stderr, flush=True)
            found.append(one)
    return found


def tabulate_folder(folder: Path, timeout: float) -> list[Table]:
    """Return the table of all listed edges of a folder; none if they are not there."""
    if not (folder / "edges.json").exists():
        return []
    return [tabulate(score_edges(read_listed_edges(folder), timeout, jobs=1))]


def main() -> None:
    parser = argparse.ArgumentParser(description="Judge blends of edges of real parts.")
    parser.add_argument("cases", nargs="?", type=Path, default=DEFAULTS.cases, help="folder with edges.json")
    parser.add_argument("--part", default="", help="only parts whose name begins so")
    parser.add_argument("--timeout", type=float, default=DEFAULTS.timeout, help="s, of one attempt")
    parser.add_argument("--jobs", type=int, default=1, help="attempts at the same time")
    options = parser.parse_args()
    edges = [one for one in read_listed_edges(options.cases) if one.part.startswith(options.part)]
    print(tabulate(score_edges(edges, options.timeout, options.jobs)))


if __name__ == "__main__":
    main()
