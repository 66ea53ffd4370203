import threading
import time

import pytest

from ffdcli.threads import in_threads, processors


@pytest.mark.parametrize("count", [1, 2, 8])
def test_results_come_in_the_jobs_order(monkeypatch, count):
    monkeypatch.setattr("ffdcli.threads.processors", lambda: count)
    assert in_threads([]) == []
    begun = threading.Barrier(min(count, 4), timeout=5)

    def job(number):
        if number < min(count, 4):
            # Only met where so many run at once.
            begun.wait()
        time.sleep(0.001 * (7 - number))
        return number

    jobs = [lambda n=n: job(n) for n in range(7)]
    assert in_threads(jobs) == list(range(7))
    assert processors() >= 1


def test_failures_come_out(monkeypatch):
    monkeypatch.setattr("ffdcli.threads.processors", lambda: 2)
    with pytest.raises(ZeroDivisionError):
        in_threads([lambda: 1, lambda: 1 // 0])
