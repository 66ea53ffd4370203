"""Adaptive volumes: direct sums against forms, breaks, smoothness, T-spline and level rules."""

import itertools

import numpy as np
import pytest
from scipy.interpolate import BSpline

from ffdcli.folds.certificate import certify
from ffdcli.folds.determinant import cell_determinants
from ffdcli.folds.domain import WholeBox
from ffdcli.folds.global_conditions import is_monotone
from ffdcli.volume.adaptive.hierarchical import active_functions, hierarchical_volume
from ffdcli.volume.adaptive.tspline import tspline_volume
from support.volume_trees import (
    BOX,
    FRAME,
    all_kinds,
    places,
    regular_tree,
    shaken,
    tree_with_junctions,
)

KINDS = all_kinds()


@pytest.fixture(params=list(KINDS))
def volume(request):
    return KINDS[request.param]


def _scipy_basis(volume, points):
    """(m, n) dense values of all functions, by scipy, knots taken one function at a time."""
    units = (points - volume.origin) / volume.unit
    out = np.ones((len(points), volume.functions.count))
    for axis in range(3):
        distinct, which = np.unique(volume.functions.knots[axis], axis=0, return_inverse=True)
        columns = [
            np.nan_to_num(BSpline.basis_element(t.astype(float), extrapolate=False)(units[:, axis]))
            for t in distinct
        ]
        out *= np.stack(columns, axis=-1)[:, which.reshape(-1)]
    return out


def _by_definition(volume, points):
    """``x + N``, or ``x + P - P0`` with both quotients, from scipy's functions."""
    basis, net = _scipy_basis(volume, points), volume.net
    if net.shape[1] == 3:
        return points + basis @ net
    sums = basis @ net
    moved = sums[:, :3] / sums[:, 3:4]
    return points + (moved - sums[:, 4:7] / sums[:, 7:] if net.shape[1] == 8 else moved)


def test_functions_are_those_of_scipy(volume):
    points = places(60)
    basis = volume.basis_matrix(points)
    assert np.abs(basis.toarray() - _scipy_basis(volume, points)).max() < 1e-15
    assert (basis.data >= 0).all()


def test_evaluation_is_the_definition(volume):
    points = places(200)
    assert np.abs(volume.evaluate(points) - _by_definition(volume, points)).max() < 4e-14


def test_bezier_forms_agree_with_evaluation(volume):
    points = places(200)
    cells = volume.cells(points)
    forms = volume.restrict(cells, points, points).apply(volume.net)
    values = volume.at_points(cells, points).apply(volume.net)
    assert values.shape == (len(points), 1, 1, 1, volume.net.shape[1])
    for found in (forms, values):
        images = volume.net_kind.images(found[:, 0, 0, 0], points)
        assert np.abs(images - volume.evaluate(points)).max() < 4e-14


def test_derivatives(volume):
    points, step = places(50), 1e-6
    slopes = volume.jacobian(points)
    for axis in range(3):
        arm = step * np.eye(3)[axis]
        ratio = (volume.evaluate(points + arm) - volume.evaluate(points - arm)) / (2 * step)
        assert np.abs(ratio - slopes[:, :, axis]).max() < 2e-8
    longest = np.linalg.norm(slopes, axis=1).max(axis=0)
    bounds = volume.slope_bounds(volume.cells(points))
    assert (bounds >= longest).all()
    # Sharp enough to say something: terms bounded one by one cost the ratio of the weights, 100.
    assert (bounds < (2 if volume is not KINDS["weights"] else 8) * longest).all()


def test_slope_bounds_where_one_weight_is_edited():
    """Elsewhere both quotients have one denominator, and count as one."""
    volume = KINDS["tspline"]
    rest = volume.with_control(volume.rest_points, volume.rest_weights)
    weights = volume.rest_weights.copy()
    weights[np.argmax(volume.hidden)] *= 1.5
    points, random = places(300), np.random.default_rng(4)
    moved = rest.rest_points + 0.05 * random.uniform(-1, 1, rest.rest_points.shape)
    edited = rest.with_control(moved, weights)
    low, high = edited.supports()
    number = int(np.argmax(volume.hidden))
    away = np.any((points < low[number]) | (points > high[number]), axis=1)
    assert away.any()
    points = points[away]
    longest = np.linalg.norm(edited.jacobian(points), axis=1).max(axis=0)
    bounds = edited.slope_bounds(edited.cells(points))
    assert (bounds >= longest).all()
    assert (bounds < 1.5 * longest).all()


def test_outside_the_box_nothing_moves(volume):
    beyond = volume.box[1] + np.array([[0.01, 0, 0], [1, 1, 1]])
    assert np.array_equal(volume.evaluate(beyond), beyond)
    assert np.array_equal(volume.jacobian(beyond), np.tile(np.eye(3), (2, 1, 1)))


def test_a_volume_at_rest_is_the_identity_to_the_last_bit(volume):
    rest = volume.with_control(volume.rest_points, volume.rest_weights)
    points = places(100)
    assert np.array_equal(rest.evaluate(points), points)


def test_boxes_between_planes_are_polynomial(volume):
    """The form of the cell in the middle holds at the box's far corners too."""
    random = np.random.default_rng(3)
    low = places(40)
    high = np.minimum(low + random.uniform(0, 0.4, (40, 3)), BOX[1])
    boxes = np.stack([low, high], axis=1)
    for axis in range(3):
        planes = volume.knot_planes(axis, boxes).values
        nearest = np.fmin(boxes[:, 1, axis], np.nanmin(np.column_stack([planes, high[:, axis]]), 1))
        boxes[:, 1, axis] = nearest
    cells = volume.cells(boxes.mean(axis=1))
    for share in itertools.product((0.01, 0.99), repeat=3):
        at = boxes[:, 0] + np.array(share) * (boxes[:, 1] - boxes[:, 0])
        forms = volume.restrict(cells, at, at).apply(volume.net)[:, 0, 0, 0]
        error = np.abs(volume.net_kind.images(forms, at) - volume.evaluate(at))
        assert error.max() < 1e-13


def test_smooth_across_faces_and_junctions():
    """C2 for cubics: the two polynomials part with the third power of the distance."""
    for name in ("tspline", "weights", "cubic"):
        volume = KINDS[name]
        tree = volume.functions.tree
        inner = np.flatnonzero((tree.low > 0).all(axis=1))
        leaves = np.random.default_rng(4).choice(inner, 200)
        for axis in range(3):
            at = volume.origin + (tree.low[leaves] + 0.37 * tree.size[leaves, None]) * volume.unit
            at[:, axis] = volume.origin[axis] + tree.low[leaves, axis] * volume.unit[axis]
            before = at.copy()
            before[:, axis] -= 1e-6 * volume.unit[axis]
            sides = (volume.cells(at), volume.cells(before))
            found = []
            for distance in (0.0, 0.02, 0.04):
                moved = at.copy()
                moved[:, axis] += distance * volume.unit[axis]
                first, second = (
                    volume.net_kind.images(
                        volume.restrict(cells, moved, moved).apply(volume.net)[:, 0, 0, 0], moved
                    )
                    for cells in sides
                )
                found.append(np.abs(first - second).max(axis=1))
            assert found[0].max() < 1e-14
            parted = found[2] > 1e-9
            assert parted.any()
            assert (found[2][parted] / found[1][parted] > 7.0).all()


def test_value_slope_and_curvature_agree_at_every_corner():
    """Jumps between the polynomials of the cells round corners, T-junctions too, by order."""
    to_powers = np.array([[1, 3, 3, 1], [-6, -6, 6, 6], [12, -12, -12, 12], [-8, 24, -24, 8]]) / 8
    order = np.indices((4, 4, 4)).sum(axis=0)
    for name in ("tspline", "weights", "cubic"):
        volume = KINDS[name]
        tree = tree_with_junctions().tree
        units = tree.corners[np.all((tree.corners > 0) & (tree.corners < 16), axis=1)]
        touching = [
            np.all((tree.low <= c) & (c <= tree.high), axis=1) for c in units
        ]  # fmt: skip
        # A corner of some of the cells round it, on a side or an edge of the others.
        junction = np.array(
            [
                np.any((tree.low[t] < c) & (c < tree.high[t]))
                for t, c in zip(touching, units, strict=True)
            ]
        )
        assert junction.sum() > 20
        at = BOX[0] + units * (BOX[1] - BOX[0]) / 16
        reach = 0.5 * volume.unit
        taylor = []
        for way in itertools.product((-1, 1), repeat=3):
            cells = volume.cells(at + 0.1 * np.array(way) * volume.unit)
            forms = volume.restrict(cells, at - reach, at + reach).apply(volume.net)
            taylor.append(np.einsum("ai,bj,ck,mijkn->mabcn", *[to_powers] * 3, forms))
        jumps = np.ptp(np.stack(taylor), axis=0)
        largest = np.abs(taylor[0]).max(axis=(0, 1, 2, 3))
        for chosen in (junction, ~junction):
            assert (jumps[chosen][:, order <= 2] / largest).max() < 1e-14
            # Cubics are no smoother than that: the third derivatives jump.
            assert (jumps[chosen][:, order == 3] / largest).max() > 1e-5


def test_tspline_quotients_add_up_to_one_and_are_positive():
    volume = KINDS["tspline"]
    basis = volume.basis_matrix(places(300))
    total = np.asarray(basis.sum(axis=1)).ravel()
    assert total.min() > 0.3
    assert total.min() < 0.9
    assert total.max() > 1.1
    weighted = basis @ volume.rest_weights
    quotient = basis.multiply(1 / weighted[:, None]).multiply(volume.rest_weights[None])
    assert np.abs(np.asarray(quotient.sum(axis=1)).ravel() - 1).max() < 4e-15
    assert quotient.min() >= 0
    shift = np.array([0.1, -0.2, 0.3])
    moved = volume.with_control(volume.rest_points + shift, volume.rest_weights)
    points = places(50)
    assert np.abs(moved.evaluate(points) - points - shift).max() < 1e-15


def test_a_regular_tspline_is_the_unclamped_nurbs_quotient():
    volume = tspline_volume(regular_tree(3), BOX, (1.0, 1.0), FRAME)
    edited = shaken(volume)
    points = places(300)
    factors = []
    for axis in range(3):
        knots = (np.arange(13) - 2) * BOX[1, axis] / 8
        factors.append(
            np.stack(
                [
                    np.nan_to_num(
                        BSpline.basis_element(knots[i : i + 5], extrapolate=False)(points[:, axis])
                    )
                    for i in range(9)
                ],
                axis=-1,
            )
        )
    basis = np.einsum("mi,mj,mk->mijk", *factors).reshape(300, -1)
    order = np.lexsort(volume.rest_points.T[::-1])
    moves = (edited.net[:, :3] / edited.net[:, 3:])[order]
    total = basis.sum(axis=1)[:, None]
    wanted = points + (basis @ moves) / total
    assert np.abs(edited.evaluate(points) - wanted).max() < 1e-12
    # The paper's own map (Eq. 5), which the embedding by inversion solves.
    plain = edited.plain_map(edited.rest_points + edited.net[:, :3], edited.rest_weights)
    wanted = (basis @ (edited.rest_points + edited.net[:, :3])[order]) / total
    assert np.abs(plain.evaluate(points) - wanted).max() < 1e-12


def test_ray_knots_meet_the_three_rules():
    """Knots of every corner, by walking from face to face in exact integers, leaf by leaf."""
    model = tree_with_junctions()
    tree = model.tree
    volume = tspline_volume(model, BOX, (100.0, 1.0), FRAME)
    top = 1 << tree.depth
    for number in np.random.default_rng(5).choice(len(tree.corners), 120, replace=False):
        corner = tree.corners[number]
        for axis in range(3):
            others = [a for a in range(3) if a != axis]
            beside = np.all(
                (tree.low[:, others] <= corner[others]) & (corner[others] <= tree.high[:, others]),
                axis=1,
            )
            faces = np.unique(np.concatenate([tree.low[beside, axis], tree.high[beside, axis]]))
            ahead = faces[faces > corner[axis]][:2].tolist()
            behind = faces[faces < corner[axis]][::-1][:2].tolist()
            at = int(corner[axis])
            first = ahead[0] - at if ahead else at - behind[0]
            step = ahead[0] - at if ahead else first
            while len(ahead) < 2:
                ahead.append((ahead or [at])[-1] + step)
            back = at - behind[0] if behind else first
            while len(behind) < 2:
                behind.append((behind or [at])[-1] - back)
            wanted = [behind[1], behind[0], at, ahead[0], ahead[1]]
            assert volume.functions.knots[axis][number].tolist() == wanted
            # Rule 3: no interval is zero.
            assert (np.diff(wanted) > 0).all()
    # Rules 1 and 2: edges of a leaf add up to its side, and are edges of cells.
    present = {tuple(c) for c in tree.corners.tolist()}
    for leaf in range(0, len(tree.size), 7):
        low, size = tree.low[leaf], int(tree.size[leaf])
        for axis in range(3):
            line = [tuple(low + s * np.eye(3, dtype=int)[axis]) for s in range(size + 1)]
            on = [s for s, p in enumerate(line) if p in present]
            assert on[0] == 0
            assert on[-1] == size
            assert sum(np.diff(on)) == size
    assert top == 16


def test_weights_follow_the_full_cells():
    model = tree_with_junctions()
    volume = tspline_volume(model, BOX, (100.0, 1.0), FRAME)
    full = np.unique(model.tree.leaf_corners[model.full])
    assert np.array_equal(np.flatnonzero(~volume.hidden), full)
    assert np.array_equal(volume.rest_weights, np.where(volume.hidden, 1.0, 100.0))


def test_levels_are_active_where_their_support_meets_cells():
    tree = tree_with_junctions().tree
    degrees = (2, 1, 3)
    first, level = active_functions(tree, degrees)
    found = {(int(n), *f) for n, f in zip(level, first.tolist(), strict=True)}
    for n in range(tree.depth + 1):
        cells = {tuple(c) for c in (tree.low[tree.levels >= n] >> (tree.depth - n)).tolist()}
        spans = [range(-k, 1 << n) for k in degrees]
        for index in itertools.product(*spans):
            support = itertools.product(
                *(range(i, i + k + 1) for i, k in zip(index, degrees, strict=True))
            )
            assert ((n, *index) in found) == any(cell in cells for cell in support)


def test_each_level_is_complete_where_it_is_refined():
    model = tree_with_junctions()
    volume = hierarchical_volume(model.tree, BOX, (3, 3, 3), FRAME)
    leaf = np.flatnonzero(model.tree.levels == model.tree.depth)
    points = BOX[0] + (model.tree.low[leaf] + 0.3) * volume.unit
    basis = volume.basis_matrix(points)
    for level in range(model.tree.depth + 1):
        total = basis[:, np.flatnonzero(volume.levels == level)].sum(axis=1)
        assert np.abs(np.asarray(total).ravel() - 1).max() < 1e-14


def test_the_field_fades_out_beyond_the_box():
    volume = KINDS["cubic"]
    for axis in range(3):
        edge = np.tile(BOX.mean(axis=0), (3, 1))
        edge[:, axis] = volume.box[1, axis] - np.array([0.0, 1e-3, 2e-3]) * BOX[1, axis]
        gone = np.abs(volume.evaluate(edge) - edge).max(axis=1)
        assert gone[0] < 1e-15
        assert gone[2] < 1e-8


def test_plans_serve_the_same_functions_only():
    cubic = KINDS["cubic"]
    assert cubic.same_basis(cubic.with_net(np.zeros_like(cubic.net)))
    assert not cubic.same_basis(KINDS["mixed"])
    assert not KINDS["tspline"].same_basis(KINDS["weights"])


@pytest.mark.parametrize("kind", ["tspline", "weights", "cubic"])
def test_cells_that_nothing_moved_reaches_are_known(kind):
    """One control point is edited: cells are still where its support does not go, bit by bit."""
    volume = KINDS[kind]
    number = int(np.flatnonzero(volume.levels == 2)[20])
    points, weights = volume.rest_points.copy(), volume.rest_weights.copy()
    if kind == "weights":
        weights[number] *= 2
    else:
        points[number] += 0.01
    edited = volume.with_control(points, weights)
    at = places(2000)
    still = edited.is_identity(edited.cells(at))
    low, high = (ends[number] for ends in edited.supports())
    assert np.array_equal(still, ~np.all((at > low) & (at < high), axis=1))
    assert 0 < still.sum() < len(at)
    if kind != "weights":
        assert np.array_equal(edited.evaluate(at[still]), at[still])


def test_a_tspline_that_few_edits_move_is_proved_not_to_fold():
    """Weights 100:1 in cells at rest once hid that det J is 1 there."""
    model = tree_with_junctions()
    volume = tspline_volume(model, BOX, (100.0, 1.0), FRAME)
    rest = certify(volume, WholeBox(BOX), may_mirror=True)
    assert (rest.locally_injective, rest.bound) == ("yes", 1.0)
    assert is_monotone(volume, BOX, reaches_out=False)
    points = volume.rest_points.copy()
    number = int(np.argmax(~volume.hidden & (volume.levels == volume.levels.max())))
    points[number] += 0.1 * volume.unit
    moved = volume.with_control(points, volume.rest_weights)
    found = certify(moved, WholeBox(BOX), may_mirror=True)
    assert found.locally_injective == "yes"
    at = np.concatenate([places(2000), points[number] + 0.3 * places(300, 2) * volume.unit])
    at = np.clip(at, *BOX)
    assert found.bound <= np.linalg.det(moved.jacobian(at)).min() <= 1


def test_uneven_weights_cost_a_bound_of_the_determinant_nothing():
    """At rest W^4 det J is W^4, which varies within a cell; by quotients only rounding is left."""
    volume = tspline_volume(tree_with_junctions(), BOX, (100.0, 1.0), FRAME)
    cells = np.unique(volume.cells(places(300)), axis=0)
    forms = cell_determinants(volume, cells, (volume.net,))
    assert (forms.powers.max(axis=(0, 1, 2)) / forms.powers.min(axis=(0, 1, 2))).max() > 1e5
    bounds = forms.lower_bounds()
    assert (bounds <= 1).all()
    assert bounds.min() > 0.5
    halves, parents = forms.split()
    assert (halves.lower_bounds() <= 1).all()
    middle = (forms.low + forms.high) / 2
    found, doubt = forms.values(np.arange(len(cells)), middle)
    assert (np.abs(found - 1) <= doubt + 1e-9).all()
    assert len(parents) == 2 * len(cells)
