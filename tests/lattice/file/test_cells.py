"""T-lattices in files: `octree: {cells: FILE}`, what is taken, refused and written."""

import numpy as np
import pytest

from ffdcli import read_lattice, read_mesh
from ffdcli.errors import LatticeError
from ffdcli.lattice import load_lattice, save_lattice, solved_text
from ffdcli.volume.adaptive import polynomial_cells, tspline
from ffdcli.volume.adaptive.local_functions import LocalFunctions
from support.commands import ffd
from support.places import SAMPLES

GIVEN = "volume: tspline\noctree: {cells: cells.csv}\n"
HEADER = "u0,v0,w0,u1,v1,w1\n"
WHOLE = HEADER + "0,0,0,2,2,2\n"


@pytest.fixture(scope="module")
def mesh():
    return read_mesh(SAMPLES / "handle.obj")


def lattice_of(folder, text, table=None, mesh=None):
    (folder / "l.yaml").write_text("version: 1\n" + text)
    if table is not None:
        (folder / "cells.csv").write_text(table)
    path = folder / "l.yaml"
    return load_lattice(path) if mesh is None else read_lattice(path, mesh)


def refused(folder, text, table=None, mesh=None):
    with pytest.raises(LatticeError) as caught:
        lattice_of(folder, text, table, mesh)
    assert caught.value.file.endswith("l.yaml")
    assert "\n" not in str(caught.value)
    return f"{caught.value.line} {caught.value.key}: {caught.value} ({caught.value.hint})"


def test_cells_written_by_info_give_the_same_lattice(tmp_path):
    octree, given = tmp_path / "octree.yaml", tmp_path / "given.yaml"
    kept = "octree: {depth: 1, also: [{min: [-90, -9, -9], max: [0, -6, -6], depth: 2}]}\n"
    octree.write_text(f"version: 1\nvolume: tspline\n{kept}")
    given.write_text(f"version: 1\n{GIVEN}")
    mesh = SAMPLES / "handle.obj"
    ffd("info", octree, "--mesh", mesh, "--cells", tmp_path / "cells.csv")
    record = read_mesh(mesh)
    first, second = read_lattice(octree, record), read_lattice(given, record)
    assert np.array_equal(first.member.layout.box, second.member.layout.box)
    assert np.array_equal(first.points, second.points)
    assert np.array_equal(first.weights, second.weights)
    assert first.volume.same_basis(second.volume)
    moved = first.points + np.random.default_rng(0).uniform(-1, 1, first.points.shape)
    images = [
        lattice.member.with_control(moved, lattice.weights).volume.evaluate(record.vertices)
        for lattice in (first, second)
    ]
    assert np.array_equal(*images)
    assert "depth" not in ffd("info", given, "--mesh", mesh).output


def test_solved_files_name_the_cells_from_where_they_are(tmp_path, mesh):
    text = GIVEN + "edits: [{move: {at: {near: [120, 0, 9]}, by: [0, 0, 3]}}]\n"
    table = HEADER + "".join(
        f"{i},{j},{k},{i + 3},{j + 1},{k + 1}\n"
        for i in range(0, 9, 3) for j in range(3) for k in range(3)
    )  # fmt: skip
    lattice = lattice_of(tmp_path, text, table, mesh)
    assert lattice.volume.unit == pytest.approx(
        np.ptp(lattice.member.layout.box, axis=0) / [9, 3, 3]
    )
    below = tmp_path / "below"
    below.mkdir()
    save_lattice(lattice, below / "solved.yaml")
    (below / "text.yaml").write_text(solved_text(lattice, folder=below))
    for name in ("solved.yaml", "text.yaml"):
        again = read_lattice(below / name, mesh)
        assert np.array_equal(again.points, lattice.points)
        assert np.array_equal(again.volume.net, lattice.volume.net)


def test_the_refine_key_says_which_cells_hold_the_mesh(tmp_path, mesh):
    row = "".join(f"{i},0,0,{i + 1},2,2\n" for i in range(8))
    heavy = []
    for refine in ("surface", "vertices"):
        text = f"volume: tspline\noctree: {{cells: cells.csv, refine: {refine}}}\n"
        lattice = lattice_of(tmp_path, text, HEADER + row, mesh)
        heavy.append(lattice.member.cells.full)
    # The handle has its corners near its ends; between them only its sides pass.
    assert heavy[0].sum() > heavy[1].sum() > 0


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (HEADER + "0,0,0,2,2,0\n", ("cell 1", "rule 3", "no extent along w")),
        (WHOLE + "1,0,0,3,2,2\n", ("cell 1 and cell 2", "rule 2", "[1, 0, 0] to [2, 2, 2]")),
        (WHOLE + "3,0,0,4,2,2\n", ("rule 1", "none covers [2, 0, 0] to [3, 2, 2]")),
        (HEADER + "0,0,1,2,2,2\n", ("rule 1", "none covers [0, 0, 0] to [2, 2, 1]")),
        (HEADER + "2,0,0,0,2,2\n", ("cell 1", "ends before it begins")),
        (HEADER + "0,0,0,2,2,1.5\n", ("cell 1", "whole numbers from 0 to 512")),
        (HEADER + "0,0,0,2,2,nan\n", ("cell 1", "whole numbers")),
        (HEADER + "-1,0,0,2,2,2\n", ("cell 1", "whole numbers")),
        (HEADER + "0,0,0,2,2,999\n", ("cell 1", "0 to 512")),
        (HEADER + "0,0,0,2,2\n", ("row 2", "six numbers")),
        (HEADER + "0,0,0,2,2,x\n", ("row 2", "six numbers")),
        ("0,0,0,2,2,2\n", ("row 1", "begin the file with u0,v0,w0,u1,v1,w1")),
        (HEADER, ("holds no cells",)),
    ],
)
def test_what_is_no_t_lattice_is_refused(tmp_path, table, words):
    said = refused(tmp_path, GIVEN, table)
    assert said.startswith("3 octree.cells: ")
    assert "cells.csv" in said
    for word in words:
        assert word in said


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ("volume: tspline\noctree: {cells: none.csv}\n", "octree.cells", "relative to the lattice"),
        ("volume: hierarchical\noctree: {cells: cells.csv}\n", "octree.cells", "has levels"),
        ("volume: tspline\noctree: {cells: cells.csv, depth: 3}\n", "octree.depth", "remove one"),
        ("volume: tspline\noctree: {cells: 3}\n", "octree.cells", "must be text"),
    ],
)
def test_keys_that_do_not_go_with_cells(tmp_path, text, key, words):
    said = refused(tmp_path, text, WHOLE)
    assert key in said
    assert words in said


def test_cells_out_of_their_corners_reach_are_refused(tmp_path, mesh):
    rows = [f"{k},0,{w},{k + 1},10,{w + 1}" for k in range(8) for w in (0, 1, 3, 4)]
    rows += [f"0,{v},2,8,{v + 2},3" for v in range(0, 10, 2)]
    said = refused(tmp_path, GIVEN, HEADER + "\n".join(rows), mesh)
    assert "too few control points reach" in said
    assert "divide the cells there" in said


def test_a_turned_region_is_padded_by_the_smallest_cell(tmp_path, mesh):
    rows = "".join(f"{i},{j},0,{i + 1},{j + 1},6\n" for i in range(10) for j in range(5))
    text = "volume: tspline\noctree: {cells: cells.csv, region: oriented}\n"
    layout = lattice_of(tmp_path, text, HEADER + rows, mesh).member.layout
    extent = np.ptp(mesh.vertices @ layout.frame.axes.T, axis=0)
    # A tenth, a fifth, and at most a quarter of the whole at either end.
    assert np.ptp(layout.box, axis=0) == pytest.approx(
        extent / (1 - 2 * np.array([0.1, 0.2, 0.25]))
    )


def test_cells_go_to_a_file_from_one_octree_only(tmp_path):
    (tmp_path / "b.yaml").write_text("version: 1\n")
    words = ["info", tmp_path / "b.yaml", "--cells", tmp_path / "c.csv"]
    ffd(*words, status=2)
    run = ffd(*words, "--mesh", SAMPLES / "handle.obj", status=1)
    assert "needs a file of one lattice" in run.output
    assert not (tmp_path / "c.csv").exists()


@pytest.mark.parametrize("units", [100, 512])
def test_slabs_with_millions_of_polynomial_pieces_are_refused_before_any_is_made(
    tmp_path, mesh, monkeypatch, units
):
    made = []
    monkeypatch.setattr(polynomial_cells, "tree_of", made.append)
    slabs = "".join(f"{n},0,0,{n + 1},{units},{units}\n" for n in range(units))
    said = refused(tmp_path, GIVEN, HEADER + slabs, mesh)
    assert said.startswith("3 octree.cells: ")
    assert "cells.csv" in said
    assert "300,000 are allowed" in said
    assert not made


def test_many_units_in_few_pieces_are_taken(tmp_path, mesh):
    # Two cells that halving does not give, on 200 units: refused where units alone were counted.
    lattice = lattice_of(tmp_path, GIVEN, HEADER + "0,0,0,3,2,2\n3,0,0,200,2,2\n", mesh)
    assert lattice.points.shape == (12, 3)


def test_the_search_for_thin_places_keeps_no_lists(tmp_path, mesh, monkeypatch):
    monkeypatch.setattr(tspline, "_CHUNK", 7)
    kept = []
    listed = LocalFunctions._list

    def counted(functions, leaves):
        kept.append(len(leaves))
        return listed(functions, leaves)

    monkeypatch.setattr(LocalFunctions, "_list", counted)
    slabs = "".join(f"{n},0,0,{n + 1},4,4\n" for n in range(4))
    lattice = lattice_of(tmp_path, GIVEN, HEADER + slabs, mesh)
    assert sum(kept) == len(lattice.volume.functions.tree.low) == 64
    assert not lattice.volume.functions._listed
