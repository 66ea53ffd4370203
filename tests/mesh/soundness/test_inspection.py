"""Inspection: every fault is found, counted and located; bodies and cavities are distinguished."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from ffdcli.errors import MeshError
from ffdcli.mesh import Mesh, inspect, require_closed, require_usable, shells
from support.mesh_models import CORNERS
from support.mesh_models import QUADS as FACES

QUADS = np.array(FACES)


def make(*bodies, polygons=None):
    """A mesh of cubes (low corner, edge length, facing out)."""
    vertices = [CORNERS * edge + np.asarray(low) for low, edge, _ in bodies]
    loops = [
        (QUADS if outward else QUADS[:, ::-1]) + 8 * n for n, (_, _, outward) in enumerate(bodies)
    ]
    corners = np.concatenate(loops).tolist() if polygons is None else polygons
    starts = np.concatenate([[0], np.cumsum([len(loop) for loop in corners])])
    return Mesh(np.concatenate(vertices), np.concatenate(corners), starts)


CUBE = ((0, 0, 0), 1.0, True)


def refusal(mesh):
    with pytest.raises(MeshError) as caught:
        require_usable(mesh, inspect(mesh))
    assert caught.value.hint
    return str(caught.value)


def test_a_sound_cube():
    mesh = make(CUBE)
    soundness = inspect(mesh)
    assert soundness.closed
    assert soundness.bodies == 1
    assert soundness.volumes.tolist() == [1.0]
    for finding in (soundness.open_edges, soundness.nonmanifold_edges, soundness.degenerate):
        assert (finding.count, finding.place) == (0, None)
    require_usable(mesh, soundness)


def test_an_open_mesh_is_reported_and_accepted():
    mesh = make(CUBE, polygons=QUADS[:-1].tolist())
    soundness = inspect(mesh)
    assert not soundness.closed
    assert soundness.open_edges.count == 4
    assert soundness.open_edges.place[0] == 1.0
    require_usable(mesh, soundness)


def test_a_turned_polygon():
    mesh = make(CUBE, polygons=[*QUADS[:-1].tolist(), QUADS[-1, ::-1].tolist()])
    assert inspect(mesh).inconsistent_edges.count == 4
    assert "4 edges join polygons wound in opposite directions" in refusal(mesh)


def test_a_wall_inside():
    mesh = make(CUBE, polygons=[*QUADS.tolist(), [0, 1, 7, 6]])
    soundness = inspect(mesh)
    assert soundness.nonmanifold_edges.count == 2
    assert np.array_equal(soundness.nonmanifold_edges.place, [0.5, 0, 0])
    assert "more than two polygons" in refusal(mesh)


def test_a_duplicate_polygon():
    mesh = make(CUBE, polygons=[*QUADS.tolist(), [3, 1, 0, 2]])
    assert inspect(mesh).duplicates.count == 1
    assert "1 polygon lies on the same vertices" in refusal(mesh)


@pytest.mark.parametrize(
    ("loop", "kind", "words"),
    [([0, 1, 1], "degenerate", "no area"), ([0, 1, 2, 1], "crossing", "doubles back")],
)
def test_a_repeated_vertex(loop, kind, words):
    mesh = make(CUBE, polygons=[*QUADS.tolist(), loop])
    assert getattr(inspect(mesh), kind).count == 1
    assert words in refusal(mesh)


@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_collinear_corners_have_no_area_but_a_thin_triangle_has(offset):
    line = np.array([[0.1, 0.2, 0.3], [0.2, 0.4, 0.6], [0.3, 0.6, 0.9]]) + offset
    starts = np.array([0, 3])
    assert inspect(Mesh(line, np.arange(3), starts)).degenerate.count == 1
    line[1, 0] += 1e-9
    assert inspect(Mesh(line, np.arange(3), starts)).degenerate.count == 0


def test_an_inside_out_cube():
    mesh = make(CUBE, ((5, 5, 5), 1.0, False))
    soundness = inspect(mesh)
    assert soundness.inside_out.count == 1
    assert soundness.inside_out.place[0] >= 5
    assert "inside out" in refusal(mesh)


def test_nested_bodies():
    mesh = make(
        ((2, 2, 2), 2.0, True),  # 0: body in the cavity
        ((0, 0, 0), 9.0, True),  # 1: outer
        ((1, 1, 1), 5.0, False),  # 2: cavity of 1
        ((2.5, 2.5, 2.5), 1.0, False),  # 3: cavity of 0
        ((7, 7, 7), 1.0, False),  # 4: second cavity of 1
        ((20, 0, 0), 1.0, True),  # 5: elsewhere
    )
    nesting = shells(mesh)
    assert nesting.volume == pytest.approx([8, 729, -125, -1, -1, 1])
    assert nesting.parent.tolist() == [-1, -1, 1, 0, 1, -1]
    assert nesting.closed.all()
    assert np.array_equal(nesting.body, np.repeat(np.arange(6), 6))
    require_usable(mesh, inspect(mesh))


def test_an_inside_out_body_in_a_void_is_no_cavity():
    nesting = shells(make(((0, 0, 0), 9.0, True), ((1, 1, 1), 5.0, False), ((2, 2, 2), 1.0, False)))
    assert nesting.parent.tolist() == [-1, 0, -1]
    assert nesting.inside_out.tolist() == [2]


def test_a_box_around_is_not_enough():
    # The corner between the arms of an L lies in its bounding box, but not in it.
    outline = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]]
    vertices = np.array([[x, y, z] for z in (0, 1) for x, y in outline], dtype=float)
    sides = [[i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6] for i in range(6)]
    loops = [[5, 4, 3, 2, 1, 0], [6, 7, 8, 9, 10, 11], *sides, *(QUADS[:, ::-1] + 12).tolist()]
    small = CORNERS * 0.5
    for low, parent in (((2, 2, 0.25), -1), ((0.25, 2, 0.25), 0)):
        mesh = Mesh(
            np.concatenate([vertices, small + low]),
            np.concatenate(loops),
            np.concatenate([[0], np.cumsum([len(loop) for loop in loops])]),
        )
        nesting = shells(mesh)
        assert nesting.volume == pytest.approx([5, -0.125])
        assert nesting.parent.tolist() == [-1, parent]


def test_volume_far_from_the_origin():
    assert inspect(make(((1e6, -1e6, 1e6), 0.5, True))).volumes == pytest.approx([0.125], rel=1e-12)


def test_trimesh_is_not_imported_with_the_package():
    code = "import sys, ffdcli.mesh; sys.exit('trimesh' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_numbers_too_coarse_for_the_model_are_refused():
    """Single precision a million units from the origin: nothing is certainly flat there."""
    mesh = replace(make(((1e6, 0, 0), 4.0, True)), resolution=0.25)
    assert "precise only to 0.25" in refusal(mesh)


def test_an_open_mesh_is_refused_where_a_solid_is_required():
    mesh = make(CUBE, polygons=QUADS[:-1].tolist())
    with pytest.raises(MeshError, match="4 edges belong to only one polygon"):
        require_closed(mesh, inspect(mesh))
    require_closed(make(CUBE), inspect(make(CUBE)))
