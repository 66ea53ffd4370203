"""Run a batch: all jobs that are not done yet; each result goes to the manifest at once."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from ffdcli.batch.events import Ended, Event, StopSignal
from ffdcli.batch.jobs import Job
from ffdcli.batch.manifest import Manifest, is_current
from ffdcli.batch.memory import default_workers
from ffdcli.batch.places import absolute, digest, is_url
from ffdcli.batch.single_job import PASSED, REJECTED, Record
from ffdcli.files import remove_remnants

# Status of a job that an interrupted batch did not run.
NOT_RUN = "not run"


@dataclass(frozen=True)
class Outcome:
    """Records of all jobs of a batch that has ended.

    Parameters
    ----------
    records : tuple of dict
        One per job, in the order of the jobs file.
    kept : frozenset of str
        Outputs that an earlier run has made.
    seconds : float
    """

    records: tuple[Record, ...]
    kept: frozenset[str]
    seconds: float

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of jobs of each status."""
        return dict(Counter(str(record["status"]) for record in self.records))

    @property
    def interrupted(self) -> bool:
        """Whether an interruption left jobs undone."""
        return NOT_RUN in self.counts

    @property
    def passed(self) -> int:
        """Number of jobs whose output was written, and verified if that was requested."""
        return sum(self.counts.get(status, 0) for status in PASSED)

    @property
    def exit_status(self) -> int:
        """0: all jobs passed; 3: some failed verification; 1: some failed otherwise."""
        if REJECTED in self.counts:
            return 3
        return 0 if self.passed == len(self.records) else 1


def run_batch(
    jobs: Sequence[Job],
    manifest: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    timeout: float | None = None,
    fresh: bool = False,
    stop: StopSignal | None = None,
    on_start: Callable[[Sequence[Job], int], None] = lambda _jobs, _kept: None,
    on_event: Callable[[Event], None] = lambda _event: None,
) -> Outcome:
    """Run all jobs whose output is missing, or that have changed or failed.

    The batch may be stopped or killed at any moment: outputs are complete or absent, the manifest
    holds the jobs that have ended, and the next run does the others.

    Parameters
    ----------
    jobs : sequence of Job
        As :func:`~ffdcli.batch.list_jobs` gives them.
    manifest : str or Path
        File of the records.
    workers : int, optional
        Number of processes; by default one per core, fewer if memory is short.
    scheduler : str, optional
        Address of a dask.distributed scheduler that runs the jobs instead.
    timeout : float, optional, seconds
        A job that takes longer is stopped and has failed; not with ``scheduler``.
    fresh : bool
        Run all jobs, including those that are done.
    stop : StopSignal, optional
        Stops the batch when its level is raised.
    on_start : callable, optional
        Called with the jobs to run, and the number of jobs that are done already.
    on_event : callable, optional
        Called with each :class:`~ffdcli.batch.events.Event`.

    Raises
    ------
    FileError
        The manifest cannot be written.
    BatchError
        Another batch is using the manifest, or the cluster cannot be used.
    """
    start = time.perf_counter()
    stop = stop or StopSignal()
    with Manifest(manifest) as ledger:
        known = cache(digest)
        kept = frozenset(
            job.output
            for job in jobs
            if not fresh and is_current(job, ledger.records.get(job.output), known)
        )
        todo = [job for job in jobs if job.output not in kept]
        on_start(todo, len(kept))
        files = [absolute(job.folder, job.output) for job in todo if not is_url(job.output)]
        ended = {}
        # Processes that were killed while writing, of this batch or an earlier one, leave temporary
        # files.
        remove_remnants(files)
        try:
            for event in _execute(todo, workers, scheduler, timeout, stop):
                if isinstance(event, Ended):
                    ledger.append(event.record)
                    ended[event.job.output] = event.record
                on_event(event)
        finally:
            remove_remnants(files)
        records = tuple(
            ledger.records[job.output]
            if job.output in kept
            else ended.get(job.output) or {**job.settings, "status": NOT_RUN}
            for job in jobs
        )
    return Outcome(records, kept, time.perf_counter() - start)


def _execute(
    todo: Sequence[Job],
    workers: int | None,
    scheduler: str | None,
    timeout: float | None,
    stop: StopSignal,
) -> Iterator[Event]:
    if scheduler is not None:
        from ffdcli.batch.cluster import run_cluster

        return run_cluster(todo, address=scheduler, stop=stop)
    from ffdcli.batch.pool import run_pool

    return run_pool(todo, workers=workers or default_workers(), stop=stop, timeout=timeout)
