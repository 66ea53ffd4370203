"""Bounds of gaps hold for curves and surfaces of noisy meshes, and vanish for exact ones."""

from __future__ import annotations

import numpy as np
import pytest

from ffdcli.surface.affine import plan_cells
from ffdcli.surface.gaps import GapBounds, plan_gaps
from support.surface_models import Stages, box_mesh, evaluate_spline, make_volume, run, turn


def pcurves_of(stages: Stages) -> np.ndarray:
    """(C, 2, 2) ends of coedges in the parameters of their surface."""
    parts, outlines = stages.parts, stages.outlines
    patch = parts.patch[outlines.coedge_region]
    return parts.local(outlines.edges[outlines.coedge_edge], patch[:, None])[..., 1:]


def bounds_of(stages: Stages) -> GapBounds:
    cells = plan_cells(stages.patches, stages.parts)
    gaps = plan_gaps(stages.parts, stages.outlines, cells, stages.curves, pcurves_of(stages))
    return gaps.bounds([stages.volume])


def noisy_box(amount: float) -> Stages:
    """A box of quadrangles whose corners are off their planes, up to its delta."""
    vertices, triangles = box_mesh(0.6, turn([0.3, -0.5, 0.8], 0.83))
    vertices = vertices + amount * np.random.default_rng(0).uniform(-1, 1, vertices.shape)
    volume = make_volume(-0.6, 0.6, (2, 2, 2), (3, 3, 3), amount=0.1)
    return run(vertices, triangles, volume, delta=1e-4, polygon=np.arange(12) // 2)


def measured_gaps(stages: Stages) -> np.ndarray:
    """(E,) largest distance found between the curve of each edge and its surfaces."""
    volume, outlines = stages.volume, stages.outlines
    at = np.linspace(0, 1, 9)
    curves = {}
    for batch in stages.curves:
        poles = batch.control_points(volume.net, np.arange(batch.count))
        for i, edge in enumerate(batch.edges.tolist()):
            curves[edge] = evaluate_spline(batch, i, poles[i], at[:, None])
    pcurves = pcurves_of(stages)
    patch = stages.parts.patch[outlines.coedge_region]
    found = np.zeros(len(outlines.edges))
    for batch in stages.patches:
        poles = batch.control_points(volume.net, np.arange(batch.count))
        for i, number in enumerate(batch.patches.tolist()):
            for coedge in np.flatnonzero(patch == number).tolist():
                start, end = pcurves[coedge]
                edge = int(outlines.coedge_edge[coedge])
                there = start + at[:, None] * (end - start)
                gap = evaluate_spline(batch, i, poles[i], there) - curves[edge]
                found[edge] = max(found[edge], float(np.linalg.norm(gap, axis=1).max()))
    return found


@pytest.mark.parametrize("amount", [1e-5, 5e-5])
def test_bounds_hold_for_noisy_facets(amount: float) -> None:
    stages = noisy_box(amount)
    bounds, found = bounds_of(stages), measured_gaps(stages)
    assert found.max() > amount / 100
    assert (found <= bounds.edges + 1e-12).all()
    assert bounds.edges.max() <= bounds.deviation <= 100 * amount


def test_bounds_vanish_for_exact_facets() -> None:
    stages = run(*box_mesh(0.5), make_volume(-0.6, 0.6, (2, 2, 2), (5, 4, 3)))
    assert bounds_of(stages).deviation <= 1e-15
