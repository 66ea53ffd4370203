"""Whole batches: bad jobs among good ones, kills, interruptions, resuming, memory."""

import csv
import os
import random
import signal
import subprocess
import time
from collections import Counter
from types import SimpleNamespace

import pytest

from ffdcli.batch import StopSignal, list_jobs, pool, run_batch
from ffdcli.batch.events import Began, Ended
from ffdcli.batch.jobs import Job
from ffdcli.batch.places import digest
from support.batch_models import command, environment, fill_folder, lines, run
from support.commands import wait_until

EPOCH = {"SOURCE_DATE_EPOCH": "1700000000"}
BAD = """\
  - {mesh: no.obj, lattice: plain.yaml, output: bad/mesh.step}
  - {mesh: cube.obj, lattice: no.yaml, output: bad/lattice.step}
  - {mesh: cube.obj, lattice: bad.yaml, output: bad/yaml.step}
  - {mesh: cube.obj, lattice: lattice.yaml, output: bad/parameter.step}
  - {mesh: open.obj, lattice: plain.yaml, output: bad/open.step, options: {require_solid: true}}
  - {mesh: segv.obj, lattice: plain.yaml, output: bad/segv.step}
  - {mesh: kill.obj, lattice: plain.yaml, output: bad/kill.step}
"""
REASONS = {
    "bad/mesh.step": ("read mesh", "no.obj: there is no such file"),
    "bad/lattice.step": ("read lattice", "no.yaml: there is no such file"),
    "bad/yaml.step": ("read lattice", "bad.yaml:6: edits[1].twist.angel"),
    "bad/parameter.step": ("read lattice", "there is no value for ${height}"),
    "bad/open.step": ("check mesh", "the mesh is open, and a solid is required"),
    "bad/segv.step": ("read mesh", "was killed by SIGSEGV"),
    "bad/kill.step": ("read mesh", "was killed by SIGKILL (possibly out of memory)"),
}


def matrix(heights, *, scales=(1,), verify=False):
    return (
        f"version: 1\nverify: {str(verify).lower()}\njobs:\n"
        "  - mesh: [cube.obj, slab.obj]\n"
        "    lattice: lattice.yaml\n"
        f"    parameters: {{height: {list(heights)}}}\n"
        f"    scale: {list(scales)}\n"
        '    output: "out/{mesh}-{height}-{scale}.step"\n'
    )


@pytest.fixture
def folder(tmp_path):
    return fill_folder(tmp_path)


def require_whole(folder, facts):
    """Outputs are there, are what the manifest says, and nothing else lies beside them."""
    outputs = {job["output"] for job in facts["jobs"] if job["status"] in ("done", "verified")}
    found = {path.relative_to(folder).as_posix() for path in folder.glob("out/*")}
    found |= {path.relative_to(folder).as_posix() for path in folder.glob("bad/*")}
    assert found == outputs
    for job in facts["jobs"]:
        if job["output"] in outputs:
            assert digest(str(folder), job["output"]) == job["sha256"]


def test_bad_jobs_harm_no_others(folder):
    text = matrix([0, 1, 2]) + BAD
    text += "  - {mesh: cube.obj, lattice: plain.yaml, output: out/verified.step, verify: true}\n"
    (folder / "jobs.yaml").write_text(text)
    facts = run(folder, "jobs.yaml", "-j", 2, status=1, crashing=True)
    counts = Counter(job["status"] for job in facts["jobs"])
    assert counts == {"done": 6, "verified": 1, "failed": 7}
    assert (facts["total"], facts["passed"], facts["failed"], facts["kept"]) == (14, 7, 7, 0)
    failed = {job["output"]: job for job in facts["jobs"] if job["status"] == "failed"}
    require_reasons(failed)
    require_whole(folder, facts)
    with (folder / "summary.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["output"] for row in rows] == [job["output"] for job in facts["jobs"]]
    assert {row["output"] for row in rows if row["reason"]} == set(REASONS)

    # A second run, told what is wrong no longer, does only what failed or has changed.
    (folder / "no.obj").write_bytes((folder / "cube.obj").read_bytes())
    (folder / "out" / "cube-1-1.step").unlink()
    (folder / "out" / "slab-1-1.step").write_text("changed")
    again = run(folder, "jobs.yaml", "-j", 2, status=1)
    assert (again["passed"], again["failed"], again["kept"]) == (7 + 3, 4, 5)
    require_whole(folder, again)


def require_reasons(failed):
    assert set(failed) == set(REASONS)
    for output, (stage, said) in REASONS.items():
        error = failed[output]["error"]
        text = f"{error['file']}:{error['line']}: {error['key']}: {error['message']}"
        assert failed[output]["stage"] == stage, output
        assert said.split(": ")[-1] in text, output


def test_rejected_wins_over_failed(folder):
    (folder / "jobs.yaml").write_text(
        "version: 1\njobs:\n"
        "  - {mesh: no.obj, lattice: plain.yaml, output: a.step}\n"
        "  - {mesh: cube.obj, lattice: plain.yaml, output: b.step, verify: {tolerance: 1e-300}}\n"
    )
    facts = run(folder, "jobs.yaml", "-j", 1, status=3)
    assert (facts["rejected"], facts["failed"]) == (1, 1)


def test_what_is_printed(folder):
    (folder / "jobs.yaml").write_text(matrix([0]) + BAD.splitlines()[0] + "\n")
    done = subprocess.run(
        command("jobs.yaml", "-j", "1"), cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stdout.startswith("3 jobs: 2 done, 1 failed, in ")
    assert done.stdout.endswith(" s; see summary.csv\n")
    assert len(done.stdout.splitlines()) == 1
    assert "\x1b" not in done.stderr
    assert "[3/3] " in done.stderr
    assert "failed  bad/mesh.step  read mesh  " in done.stderr
    quiet = subprocess.run(
        command("jobs.yaml", "--quiet"), cwd=folder, capture_output=True, text=True
    )
    assert quiet.stderr.splitlines()[0].split() == ["status", "output", "stage", "reason"]
    assert len(quiet.stderr.splitlines()) == 2


def test_killed_at_random_and_resumed(folder):
    """Killed with -9, no matter when: nothing that was done is lost or done twice."""
    chance = random.Random(0)
    (folder / "jobs.yaml").write_text(matrix(range(12)))
    manifest = folder / "manifest.jsonl"
    for more in chance.sample([0, 1, 2, 4], 2):
        goal = more + len(list(folder.glob("out/*.step")))
        started = subprocess.Popen(
            command("jobs.yaml", "-j", "2"),
            cwd=folder,
            env=environment(**EPOCH),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        wait_until(lambda goal=goal: len(list(folder.glob("out/*.step"))) >= goal)
        time.sleep(chance.uniform(0, 0.3))
        started.kill()
        started.wait()
        for path in folder.glob("out/*.step"):
            assert path.read_bytes().endswith(b"END-ISO-10303-21;\n"), path
    before = lines(manifest)
    facts = run(folder, "jobs.yaml", "-j", 2, **EPOCH)
    assert facts["passed"] == facts["total"] == 24
    assert facts["kept"] == len(before)
    assert set(Counter(record["output"] for record in lines(manifest)).values()) == {1}
    require_whole(folder, facts)


@pytest.mark.parametrize("times", [1, 2])
def test_interrupted(folder, times):
    """Ctrl-C once finishes the jobs under way; twice gives them up."""
    (folder / "jobs.yaml").write_text(matrix(range(40)))
    started = subprocess.Popen(
        command("jobs.yaml", "-j", "2"),
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while "[3/80]" not in (line := started.stderr.readline()):
        assert line, started.wait()
    started.send_signal(signal.SIGINT)
    while "finishing the running jobs" not in (line := started.stderr.readline()):
        assert line, started.wait()
    if times == 2:
        started.send_signal(signal.SIGINT)
    out, said = started.communicate()
    assert started.returncode == 130, said
    assert " not run" in out
    done = [record["output"] for record in lines(folder / "manifest.jsonl")]
    assert 3 <= len(done) < 80
    assert not list(folder.glob("out/.*"))
    if times == 1:
        assert sorted(done) == sorted(f"out/{path.name}" for path in folder.glob("out/*"))


def test_memory_decides_how_many_run_at_a_time(folder, monkeypatch):
    """With memory for one job only, no second process is started."""
    (folder / "jobs.yaml").write_text(matrix([0, 1]))
    monkeypatch.setattr(pool, "free_bytes", lambda _: 100)
    processes = set()
    outcome = run_batch(
        list_jobs(folder / "jobs.yaml"),
        folder / "m.jsonl",
        workers=2,
        on_event=lambda event: processes.add(getattr(event, "process", None)),
    )
    assert outcome.exit_status == 0
    assert len(processes - {None}) == 1


def test_a_job_refused_beside_others_runs_again_alone():
    """It has failed only where no other job held memory meanwhile."""
    large, small, last = (Job(f"{name}.obj", "a.yaml", name) for name in ("large", "small", "last"))
    jobs = pool._Pool(pool._Queue([last]), 2, None)
    first, second = (SimpleNamespace(job=job, last=job) for job in (large, small))
    jobs.workers = [first, second]
    refused = {"record": {"error": {"kind": "memory"}}}
    assert list(jobs._events_of(first, large, refused)) == []
    assert first.job is None
    # The small job runs still: neither the large one nor, after it, any other begins.
    assert list(jobs.assign_jobs()) == []
    (ended,) = jobs._events_of(second, small, {"record": {}})
    assert ended == Ended(small, {})
    first.job = jobs.queue.pop(("large.obj", "a.yaml"))
    assert jobs._one_is_alone(last)
    assert list(jobs._events_of(first, large, refused)) == [Ended(large, refused["record"])]


def test_a_limit_that_no_job_keeps(folder):
    (folder / "jobs.yaml").write_text(matrix([0]))
    facts = run(folder, "jobs.yaml", "--memory", "20MB", status=1)
    for job in facts["jobs"]:
        assert job["error"]["kind"] == "memory"
        assert "20.0 MB can be had" in job["error"]["message"]
        assert "--memory none" in job["error"]["hint"]
    assert not list(folder.glob("out/*"))


def test_process_killed_from_outside(folder):
    """The job that was under way has failed with its stage; its process is replaced."""
    (folder / "jobs.yaml").write_text(matrix([0, 1, 2]))
    seen = []

    def tell(event):
        if isinstance(event, Began):
            seen.append(event.process)
            if event.job.output == "out/cube-1-1.step" and event.stage == "surfaces":
                os.kill(event.process, signal.SIGKILL)

    outcome = run_batch(
        list_jobs(folder / "jobs.yaml"), folder / "m.jsonl", workers=1, on_event=tell
    )
    (failed,) = (record for record in outcome.records if record["status"] == "failed")
    assert failed["output"] == "out/cube-1-1.step"
    assert failed["error"]["kind"] == "crash"
    assert failed["stage"] not in ("start", "read mesh")
    assert outcome.passed == 5
    assert len(set(seen)) == 2


def test_a_job_over_the_limit_is_stopped(folder, monkeypatch, tmp_path_factory):
    """The clock is turned on while the job reads a file that never comes; the others are done."""
    text = matrix([0]) + "  - {mesh: hang.obj, lattice: plain.yaml, output: out/late.step}\n"
    (folder / "jobs.yaml").write_text(text)
    monkeypatch.setenv("PYTHONPATH", environment(crashing=True)["PYTHONPATH"])
    monkeypatch.setattr(pool.tempfile, "tempdir", str(tmp_path_factory.mktemp("scratch")))
    turned, processes = 0.0, {}

    def tell(event):
        nonlocal turned
        if isinstance(event, Began):
            processes.setdefault(event.job.output, event.process)
            if (event.job.output, event.stage) == ("out/late.step", "read mesh"):
                turned = 5000.0

    clock = time.perf_counter
    monkeypatch.setattr(pool.time, "perf_counter", lambda: clock() + turned)
    jobs = list_jobs(folder / "jobs.yaml")
    outcome = run_batch(
        [jobs[-1], *jobs[:-1]], folder / "m.jsonl", workers=1, timeout=3000.0, on_event=tell
    )
    assert outcome.counts == {"done": 2, "failed": 1}
    failed = outcome.records[0]
    assert failed["output"] == "out/late.step"
    assert failed["stage"] == "read mesh"
    assert failed["error"]["kind"] == "timeout"
    assert failed["error"]["message"] == "the job took longer than 3000 s and was stopped"
    assert not os.path.exists(f"/proc/{processes['out/late.step']}")
    assert len(set(processes.values())) == 2
    assert os.listdir(pool.tempfile.tempdir) == []


@pytest.mark.parametrize(
    "words", [["--timeout", "0"], ["--timeout", "5", "--scheduler", "tcp://localhost:1"]]
)
def test_limits_that_cannot_be(folder, words):
    (folder / "jobs.yaml").write_text(matrix([0]))
    done = subprocess.run(command("jobs.yaml", *words), cwd=folder, capture_output=True, text=True)
    assert done.returncode == 2
    assert "--timeout" in done.stderr


def test_stop_signal(folder):
    """Pulled from within Python: what is under way ends, the rest is not run."""
    (folder / "jobs.yaml").write_text(matrix([0, 1, 2]))
    stop = StopSignal()

    def tell(event):
        if isinstance(event, Ended):
            stop.level = 1

    outcome = run_batch(
        list_jobs(folder / "jobs.yaml"), folder / "m.jsonl", workers=1, stop=stop, on_event=tell
    )
    assert outcome.interrupted
    assert outcome.counts == {"done": 1, "not run": 5}


@pytest.mark.sweep
def test_two_hundred_jobs(folder):
    """Ten bad ones among 200; interrupted twice, resumed; 190 outputs, all verified."""
    bad = [*BAD.splitlines(), *(line.replace("bad/", "bad/2-") for line in BAD.splitlines()[:3])]
    text = matrix(range(19), scales=(0.2, 0.4, 0.6, 0.8, 1), verify=True)
    (folder / "jobs.yaml").write_text(text + "\n".join(bad) + "\n")
    for stop, code in ((signal.SIGINT, 130), (signal.SIGKILL, -9)):
        started = subprocess.Popen(
            command("jobs.yaml", "-j", "2"),
            cwd=folder,
            env=environment(crashing=True),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        while "[20/" not in (line := started.stderr.readline()):
            assert line, started.wait()
        started.send_signal(stop)
        started.communicate()
        assert started.returncode == code
    passed = [r for r in lines(folder / "manifest.jsonl") if r["status"] == "verified"]
    facts = run(folder, "jobs.yaml", "-j", 2, status=1, crashing=True)
    assert (facts["total"], facts["passed"], facts["failed"]) == (200, 190, 10)
    assert facts["kept"] == len(passed) >= 20
    assert {job["status"] for job in facts["jobs"]} == {"verified", "failed"}
    failed = {job["output"]: job for job in facts["jobs"] if job["status"] == "failed"}
    assert len(failed) == 10
    require_reasons({name: job for name, job in failed.items() if "2-" not in name})
    require_whole(folder, facts)
