"""All tables of docs/performance.md, by one command: ``python -m benchmarks`` from the project's folder.

``python -m benchmarks rims kernel`` makes some groups of tables only; ``--help`` names them. Tables in Markdown go to
stdout as they are done, progress to stderr. ``--write`` also puts them, and the machine, into their places in
docs/performance.md; tables that have no place there are printed only.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

from benchmarks import (
    chain_sweep,
    corner_part_scores,
    everyday_scores,
    irit_table,
    native,
    random_corners,
    real_scores,
    start_up,
    strips,
    surface_blends,
)
from benchmarks.tables import MACHINE, Table, describe_machine, replace_blocks

DOCUMENT = Path(__file__).parents[1] / "docs" / "performance.md"


OTHER_GROUPS: dict[str, Callable[[native.Settings], Iterable[Table]]] = {
    "scores": lambda settings: real_scores.tabulate_folder(settings.cases, settings.timeout),
    "everyday": lambda settings: everyday_scores.tabulate(settings.timeout),
    "chains": lambda settings: chain_sweep.tabulate_families(settings.timeout),
    "corners": lambda settings: random_corners.tabulate_families(settings.timeout),
    "corner_parts": lambda settings: corner_part_scores.tabulate(settings.timeout, settings.cases),
    "surface_blends": lambda _: surface_blends.tabulate(),
    "kernel": lambda _: [irit_table.tabulate()],
    "unrolling": lambda _: strips.tabulate(),
    "start_up": lambda _: [start_up.tabulate()],
}
"""What makes the tables of each group beside those of `benchmarks.native`."""


def make_tables(groups: Sequence[str], settings: native.Settings) -> Iterator[Table]:
    """Yield the tables of some groups as they are done."""
    against_native = [name for name in groups if name in native.GROUPS]
    if against_native:
        yield from native.tabulate(against_native, settings)
    for name in groups:
        if name in OTHER_GROUPS:
            yield from OTHER_GROUPS[name](settings)


def main() -> None:
    names = [*native.GROUPS, *OTHER_GROUPS]
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Measure how fast cqblend is.")
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=f"{', '.join(names)}; by default all of them")
    parser.add_argument("--write", action="store_true", help=f"put the tables into {DOCUMENT.name}")
    parser.add_argument("--cases", type=Path, default=native.DEFAULTS.cases, help="folder with real parts")
    parser.add_argument("--draws", type=int, default=native.DEFAULTS.draws, help="of each random family")
    options = parser.parse_args()
    unknown = ", ".join(sorted(set(options.groups) - set(names)))
    if unknown:
        parser.error(f"there is no group {unknown}")
    print(describe_machine(), flush=True)
    for table in make_tables(options.groups or names, native.Settings(options.cases, options.draws)):
        print(f"\n{table.name}\n\n{table}", flush=True)
        if options.write:  # at once, since the whole takes long
            blocks = {table.name: str(table), MACHINE: describe_machine()}
            DOCUMENT.write_text(replace_blocks(DOCUMENT.read_text(encoding="utf-8"), blocks), encoding="utf-8")


if __name__ == "__main__":
    main()
