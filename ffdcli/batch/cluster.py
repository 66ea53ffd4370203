"""The same jobs on an existing dask.distributed cluster; the only place that knows it."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from ffdcli.batch.events import Began, Brake, Ended, Event
from ffdcli.batch.jobs import Job
from ffdcli.batch.work import FAILED, Record, as_task, error_facts, finished, from_task, run_job
from ffdcli.errors import BatchError, FfdError

if TYPE_CHECKING:
    from distributed import Client, Future

_PULSE = 0.2
_PATIENCE = "20s"


def run_cluster(jobs: Iterable[Job], *, address: str, brake: Brake) -> Iterator[Event]:
    """Do jobs on a cluster that sees the same files, and tell what happens.

    A job whose worker is lost is done again by another one; one that loses worker after worker
    has failed (the scheduler's ``distributed.scheduler.allowed-failures``).

    Parameters
    ----------
    jobs : iterable of Job
    address : str
        Of the scheduler, such as ``tcp://host:8786``.
    brake : Brake

    Raises
    ------
    BatchError
        The scheduler cannot be reached, or was lost; or its workers lack this program.
    """
    client = _connect(address)
    try:
        yield from _run(client, jobs, address, brake)
    finally:
        # Leaving cancels what is still under way.
        client.close(timeout=5)


def run_task(task: dict[str, Any], epoch: str | None) -> Record:
    """What a worker of the cluster does."""
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
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        said = " ".join(str(error).split()) or type(error).__name__
        raise BatchError(
            f"no scheduler answers at {address}: {said}", hint="give it as in tcp://host:8786"
        ) from None
    return client


def _run(client: Client, jobs: Iterable[Job], address: str, brake: Brake) -> Iterator[Event]:
    from distributed import CancelledError

    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    started = time.perf_counter()
    waiting: dict[Future, Job] = {}
    for job in sorted(jobs, key=lambda job: (job.mesh, job.lattice)):
        # Not pure: a job done again after its output was removed is no old result.
        future = client.submit(run_task, dict(as_task(job)), epoch, pure=False)
        waiting[future] = job
        yield Began(job, "waiting")
    while waiting and brake.level < 2:
        if brake.level == 1:
            _cancel_unbegun(client, waiting)
        ended = [future for future in waiting if future.done()]
        if not ended:
            if client.status != "running":
                raise _lost(address)
            time.sleep(_PULSE)
        for future in ended:
            job = waiting.pop(future)
            try:
                record = future.result()
            except CancelledError:
                if brake.level == 0:
                    raise _lost(address) from None
                continue
            except Exception as error:
                record = _failed(job, error, time.perf_counter() - started)
            yield Ended(job, record)
            future.release()
    if waiting:
        client.cancel(list(waiting), force=True)


def _cancel_unbegun(client: Client, waiting: dict[Future, Job]) -> None:
    """Take back what no worker has begun."""
    running = {key for keys in client.processing().values() for key in keys}
    unbegun = [future for future in waiting if future.key not in running and not future.done()]
    if unbegun:
        client.cancel(unbegun)
        for future in unbegun:
            del waiting[future]


def _failed(job: Job, error: Exception, seconds: float) -> Record:
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        said = FfdError(
            f"the workers that ran this job died, the last at {error.last_worker.address}",
            hint="the workers' logs may say why; out of memory, perhaps",
        )
        said.kind = "crash"
        error = said
    record = {"status": FAILED, "error": error_facts(error)}
    return finished(job, record, stage="cluster", seconds=seconds)


def _lost(address: str) -> BatchError:
    return BatchError(
        f"the scheduler at {address} was lost", hint="run the batch again to go on with the rest"
    )
