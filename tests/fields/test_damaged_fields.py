"""Damaged fields: read, or refused by name; never another exception."""

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.errors import FileError
from ffdcli.fields import mesh_files, mesh_process
from ffdcli.fields.read import read_field
from support.damage import damage
from support.field_files import FORMATS, MOVES, POINTS, npz, vtu

TABLES = {
    "f.csv": b"x,y,z,dx,dy,dz,weight\n1,2,3,0,0,0.5,1\n4,5,6,0.25,0,-1e-3,2\n",
    "f.npz": npz(points=POINTS, displacements=MOVES, weights=np.ones(5)),
}
MESHES = {name: contents[0] for name, contents in FORMATS.items()}
MESHES["binary.vtu"] = vtu([("U", MOVES)], binary=True)


def require_read_or_refused(path, **how):
    field = refused = None
    try:
        field = read_field(path, **how)
    except FileError as error:
        refused = error
    if field is None:
        assert refused.file == str(path)
        assert refused.hint
        assert len(str(refused).replace(str(path.parent), "")) < 600
        return
    assert field.sources.shape == field.goals.shape == (len(field.weights), 3)
    assert len(field.sources)
    assert np.isfinite(field.displacements).all()


@pytest.mark.parametrize("name", TABLES)
@settings(max_examples=150, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_damaged_tables(tmp_path_factory, name, data):
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(damage(TABLES[name], data))
    require_read_or_refused(path)


def answer_in_a_copy(command, **_):
    """What the other process does, in a copy of this one, which has its modules already."""
    request = json.loads(command[-1])
    receiver, sender = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            # The memory of this process comes on top.
            mesh_process._set_limits(request["memory"] + (4 << 30), 1)
            with os.fdopen(sender, "wb") as out:
                out.write(mesh_process.answer(request))
        finally:
            os._exit(0)
    os.close(sender)
    with os.fdopen(receiver, "rb") as answers:
        content = answers.read()
    _, status = os.waitpid(child, 0)
    # The processor time is what an endless loop of a reader spends.
    assert status in (0, signal.SIGXCPU, signal.SIGKILL)
    return subprocess.CompletedProcess(command, status, content)


@pytest.mark.skipif(sys.platform != "linux", reason="needs fork and limits of Linux")
@pytest.mark.parametrize("name", MESHES)
@settings(max_examples=20, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_damaged_mesh_files(tmp_path_factory, name, data):
    meshio = pytest.importorskip("meshio")
    pytest.importorskip("h5py")
    assert meshio
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(damage(MESHES[name], data))
    how = {} if name.endswith((".vtu", ".vtk", ".xdmf")) else {"targets": path}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mesh_files.subprocess, "run", answer_in_a_copy)
        require_read_or_refused(path, **how)
