"""Scenes: outlines, colours and frames of what is drawn."""

from __future__ import annotations

import numpy as np
import pytest

from ffdcli import deform
from ffdcli.view.deformation_scene import scene_of
from ffdcli.view.scene import colour_faces, grid_lines, skin
from support.mesh_models import CORNERS, QUADS

# A strip of two flat squares, two triangles each, hinged at vertices 1 and 4.
POINTS = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 1], [0, 1, 0], [1, 1, 0], [2, 1, 1]], dtype=float)
STRIP = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
FACE = np.array([0, 0, 1, 1])


def test_faces_share_no_vertices_and_diagonals_are_no_outline():
    made = skin(POINTS[None], STRIP, FACE)
    assert made.frames.shape == (1, 8, 3)
    assert not set(made.triangles[:2].ravel()) & set(made.triangles[2:].ravel())
    assert np.array_equal(made.frames[0][made.triangles], POINTS[STRIP])
    drawn = {frozenset(map(tuple, made.frames[0][pair].tolist())) for pair in made.outline}
    expected = [(0, 1), (1, 4), (4, 3), (3, 0), (1, 2), (2, 5), (5, 4)]
    assert drawn == {frozenset(map(tuple, POINTS[list(pair)].tolist())) for pair in expected}
    assert len(made.outline) == 7


def test_neighbours_differ_in_colour():
    # The faces of a cube: each touches four others.
    corner = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2],
                       [1, 3, 7, 5]])  # fmt: skip
    triangles = np.concatenate([corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]])
    face = np.tile(np.arange(6), 2)
    given = colour_faces(triangles, face, 6)
    for one in range(6):
        for other in range(one):
            if len(set(corner[one]) & set(corner[other])) == 2:
                assert given[one] != given[other]


def test_a_net_has_a_line_between_neighbours_only():
    pairs = grid_lines((2, 3, 2))
    assert len(pairs) == 1 * 3 * 2 + 2 * 2 * 2 + 2 * 3 * 1
    place = np.stack(np.unravel_index(np.arange(12), (2, 3, 2)), axis=1)
    assert np.array_equal(np.abs(place[pairs[:, 0]] - place[pairs[:, 1]]).sum(axis=1), [1] * 20)


DRAGGED = """\
degree: [2, 2, 2]
points: [3, 3, 3]
edits:
  - drag: {pairs: [{from: [1, 1, 1], by: [0.1, 0.2, 0.3]}]}
"""


@pytest.mark.parametrize(
    ("more", "steps"), [("volume: bspline\n", 2), ("volume: nurbs\n", 11)], ids=["bspline", "nurbs"]
)
def test_the_scene_of_a_run(job, more, steps):
    weight = "  - weight: {at: [1, 1, 1], value: 3}\n" if "nurbs" in more else ""
    mesh, lattice = job(more + DRAGGED + weight, CORNERS, QUADS)
    result = deform(mesh, lattice)
    scene = scene_of(mesh, lattice, result)
    assert scene.amplitudes.tolist() == pytest.approx(np.linspace(0, 1, steps))
    assert scene.faces.degrees == tuple(["2x2"] * 6)
    assert scene.drags.tolist() == [[[1, 1, 1], [1.1, 1.2, 1.3]]]
    # At rest the faces lie in the cube's sides; fully deformed the corner is where it was dragged.
    rest = scene.after.frames[0]
    assert np.min(np.abs(rest * (1 - rest)), axis=1).max() < 1e-15
    assert np.linalg.norm(scene.after.frames[-1] - [1.1, 1.2, 1.3], axis=1).min() < 1e-12
    net = scene.lattices[0]
    assert net.frames.shape == (steps, 27, 3)
    assert not net.locked.any()
    # The four polygons' borders, and no diagonals.
    assert len(scene.before.outline) == 12


def corners_near(cells, places):
    """(n,) True for places that lie in one of the closed cells (m, 2, 3), in whole numbers."""
    return np.array(
        [bool(((cells[:, 0] <= p) & (p <= cells[:, 1])).all(axis=1).any()) for p in places]
    )


@pytest.mark.parametrize("degree", [2, 3])
def test_control_points_of_empty_cells_are_hidden(job, degree):
    """On a hierarchical volume: those whose place touches no full cell of their level."""
    octree = "octree: {depth: 3, also: [{min: [0, 0, 0], max: [0.4, 0.4, 0.4], depth: 4}]}"
    text = f"volume: hierarchical\ndegree: [{degree}, {degree}, {degree}]\n{octree}\n"
    mesh, lattice = job(text + "edits: []\n", CORNERS, QUADS)
    scene = scene_of(mesh, lattice, deform(mesh, lattice), deviations=False)
    (net,), member = scene.lattices, lattice.member
    levels = member.map.levels
    # The surface of the unit cube passes those cells of each level that touch a side of it.
    box = np.array([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
    assert np.array_equal(box, member.layout.box)
    shown = np.zeros(len(levels), dtype=bool)
    leaves = member.full_cells
    for level in range(5):
        side = 2.0**-level
        fine = leaves[np.ptp(leaves[:, :, 0], axis=1) <= side]
        low = np.unique(np.floor(fine[:, 0] / side), axis=0) * side
        mine = levels == level
        shown[mine] = corners_near(np.stack([low, low + side], axis=1), net.frames[0][mine])
    assert np.array_equal(net.hidden, ~shown)
    assert 0 < scene.hidden_count < len(levels)
    # What is not drawn takes no room.
    plain, whole = (scene.bounds(hidden_points=hidden) for hidden in (False, True))
    assert np.ptp(plain, axis=0).max() <= 1 + 1e-12
    assert np.ptp(whole, axis=0).min() > 1.5


def test_faces_say_how_far_they_are_from_the_deformed_mesh(job):
    mesh, lattice = job(DRAGGED, CORNERS, QUADS)
    scene = scene_of(mesh, lattice, deform(mesh, lattice))
    assert scene.faces.deviation.shape == (6,)
    assert 0 <= scene.faces.deviation.max() < 1e-12
