"""The cube of 12 triangles, through the whole path (Feng 2002, Table 2 and Fig. 7)."""

from __future__ import annotations

import pytest

from ffdcli import deform
from support.surface_models import box_mesh

LATTICE = """\
volume: bspline
degree: [2, 2, 2]
points: [4, 4, 4]
edits:
  - move: {at: [0, 0, 0], by: [0.1, -0.05, 0.02]}
  - move: {at: [1, 2, 3], by: [0.1, -0.05, 0.2]}
  - move: {at: [3, 2, 1], by: [0.1, -0.05, 0.2]}
  - twist: {axis: w, angle: 30}
"""


@pytest.fixture
def cube(job):
    vertices, triangles = box_mesh()
    return job(LATTICE, vertices, triangles)


def test_the_papers_partition(cube) -> None:
    report = deform(*cube, patches="bezier").report
    assert report["sub_polygons"] == 36
    assert report["patches"] == 24
    assert report["faces"] == 24
    assert report["edges"] == 48
    assert report["vertices"] == 26
    assert report["degrees"] == {"2x2": 24}
    assert report["control_points"] == 216
    assert report["solids"] == 1
    assert report["watertight"]


def test_merged_faces(cube) -> None:
    report = deform(*cube).report
    assert report["faces"] == report["patches"] == 6
    assert report["edges"] == 12
    assert report["vertices"] == 8
    assert report["degrees"] == {"2x2": 6}
    assert report["solids"] == 1
    assert report["watertight"]
