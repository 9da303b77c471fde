"""CPU times of a job in this process: medians, and not time on the clock, since machines do other things as well."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import TypeVar

ResultT = TypeVar("ResultT")

LONGEST = 2.0  # s: a job is not repeated any more once it has taken so long in all


def run_timed(job: Callable[[], ResultT], repeats: int = 5) -> tuple[ResultT, float]:
    """Run a job some times, and return its last result and its median CPU time, ms.

    The first run does not count, since it may load modules, unless it takes long or there are no repeats.
    """
    result, first = _run_once(job)
    times = [first] if first >= LONGEST or repeats == 0 else []
    while len(times) < repeats and sum(times) < LONGEST:
        result, once = _run_once(job)
        times.append(once)
    return result, 1e3 * statistics.median(times)


def measure_cpu(job: Callable[[], object], repeats: int = 5) -> float:
    """Return the median CPU time of a job, ms."""
    return run_timed(job, repeats)[1]


def _run_once(job: Callable[[], ResultT]) -> tuple[ResultT, float]:
    start = time.process_time()
    result = job()
    return result, time.process_time() - start
