"""Measure the time of each stage of a run, and report progress."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str], None]


class Stopwatch:
    """Seconds of each stage; calls ``progress`` when a stage begins."""

    def __init__(self, progress: Progress | None = None) -> None:
        self.seconds: dict[str, float] = {}
        self._progress = progress

    @contextmanager
    def __call__(self, name: str, amount: str = "") -> Iterator[None]:
        """Time the enclosed stage; ``progress`` is called with ``name`` or ``name: amount``."""
        if self._progress is not None:
            self._progress(f"{name}: {amount}" if amount else name)
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = time.perf_counter() - start
