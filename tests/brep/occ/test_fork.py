"""Work in forked processes: results, failures, and the printing of STEP text."""

import os
import sys

import pytest

from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.fork import run_in_fork
from ffdcli.brep.occ.writing.step import step_bytes
from support import brep_models as models

copies = pytest.mark.skipif(sys.platform != "linux", reason="no copies of processes here")


def test_work_comes_back():
    held = list(range(5))
    waits = [run_in_fork(lambda n=n: [n, *held]) for n in range(3)]
    assert [wait() for wait in waits] == [[n, *held] for n in range(3)]


@copies
def test_work_is_done_in_another_process_at_the_same_time():
    (met, meet), (gone, go) = os.pipe(), os.pipe()

    def work():
        os.write(meet, b"x")
        os.read(gone, 1)
        return os.getpid()

    waits = [run_in_fork(work) for _ in range(3)]
    # None goes on before all three are at work.
    for _ in waits:
        os.read(met, 1)
    os.write(go, b"xxx")
    numbers = {wait() for wait in waits}
    for end in (met, meet, gone, go):
        os.close(end)
    assert len(numbers) == 3
    assert os.getpid() not in numbers


@copies
def test_failures_come_back():
    def fail(error):
        raise error

    # numpy's and OpenCascade's own kinds come back as Python's.
    for name, parent in (("_ArrayMemoryError", MemoryError), ("Standard_OutOfMemory", Exception)):
        exhausted = type(name, (parent,), {})
        with pytest.raises(MemoryError):
            run_in_fork(lambda kind=exhausted: fail(kind("too much")))()
    with pytest.raises(RuntimeError, match=r"(?s)copy of the process.*ValueError: seven"):
        run_in_fork(lambda: fail(ValueError("seven")))()
    with pytest.raises(RuntimeError, match="ended without a result"):
        run_in_fork(lambda: os._exit(3))()


def test_the_text_is_the_same_however_many_print(monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    monkeypatch.setattr("ffdcli.brep.occ.writing.print_step._WORTH", 50)
    shape = build_shape(models.cube(models.bumpy))
    alone = step_bytes(shape, "part.step")
    assert alone.startswith(b"ISO-10303-21;\nHEADER;")
    assert alone.endswith(b"ENDSEC;\nEND-ISO-10303-21;\n")
    for processes in (2, 3, 7):
        assert step_bytes(shape, "part.step", processes=processes) == alone


@copies
def test_where_no_copy_can_be_made_the_work_is_done_here(monkeypatch):
    def refuse():
        raise BlockingIOError("too many processes")

    monkeypatch.setattr(os, "fork", refuse)
    before = len(os.listdir("/proc/self/fd"))
    assert run_in_fork(os.getpid)() == os.getpid()
    assert len(os.listdir("/proc/self/fd")) == before
