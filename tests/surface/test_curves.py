"""Curves of edges: degrees, breaks and multiplicities."""

from __future__ import annotations

import numpy as np

from ffdcli.surface.curves import plan_curves
from ffdcli.surface.tolerance import Tolerances
from support.surface_models import box_mesh, evaluate_spline, make_volume, run, turn


def test_curve_degrees_and_breaks() -> None:
    volume = make_volume(-0.5, 0.5, (2, 3, 4), (4, 6, 5))
    cube = run(*box_mesh(), volume)
    assert sorted((batch.running, batch.degrees[0]) for batch in cube.curves) == [
        ((0,), 2), ((1,), 3), ((2,), 4)
    ]  # fmt: skip
    for batch in cube.curves:
        axis = batch.running[0]
        knots = volume.knot_planes(axis, volume.box[None]).values[0] + 0.5
        for row in batch.breaks[0]:
            inner = row[1:-1]
            assert np.allclose(inner, knots) or np.allclose(inner, 1 - knots[::-1])
        assert (batch.mults[0] == 1).all()
    rotated = run(*box_mesh(0.5, turn([0.3, -0.5, 0.8], 0.83)), volume)
    # Edges of the box run along all axes; those that cuts made lie in knot planes.
    cuts = {((0, 1), 5), ((1, 2), 7), ((0, 2), 6)}
    found = {(batch.running, batch.degrees[0]) for batch in rotated.curves}
    assert ((0, 1, 2), 9) in found
    assert found <= cuts | {((0, 1, 2), 9)}
    for batch in rotated.curves:
        allowed = {batch.degrees[0] - (volume.degrees[axis] - 1) for axis in batch.running}
        assert set(batch.mults[0].tolist()) <= allowed


def test_an_edge_through_several_knot_planes_at_once_breaks_once() -> None:
    """The diagonal of the cube meets the knots of all three axes at one parameter each."""
    volume = make_volume(-0.5, 0.5, (3, 3, 2), (6, 6, 5))
    ends = np.array([[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]])
    (batch,) = plan_curves(
        ends[:, None], np.array([[0, 1]]), np.array([0]), [volume], Tolerances(1.0, 1e-9, 1e-7)
    )
    np.testing.assert_allclose(batch.breaks[0][0], [0, 1 / 3, 2 / 3, 1], atol=1e-15)
    assert batch.degrees == (8,)
    assert batch.mults[0].tolist() == [8 - 1, 8 - 1]  # the w-knots are only C1
    poles = batch.control_points(volume.net, np.array([0]))[0]
    t = np.linspace(0, 1, 50)
    image = evaluate_spline(batch, 0, poles, t[:, None])
    points = np.clip(ends[0] + t[:, None] * (ends[1] - ends[0]), -0.5, 0.5)
    assert np.abs(image - volume.evaluate(points)).max() <= 1e-14


def test_a_curve_across_an_axis_within_epsilon_lies_halfway() -> None:
    volume = make_volume(-0.5, 0.5, (2, 3, 2), (5, 6, 4))
    ends = np.array([[-0.4, 0.1, 0.2], [0.3, 0.1 + 8e-10, 0.2]])
    (batch,) = plan_curves(
        ends[:, None], np.array([[0, 1]]), np.array([0]), [volume], Tolerances(1.0, 1e-9, 1e-7)
    )
    assert batch.running == (0,)
    poles = batch.control_points(volume.net, np.array([0]))[0]
    halfway = ends.copy()
    halfway[:, 1] = ends[:, 1].mean()
    np.testing.assert_allclose(poles[[0, -1]], volume.evaluate(halfway), rtol=0, atol=1e-14)
