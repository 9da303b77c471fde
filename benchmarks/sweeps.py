"""How often cqblend succeeds on random bodies, and how exact it is when it does.

Run ``python -m benchmarks.sweeps`` from the project's folder. For each family of :mod:`benchmarks.bodies`: the share of
draws that come back valid (as in :mod:`benchmarks.native`), how many come back invalid, the largest normal angle (rad)
and new edge tolerance (mm) among the valid ones, the median CPU time (ms), and the typed errors of the rest. Anything
untyped is a bug, and so is a crash.
"""

from __future__ import annotations

import argparse
import math
import statistics
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from benchmarks.attempts import Outcome, attempt, blended
from benchmarks.bodies import FAMILIES, Case, Rng, draw


def main() -> None:
    parser = argparse.ArgumentParser(description="Blend random bodies.")
    parser.add_argument("draws", nargs="?", type=int, default=40, help="of each family")
    parser.add_argument("--family", default="", help="only families whose name contains this")
    parser.add_argument("--form", default="auto", choices=("auto", "exact", "compact"))
    parser.add_argument("--timeout", type=float, default=120.0, help="s, of one attempt")
    parser.add_argument("--jobs", type=int, default=1, help="attempts at the same time")
    options = parser.parse_args()
    print(f"{'':20s}{'valid':>8s}{'invalid':>9s}{'angle':>10s}{'toler.':>10s}{'median ms':>11s}")
    for family in FAMILIES:
        if options.family in family.__name__:
            sweep(family, options)


def sweep(family: Callable[[Rng], Case], options: argparse.Namespace) -> None:
    """Run one family and print its line, and one for each draw that failed."""

    def run(number: int) -> Outcome:
        case = draw(family, number)
        operation = blended(case.body.wrapped, [case.edge.wrapped], case.radius, options.form)
        return attempt(case.body.wrapped, operation, options.timeout)

    with ThreadPoolExecutor(options.jobs) as pool:
        outcomes = list(pool.map(run, range(options.draws)))
    good = [outcome for outcome in outcomes if outcome.ok]
    angle, tolerance = (max((getattr(o, name) for o in good), default=math.nan) for name in ("angle", "tolerance"))
    ms = statistics.median(o.ms for o in good) if good else math.nan
    share, invalid = len(good) / len(outcomes), sum(outcome.status == "invalid" for outcome in outcomes)
    print(f"{family.__name__:20s}{share:8.1%}{invalid:9d}{angle:10.1e}{tolerance:10.1e}{ms:11.0f}", flush=True)
    for number, outcome in enumerate(outcomes):
        if not outcome.ok:
            print(f"    {number}: {outcome.status}: {outcome.message}", flush=True)


if __name__ == "__main__":
    main()
