"""The threads of the page: order, the newest of what is shown, and work for rest."""

from __future__ import annotations

import threading

import pytest

pytest.importorskip("viser")

from ffdcli.editor.page.worker import Worker


@pytest.fixture
def make():
    made = []

    def start(failed=lambda error: None, rest=lambda asked: None):
        made.append(Worker(failed, rest))
        made[-1].start()
        return made[-1]

    yield start
    for worker in made:
        worker.close()


def test_jobs_come_in_order_and_only_the_newest_is_shown(make):
    worker, done, gate, finished = make(), [], threading.Event(), threading.Event()
    worker.do(lambda: gate.wait(30))
    for number in range(5):
        worker.show(lambda number=number: done.append(f"shown {number}"))
    worker.do(lambda: done.append("first"))
    worker.do(lambda: done.append("second"))
    for number in range(5, 9):
        worker.show(lambda number=number: done.append(f"shown {number}"))
    # What is shown last comes after all jobs; to know that it has come, it tells.
    worker.show(lambda: (done.append("shown last"), finished.set()))
    gate.set()
    assert finished.wait(30)
    assert done == ["first", "second", "shown last"]


def test_a_job_that_fails_ends_nothing(make):
    errors, finished = [], threading.Event()
    worker = make(failed=errors.append)

    def fail():
        raise ValueError("no")

    worker.do(fail)
    worker.do(finished.set)
    assert finished.wait(30)
    assert [str(error) for error in errors] == ["no"]


def test_work_for_rest_waits_and_is_told_of_new_jobs(make):
    begun, asked_then, ended = threading.Event(), [], threading.Event()
    go_on = threading.Event()

    def rest(asked):
        if asked_then:
            ended.set()
            return
        asked_then.append(asked())
        begun.set()
        go_on.wait(30)
        asked_then.append(asked())

    worker = make(rest=rest)
    assert begun.wait(30)
    worker.do(lambda: None)
    go_on.set()
    # After the new job it comes again.
    assert ended.wait(30)
    assert asked_then == [False, True]
