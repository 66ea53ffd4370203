"""Place the box and frame of a lattice; its B-spline volume before any edit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.file.check_spec import nearest_axes
from ffdcli.lattice.file.definition import Definition
from ffdcli.lattice.file.model_base import Corners
from ffdcli.lattice.file.problems import AXES
from ffdcli.lattice.file.spec import LatticeSpec, OrientedBox
from ffdcli.splines.knots import greville, make_knots
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.frame import Frame, aligned_frame

Interior = tuple[Floats, Floats, Floats]

# Margin of an automatic box on both sides of a flat mesh, relative to the size of the mesh.
FLAT_MARGIN = 0.05


@dataclass(frozen=True)
class Layout:
    """Box and frame of a lattice.

    Parameters
    ----------
    frame : Frame
    box : (2, 3) float64, lattice frame
    written_box : (2, 3) float64
        The box in the coordinates of edits: model coordinates if the box is aligned with the
        model axes, else those of the frame.
    written_origin : (3,) float64
        Origin of the frame in these coordinates: ``lattice = written - written_origin``.
    """

    frame: Frame
    box: Floats
    written_box: Floats
    written_origin: Floats


def automatic_corners(bounds: Floats, delta: float) -> Floats:
    """(2, 3) bounding box of a mesh, with a margin along axes where the mesh is flat.

    Flat means thinner than twice ``delta``, the distance within which points count as coplanar.
    """
    flat = bounds[1] - bounds[0] <= 2 * delta
    margin = FLAT_MARGIN * float(np.linalg.norm(bounds[1] - bounds[0]))
    return np.stack([bounds[0] - flat * margin, bounds[1] + flat * margin])


def padding(extent: Floats, share: Floats | float) -> Floats:
    """Margin (3,) on each side of a box that is as wide as one finest cell of the enlarged box.

    A T-spline volume maps its box strictly inside itself, so the mesh must keep away from its
    sides. ``extent`` (3,) is the size of the box, ``share`` that of a finest cell as a fraction of
    the enlarged box. Cells larger than a quarter of the box give a margin of a quarter.
    """
    share = np.minimum(share, 0.25)
    return np.asarray(extent * share / (1 - 2 * share))


def automatic_box(definition: Definition, bounds: Floats, delta: float) -> Floats:
    """:func:`automatic_corners`, with :func:`padding` for a T-spline."""
    corners = automatic_corners(bounds, delta)
    if definition.spec.volume != "tspline":
        return corners
    more = padding(corners[1] - corners[0], definition.finest)
    return np.stack([corners[0] - more, corners[1] + more])


def lay_out(definition: Definition, bounds: Floats | None, delta: float) -> Layout:
    """Place the box as the file says: given, or round the bounds (2, 3) of a mesh.

    Raises
    ------
    LatticeError
        The box is automatic and there is no mesh, or floating point cannot resolve its extent.
    """
    spec, source = definition.spec, definition.source
    box = spec.box
    if isinstance(box, OrientedBox) and box.axes is not None:
        half = np.array(box.size) / 2
        local = np.stack([-half, half])
        frame = Frame(np.array(box.center), nearest_axes(box.axes))
        layout = Layout(frame, local, local, np.zeros(3))
    else:
        if isinstance(box, OrientedBox):
            half = np.array(box.size) / 2
            corners = np.stack([np.array(box.center) - half, np.array(box.center) + half])
        elif isinstance(box, Corners):
            corners = np.array([box.min, box.max])
        elif bounds is None:
            raise source.error(
                ("box",), "an automatic box needs a mesh", "name the mesh, or give min and max"
            )
        else:
            corners = automatic_box(definition, bounds, delta)
        frame = aligned_frame(corners[0], corners[1])
        layout = Layout(frame, corners - frame.origin, corners, frame.origin)
    _require_extent(definition, layout)
    return layout


def interior_fractions(spec: LatticeSpec) -> Interior:
    """Interior knots of all axes as fractions of the box: given or evenly spaced."""
    if spec.knots is not None:
        u, v, w = (np.array(values, dtype=np.float64) for values in spec.knots)
        return u, v, w
    u, v, w = (
        np.arange(1, count - degree) / (count - degree)
        for count, degree in zip(spec.counts, spec.degree, strict=True)
    )
    return u, v, w


def bspline_at_rest(spec: LatticeSpec, layout: Layout, interior: Interior) -> BSplineVolume:
    """The identity map of the box as a B-spline volume with given interior knots."""
    u, v, w = (
        make_knots(
            spec.degree[axis],
            spec.counts[axis],
            float(layout.box[0, axis]),
            float(layout.box[1, axis]),
            interior=interior[axis],
            clamped=spec.ends == "clamped",
        )
        for axis in range(3)
    )
    places = [greville(knots, degree) for knots, degree in zip((u, v, w), spec.degree, strict=True)]
    net = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1)
    return BSplineVolume(spec.degree, (u, v, w), net, layout.frame)


def _require_extent(definition: Definition, layout: Layout) -> None:
    """Reject a box so thin that its knots coincide in floating point."""
    steps = [np.unique(values) for values in interior_fractions(definition.spec)]
    for axis, inside in enumerate(steps):
        low, high = layout.box[:, axis]
        knots = np.concatenate([[low], low + inside * (high - low), [high]])
        if not np.all(np.diff(knots) > 0) or not np.isfinite(high - low):
            raise definition.source.error(
                ("box",),
                f"the box has no usable extent along {AXES[axis]}: {low:g} to {high:g}",
                "check the mesh, or give the box a thickness",
            )
