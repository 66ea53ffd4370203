"""Graphs of planes: right-handed, dominant, and near all vertices of their plane in every frame."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.surface.plane_graphs import fit_graphs
from ffdcli.surface.planes import find_planes
from support.surface_models import box_mesh, make_volume, run, turn, zoo


def test_graphs_are_right_handed_and_dominant() -> None:
    stages = run(*zoo(), make_volume(-0.5, 0.5, (2, 2, 2), (4, 5, 6)))
    graphs = stages.facets.graphs.take(0)
    normal, axes = stages.groups.normal, graphs.axes
    rows = np.arange(len(normal))
    dominant = np.abs(normal[rows, axes[:, 0]])
    assert (dominant >= np.abs(normal).max(axis=1) / 2).all()
    unit = np.eye(3)
    handed = np.cross(unit[axes[:, 1]], unit[axes[:, 2]])[rows, axes[:, 0]]
    assert (handed == np.sign(normal[rows, axes[:, 0]])).all()
    assert (np.abs(graphs.slopes) <= 2 + 1e-12).all()


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_graphs_pass_through_the_vertices_in_every_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices, triangles = box_mesh(rng.uniform(0.2, 0.5, 3), turn(rng.normal(size=3), 0.8))
    frames = np.stack([vertices, vertices @ turn(rng.normal(size=3), 1.7).T], axis=1)
    volumes = [make_volume(-1, 1, (2, 2, 2), (5, 4, 6)) for _ in range(2)]
    groups = find_planes(vertices, triangles, np.arange(12) // 2, 1e-9)
    graphs = fit_graphs(frames, triangles, groups, volumes, 1e-9)
    assert graphs.axes.shape == (2, 6, 3)
    owner, corners = np.repeat(groups.group, 3), triangles.ravel()
    for number in range(2):
        here = graphs.take(number)
        points = np.take_along_axis(frames[corners, number], here.axes[owner], axis=1)
        gap = np.abs(here.height(owner, points[:, 1], points[:, 2]) - points[:, 0])
        assert (gap <= here.deviation[owner] + 1e-15).all()
        assert gap.max() <= 1e-14
        assert ((here.low <= here.high).all(axis=1)).all()


def test_a_slope_within_epsilon_is_dropped() -> None:
    vertices, triangles = box_mesh(1.0, turn([1, 0, 0], 1e-10))
    volume = make_volume(-1, 1, (2, 2, 2), (5, 4, 6))
    groups = find_planes(vertices, triangles, np.arange(12) // 2, 1e-9)
    for epsilon, sloping in ((1e-9, False), (1e-12, True)):
        graphs = fit_graphs(vertices[:, None], triangles, groups, [volume], epsilon)
        assert graphs.sloping.any() == sloping
