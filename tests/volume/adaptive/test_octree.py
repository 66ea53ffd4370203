"""Octrees: tiling, balance, what triangles touch, corners."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from scipy.optimize import linprog

from ffdcli.volume.adaptive.octree import interleave, separate
from ffdcli.volume.adaptive.octree_growth import Region, balanced, grow, tree_of
from support.volume_trees import CORNER, ball, regular_tree, tree_with_junctions


def test_codes_are_undone_and_keep_cells_together():
    cells = np.random.default_rng(0).integers(0, 1 << 20, (1000, 3))
    assert np.array_equal(separate(interleave(cells)), cells)
    assert interleave(np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0], [1, 1, 1]])).tolist() == [
        1,
        2,
        4,
        7,
    ]


@pytest.mark.parametrize(("depth", "count"), [(3, 729), (4, 4913), (5, 35937)])
def test_regular_subdivision_has_the_papers_counts(depth, count):
    model = regular_tree(depth)
    assert len(model.tree.corners) == count
    assert len(model.tree.size) == 8**depth


def test_leaves_tile_the_box_and_are_found():
    tree = tree_with_junctions().tree
    assert int((tree.size.astype(object) ** 3).sum()) == 8**tree.depth
    cells = np.random.default_rng(0).integers(0, 1 << tree.depth, (500, 3))
    leaf = tree.locate(cells)
    assert (tree.low[leaf] <= cells).all()
    assert (cells < tree.high[leaf]).all()


def test_cells_that_touch_differ_by_one_level_at_most():
    # A deep point beside a coarse box needs many rounds of balancing.
    deep = grow(None, np.array([[0.501, 0.501, 0.501]]), 7).tree
    for tree in (deep, tree_with_junctions().tree):
        for i, j in itertools.combinations(range(len(tree.size)), 2):
            touching = (tree.low[i] <= tree.high[j]).all() and (tree.low[j] <= tree.high[i]).all()
            if touching:
                assert abs(int(tree.levels[i]) - int(tree.levels[j])) <= 1
    assert (deep.levels == 7).sum() >= 8


def test_balancing_leaves_a_balanced_tree_alone():
    tree = tree_with_junctions().tree
    divided = []
    for level in range(tree.depth):
        inner = tree.low[tree.levels > level] >> (tree.depth - level)
        divided.append(np.unique(interleave(inner)))
    again = tree_of(balanced(divided))
    assert np.array_equal(again.low, tree.low)


def test_full_leaves_are_those_that_triangles_touch():
    triangles = ball()
    model = grow(triangles, None, 3)
    tree = model.tree
    low, high = tree.low / 8, tree.high / 8
    for leaf in np.random.default_rng(0).choice(len(tree.size), 60, replace=False):
        assert model.full[leaf] == any(_meets(t, low[leaf], high[leaf]) for t in triangles)
    assert (tree.levels[model.full] == 3).all()


def _meets(triangle, low, high):
    """Whether some convex combination of the corners lies in the box, by linear programming."""
    if np.any(triangle.min(axis=0) > high) or np.any(triangle.max(axis=0) < low):
        return False
    rows, limits = np.vstack([triangle.T, -triangle.T]), np.concatenate([high, -low])
    found = linprog(np.zeros(3), rows, limits, [[1, 1, 1]], [1], bounds=(0, 1))
    return found.status == 0


def test_a_triangle_on_a_side_touches_both_cells():
    sheet = np.array([[[0.1, 0.1, 0.5], [0.2, 0.1, 0.5], [0.1, 0.2, 0.5]]])
    model = grow(sheet, None, 1)
    touched = model.tree.low[model.full].tolist()
    assert touched == [[0, 0, 0], [0, 0, 1]]


def test_vertices_rule_and_regions():
    model = grow(None, np.array([[0.1, 0.1, 0.1], [1.0, 1.0, 1.0], [1.5, 0, 0]]), 2)
    assert model.tree.low[model.full].tolist() == [[0, 0, 0], [3, 3, 3]]
    part = grow(None, None, 0, [CORNER]).tree
    fine = part.levels == 4
    # The part ends within the fourth cell; cells that it only touches are not divided for it.
    assert (part.low[fine] <= 4).all()
    exact = grow(None, None, 0, [Region(np.zeros(3), np.full(3, 0.25), 2)]).tree
    assert (exact.levels == 2).sum() == 8


def test_boxes_meet_the_leaves_they_overlap():
    tree = tree_with_junctions().tree
    random = np.random.default_rng(2)
    low = random.uniform(0, 16, (40, 3))
    high = low + random.uniform(0, 5, (40, 3))
    low[0] = high[0] = [4.0, 4.0, 4.0]
    box, leaf = tree.meeting(low, high)
    found = set(zip(box.tolist(), leaf.tolist(), strict=True))
    for i, j in itertools.product(range(40), range(len(tree.size))):
        open_meet = (low[i] < tree.high[j]).all() and (high[i] > tree.low[j]).all()
        closed = (low[i] <= tree.high[j]).all() and (high[i] >= tree.low[j]).all()
        assert ((i, j) in found) == (closed if i == 0 else open_meet)
    some = np.array([0, 3, 7])
    box, leaf = tree.meeting(low, high, some)
    assert set(zip(box.tolist(), leaf.tolist(), strict=True)) == {p for p in found if p[1] in some}


def test_corners_are_shared():
    tree = tree_with_junctions().tree
    assert len(np.unique(tree.corners, axis=0)) == len(tree.corners)
    share = [Fraction(int(s), 1 << tree.depth) for s in tree.size]
    assert sum(s**3 for s in share) == 1
    first = tree.corners[tree.leaf_corners[:, 0]]
    last = tree.corners[tree.leaf_corners[:, 7]]
    assert np.array_equal(first, tree.low)
    assert np.array_equal(last, tree.high)
