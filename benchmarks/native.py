"""The same edges and radii by cqblend and by OCCT's native fillet, in one run.

Run ``python -m benchmarks.native`` from the project's folder. Three groups: the first draws of the random families,
edges of real STEP parts (``--cases`` names a folder with ``edges.json`` and the files it lists; left out if there is
none), and fillets known to fail natively. Each line gives what became of it, the change of volume (mm^3), the largest
normal angle along the rails (rad), the largest tolerance of a new edge (mm) and the median time of three (ms). "ok"
means a valid solid: all that is new passes BRepCheck's exact mode, shells are closed, nothing is inside out or folds
over. cqblend's times include its own verification and certificate, native times nothing of the kind.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from benchmarks.attempts import Outcome, attempt, blended, native
from benchmarks.cases import Trial, failing, families, real

HEAD = f"{'':24s}{'radius':>9s}  " + "  ".join(
    f"{name:<18s}{'volume':>11s}{'angle':>9s}{'toler.':>9s}{'ms':>8s}" for name in ("native", "cqblend")
)


def main() -> None:
    parser = argparse.ArgumentParser(description="Compare cqblend with OCCT's native fillet.")
    parser.add_argument("--cases", type=Path, default=Path(__file__).parents[2] / "shared" / "cases")
    parser.add_argument("--draws", type=int, default=5, help="of each random family")
    parser.add_argument("--timeout", type=float, default=60.0, help="s, of one attempt")
    parser.add_argument("--groups", default="families,real,failing")
    parser.add_argument("--messages", action="store_true", help="print what went wrong")
    options = parser.parse_args()
    groups = options.groups.split(",")
    if "families" in groups:
        compare("random families", families(options.draws), options)
    if "real" in groups and (options.cases / "edges.json").exists():
        compare("edges of real parts", real(options.cases), options)
    if "failing" in groups:
        compare("fillets known to fail", failing(), options)


def compare(title: str, trials: Iterable[Trial], options: argparse.Namespace) -> None:
    """Run a group and print its table and its summary."""
    print(f"\n{title}\n{HEAD}")
    results: list[tuple[Trial, Outcome, Outcome]] = []
    for trial in trials:
        arguments = (trial.shape, trial.edges, trial.radius)
        theirs = attempt(trial.shape, native(*arguments), options.timeout)
        ours = attempt(trial.shape, blended(*arguments), options.timeout)
        results.append((trial, theirs, ours))
        print(f"{trial.name:24s}{trial.radius:9.4g}  {_row(theirs)}  {_row(ours)}", flush=True)
        if options.messages:
            said = (("native", theirs.message), ("cqblend", ours.message))
            print("".join(f"    {name}: {message}\n" for name, message in said if message), end="")
    _summarise(results)


def _row(outcome: Outcome) -> str:
    if math.isnan(outcome.seconds):
        return f"{outcome.status:<55s}"
    figures = f"{outcome.change:11.4g}{outcome.angle:9.1e}{outcome.tolerance:9.1e}{outcome.seconds * 1e3:8.1f}"
    return f"{outcome.status:<18s}{figures}"


def _summarise(results: list[tuple[Trial, Outcome, Outcome]]) -> None:
    for name, outcomes in (("native", [row[1] for row in results]), ("cqblend", [row[2] for row in results])):
        counts = ", ".join(f"{status} {count}" for status, count in Counter(o.status for o in outcomes).most_common())
        angle = max((o.angle for o in outcomes if o.ok), default=math.nan)
        tolerance = max((o.tolerance for o in outcomes if o.ok), default=math.nan)
        print(f"{name:8s} of {len(results)}: {counts}; valid ones: angle <= {angle:.1e}, tolerance <= {tolerance:.1e}")
    both = [ours.seconds / theirs.seconds for _, theirs, ours in results if theirs.ok and ours.ok]
    if both:
        mean = math.exp(sum(map(math.log, both)) / len(both))
        print(f"time cqblend / native, {len(both)} valid in both: {mean:.2f} (geometric mean), at most {max(both):.2f}")
    owned = {trial.name: trial.freeform for trial, theirs, ours in results if ours.ok and not theirs.ok}
    lost = {trial.name for trial, theirs, ours in results if theirs.ok and not ours.ok}
    print(f"only cqblend: {len(owned)} joints, {sum(owned.values())} of them freeform; only native: {len(lost)}")


if __name__ == "__main__":
    main()
