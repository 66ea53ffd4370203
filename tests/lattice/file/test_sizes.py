"""Octrees, arrays and tables that are too large are refused from sizes and counts."""

import numpy as np
import pytest

from ffdcli import read_lattice
from ffdcli.errors import LatticeError
from ffdcli.lattice.file import definition
from ffdcli.lattice.lattice_file import load_lattice
from ffdcli.volume.adaptive import octree_growth
from support.jobs import ellipsoid

V = "version: 1\n"


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    return ellipsoid(tmp_path_factory.mktemp("mesh"), 2)


def refused(tmp_path, text, mesh=None):
    path = tmp_path / "l.yaml"
    path.write_text(V + text)
    with pytest.raises(LatticeError) as caught:
        read_lattice(path, mesh) if mesh is not None else load_lattice(path)
    assert caught.value.file == str(path)
    return caught.value


@pytest.mark.parametrize("volume", ["tspline", "hierarchical"])
@pytest.mark.parametrize("refine", ["surface", "vertices"])
def test_octrees_of_too_many_cells_are_refused(tmp_path, monkeypatch, mesh, volume, refine):
    monkeypatch.setattr(octree_growth, "MAX_CELLS", 500)
    error = refused(tmp_path, f"volume: {volume}\noctree: {{depth: 9, refine: {refine}}}\n", mesh)
    assert error.key == "octree.depth"
    assert "cells" in error.message
    assert "smaller `depth`" in error.hint


def test_the_surface_is_not_followed_deeper_than_the_limit(tmp_path, mesh):
    # Depth 9 would give some 4**9 * 3 cells.
    error = refused(tmp_path, "volume: tspline\noctree: {depth: 9}\n", mesh)
    assert "200,000 are allowed" in error.message


def test_boxes_of_also_are_counted_before_their_cells_are_made(tmp_path, mesh):
    box = "{min: [-20, -20, -20], max: [20, 20, 20], depth: 9}"
    text = f"volume: tspline\noctree: {{depth: 1, also: [{box}]}}\n"
    error = refused(tmp_path, text, mesh)
    assert error.key == "octree.also[0]"
    # All cells of depth 9.
    assert f"{8**9:,}" in error.message


HEADERS = {
    "shape too large": "{'descr': '<f8', 'fortran_order': False, 'shape': (100000, 100000, 1000)}",
    "shape no number": f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({'9' * 31}, 3)}}",
    "shape negative": "{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 3)}",
    "unfinished": "{'descr': '<f8', 'fortran_order': False, 'shape': (3,",
    "objects": "{'descr': '|O', 'fortran_order': False, 'shape': (3,)}",
    "no dictionary": "[" * 90,
    "less data": "{'descr': '<f8', 'fortran_order': False, 'shape': (6, 6, 6, 3)}",
    "many empty rows": "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 0)}",
    "no width": "{'descr': '|V0', 'fortran_order': False, 'shape': (1000000000, 3)}",
    "text": "{'descr': '<U8', 'fortran_order': False, 'shape': (4,)}",
}


@pytest.mark.parametrize("name", HEADERS)
@pytest.mark.parametrize("edit", ["net", "weights"])
def test_headers_that_lie_are_refused(tmp_path, name, edit):
    header = HEADERS[name].encode() + b"\n"
    content = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + b"\0" * 128
    (tmp_path / "n.npy").write_bytes(content)
    error = refused(tmp_path, f"volume: nurbs\nedits:\n- {edit}: n.npy\n")
    assert error.key == f"edits[0].{edit}"
    assert "n.npy" in error.message


@pytest.mark.parametrize("value", [1e200, 1e31, -1e300])
def test_arrays_of_huge_numbers_are_refused(tmp_path, value):
    net = np.ones((6, 6, 6, 3))
    net[1, 2, 3, 0] = value
    np.save(tmp_path / "n.npy", net)
    error = refused(tmp_path, "edits:\n- net: n.npy\n")
    assert "larger than 1e+30, at control point [1, 2, 3]" in error.message


def test_numbers_beyond_float64_are_refused_without_a_warning(tmp_path, recwarn):
    np.save(tmp_path / "n.npy", np.full((6, 6, 6, 3), np.longdouble("1e4000")))
    assert "not finite" in refused(tmp_path, "edits:\n- net: n.npy\n").message
    assert not recwarn


def test_more_pairs_than_the_limit_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(definition, "MAX_PAIRS", 10)
    (tmp_path / "p.csv").write_text("x,y,z,tx,ty,tz\n" + "0,0,0,1,1,1\n" * 11)
    text = "edits:\n- drag: {pairs: p.csv}\n"
    assert "more than 10 rows" in refused(tmp_path, text).message
    pair = "{from: [0, 0, 0], to: [0, 0, 1]}, "
    text = f"edits:\n- drag: {{pairs: [{pair * 11}]}}\n"
    assert "11 pairs" in refused(tmp_path, text).message


def test_tables_are_measured_before_they_are_read(tmp_path):
    with (tmp_path / "p.csv").open("wb") as stream:
        # A hole: takes no room on the disk.
        stream.truncate(10**11)
    error = refused(tmp_path, "edits:\n- drag: {pairs: p.csv}\n")
    assert "100,000,000,000 bytes" in error.message
    text = "volume: tspline\noctree: {cells: p.csv}\n"
    assert "100,000,000,000 bytes" in refused(tmp_path, text).message
    (tmp_path / "p.csv").rename(tmp_path / "n.csv")
    assert "bytes" in refused(tmp_path, "edits:\n- net: n.csv\n").message


@pytest.mark.parametrize(
    "text",
    [
        'edits:\n- net: "a\\0b.npy"\n',
        'edits:\n- drag: {pairs: "a\\0b.csv"}\n',
        'volume: tspline\noctree: {cells: "a\\0b.csv"}\n',
        f"edits:\n- net: {'a' * 5000}.npy\n",
    ],
)
def test_names_that_no_file_has_are_refused(tmp_path, text):
    assert refused(tmp_path, text).key in ("edits[0].net", "edits[0].drag.pairs", "octree.cells")
