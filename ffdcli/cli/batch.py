"""Command `ffd batch`: run the jobs of a jobs file in parallel, and write a summary."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ffdcli.cli.batch_progress import show_batch
from ffdcli.cli.options import (
    FILE,
    FiniteRange,
    json_option,
    memory_option,
    print_json,
    quiet_option,
    say,
)

if TYPE_CHECKING:
    from ffdcli.batch import Outcome, StopSignal

_INTERRUPTED = 130


@click.command()
@click.argument("jobs", type=FILE)
@click.option(
    "-j",
    "--jobs",
    "workers",
    type=click.IntRange(min=1),
    help="Number of processes. Default: one per core, fewer if memory is short.",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Run the jobs on the dask.distributed cluster with this scheduler, such as "
    "tcp://host:8786.",
)
@click.option(
    "--timeout",
    metavar="SECONDS",
    type=FiniteRange(min=0, min_open=True),
    help="Stop a job that takes longer; it has failed, and the others continue. Not with "
    "--scheduler.",
)
@click.option(
    "--manifest",
    type=FILE,
    help="File that records the jobs that have ended. Default: manifest.jsonl beside JOBS.",
)
@click.option("--summary", type=FILE, help="Table of all jobs. Default: summary.csv beside JOBS.")
@memory_option
@click.option("--fresh", is_flag=True, help="Run all jobs, including those that are done.")
@json_option
@quiet_option
def batch(
    jobs: Path,
    workers: int | None,
    scheduler: str | None,
    timeout: float | None,
    manifest: Path | None,
    summary: Path | None,
    fresh: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Run the jobs of the file JOBS that are not done, have changed or have failed.

    Jobs run in parallel; if one fails, the others continue. A batch that was stopped or killed can
    be run again: it does the remaining jobs. Ctrl-C lets the running jobs finish; a second Ctrl-C
    abandons them.

    Exit status: 0 all jobs passed, 1 some failed, 3 some failed verification, 130 interrupted.
    """
    from ffdcli.batch import StopSignal, list_jobs, run_batch, write_summary
    from ffdcli.files import require_place

    if scheduler is not None and workers is not None:
        raise click.UsageError("--jobs and --scheduler exclude each other.")
    if scheduler is not None and timeout is not None:
        raise click.UsageError("--timeout and --scheduler exclude each other.")
    manifest = manifest or jobs.with_name("manifest.jsonl")
    summary = summary or jobs.with_name("summary.csv")
    for place in (manifest, summary):
        require_place(place)
    listed = list_jobs(jobs)
    stop = StopSignal()
    with show_batch(quiet=quiet) as display, _signals(stop):
        outcome = run_batch(
            listed,
            manifest,
            workers=workers,
            scheduler=scheduler,
            timeout=timeout,
            fresh=fresh,
            stop=stop,
            on_start=display.start,
            on_event=display.show,
        )
    write_summary(outcome, summary)
    _print_failures(outcome)
    if as_json:
        if not quiet:
            say(_totals(outcome), err=True)
        print_json(_facts(outcome, manifest, summary))
    else:
        say(f"{_totals(outcome)}; see {summary}")
    status = _INTERRUPTED if outcome.interrupted else outcome.exit_status
    click.get_current_context().exit(status)


@contextlib.contextmanager
def _signals(stop: StopSignal) -> Iterator[None]:
    """Inside the block, Ctrl-C raises the level of the signal by one, and SIGTERM to 2."""

    def interrupt(_number: int, _frame: Any) -> None:
        if stop.escalate() == 1:
            say("finishing the running jobs; Ctrl-C again abandons them", err=True)

    def terminate(_number: int, _frame: Any) -> None:
        stop.level = 2

    try:
        before = {
            signal.SIGINT: signal.signal(signal.SIGINT, interrupt),
            signal.SIGTERM: signal.signal(signal.SIGTERM, terminate),
        }
    except ValueError:
        # Only the main thread may set signal handlers.
        yield
        return
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _facts(outcome: Outcome, manifest: Path, summary: Path) -> dict[str, Any]:
    return {
        "total": len(outcome.records),
        "passed": outcome.passed,
        "failed": outcome.counts.get("failed", 0),
        "rejected": outcome.counts.get("rejected", 0),
        "not_run": outcome.counts.get("not run", 0),
        "kept": len(outcome.kept),
        "interrupted": outcome.interrupted,
        "seconds": round(outcome.seconds, 3),
        "manifest": str(manifest),
        "summary": str(summary),
        "jobs": [
            {**record, "kept": record["output"] in outcome.kept} for record in outcome.records
        ],
    }


def _totals(outcome: Outcome) -> str:
    parts = [f"{count} {status}" for status, count in sorted(outcome.counts.items())]
    kept = f" ({len(outcome.kept)} by an earlier run)" if outcome.kept else ""
    many = len(outcome.records)
    jobs = f"{many} job{'' if many == 1 else 's'}"
    return f"{jobs}: {', '.join(parts)}{kept}, in {outcome.seconds:.1f} s"


def _print_failures(outcome: Outcome) -> None:
    """Print a table of the jobs that did not pass, with the reasons, to stderr."""
    from ffdcli.batch.summary import reason

    rows = [
        (record["status"], record["output"], record.get("stage", ""), reason(record))
        for record in outcome.records
        if record["status"] in ("failed", "rejected")
    ]
    if rows:
        heads = ("status", "output", "stage", "reason")
        widths = [max(len(str(row[i])) for row in (heads, *rows)) for i in range(3)]
        for row in (heads, *rows):
            cells = [str(cell).ljust(width) for cell, width in zip(row[:3], widths, strict=True)]
            say(f"{'  '.join(cells)}  {row[3]}", err=True)
