"""Needles that face away from the plane of their group: notches and spikes."""

from dataclasses import replace

import numpy as np
import pytest

from ffdcli import deform
from ffdcli.brep.occ.check import kernel_check
from ffdcli.surface.needles import beyond_sides, faces_away, fold_width, triangle_areas
from ffdcli.surface.planes import find_planes
from support.jobs import EDITS, obj, read_job, written
from support.surface_models import make_volume, run

DELTA = 1e-3


def groups_of(points, faces):
    points, faces = np.array(points, dtype=float), np.array(faces)
    return points, faces, find_planes(points, faces, np.arange(len(faces)), DELTA)


def test_a_spike_is_a_face_of_its_own():
    """A needle over the edge 1-2 that reaches beyond vertex 2, and faces away."""
    base = [[0, 0, 0], [2, 0, 0], [2, 1, 0]]
    points, faces, groups = groups_of([*base, [2 - 5e-4, 1.4, 0]], [[0, 1, 2], [2, 1, 3]])
    assert (triangle_areas(points, faces)[:, 2] > 0).tolist() == [True, False]
    assert beyond_sides(points, faces, groups.sides).tolist() == [[-1, -1, 1], [-1, 0, -1]]
    assert len(groups.normal) == 2


def test_a_notch_stays():
    """The same, but its tip lies beside the edge: the outline has a notch, and stays simple."""
    base = [[0, 0, 0], [2, 0, 0], [2, 1, 0]]
    points, faces, groups = groups_of([*base, [2 - 5e-4, 0.4, 0]], [[0, 1, 2], [2, 1, 3]])
    assert beyond_sides(points, faces, groups.sides)[1].tolist() == [0, -1, -1]
    assert len(groups.normal) == 1
    axes = np.array([[2, 0, 1]])
    width = fold_width(points, faces, groups.sides, groups.group, axes, DELTA)
    assert abs(width - 5e-4) <= 1e-12
    # Seen from behind, the large triangle is the one that faces away, and is no needle.
    back = np.array([[2, 1, 0]])
    assert fold_width(points, faces, groups.sides, groups.group, back, DELTA) == 0


def test_needles_side_by_side_add_up():
    points = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [2 - 3e-4, 0.5, 0], [2 - 5e-4, 0.25, 0]]
    points, faces, groups = groups_of(points, [[0, 1, 2], [2, 1, 3], [3, 1, 4]])
    assert len(groups.normal) == 1
    width = fold_width(points, faces, groups.sides, groups.group, np.array([[2, 0, 1]]), DELTA)
    # The second altitude stands on the side from 1 to 3.
    side, tip = points[3] - points[1], points[4] - points[1]
    second = np.linalg.norm(np.cross(side, tip)) / np.linalg.norm(side)
    assert abs(width - 3e-4 - second) <= 1e-12


def test_edge_on_faces_away():
    normal = np.array([0.6, 0, 0.8])
    area = np.array([[0.6, 0, 0.8], [0, 0, 1], [-0.6, 0, -0.8]])
    assert faces_away(area, normal).tolist() == [False, True, True]


def test_a_needle_keeps_its_corners():
    """Its third vertex lies within the noise of the long side; two edges alone make no outline."""
    points = np.array([[-0.4, -0.3, 0.1], [0.4, 0.3, 0.1], [0.4 - 4e-5, 0.3, 0.1]])
    stages = run(
        points, np.array([[0, 1, 2]]), make_volume(-1.0, 1.0, (2, 2, 2), (3, 3, 3)), delta=1e-4
    )
    assert len(stages.outlines.edges) == 3


@pytest.mark.parametrize("rise", [0.0, 3.8e-5])
def test_pcurves_of_needles_do_not_cross(tmp_path, rise):
    """A side that is almost level becomes level, unless it would cross the other long side."""
    points = [
        [0, -2.8968, 0.4946],
        [0, -2.8968, 0.5],
        [0, -10, 0.5 + rise],
        [3, -2, 0.5],
        [3, -9, 0],
    ]
    faces = [[0, 1, 2], [1, 3, 2], [2, 3, 4]]
    mesh, lattice = read_job(tmp_path, f"points: [4, 4, 4]{EDITS}", mesh=obj(points, faces))
    mesh = replace(mesh, resolution=6e-5)
    result = deform(mesh, lattice)
    brep = result.brep
    ends = brep.pcurves[np.arange(3), np.where(brep.coedge_forward[:3], 0, 1)]
    level = np.abs(np.diff(brep.pcurves[:3], axis=1)[:, 0, :]).min(axis=1) == 0
    assert level.sum() == (2 if rise == 0 else 1), ends
    assert kernel_check(result.kernel_shape).valid
    assert written(result, tmp_path / "a.step", mesh, lattice).faces == result.report["faces"]
