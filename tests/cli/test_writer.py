"""`--writer direct` and `--check`: what they do, refuse and load."""

import json
import os
import signal
import subprocess
import sys

import pytest
import yaml

from ffdcli.brep.evaluate import own_check
from ffdcli.brep.record import Brep
from ffdcli.files import whole_file, write_whole
from support.commands import COMMAND, KernelHere, ffd, wait_until
from support.places import ROOT

LATTICE = "version: 1\nedits:\n- move: {at: [2, 2, 2], by: [0.1, 0, 0.2]}\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    import trimesh

    trimesh.creation.box().export(tmp_path / "box.obj")
    (tmp_path / "lattice.yaml").write_text(LATTICE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    return tmp_path


def test_the_file_passes_verification_and_opencascade_is_not_loaded(folder):
    code = (
        "import sys\nfrom ffdcli.cli import main\n"
        "try:\n    main()\n"
        "finally:\n    print(sorted(m for m in sys.modules if m in ('OCP', 'cadquery')))"
    )
    arguments = ["deform", "box.obj", "lattice.yaml", "-o", "out.step", "--writer", "direct"]
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments, "--quiet"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines()[-1] == "[]"
    ffd("verify", "out.step", "box.obj", "lattice.yaml")


class NoKernel(KernelHere):
    def __init__(self):
        raise AssertionError("OpenCascade is started")


def test_the_kernel_is_asked_for_its_verdict_only_if_told(folder, monkeypatch):
    asked = []
    verdict = KernelHere.verdict
    monkeypatch.setattr(KernelHere, "verdict", lambda self: asked.append(1) or verdict(self))
    run = ("deform", "box.obj", "lattice.yaml", "-o", "out.step")
    ffd(*run, "--writer", "direct", kernel=NoKernel)
    plain = (folder / "out.step").read_bytes()
    ffd(*run, "--writer", "direct", "--check", "kernel")
    assert asked == [1]
    assert (folder / "out.step").read_bytes() == plain
    ffd(*run, "--check", "own")
    assert asked == [1]
    ffd(*run)
    assert asked == [1, 1]


def test_a_verdict_that_is_no_leaves_the_old_file(folder, monkeypatch):
    from ffdcli.brep.occ.check import KernelVerdict

    monkeypatch.setattr(KernelHere, "verdict", lambda _: KernelVerdict(False, True, ("face 1",)))
    (folder / "out.step").write_text("old")
    before = sorted(folder.iterdir())
    run = ("deform", "box.obj", "lattice.yaml", "-o", "out.step", "--writer", "direct")
    failed = ffd(*run, "--check", "kernel", status=1)
    assert "OpenCascade does not accept the result: face 1" in failed.output
    assert (folder / "out.step").read_text() == "old"
    assert sorted(folder.iterdir()) == before


def test_the_own_check_runs(folder, monkeypatch):
    seen = []
    monkeypatch.setattr(own_check, "require_sound", lambda brep, hint: seen.append(brep) or ())
    run = ("deform", "box.obj", "lattice.yaml", "-o", "out.step", "--writer", "direct")
    ffd(*run)
    assert [type(brep) for brep in seen] == [Brep]
    ffd(*run, "--no-check")
    assert len(seen) == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("-o", "a.igs"), "--writer direct needs an output in STEP."),
        (("-o", "a.brep"), "--writer direct needs an output in STEP."),
        (("-o", "a.stl"), "--writer direct needs an output in STEP."),
        (("-o", "a.step", "--check", "own", "--no-check"), "exclude each other"),
    ],
)
def test_what_does_not_go_together_is_wrong_usage(folder, options, said):
    run = ("deform", "box.obj", "lattice.yaml", "--writer", "direct")
    assert said in ffd(*run, *options, status=2).output


def test_parts_with_curved_faces_are_refused():
    part, lattice = ROOT / "samples/cad/bracket.step", ROOT / "samples/cad/bracket.yaml"
    run = ("deform", part, lattice, "-o", "never.step", "--writer", "direct")
    assert "--writer direct needs a mesh, or a part of planes" in ffd(*run, status=2).output


def test_a_batch_refuses_parts_with_curved_faces(folder):
    samples = {"mesh": str(ROOT / "samples/cad/bracket.step")}
    samples["lattice"] = str(ROOT / "samples/cad/bracket.yaml")
    jobs = {"version": 1, "options": {"writer": "direct"}, "jobs": [samples | {"output": "a.step"}]}
    (folder / "jobs.yaml").write_text(yaml.safe_dump(jobs))
    failed = ffd("batch", "jobs.yaml", "--json", status=1)
    assert "the writer `direct` takes meshes" in failed.stdout
    assert not (folder / "a.step").exists()


def test_python_refuses_other_formats_with_a_hint(folder):
    from ffdcli import deform, read_lattice, read_mesh
    from ffdcli.errors import FileError, KernelError

    mesh = read_mesh("box.obj")
    result = deform(mesh, read_lattice("lattice.yaml", mesh))
    with pytest.raises(FileError, match="only OpenCascade writes IGES files") as caught:
        result.write("a.igs", writer="direct")
    assert caught.value.hint == "use the writer `kernel`, or write .step"
    with pytest.raises(KernelError, match="there is no writer 'fast'"):
        result.write("a.step", writer="fast")
    assert result.write("a.step", writer="direct").bytes == os.path.getsize("a.step")


def test_a_batch_takes_the_writer(folder):
    jobs = {
        "version": 1,
        "verify": True,
        "options": {"writer": "direct", "check": "own"},
        "jobs": [{"mesh": "box.obj", "lattice": "lattice.yaml", "output": "{mesh}.step"}],
    }
    (folder / "jobs.yaml").write_text(yaml.safe_dump(jobs))
    ffd("batch", "jobs.yaml")
    ffd("deform", "box.obj", "lattice.yaml", "-o", "box2.step", "--writer", "direct")
    alone = (folder / "box2.step").read_bytes().replace(b"box2.step", b"box.step")
    assert (folder / "box.step").read_bytes() == alone


SLOW = """
import sys
from ffdcli.brep.labels import label_shape
from ffdcli.brep.step.write import write_step
from support import brep_models as models

brep = models.grid_of_cubes(60, models.bumpy)
write_step(brep, sys.argv[1], labels=label_shape(brep, "a", None), values=1)
print("done")
"""


@pytest.mark.parametrize("signum", [signal.SIGKILL, signal.SIGINT])
def test_a_run_killed_in_mid_write_leaves_the_old_file(tmp_path, signum):
    out = tmp_path / "out.step"
    out.write_text("precious")
    paths = os.pathsep.join([str(ROOT), str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")])
    run = subprocess.Popen(
        [sys.executable, "-c", SLOW, str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": paths},
    )
    wait_until(lambda: [p for p in tmp_path.glob(".*.part") if p.stat().st_size > 100_000], run)
    run.send_signal(signum)
    said, _ = run.communicate()
    assert said == b""
    assert out.read_text() == "precious"
    left = [path for path in tmp_path.iterdir() if path != out]
    assert len(left) == (signum == signal.SIGKILL)
    for path in left:
        assert path.name.startswith(".out.step.")
        assert path.suffix == ".part"
        # Long ago, for the next run.
        os.utime(path, (0, 0))
    write_whole(out, b"new")
    assert list(tmp_path.iterdir()) == [out]


def test_what_another_run_is_writing_stays(tmp_path):
    out = tmp_path / "out.step"
    with whole_file(out) as first:
        first.write(b"first")
        first.flush()
        os.utime(first.name, (0, 0))
        write_whole(out, b"second")
        assert out.read_bytes() == b"second"
    assert out.read_bytes() == b"first"
    assert list(tmp_path.iterdir()) == [out]


STOPPED = """
import signal, sys, time
from ffdcli.brep.step.entities import Entities
from ffdcli.cli import main

whole = Entities.pieces

def pieces(self, values):
    for count, piece in enumerate(whole(self, 1)):
        if count == 20:
            print("writing", flush=True)
            time.sleep(60)
        yield piece

Entities.pieces = pieces
signal.signal(signal.SIGINT, signal.default_int_handler)
main(sys.argv[1:])
"""


@pytest.mark.parametrize("as_json", [False, True])
def test_ctrl_c_in_mid_write_says_so_and_leaves_the_old_file(folder, as_json):
    (folder / "out.step").write_text("precious")
    words = ["deform", "box.obj", "lattice.yaml", "-o", "out.step", "--writer", "direct"]
    before = sorted(folder.iterdir())
    run = subprocess.Popen(
        [sys.executable, "-c", STOPPED, *words, *(["--json"] if as_json else [])],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])},
        text=True,
    )
    assert run.stdout.readline() == "writing\n"
    assert list(folder.glob(".out.step.*.part"))
    run.send_signal(signal.SIGINT)
    printed, said = run.communicate()
    assert (run.returncode, said.strip()) == (130, "interrupted")
    assert (json.loads(printed)["error"]["kind"] == "interrupted") if as_json else printed == ""
    assert sorted(folder.iterdir()) == before
    assert (folder / "out.step").read_text() == "precious"


@pytest.mark.parametrize(
    "options", [[], pytest.param(["--tolerance", "1e-4"], marks=pytest.mark.sweep)]
)
def test_the_same_bytes_however_many_threads(folder, options):
    import trimesh

    trimesh.creation.icosphere(subdivisions=2).export(folder / "ball.obj")
    (folder / "twist.yaml").write_text(
        "version: 1\ndegree: [2, 2, 2]\npoints: [5, 5, 5]\nedits:\n- twist: {axis: w, angle: 40}\n"
    )
    words = ["deform", "ball.obj", "twist.yaml", "-o", "out.step", "--writer", "direct"]
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []

    def written(threads, processors):
        def limit():
            os.sched_setaffinity(0, processors)

        numbers = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), str(threads))
        subprocess.run(
            [*COMMAND, *words, *options, "--quiet"],
            env={**os.environ, **numbers},
            preexec_fn=limit if processors else None,
            check=True,
        )
        return (folder / "out.step").read_bytes()

    assert written(1, cores[:1]) == written(2, cores)


def test_a_full_disk_leaves_the_old_file(tmp_path):
    resource = pytest.importorskip("resource")
    out = tmp_path / "out.step"
    out.write_text("precious")
    paths = os.pathsep.join([str(ROOT), str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")])

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

    done = subprocess.run(
        [sys.executable, "-c", SLOW, str(out)],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": paths},
        preexec_fn=limit,
        check=False,
    )
    assert "cannot write the file" in done.stderr
    assert out.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [out]


def test_the_command_is_that_of_a_person(folder):
    arguments = ["deform", "box.obj", "lattice.yaml", "-o", "out.step", "--writer", "direct"]
    done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("out.step: 1 solid")
