"""Damaged files: read, or refused by name; never another exception."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from support.damage import damage, require_read_or_refused
from support.jobs import obj
from support.mesh_models import CORNERS, QUADS, ascii_stl, binary_stl, cube_triangles, off, ply

MIXED = [*QUADS[:5], [1, 3, 7], [1, 7, 5]]
SEEDS = {
    "a.obj": ("g a b\no c\n" + obj(CORNERS * 1.25, MIXED) + "f -1 -2 \\\n -3\n").encode(),
    "a.off": off(CORNERS * 0.15, MIXED).encode(),
    "text.ply": ply(CORNERS, MIXED).encode(),
    "little.ply": ply(CORNERS, MIXED, "binary_little_endian"),
    "big.ply": ply(CORNERS, MIXED, "binary_big_endian", "float"),
    "strips.ply": (
        ply(CORNERS, [[0, 2, 1, 3, 5, 7, 4, 6, -1, 0, 1, 4, 5, 5, 2], [2, 6, 3, 7]])
        .replace("element face", "element tristrips")
        .encode()
    ),
    "text.stl": ascii_stl(cube_triangles()).encode(),
    "binary.stl": binary_stl(cube_triangles()),
}


@pytest.mark.parametrize("name", SEEDS)
@settings(max_examples=60)
@given(data=st.data())
def test_damaged_files(tmp_path_factory, name, data):
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(damage(SEEDS[name], data))
    require_read_or_refused(path)
