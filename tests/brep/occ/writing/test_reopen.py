"""Written files are opened again: damage to their structure is found, and nothing is written."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.brep.labels import BodyLabels, ShapeLabels
from ffdcli.brep.occ.building.build import build_shape
from ffdcli.brep.occ.writing import step_texts
from ffdcli.brep.occ.writing.brep import brep_bytes
from ffdcli.brep.occ.writing.iges import iges_bytes
from ffdcli.brep.occ.writing.reopen import brep_fault, iges_fault, step_fault
from ffdcli.brep.occ.writing.step import SHORT_DIGITS, step_bytes
from ffdcli.brep.occ.writing.write import write_cad
from ffdcli.errors import KernelError
from support import brep_models as models

NAMED = ShapeLabels("beam (5')", bodies=(BodyLabels("beam (5')"),))


@pytest.fixture(scope="module")
def shape():
    return build_shape(models.cube(models.bumpy))


@pytest.fixture(scope="module")
def step(shape):
    return step_bytes(shape, "a.step", labels=NAMED)


@pytest.fixture(scope="module")
def iges(shape):
    return bytes(iges_bytes(shape, "a.igs", labels=NAMED))


@pytest.mark.parametrize("schema", ["ap203", "ap214", "ap242"])
@pytest.mark.parametrize("digits", [17, SHORT_DIGITS])
def test_whole_step_files_have_no_fault(shape, schema, digits):
    assert step_fault(step_bytes(shape, "a", schema=schema, digits=digits, labels=NAMED)) == ""


@pytest.mark.parametrize("mode", ["brep", "faces"])
def test_whole_iges_files_have_no_fault(shape, mode):
    assert iges_fault(iges_bytes(shape, "a", mode=mode, labels=NAMED)) == ""


def test_whole_brep_files_have_no_fault(shape):
    content = brep_bytes(shape)
    assert brep_fault(content) == ""
    assert brep_fault(content[:-9]) != ""


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (b"(5\\X2\\0027\\X0\\)", b"(5'')", "ends where it should not"),
        (b"(5\\X2\\0027\\X0\\)", b"(5')", "a text has no end"),
        (b"(5\\X2\\0027\\X0\\)", b"(5'x'", "ends where it should not"),
        (b"beam (5", b"b" * 17_000, "is too long"),
        (b"beam (5", "bäm (5".encode(), "is no character of such files"),
        (b"CLOSED_SHELL('',(", b"CLOSED_SHELL('',((", "do not match"),
        (b"CLOSED_SHELL('',(", b"CLOSED_SHELL('',(#999999,", "entity #999999 is missing"),
        (b"\n#7 = ", b"\n#70 = ", "is out of order"),
        (b"END-ISO-10303-21;", b"", "its first or last line is missing"),
    ],
)
def test_damaged_step_files_have_a_fault(step, old, new, fault):
    assert old in step
    assert fault in step_fault(step.replace(old, new, 1))


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (rb"\n", b"", "80 characters"),
        (rb"beam", b"be", "80 characters"),
        (rb"beam", b"b\xe4m ", "printable ASCII"),
        (rb"G0000002\n", b"G0000003\n", "wrong number"),
        (rb"G0000002\n", b"P0000002\n", "not in order"),
        (rb"D( +)\d\d(\dP +\d+ )", rb"D\g<1>99\2", "the counts in its last line"),
        (rb",,9Hbeam", b",,0Hbeam", "global section has"),
        (rb"(?m)^( +186)( +\d+)", lambda m: m[1] + b"%8d" % (int(m[2]) + 1), "directory"),
        (rb"(?m)^(186,.{60}) \d{7}P", rb"\1    9999P", "its parameters"),
    ],
)
def test_damaged_iges_files_have_a_fault(iges, old, new, fault):
    damaged = re.sub(old, new, iges, count=1)
    assert damaged != iges
    assert fault in iges_fault(damaged)


@settings(max_examples=60)
@given(text=st.text(alphabet="'\"),; \\\\(#x", min_size=1, max_size=12))
def test_what_has_no_fault_is_read_by_opencascade(text, step, tmp_path_factory):
    from OCP.STEPControl import STEPControl_Reader

    content = step.replace(b"beam (5\\X2\\0027\\X0\\)", text.encode())
    path = tmp_path_factory.getbasetemp() / "text.step"
    path.write_bytes(content)
    if step_fault(content) == "":
        reader = STEPControl_Reader()
        reader.ReadFile(str(path))
        assert (reader.TransferRoots(), reader.NbRootsForTransfer()) == (1, 1)
        assert reader.WS().Model().NbEntities() == len(re.findall(rb"(?m)^#\d+ = ", step))


def test_a_file_that_cannot_be_read_again_leaves_the_old_one(shape, tmp_path, monkeypatch):
    path = tmp_path / "out.step"
    path.write_text("the old file")
    monkeypatch.setattr(step_texts, "step_text", lambda value: value.replace("'", "''"))
    with pytest.raises(KernelError, match=r"STEP file could not be read again.*please report it"):
        write_cad(shape, path, labels=NAMED)
    assert path.read_text() == "the old file"
    assert list(tmp_path.iterdir()) == [path]
