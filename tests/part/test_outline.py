"""Outlines: inside tests on grids and the cells that a face meets, against geometry by hand."""

from dataclasses import replace

import numpy as np

from ffdcli.part.curves import BSplineCurve
from ffdcli.part.outline import outlines_of, turned_outline
from ffdcli.part.outlines import rectangles_of, trace_outlines
from ffdcli.part.surfaces import Cylinder, Plane
from support.hand_parts import ball, cylinder


def test_a_disc_in_its_square():
    disc = outlines_of(cylinder())[1]
    u, v = np.linspace(0.013, 0.991, 61), np.linspace(0.007, 0.983, 47)
    radius = 2 * np.hypot(u[:, None] - 0.5, v - 0.5)
    sure = np.abs(radius - 1) > 2e-3
    assert np.array_equal(disc.inside(u, v)[sure], (radius < 1)[sure])


def test_faces_that_are_their_whole_rectangle():
    steps = np.linspace(0, 1, 8)
    for outline in (outlines_of(cylinder())[0], outlines_of(ball())[0]):
        assert outline.inside(steps[1:-1], steps[1:-1]).all()
        assert outline.cells(steps, steps).all()


def test_cells_that_a_disc_meets():
    disc = outlines_of(cylinder())[1]
    steps = np.linspace(0, 1, 11)
    nearest = np.clip(0.5, steps[:-1], steps[1:]) - 0.5
    gap = np.hypot(nearest[:, None], nearest)
    found = disc.cells(steps, steps)
    assert found[gap < 0.495].all()
    assert not found[gap > 0.505].any()


def test_faces_without_pcurves_count_as_whole():
    part = cylinder()
    bare = replace(part, pcurves=(None,) * len(part.pcurves))
    assert all(each.inside(np.array([0.1]), np.array([0.1])).all() for each in outlines_of(bare))


def test_a_plane_turned():
    part = cylinder()
    plane = part.surfaces[1]
    c, s = np.cos(0.3), np.sin(0.3)
    turned = Plane(plane.origin, c * plane.x + s * plane.y, c * plane.y - s * plane.x, plane.z)
    rectangle, outline = turned_outline(outlines_of(part)[1], part.rectangles[1], plane, turned)
    assert (rectangle[0] <= -2).all()
    assert (rectangle[1] >= 2).all()
    assert np.abs(rectangle).max() < 2.02
    at = np.linspace(0.01, 0.99, 40)
    places = rectangle[0] + np.stack(np.meshgrid(at, at, indexing="ij"), -1) * np.ptp(rectangle, 0)
    radius = np.linalg.norm(places, axis=-1)
    sure = np.abs(radius - 2) > 5e-3
    assert np.array_equal(outline.inside(at, at)[sure], (radius < 2)[sure])


def test_a_face_round_a_cylinder_reaches_a_period_and_no_more():
    # A wavy rim: a parabola in u for each of its thirds, all but smooth, once around.
    around = np.linspace(0.3, 0.3 + 2 * np.pi, 13)
    poles = np.stack([around, 0.1 * np.cos(3 * around)], axis=1)
    rim = BSplineCurve(3, np.r_[np.zeros(4), np.linspace(0, 1, 11)[1:-1], np.ones(4)], poles)
    across = np.zeros(3), np.eye(3)
    tube = Cylinder(across[0], *across[1], 1.0)
    traced = trace_outlines(
        (rim,), np.array([[0.0, 1.0]]), np.array([True]), np.array([0, 1]), np.array([0, 1])
    )
    low, high = rectangles_of((tube,), np.array([[[0, -1e100], [7, 1e100]]]), traced)[0]
    assert high[0] - low[0] <= 2 * np.pi
    dense = rim.points(np.linspace(0, 1, 5001))
    assert np.abs(low - dense.min(axis=0)).max() < 1e-3
    assert np.abs(high - dense.max(axis=0)).max() < 1e-3
    assert (low[1], -high[1]) <= (dense[:, 1].min(), -dense[:, 1].max())
