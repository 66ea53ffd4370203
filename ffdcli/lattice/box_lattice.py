"""One settled box of control points, and its control net: scaled, or replaced by another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.border import (
    Border,
    describe_locked,
    restore_locked_points,
    restore_locked_weights,
)
from ffdcli.lattice.file.definition import Definition
from ffdcli.lattice.file.source import Source
from ffdcli.lattice.file.spec import LatticeSpec
from ffdcli.lattice.layout import Interior, Layout
from ffdcli.volume.protocol import Volume

if TYPE_CHECKING:
    from ffdcli.lattice.drag.holds import Groups
    from ffdcli.lattice.drag.solutions import Succession
    from ffdcli.lattice.fit.report import FitReport
    from ffdcli.volume.adaptive.inverse_map import AnyMap
    from ffdcli.volume.adaptive.octree import Cells, ModelTree
    from ffdcli.volume.adaptive.volume import AdaptiveVolume


@dataclass(frozen=True, eq=False)
class ControlNet:
    """Control points with their weights and knots, and the map that they make.

    Parameters
    ----------
    at_rest : AnyMap
        The identity map with these knots.
    interior : three float64 arrays
        Interior knots, as fractions of the box.
    points, weights : (nu, nv, nw, 3), (nu, nv, nw) float64
        Control points, lattice frame, and their weights.
    map : AnyMap
        The deformation.
    """

    at_rest: AnyMap
    interior: Interior
    points: Floats
    weights: Floats
    map: AnyMap


def control_net(at_rest: AnyMap, interior: Interior, points: Floats, weights: Floats) -> ControlNet:
    """The control net of control points and weights; its map may hold infinite numbers."""
    with np.errstate(over="ignore"):
        deformed = at_rest.with_control(points, weights)
    return ControlNet(at_rest, interior, points, weights, deformed)


@dataclass(frozen=True, eq=False)
class BoxLattice:
    """A lattice settled by a mesh; immutable.

    Parameters
    ----------
    definition : Definition
        What the file says.
    layout : Layout
        Box and frame.
    cells : ModelTree or None
        Cells of the volume, where it has an octree.
    border : Border
        Locked layers of control points.
    groups : mapping of str to (T, 3, 3) float64, or None
        Triangles of the mesh's groups, model coordinates; None where they are not known.
    start : AnyMap
        The map before any edit.
    control : ControlNet
        Control points, weights and knots, all edits applied.
    warnings : tuple of str
        Warnings about the box and the edits.
    successions : mapping of int to Succession
        Single-point drags that the `drag` edits consist of, by the edit's number.
    fits : mapping of int to FitReport
        What the `fit` edits reached, by the edit's number.
    """

    definition: Definition
    layout: Layout
    cells: ModelTree[Cells] | None
    border: Border
    groups: Groups | None
    start: AnyMap
    control: ControlNet
    warnings: tuple[str, ...]
    successions: Mapping[int, Succession]
    fits: Mapping[int, FitReport] = field(default_factory=dict)

    @property
    def spec(self) -> LatticeSpec:
        """The keys of the file."""
        return self.definition.spec

    @property
    def source(self) -> Source:
        """File and lines of the keys, for messages."""
        return self.definition.source

    @property
    def map(self) -> AnyMap:
        """The deformation, all edits applied."""
        return self.control.map

    @property
    def volume(self) -> Volume:
        """The map as a volume of polynomial or rational pieces.

        Raises
        ------
        LatticeError
            It has no such pieces, and must be fitted first.
        """
        if self.map.needs_fit:
            message = "with `embedding: inverse` the deformation is no polynomial: fit it first"
            raise LatticeError(message, file=self.source.name)
        return self.map

    @property
    def points(self) -> Floats:
        """(nu, nv, nw, 3) control points in the lattice frame, all edits applied."""
        return self.control.points

    @property
    def weights(self) -> Floats:
        """(nu, nv, nw) weights of the control points; 1 at rest."""
        return self.control.weights

    @property
    def locked(self) -> Bools:
        """(nu, nv, nw) True for control points that are locked at crossed sides."""
        return self.border.locked

    @property
    def free(self) -> Bools:
        """(nu, nv, nw) True for control points that are neither locked nor hidden."""
        return ~(self.locked | self.start.hidden)

    @property
    def full_cells(self) -> Floats:
        """(m, 2, 3) corners of the octree's cells that hold part of the mesh, lattice frame."""
        if self.cells is None:
            return np.zeros((0, 2, 3))
        tree, box = self.cells.tree, self.layout.box
        ends = np.stack([tree.low, tree.high], axis=1)[self.cells.full]
        return np.asarray(box[0] + ends * (box[1] - box[0]) / tree.counts)

    @property
    def crossed(self) -> tuple[str, ...]:
        """Sides of the box that the mesh crosses or another box lies on, such as ``u_min``."""
        return self.border.crossed

    def with_points(self, points: Floats, weights: Floats) -> BoxLattice:
        """Replace control points and weights; locked ones are taken as they are given."""
        rest, interior = self.control.at_rest, self.control.interior
        return replace(self, control=control_net(rest, interior, points, weights))

    def scaled(self, share: float) -> BoxLattice:
        """Control points and weights between rest (0) and edited (1), linearly.

        Raises
        ------
        LatticeError
            ``share`` is not finite, or so far outside 0 to 1 that a weight is not positive.
        """
        if not np.isfinite(share):
            raise LatticeError(f"a lattice cannot be scaled by {share}", file=self.source.name)
        if share == 1:
            return self
        rest = self.control.at_rest
        points = rest.rest_points + share * (self.points - rest.rest_points)
        weights = rest.rest_weights + share * (self.weights - rest.rest_weights)
        if not np.all(weights > 0):
            message = f"scaling the lattice by {share:g} makes weights zero or negative"
            raise LatticeError(message, file=self.source.name, hint="stay between 0 and 1")
        return self.with_points(points, weights)

    def with_net(self, net: Floats) -> BoxLattice:
        """Replace the control net by another in the frame and the form of ``volume.net``.

        Parameters
        ----------
        net : (nu, nv, nw, 3 or 4) float64
            Control points, all weights 1; or, for `volume: nurbs`, homogeneous control points
            ``(wx, wy, wz, w)``.

        Raises
        ------
        LatticeError
            The net has another shape, holds numbers that are not finite or weights that are not
            positive, or displaces locked control points.
        """
        rest = self.control.at_rest
        net = np.asarray(net, dtype=np.float64)
        forms = [(*rest.shape, 3)] + [(*rest.shape, 4)] * self.spec.weighted
        if net.shape not in forms or not np.isfinite(net).all():
            wanted = " or ".join(map(str, forms))
            message = f"a control net here is {wanted} finite numbers, not {net.shape}"
            raise LatticeError(message, file=self.source.name)
        if net.shape[-1] == 3:
            return self.with_control(net, rest.rest_weights)
        if not np.all(net[..., 3] > 0):
            message = "the net holds a weight that is not greater than 0"
            raise LatticeError(message, file=self.source.name)
        return self.with_control(net[..., :3] / net[..., 3:], net[..., 3])

    def with_control(self, points: Floats, weights: Floats) -> BoxLattice:
        """Replace the control points (nu, nv, nw, 3) and weights (nu, nv, nw).

        Raises
        ------
        LatticeError
            A locked control point is not at rest.
        """
        rest, border = self.control.at_rest, self.border
        displaced, points = restore_locked_points(points, rest.rest_points, border, self.layout.box)
        if displaced.any():
            message = f"the net displaces {describe_locked(displaced, border)}"
            raise LatticeError(message, file=self.source.name)
        changed, weights = restore_locked_weights(weights, rest.rest_weights, border)
        if changed.any():
            message = f"the net changes the weight of {describe_locked(changed, border)}"
            raise LatticeError(message, file=self.source.name)
        return self.with_points(points, weights)

    def with_volume(self, volume: AdaptiveVolume) -> BoxLattice:
        """Replace the volume by a hierarchical one that was fitted to it, in the same box.

        At crossed sides no function of it reaches out of the box, so nothing need be locked there.
        """
        nothing = np.zeros((6, *volume.shape), dtype=bool)
        rest = volume.with_net(np.zeros_like(volume.net))
        points = rest.rest_points + volume.net
        return replace(
            self,
            border=replace(self.border, held=nothing),
            start=rest,
            control=ControlNet(rest, self.control.interior, points, rest.rest_weights, volume),
        )
