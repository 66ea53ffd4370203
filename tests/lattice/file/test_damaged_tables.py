"""Damaged tables that a lattice file names: read, or refused by name; never another exception."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli import read_lattice, read_mesh
from ffdcli.errors import FfdError, LatticeError
from support.damage import damage
from support.field_files import npz
from support.jobs import obj
from support.mesh_models import CORNERS, QUADS


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def csv(rows):
    return "".join(f"{','.join(map(str, row))}\n" for row in rows).encode()


GRID = np.stack(np.meshgrid(*[np.linspace(0, 1, 2)] * 3, indexing="ij"), axis=-1)
ROWS = "degree: [1, 1, 1]\npoints: [2, 2, 2]\n"
NURBS = f"volume: nurbs\n{ROWS}"
CELLS = [["u0", "v0", "w0", "u1", "v1", "w1"], [0, 0, 0, 1, 2, 2], [1, 0, 0, 2, 2, 2]]
PAIRS = [["x", "y", "z", "dx", "dy", "dz"], [1, 1, 1, 0, 0, 0.125]]
TABLES = {
    "cells.csv": (csv(CELLS), "volume: tspline\noctree: {cells: cells.csv}\n"),
    "net.csv": (csv(GRID.reshape(-1, 3)), f"{ROWS}edits:\n- net: net.csv\n"),
    "net.npy": (npy(GRID + 0.25), f"{ROWS}edits:\n- net: net.npy\n"),
    "weights.csv": (csv(np.full((8, 1), 2.5)), f"{NURBS}edits:\n- weights: weights.csv\n"),
    "weights.npy": (npy(np.ones((2, 2, 2))), f"{NURBS}edits:\n- weights: weights.npy\n"),
    "field.csv": (
        csv([[*PAIRS[0], "weight"], [*PAIRS[1], 2]]),
        f"{ROWS}edits:\n- fit: {{pairs: field.csv}}\n",
    ),
    "field.npz": (
        npz(points=np.ones((2, 3)) / 2, targets=np.ones((2, 3))),
        f"{ROWS}edits:\n- fit: {{pairs: field.npz}}\n",
    ),
    "pairs.csv": (csv(PAIRS), f"{ROWS}edits:\n- drag: {{pairs: pairs.csv}}\n"),
}  # fmt: skip


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    path = tmp_path_factory.mktemp("mesh") / "cube.obj"
    path.write_text(obj(CORNERS, QUADS))
    return read_mesh(path)


def lattice_of(folder, name, content, mesh):
    (folder / name).write_bytes(content)
    (folder / "l.yaml").write_text(f"version: 1\n{TABLES[name][1]}")
    return read_lattice(folder / "l.yaml", mesh)


@pytest.mark.parametrize("name", TABLES)
def test_the_tables_are_read_undamaged(tmp_path, name, mesh):
    assert lattice_of(tmp_path, name, TABLES[name][0], mesh).members


@pytest.mark.parametrize("name", TABLES)
@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_damaged_tables(tmp_path_factory, mesh, name, data):
    folder = tmp_path_factory.mktemp("damaged")
    refused = None
    try:
        lattice = lattice_of(folder, name, damage(TABLES[name][0], data), mesh)
    except FfdError as error:
        refused = error
    if refused is None:
        assert np.isfinite(lattice.members[0].points).all()
        return
    assert isinstance(refused, LatticeError)
    assert refused.file == str(folder / "l.yaml")
    assert refused.key
    assert len(str(refused).replace(str(folder), "")) < 600
