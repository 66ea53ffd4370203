"""Reading of models of glTF files, for the tests of this folder."""

import pytest

from ffdcli.mesh import read_mesh


@pytest.fixture
def read(tmp_path):
    def write_and_read(model):
        path = tmp_path / "a.glb"
        path.write_bytes(model.glb())
        return read_mesh(path)

    return write_and_read
