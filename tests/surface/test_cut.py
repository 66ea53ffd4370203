"""Cuts of polygons keep area and orientation, share vertices, and lie on the plane to the bit."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.corners import find_twins, number_sides
from ffdcli.surface.cut import CutPlane, CutRule, Pieces, from_triangles, split
from support.surface_models import box_mesh, turn, vector_areas

RULE = CutRule(1e-9, 1e-9, 1e-9)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_cuts_in_either_frame_keep_area_and_closedness(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices, triangles = box_mesh(rng.uniform(0.3, 1, 3), turn(rng.normal(size=3), 1.0))
    rotation, shift = turn(rng.normal(size=3), rng.uniform(0, 3)), rng.normal(size=3)
    frames = np.stack([vertices, vertices @ rotation.T + shift], axis=1)
    sides = number_sides(triangles, np.arange(len(triangles)), len(vertices))
    pieces = from_triangles(frames, triangles, sides)
    uncut = vector_areas(pieces)
    for _ in range(4):
        volume, axis = int(rng.integers(2)), int(rng.integers(3))
        low, high = pieces.bounds(volume, axis)
        plane = CutPlane(volume, axis, float(rng.uniform(low.min(), high.max())), RULE)
        count = len(pieces.vertices)
        pieces, cut = split(pieces, plane, rng.random(pieces.count) < 0.8)
        assert (pieces.vertices[count:, volume, axis] == plane.value).all()
        low, high = pieces.bounds(volume, axis)
        assert (high[cut] <= plane.value + RULE.snap).all()
        assert (low[pieces.count - len(cut) :] >= plane.value - RULE.snap).all()
    total = np.zeros_like(uncut)
    np.add.at(total, pieces.triangle, vector_areas(pieces))
    np.testing.assert_allclose(total, uncut, rtol=0, atol=1e-14)
    assert (find_twins(pieces.edges, pieces.corners) >= 0).all()
    there = pieces.vertices[:, 0] @ rotation.T + shift
    np.testing.assert_allclose(pieces.vertices[:, 1], there, rtol=0, atol=1e-14)


def test_pieces_that_are_not_chosen_get_the_vertices_of_their_neighbours_only() -> None:
    vertices, triangles = box_mesh()
    sides = number_sides(triangles, np.arange(12), 8)
    pieces = from_triangles(vertices[:, None], triangles, sides)
    chosen = np.arange(12) == 0
    parts, cut = split(pieces, CutPlane(0, 2, 0.1, RULE), chosen)
    assert cut.tolist() == [0]
    assert parts.count == 13
    corners = np.diff(parts.starts)
    # Two edges of the triangle cross the plane, each beside one neighbour.
    assert np.sort(corners[1:12])[-2:].tolist() == [4, 4]
    assert corners.sum() == 3 + 4 + 11 * 3 + 2


def test_a_quadrangle_is_parted_along_its_diagonal() -> None:
    vertices = np.array([[-1, 0, 0], [0, -1, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
    around = np.arange(4)
    quad = Pieces(vertices[:, None], around, around, np.array([0, 4]), np.zeros(1, dtype=np.int64))
    parted, cut = split(
        quad, CutPlane(0, 1, 0.0, CutRule(1e-9, 1e-9, 1e-9)), np.ones(1, dtype=bool)
    )
    assert cut.tolist() == [0]
    assert len(parted.vertices) == 4
    found = [
        set(parted.corners[a:b].tolist())
        for a, b in zip(parted.starts[:-1], parted.starts[1:], strict=True)
    ]
    assert found == [{0, 1, 2}, {0, 2, 3}]
