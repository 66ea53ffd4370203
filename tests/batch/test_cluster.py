"""The same jobs on a real dask.distributed cluster on this machine."""

import json
import subprocess
import sys
from contextlib import ExitStack, contextmanager

import pytest

from ffdcli.batch import list_jobs, run_batch
from ffdcli.batch.events import Ended
from ffdcli.errors import BatchError
from support.batch_models import environment, fill_folder, run
from support.commands import wait_until

pytest.importorskip("distributed")

EPOCH = {"SOURCE_DATE_EPOCH": "1700000000"}
JOBS = """\
version: 1
jobs:
  - mesh: [cube.obj, slab.obj]
    lattice: lattice.yaml
    parameters: {height: [0, 1, 2, 3, 4, 5]}
    output: "OUT/{mesh}-{height}.step"
  - {mesh: no.obj, lattice: plain.yaml, output: OUT/bad.step}
"""


@contextmanager
def started(module, *arguments):
    process = subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{module}", "--host", "127.0.0.1", *arguments],
        env=environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.fixture
def cluster(tmp_path):
    """Address of a scheduler, and its two worker processes."""
    file = tmp_path / "scheduler.json"
    shared = ("--scheduler-file", str(file), "--no-dashboard")
    with ExitStack() as stack:
        stack.enter_context(started("dask_scheduler", "--port", "0", *shared))
        # The file is there before its text is.
        wait_until(lambda: file.exists() and file.read_text().rstrip().endswith("}"))
        worker = ("dask_worker", "--no-nanny", "--nthreads", "1", *shared)
        scratch = ("--local-directory", str(tmp_path / "dask"))
        workers = [stack.enter_context(started(*worker, *scratch)) for _ in range(2)]
        yield json.loads(file.read_text())["address"], workers


def test_same_bytes_although_a_worker_is_lost(tmp_path, cluster, monkeypatch):
    address, workers = cluster
    folder = fill_folder(tmp_path)
    (folder / "here.yaml").write_text(JOBS.replace("OUT", "here"))
    (folder / "there.yaml").write_text(JOBS.replace("OUT", "there"))
    local = run(folder, "here.yaml", "--jobs", 1, status=1, **EPOCH)
    assert (local["passed"], local["failed"]) == (12, 1)

    ended = []

    def tell(event):
        if isinstance(event, Ended):
            ended.append(event.record)
            if len(ended) == 2:
                workers[0].kill()

    monkeypatch.setenv("SOURCE_DATE_EPOCH", EPOCH["SOURCE_DATE_EPOCH"])
    outcome = run_batch(
        list_jobs(folder / "there.yaml"), folder / "there.jsonl", scheduler=address, on_event=tell
    )
    assert workers[0].wait() == -9
    assert (outcome.passed, outcome.counts["failed"]) == (12, 1)
    assert len(ended) == 13
    here = {path.name: path.read_bytes() for path in (folder / "here").iterdir()}
    there = {path.name: path.read_bytes() for path in (folder / "there").iterdir()}
    assert len(here) == 12
    assert here == there
    # Through the command line, and nothing left to do but what failed.
    again = run(
        folder, "there.yaml", "--manifest", "there.jsonl", "--scheduler", address, status=1, **EPOCH
    )
    assert (again["kept"], again["failed"]) == (12, 1)


def test_no_scheduler(tmp_path, monkeypatch):
    from ffdcli.batch import cluster

    monkeypatch.setattr(cluster, "_CONNECT_TIMEOUT", "1s")
    folder = fill_folder(tmp_path)
    (folder / "jobs.yaml").write_text(JOBS)
    with pytest.raises(BatchError, match=r"no scheduler answers at tcp://127\.0\.0\.1:9"):
        run_batch(
            list_jobs(folder / "jobs.yaml"), folder / "m.jsonl", scheduler="tcp://127.0.0.1:9"
        )
