"""One settled box of control points: scaled, dragged, given another control net."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.border import Border
from ffdcli.lattice.drag.holds import Groups
from ffdcli.lattice.drag.requests import DragOptions, drag_points
from ffdcli.lattice.drag.solutions import Succession
from ffdcli.lattice.edit.solve import ControlNet
from ffdcli.lattice.file.definition import Definition
from ffdcli.lattice.file.pairs import PairTable
from ffdcli.lattice.file.source import Source
from ffdcli.lattice.file.spec import LatticeSpec
from ffdcli.lattice.layout import Layout, interior_fractions, map_at_rest
from ffdcli.lattice.locked import describe_locked, require_locked_at_rest, require_locked_weights
from ffdcli.volume.adaptive.inverse_map import AnyMap
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from ffdcli.volume.protocol import Volume


@dataclass(frozen=True, eq=False)
class BoxLattice:
    """A lattice settled by a mesh; immutable.

    Parameters
    ----------
    definition : Definition
        What the file says.
    layout : Layout
        Box and frame, and the cells of an octree.
    border : Border
        Locked layers of control points.
    groups : mapping of str to (T, 3, 3) float64, or None
        Triangles of the mesh's groups, model coordinates; None where they are not known.
    control : ControlNet
        Control points, weights and knots, all edits applied.
    map : AnyMap
        The map of that control net.
    warnings : tuple of str
        Warnings about the box and the edits.
    successions : mapping of int to Succession
        Single-point drags that the `drag` edits consist of, by the edit's number.
    """

    definition: Definition
    layout: Layout
    border: Border
    groups: Groups | None
    control: ControlNet
    map: AnyMap
    warnings: tuple[str, ...]
    successions: Mapping[int, Succession]

    @property
    def spec(self) -> LatticeSpec:
        """The keys of the file."""
        return self.definition.spec

    @property
    def source(self) -> Source:
        """File and lines of the keys, for messages."""
        return self.definition.source

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
    def crossed(self) -> tuple[str, ...]:
        """Sides of the box that the mesh crosses or another box lies on, such as ``u_min``."""
        return self.border.crossed

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
        return self._changed(points, weights)

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
        rest = self.control.at_rest
        displaced, kept = require_locked_at_rest(
            points, rest.rest_points, self.border, self.layout.box
        )
        if displaced.any():
            message = f"the net displaces {describe_locked(displaced, self.border)}"
            raise LatticeError(message, file=self.source.name)
        changed, kept_weights = require_locked_weights(weights, rest.rest_weights, self.border)
        if changed.any():
            message = f"the net changes the weight of {describe_locked(changed, self.border)}"
            raise LatticeError(message, file=self.source.name)
        return self._changed(kept, kept_weights)

    def with_volume(self, volume: AdaptiveVolume) -> BoxLattice:
        """Replace the volume by a hierarchical one that was fitted to it; nothing is locked."""
        rest = volume.with_net(np.zeros_like(volume.net))
        points = rest.rest_points + volume.net
        return replace(
            self,
            layout=replace(self.layout, octree_map=rest),
            border=Border((0,) * 6, np.zeros((6, *volume.shape), dtype=bool)),
            control=ControlNet(points, rest.rest_weights, self.control.interior, rest),
            map=volume,
        )

    def drag(self, table: PairTable, options: DragOptions) -> BoxLattice:
        """Move points of the object to targets; see :meth:`ffdcli.lattice.lattice.Lattice.drag`.

        Raises
        ------
        LatticeError
        """
        done = drag_points(
            self.map,
            self.points,
            self.weights,
            table,
            options,
            places=self._places,
            locked=self.locked | self.control.at_rest.hidden,
            groups=self.groups,
            rational=self.spec.weighted,
            source=self.source,
        )
        moved = self._changed(done.points, done.weights)
        return replace(moved, warnings=(*self.warnings, *done.warnings))

    def _changed(self, points: Floats, weights: Floats) -> BoxLattice:
        control = replace(self.control, points=points, weights=weights)
        return replace(self, control=control, map=self.map.with_control(points, weights))

    def _places(self) -> Floats:
        """Control points before any edit, in the coordinates of selectors."""
        start = map_at_rest(self.spec, self.layout, interior_fractions(self.spec))
        return start.rest_points + self.layout.written_origin
