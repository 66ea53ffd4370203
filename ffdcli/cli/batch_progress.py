"""Progress of a batch on stderr: live lines on a terminal, elsewhere one plain line per job."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

import click

if TYPE_CHECKING:
    from ffdcli.batch import Job
    from ffdcli.batch.events import Event


class Display(Protocol):
    """Shows what a batch is doing."""

    def begin(self, jobs: Sequence[Job], kept: int) -> None:
        """These jobs are to be done; so many others were done before."""

    def tell(self, event: Event) -> None:
        """Something has happened to a job."""


@contextmanager
def show_batch(*, quiet: bool) -> Iterator[Display]:
    """The display that fits stderr."""
    if quiet:
        yield _Silent()
    elif not sys.stderr.isatty() or "NO_COLOR" in os.environ:
        yield _Lines()
    else:
        with _Live() as live:
            yield live


class _Silent:
    def begin(self, jobs: Sequence[Job], kept: int) -> None:
        pass

    def tell(self, event: Event) -> None:
        pass


class _Lines:
    """One line for every job that ends."""

    def __init__(self) -> None:
        self.total = 0
        self.ended = 0

    def begin(self, jobs: Sequence[Job], kept: int) -> None:
        self.total = len(jobs)
        done = f", {kept} done already" if kept else ""
        click.echo(f"{len(jobs)} jobs to do{done}", err=True)

    def tell(self, event: Event) -> None:
        from ffdcli.batch.events import Ended

        if isinstance(event, Ended):
            self.ended += 1
            click.echo(f"[{self.ended}/{self.total}] {_line(event.record)}", err=True)


class _Live:
    """A bar for the whole, and a line for every job under way."""

    def __init__(self) -> None:
        # Only a run on a terminal pays for rich.
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

    def begin(self, jobs: Sequence[Job], kept: int) -> None:
        total = len(jobs) + kept
        self.whole.add_task("all jobs", total=total, completed=kept)

    def tell(self, event: Event) -> None:
        from rich.markup import escape

        from ffdcli.batch.events import Began
        from ffdcli.batch.work import PASSED

        name = event.job.output
        if isinstance(event, Began):
            if event.process is None:
                return
            said = escape(f"  {name}: {event.stage}")
            if name not in self.lines:
                self.lines[name] = self.jobs.add_task(said, total=None)
            self.jobs.update(self.lines[name], description=said)
            return
        if name in self.lines:
            self.jobs.remove_task(self.lines.pop(name))
        self.whole.advance(self.whole.task_ids[0])
        if event.record["status"] not in PASSED:
            self.console.print(_line(event.record), markup=False, highlight=False)


def _line(record: dict[str, Any]) -> str:
    from ffdcli.batch.summary import reason

    said = reason(record)
    where = f" in stage {record['stage']!r}: {said}" if said else ""
    return f"{record['status']}: {record['output']}{where} ({record['seconds']:.1f} s)"
