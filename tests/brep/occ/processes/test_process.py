"""OpenCascade in a process of its own: results, errors, interruption."""

import os
import signal
import sys
import threading
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ffdcli.brep.occ.processes.kernel import LocalKernel
from ffdcli.brep.occ.processes.process import KernelProcess
from ffdcli.brep.occ.writing.header import FileHeader
from ffdcli.errors import CheckError, FileError, KernelError
from ffdcli.files import whole_file
from support import brep_models as models
from support.commands import wait_until


def test_both_kernels_check_and_write_the_same(tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    brep = models.cube_with_cavity(models.bumpy)
    here = LocalKernel()
    # The process took its environment along when it started.
    with KernelProcess() as there:
        written = []
        for folder, asked in (("here", here), ("there", there)):
            (tmp_path / folder).mkdir()
            path = tmp_path / folder / "part.step"
            asked.load()
            asked.build(brep)
            verdicts = []
            asked.begin_check()
            size = asked.write(
                path, agree=verdicts.append, unit="inch", header=FileHeader(description="two")
            )
            assert size == path.stat().st_size
            assert [verdict.valid for verdict in verdicts] == [True]
            written.append(path.read_bytes())
    assert written[0] == written[1]


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize("make", [LocalKernel, KernelProcess])
def test_nothing_is_written_where_the_verdict_is_not_agreed_to(make, ahead, tmp_path):
    path = tmp_path / "part.step"
    path.write_text("precious")
    seen = []

    def refuse(verdict):
        seen.append((verdict.valid, verdict.faults))
        raise CheckError("no")

    with ExitStack() as stack:
        kernel = make()
        if make is KernelProcess:
            stack.enter_context(kernel)
        kernel.build(models.without_last_face(models.cube(models.bumpy)))
        if ahead:
            kernel.begin_check()
        with pytest.raises(CheckError, match="no"):
            kernel.write(path, agree=refuse)
    assert seen == [(False, ("shell 0: NotClosed",))]
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "precious"


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_opencascade_is_loaded_ahead_and_nothing_else_that_takes_long():
    with KernelProcess() as kernel:
        kernel.load()
        loaded = Path(f"/proc/{kernel.number}/maps").read_text()
    assert "/OCP" in loaded
    assert "/scipy/" not in loaded


def test_errors_come_back(tmp_path):
    with KernelProcess() as other:
        other.build(models.cube())
        with pytest.raises(FileError, match="folder for this file does not exist") as caught:
            other.write(tmp_path / "none" / "part.step")
        assert caught.value.file == str(tmp_path / "none" / "part.step")
        assert caught.value.hint == "make the folder first"


def test_a_record_the_kernel_refuses_is_named_here():
    brep = models.cube(models.bumpy)
    (batch,) = brep.curves
    poles = batch.poles.copy()
    poles[3, 0, 0] = np.inf
    with KernelProcess() as kernel, pytest.raises(KernelError, match="curve of edge 3"):
        kernel.build(replace(brep, curves=(replace(batch, poles=poles),)))


def test_an_internal_error_says_where_it_was(tmp_path):
    with KernelProcess() as empty, pytest.raises(RuntimeError, match=r"(?s)tolerance_settings.*"):
        empty.write(tmp_path / "part.step", agree=print)


def test_a_kernel_that_dies_is_an_error(tmp_path):
    with KernelProcess() as kernel:
        kernel.load()
        os.kill(kernel.number, signal.SIGKILL)
        with pytest.raises(KernelError, match=r"process ended \(signal 9\) while .* to build"):
            kernel.build(models.cube())


def test_an_interrupted_write_ends_the_process_and_takes_its_file_along(tmp_path):
    path = tmp_path / "part.step"
    path.write_text("precious")
    with KernelProcess() as kernel:
        kernel.build(models.grid_of_cubes(300, models.bumpy))
        # Stands for what a killed writer has begun.
        begun = tmp_path / f".part.step.{kernel.number:08x}00000000.part"
        begun.write_text("half")
        others = tmp_path / f".part.step.{os.getpid():08x}00000000.part"
        others.write_text("half")

        def interrupt():
            wait_until(lambda: set(tmp_path.glob(".*.part")) - {begun, others})
            # Stopped, it will never be done: nothing may wait for it.
            os.kill(kernel.number, signal.SIGSTOP)
            os.kill(os.getpid(), signal.SIGINT)

        threading.Thread(target=interrupt).start()
        with pytest.raises(KeyboardInterrupt):
            kernel.write(path)
        with pytest.raises(ProcessLookupError):
            os.kill(kernel.number, 0)
    assert path.read_text() == "precious"
    assert sorted(each.name for each in tmp_path.iterdir()) == sorted([path.name, others.name])


def test_temporary_files_name_their_process(tmp_path):
    with whole_file(tmp_path / "a.txt"):
        (name,) = [each.name for each in tmp_path.iterdir()]
    assert name.startswith(f".a.txt.{os.getpid():08x}")
