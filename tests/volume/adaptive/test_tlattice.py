"""T-lattices given cell by cell: rules, tables of places, and volumes on them."""

from math import comb

import numpy as np
import pytest
from scipy.interpolate import BSpline

from ffdcli.volume.adaptive.octree import ModelTree, interleave
from ffdcli.volume.adaptive.octree_growth import tree_of
from ffdcli.volume.adaptive.tlattice import BrokenRule, tlattice
from ffdcli.volume.adaptive.tspline import ray_knots, thin_place, tspline_volume
from support.volume_trees import BOX, FRAME, ball, places, shaken, tree_with_junctions


def halves(counts, seed, least=2):
    """A box cut at whole numbers again and again, along an axis and at a place drawn by chance."""
    random = np.random.default_rng(seed)
    todo, done = [(np.zeros(3, dtype=int), np.array(counts))], []
    while todo:
        low, high = todo.pop()
        axis = int(np.argmax((high - low) * random.uniform(0.8, 1, 3)))
        if high[axis] - low[axis] < 2 * least or random.uniform() < 0.05:
            done.append((low, high))
            continue
        at = int(random.integers(low[axis] + least, high[axis] - least + 1))
        upper, lower = low.copy(), high.copy()
        upper[axis] = lower[axis] = at
        todo += [(low, lower), (upper, high)]
    cells = np.array(done)
    return cells[:, 0], cells[:, 1]


UNEVEN = tlattice(*halves((11, 9, 7), 3))


def broken(low, high):
    with pytest.raises(BrokenRule) as caught:
        tlattice(np.array(low), np.array(high))
    return caught.value


def test_cells_of_an_octree_give_the_octrees_volume_to_the_last_bit():
    model = tree_with_junctions()
    tree = model.tree
    order = np.random.default_rng(0).permutation(len(tree.size))
    cells = tlattice(tree.low[order], tree.high[order])
    assert np.array_equal(cells.levels, tree.levels[order])
    full = cells.touching_triangles(ball(0.1))
    assert np.array_equal(full, model.full[order])
    same = shaken(tspline_volume(ModelTree(cells, full), BOX, (100.0, 1.0), FRAME))
    first = shaken(tspline_volume(model, BOX, (100.0, 1.0), FRAME))
    assert same.same_basis(first)
    assert np.array_equal(same.net, first.net)
    assert np.array_equal(same.levels, first.levels)
    assert thin_place(same) is None


def test_places_are_found_by_walking_through_all_boxes():
    low, high = UNEVEN.low, UNEVEN.high
    assert UNEVEN.counts.tolist() == [11, 9, 7]
    assert len(low) > 15
    units = np.stack(np.meshgrid(*map(np.arange, (11, 9, 7)), indexing="ij"), -1).reshape(-1, 3)
    holds = np.all((low[None] <= units[:, None]) & (units[:, None] < high[None]), axis=2)
    assert (holds.sum(axis=1) == 1).all()
    assert np.array_equal(UNEVEN.locate(units), holds.argmax(axis=1))


def test_boxes_that_hold_the_model():
    triangles = ball(0.3)
    full = UNEVEN.touching_triangles(triangles)
    share = np.linspace(0, 1, 30)
    grid = np.array([(a, b, 1 - a - b) for a in share for b in share if a + b <= 1])
    samples = (grid @ triangles).reshape(-1, 3)
    holding = UNEVEN.holding_points(samples)
    assert 0 < holding.sum() < len(full)
    assert not (holding & ~full).any()
    # What is touched but holds no sample is grazed only: a sample is near it.
    for box in np.flatnonzero(full & ~holding):
        low, high = UNEVEN.low[box] / UNEVEN.counts, UNEVEN.high[box] / UNEVEN.counts
        apart = np.linalg.norm(np.clip(samples, low, high) - samples, axis=1).min()
        assert apart < 0.01


def test_rays_meet_closed_faces_only():
    """Knots by walking from face to face, box by box, as in Song & Yang 2005, section 3.2.2."""
    for axis in range(3):
        found = ray_knots(UNEVEN, UNEVEN.corners, axis)
        others = [a for a in range(3) if a != axis]
        for corner, knots in zip(UNEVEN.corners, found.tolist(), strict=True):
            meets = np.all(
                (UNEVEN.low[:, others] <= corner[others])
                & (corner[others] <= UNEVEN.high[:, others]),
                axis=1,
            )
            faces = np.union1d(UNEVEN.low[meets, axis], UNEVEN.high[meets, axis])
            at = corner[axis]
            # Beyond the box the last interval is repeated.
            first, last = np.diff(faces)[0], np.diff(faces)[-1]
            faces = [faces[0] - 2 * first, faces[0] - first, *faces, faces[-1] + last]
            faces = np.array([*faces, faces[-1] + last])
            if at == UNEVEN.counts[axis]:
                faces[-2:] = at + last * np.array([1, 2])
            here = int(np.flatnonzero(faces == at)[0])
            assert knots == faces[here - 2 : here + 3].tolist()
            assert (np.diff(knots) > 0).all()


def test_a_volume_on_uneven_cells_is_the_quotient_and_smooth():
    full = UNEVEN.touching_triangles(ball(0.3))
    volume = tspline_volume(ModelTree(UNEVEN, full), BOX, (10.0, 1.0), FRAME)
    assert thin_place(volume) is None
    points = places(80)
    assert np.array_equal(volume.evaluate(points), points)
    edited = shaken(volume, weights=True)
    units = (points - volume.origin) / volume.unit
    basis = np.ones((len(points), len(UNEVEN.corners)))
    for axis in range(3):
        for number, knots in enumerate(volume.functions.knots[axis].astype(float)):
            one = BSpline.basis_element(knots, extrapolate=False)
            basis[:, number] *= np.nan_to_num(one(units[:, axis]))
    net = edited.net
    sums = basis @ net
    wanted = points + sums[:, :3] / sums[:, 3:4] - sums[:, 4:7] / sums[:, 7:]
    assert np.abs(edited.evaluate(points) - wanted).max() < 1e-13
    forms = edited.restrict(edited.cells(points), points, points).apply(net)
    images = edited.net_kind.images(forms[:, 0, 0, 0], points)
    assert np.abs(images - wanted).max() < 1e-13


def test_the_rule_that_is_broken_is_named_with_its_cells():
    zero = broken([[0, 0, 0], [0, 0, 1]], [[2, 2, 1], [2, 0, 2]])
    assert (zero.rule, zero.cells) == (3, (1,))
    over = broken([[0, 0, 0], [1, 0, 0]], [[2, 2, 2], [4, 2, 2]])
    assert (over.rule, over.cells) == (2, (0, 1))
    assert over.place.tolist() == [[1, 0, 0], [2, 2, 2]]
    twice = broken([[0, 0, 0], [0, 0, 0]], [[2, 2, 2], [2, 2, 2]])
    assert (twice.rule, twice.cells) == (2, (0, 1))
    gap = broken([[0, 0, 0], [3, 0, 0]], [[2, 2, 2], [4, 2, 2]])
    assert gap.rule == 1
    assert gap.place.tolist() == [[2, 0, 0], [3, 2, 2]]
    late = broken([[0, 1, 0]], [[2, 2, 2]])
    assert late.rule == 1
    assert late.place.tolist() == [[0, 0, 0], [2, 1, 2]]


def test_cells_that_too_few_control_points_reach_are_found():
    """Long cells between layers of slats that cross them: all rules hold, no slat ends there."""
    slats = [[k, 0, w, k + 1, 10, w + 1] for k in range(8) for w in (0, 1, 3, 4)]
    found = []
    for wide in (8, 2):
        cut = [[k, v, 2, k + wide, v + 2, 3] for k in range(0, 8, wide) for v in range(0, 10, 2)]
        rows = np.array([*slats, *cut])
        cells = tlattice(rows[:, :3], rows[:, 3:])
        model = ModelTree(cells, np.ones(len(rows), dtype=bool))
        volume = tspline_volume(model, BOX, (1.0, 1.0), FRAME)
        found.append((volume, thin_place(volume)))
    assert found[1][1] is None
    # Bernstein coefficients of the sum on the cell named, by interpolation.
    node = np.linspace(0.01, 0.99, 4)
    grid = np.stack(np.meshgrid(node, node, node, indexing="ij"), axis=-1).reshape(-1, 3)
    volume, (low, high) = found[0]
    sums = volume.basis_matrix(low + grid * (high - low)).sum(axis=1).reshape(4, 4, 4)
    bernstein = np.stack([comb(3, i) * node**i * (1 - node) ** (3 - i) for i in range(4)], axis=1)
    inverse = np.linalg.inv(bernstein)
    forms = np.einsum("ai,bj,ck,ijk->abc", inverse, inverse, inverse, sums)
    assert forms.min() < 1e-10
    assert forms.max() > 0.01


def test_octrees_need_no_balance_for_every_place_to_be_reached():
    """A deep corner beside cells of half the box; neighbours there differ by four levels."""
    divided = [np.zeros(1, dtype=np.int64)] * 5
    deep = tree_of(divided)
    assert deep.levels.min() == 1
    assert deep.levels.max() == 5
    model = ModelTree(deep, np.ones(len(deep.size), dtype=bool))
    assert thin_place(tspline_volume(model, BOX, (1.0, 1.0), FRAME)) is None
    inner = interleave(np.array([[0, 0, 0], [0, 0, 0], [1, 1, 1], [3, 3, 3], [7, 7, 7]]))
    middle = tree_of([inner[n : n + 1] for n in range(5)])
    model = ModelTree(middle, np.ones(len(middle.size), dtype=bool))
    assert thin_place(tspline_volume(model, BOX, (1.0, 1.0), FRAME)) is None
