"""Knots of fits: where iso-lines lie in planes across which the deformation is not smooth."""

import numpy as np
import pytest

from ffdcli.part.breaks import breaks_along, planes_of
from ffdcli.part.targets import curve_target, surface_target
from support.hand_parts import ball, cylinder, lattice_for

KNOTS = np.array([5 / 3, 10 / 3])


def along(surface, axis, rectangle):
    low, extent = rectangle[0], rectangle[1] - rectangle[0]

    def place(at, across):
        u, v = (at[:, None], across[None]) if axis == 0 else (across[None], at[:, None])
        points = surface.points(low[0] + u * extent[0], low[1] + v * extent[1])
        return points

    return place


def test_knot_planes_across_a_cylinder():
    part = cylinder()
    planes, side = planes_of(lattice_for(part)), along(part.surfaces[0], 1, part.rectangles[0])
    found = breaks_along(side, planes, part.size)
    inner = (found.values > 1e-9) & (found.values < 1 - 1e-9)
    assert np.allclose(np.sort(found.values[inner]) * 5, KNOTS, atol=1e-13)
    assert (found.continuity[inner] == 2).all()


def test_knot_planes_along_a_cylinder():
    """The knots x = 0 and y = 0 pass through the axis: they cut the side at quarters."""
    part = cylinder()
    side = along(part.surfaces[0], 0, part.rectangles[0])
    found = breaks_along(side, planes_of(lattice_for(part)), part.size)
    assert np.abs(np.cos(4 * np.pi * found.values) ** 2 - 1).max() <= 1e-9
    inner = found.values[(found.values > 1e-6) & (found.values < 1 - 1e-6)]
    assert np.allclose(np.unique(np.round(inner, 9)), [0.25, 0.5, 0.75])


def test_planes_that_cut_across_the_parameters_are_no_breaks():
    part = ball()
    sphere = along(part.surfaces[0], 0, part.rectangles[0])
    found = breaks_along(sphere, planes_of(lattice_for(part, points=[6, 5, 5])), part.size)
    # y = 0 cuts the sphere along meridians, x = const does not.
    inner = found.values[(found.values > 1e-6) & (found.values < 1 - 1e-6)]
    assert np.allclose(np.unique(np.round(inner, 9)), [0.5])


@pytest.mark.parametrize(("border", "wanted"), [("c0", 0), ("c1", 1), ("c2", 2)])
def test_the_continuity_of_crossed_sides(border, wanted):
    part = cylinder()
    box = {"min": [-3, -3, 2], "max": [3, 3, 6]}
    found = planes_of(lattice_for(part, box=box, border=border))[0].sides
    # Only the lower side of w is crossed; beyond the others the map is continued.
    assert found == (1, 1, 1, 1, wanted, 1)


def test_first_knots_of_edges_and_faces():
    part = cylinder()
    planes = planes_of(lattice_for(part))
    line = curve_target(part.curves[2], part.edge_range[2], planes, part.size, 3)
    assert np.allclose(line.axes[0].breaks, [0, 1 / 3, 2 / 3, 1])
    assert line.axes[0].mults == (1, 1)
    rim = curve_target(part.curves[0], part.edge_range[0], planes, part.size, 3)
    assert rim.axes[0].closed == "continuous"
    side = surface_target(part.surfaces[0], part.rectangles[0], None, planes, part.size, (3, 3))
    assert [axis.closed for axis in side.axes] == ["smooth", ""]
    sphere = ball()
    whole = surface_target(
        sphere.surfaces[0], sphere.rectangles[0], None, planes, sphere.size, (3, 3)
    )
    assert whole.points == ((1, 0), (1, 1))
