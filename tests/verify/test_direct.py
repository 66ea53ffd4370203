"""Evaluation for verification, without the code that makes surfaces."""

import subprocess
import sys

import numpy as np
import pytest

from ffdcli.deformation import Deformation
from ffdcli.verify.direct import DirectMap, evaluate_directly
from support.injective_models import shaken
from support.lattice_models import settled

# Packages that make surfaces, or the polynomials that surfaces come from.
MAKERS = "splines volume surface fitting folds lattice brep.assemble brep.geometry brep.reduce"


def direct(volume):
    (found,) = evaluate_directly(Deformation((volume,), np.zeros((1, 2, 3)))).maps
    assert isinstance(found, DirectMap)
    return found


def points_in(box, count=200):
    corners = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)
    within = np.random.default_rng(0).uniform(*box, size=(count, 3))
    return np.concatenate([within, corners, box[1:] + 1.0])


@pytest.mark.parametrize("clamped", [True, False])
@pytest.mark.parametrize("heavy", [1.0, 5.0])
@pytest.mark.parametrize("degrees", [(1, 1, 1), (3, 2, 1), (4, 3, 5)])
def test_values_and_derivatives_are_those_of_the_volume(degrees, heavy, clamped):
    volume = shaken(degrees, [k + 3 for k in degrees], 0.2, 0, clamped=clamped, heavy=heavy)
    points = points_in(volume.box)
    found = direct(volume)
    np.testing.assert_allclose(found.evaluate(points), volume.evaluate(points), atol=1e-12)
    np.testing.assert_allclose(found.jacobian(points), volume.jacobian(points), atol=1e-11)


def test_derivatives_are_slopes_of_the_values():
    found = direct(shaken((3, 2, 4), (6, 5, 7), 0.2, 1, heavy=3.0))
    points = np.random.default_rng(1).uniform(*found.box, size=(50, 3)) * 0.9 + 0.05
    step = 1e-6
    for axis, arm in enumerate(step * np.eye(3)):
        slope = (found.evaluate(points + arm) - found.evaluate(points - arm)) / (2 * step)
        np.testing.assert_allclose(found.jacobian(points)[:, :, axis], slope, atol=1e-6)


def test_adaptive_volumes_keep_their_own_evaluation():
    lattice = settled(volume="hierarchical", octree={"depth": 2})
    made = Deformation.of(lattice, 1e-9)
    assert evaluate_directly(made).maps == made.maps


def test_no_code_that_makes_surfaces_is_imported():
    script = "import sys, ffdcli.verify.file, ffdcli.brep.occ.reading.read\nprint(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    loaded = done.stdout.split()
    assert "ffdcli.verify.direct" in loaded
    assert [m for m in loaded if m.startswith(tuple(f"ffdcli.{n}" for n in MAKERS.split()))] == []
