"""What would take too much memory is refused before the work, with the number and what to do."""

import json
import subprocess
import sys

import pytest
import trimesh

from ffdcli import deform, pipeline, prepare, read_lattice, read_mesh
from ffdcli.errors import MemoryLimitError, lacks_memory
from ffdcli.forecast import require
from ffdcli.forecast.counts import Counts
from ffdcli.forecast.rates import Work, memory_of
from ffdcli.memory import LIMIT
from support.commands import COMMAND, ffd

MANY = Counts(1e6, 1e6, 1e6, 1.5e6, 3e6, 25e6, 10e6)
FEWER = Counts(1e6, 1e6, 1e6, 1.5e6, 3e6, 6e6, 4e6)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    trimesh.creation.icosphere(subdivisions=3).export(tmp_path / "ball.obj")
    (tmp_path / "twist.yaml").write_text(
        "version: 1\ndegree: [2, 2, 2]\npoints: [5, 5, 5]\nedits:\n- twist: {axis: w, angle: 40}\n"
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_more_work_takes_more():
    alone = memory_of(Work(), MANY, MANY)
    direct = memory_of(Work("STEP", "direct"), MANY, MANY)
    judged = memory_of(Work("STEP", "direct", judged=True), MANY, MANY)
    kernel = memory_of(Work("STEP"), MANY, MANY)
    assert alone <= direct < judged
    assert direct < kernel / 3
    assert memory_of(Work("STEP", tolerance=1.0), MANY, FEWER) < kernel


def test_a_tolerance_is_asked_for_its_share_only_where_that_decides(monkeypatch):
    work, asked = Work("STEP", tolerance=1.0), []

    def made():
        asked.append(1)
        return FEWER

    monkeypatch.setenv(LIMIT, "10TB")
    assert require.require_memory(work, MANY, made).needed == memory_of(work, MANY, MANY)
    assert not asked
    enough = memory_of(work, MANY, FEWER)
    monkeypatch.setenv(LIMIT, str(enough))
    assert require.require_memory(work, MANY, made).needed == enough
    assert asked == [1]
    monkeypatch.setenv(LIMIT, str(enough - 1))
    with pytest.raises(MemoryLimitError):
        require.require_memory(work, MANY, made)


def test_what_the_run_holds_counts_as_free_but_not_what_else_the_process_holds(monkeypatch):
    monkeypatch.delenv(LIMIT, raising=False)
    monkeypatch.setattr(require, "available_bytes", lambda: 1000)
    monkeypatch.setattr(require, "held_bytes", lambda: 5 * 10**12)
    room = require.foresee(Work(), MANY, MANY).room
    assert 1000 < room < 1e11
    monkeypatch.setattr(require, "held_bytes", lambda: 7)
    assert require.foresee(Work(), MANY, MANY).room == 1007


@pytest.mark.parametrize("stage", ["before the cut", "planned"])
def test_before_the_cut_and_once_it_is_planned(folder, monkeypatch, stage):
    mesh = read_mesh("ball.obj")
    lattice = read_lattice("twist.yaml", mesh)
    monkeypatch.setenv(LIMIT, "50MB")
    if stage == "before the cut":
        monkeypatch.setattr(pipeline, "MANY", 1000)
        monkeypatch.setattr(pipeline, "partition", None)
    with pytest.raises(MemoryLimitError, match=r"50\.0 MB can be had") as caught:
        prepare(mesh, lattice)
    assert isinstance(caught.value, MemoryError)
    assert lacks_memory(caught.value)
    with pytest.raises(MemoryLimitError):
        deform(mesh, lattice)


def test_a_result_is_not_written(folder, monkeypatch):
    mesh = read_mesh("ball.obj")
    result = deform(mesh, read_lattice("twist.yaml", mesh))
    (folder / "out.step").write_text("old")
    needed = result.write("a.step", writer="direct").memory.needed
    monkeypatch.setenv(LIMIT, str(needed))
    result.write("a.step", writer="direct")
    with pytest.raises(MemoryLimitError, match="of memory") as caught:
        result.write("out.step")
    assert "`--writer direct` takes about" in caught.value.hint
    assert "still too much" not in caught.value.hint
    assert (folder / "out.step").read_text() == "old"
    with pytest.raises(MemoryLimitError) as caught:
        result.write("out.igs")
    assert "a .step file by `--writer direct` takes about" in caught.value.hint
    monkeypatch.setenv(LIMIT, "none")
    report = result.write("out.step", writer="direct").report
    assert report["memory"] == {"needed": needed, "available": None}


def test_the_command_refuses_with_the_number_and_what_to_do(folder):
    run = ("deform", "ball.obj", "twist.yaml", "-o", "out.step", "--memory", "120MB", "--json")
    failed = ffd(*run, status=1)
    error = json.loads(failed.stdout)["error"]
    assert error["kind"] == "memory"
    assert "120.0 MB can be had" in error["message"]
    assert "`--writer direct` takes about" in error["hint"]
    assert "`--tolerance` writes fewer control points" in error["hint"]
    assert "`--memory none`" in error["hint"]
    assert sorted(path.name for path in folder.iterdir()) == ["ball.obj", "twist.yaml"]


def test_an_amount_that_is_none_is_wrong_usage(folder, monkeypatch):
    run = ("deform", "ball.obj", "twist.yaml", "-o", "out.step")
    assert "'lots' is no amount of memory" in ffd(*run, "--memory", "lots", status=2).output
    monkeypatch.setenv(LIMIT, "lots")
    assert (
        "the variable FFD_MEMORY: 'lots' is no" in ffd(*run, "--writer", "direct", status=1).output
    )
    # The option counts, and is forgotten afterwards.
    ffd(*run, "--writer", "direct", "--memory", "none")
    assert ffd(*run, "--writer", "direct", status=1)


def test_a_dry_run_says_it_for_both_writers_and_is_not_refused(folder):
    run = ("deform", "ball.obj", "twist.yaml", "--dry-run", "--memory", "280MB", "--json")
    kernel = json.loads(ffd(*run).stdout)
    direct = json.loads(ffd(*run, "--writer", "direct").stdout)
    reduced = json.loads(ffd(*run, "--tolerance", "1e-4").stdout)
    for report, writer in ((kernel, "kernel"), (direct, "direct")):
        assert report["memory"]["needed"] == report["memory"]["by_writer"][writer]
        assert report["memory"]["available"] == 280e6
    assert kernel["memory"]["by_writer"] == direct["memory"]["by_writer"]
    assert kernel["warnings"] == ["the run would be refused: it takes more memory than can be had"]
    assert direct["warnings"] == []
    assert reduced["control_points"] < kernel["control_points"] / 2
    assert reduced["bytes"] < 0.6 * kernel["bytes"]
    iges = json.loads(ffd(*run, "-o", "a.igs").stdout)
    assert list(iges["memory"]["by_writer"]) == ["kernel"]
    said = ffd(*run[:-1]).stdout.splitlines()[1]
    assert said.startswith("memory: about ")
    assert said.endswith(" with --writer direct); 280.0 MB can be had")


def peak(*options):
    done = subprocess.run(
        [*COMMAND, "deform", "ball.obj", "twist.yaml", "-o", "a.step", *options],
        capture_output=True,
        text=True,
        check=True,
    )
    report = json.loads(done.stdout)
    peaks = [
        each["peak_bytes"] + each.get("kernel_peak_bytes", 0)
        for each in report["profile"]
        if each["peak_bytes"]
    ]
    return report["memory"]["needed"], max(peaks)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells the peak of a stage")
@pytest.mark.parametrize(
    "options", [["--writer", "direct"], pytest.param([], marks=pytest.mark.sweep)]
)
def test_the_forecast_is_near_what_is_measured(folder, options):
    told, taken = peak(*options, "--json", "--quiet", "--profile")
    # Loose: other machines have other libraries, and page sizes.
    assert 0.6 * taken < told < 2 * taken
