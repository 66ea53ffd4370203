"""Damaged files: read, or refused by name; never another exception."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.errors import FfdError
from ffdcli.mesh import describe_remarks, inspect, read_mesh, repair, usability
from support.jobs import obj
from support.mesh_models import CORNERS, QUADS, ascii_stl, binary_stl, cube_triangles, off, ply

MIXED = [*QUADS[:5], [1, 3, 7], [1, 7, 5]]
SEEDS = {
    "a.obj": ("g a b\no c\n" + obj(CORNERS * 1.25, MIXED) + "f -1 -2 \\\n -3\n").encode(),
    "a.off": off(CORNERS * 0.15, MIXED).encode(),
    "text.ply": ply(CORNERS, MIXED).encode(),
    "little.ply": ply(CORNERS, MIXED, "binary_little_endian"),
    "big.ply": ply(CORNERS, MIXED, "binary_big_endian", "float"),
    "text.stl": ascii_stl(cube_triangles()).encode(),
    "binary.stl": binary_stl(cube_triangles()),
}
# What numbers and separators turn into when files are mangled.
BITS = [
    b"-",
    b"1e999",
    b"nan",
    b"9" * 20,
    b" ",
    b"\n",
    b"\0",
    b"1e",
    b"/",
    b".",
    b"1e-" + b"9" * 20,
    b"0",
]


@pytest.mark.parametrize("name", SEEDS)
@settings(max_examples=60)
@given(data=st.data())
def test_damaged_files(tmp_path_factory, name, data):
    content = bytearray(SEEDS[name])
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, max(len(content) - 1, 0)))
        kind = data.draw(st.sampled_from(["cut", "byte", "drop", "twice", "bits", "digit"]))
        if kind == "cut":
            del content[at:]
        elif kind == "byte":
            content[at : at + 1] = bytes([data.draw(st.integers(0, 255))])
        elif kind == "drop":
            del content[at : at + data.draw(st.integers(1, 9))]
        elif kind == "twice":
            content[at:at] = content[at : at + data.draw(st.integers(1, 20))]
        elif kind == "bits":
            content[at : at + 1] = data.draw(st.sampled_from(BITS))
        else:
            digits = [n for n, character in enumerate(content) if 48 <= character <= 57]
            if digits:
                content[data.draw(st.sampled_from(digits))] = data.draw(st.integers(48, 57))
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(content)
    try:
        mesh = read_mesh(path)
    except FfdError as error:
        refusal = error
        mesh = None
    if mesh is None:
        assert refusal.file == str(path)
        assert refusal.hint
        return
    found = inspect(mesh)
    assert usability(mesh, found) in ("yes", "with --repair", "no")
    describe_remarks(mesh, found)
    mended, _ = repair(mesh)
    assert np.isin(mended.corners, np.arange(len(mended.vertices))).all()
    assert repair(mended) == (mended, ())
