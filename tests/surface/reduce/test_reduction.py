"""Reduction against densely sampled errors; the oracle is scipy's own B-spline evaluation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from ffdcli.surface.reduce.reduction import TensorSplines, reduce_patches

SHARES = np.linspace(0, 1, 41)


def evaluate(patches, row, u, v):
    """Points (len(u), len(v), 3) of one patch, homogeneous ones divided."""
    poles = patches.poles[row]
    for axis, at in ((0, u), (1, v)):
        degree = patches.degrees[axis]
        knots = np.repeat(patches.knots[axis][row], patches.mults[axis])
        if degree == 0:
            continue
        along = BSpline(knots, np.moveaxis(poles, axis, 0), degree)(at)
        poles = np.moveaxis(along, 0, axis)
    return poles[..., :3] / poles[..., 3:] if poles.shape[-1] == 4 else poles


def sampled_error(exact, row, reduced, place):
    """Largest distance seen, with samples crowded in every span of both."""
    sites = []
    for axis in range(2):
        both = np.union1d(exact.knots[axis][row], reduced.knots[axis][place])
        sites.append(np.unique(both[:-1, None] + np.diff(both)[:, None] * SHARES))
    gap = evaluate(exact, row, *sites) - evaluate(reduced, place, *sites)
    return np.linalg.norm(gap, axis=-1).max()


def random_patches(rng, count, degrees, spans, smooth, rational):
    """Patches over rectangles of any place and size, knots of multiplicity 1 or 2."""
    knots, mults = [], []
    for degree, inner in zip(degrees, spans, strict=True):
        breaks = np.sort(rng.uniform(0.1, 0.9, (count, inner)) * 0.05 + np.arange(inner), axis=1)
        breaks = np.column_stack([np.full(count, -0.3), breaks, np.full(count, inner + 0.2)])
        knots.append(3 + rng.uniform(0.2, 2) * breaks)
        inner_mult = np.full(inner, min(2, degree - 1), dtype=int)
        mults.append(np.concatenate([[degree + 1], inner_mult, [degree + 1]]))
    shape = [int(m.sum()) - d - 1 for m, d in zip(mults, degrees, strict=True)]
    poles = rng.normal(size=(count, *shape, 3)) * smooth
    # A gentle patch under the noise: what reduction is for.
    grid = np.stack(np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij"), axis=-1)
    poles[..., :2] += grid
    poles[..., 2] += 0.3 * np.sin(2 * grid[..., 0]) * grid[..., 1]
    if rational:
        weights = rng.uniform(0.6, 1.7, (count, *shape, 1)) ** smooth**0.5
        poles = np.concatenate([poles * weights, weights], axis=-1)
    return TensorSplines(degrees, (knots[0], knots[1]), (mults[0], mults[1]), poles)


def assert_certified(patches, found, tolerance, max_degree=None):
    """Bounds hold, every patch is there once; the ratios of bound to sampled error."""
    rows = np.sort(np.concatenate([part.rows for part in found]))
    assert np.array_equal(rows, np.arange(len(patches.poles)))
    ratios = []
    for part in found:
        assert (part.bounds <= tolerance).all()
        assert max_degree is None or max(part.patches.degrees) <= max_degree
        for place, row in enumerate(part.rows):
            error = sampled_error(patches, row, part.patches, place)
            assert error <= part.bounds[place]
            if part.bounds[place] == 0:
                assert np.array_equal(part.patches.poles[place], patches.poles[row])
            elif part.bounds[place] > 1e-12:
                ratios.append(part.bounds[place] / error)
    return ratios


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32 - 1),
    degrees=st.tuples(st.integers(2, 6), st.integers(2, 6)),
    spans=st.tuples(st.integers(0, 2), st.integers(0, 2)),
    smooth=st.sampled_from([1e-6, 1e-3, 0.1]),
    tolerance=st.sampled_from([1e-7, 1e-4, 1e-2]),
    rational=st.booleans(),
)
def test_bounds_hold(seed, degrees, spans, smooth, tolerance, rational):
    rng = np.random.default_rng(seed)
    patches = random_patches(rng, 4, degrees, spans, smooth, rational)
    found = reduce_patches(patches, np.full(4, tolerance))
    assert_certified(patches, found, tolerance)
    before = patches.poles[..., 0].size
    assert sum(part.patches.poles[..., 0].size for part in found) <= before


@settings(max_examples=10)
@given(
    seed=st.integers(0, 2**32 - 1),
    degrees=st.tuples(st.integers(2, 7), st.integers(2, 7)),
    spans=st.tuples(st.integers(0, 2), st.integers(0, 1)),
    cap=st.integers(3, 5),
    rational=st.booleans(),
)
def test_bounds_hold_under_a_cap(seed, degrees, spans, cap, rational):
    rng = np.random.default_rng(seed)
    patches = random_patches(rng, 2, degrees, spans, 0.01, rational)
    found = reduce_patches(patches, np.full(2, 1e-3), max_degree=cap)
    assert_certified(patches, found, 1e-3, cap)
    for part in found:
        for degree, mults in zip(part.patches.degrees, part.patches.mults, strict=True):
            assert (mults[1:-1] < degree).all()  # C1 at least


@pytest.mark.parametrize("rational", [False, True])
def test_bounds_are_tight(rational):
    rng = np.random.default_rng(6)
    ratios = []
    for degrees in ((6, 6), (3, 6), (4, 4)):
        for spans in ((0, 0), (1, 0)):
            patches = random_patches(rng, 12, degrees, spans, 1e-3, rational)
            found = reduce_patches(patches, np.full(12, 2e-3))
            ratios += assert_certified(patches, found, 2e-3)
    assert len(ratios) > 40
    assert np.median(ratios) < 2


def test_what_is_of_lower_degree_is_found_out():
    """A bilinear patch written with degree 6 x 5 needs 2 x 2 control points again."""
    corner = np.array([[[0, 0, 0], [0, 1, 0.2]], [[1, 0, 0.1], [1.5, 1, 0.7]]])
    u, v = (np.linspace(0, 1, n)[:, None] for n in (7, 6))
    poles = np.einsum("ui,vj,ijd->uvd", np.hstack([1 - u, u]), np.hstack([1 - v, v]), corner)
    ends = np.array([[0.0, 2.0]])
    patches = TensorSplines((6, 5), (ends, ends), (np.array([7, 7]), np.array([6, 6])), poles[None])
    (found,) = reduce_patches(patches, np.array([1e-9]))
    assert found.patches.degrees == (1, 1)
    assert np.abs(found.patches.poles[0] - corner).max() < 1e-14
    assert 0 < found.bounds[0] < 1e-12


def test_needless_knots_go_and_needed_ones_stay():
    """Of seven knots, the function has a break at one: that one is kept, where it was."""
    breaks = np.linspace(0, 8, 9)
    mults = np.array([5, *[3] * 7, 5])
    flat = np.repeat(breaks, mults)
    sites = np.array([flat[i + 1 : i + 5].mean() for i in range(int(mults.sum()) - 5)])
    at = np.linspace(0, 8, 400)
    basis = BSpline.design_matrix(at, flat, 4).toarray()
    wanted = np.stack([at, 0 * at, 0.1 * np.maximum(at - 5, 0) ** 2], axis=1)
    poles = np.linalg.lstsq(basis, wanted, rcond=None)[0]
    assert np.abs(poles[:, 0] - sites).max() < 1e-9
    point = (np.array([[0.0, 1.0]]), np.array([1, 1]))
    curve = TensorSplines((4, 0), (breaks[None], point[0]), (mults, point[1]), poles[None, :, None])
    (found,) = reduce_patches(curve, np.array([1e-8]), keep_ends=True)
    assert found.patches.degrees[0] == 2
    assert np.array_equal(found.patches.knots[0], [[0, 5, 8]])
    assert sampled_error(curve, 0, found.patches, 0) <= found.bounds[0] <= 1e-8


def test_curves_keep_their_ends():
    rng = np.random.default_rng(3)
    patches = random_patches(rng, 6, (9, 2), (1, 0), 0.02, False)
    curves = TensorSplines(
        (9, 0),
        (patches.knots[0], np.tile([0.0, 1.0], (6, 1))),
        (patches.mults[0], np.array([1, 1])),
        patches.poles[:, :, :1],
    )
    found = reduce_patches(curves, np.full(6, 0.01), keep_ends=True, step=1e-4)
    assert_certified(curves, found, 0.01)
    assert any(part.bounds.all() for part in found)
    for part in found:
        for side in (0, -1):
            ends = part.patches.poles[:, side]
            assert np.array_equal(ends, curves.poles[part.rows, side])


def test_new_control_points_are_multiples_of_the_step():
    rng = np.random.default_rng(4)
    patches = random_patches(rng, 8, (6, 6), (0, 0), 1e-3, False)
    found = reduce_patches(patches, np.full(8, 1e-2), step=1e-4)
    assert_certified(patches, found, 1e-2)
    for part in found:
        steps = part.patches.poles / 1e-4
        assert np.abs(steps - np.round(steps)).max() < 1e-8


def test_a_tolerance_out_of_reach_is_told_by_the_bound():
    rng = np.random.default_rng(5)
    patches = random_patches(rng, 1, (7, 2), (0, 0), 1.0, False)
    (found,) = reduce_patches(patches, np.array([1e-13]), max_degree=3)
    assert found.patches.degrees[0] == 3
    assert found.bounds[0] > 1e-13
    assert sampled_error(patches, 0, found.patches, 0) <= found.bounds[0]
