"""A run that is ended from outside leaves nothing half-written and loses nothing."""

import signal
import subprocess
import sys
import time

import pytest

SCRIPT = """
import sys, time
import ffdcli.brep.occ.write as write
from ffdcli.cli import main

def slow(*_):
    print("writing", flush=True)
    time.sleep(60)

write._step_bytes = slow
main()
"""
CUBE = "\n".join(
    [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    + ["f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5", "f 2 6 8 4", ""]
)


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_write_leaves_the_old_file(tmp_path, signum):
    (tmp_path / "cube.obj").write_text(CUBE)
    (tmp_path / "lattice.yaml").write_text("version: 1\ndegree: [2, 2, 2]\npoints: [3, 3, 3]\n")
    out = tmp_path / "out.step"
    out.write_text("precious")
    before = sorted(path.name for path in tmp_path.iterdir())
    arguments = ["deform", "cube.obj", "lattice.yaml", "-o", "out.step"]
    run = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, *arguments],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert run.stdout.readline() == "writing\n"
    time.sleep(0.2)
    run.send_signal(signum)
    _, said = run.communicate(timeout=30)
    assert run.returncode == 128 + signum
    assert "Traceback" not in said
    assert out.read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == before
