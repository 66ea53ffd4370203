"""Drags from Python: what Hu et al. (2001) promise of them, and what else must hold."""

import importlib.util

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ffdcli.errors import LatticeError
from ffdcli.lattice import drag_steps
from ffdcli.lattice.drag.least_norm import factor
from ffdcli.volume.weights import rational_basis
from support.lattice_models import SMALLER, lattice_of, settled
from support.places import BENCHMARKS

SEEDS = st.integers(0, 2**32 - 1)
SIZE = 7.0  # diagonal of the box of test_lattice_settle: 3 x 2 x 6
WAVE = {"twist": {"axis": "w", "angle": 25}}
WEIGHTS = np.random.default_rng(8).uniform(0.5, 3, size=(6, 6, 6)).tolist()
LATTICES = {
    "bspline": settled(edits=[WAVE]),
    "nurbs": settled(volume="nurbs", edits=[WAVE, {"weights": WEIGHTS}]),
    "unclamped": settled(degree=[2, 3, 1], points=[5, 6, 4], ends="unclamped"),
    "far": settled(low=[1e5, 2e5, -3e5], high=[1e5 + 3, 2e5 + 2, 6 - 3e5], edits=[WAVE]),
    "turned": settled(
        volume="nurbs",
        box={
            "center": [1.5, 1, 3],
            "size": [9, 9, 9],
            "axes": Rotation.from_euler("zyx", [30, 40, 50], degrees=True).as_matrix().tolist(),
        },
        edits=[WAVE, {"weights": WEIGHTS}],
    ),
    "smaller": settled(**SMALLER, edits=[WAVE]),
}


def images(lattice, sources):
    frame = lattice.volume.frame
    local = frame.to_local(np.asarray(sources, dtype=float))
    return frame.to_model(lattice.volume.evaluate(local))


def sample(lattice, seed, count, spread=0.3):
    """Points of the object in the lattice box, and where to."""
    rng = np.random.default_rng(seed)
    low, high = lattice.volume.box
    # Away from locked layers, where little can move.
    local = low + rng.uniform([0, 0, 0.4], 1, size=(count, 3)) * (high - low)
    if not lattice.volume.frame.aligned:
        local = rng.uniform(-1, 1, size=(count, 3))
    sources = lattice.volume.frame.to_model(local)
    return sources, images(lattice, sources) + rng.normal(size=(count, 3)) * spread


def condition(lattice, sources):
    volume = lattice.volume
    rows = volume.basis_matrix(volume.frame.to_local(sources))
    rows = rational_basis(rows, lattice.weights.ravel())
    free = ~lattice.locked.ravel()
    return np.linalg.cond((rows.toarray() * free) @ (rows.toarray() * free).T)


@settings(max_examples=60)
@given(SEEDS, st.sampled_from(sorted(LATTICES)), st.integers(1, 12))
@example(36, "turned", 12)  # nearly dependent: control points move hundreds of times as far
@example(167, "turned", 12)
def test_every_source_is_at_its_target(seed, name, count):
    lattice = LATTICES[name]
    sources, targets = sample(lattice, seed, count)
    assume(condition(lattice, sources) < 1e8)
    moved = lattice.drag(sources, targets)
    size = SIZE if name != "far" else 4e5  # to the last digits that such coordinates have
    np.testing.assert_allclose(images(moved, sources), targets, rtol=0, atol=1e-12 * size)
    by = lattice.drag(sources, targets - images(lattice, sources), by=True)
    np.testing.assert_allclose(images(by, sources), targets, rtol=0, atol=1e-12 * size)


@settings(max_examples=30)
@given(SEEDS, st.sampled_from(["bspline", "nurbs", "smaller"]))
def test_displacement_drags_commute_associate_and_invert(seed, name):
    lattice = LATTICES[name]
    sources, _ = sample(lattice, seed, 3)
    one, two, three = np.random.default_rng(seed).normal(size=(3, 3, 3))

    def after(*drags):
        found = lattice
        for points, by in drags:
            found = found.drag(points, by, by=True)
        return found.points

    a, b = (sources[:1], one[:1]), (sources[1:2], two[:1])
    tight = {"rtol": 0, "atol": 1e-12 * max(SIZE, np.abs(after(a, b)).max())}
    np.testing.assert_allclose(after(a, b), after(b, a), **tight)
    # At one point, displacements add up, so how they are bracketed is all the same.
    both, rest = (sources[:1], one[:1] + two[:1]), (sources[:1], two[:1] + three[:1])
    c = (sources[:1], three[:1])
    np.testing.assert_allclose(after(both, c), after(a, rest), **tight)
    np.testing.assert_allclose(after(a, (sources[:1], -one[:1])), lattice.points, **tight)
    np.testing.assert_allclose(after((sources[:1], 0 * one[:1])), lattice.points, **tight)


def test_target_drags_at_different_points_do_not_commute():
    lattice = settled()
    a, b = ([[1, 1, 3]], [[1.5, 1, 3]]), ([[1.2, 1, 3]], [[1.2, 1.5, 3]])
    one, other = lattice.drag(*a).drag(*b), lattice.drag(*b).drag(*a)
    assert np.abs(one.points - other.points).max() > 0.05
    np.testing.assert_allclose(images(one, b[0]), b[1], atol=1e-12)
    assert np.abs(images(one, a[0]) - a[1]).max() > 0.05


@settings(max_examples=40)
@given(SEEDS, st.sampled_from(["bspline", "nurbs", "smaller"]), st.integers(2, 8))
def test_many_points_at_once_are_their_steps_in_any_order(seed, name, count):
    lattice = LATTICES[name]
    sources, targets = sample(lattice, seed, count)
    assume(condition(lattice, sources) <= 1e6)
    together = lattice.drag(sources, targets)
    volume = lattice.volume
    rows = volume.basis_matrix(volume.frame.to_local(sources))
    rows = rational_basis(rows, lattice.weights.ravel())
    rows.data = rows.data * ~lattice.locked.ravel()[rows.indices]
    multipliers = factor(rows).multipliers(targets - images(lattice, sources))
    steps = multipliers * (rows**2).sum(axis=1)[:, None]
    for order in (np.arange(count), np.random.default_rng(seed).permutation(count)):
        apart = lattice
        for q in order:
            apart = apart.drag(sources[q], steps[q], by=True)
        np.testing.assert_allclose(apart.points, together.points, rtol=0, atol=1e-10 * SIZE)
        np.testing.assert_allclose(images(apart, sources), targets, rtol=0, atol=1e-10 * SIZE)


@given(SEEDS)
def test_control_points_whose_basis_vanishes_at_every_source_stay(seed):
    lattice = settled(points=[9, 9, 12], edits=[WAVE])
    sources, targets = sample(lattice, seed, 2)
    moved = lattice.drag(sources, targets)
    changed = np.any(moved.points != lattice.points, axis=-1)
    reaching = lattice.volume.basis_matrix(sources).toarray().any(axis=0)
    assert not changed.ravel()[~reaching].any()
    assert changed.any()


@settings(max_examples=20)
@given(SEEDS)
def test_locked_and_pinned_points_stay(seed):
    lattice = LATTICES["smaller"]
    sources, targets = sample(lattice, seed, 3)
    mask = np.zeros((6, 6, 6), dtype=bool)
    mask[0] = mask[:, 2, 3] = True
    selectors = [[0, ":", ":"], [":", 2, 3]]
    moved = lattice.drag(sources, targets, pin=mask)
    assert np.array_equal(moved.points, lattice.drag(sources, targets, pin=selectors).points)
    still = mask | lattice.locked
    assert np.array_equal(moved.points[still], lattice.points[still])
    np.testing.assert_allclose(images(moved, sources), targets, atol=1e-11)


def test_lattices_are_immutable():
    lattice = settled()
    before = lattice.points.copy()
    assert lattice.drag([(1, 1, 3)], [(1, 1, 4)]) is not lattice
    assert np.array_equal(lattice.points, before)


def test_finer_lattices_keep_the_deformation_nearer_the_sources():
    """Four pulls at the ends of a long body, as in Hu et al., Fig. 5."""
    low, high = np.array([0.0, 0, 0]), np.array([1.0, 4, 1])
    sources = np.array([[0.2, 0.2, 0.5], [0.8, 0.2, 0.5], [0.2, 3.8, 0.5], [0.8, 3.8, 0.5]])
    targets = sources + [[-0.2, -0.3, 0], [0.2, -0.3, 0], [-0.2, 0.3, 0], [0.2, 0.3, 0]]
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, (9, 65, 9), strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    far = np.linalg.norm(points[:, None] - sources, axis=2).min(axis=1)
    middle, distant, mean_distance = [], [], []
    for count in (4, 7, 10):
        lattice = settled(low=low, high=high, points=[4, count, 4]).drag(sources, targets)
        np.testing.assert_allclose(images(lattice, sources), targets, atol=1e-13)
        moved = np.linalg.norm(images(lattice, points) - points, axis=1)
        middle.append(moved[np.abs(points[:, 1] - 2) < 1].max())
        distant.append(moved[far > 1].max())
        mean_distance.append((moved * far).sum() / moved.sum())
    # Measured: 0.23, 0.12, 0.04 half way; 0.21, 0.09, 0.02 far off; 0.68, 0.52, 0.42 on the mean.
    assert middle[0] > 1.9 * middle[1] > 1.9 * 2.5 * middle[2]
    assert distant[0] > 2 * distant[1] > 2 * 3 * distant[2]
    assert mean_distance[0] > 1.2 * mean_distance[1] > 1.2 * 1.2 * mean_distance[2]


CONFLICTS = {
    "outside": ([(1, 1, 9)], [(1, 1, 8)], {}, r"sources\[0\] by 1 .*outside the lattice box"),
    "one of two outside": (
        [(1, 1, 3), (9, 1, 3)],
        [(1, 1, 3.5), (9, 2, 3)],
        {},
        r"targets: sources\[1\] by 1 \(it lies outside",
    ),
    "pinned": (
        [(0, 0, 0)],
        [(0, 0, 1)],
        {"pin": [[0, 0, 0]]},
        r"sources\[0\] by 1 \(no control point",
    ),
    "held": (
        [(1, 1, 1), (1, 1, 5)],
        [(1, 1, 2), (1, 1, 5.5)],
        {"hold": [{"inside": {"min": [0, 0, 0], "max": [3, 2, 2]}}]},
        r"sources\[0\] by 1 \(no control point",
    ),
    "twice": (
        [(1, 1, 3), (2, 1, 3), (1, 1, 3)],
        [(1, 1, 4), (2, 1, 3), (1, 1, 6)],
        {},
        r"sources\[[02]\] by 1 \(it depends.*sources\[[02]\] by 1 \(it depends",
    ),
    "point held": (
        [(1, 1, 3)],
        [(1, 1, 4)],
        {"hold": [{"point": [1, 1, 3]}]},
        r"hold\[0\] by 0.5",
    ),
}


@pytest.mark.parametrize("name", CONFLICTS)
def test_conflicts_name_each_constraint_and_its_residual(name):
    sources, targets, keys, words = CONFLICTS[name]
    with pytest.raises(LatticeError, match=words):
        settled().drag(sources, targets, **keys)
    nearest = settled().drag(sources, targets, on_conflict="least_squares", **keys)
    (warning,) = nearest.warnings
    assert "targets are missed" in warning


def test_more_constraints_than_freedom():
    rng = np.random.default_rng(1)
    sources = rng.uniform([0, 0, 0], [3, 2, 6], size=(100, 3))
    targets = sources + rng.normal(size=(100, 3))
    lattice = settled(degree=[1, 1, 1], points=[2, 2, 3])
    with pytest.raises(LatticeError, match=r"cannot meet all targets: .*, and 92 more"):
        lattice.drag(sources, targets)
    nearest = lattice.drag(sources, targets, on_conflict="least_squares")
    dense = lattice.volume.basis_matrix(sources).toarray()
    best = np.linalg.lstsq(dense, targets, rcond=None)[0]
    np.testing.assert_allclose(images(nearest, sources), dense @ best, atol=1e-11)


def test_nothing_left_free_is_said():
    hold = [{"inside": {"min": [0, 0, 0], "max": [3, 2, 4]}}]
    with pytest.raises(LatticeError, match=r"leave no control point free.*too coarse"):
        settled(points=[4, 4, 4]).drag([(1, 1, 5)], [(1, 1, 6)], hold=hold)


def test_unreachable_points_that_stay_are_no_conflict():
    hold = [{"inside": {"min": [0, 0, 0], "max": [3, 2, 2]}}, {"point": [1, 1, 1]}]
    moved = settled(points=[4, 4, 9]).drag(
        [(1, 1, 5), (9, 9, 9)], [(1, 1, 5.5), (9, 9, 9)], hold=hold
    )
    np.testing.assert_allclose(images(moved, [(1, 1, 1), (1, 1, 5)]), [(1, 1, 1), (1, 1, 5.5)])


@pytest.mark.parametrize(
    ("arguments", "keys", "words"),
    [
        (([(1, 1)], [(1, 1, 1)]), {}, "as many targets"),
        (([(1, 1, 1)], [(1, 1, 1), (1, 1, 2)]), {}, "as many targets"),
        (([], []), {}, "as many targets"),
        (([(1, 1, np.nan)], [(1, 1, 1)]), {}, "finite"),
        (([("a", 1, 1)], [(1, 1, 1)]), {}, "finite numbers"),
        (
            ([(1, 1, 1)], [(1, 1, 2)]),
            {"vary": "knots"},
            "vary: must be points or weights, not `knots`",
        ),
        (([(1, 1, 1)], [(1, 1, 2)]), {"vary": "weights"}, "no weights.*nurbs"),
        (([(1, 1, 1)], [(1, 1, 2)]), {"level_cost": 2}, "level_cost: a bspline volume has no"),
        (([(1, 1, 1)], [(1, 1, 2)]), {"pin": np.ones((2, 2, 2), dtype=bool)}, "booleans"),
        (([(1, 1, 1)], [(1, 1, 2)]), {"pin": [[7, 0, 0]]}, r"pin\[0\].*out of range"),
        (([(1, 1, 1)], [(1, 1, 2)]), {"pin": ["all"]}, r"pin\[0\].*three entries"),
        (([(1, 1, 1)], [(1, 1, 2)]), {"hold": [{"group": "rim"}]}, r"hold\[0\].*not available"),
        (([(1, 1, 1)], [(1, 1, 2)]), {"hold": [{"sphere": 3}]}, r"hold\[0\].*point"),
        (([(1, 1, 1)], [(1, 1, 1e308)]), {}, "too large"),
    ],
)
def test_wrong_arguments_are_refused(arguments, keys, words):
    with pytest.raises(LatticeError, match=words):
        settled(edits=[]).drag(*arguments, **keys)


def test_unsettled_lattices_are_refused():
    with pytest.raises(LatticeError, match="needs a mesh"):
        lattice_of().drag([(1, 1, 1)], [(1, 1, 2)])


def test_steps_belong_to_the_files_drags():
    edit = {"pairs": [{"from": [1, 1, 3], "by": [0, 0, 1]}, {"from": [2, 1, 3], "to": [2, 1, 4]}]}
    lattice = settled(edits=[WAVE, {"drag": edit}])
    steps = drag_steps(lattice)
    assert [step.edit for step in steps] == [1, 1]
    np.testing.assert_allclose(steps[1].target, [2, 1, 4], atol=1e-13)


def test_speed_against_the_dense_pseudo_inverse(capsys):
    file = BENCHMARKS / "drag.py"
    spec = importlib.util.spec_from_file_location("drag_benchmark", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found = module.compare(constraints=100, per_axis=22)
    with capsys.disabled():
        print(f"\n  drag {1e3 * found['drag']:.2f} ms, {found['ratio']:.0f} times the dense way")
    assert found["difference"] < 1e-12
