"""Run functions in several threads; useful for numpy operations that release the GIL."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

# With more threads, waiting outweighs the gain.
_MOST = 4

T = TypeVar("T")


def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def in_threads(jobs: Sequence[Callable[[], T]]) -> list[T]:
    """Results of jobs, in the order of the jobs; some run at the same time.

    Parameters
    ----------
    jobs : sequence of callables
        Pure functions that mostly run long numpy operations.
    """
    count = min(_MOST, processors(), len(jobs))
    if count < 2:
        return [job() for job in jobs]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(lambda job: job(), jobs))
