"""Hulls of derivatives hold every derivative that is found by direct evaluation."""

import numpy as np
import pytest

from ffdcli.folds.determinant import find_cells
from ffdcli.folds.domain import WholeBox
from ffdcli.folds.hulls import settle
from ffdcli.volume.slope_hulls import count_products, slope_hulls
from support.injective_models import shaken
from support.volume_trees import all_kinds, places

KINDS = all_kinds()
EFFORT = 20_000_000_000


def hull_of(volume, sharp):
    """Cells, boxes, and the hulls of all of them in one."""
    cells = np.unique(volume.cells(places(60)), axis=0)
    boxes = volume.cell_bounds(cells)
    hulls = list(slope_hulls(volume, cells, boxes, sharp=sharp))
    centres = np.concatenate([hull.centres for hull in hulls])
    radii = np.concatenate([hull.radii for hull in hulls])
    least = np.concatenate([hull.least_determinant(1) for hull in hulls])
    return cells, boxes, centres, radii, least


@pytest.mark.parametrize("sharp", [False, True])
@pytest.mark.parametrize("kind", list(KINDS))
def test_hulls_hold_sampled_derivatives(kind, sharp):
    volume = KINDS[kind]
    cells, boxes, centres, radii, least = hull_of(volume, sharp)
    random = np.random.default_rng(8)
    for _ in range(20):
        share = random.random((len(cells), 3))
        slopes = volume.jacobian(boxes[:, 0] + share * (boxes[:, 1] - boxes[:, 0]))
        assert (np.linalg.norm(slopes - centres, axis=1) <= radii + 1e-12).all()
        assert (np.linalg.det(slopes) >= least).all()


def test_one_quotient_is_sharper_than_two():
    volume = KINDS["weights"]
    *_, plain, _ = hull_of(volume, sharp=False)
    *_, sharp, _ = hull_of(volume, sharp=True)
    assert np.median(sharp.max(axis=1)) < 0.5 * np.median(plain.max(axis=1))


def require_above(volume, cells, least, sense):
    """det J by direct evaluation is nowhere below a bound."""
    random, bounds = np.random.default_rng(3), volume.cell_bounds(cells)
    for _ in range(200):
        share = random.random((len(cells), 3))
        slopes = volume.jacobian(bounds[:, 0] + share * (bounds[:, 1] - bounds[:, 0]))
        assert (sense * np.linalg.det(slopes) >= least).all()


@pytest.mark.parametrize("sense", [1, -1])
def test_a_rational_lattice_and_its_mirror_are_settled_everywhere(sense):
    volume = shaken((3, 2, 3), (6, 5, 6), 0.05, seed=4, heavy=1.2)
    if sense < 0:
        mirrored = volume.net.copy()
        mirrored[..., 0] = volume.box[:, 0].sum() * mirrored[..., 3] - mirrored[..., 0]
        volume = volume.with_net(mirrored)
    cells = find_cells(volume, *volume.box)
    least, left, _ = settle(volume, cells, WholeBox(volume.box), sense, 0.2, effort=EFFORT)
    assert len(left) == 0
    assert least >= 0.2
    require_above(volume, cells, least, sense)
    # The other way round nothing can be.
    nothing, left, _ = settle(volume, cells, WholeBox(volume.box), -sense, 0.2, effort=EFFORT)
    assert (nothing, len(left)) == (np.inf, len(cells))


def test_what_is_settled_of_two_quotients_is_above_the_bound():
    volume = KINDS["weights"]
    random = np.random.default_rng(2)
    points = volume.rest_points + 0.02 * random.uniform(-1, 1, volume.rest_points.shape)
    weights = volume.rest_weights.copy()
    weights[::7] *= 1.2
    edited = volume.with_control(points, weights)
    assert edited.net.shape[1] == 8
    cells = np.unique(edited.cells(places(12)), axis=0)
    least, left, _ = settle(edited, cells, WholeBox(edited.box), 1, 0.2, effort=EFFORT)
    settled = np.delete(cells, left, axis=0)
    assert len(settled) > len(cells) / 2
    assert least >= 0.2
    require_above(edited, settled, least, 1)


def test_no_round_is_begun_beyond_the_effort():
    volume = shaken((3, 2, 3), (6, 5, 6), 0.05, seed=4, heavy=1.2)
    cells = find_cells(volume, *volume.box)
    first = len(cells) * count_products(volume, sharp=False)
    _, left, spent = settle(volume, cells, WholeBox(volume.box), 1, 0.2, effort=first - 1)
    assert (len(left), spent) == (len(cells), 0)
    _, left, spent = settle(volume, cells, WholeBox(volume.box), 1, 0.2, effort=first)
    assert spent == first
    assert len(left) < len(cells)


def test_hulls_hold_the_derivatives_of_all_nets_between():
    """Three nets are the Bernstein coefficients of a net that depends on s."""
    volume = shaken((2, 2, 1), (4, 4, 3), 0.2, seed=5, heavy=1.5)
    other = shaken((2, 2, 1), (4, 4, 3), 0.2, seed=6, heavy=1.5).net
    nets = (volume.net, (volume.net + other) / 2, other)
    cells = find_cells(volume, *volume.box)
    boxes = volume.cell_bounds(cells)
    (hull,) = slope_hulls(volume, cells, boxes, nets=nets)
    random = np.random.default_rng(8)
    for s in np.linspace(0, 1, 9):
        between = volume.with_net((1 - s) ** 2 * nets[0] + 2 * s * (1 - s) * nets[1] + s**2 * other)
        for _ in range(5):
            at = boxes[:, 0] + random.random((len(cells), 3)) * (boxes[:, 1] - boxes[:, 0])
            slopes = between.jacobian(at)
            assert (np.linalg.norm(slopes - hull.centres, axis=1) <= hull.radii + 1e-12).all()
