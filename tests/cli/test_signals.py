"""A run that is ended from outside ends at once, leaves nothing half-written and loses nothing."""

import os
import signal
import subprocess
import sys

import pytest
import trimesh

from support.commands import COMMAND, wait_until


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_write_leaves_the_old_file(tmp_path, signum):
    # So many facets that OpenCascade takes seconds to write them, and holds the interpreter's lock.
    trimesh.creation.icosphere(subdivisions=4).export(tmp_path / "ball.obj")
    (tmp_path / "lattice.yaml").write_text(
        "version: 1\nedits:\n- move: {at: [2, 2, 2], by: [0.1, 0, 0]}\n"
    )
    out = tmp_path / "out.step"
    out.write_text("precious")
    before = sorted(path.name for path in tmp_path.iterdir())
    run = subprocess.Popen(
        [*COMMAND, "deform", "ball.obj", "lattice.yaml", "-o", "out.step", "--no-check"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    (part,) = wait_until(lambda: list(tmp_path.glob(".out.step.*.part")), run)
    kernel = int(part.suffixes[-2][1:9], 16)
    # Stopped, OpenCascade will never be done: nothing may wait for it.
    os.kill(kernel, signal.SIGSTOP)
    run.send_signal(signum)
    _, said = run.communicate()
    assert run.returncode == 128 + signum
    assert "Traceback" not in said
    assert out.read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == before
    # The process OpenCascade had for itself is gone too.
    with pytest.raises(ProcessLookupError):
        os.kill(kernel, 0)


@pytest.mark.parametrize("closed", [(0,), (2,), (0, 1, 2)])
def test_closed_streams_do_not_matter(tmp_path, closed):
    trimesh.creation.box().export(tmp_path / "box.obj")
    (tmp_path / "lattice.yaml").write_text("version: 1\nedits:\n- twist: {axis: w, angle: 9}\n")
    code = f"import os, sys\nfor n in {closed}: os.close(n)\nos.execv(sys.executable, sys.argv[1:])"
    arguments = [*COMMAND, "deform", "box.obj", "lattice.yaml", "-o", "box.step"]
    done = subprocess.run([sys.executable, "-c", code, *arguments], cwd=tmp_path, check=False)
    assert done.returncode == 0
    assert (tmp_path / "box.step").stat().st_size > 1000
