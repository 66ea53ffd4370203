"""Rational volumes through the whole program: exact rational surfaces, positive weights."""

import numpy as np
import pytest

from ffdcli import deform, prepare
from ffdcli.errors import LatticeError
from ffdcli.verify.file import verify_file
from support.jobs import CUBE, turn

MOVES = """edits:
  - move: {at: [0, 0, 0], by: [0.1, 0.1, 0.05]}
  - move: {at: [2, 1, -1], by: [0.1, -0.1, 0.1]}
"""


def lattice_text(low, high, degree=(3, 3, 3), seed=0):
    """Random weights between two bounds on a 5 x 5 x 5 lattice."""
    weights = np.exp(np.random.default_rng(seed).uniform(np.log(low), np.log(high), (5, 5, 5)))
    head = f"degree: {list(degree)}\npoints: [5, 5, 5]\n"
    return head + MOVES + f"  - weights: {weights.tolist()}\n"


@pytest.fixture
def rational(job):
    """As ``job``, for a nurbs volume; the cube in general position by default."""

    def make(lattice, points=None):
        turned = CUBE @ turn([0.3, 0.5, 0.7]).T
        return job("volume: nurbs\n" + lattice, turned if points is None else points)

    return make


@pytest.mark.parametrize(
    ("low", "high", "patches", "name"),
    [
        (0.5, 3, "merged", "out.step"),
        (0.5, 3, "bezier", "out.step"),
        (0.5, 3, "merged", "out.iges"),
        (1, 100, "merged", "out.step"),
        (1, 100, "bezier", "out.iges"),
    ],
)
def test_rational_solids_verify(rational, tmp_path, low, high, patches, name):
    mesh, lattice = rational(lattice_text(low, high, (2, 3, 2)))
    result = deform(mesh, lattice, patches=patches).write(tmp_path / name)
    assert result.report["rational"]
    assert min(batch.poles[..., 3].min() for batch in result.brep.surfaces) > 0
    verdict = verify_file(tmp_path / name, mesh, lattice, tolerance=1e-9 * mesh.size)
    assert verdict.passed, verdict.reasons
    assert verdict.max_deviation < 1e-12 * mesh.size
    assert verdict.volume == pytest.approx(verdict.expected_volume, rel=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_patches_are_halved_until_all_weights_are_positive(rational, seed):
    """Weights 1:100 drive continued slabs below zero, although every lattice weight is positive."""
    angles = np.random.default_rng(seed).uniform(0, 6, 3)
    mesh, lattice = rational(lattice_text(1, 100, seed=seed), (CUBE - 0.5) @ turn(angles).T)
    brep = prepare(mesh, lattice).deform(lattice, check=False).brep
    least = 0.1 * lattice.volume.net[..., 3].min()
    assert min(batch.poles[..., 3].min() for batch in brep.surfaces) >= least
    assert min(batch.poles[..., 3].min() for batch in brep.curves if batch.degree > 1) >= least


def test_equal_weights_are_written_as_polynomials(rational):
    text = "degree: [3, 3, 3]\npoints: [5, 5, 5]\n" + MOVES
    mesh, heavy = rational(text + '  - weight: {at: [":", ":", ":"], value: 7}\n')
    _, plain = rational(text)
    for a, b in zip(
        deform(mesh, heavy).brep.surfaces, deform(mesh, plain).brep.surfaces, strict=True
    ):
        assert a.poles.shape[-1] == 3
        np.testing.assert_allclose(a.poles, b.poles, rtol=0, atol=1e-14)


def test_a_local_weight_leaves_far_patches_polynomial(rational):
    text = "degree: [2, 2, 2]\npoints: [8, 5, 5]\nedits:\n"
    text += "  - move: {at: [3, 2, -1], by: [0, 0, 0.1]}\n"
    mesh, lattice = rational(text + "  - weight: {at: [0, 0, 0], value: 5}\n", CUBE)
    result = deform(mesh, lattice, patches="bezier")
    sizes = {batch.poles.shape[-1] for batch in result.brep.surfaces}
    assert sizes == {3, 4}
    assert result.report["degrees"]["plane"] > 0


def test_a_plan_for_other_weights_is_refused(rational):
    angles = np.random.default_rng(4).uniform(0, 6, 3)
    points = (CUBE - 0.5) @ turn(angles).T
    mesh, plain = rational("degree: [3, 3, 3]\npoints: [5, 5, 5]\n" + MOVES, points)
    plan = prepare(mesh, plain)
    _, heavy = rational(lattice_text(1, 1000, seed=0), points)
    with pytest.raises(LatticeError, match="other weights"):
        plan.deform(heavy, check=False)
