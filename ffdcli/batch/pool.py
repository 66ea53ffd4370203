"""Run the jobs of a batch in worker processes of this machine, each with its own pipes.

If a process dies, only its job fails, and another process replaces it. (The executors of the
standard library abandon all jobs when a process dies.)
"""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import IO, Any, cast

from ffdcli.batch.events import Began, Ended, Event, StopSignal
from ffdcli.batch.jobs import Job
from ffdcli.batch.memory import (
    RETIRE_BYTES,
    WORKER_BYTES,
    free_bytes,
    needed_bytes,
)
from ffdcli.batch.single_job import FAILED, as_task, error_facts, finished
from ffdcli.errors import FfdError, MemoryLimitError
from ffdcli.memory import resident_bytes

# Seconds between looks at the stop signal and at the memory.
_POLL_SECONDS = 0.2
# Seconds that an idle process has to exit after its stdin was closed.
_EXIT_SECONDS = 5.0


def run_pool(
    jobs: Iterable[Job], *, workers: int, stop: StopSignal, timeout: float | None = None
) -> Iterator[Event]:
    """Run jobs in processes of this machine, and yield events.

    Parameters
    ----------
    jobs : iterable of Job
    workers : int
        Largest number of processes; fewer run if memory is short.
    stop : StopSignal
    timeout : float, optional, seconds
        A job that takes longer is stopped and has failed.
    """
    pool = _Pool(_Queue(jobs), workers, os.environ.get("SOURCE_DATE_EPOCH"))
    try:
        while stop.level < 2:
            if stop.level == 0:
                yield from pool.assign_jobs()
            if not pool.busy:
                break
            yield from pool.receive()
            if timeout is not None:
                yield from pool.stop_late(timeout)
    finally:
        pool.close()


class _Queue:
    """Waiting jobs, grouped by mesh and lattice: a process works on one group as long as it can."""

    def __init__(self, jobs: Iterable[Job]) -> None:
        self._groups: dict[tuple[str, str], deque[Job]] = {}
        for job in jobs:
            self._groups.setdefault((job.mesh, job.lattice), deque()).append(job)

    def __bool__(self) -> bool:
        return bool(self._groups)

    def choose(self, last: Job | None, taken: Iterable[Job]) -> tuple[str, str]:
        """Next group: that of the last job, else one that no process works on, else the longest."""
        if last is not None and (last.mesh, last.lattice) in self._groups:
            return last.mesh, last.lattice
        occupied = {(job.mesh, job.lattice) for job in taken}
        # If a group has the same mesh, the mesh need not be read again.
        return min(
            self._groups,
            key=lambda group: (
                group in occupied,
                last is None or group[0] != last.mesh,
                -len(self._groups[group]) if group in occupied else 0,
            ),
        )

    def peek(self, group: tuple[str, str]) -> Job:
        return self._groups[group][0]

    def pop(self, group: tuple[str, str]) -> Job:
        job = self._groups[group].popleft()
        if not self._groups[group]:
            del self._groups[group]
        return job

    def put_back(self, job: Job) -> None:
        self._groups.setdefault((job.mesh, job.lattice), deque()).appendleft(job)


@dataclass(eq=False)
class _Worker:
    """A worker process and its current job."""

    process: subprocess.Popen[bytes]
    tasks: IO[bytes]
    answers: IO[bytes]
    stderr: IO[bytes]
    scratch: tempfile.TemporaryDirectory[str]
    job: Job | None = None
    last: Job | None = None
    stage: str | None = None
    began: float = 0.0
    buffer: bytearray = field(default_factory=bytearray)

    def send(self, job: Job, epoch: str | None) -> None:
        self.job, self.last, self.stage, self.began = job, job, None, time.perf_counter()
        line = json.dumps({"job": as_task(job), "epoch": epoch}) + "\n"
        # If the process has died while idle, `receive` will find out.
        with contextlib.suppress(BrokenPipeError):
            self.tasks.write(line.encode())
            self.tasks.flush()


class _Pool:
    """Worker processes and the jobs assigned to them."""

    def __init__(self, queue: _Queue, workers: int, epoch: str | None) -> None:
        self.queue = queue
        self.limit = workers
        self.epoch = epoch
        self.workers: list[_Worker] = []
        self.selector = selectors.DefaultSelector()
        self.retried: set[str] = set()
        # Jobs that run while no other does: beside others their memory did not suffice.
        self.alone: set[str] = set()

    @property
    def busy(self) -> list[tuple[_Worker, Job]]:
        return [(worker, worker.job) for worker in self.workers if worker.job is not None]

    def assign_jobs(self) -> Iterator[Event]:
        """Assign jobs to idle processes and to new ones, as long as memory suffices."""
        while self.queue:
            idle = next((worker for worker in self.workers if worker.job is None), None)
            if idle is None and len(self.workers) >= self.limit:
                return
            last = idle.last if idle is not None else None
            group = self.queue.choose(last, [job for _, job in self.busy])
            job = self.queue.peek(group)
            needed = needed_bytes(job) + (0 if idle else WORKER_BYTES)
            # One job always runs: the estimate may be too high.
            if self.busy and (self._one_is_alone(job) or needed > self._free()):
                return
            worker = idle or self._start()
            self.queue.pop(group)
            worker.send(job, self.epoch)
            yield Began(job, "start", worker.process.pid)

    def _one_is_alone(self, job: Job) -> bool:
        """Whether a job, or one that is running, has to run while no other does."""
        return any(each.fingerprint in self.alone for each in (job, *(job for _, job in self.busy)))

    def _free(self) -> float:
        """Memory that another job may take, in bytes: without what running ones may still take."""
        free = free_bytes(worker.process.pid for worker in self.workers)
        for worker, job in self.busy:
            peak = WORKER_BYTES + needed_bytes(job)
            free -= max(0, peak - resident_bytes(worker.process.pid))
        return free

    def receive(self) -> Iterator[Event]:
        """Read messages of the processes; returns after `_POLL_SECONDS` at the latest."""
        for key, _ in self.selector.select(_POLL_SECONDS):
            worker: _Worker = key.data
            received = os.read(key.fd, 1 << 16)
            if not received:
                yield from self._handle_exit(worker)
                continue
            worker.buffer += received
            *lines, rest = bytes(worker.buffer).split(b"\n")
            worker.buffer[:] = rest
            for line in lines:
                # A message concerns the current job of the process.
                if worker.job is not None:
                    yield from self._events_of(worker, worker.job, json.loads(line))
            if worker.job is None and resident_bytes(worker.process.pid) > RETIRE_BYTES:
                self._end(worker)

    def _events_of(self, worker: _Worker, job: Job, message: dict[str, Any]) -> Iterator[Event]:
        if "record" not in message:
            worker.stage = str(message["stage"])
            yield Began(job, worker.stage, worker.process.pid)
            return
        worker.job, record = None, message["record"]
        if self.busy and record.get("error", {}).get("kind") == MemoryLimitError.kind:
            self.alone.add(job.fingerprint)
            self.queue.put_back(job)
            return
        yield Ended(job, record)

    def _start(self) -> _Worker:
        environment = dict(os.environ)
        # One thread per process: the processes share the cores, and floating-point sums do not
        # depend on the number of processes.
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            environment.setdefault(name, "1")
        # A process that is killed leaves its temporary files to this one.
        scratch = tempfile.TemporaryDirectory(prefix="ffd-", ignore_cleanup_errors=True)
        environment["TMPDIR"] = scratch.name
        stderr = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        process = subprocess.Popen(
            # -P: modules are not imported from the current folder.
            [sys.executable, "-P", "-m", "ffdcli.batch.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=stderr,
            env=environment,
            # Ctrl-C reaches the batch alone, which then stops its processes.
            process_group=0,
        )
        tasks, answers = cast(IO[bytes], process.stdin), cast(IO[bytes], process.stdout)
        worker = _Worker(process, tasks, answers, stderr, scratch)
        self.workers.append(worker)
        self.selector.register(answers, selectors.EVENT_READ, worker)
        return worker

    def _handle_exit(self, worker: _Worker) -> Iterator[Event]:
        """Handle the death of a process: its job fails, or is retried once if it had not begun."""
        code = worker.process.wait()
        detail = _last_line(worker.stderr)
        job = worker.job
        self._end(worker)
        if job is None:
            return
        if worker.stage is None and job.fingerprint not in self.retried:
            self.retried.add(job.fingerprint)
            self.queue.put_back(job)
            return
        message = f"the process that ran this job {_exit_reason(code)}"
        hint = "the other jobs continued; run the batch again to retry this one"
        yield _failed(worker, job, "crash", f"{message}: {detail}" if detail else message, hint)

    def stop_late(self, timeout: float) -> Iterator[Event]:
        """Stop the jobs that have taken longer than ``timeout`` seconds, with their processes."""
        for worker, job in self.busy:
            if time.perf_counter() - worker.began > timeout:
                self._end(worker)
                message = f"the job took longer than {timeout:g} s and was stopped"
                yield _failed(worker, job, "timeout", message, "raise --timeout, or use less mesh")

    def _end(self, worker: _Worker) -> None:
        """End an idle process, or kill one that has a job."""
        process = worker.process
        self.selector.unregister(worker.answers)
        if worker.job is not None:
            process.kill()
        with contextlib.suppress(BrokenPipeError):
            worker.tasks.close()
        try:
            process.wait(_EXIT_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        worker.answers.close()
        worker.stderr.close()
        worker.scratch.cleanup()
        self.workers.remove(worker)

    def close(self) -> None:
        """End all processes; running jobs are abandoned."""
        for worker in list(self.workers):
            self._end(worker)
        self.selector.close()


def _failed(worker: _Worker, job: Job, kind: str, message: str, hint: str) -> Ended:
    """The end of a job whose process has ended before it."""
    error = FfdError(message, hint=hint)
    error.kind = kind
    record = {"status": FAILED, "error": error_facts(error)}
    seconds = time.perf_counter() - worker.began
    return Ended(job, finished(job, record, stage=worker.stage or "start", seconds=seconds))


def _exit_reason(code: int) -> str:
    if code >= 0:
        return f"exited with status {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    more = " (possibly out of memory)" if name == "SIGKILL" else ""
    return f"was killed by {name}{more}"


def _last_line(stderr: IO[bytes]) -> str:
    """Last line that a process wrote to stderr."""
    stderr.seek(max(0, stderr.seek(0, os.SEEK_END) - 4096))
    lines = stderr.read().decode(errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "")
