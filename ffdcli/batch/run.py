"""The batch: what is not yet done is done, and every job that ends is noted at once."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from ffdcli.batch.events import Brake, Ended, Event
from ffdcli.batch.jobs import Job
from ffdcli.batch.manifest import Manifest, is_current
from ffdcli.batch.memory import default_workers
from ffdcli.batch.places import absolute, digest, is_url
from ffdcli.batch.work import PASSED, REJECTED, Record
from ffdcli.files import remove_remnants

__all__ = ["Brake", "Outcome", "run_batch"]

# What a record says of a job that an interruption kept from being done.
NOT_RUN = "not run"


@dataclass(frozen=True)
class Outcome:
    """How a batch ended.

    Parameters
    ----------
    records : tuple of dict
        One per job, in the order of the jobs file.
    kept : frozenset of str
        Outputs that an earlier run had made.
    seconds : float
    """

    records: tuple[Record, ...]
    kept: frozenset[str]
    seconds: float

    @cached_property
    def counts(self) -> dict[str, int]:
        """Jobs of each status."""
        return dict(Counter(str(record["status"]) for record in self.records))

    @property
    def interrupted(self) -> bool:
        """Whether jobs were left undone."""
        return NOT_RUN in self.counts

    @property
    def passed(self) -> int:
        """Jobs whose output is there, and verified where that was asked for."""
        return sum(self.counts.get(status, 0) for status in PASSED)

    @property
    def exit_status(self) -> int:
        """The contract's: 0 all passed, 3 some failed verification, 1 some failed."""
        if REJECTED in self.counts:
            return 3
        return 0 if self.passed == len(self.records) else 1


def run_batch(
    jobs: Sequence[Job],
    manifest: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    fresh: bool = False,
    brake: Brake | None = None,
    begin: Callable[[Sequence[Job], int], None] = lambda _jobs, _kept: None,
    tell: Callable[[Event], None] = lambda _event: None,
) -> Outcome:
    """Do all jobs that are missing, changed or failed.

    It may be stopped or killed at any moment: outputs appear whole or not at all, what has ended
    is in the manifest, and the next run does the rest.

    Parameters
    ----------
    jobs : sequence of Job
        As :func:`~ffdcli.batch.list_jobs` gives them.
    manifest : str or Path
        Where to keep account.
    workers : int, optional
        Processes; by default one per core, as far as memory goes.
    scheduler : str, optional
        Address of a dask.distributed scheduler to run the jobs on instead.
    fresh : bool
        Do all jobs, also those that are done.
    brake : Brake, optional
        To stop the batch by.
    begin : callable, optional
        Told the jobs that are to be done, and how many others are done already.
    tell : callable, optional
        Told each :class:`~ffdcli.batch.events.Event`.

    Raises
    ------
    FileError
        The manifest cannot be written.
    BatchError
        Another batch is at work with it, or the cluster cannot be used.
    """
    start = time.perf_counter()
    brake = brake or Brake()
    with Manifest(manifest) as book:
        known = cache(digest)
        kept = frozenset(
            job.output
            for job in jobs
            if not fresh and is_current(job, book.records.get(job.output), known)
        )
        todo = [job for job in jobs if job.output not in kept]
        begin(todo, len(kept))
        files = [absolute(job.folder, job.output) for job in todo if not is_url(job.output)]
        ended = {}
        # Processes that are killed while they write leave their temporary files: an earlier
        # batch's with it, or those of this one.
        remove_remnants(files)
        try:
            for event in _execute(todo, workers, scheduler, brake):
                if isinstance(event, Ended):
                    book.append(event.record)
                    ended[event.job.output] = event.record
                tell(event)
        finally:
            remove_remnants(files)
        records = tuple(
            book.records[job.output]
            if job.output in kept
            else ended.get(job.output) or {**job.settings, "status": NOT_RUN}
            for job in jobs
        )
    return Outcome(records, kept, time.perf_counter() - start)


def _execute(
    todo: Sequence[Job], workers: int | None, scheduler: str | None, brake: Brake
) -> Iterator[Event]:
    if scheduler is not None:
        from ffdcli.batch.cluster import run_cluster

        return run_cluster(todo, address=scheduler, brake=brake)
    from ffdcli.batch.pool import run_pool

    return run_pool(todo, workers=workers or default_workers(), brake=brake)
