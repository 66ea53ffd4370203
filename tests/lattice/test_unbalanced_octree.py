"""`octree: {balance: false}`: the octree of Song & Yang, whose neighbours differ by any level."""

import json

import numpy as np
import pytest
from scipy.interpolate import BSpline

from ffdcli import read_lattice
from ffdcli.errors import LatticeError
from support.commands import ffd
from support.jobs import ellipsoid

MOVES = "edits:\n  - move: {at: {near: [0.5, 0.2, 5]%s}, by: [0.2, -0.1, 1]}\n"


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    return ellipsoid(tmp_path_factory.mktemp("mesh"), 0)


def settled(folder, mesh, volume, balance, edits="", depth=4):
    path = folder / f"{volume}.yaml"
    degree = "degree: [2, 2, 2]\n" if volume == "hierarchical" else ""
    octree = f"octree: {{depth: {depth}, refine: vertices, balance: {str(balance).lower()}}}\n"
    path.write_text(f"version: 1\nvolume: {volume}\n{degree}{octree}{edits}")
    return path, read_lattice(path, mesh).members[0]


def greatest_step(tree):
    """Greatest difference of levels of cells that touch, by comparing all pairs."""
    low, high, level = tree.low, tree.high, tree.levels
    touch = np.all((low[:, None] <= high[None]) & (low[None] <= high[:, None]), axis=2)
    return int(np.abs(level[:, None] - level[None])[touch].max())


@pytest.mark.parametrize("volume", ["tspline", "hierarchical"])
def test_only_cells_with_part_of_the_mesh_are_halved(tmp_path, mesh, volume):
    _, free = settled(tmp_path, mesh, volume, False)
    _, even = settled(tmp_path, mesh, volume, True)
    assert greatest_step(even.cells.tree) == 1
    assert greatest_step(free.cells.tree) > 1
    assert free.weights.size < even.weights.size
    # Each halved cell holds a vertex: the finest cells of any eight siblings, or one of them.
    tree = free.cells.tree
    low, high = free.layout.box
    places = (mesh.vertices - low - free.layout.frame.origin) / (high - low) * tree.counts
    parent = tree.low - tree.low % (2 * tree.size[:, None])
    side = 2 * tree.size[:, None, None]
    held = (places >= parent[:, None]) & (places <= parent[:, None] + side)
    assert held.all(axis=2).any(axis=1).all()


def test_a_tspline_is_the_weighted_sum_of_scipys_bsplines(tmp_path, mesh):
    _, lattice = settled(tmp_path, mesh, "tspline", False, MOVES % "")
    volume = lattice.volume
    points = (mesh.vertices[:, None] + mesh.vertices).reshape(-1, 3) / 2
    local = lattice.layout.frame.to_local(points)
    units = (local - volume.origin) / volume.unit
    values = np.ones((len(points), lattice.weights.size))
    for axis, knots in enumerate(volume.functions.knots):
        for number, row in enumerate(knots.astype(float)):
            piece = BSpline.basis_element(row, extrapolate=False)
            values[:, number] *= np.nan_to_num(piece(units[:, axis]))
    total = values @ lattice.weights
    assert total.min() > 0
    move = values @ (lattice.weights[:, None] * (lattice.points - volume.rest_points))
    assert np.abs(volume.evaluate(points) - points - move / total[:, None]).max() < 1e-13
    assert np.abs(move).max() > 0.5


def test_the_coarsest_level_of_a_hierarchical_volume_still_moves_everything(tmp_path, mesh):
    _, lattice = settled(tmp_path, mesh, "hierarchical", False)
    coarse = (lattice.map.levels == 0)[:, None]
    moved = lattice.with_points(lattice.points + coarse * [1.0, 2.0, 3.0], lattice.weights)
    points = mesh.vertices
    assert np.abs(moved.volume.evaluate(points) - points - [1, 2, 3]).max() < 1e-13


@pytest.mark.parametrize("volume", ["tspline", "hierarchical"])
def test_a_whole_run_verifies(tmp_path, mesh, volume):
    level = ", level: 3" if volume == "hierarchical" else ""
    path, lattice = settled(tmp_path, mesh, volume, False, MOVES % level, depth=3)
    assert greatest_step(lattice.cells.tree) > 1
    out, report = tmp_path / "out.step", tmp_path / "report.json"
    ffd("deform", mesh.source, path, "-o", out, "--report", report)
    told = json.loads(report.read_text())
    assert (told["solids"], told["watertight"], told["exact"]) == (1, True, True)
    ffd("verify", out, mesh.source, path, "--against", report)


def test_cells_of_a_file_are_as_they_are(tmp_path, mesh):
    path = tmp_path / "l.yaml"
    path.write_text(
        "version: 1\nvolume: tspline\noctree: {cells: cells.csv, balance: false}\nedits: []\n"
    )
    (tmp_path / "cells.csv").write_text("0,0,0,1,1,1\n")
    with pytest.raises(LatticeError, match="already divides the box"):
        read_lattice(path, mesh)
