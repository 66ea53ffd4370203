"""Vertices of the B-rep: images inside boxes, and no change outside."""

from __future__ import annotations

import numpy as np

from ffdcli.surface.vertices import Vertices, plan_vertices
from support.surface_models import Stages, make_volume, run, zoo


def stages_and_vertices() -> tuple[Stages, Vertices]:
    stages = run(*zoo(), make_volume(-0.3, 0.3, (2, 3, 2), (6, 5, 7)))
    return stages, plan_vertices(stages.outlines.edges, stages.parts, stages.vertices)


def test_vertices_in_the_box_move_with_it_and_others_keep_every_bit() -> None:
    stages, vertices = stages_and_vertices()
    assert np.array_equal(vertices.number[vertices.used], np.arange(len(vertices.used)))
    original = vertices.used < len(stages.vertices)
    assert np.array_equal(vertices.rest[original], stages.vertices[vertices.used[original]])
    found = vertices.deformed([stages.volume])
    moved = np.concatenate([batch.vertices for batch in vertices.batches])
    expected = stages.volume.evaluate(vertices.rest[moved])
    np.testing.assert_allclose(found[moved], expected, rtol=0, atol=1e-14)
    stay = np.setdiff1d(np.arange(len(vertices.used)), moved)
    assert np.array_equal(found[stay], vertices.rest[stay])
    low, high = stages.volume.box
    inner = ((vertices.rest > low + 1e-9) & (vertices.rest < high - 1e-9)).all(axis=1)
    assert np.array_equal(np.flatnonzero(inner), np.sort(moved))


def test_matrices_give_the_same_vertices() -> None:
    stages, vertices = stages_and_vertices()
    kept = vertices.with_matrices()
    assert all(batch.sums is not None for batch in kept.batches)
    np.testing.assert_allclose(
        kept.deformed([stages.volume]), vertices.deformed([stages.volume]), rtol=0, atol=1e-14
    )
