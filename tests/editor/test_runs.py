"""Writing and verifying from a session: what is on the screen is what is in the file."""

import subprocess
import sys

import numpy as np
import pytest

from ffdcli.editor import Session, runs
from ffdcli.errors import FileError, KernelError, LatticeError
from support.editor_models import box_file, session_of


def test_the_step_file_that_is_written_verifies(tmp_path):
    with Session.open(box_file(tmp_path)) as session:
        with pytest.raises(FileError, match="nothing to verify"):
            session.verify()
        session.append(*session.drag([[3, 1.5, 2]], by=[[0.1, 0, 0.4]]))
        stages = []
        report = session.write_cad(stages.append)
        assert not session.unsaved
        assert report["output"] == str(session.output)
        assert report["faces"] == 6
        assert report["exact"]
        assert "read" in stages
        assert len(stages) > 5
        verdict = session.verify(stages.append)
        assert verdict["passed"]
        assert verdict["max_deviation"] < 1e-9
        assert stages[-1] == "verify"
        session.model_path.write_text(session.model_path.read_text().replace("4.0", "5.0"))
        for run in (session.write_cad, session.verify):
            with pytest.raises(FileError, match="the model changed"):
                run()


def test_errors_of_the_other_process_are_raised_here(tmp_path):
    with session_of(tmp_path) as session:
        # The whole top is pushed through the bottom.
        session.append(*session.move(session.slice_mask("w", -1), [0, 0, -9]))
        with pytest.raises(LatticeError, match="folds"):
            session.write_cad(options={"require_injective": True})
        assert not session.output.exists()
        assert not session.unsaved
    missing = tmp_path / "none.yaml"
    with pytest.raises(FileError, match="no such file"):
        runs.run("deform", tmp_path / "o.step", box_file(tmp_path), missing, options={})
    missing.write_text("version: 2\n")
    with pytest.raises(LatticeError, match="version") as caught:
        runs.run("deform", tmp_path / "o.step", box_file(tmp_path), missing, options={})
    assert caught.value.line == 1


def test_a_process_that_dies_is_named(tmp_path, monkeypatch):
    start = subprocess.Popen

    def dying(command, **keys):
        return start([sys.executable, "-c", "import os; os._exit(7)"], **keys)

    monkeypatch.setattr("ffdcli.editor.runs.subprocess.Popen", dying)
    with pytest.raises(KernelError, match="status 7"):
        runs.run("deform", tmp_path / "o.step", tmp_path / "m", tmp_path / "l", options={})


def test_neat_numbers_are_short(tmp_path):
    with session_of(tmp_path) as session:
        found = session.neat(np.array([[1 / 3, 2.0, -1e-12]]))
        assert np.allclose(found, [[1 / 3, 2, 0]], atol=1e-6 * session.size)
        assert all(len(repr(each)) <= 9 for each in found[0])
