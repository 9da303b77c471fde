"""How long ``import cqblend`` and ``cqblend --help`` take, beyond Python itself.

Run ``python -m benchmarks.start_up`` from the project's folder. Each row is a fresh process: its CPU time, and that
beyond a process that does nothing. Medians.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys

from benchmarks.tables import Table

RUNS = 9

COMMANDS = {
    "Python alone": ["-c", "pass"],
    "`import cqblend`": ["-c", "import cqblend"],
    "`cqblend --help`": ["-m", "cqblend", "--help"],
    "`import numpy`": ["-c", "import numpy"],
    "`import cadquery`": ["-c", "import cadquery"],
}


def measure_process(arguments: list[str]) -> float:
    """Return the CPU time of a fresh interpreter, ms."""
    with subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{arguments} failed")
    return 1e3 * (usage.ru_utime + usage.ru_stime)


def tabulate() -> Table:
    """Return the table of all commands."""
    times = [
        (name, statistics.median(measure_process(command) for _ in range(RUNS))) for name, command in COMMANDS.items()
    ]
    bare = times[0][1]
    rows = [[name, ms, ms - bare] for name, ms in times]
    return Table("start_up", ("a fresh process", "CPU, ms", "beyond Python, ms"), rows)


if __name__ == "__main__":
    print(tabulate())
