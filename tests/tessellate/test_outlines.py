"""Faces on their own outlines: corners on straight stretches, holes, every side once."""

from __future__ import annotations

import numpy as np
import pytest

from ffdcli import deform
from ffdcli.errors import CheckError
from ffdcli.tessellate.outlines import net_of_faces


@pytest.fixture
def net(job):
    """A pyramid on a turned square: its sides are cut in slabs, its base is not.

    So the base's outline has corners on straight stretches, where the cuts end.
    """
    turn = np.exp(1j * (0.4 + np.pi / 2 * np.arange(4)))
    points = [(z.real, z.imag, 0) for z in turn.tolist()] + [(0, 0, 1.7)]
    faces = [(3, 2, 1, 0), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
    mesh, lattice = job(
        "degree: [2, 2, 2]\npoints: [6, 6, 6]\nedits:\n"
        "  - twist: {axis: w, angle: 20}\n"
        "  - move: {at: [1, 1, 0], by: [0.2, 0, 0.3]}\n",
        points,
        faces,
    )
    result = deform(mesh, lattice)
    return net_of_faces(result.brep, result.undeformed.rest), result


def test_all_corners_are_used_and_areas_are_right(net):
    triangles, result = net
    brep = result.brep
    assert np.diff(brep.loop_coedges).max() == 8
    assert set(np.unique(triangles.triangles)) == set(range(len(brep.points)))
    a, b, c = (triangles.rest[triangles.triangles[:, i]] for i in range(3))
    area = np.cross(b - a, c - a) / 2
    slant = np.hypot(1.7, np.sqrt(0.5))
    sides = 4 * np.sqrt(2) * slant / 2
    assert np.linalg.norm(area, axis=1).sum() == pytest.approx(2 + sides, rel=1e-14)
    assert (np.linalg.norm(area, axis=1) > 0).all()
    np.testing.assert_allclose(area.sum(axis=0), 0, atol=1e-14)


def test_an_outline_that_crosses_itself_is_refused(net):
    _, result = net
    crossed = result.undeformed.rest.copy()
    base = np.flatnonzero(np.abs(crossed[:, 2]) < 1e-12)
    corners = base[np.argsort(-np.linalg.norm(crossed[base], axis=1))[:2]]
    crossed[corners] = crossed[corners[::-1]]
    with pytest.raises(CheckError, match="crosses or touches itself"):
        net_of_faces(result.brep, crossed)


def test_brep_edges_are_sides_of_both_faces(net):
    triangles, result = net
    brep = result.brep
    uses = np.bincount(triangles.sides.ravel(), minlength=len(triangles.ends))
    assert (uses == 2).all()
    np.testing.assert_array_equal(triangles.ends[: len(brep.edges)], brep.edges)
    owners = triangles.owner[triangles.beside // 3]
    crease = owners[:, 0] != owners[:, 1]
    assert crease[: len(brep.edges)].all()
    assert not crease[len(brep.edges) :].any()
