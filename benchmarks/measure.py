"""Times, peak memory and rows of the table."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

CHILDREN = Path(__file__).parent / "children"
FFD = ["-c", "from ffdcli.cli import main; main()"]


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Parameters
    ----------
    what, against : str
        What is measured, and what it is measured against.
    found, wanted : str
    met : bool or None
        None where nothing is asked.
    """

    what: str
    against: str
    found: str
    wanted: str = "-"
    met: bool | None = None


@dataclass(frozen=True)
class Run:
    """What a process took: seconds from start to end, of which on processors, and peak bytes; and
    what it printed.
    """

    seconds: float
    processor: float
    peak: int
    printed: str

    @property
    def value(self) -> Any:
        """What it printed, as JSON."""
        return json.loads(self.printed)


def run_process(arguments: Iterable[str | Path], folder: Path) -> Run:
    """Run Python with some arguments in a folder; one thread for numpy, as peers have."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    # An installed program has its modules compiled.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    begun = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, *map(str, arguments)],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        printed = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    seconds = time.perf_counter() - begun
    if process.returncode:
        sys.exit(f"failed: {' '.join(map(str, arguments))}")
    # Kilobytes on Linux, bytes on macOS.
    processor = usage.ru_utime + usage.ru_stime
    return Run(
        seconds, processor, usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024), printed
    )


def child(name: str, *arguments: object) -> list[str]:
    """Arguments that run one of the scripts in ``children``."""
    return [str(CHILDREN / f"{name}.py"), *map(str, arguments)]


def in_turn(rounds: int, *ways: Callable[[], Run]) -> list[Run]:
    """Several ways, run in turn so that other load meets all of them: each one's medians."""
    taken: list[list[Run]] = [[] for _ in ways]
    for _ in range(rounds):
        for runs, way in zip(taken, ways, strict=True):
            runs.append(way())
    return [
        replace(
            runs[-1],
            seconds=statistics.median(run.seconds for run in runs),
            processor=statistics.median(run.processor for run in runs),
        )
        for runs in taken
    ]


def table(rows: Iterable[Row]) -> str:
    """Rows as a Markdown table."""
    marks = {True: "yes", False: "no", None: "-"}
    lines = ["| what | measured against | found | wanted | met |", "|---|---|---|---|---|"]
    lines += [
        f"| {row.what} | {row.against} | {row.found} | {row.wanted} | {marks[row.met]} |"
        for row in rows
    ]
    return "\n".join(lines)
