"""Parameters of points in a T-spline volume at rest."""

import numpy as np
import pytest

from ffdcli.volume.adaptive.octree_growth import grow
from ffdcli.volume.adaptive.parameters import SOLVED, find_parameters
from ffdcli.volume.adaptive.tspline import tspline_volume
from support.volume_trees import BOX, FRAME, ball, regular_tree, tree_with_junctions


@pytest.mark.parametrize("weights", [(1.0, 1.0), (100.0, 1.0)])
def test_points_of_the_model_get_their_parameters(weights):
    volume = tspline_volume(grow(ball(), None, 4), BOX, weights, FRAME)
    points = ball().reshape(-1, 3) * BOX[1]
    found = find_parameters(volume, points)
    size = np.linalg.norm(BOX[1])
    assert found.solved.all()
    assert not found.folded.any()
    # By the sums of the definition, not by the forms that Newton's steps are made with.
    basis = volume.basis_matrix(found.parameters)
    total = basis @ volume.rest_weights
    images = basis @ (volume.rest_weights[:, None] * volume.rest_points) / total[:, None]
    assert np.linalg.norm(images - points, axis=1).max() < 2 * SOLVED * size


def test_at_regular_inner_places_the_map_is_the_identity():
    volume = tspline_volume(regular_tree(3), BOX, (1.0, 1.0), FRAME)
    points = np.random.default_rng(0).uniform(BOX[1] * 0.26, BOX[1] * 0.74, (50, 3))
    found = find_parameters(volume, points)
    assert np.abs(found.parameters - points).max() < 1e-12


def test_points_without_parameters_are_told():
    """The map takes its box strictly inside itself: corners of the box have no parameters."""
    volume = tspline_volume(tree_with_junctions(), BOX, (100.0, 1.0), FRAME)
    found = find_parameters(volume, np.concatenate([BOX, BOX.mean(axis=0, keepdims=True)]))
    assert found.solved.tolist() == [False, False, True]
    assert (found.residual[:2] > 1e-3).all()
    assert np.all((found.parameters >= BOX[0]) & (found.parameters <= BOX[1]))


def test_folds_of_the_map_are_told():
    """In light cells beside heavy ones: the paper's claim of a unique solution fails."""
    volume = tspline_volume(grow(ball(), None, 3), BOX, (100.0, 1.0), FRAME)
    rest = volume.plain_map(volume.rest_points, volume.rest_weights)
    random = np.random.default_rng(1).uniform(BOX[0], BOX[1], (20_000, 3))
    images, slopes = rest.linearise(random)
    folded = np.linalg.det(slopes) < -1e-3
    assert folded.any()
    chosen = np.flatnonzero(folded)[:50]
    found = find_parameters(volume, images[chosen])
    determinant = np.linalg.det(rest.linearise(found.parameters)[1])
    assert np.array_equal(found.folded, determinant <= 0)
