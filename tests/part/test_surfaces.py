"""Surfaces: points, derivatives and breaks against OpenCascade's own evaluation."""

from __future__ import annotations

import numpy as np
import pytest
from OCP.gp import gp_Pnt, gp_Vec

from ffdcli.part.surfaces import Offset, Sphere
from tests.support.geom_models import geom_surfaces

NAMES = [
    "plane", "cylinder", "cone", "sphere", "torus", "b-spline", "rational", "extrusion",
    "revolution", "offset", "offset of revolution",
]  # fmt: skip
# In the order of OpenCascade.
NAMED = ["point", "du", "dv", "duu", "dvv", "duv"]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", NAMES)
def test_points_and_derivatives(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    record, geom = geom_surfaces(rng)[name]
    u, v = rng.uniform(0.02, 0.98, (2, 20))
    offset = name.startswith("offset")
    known = list(record.derivatives(u, v, 1 if offset else 2))
    assert np.array_equal(record.points(u, v), known[0])
    known[4:] = known[:3:-1]
    for k, (s, t) in enumerate(zip(u, v, strict=True)):
        vectors = [gp_Pnt(), *(gp_Vec() for _ in known[1:])]
        # Not DN, whose first derivatives of offset surfaces of revolution are wrong.
        (geom.D1 if offset else geom.D2)(s, t, *vectors)
        for name_of, mine, theirs in zip(NAMED, known, vectors, strict=False):
            wanted = np.array(theirs.Coord())
            assert np.abs(mine[k] - wanted).max() <= 1e-9 * (1 + np.abs(wanted).max()), name_of


@pytest.mark.parametrize("name", NAMES)
def test_an_open_grid_gives_the_same(name: str) -> None:
    rng = np.random.default_rng(7)
    record, _ = geom_surfaces(rng)[name]
    u, v = np.sort(rng.uniform(0.02, 0.98, (2, 6)), axis=1)
    grid = record.derivatives(u[:, None], v[None, :4])
    single = record.derivatives(np.repeat(u, 4), np.tile(v[:4], 6))
    for one, other in zip(grid, single, strict=True):
        assert one.shape == (6, 4, 3)
        assert np.abs(one.reshape(-1, 3) - other).max() <= 1e-12 * (1 + np.abs(other).max())


def test_breaks_are_those_of_the_knots_and_of_the_basis() -> None:
    models = geom_surfaces(np.random.default_rng(1))
    spline, _ = models["b-spline"]
    assert spline.breaks(0, 0.0, 1.0).values.tolist() == [0.5]
    assert spline.breaks(0, 0.0, 1.0).continuity.tolist() == [2]
    assert spline.breaks(1, 0.0, 1.0).continuity.tolist() == [0]
    assert spline.breaks(1, 0.5, 1.0).values.size == 0
    swept, _ = models["extrusion"]
    assert swept.breaks(0, 0.0, 1.0).values.tolist() == [0.4]
    assert swept.breaks(1, 0.0, 1.0).values.size == 0
    offset, _ = models["offset of revolution"]
    assert offset.breaks(1, 0.0, 1.0).continuity.tolist() == [1]
    plane, _ = models["plane"]
    assert plane.breaks(0, 0.0, 1.0).values.size == 0


@pytest.mark.parametrize("end", [-1, 1])
def test_the_offset_of_a_pole_is_the_limit(end: int) -> None:
    shell = Offset(Sphere(np.zeros(3), *np.eye(3), radius=2.0), 0.5)
    u = np.linspace(0, 6, 7)
    top = shell.points(u, np.full(7, end * np.pi / 2))
    near = shell.points(u, np.full(7, end * (np.pi / 2 - 1e-7)))
    assert np.abs(np.linalg.norm(top, axis=1) - 2.5).max() < 1e-12
    assert np.abs(top - near).max() < 1e-6
