"""Fields in the space of a lattice are found, and the solver agrees with dense linear algebra."""

import itertools

import numpy as np
import pytest
from scipy.interpolate import BSpline

from ffdcli.lattice.fit.level_basis import level_basis
from ffdcli.lattice.fit.tensor_basis import tensor_basis
from support.fits import displacements, fitted, settle

AROUND = {"min": [0.1, 0.2, 0.3], "max": [0.4, 0.6, 0.5], "depth": 3}
LATTICES = {
    "cubic": {"points": [7, 6, 8]},
    "mixed": {"degree": [2, 3, 1], "points": [6, 7, 5]},
    "linear": {"degree": [1, 1, 1], "points": [4, 5, 3]},
    "unclamped": {"points": [7, 6, 5], "ends": "unclamped"},
    "creased": {
        "degree": [2, 2, 2],
        "points": [6, 6, 6],
        "knots": [[0.5, 0.5, 0.7], [0.2, 0.2, 0.3], [0.1, 0.5, 0.6]],
    },
    "even octree": {"volume": "hierarchical", "octree": {"depth": 2}},
    "octree": {"volume": "hierarchical", "octree": {"depth": 1, "also": [AROUND]}},
    "quadratic octree": {
        "volume": "hierarchical",
        "degree": [2, 2, 3],
        "octree": {"depth": 1, "also": [AROUND]},
    },
}


@pytest.mark.parametrize("name", LATTICES)
def test_a_field_of_the_lattice_is_found(name):
    rng = np.random.default_rng(7)
    rest = settle(LATTICES[name])
    member = rest.member
    moved = member.points + 0.05 * rng.standard_normal(member.points.shape)
    true = rest.with_member(0, member.with_points(moved, member.weights))
    places, others = rng.random((6000, 3)), rng.random((1000, 3))
    found = rest.fit(places, displacements(true, places), by=True)
    error = displacements(found, others) - displacements(true, others)
    assert np.abs(error).max() < 1e-10


def test_a_field_of_a_rational_lattice_is_found():
    rng = np.random.default_rng(8)
    weight = {"weight": {"at": [2, 2, ":"], "value": 3}}
    rest = settle({"volume": "nurbs", "points": [5, 6, 5], "edits": [weight]})
    member = rest.member
    moved = member.points + 0.05 * rng.standard_normal(member.points.shape)
    true = rest.with_member(0, member.with_points(moved, member.weights))
    places, others = rng.random((3000, 3)), rng.random((1000, 3))
    by = displacements(true, places) - displacements(rest, places)
    found = rest.fit(places, by, by=True)
    assert np.abs(displacements(found, others) - displacements(true, others)).max() < 1e-10


def test_a_field_by_scipys_splines_is_found():
    # The same knots, evaluated by scipy alone.
    rng = np.random.default_rng(9)
    knots = np.array([0, 0, 0, 0, 0.25, 0.5, 0.75, 1, 1, 1, 1])
    net = 0.1 * rng.standard_normal((7, 7, 7, 3))
    rows = [BSpline(knots, np.eye(7), 3) for _ in range(3)]

    def field(places):
        u, v, w = (row(places[:, axis]) for axis, row in enumerate(rows))
        return np.einsum("mi,mj,mk,ijkc->mc", u, v, w, net)

    places, others = rng.random((4000, 3)), rng.random((500, 3))
    for keys in ({"points": [7, 7, 7]}, {"volume": "hierarchical", "octree": {"depth": 2}}):
        found, report = fitted(keys, places, field(places))
        assert np.abs(displacements(found, others) - field(others)).max() < 1e-10
        assert report["within_tolerance"] == 1
        assert report["smooth"] == 0


def test_the_energy_of_a_cubic_field_is_its_integral():
    # u = x^2 y: its second derivatives are 2 y, and twice 2 x in the two mixed places.
    knots = np.array([0, 0, 0, 0, 0.5, 1, 1, 1, 1.0])
    square = np.array(
        [
            np.mean([a * b for a, b in itertools.combinations(knots[i + 1 : i + 4], 2)])
            for i in range(5)
        ]
    )
    line = np.array([knots[i + 1 : i + 4].mean() for i in range(5)])
    moves = np.einsum("i,j,k->ijk", square, line, np.ones(5)).ravel()
    wanted = 9 * (4 / 3 + 2 * 4 / 3)
    rest = settle({"points": [5, 5, 5]})
    places = np.random.default_rng(1).random((300, 3))
    basis = tensor_basis(rest.maps[0], rest.weights, places, np.arange(125))
    np.testing.assert_allclose(
        basis.at_pairs(moves[:, None])[:, 0], places[:, 0] ** 2 * places[:, 1]
    )
    assert moves @ basis.energy @ moves == pytest.approx(wanted)
    octree = settle(LATTICES["octree"])
    volume = octree.maps[0]
    local = volume.frame.to_local(places)
    levels = level_basis(volume, octree.member.layout.box, local, np.ones(volume.shape, bool))
    many = np.random.default_rng(2).random((4000, 3))
    rows = volume.basis_matrix(volume.frame.to_local(many))[:, levels.unknowns].toarray()
    moves = np.linalg.lstsq(rows, many[:, 0] ** 2 * many[:, 1])[0]
    assert moves @ levels.energy @ moves == pytest.approx(wanted)


@pytest.mark.parametrize("name", ["cubic", "creased", "octree", "quadratic octree"])
def test_a_given_smoothing_is_that_of_dense_algebra(name):
    rng = np.random.default_rng(3)
    rest = settle(LATTICES[name])
    volume, box = rest.maps[0], rest.member.layout.box
    places, moves = rng.random((400, 3)), rng.standard_normal((400, 3))
    weights, smooth = rng.random(400) + 0.1, 1e-5
    found = rest.fit(places, moves, by=True, weights=weights, smooth=smooth, robust=False)
    local = volume.frame.to_local(places)
    if "octree" in name:
        basis = level_basis(volume, box, local, np.ones(volume.shape, bool))
    else:
        basis = tensor_basis(volume, rest.weights, local, np.arange(rest.weights.size))
    rows = volume.basis_matrix(local)[:, basis.unknowns].toarray()
    shares = (weights / weights.sum())[:, None]
    matrix = rows.T @ (shares * rows) + smooth * basis.energy.toarray()
    dense = np.linalg.lstsq(matrix, rows.T @ (shares * moves), rcond=1e-15)[0]
    np.testing.assert_allclose(
        displacements(found, places), rows @ dense, atol=1e-9 * np.abs(rows @ dense).max()
    )
