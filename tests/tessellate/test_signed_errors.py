"""Signed distances: the side, the size, against a surface whose distances are known."""

from __future__ import annotations

import numpy as np
import pytest

from ffdcli.deformation import Deformation
from ffdcli.tessellate.signed_errors import grid, signed_errors
from ffdcli.triangles import deform_mesh

PLATE = "v 0 0 0\nv 4 0 0\nv 4 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n"
# Along u a quadratic Bézier curve: the plate becomes the parabola z = 2 t (1 - t), x = 4 t.
HUMP = (
    'degree: [2, 1, 1]\npoints: [3, 2, 2]\nedits:\n  - move: {at: [1, ":", ":"], by: [0, 0, 1]}\n'
)


@pytest.mark.parametrize("up", [True, False])
def test_flat_plate_under_a_parabola(job, up):
    text = PLATE if up else PLATE.replace("f 1 2 3\nf 1 3 4", "f 3 2 1\nf 4 3 1")
    mesh, lattice = job(HUMP, mesh=text)
    result = deform_mesh(mesh, lattice, mode="vertices")
    assert result.deviation == pytest.approx(0.5, rel=1e-3)
    errors = signed_errors(result, Deformation.of(lattice, result.mesh.delta), parts=8)
    # The exact surface is above: the plate lies inside where its normal points up.
    apart = errors.distance[np.abs(errors.distance) > 1e-12]
    assert len(apart) > len(errors.distance.ravel()) / 2
    assert (apart < 0 if up else apart > 0).all()
    # The distance from (x, 0) to the parabola, by brute force.
    t = np.linspace(0, 1, 20_001)
    curve = np.column_stack([4 * t, 2 * t * (1 - t)])
    for point, found in zip(
        errors.points.reshape(-1, 3)[::7], errors.distance.ravel()[::7], strict=True
    ):
        expected = np.linalg.norm(curve - point[[0, 2]], axis=1).min()
        assert abs(found) == pytest.approx(expected, abs=1e-6)


def test_fine_results_err_as_much_as_they_say(job):
    mesh, lattice = job(HUMP, mesh=PLATE)
    result = deform_mesh(mesh, lattice, mode="adaptive", tolerance=0.01)
    errors = signed_errors(result, Deformation.of(lattice, result.mesh.delta))
    assert 0.5 * result.deviation < np.abs(errors.distance).max() <= 1.01 * result.deviation


def test_grid_covers_the_triangle():
    for parts in (1, 2, 5):
        places, cells = grid(parts)
        assert len(cells) == parts**2
        np.testing.assert_allclose(places.sum(axis=1), 1)
        a, b, c = (places[cells[:, i], 1:] for i in range(3))
        area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        np.testing.assert_allclose(area, 1 / parts**2)
