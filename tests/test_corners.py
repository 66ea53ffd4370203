"""Edges of triangles: shared by vertices, but for diagonals, which are a polygon's own."""

from __future__ import annotations

import numpy as np

from ffdcli.corners import edge_keys, find_twins, number_sides

# Two sheets on the vertices 0 2 1 3, back to back, both split along 0 1: four sides are on it.
ON_AN_EDGE = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 0], [1, 0, 3]])


def twins_of(triangles, polygon):
    sides = number_sides(triangles, np.asarray(polygon), int(triangles.max()) + 1)
    return sides, find_twins(sides.ravel(), triangles.ravel())


def test_sides_on_the_same_vertices_share_an_edge():
    triangles = np.array([[0, 1, 2], [2, 1, 3], [3, 1, 0], [0, 2, 3]])
    sides, twins = twins_of(triangles, range(4))
    keys = edge_keys(triangles, np.roll(triangles, -1, axis=1), 4)
    same = keys.ravel()[:, None] == keys.ravel()
    np.testing.assert_array_equal(sides.ravel()[:, None] == sides.ravel(), same)
    assert sides.max() == 5
    heads = np.roll(triangles, -1, axis=1).ravel()
    np.testing.assert_array_equal(triangles.ravel()[twins], heads)


def test_a_diagonal_is_told_from_an_edge_on_its_vertices():
    sides, twins = twins_of(ON_AN_EDGE, [0, 0, 1, 2])
    assert (twins >= 0).all()
    # Sides 2 and 3 are the diagonal, 8 and 9 the edge of the triangles.
    assert [twins[2], twins[8]] == [3, 9]
    assert sorted(np.unique(sides)) == list(range(6))


def test_two_diagonals_on_the_same_vertices_are_two():
    _, twins = twins_of(ON_AN_EDGE, [0, 0, 1, 1])
    assert [twins[2], twins[8]] == [3, 9]
    _, twins = twins_of(ON_AN_EDGE[[0, 2, 1, 3]], [0, 1, 0, 1])
    assert [twins[2], twins[5]] == [6, 9]


def test_edges_of_many_polygons_have_no_twins():
    sides, twins = twins_of(ON_AN_EDGE, range(4))
    assert (twins[sides.ravel() == sides[0, 2]] == -1).all()
    assert (sides == sides[0, 2]).sum() == 4


def test_a_polygon_with_more_sides_one_way_than_back_leaves_one_over():
    """An outline that runs along its own diagonal: the side left over meets the neighbour's."""
    triangles = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 0, 5]])
    sides, twins = twins_of(triangles, [0, 0, 0, 1])
    assert sorted([twins[0], twins[6]]) == [3, 9]
    assert len(np.unique(sides[:, 0])) == 2
    assert sorted(np.unique(sides)) == list(range(10))


def test_sides_that_run_alike_are_no_twins():
    _, twins = twins_of(np.array([[0, 1, 2], [0, 1, 3]]), [0, 1])
    assert (twins == -1).all()
