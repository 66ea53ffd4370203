"""Drags on octrees that vary weights, or in which pieces move as one."""

import numpy as np
import pytest
from scipy.optimize import minimize

from ffdcli import read_lattice
from ffdcli.errors import LatticeError
from support.jobs import ellipsoid

SPLINE = "volume: tspline\noctree: {depth: 2, weights: [10, 1]}\n"
LEVELS = (
    "volume: hierarchical\noctree: {depth: 3, "
    "also: [{min: [4, -8, -6], max: [12, 8, 6], depth: 4}, "
    "{min: [-12, -4, -4], max: [-5, 4, 4], depth: 4}]}\n"
)


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    return ellipsoid(tmp_path_factory.mktemp("mesh"), 2)


def lattice_of(tmp_path, text, mesh):
    path = tmp_path / "l.yaml"
    path.write_text("version: 1\n" + text)
    return read_lattice(path, mesh)


PEAK = "  - move: {at: {near: [9, 0, 0]}, by: [4, 0, 1]}\n"


def test_weights_take_a_point_to_its_target_with_the_least_change(tmp_path, mesh):
    bumped = lattice_of(tmp_path, SPLINE + "edits:\n" + PEAK, mesh)
    volume = bumped.volume
    source = mesh.vertices[np.argmax(mesh.vertices[:, 0])]
    basis = volume.basis_matrix(source[None]).toarray()[0]
    # A target that heavier weights of the moved point reach: towards where it is pulled.
    wanted = bumped.weights.copy()
    near = int(np.argmax(np.linalg.norm(bumped.points - volume.rest_points, axis=1)))
    wanted[near] *= 1.5
    target = bumped.member.with_control(bumped.points, wanted).volume.evaluate(source[None])[0]
    dragged = bumped.drag([source], [target], vary="weights")
    image = dragged.volume.evaluate(source[None])[0]
    assert np.abs(image - target).max() < 1e-12 * mesh.size
    assert np.array_equal(dragged.points, bumped.points)
    assert (dragged.weights >= 0.01 * bumped.weights).all()
    hidden = volume.hidden
    assert np.array_equal(dragged.weights[hidden], bumped.weights[hidden])
    # Lagrange: among the free ones the change is a mix of the three constraints, unless at a bound.
    free = (basis > 0) & ~hidden
    quotient = (basis * bumped.weights) @ bumped.points / (basis @ bumped.weights)
    aim = target - bumped.volume.evaluate(source[None])[0] + quotient
    rows = (basis[:, None] * (bumped.points - aim))[free]
    change = (dragged.weights - bumped.weights)[free]
    assert np.abs(rows.T @ dragged.weights[free] + (
        (basis[:, None] * (bumped.points - aim))[~free].T @ bumped.weights[~free]
    )).max() < 1e-10  # fmt: skip
    found = minimize(
        lambda x: 0.5 * x @ x,
        np.zeros(free.sum()),
        jac=lambda x: x,
        method="SLSQP",
        bounds=[(-0.99 * w, None) for w in bumped.weights[free]],
        constraints={"type": "eq", "fun": lambda x: rows.T @ (x - change), "jac": lambda x: rows.T},
        options={"ftol": 1e-15, "maxiter": 500},
    )
    assert found.success
    assert np.linalg.norm(change) <= np.linalg.norm(found.x) * (1 + 1e-5)
    assert np.abs(change - found.x).max() < 1e-3 * np.abs(change).max()


def test_weights_by_file_and_what_they_cannot_reach(tmp_path, mesh):
    pair = "{from: [9.5, 0.5, 0.2], by: [%s, 0, 0]}"
    drag = SPLINE + "edits:\n" + PEAK + "  - drag: {pairs: [" + pair + "], vary: weights%s}\n"
    at = np.array([[9.5, 0.5, 0.2]])
    before = lattice_of(tmp_path, SPLINE + "edits:\n" + PEAK, mesh)
    held = ", hold: [{inside: {min: [-12, -8, -6], max: [-6, 8, 6]}}]"
    after = lattice_of(tmp_path, drag % ("0.01", held), mesh)
    moved = after.volume.evaluate(at) - before.volume.evaluate(at)
    assert np.abs(moved - [0.01, 0, 0]).max() < 1e-12 * mesh.size
    far = mesh.vertices[mesh.vertices[:, 0] < -6]
    drift = after.volume.evaluate(far) - before.volume.evaluate(far)
    assert np.abs(drift).max() < 1e-14 * mesh.size
    with pytest.raises(LatticeError, match="outside the hull of the control points that reach it"):
        lattice_of(tmp_path, drag % ("90", ""), mesh)


def is_rigid(before, after):
    """Whether places are turned and shifted only."""
    arms = [points - points.mean(axis=0) for points in (before, after)]
    left, _, right = np.linalg.svd(arms[0].T @ arms[1])
    turn = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    return turn, np.abs(arms[0] @ turn - arms[1]).max()


@pytest.mark.parametrize("edited", [False, True])
def test_a_piece_moves_as_one_through_all_levels(tmp_path, mesh, edited):
    """Two points of it go where only a turn takes them; what is edited already turns along."""
    hold = "hold: [{inside: {min: [6, -3, -3], max: [9, 3, 3]}, rigid: true}]"
    pairs = "{from: [7, 0, 2], by: [1, 0, 0]}, {from: [7, 0, -2], by: [-1, 0, 0.5]}"
    bump = "  - move: {at: {near: [7.5, 0, 0], level: 3}, by: [0.2, 0.5, 0]}\n"
    edits = "edits:\n" + bump * edited
    drag = f"  - drag: {{pairs: [{pairs}], {hold}, on_conflict: least_squares}}\n"
    before = lattice_of(tmp_path, LEVELS + edits, mesh).volume
    lattice = lattice_of(tmp_path, LEVELS + edits + drag, mesh)
    random = np.random.default_rng(0)
    inside = random.uniform([6, -3, -3], [9, 3, 3], (200, 3))
    first, second = before.evaluate(inside), lattice.volume.evaluate(inside)
    turn, off = is_rigid(first, second)
    assert off < 1e-12 * mesh.size
    assert np.abs(turn - np.eye(3)).max() > 0.2
    # The bump was no rigid motion of the piece by itself.
    assert (is_rigid(inside, first)[1] > 0.01) == edited
    # Far off, functions of the finest levels have nothing to do.
    far = np.array([[-9.0, 0, 0], [-8, 2, 1]])
    assert np.abs(lattice.volume.evaluate(far) - before.evaluate(far)).max() < 1e-12


def test_rigid_pieces_meet_targets_and_stay_apart(tmp_path, mesh):
    """Two pieces share coarse functions, which stay: they need not move together."""
    hold = (
        "hold: [{inside: {min: [7, -1, -1], max: [9, 1, 1]}, rigid: true}, "
        "{inside: {min: [-8, -1, -1], max: [-7, 1, 1]}, rigid: true}, "
        "{inside: {min: [-1, -1, -4], max: [1, 1, -3]}}]"
    )
    pairs = "{from: [8, 0, 0], by: [0, 0, 1]}, {from: [-7.5, 0, 0], by: [0, 0.5, 0]}"
    lattice = lattice_of(
        tmp_path, LEVELS + f"edits: [{{drag: {{pairs: [{pairs}], {hold}}}}}]", mesh
    )
    assert not lattice.warnings
    images = lattice.volume.evaluate(np.array([[8.0, 0, 0], [-7.5, 0, 0], [0.5, 0.5, -3.5]]))
    wanted = [[8, 0, 1], [-7.5, 0.5, 0], [0.5, 0.5, -3.5]]
    assert np.abs(images - wanted).max() < 1e-12 * mesh.size
    level = lattice.volume.levels
    moved = np.any(lattice.points != lattice.volume.rest_points, axis=1)
    assert not moved[level == 0].any()
    # By Python the same.
    again = lattice_of(tmp_path, LEVELS, mesh).drag(
        [[8, 0, 0], [-7.5, 0, 0]],
        [[0, 0, 1], [0, 0.5, 0]],
        by=True,
        hold=[
            {"inside": {"min": [7, -1, -1], "max": [9, 1, 1]}, "rigid": True},
            {"inside": {"min": [-8, -1, -1], "max": [-7, 1, 1]}, "rigid": True},
            {"inside": {"min": [-1, -1, -4], "max": [1, 1, -3]}},
        ],
    )
    assert np.array_equal(again.points, lattice.points)


def test_rigid_pieces_that_cannot_be(tmp_path, mesh):
    drag = "edits: [{drag: {pairs: [{from: [7, 0, 0], by: [0, 0, 1]}], hold: [%s]}}]"
    out = "{inside: {min: [7, -1, -1], max: [30, 1, 1]}, rigid: true}"
    with pytest.raises(LatticeError, match="extends beyond the lattice box"):
        lattice_of(tmp_path, LEVELS + drag % out, mesh)
    near = "{inside: {min: [6, -1, -1], max: [9, 1, 1]}, rigid: true}"
    fixed = near + ", {inside: {min: [6, 1, 1], max: [9, 2, 2]}}"
    with pytest.raises(LatticeError, match="belong to a part that is held fixed"):
        lattice_of(tmp_path, LEVELS + drag % fixed, mesh)
    at_rest = lattice_of(tmp_path, SPLINE, mesh)
    hold = [{"inside": {"min": [6, -1, -1], "max": [9, 1, 1]}, "rigid": True}]
    with pytest.raises(LatticeError, match="cannot rotate a part rigidly"):
        at_rest.drag([[7, 0, 0]], [[0, 0, 1]], by=True, hold=hold)
    with pytest.raises(LatticeError, match="all levels must cost the same"):
        lattice_of(tmp_path, LEVELS, mesh).drag(
            [[7, 0, 0]], [[0, 0, 1]], by=True, hold=hold, level_cost=2
        )
    with pytest.raises(LatticeError, match="a hierarchical volume has no weights"):
        lattice_of(tmp_path, LEVELS, mesh).drag([[7, 0, 0]], [[7, 0, 1]], vary="weights")
