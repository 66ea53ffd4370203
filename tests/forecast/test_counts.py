"""Counts of planned, sampled and finished results."""

from dataclasses import astuple

import numpy as np
import pytest
import trimesh

from ffdcli import prepare, read_lattice, read_mesh
from ffdcli.forecast import sample
from ffdcli.forecast.counts import count_made, count_planned
from ffdcli.forecast.rates import Work

LATTICES = {
    "quadratic": "degree: [2, 2, 2]\npoints: [5, 5, 5]\nedits:\n- twist: {axis: w, angle: 40}\n",
    "rational": "volume: nurbs\ndegree: [2, 2, 2]\npoints: [5, 5, 5]\nedits:\n"
    "- twist: {axis: w, angle: 40}\n- weight: {at: [2, 2, 2], value: 1.5}\n",
    # Most faces are planes, and most edges straight.
    "local": "degree: [2, 2, 2]\npoints: [9, 9, 9]\nedits:\n"
    "- move: {at: [4, 4, 8], by: [0, 0, .1]}\n",
}


def planned(folder, name, mesh):
    mesh.export(folder / "a.ply")
    (folder / "a.yaml").write_text(f"version: 1\n{LATTICES[name]}")
    found = read_mesh(folder / "a.ply")
    lattice = read_lattice(folder / "a.yaml", found)
    return prepare(found, lattice, once=True), lattice


@pytest.mark.parametrize("name", LATTICES)
def test_what_is_planned_is_made(name, tmp_path):
    plan, lattice = planned(tmp_path, name, trimesh.creation.icosphere(subdivisions=2))
    told = count_planned(plan.geometry, lattice.volumes, 320)
    made = plan.deform(lattice, check=False)
    assert told == count_made(made.brep, lattice.volumes, 320)
    assert told.faces == made.report["faces"]
    assert told.surface_points == made.report["control_points"]
    assert told.coedges == 2 * told.edges


@pytest.mark.parametrize("tolerance", [None, 1e-4])
@pytest.mark.parametrize("name", LATTICES)
def test_a_sample_tells_what_all_will_be(name, tolerance, tmp_path, monkeypatch):
    monkeypatch.setattr(sample, "SAMPLE", 300)
    plan, lattice = planned(tmp_path, name, trimesh.creation.icosphere(subdivisions=3))
    facets = plan.geometry.parts.facets
    work = Work(tolerance=tolerance)
    told = sample.sample_counts(plan.origin.checked, facets, work, spare_planes=True)
    exact = plan.deform(lattice, check=False)
    made = plan.deform(lattice, tolerance=tolerance, check=False)
    for found, real in zip(told, (exact, made), strict=True):
        wanted = count_made(real.brep, lattice.volumes, 1280)
        # Of few faces with many points, some are missed by chance.
        np.testing.assert_allclose(astuple(found), astuple(wanted), rtol=0.25)


def test_a_share_of_a_reduction():
    from ffdcli.forecast.counts import Counts

    exact = Counts(10, 10, 10, 15, 30, 100, 60)
    made = Counts(10, 10, 10, 15, 30, 25, 30)
    all_of_them = Counts(100, 100, 100, 150, 300, 1000, 700)
    assert all_of_them.reduced_as(exact, made) == Counts(100, 100, 100, 150, 300, 250, 350)
