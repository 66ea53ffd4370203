"""Triangles of deformed parts: closed, near the deformed part, with its names and colours."""

import numpy as np
import pytest
import trimesh

from ffdcli import deform, deform_mesh, read_lattice, read_part
from ffdcli.brep.occ.part.mesh import mesh_of_part
from ffdcli.deformation import Deformation
from ffdcli.errors import CheckError, MeshError
from ffdcli.mesh.winding import nearest_on_triangles
from support import parts

TWIST = "version: 1\npoints: [4, 4, 5]\nedits:\n  - twist: {axis: w, angle: 40}\n"


@pytest.fixture
def job(tmp_path):
    def make(name, text=TWIST):
        part = read_part(parts.write_part(name, tmp_path))
        (tmp_path / "lattice.yaml").write_text(text)
        return part, read_lattice(tmp_path / "lattice.yaml", part)

    return make


def farthest(part, lattice, found, count=40):
    """Largest distance of points of the deformed part from the triangles, by comparing with all."""
    rest = mesh_of_part(part, 1e-4).vertices
    chosen = np.random.default_rng(5).choice(len(rest), min(count, len(rest)), replace=False)
    images = Deformation.of(lattice, part.delta).images(rest[chosen])
    corners, off = found.points[found.triangles], []
    for point in images:
        every = np.broadcast_to(point, (len(corners), 3))
        off.append(np.linalg.norm(nearest_on_triangles(every, corners) - point, axis=1).min())
    return max(off)


@pytest.mark.parametrize("name", ["cone", "torus", "hollow", "pair"])
def test_triangles_are_closed_and_near(job, name):
    part, lattice = job(name)
    allowed = 1e-3 * part.size
    found = deform_mesh(part, lattice, tolerance=allowed)
    assert 0 < found.deviation <= allowed
    assert farthest(part, lattice, found) <= allowed
    solid = trimesh.Trimesh(found.points, found.triangles, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    exact = deform(part, lattice).shape
    assert abs(solid.volume - exact.Volume()) <= allowed * exact.Area()
    assert found.report["part"]["faces"] == deform(part, lattice).report["part"]["faces"]


@pytest.mark.parametrize("factors", [(1.5, 1.5, 1.5), (2, 1, 0.5)])
def test_points_at_rest_are_those_of_the_part(job, factors):
    """Also on planes that stay planes, whose parameters change with their lengths."""
    part, lattice = job("cylinder", "version: 1\npoints: [4, 4, 5]\n")
    lattice = lattice.with_net(lattice.points * np.array(factors))
    result = deform(part, lattice)
    assert result.report["faces_by"]["exact"] == 2
    found = result.tessellate(1e-3 * part.size)
    off = found.rest * factors - found.points
    # The cylinder itself is fitted, since its parameters count lengths.
    assert np.linalg.norm(off, axis=1).max() <= result.max_error


def test_triangles_cannot_be_closer_than_the_fit(job):
    part, lattice = job("cylinder")
    coarse = deform(part, lattice, fit_tolerance=1e-3 * part.size)
    with pytest.raises(CheckError, match="no triangles were found"):
        coarse.tessellate(0.5 * coarse.max_error)
    # Fits for triangles keep to a quarter of their tolerance.
    found = deform_mesh(part, lattice, fit_tolerance=1e-3 * part.size, tolerance=5e-3 * part.size)
    assert found.report["max_error"] == coarse.max_error


def test_names_and_colours_come_along(tmp_path):
    parts.assembly().export(str(tmp_path / "stand.step"))
    part = read_part(tmp_path / "stand.step")
    (tmp_path / "lattice.yaml").write_text(TWIST)
    found = deform_mesh(part, read_lattice(tmp_path / "lattice.yaml", part))
    assert set(part.solid_names) <= set(found.groups)
    for number, name in enumerate(part.solid_names):
        faces = np.flatnonzero(part.shell_solid[part.face_shell] == number)
        same = [each for each, other in enumerate(part.solid_names) if other == name]
        if same == [number]:
            assert np.array_equal(found.groups[name], np.flatnonzero(np.isin(found.owner, faces)))
    assert {material.colour is not None for material in found.paint.materials} == {True}
    assert len(found.paint.materials) == 2


def test_an_open_part_stays_open(tmp_path):
    import cadquery as cq

    cq.Shell.makeShell(cq.Workplane().cylinder(4, 1).faces("not >Z").vals()).exportBrep(
        str(tmp_path / "open.brep")
    )
    part = read_part(tmp_path / "open.brep")
    (tmp_path / "lattice.yaml").write_text(TWIST)
    found = deform_mesh(part, read_lattice(tmp_path / "lattice.yaml", part))
    assert not found.report["watertight"]
    assert not trimesh.Trimesh(found.points, found.triangles, process=False).is_watertight


def test_a_part_has_no_vertices_to_deform(job):
    for mode in ("vertices", "uniform", "adaptive"):
        with pytest.raises(MeshError, match="no vertices to deform"):
            deform_mesh(*job("cylinder"), mode=mode)
