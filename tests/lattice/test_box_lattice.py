"""Settled lattices of one box: their cells and maps."""

import numpy as np
import pytest

from ffdcli import read_lattice
from ffdcli.errors import LatticeError
from support.jobs import ellipsoid


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    return ellipsoid(tmp_path_factory.mktemp("mesh"), 2)


def lattice_of(tmp_path, text, mesh):
    path = tmp_path / "l.yaml"
    path.write_text(f"version: 1\n{text}\n")
    return read_lattice(path, mesh)


@pytest.mark.parametrize("volume", ["tspline", "hierarchical"])
def test_cells_that_hold_the_mesh_lie_in_the_box_and_hold_its_vertices(tmp_path, mesh, volume):
    member = lattice_of(tmp_path, f"volume: {volume}\noctree: {{depth: 3}}", mesh).member
    low, high = np.moveaxis(member.full_cells, 1, 0)
    box, slack = member.layout.box, 1e-12 * mesh.size
    assert np.all((low >= box[0] - slack) & (high <= box[1] + slack))
    local = member.layout.frame.to_local(mesh.vertices)[:, None]
    assert np.all((local >= low - slack) & (local <= high + slack), axis=2).any(axis=1).all()


def test_an_inverse_embedding_has_a_map_and_no_volume(tmp_path, mesh):
    text = "volume: tspline\noctree: {depth: 2, weights: [10, 1], embedding: inverse}"
    lattice = lattice_of(tmp_path, text, mesh)
    assert lattice.needs_fit
    assert np.array_equal(lattice.maps[0].evaluate(mesh.vertices), mesh.vertices)
    with pytest.raises(LatticeError, match="fit it first"):
        _ = lattice.volume
