"""Run the jobs of a batch on an existing dask.distributed cluster."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from ffdcli.batch.events import Began, Ended, Event, StopSignal
from ffdcli.batch.jobs import Job
from ffdcli.batch.single_job import (
    FAILED,
    Record,
    as_task,
    error_facts,
    finished,
    from_task,
    run_job,
)
from ffdcli.errors import BatchError, FfdError

if TYPE_CHECKING:
    from distributed import Client, Future

# Seconds between looks at the futures.
_POLL_SECONDS = 0.2
_CONNECT_TIMEOUT = "20s"


def run_cluster(jobs: Iterable[Job], *, address: str, stop: StopSignal) -> Iterator[Event]:
    """Run jobs on a cluster whose workers see the same files, and yield events.

    If the worker of a job dies, another one runs the job again. The job fails after as many deaths
    as the scheduler allows (``distributed.scheduler.allowed-failures``).

    Parameters
    ----------
    jobs : iterable of Job
    address : str
        Address of the scheduler, such as ``tcp://host:8786``.
    stop : StopSignal

    Raises
    ------
    BatchError
        The scheduler cannot be reached or was lost, or its workers lack this program.
    """
    client = _connect(address)
    try:
        yield from _run(client, jobs, address, stop)
    finally:
        # Closing the client cancels its remaining jobs.
        client.close(timeout=5)


def run_task(task: dict[str, Any], epoch: str | None) -> Record:
    """Run one job on a worker of the cluster; returns its record."""
    return run_job(from_task(task), epoch=epoch)


def _connect(address: str) -> Client:
    try:
        from distributed import Client
    except ImportError:
        raise BatchError(
            "running on a cluster needs the package distributed",
            hint="pip install 'ffdcli[cluster]'",
        ) from None
    try:
        client = Client(address, timeout=_CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        detail = " ".join(str(error).split()) or type(error).__name__
        raise BatchError(
            f"no scheduler answers at {address}: {detail}",
            hint="use an address such as tcp://host:8786",
        ) from None
    return client


def _run(client: Client, jobs: Iterable[Job], address: str, stop: StopSignal) -> Iterator[Event]:
    from distributed import CancelledError

    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    started = time.perf_counter()
    waiting: dict[Future, Job] = {}
    for job in sorted(jobs, key=lambda job: (job.mesh, job.lattice)):
        # Not pure: a job repeated after its output was removed must run again.
        future = client.submit(run_task, dict(as_task(job)), epoch, pure=False)
        waiting[future] = job
        yield Began(job, "waiting")
    while waiting and stop.level < 2:
        if stop.level == 1:
            _cancel_unbegun(client, waiting)
        ended = [future for future in waiting if future.done()]
        if not ended:
            if client.status != "running":
                raise _lost(address)
            time.sleep(_POLL_SECONDS)
        for future in ended:
            job = waiting.pop(future)
            try:
                record = future.result()
            except CancelledError:
                if stop.level == 0:
                    raise _lost(address) from None
                continue
            except Exception as error:
                record = _failed(job, error, time.perf_counter() - started)
            yield Ended(job, record)
            future.release()
    if waiting:
        client.cancel(list(waiting), force=True)


def _cancel_unbegun(client: Client, waiting: dict[Future, Job]) -> None:
    """Cancel the jobs that no worker has begun."""
    running = {key for keys in client.processing().values() for key in keys}
    unbegun = [future for future in waiting if future.key not in running and not future.done()]
    if unbegun:
        client.cancel(unbegun)
        for future in unbegun:
            del waiting[future]


def _failed(job: Job, error: Exception, seconds: float) -> Record:
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        crash = FfdError(
            f"the workers that ran this job died, the last one at {error.last_worker.address}",
            hint="look into the logs of the workers; they may have run out of memory",
        )
        crash.kind = "crash"
        error = crash
    record = {"status": FAILED, "error": error_facts(error)}
    return finished(job, record, stage="cluster", seconds=seconds)


def _lost(address: str) -> BatchError:
    return BatchError(
        f"the connection to the scheduler at {address} was lost",
        hint="run the batch again to do the remaining jobs",
    )
