"""The local pool: one process per slot, each with its own pipes, so that none can harm another.

A process that dies takes only its own job with it and is replaced. (The executors of the standard
library give up all jobs when one process dies.)
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

from ffdcli.batch.events import Began, Brake, Ended, Event
from ffdcli.batch.jobs import Job
from ffdcli.batch.memory import (
    RETIRE_BYTES,
    WORKER_BYTES,
    available_bytes,
    needed_bytes,
    resident_bytes,
)
from ffdcli.batch.work import FAILED, as_task, error_facts, finished
from ffdcli.errors import FfdError

# Seconds between looks at the brake and at the memory.
_PULSE = 0.2
# Seconds that an idle process has to end by itself.
_GRACE = 5.0


def run_pool(jobs: Iterable[Job], *, workers: int, brake: Brake) -> Iterator[Event]:
    """Do jobs in processes of this machine, and tell what happens.

    Parameters
    ----------
    jobs : iterable of Job
    workers : int
        Processes at most; fewer where memory would not do for all.
    brake : Brake
    """
    pool = _Pool(_Queue(jobs), workers, os.environ.get("SOURCE_DATE_EPOCH"))
    try:
        while brake.level < 2:
            if brake.level == 0:
                yield from pool.hand_out()
            if not pool.busy:
                break
            yield from pool.listen()
    finally:
        pool.close()


class _Queue:
    """Jobs still to do; each process stays with one mesh and lattice for as long as it can."""

    def __init__(self, jobs: Iterable[Job]) -> None:
        self._groups: dict[tuple[str, str], deque[Job]] = {}
        for job in jobs:
            self._groups.setdefault((job.mesh, job.lattice), deque()).append(job)

    def __bool__(self) -> bool:
        return bool(self._groups)

    def choose(self, last: Job | None, taken: Iterable[Job]) -> tuple[str, str]:
        """The group to go on with: the last job's; one nobody works on; the longest."""
        if last is not None and (last.mesh, last.lattice) in self._groups:
            return last.mesh, last.lattice
        occupied = {(job.mesh, job.lattice) for job in taken}
        # A group that shares the mesh saves at least reading it.
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
    """A process and the job it has."""

    process: subprocess.Popen[bytes]
    tasks: IO[bytes]
    answers: IO[bytes]
    complaints: IO[bytes]
    job: Job | None = None
    last: Job | None = None
    stage: str | None = None
    began: float = 0.0
    heard: bytearray = field(default_factory=bytearray)

    def send(self, job: Job, epoch: str | None) -> None:
        self.job, self.last, self.stage, self.began = job, job, None, time.perf_counter()
        line = json.dumps({"job": as_task(job), "epoch": epoch}) + "\n"
        # A process that died while idle is noticed where its answers are read.
        with contextlib.suppress(BrokenPipeError):
            self.tasks.write(line.encode())
            self.tasks.flush()


class _Pool:
    """Processes, and what they say."""

    def __init__(self, queue: _Queue, workers: int, epoch: str | None) -> None:
        self.queue = queue
        self.limit = workers
        self.epoch = epoch
        self.workers: list[_Worker] = []
        self.selector = selectors.DefaultSelector()
        self.early_deaths: set[str] = set()

    @property
    def busy(self) -> list[tuple[_Worker, Job]]:
        return [(worker, worker.job) for worker in self.workers if worker.job is not None]

    def hand_out(self) -> Iterator[Event]:
        """Give jobs to idle processes, and start new ones, as far as memory goes."""
        while self.queue:
            idle = next((worker for worker in self.workers if worker.job is None), None)
            if idle is None and len(self.workers) >= self.limit:
                return
            last = idle.last if idle is not None else None
            group = self.queue.choose(last, [job for _, job in self.busy])
            needed = needed_bytes(self.queue.peek(group)) + (0 if idle else WORKER_BYTES)
            # One job is always tried: how much it really takes shows only then.
            if self.busy and needed > available_bytes() - self._promised():
                return
            worker = idle or self._start()
            job = self.queue.pop(group)
            worker.send(job, self.epoch)
            yield Began(job, "start", worker.process.pid)

    def _promised(self) -> int:
        """Memory that jobs under way may still take."""
        promised = 0
        for worker, job in self.busy:
            peak = WORKER_BYTES + needed_bytes(job)
            promised += max(0, peak - resident_bytes(worker.process.pid))
        return promised

    def listen(self) -> Iterator[Event]:
        """Take in what processes say within one pulse."""
        for key, _ in self.selector.select(_PULSE):
            worker: _Worker = key.data
            heard = os.read(key.fd, 1 << 16)
            if not heard:
                yield from self._bury(worker)
                continue
            worker.heard += heard
            *lines, rest = bytes(worker.heard).split(b"\n")
            worker.heard[:] = rest
            for line in lines:
                # A process speaks only of the job it has.
                if worker.job is not None:
                    yield self._understand(worker, worker.job, json.loads(line))
            if worker.job is None and resident_bytes(worker.process.pid) > RETIRE_BYTES:
                self._dismiss(worker)

    def _understand(self, worker: _Worker, job: Job, message: dict[str, Any]) -> Event:
        if "record" in message:
            worker.job = None
            return Ended(job, message["record"])
        worker.stage = str(message["stage"])
        return Began(job, worker.stage, worker.process.pid)

    def _start(self) -> _Worker:
        environment = dict(os.environ)
        # The processes share the cores, so threads inside each would only get in the way; and sums
        # come out the same to the last bit, however many processes there are.
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            environment.setdefault(name, "1")
        complaints = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        process = subprocess.Popen(
            # -P: nothing in the current folder may stand in for a module.
            [sys.executable, "-P", "-m", "ffdcli.batch.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=complaints,
            env=environment,
            # Ctrl-C is for the batch, which tells its processes what to do.
            process_group=0,
        )
        tasks, answers = cast(IO[bytes], process.stdin), cast(IO[bytes], process.stdout)
        worker = _Worker(process, tasks, answers, complaints)
        self.workers.append(worker)
        self.selector.register(answers, selectors.EVENT_READ, worker)
        return worker

    def _bury(self, worker: _Worker) -> Iterator[Event]:
        """A process has died: its job has failed, unless it had not even begun."""
        code = worker.process.wait()
        said = _last_words(worker.complaints)
        job, stage = worker.job, worker.stage
        self._dismiss(worker)
        if job is None:
            return
        if stage is None and job.fingerprint not in self.early_deaths:
            self.early_deaths.add(job.fingerprint)
            self.queue.put_back(job)
            return
        error = FfdError(
            f"the process that ran this job {_death(code)}" + (f": {said}" if said else ""),
            hint="the other jobs went on; run the batch again to retry it",
        )
        error.kind = "crash"
        record = {"status": FAILED, "error": error_facts(error)}
        seconds = time.perf_counter() - worker.began
        yield Ended(job, finished(job, record, stage=stage or "start", seconds=seconds))

    def _dismiss(self, worker: _Worker) -> None:
        """End a process that has nothing to do, or kill one that has."""
        process = worker.process
        self.selector.unregister(worker.answers)
        if worker.job is not None:
            process.kill()
        with contextlib.suppress(BrokenPipeError):
            worker.tasks.close()
        try:
            process.wait(_GRACE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        worker.answers.close()
        worker.complaints.close()
        self.workers.remove(worker)

    def close(self) -> None:
        """End all processes; jobs under way are given up."""
        for worker in list(self.workers):
            self._dismiss(worker)
        self.selector.close()


def _death(code: int) -> str:
    if code >= 0:
        return f"ended by itself with status {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    more = " (out of memory, perhaps)" if name == "SIGKILL" else ""
    return f"was killed by {name}{more}"


def _last_words(complaints: IO[bytes]) -> str:
    """The last line a process wrote to stderr."""
    complaints.seek(max(0, complaints.seek(0, os.SEEK_END) - 4096))
    lines = complaints.read().decode(errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "")
