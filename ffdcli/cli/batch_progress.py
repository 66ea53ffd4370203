"""Progress of a batch on stderr: live on a terminal, otherwise one plain line per job."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

from ffdcli.cli.options import say
from ffdcli.messages import printable

if TYPE_CHECKING:
    from ffdcli.batch import Job
    from ffdcli.batch.events import Event


class Display(Protocol):
    """Shows the progress of a batch."""

    def start(self, jobs: Sequence[Job], kept: int) -> None:
        """Called once with the jobs to run and the number of jobs done before."""

    def show(self, event: Event) -> None:
        """Called with each event."""


@contextmanager
def show_batch(*, quiet: bool) -> Iterator[Display]:
    """Display for stderr: silent, plain or live."""
    if quiet:
        yield _Silent()
    elif not sys.stderr.isatty() or "NO_COLOR" in os.environ:
        yield _Lines()
    else:
        with _Live() as live:
            yield live


class _Silent:
    def start(self, jobs: Sequence[Job], kept: int) -> None:
        pass

    def show(self, event: Event) -> None:
        pass


class _Lines:
    """Prints one line for each job that ends."""

    def __init__(self) -> None:
        self.total = 0
        self.ended = 0

    def start(self, jobs: Sequence[Job], kept: int) -> None:
        self.total = len(jobs)
        done = f", {kept} done already" if kept else ""
        say(f"{len(jobs)} jobs to do{done}", err=True)

    def show(self, event: Event) -> None:
        from ffdcli.batch.events import Ended

        if isinstance(event, Ended):
            self.ended += 1
            say(f"[{self.ended}/{self.total}] {_line(event.record)}", err=True)


class _Live:
    """Shows a bar for the batch and a line for each running job."""

    def __init__(self) -> None:
        # Imported only on a terminal: rich is slow to load.
        from rich.console import Console, Group
        from rich.live import Live
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn

        self.whole = Progress(
            "{task.description}", BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
        )
        self.jobs = Progress("{task.description}", TimeElapsedColumn())
        self.console = Console(stderr=True)
        self.live = Live(Group(self.whole, self.jobs), console=self.console, transient=True)
        self.lines: dict[str, Any] = {}

    def __enter__(self) -> _Live:
        self.live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.live.stop()

    def start(self, jobs: Sequence[Job], kept: int) -> None:
        total = len(jobs) + kept
        self.whole.add_task("all jobs", total=total, completed=kept)

    def show(self, event: Event) -> None:
        from rich.markup import escape

        from ffdcli.batch.events import Began
        from ffdcli.batch.single_job import PASSED

        name = event.job.output
        if isinstance(event, Began):
            if event.process is None:
                return
            text = escape(printable(f"  {name}: {event.stage}"))
            if name not in self.lines:
                self.lines[name] = self.jobs.add_task(text, total=None)
            self.jobs.update(self.lines[name], description=text)
            return
        if name in self.lines:
            self.jobs.remove_task(self.lines.pop(name))
        self.whole.advance(self.whole.task_ids[0])
        if event.record["status"] not in PASSED:
            self.console.print(printable(_line(event.record)), markup=False, highlight=False)


def _line(record: dict[str, Any]) -> str:
    from ffdcli.batch.summary import reason

    why = reason(record)
    where = f" in stage {record['stage']!r}: {why}" if why else ""
    return f"{record['status']}: {record['output']}{where} ({record['seconds']:.1f} s)"
