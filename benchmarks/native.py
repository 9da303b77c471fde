"""The same edges and radii by cqblend and by OCCT's native fillet, in one run.

Run ``python -m benchmarks.native`` from the project's folder; ``--groups`` chooses some of `GROUPS`. The tables go to
stdout: CPU times, medians of several runs of the one operation, and their ratio, cqblend over native, where both make a
solid, a native one valid or not. cqblend's times include its own verification and certificate, native times nothing of
the kind. The last table tells what became of all edges.

While it works, a line for each edge goes to stderr: what became of it, the change of volume (mm^3), the largest normal
angle along the rails (rad), the largest tolerance of a new edge (mm) and the time (ms). "ok" means a valid solid: all
that is new passes BRepCheck's exact mode, shells are closed, nothing is inside out or folds over.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cadquery as cq

from benchmarks.attempts import Operation, Outcome, attempt, blended, native
from benchmarks.bodies import (
    FAMILIES,
    angle_bracket,
    box,
    cylinder_cap,
    freeform_top,
    loft,
    sphere_and_boss,
    sphere_with_hole,
)
from benchmarks.cases import Trial, draw_family, failing, real
from benchmarks.plain_cases import (
    circular_joints,
    edges_of_many_faces,
    hole_rims,
    one_of_many_holes,
    rim_around_holes,
    straight_joints,
)
from benchmarks.tables import Table

CASES = Path(__file__).parents[2] / "shared" / "cases"
"""Folder with real parts, as a checkout may have beside it."""

MAIN_FAMILIES = (cylinder_cap, box, sphere_and_boss, sphere_with_hole, angle_bracket, freeform_top, loft)
"""Families of which the median is taken; of the others the outcome counts more than the time."""

RIM_COUNTS = (1, 4, 16, 64)
PLATE_HOLES = (625, 961)

TIMES = ("native, ms", "cqblend, ms", "ratio", "largest")


@dataclass(frozen=True)
class Settings:
    """How trials are run: where real parts are, how many draws of each family, and what one attempt may take, s."""

    cases: Path = CASES
    draws: int = 4
    timeout: float = 120.0


DEFAULTS = Settings()


@dataclass(frozen=True)
class Comparison:
    """What became of a trial natively and by cqblend."""

    trial: Trial
    theirs: Outcome
    ours: Outcome

    @property
    def ratio(self) -> float:
        """Time of cqblend over that of native fillet; NaN if not both make a solid, or cqblend's is not valid."""
        return self.ours.ms / self.theirs.ms if self.theirs.made and self.ours.ok else math.nan


def compare(trials: Iterable[Trial], settings: Settings) -> list[Comparison]:
    """Run trials both ways, and tell on stderr what becomes of each."""
    made = []
    for trial in trials:
        arguments = (trial.shape, trial.edges, trial.radius)
        theirs = attempt(trial.shape, native(*arguments), settings.timeout)
        ours = attempt(trial.shape, blended(*arguments), settings.timeout)
        made.append(Comparison(trial, theirs, ours))
        for name, outcome in (("native", theirs), ("cqblend", ours)):
            print(f"{trial.name:40s}{trial.radius:9.4g}  {name:8s}{_describe(outcome)}", file=sys.stderr, flush=True)
    return made


def _describe(outcome: Outcome) -> str:
    if math.isnan(outcome.change):
        return f"{outcome.status:<18s}{outcome.ms:9.1f}  {outcome.message}"
    return (
        f"{outcome.status:<18s}{outcome.ms:9.1f}{outcome.change:12.4g}{outcome.angle:9.1e}{outcome.tolerance:9.1e}"
        f"  {outcome.message}"
    )


# -- what the tables show


def summarise_times(title: str, compared: Sequence[Comparison]) -> list[str | float]:
    """Return a row: medians of both times and of the ratio, and the largest ratio, where both make a solid."""
    both = [one for one in compared if not math.isnan(one.ratio)]
    if not both:
        return [title, *[math.nan] * len(TIMES)]
    ratios = [one.ratio for one in both]
    theirs, ours = ([getattr(one, name).ms for one in both] for name in ("theirs", "ours"))
    return [title, statistics.median(theirs), statistics.median(ours), statistics.median(ratios), max(ratios)]


def summarise_outcomes(title: str, compared: Sequence[Comparison]) -> list[str | float]:
    """Return a row: how many trials there are, and what became of them."""
    ours = [one.ours for one in compared if one.ours.ok]
    alone = [one.trial for one in compared if one.ours.ok and not one.theirs.ok]
    return [
        title,
        len(compared),
        sum(one.theirs.ok for one in compared),
        len(ours),
        sum(one.theirs.ok and not one.ours.ok for one in compared),
        f"{len(alone)} ({sum(trial.freeform for trial in alone)})",
        sum(one.ours.status == "invalid" for one in compared),
        f"{max((one.angle for one in ours), default=math.nan):.0e}",
        f"{max((one.tolerance for one in ours), default=math.nan):.0e}",
    ]


def measure_step_size(operation: Operation) -> float:
    """Return the size of the STEP file that CadQuery writes of what an operation makes, kB."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "made.step"
        cq.exporters.export(cq.Workplane(cq.Shape.cast(operation().shape)), str(path))
        return path.stat().st_size / 1e3


# -- the groups


def tabulate_families(settings: Settings) -> tuple[Table, list[Comparison]]:
    """Compare one edge of random bodies, by family."""
    rows, main, others = [], [], []
    for family in (*MAIN_FAMILIES, *(one for one in FAMILIES if one not in MAIN_FAMILIES)):
        compared = compare(draw_family(family, settings.draws), settings)
        (main if family in MAIN_FAMILIES else others).extend(compared)
        rows.append(summarise_times(family.__name__.replace("_", " "), compared))
    rows.append(summarise_times(f"the first {len(MAIN_FAMILIES)} of these", main))
    return Table("families", ("one edge of a", *TIMES), rows), main + others


def tabulate_plain_joints(settings: Settings) -> tuple[Table, list[Comparison]]:
    """Compare straight and circular joints; what is made is written to STEP files."""
    rows, everything = [], []
    for title, trials in (("straight joints", straight_joints()), ("circular joints", circular_joints())):
        compared = compare(trials, settings)
        for one in compared:
            trial = one.trial
            makers = (make(trial.shape, trial.edges, trial.radius) for make in (native, blended))
            sizes = [measure_step_size(make) if one.ours.ok else math.nan for make in makers]
            rows.append([*summarise_times(trial.name, [one])[:-1], *sizes])
        rows.append([*summarise_times(f"all {title}", compared)[:-1], math.nan, math.nan])
        everything += compared
    return Table("joints", ("one edge between", *TIMES[:-1], "native, kB", "cqblend, kB"), rows), everything


def tabulate_real(settings: Settings) -> tuple[Table, list[Comparison]]:
    """Compare edges of real parts, by part."""
    by_part: dict[str, list[Comparison]] = {}
    for one in compare(real(settings.cases), settings) if (settings.cases / "edges.json").exists() else []:
        by_part.setdefault(one.trial.name.split()[0], []).append(one)
    everything = [one for compared in by_part.values() for one in compared]
    rows = []
    for title, compared in (*by_part.items(), *([("all", everything)] if everything else [])):
        counts = (len(compared), sum(not math.isnan(one.ratio) for one in compared))
        rows.append([title, *counts, *summarise_times(title, compared)[1:], max(one.ours.ms for one in compared)])
    columns = ("edges of", "attempts", "both made", *TIMES, "slowest attempt of cqblend, ms")
    return Table("real", columns, rows), everything


def tabulate_rims(settings: Settings) -> tuple[Table, list[Comparison]]:
    """Compare rims of many holes in one call: the time of each."""
    compared = compare(map(hole_rims, RIM_COUNTS), settings)
    rows: list[list[str | float]] = [
        [one.trial.name, *(outcome.ms / len(one.trial.edges) for outcome in (one.theirs, one.ours)), one.ratio]
        for one in compared
    ]
    return Table("rims", ("in one call", "native, ms an edge", "cqblend, ms an edge", "ratio"), rows), compared


def tabulate_large_bodies(settings: Settings) -> tuple[Table, list[Comparison]]:
    """Compare one edge of bodies with many faces or a face with many wires."""
    with tempfile.TemporaryDirectory() as folder:
        trials = [*(one_of_many_holes(count, Path(folder)) for count in PLATE_HOLES), *edges_of_many_faces()]
        trials.append(rim_around_holes())
    compared = compare(trials, settings)
    rows = [summarise_times(one.trial.name, [one])[:-1] for one in compared]
    return Table("large_bodies", ("one edge", *TIMES[:-1]), rows), compared


def tabulate_failing(settings: Settings) -> tuple[Table, list[Comparison]]:
    """Compare fillets that are known to fail natively."""
    compared = compare(failing(), settings)
    rows = [[one.trial.name, f"{one.trial.radius:g}", one.theirs.status, one.ours.status] for one in compared]
    return Table("failing", ("known to fail", "radius, mm", "native", "cqblend"), rows), compared


GROUPS: dict[str, Callable[[Settings], tuple[Table, list[Comparison]]]] = {
    "families": tabulate_families,
    "joints": tabulate_plain_joints,
    "real": tabulate_real,
    "rims": tabulate_rims,
    "large_bodies": tabulate_large_bodies,
    "failing": tabulate_failing,
}
"""What can be compared, by name."""


def tabulate(groups: Sequence[str], settings: Settings) -> Iterator[Table]:
    """Yield the table of each group, and in the end what became of all their edges."""
    outcomes = []
    for name in groups:
        table, compared = GROUPS[name](settings)
        yield table
        outcomes.append(summarise_outcomes(name.replace("_", " "), compared))
    columns = (
        "edges",
        "attempts",
        "native ok",
        "cqblend ok",
        "only native",
        "only cqblend (freeform)",
        "cqblend invalid",
        "angle, rad",
        "tolerance, mm",
    )
    yield Table("outcomes" if set(groups) == set(GROUPS) else "some_outcomes", columns, outcomes)


def main() -> None:
    parser = argparse.ArgumentParser(description="Compare cqblend with OCCT's native fillet.")
    parser.add_argument("--cases", type=Path, default=DEFAULTS.cases, help="folder with edges.json and edges_more.json")
    parser.add_argument("--draws", type=int, default=DEFAULTS.draws, help="of each random family")
    parser.add_argument("--timeout", type=float, default=DEFAULTS.timeout, help="s, of one attempt")
    parser.add_argument("--groups", default=",".join(GROUPS))
    options = parser.parse_args()
    settings = Settings(options.cases, options.draws, options.timeout)
    for table in tabulate(options.groups.split(","), settings):
        print(f"\n{table}", flush=True)


if __name__ == "__main__":
    main()
