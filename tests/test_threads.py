"""Results are the same, byte for byte, whatever the number of threads."""

import os
import subprocess
import sys

import pytest

COMMAND = [sys.executable, "-c", "from ffdcli.cli import main; main()", "deform"]


@pytest.mark.parametrize("extension", ["step", "brep"])
def test_the_number_of_threads_changes_no_byte(extension, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.icosphere(subdivisions=3).export(tmp_path / "ball.obj")
    (tmp_path / "lattice.yaml").write_text(
        "version: 1\nvolume: nurbs\npoints: [6, 5, 5]\nedits:\n"
        "- twist: {axis: w, angle: 50}\n- weight: {at: [2, 2, 2], value: 2}\n"
    )
    written = []
    for threads in ("1", "2"):
        out = tmp_path / threads
        out.mkdir()
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
        subprocess.run(
            [*COMMAND, "ball.obj", "lattice.yaml", "-o", out / f"ball.{extension}", "--no-check"],
            cwd=tmp_path,
            env={**os.environ, **dict.fromkeys(names, threads), "SOURCE_DATE_EPOCH": "1700000000"},
            check=True,
            capture_output=True,
        )
        written.append((out / f"ball.{extension}").read_bytes())
    assert len(written[0]) > 1e6
    assert written[0] == written[1]
