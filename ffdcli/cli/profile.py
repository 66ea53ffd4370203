"""Time and peak memory of each stage, for `--profile`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class StageUse:
    """Resources that a stage has used.

    Parameters
    ----------
    name : str
    seconds : float
    peaks : tuple of int or None, bytes
        Peak memory of each process; None if unknown.
    """

    name: str
    seconds: float
    peaks: tuple[int | None, ...]


class Profile:
    """Measures each stage from its beginning to the beginning of the next one.

    Peak memory is measured on Linux only, where the peak of a process can be reset.

    Parameters
    ----------
    processes : tuple of int
        Ids of the processes to measure.
    progress : callable
        Called with the name of each stage.
    """

    def __init__(self, processes: tuple[int, ...], progress: Callable[[str], None]) -> None:
        self.stages: list[StageUse] = []
        self._processes, self._progress = processes, progress
        self._name: str | None = None
        self._begun = time.perf_counter()

    def __call__(self, name: str) -> None:
        """End the previous stage and begin this one."""
        self.end()
        self._progress(name)
        self._name, self._begun = name.partition(":")[0], time.perf_counter()
        for process in self._processes:
            _reset_peak(process)

    def end(self) -> None:
        """End the current stage."""
        if self._name is not None:
            seconds = time.perf_counter() - self._begun
            peaks = tuple(_peak(process) for process in self._processes)
            self.stages.append(StageUse(self._name, seconds, peaks))
        self._name = None

    def as_json(self) -> list[dict[str, Any]]:
        """Stages for the report, with peaks of this process and of the OpenCascade process."""
        names = ("peak_bytes", "kernel_peak_bytes")
        return [
            {"stage": stage.name, "seconds": round(stage.seconds, 4)}
            | dict(zip(names, stage.peaks, strict=False))
            for stage in self.stages
        ]

    def as_text(self) -> str:
        """Stages as a table."""
        lines = ["stage                seconds   peak MB"]
        if len(self._processes) > 1:
            lines[0] += "  OpenCascade's"
        for stage in self.stages:
            values = ["-" if peak is None else f"{peak / 1e6:.0f}" for peak in stage.peaks]
            peaks = [f"{value:>{width}}" for value, width in zip(values, (10, 15), strict=False)]
            lines.append(f"{stage.name:<18}{stage.seconds:>10.2f}{''.join(peaks)}")
        lines.append(f"{'all':<18}{sum(stage.seconds for stage in self.stages):>10.2f}")
        return "\n".join(lines)


def _peak(process: int) -> int | None:
    """Peak memory of a process since the last reset, in bytes; None if unknown."""
    if sys.platform == "linux":
        with suppress(OSError):
            for line in Path(f"/proc/{process}/status").read_text().splitlines():
                if line.startswith("VmHWM:"):
                    return int(line.split()[1]) * 1024
    return None


def _reset_peak(process: int) -> None:
    if sys.platform == "linux":
        with suppress(OSError):
            Path(f"/proc/{process}/clear_refs").write_text("5")
