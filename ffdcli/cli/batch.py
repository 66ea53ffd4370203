"""`ffd batch`: many jobs, in parallel and resumable, with one summary."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ffdcli.cli.batch_progress import show_batch
from ffdcli.cli.options import FILE, json_option, print_json, quiet_option

if TYPE_CHECKING:
    from ffdcli.batch import Brake, Outcome

_INTERRUPTED = 130


@click.command()
@click.argument("jobs", type=FILE)
@click.option(
    "-j",
    "--jobs",
    "workers",
    type=click.IntRange(min=1),
    help="Processes at a time. [default: one per core, as far as memory goes]",
)
@click.option("--scheduler", metavar="ADDRESS", help="Run on this dask.distributed cluster.")
@click.option(
    "--manifest", type=FILE, help="Where account is kept. [default: manifest.jsonl beside JOBS]"
)
@click.option("--summary", type=FILE, help="Table of all jobs. [default: summary.csv beside JOBS]")
@click.option("--fresh", is_flag=True, help="Do all jobs, also those that are done already.")
@json_option
@quiet_option
def batch(
    jobs: Path,
    workers: int | None,
    scheduler: str | None,
    manifest: Path | None,
    summary: Path | None,
    fresh: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Do all jobs of the file JOBS that are missing, changed or failed.

    One job that goes wrong never harms another. Stopped or killed at any moment, the batch goes on
    where it was when it is run again. Ctrl-C finishes the jobs under way; twice gives them up.

    Exit status: 0 all passed, 1 some failed, 3 some failed verification, 130 interrupted.
    """
    from ffdcli.batch import Brake, list_jobs, run_batch, write_summary
    from ffdcli.files import require_place

    if scheduler is not None and workers is not None:
        raise click.UsageError("--jobs is for this machine; --scheduler runs elsewhere.")
    manifest = manifest or jobs.with_name("manifest.jsonl")
    summary = summary or jobs.with_name("summary.csv")
    for place in (manifest, summary):
        require_place(place)
    listed = list_jobs(jobs)
    brake = Brake()
    with show_batch(quiet=quiet) as display, _signals(brake):
        outcome = run_batch(
            listed,
            manifest,
            workers=workers,
            scheduler=scheduler,
            fresh=fresh,
            brake=brake,
            begin=display.begin,
            tell=display.tell,
        )
    write_summary(outcome, summary)
    _print_failures(outcome)
    if as_json:
        if not quiet:
            click.echo(_totals(outcome), err=True)
        print_json(_facts(outcome, manifest, summary))
    else:
        click.echo(f"{_totals(outcome)}; see {summary}")
    status = _INTERRUPTED if outcome.interrupted else outcome.exit_status
    click.get_current_context().exit(status)


@contextlib.contextmanager
def _signals(brake: Brake) -> Iterator[None]:
    """Ctrl-C brakes gently, then hard; SIGTERM hard at once."""

    def interrupt(_number: int, _frame: Any) -> None:
        if brake.pull() == 1:
            click.echo("finishing the jobs under way; Ctrl-C again gives them up", err=True)

    def terminate(_number: int, _frame: Any) -> None:
        brake.level = 2

    try:
        before = {
            signal.SIGINT: signal.signal(signal.SIGINT, interrupt),
            signal.SIGTERM: signal.signal(signal.SIGTERM, terminate),
        }
    except ValueError:
        # Not in the main thread: whoever called has signals of their own.
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
    """On stderr: a table of the jobs that did not pass, and why."""
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
            click.echo(f"{'  '.join(cells)}  {row[3]}", err=True)
