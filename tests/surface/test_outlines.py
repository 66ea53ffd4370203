"""Outlines of regions with holes, of regions that touch themselves, and straightening."""

from __future__ import annotations

import numpy as np
import pytest

from support.surface_models import make_volume, run, turn


def extrude(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A plate of height 0.2 whose plan is the chosen unit cells (n, m) of a grid, scaled to 1."""
    n, m = cells.shape
    number = np.arange(2 * (n + 1) * (m + 1)).reshape(2, n + 1, m + 1)
    grid = np.meshgrid([-0.1, 0.1], np.linspace(-0.5, 0.5, n + 1), np.linspace(-0.5, 0.5, m + 1),
                       indexing="ij")  # fmt: skip
    vertices = np.stack([grid[1], grid[2], grid[0]], axis=-1).reshape(-1, 3)
    quads = []
    for i, j in np.argwhere(cells):
        ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        quads.append([number[1][p] for p in ring])
        quads.append([number[0][p] for p in ring[::-1]])
        beside = [(i, j - 1), (i + 1, j), (i, j + 1), (i - 1, j)]
        for side, (x, y) in enumerate(beside):
            if 0 <= x < n and 0 <= y < m and cells[x, y]:
                continue
            p, q = ring[side], ring[(side + 1) % 4]
            quads.append([number[0][p], number[0][q], number[1][q], number[1][p]])
    corner = np.array(quads)
    triangles = np.concatenate([corner[:, [0, 1, 2]], corner[:, [0, 2, 3]]])
    used, triangles = np.unique(triangles, return_inverse=True)
    return vertices[used], triangles.reshape(-1, 3)


def euler(outlines, regions: int) -> int:
    loops = np.diff(outlines.region_loops)
    assert len(loops) == regions
    return len(np.unique(outlines.edges)) - len(outlines.edges) + int((2 - loops).sum())


def loop_lengths(outlines, region: int) -> list[int]:
    part = slice(outlines.region_loops[region], outlines.region_loops[region + 1] + 1)
    return np.diff(outlines.loop_coedges[part]).tolist()


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_plate_with_a_hole(angle: float) -> None:
    cells = np.ones((3, 3), dtype=bool)
    cells[1, 1] = False
    vertices, triangles = extrude(cells)
    vertices = vertices @ turn([1, 2, 3], angle).T
    volume = make_volume(-1.0, 1.0, (3, 3, 3), (4, 4, 4))
    stages = run(vertices, triangles, volume)
    assert len(stages.parts.patch) == 10
    assert len(stages.outlines.edges) == 24
    assert euler(stages.outlines, 10) == 0  # a torus
    loops = np.diff(stages.outlines.region_loops)
    assert sorted(loops.tolist()) == [1] * 8 + [2] * 2
    for region in np.flatnonzero(loops == 2):
        assert loop_lengths(stages.outlines, int(region)) == [4, 4]
        first = stages.outlines.region_loops[region]
        reach = []
        for loop in (first, first + 1):
            part = slice(*stages.outlines.loop_coedges[loop : loop + 2])
            at = stages.vertices[stages.outlines.edges[stages.outlines.coedge_edge[part]]]
            reach.append(np.ptp(at.reshape(-1, 3), axis=0).max())
        assert reach[0] > reach[1]


@pytest.mark.parametrize("missing", [[(1, 1), (0, 0)], [(1, 1), (2, 2)], [(0, 1), (1, 2), (2, 1)]])
def test_regions_that_touch_themselves_are_divided(missing: list[tuple[int, int]]) -> None:
    """A hole at a corner of the outline, two holes and three: each loop passes a vertex once."""
    cells = np.ones((4, 4), dtype=bool)
    for place in missing:
        cells[place] = False
    vertices, triangles = extrude(cells)
    stages = run(vertices, triangles, make_volume(-1.0, 1.0, (2, 2, 2), (3, 3, 3)))
    outlines = stages.outlines
    ends = outlines.edges[outlines.coedge_edge]
    tails = np.where(outlines.coedge_forward, ends[:, 0], ends[:, 1])
    passages = np.stack([outlines.coedge_region, tails])
    assert len(np.unique(passages, axis=1).T) == passages.shape[1]
    flat = np.abs(stages.groups.normal[stages.parts.group][:, 2]) > 0.5
    assert len(np.flatnonzero(flat)) == 4
    area = abs(signed_areas(stages))[flat].sum()
    assert area == pytest.approx(2 * cells.sum() / 16, rel=1e-14)


def signed_areas(stages) -> np.ndarray:
    """Area (R,) that the loops of each region enclose in the plane of x and y, by Green."""
    outlines = stages.outlines
    ends = outlines.edges[outlines.coedge_edge]
    ends = np.where(outlines.coedge_forward[:, None], ends, ends[:, ::-1])
    (px, py), (qx, qy) = np.moveaxis(stages.vertices[ends][..., :2], 0, -1).swapaxes(0, 1)
    return np.bincount(outlines.coedge_region, weights=(px * qy - py * qx) / 2)


def test_collinear_vertices_go_away_only_between_the_same_regions() -> None:
    """A bar of three cells: inner vertices of its long edges vanish; an L keeps its corners."""
    volume = make_volume(-1.0, 1.0, (2, 2, 2), (3, 3, 3))
    bar = run(*extrude(np.array([[True, True, True]])), volume)
    assert len(bar.outlines.edges) == 12
    assert bar.outlines.straightened == 0
    corner = run(*extrude(np.array([[True, False], [True, True]])), volume)
    assert len(corner.outlines.edges) == 18
    assert len(corner.parts.patch) == 8


def test_an_open_mesh_has_edges_with_one_region() -> None:
    vertices, triangles = extrude(np.ones((1, 1), dtype=bool))
    top = vertices[triangles][:, :, 2].min(axis=1) > 0
    stages = run(vertices, triangles[~top], make_volume(-1.0, 1.0, (2, 2, 2), (3, 3, 3)))
    alone = stages.outlines.edge_regions[:, 1] < 0
    assert alone.sum() == 4
    assert (stages.outlines.edge_regions[:, 0] >= 0).all()
    ends = stages.places[stages.outlines.edges[alone]]
    assert (ends[:, :, 2] == 0.1).all()
