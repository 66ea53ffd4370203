"""Polygons of one plane that lie on one another round a vertex are faces of their own."""

import numpy as np
import pytest

from ffdcli import deform
from ffdcli.brep.occ.check import kernel_check
from ffdcli.surface.overlaps import overlapping_polygons
from ffdcli.surface.planes import divide, find_planes
from support.jobs import EDITS, obj, read_job, turn, written


def fan(degrees, way=1):
    """Triangles round a vertex in a plane, over so many degrees, the rim a spiral."""
    angles = np.radians(np.arange(0, degrees + 1, 60))
    radius = 3 + angles / 10
    rim = np.column_stack([radius * np.cos(angles), way * radius * np.sin(angles), 0 * angles])
    count = len(angles)
    faces = np.column_stack([np.zeros(count - 1), np.arange(1, count), np.arange(2, count + 1)])
    return np.concatenate([[[0, 0, 0]], rim]), faces.astype(np.int64)[:, ::way]


@pytest.mark.parametrize("way", [1, -1])
def test_more_than_a_full_turn(way):
    for degrees, apart in ((300, 0), (360, 0), (420, 7)):
        points, faces = fan(degrees, way)
        points = points @ turn([0.3, 0.5, 0.7])
        polygon = np.arange(len(faces))
        groups = find_planes(points, faces, polygon, 1e-9)
        assert len(groups.normal) == 1
        labels = overlapping_polygons(points, faces, polygon, groups)
        assert len(set(labels[labels > 0].tolist())) == np.count_nonzero(labels) == apart


def test_a_closed_fan_is_one_face():
    points, faces = fan(360)
    faces[faces == 7] = 1
    polygon = np.arange(6)
    groups = find_planes(points, faces, polygon, 1e-9)
    assert not overlapping_polygons(points, faces, polygon, groups).any()


def test_they_are_written(tmp_path):
    """As one face their outline crosses itself, which OpenCascade refuses."""
    points, faces = fan(420)
    # A wall, so that the mesh is not flat.
    points = np.concatenate([points, points[1:3] + [0, 0, 2]])
    faces = np.concatenate(
        [faces, [[2, 1, len(points) - 2], [2, len(points) - 2, len(points) - 1]]]
    )
    mesh, lattice = read_job(tmp_path, f"points: [4, 4, 4]{EDITS}", mesh=obj(points, faces))
    result = deform(mesh, lattice)
    assert kernel_check(result.kernel_shape).valid
    verdict = written(result, tmp_path / "a.step", mesh, lattice)
    assert verdict.faces == result.report["faces"] == 8


def test_outlines_that_cross_between_vertices():
    """A ring that closes with an overlap narrower than the noise, and shares no vertex there."""
    angles = np.radians(np.linspace(0, 360, 9))
    rim = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    points = np.concatenate([rim, 2 * rim])
    points[[8, 17], 1] += 4e-5
    k = np.arange(8)
    faces = np.concatenate(
        [np.column_stack([k, k + 9, k + 10]), np.column_stack([k, k + 10, k + 1])]
    )
    points = points @ turn([0.3, 0.5, 0.7])
    polygon = np.arange(len(faces))
    for overlap in (True, False):
        if not overlap:
            points[[8, 17]] -= np.array([0, 8e-5, 0]) @ turn([0.3, 0.5, 0.7])
        groups = find_planes(points, faces, polygon, 1e-4)
        assert len(groups.normal) == 1
        labels = overlapping_polygons(points, faces, polygon, groups)
        assert (0 < np.count_nonzero(labels) < 4) if overlap else not labels.any()
        rest = divide(points, faces, groups, labels)
        assert not overlapping_polygons(points, faces, polygon, rest).any()
