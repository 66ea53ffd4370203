"""Work on several processors at once, where numpy lets other threads run."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

# More threads wait for one another more than they work.
_MOST = 4

T = TypeVar("T")


def processors() -> int:
    """How many processors this process may use, as far as is known."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def in_threads(jobs: Sequence[Callable[[], T]]) -> list[T]:
    """Do jobs, some at once; what comes of them is in their order, however many threads there are.

    Parameters
    ----------
    jobs : sequence of callables
        Pure, and long operations of numpy for the most part.
    """
    count = min(_MOST, processors(), len(jobs))
    if count < 2:
        return [job() for job in jobs]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(lambda job: job(), jobs))
