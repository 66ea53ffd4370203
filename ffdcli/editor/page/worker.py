"""Threads of the page: one does what the user asks in order; one computes when nothing is asked."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from functools import partial

Job = Callable[[], None]

# Seconds without a job after which the work for rest begins.
_REST = 0.6


class Worker:
    """Does jobs one after another; of jobs that only show something, the newest alone.

    Parameters
    ----------
    failed : callable
        Called with the exception of a job; the worker goes on.
    rest : callable
        Called in a thread of its own once nothing has been asked for a while. It takes a function
        that tells whether something has been asked since.
    """

    def __init__(
        self, failed: Callable[[Exception], None], rest: Callable[[Callable[[], bool]], None]
    ) -> None:
        self._failed = failed
        self._rest = rest
        self._asked = threading.Condition()
        self._jobs: deque[Job] = deque()
        self._newest: Job | None = None
        self._count = 0
        self._rested = -1
        self._busy = False
        self._closed = False
        self._threads = [
            threading.Thread(target=run, daemon=True) for run in (self._work, self._work_at_rest)
        ]

    def start(self) -> None:
        """Begin with what has been asked, and with the work for rest."""
        for thread in self._threads:
            thread.start()

    def do(self, job: Job) -> None:
        """Do a job after all others. What was to be shown before it is dropped."""
        self._ask(job, None)

    def show(self, job: Job) -> None:
        """Do a job when all others are done, unless another such job comes before that."""
        self._ask(None, job)

    def close(self) -> None:
        """End the threads after the job that each does now."""
        with self._asked:
            self._closed = True
            self._asked.notify_all()
        for thread in self._threads:
            if thread.is_alive():
                thread.join(timeout=1)

    def _ask(self, job: Job | None, newest: Job | None) -> None:
        with self._asked:
            if job is not None:
                self._jobs.append(job)
            self._newest = newest
            self._count += 1
            self._asked.notify_all()

    def _work(self) -> None:
        while True:
            with self._asked:
                self._busy = False
                self._asked.notify_all()
                self._asked.wait_for(lambda: self._closed or self._jobs or self._newest)
                if self._closed:
                    return
                self._busy = True
                if self._jobs:
                    job = self._jobs.popleft()
                else:
                    assert self._newest is not None
                    job, self._newest = self._newest, None
            self._run(job)

    def _work_at_rest(self) -> None:
        while True:
            with self._asked:
                self._asked.wait_for(lambda: self._closed or self._waiting())
                seen = self._count
                moved = self._asked.wait_for(partial(self._asked_since, seen), _REST)
                if self._closed:
                    return
                if moved:
                    continue
                self._rested = seen
            self._run(partial(self._rest, partial(self._asked_since, seen)))

    def _asked_since(self, count: int) -> bool:
        """Whether a job has been asked for since there were so many, or the page is closed."""
        return self._closed or self._count != count

    def _waiting(self) -> bool:
        """Whether all jobs are done, and the work for rest is not."""
        return not self._busy and not self._jobs and self._rested != self._count

    def _run(self, job: Job) -> None:
        try:
            job()
        except Exception as error:
            self._failed(error)
