"""The lattice: a file's spec, settled by a mesh, and the volume that its edits lead to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.border import Border, crossed_sides, lock_layers, lock_octree
from ffdcli.lattice.drag.holds import Groups
from ffdcli.lattice.drag.requests import checked_pairs, drag_points
from ffdcli.lattice.drag.solutions import Succession
from ffdcli.lattice.edit.solve import solve
from ffdcli.lattice.file.pairs import PairTable
from ffdcli.lattice.file.source import Source
from ffdcli.lattice.file.spec import LatticeSpec
from ffdcli.lattice.layout import Interior, Layout, interior_fractions, lay_out, volume_at_rest
from ffdcli.lattice.locked import describe_locked, require_locked_at_rest, require_locked_weights
from ffdcli.lattice.octree_placement import (
    SmallestBox,
    finest_share,
    oriented_layout,
    principal_axes,
    with_octree,
)
from ffdcli.volume.adaptive.tlattice import TLattice
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from ffdcli.volume.bspline import BSplineVolume


@dataclass(frozen=True)
class Settled:
    """What a mesh settles: the box, the locked layers, and so the edits.

    Parameters
    ----------
    layout : Layout
    border : Border
    volume : BSplineVolume or AdaptiveVolume
        Knots and control net after all edits.
    points, weights : (nu, nv, nw, 3), (nu, nv, nw) float64
        Control points, in the lattice frame, and weights that the net is made of.
    interior : three float64 arrays
        Interior knots as fractions of the box.
    warnings : tuple of str
    successions : mapping of int to Succession
        Single-point drags that `drag` edits are made of, by the edit's number.
    groups : mapping of str to (T, 3, 3) float64, or None
        Triangles of the mesh's groups.
    """

    layout: Layout
    border: Border
    volume: BSplineVolume | AdaptiveVolume
    points: Floats
    weights: Floats
    interior: Interior
    warnings: tuple[str, ...]
    successions: Mapping[int, Succession]
    groups: Groups | None

    def with_control(self, points: Floats, weights: Floats) -> Settled:
        """The same with other control points and weights."""
        volume = self.volume.with_control(points, weights)
        return replace(self, volume=volume, points=points, weights=weights)


@dataclass(frozen=True, eq=False)
class Lattice:
    """A lattice file, read; immutable.

    Parameters
    ----------
    spec : LatticeSpec
        The file as a model.
    source : Source
        Where it was read, for messages.
    nets : mapping of int to (nu, nv, nw, 3) or (nu, nv, nw) float64
        Control nets and weights of the `net` and `weights` edits, by the edit's number.
    pairs : mapping of int to PairTable
        Pairs of the `drag` edits, likewise.
    cells : TLattice or None
        Cells that the file names instead of an octree.
    settled : Settled or None
        None until :meth:`settle` has been told the mesh.
    """

    spec: LatticeSpec
    source: Source
    nets: Mapping[int, Floats]
    pairs: Mapping[int, PairTable] = field(default_factory=dict)
    cells: TLattice | None = None
    settled: Settled | None = None

    @property
    def unit(self) -> str | None:
        """Length unit that the file states."""
        return self.spec.unit

    @property
    def volume(self) -> BSplineVolume | AdaptiveVolume:
        """The deforming volume, all edits applied.

        Raises
        ------
        LatticeError
            The lattice was read without a mesh, so its box or its borders are open.
        """
        return self._require_settled().volume

    @property
    def members(self) -> tuple[Lattice, ...]:
        """The lattice alone, as other lattice files hold several."""
        return (self,)

    @property
    def volumes(self) -> tuple[BSplineVolume | AdaptiveVolume, ...]:
        """The deforming volume alone, as other lattice files have several."""
        return (self.volume,)

    @property
    def points(self) -> Floats:
        """(nu, nv, nw, 3) control points in the lattice frame, all edits applied."""
        return self._require_settled().points

    @property
    def weights(self) -> Floats:
        """(nu, nv, nw) weights of the control points; 1 at rest."""
        return self._require_settled().weights

    @property
    def locked(self) -> Bools:
        """(nu, nv, nw) True for control points that hold the join where the mesh leaves the box."""
        return self._require_settled().border.locked

    @property
    def layout(self) -> Layout:
        """Box and frame, and for an octree its cells."""
        return self._require_settled().layout

    @property
    def crossed(self) -> tuple[str, ...]:
        """Sides of the box that the mesh crosses or another box lies on, such as ``u_min``."""
        return self._require_settled().border.crossed

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know about how the edits were applied."""
        return self.settled.warnings if self.settled else ()

    def settle(
        self,
        *,
        bounds: Floats,
        triangles: Floats,
        delta: float,
        groups: Groups | None = None,
        shared: frozenset[str] = frozenset(),
        smallest_box: SmallestBox | None = None,
    ) -> Lattice:
        """The lattice fitted to a mesh: `box: auto`, locked layers, edits applied.

        Parameters
        ----------
        bounds : (2, 3) float64, model length
            Bounding box of the mesh.
        triangles : (T, 3, 3) float64, model length
            The mesh's polygons as triangles.
        delta : float, model length
            Distance within which points count as coplanar (design, section 4).
        groups : mapping of str to (T, 3, 3) float64, model length
            Triangles of the mesh's named groups, for `hold: [{group: name}]`; any mapping will
            do, also one that works them out when asked. None where they are not known.
        shared : frozenset of str
            Sides of the box that another lattice's box lies on: locked like crossed ones.
        smallest_box : callable, optional
            Axes (3, 3) of the box of least volume round points (m, 3), for `region: minimum`.

        Raises
        ------
        LatticeError
            The box has no extent, or an edit cannot be applied; names the edit.
        """
        layout = self._lay_out(bounds, triangles, delta, smallest_box)
        local = layout.frame.to_local(triangles)
        if self.spec.adaptive:
            layout = with_octree(self.spec, self.source, layout, local, self.cells)
        if layout.volume is None:
            border = lock_layers(self.spec, crossed_sides(local, layout.box, delta), shared)
        else:
            crossed = crossed_sides(local, layout.volume.box, delta)
            border = lock_octree(layout.volume, crossed, shared)
        solved = solve(self.spec, self.source, layout, border, self.nets, self.pairs, groups, local)
        settled = Settled(
            layout,
            border,
            solved.volume,
            solved.points,
            solved.weights,
            solved.interior,
            (*_placement_warnings(local, layout.box), *solved.warnings),
            solved.successions,
            groups,
        )
        return replace(self, settled=settled)

    def _lay_out(
        self, bounds: Floats, triangles: Floats, delta: float, smallest: SmallestBox | None
    ) -> Layout:
        octree = self.spec.octree
        finest = finest_share(self.spec, self.cells)
        if octree is None or octree.region == "auto":
            return lay_out(self.spec, self.source, bounds, delta, finest)
        if octree.region == "minimum" and smallest is None:
            message = "the box of least volume is not known here"
            raise self.source.error(("octree", "region"), message, "say `region: oriented`")
        return oriented_layout(self.spec, triangles, delta, smallest or principal_axes, finest)

    def scaled(self, share: float) -> Lattice:
        """The lattice part of the way: control points and weights from rest (0) to edited (1).

        Both run linearly, so that a control point's path is a straight line.

        Raises
        ------
        LatticeError
            The lattice is not settled, ``share`` is not finite, or it goes so far beyond 0 and 1
            that a weight is no longer positive.
        """
        settled = self._require_settled()
        if not np.isfinite(share):
            raise LatticeError(f"a lattice cannot be scaled by {share}", file=self.source.name)
        if share == 1:
            return self
        at_rest = self._at_rest(settled)
        rest, ones = at_rest.rest_points, at_rest.rest_weights
        points = rest + share * (settled.points - rest)
        weights = ones + share * (settled.weights - ones)
        if not np.all(weights > 0):
            message = f"scaling the lattice by {share:g} makes weights zero or negative"
            raise LatticeError(message, file=self.source.name, hint="stay between 0 and 1")
        return replace(self, settled=settled.with_control(points, weights))

    def with_net(self, net: Floats) -> Lattice:
        """The lattice with another control net, in the frame and the form of ``volume.net``.

        Parameters
        ----------
        net : (nu, nv, nw, 3 or 4) float64
            Control points, all weights 1; or, for `volume: nurbs`, homogeneous control points
            ``(wx, wy, wz, w)``.

        Raises
        ------
        LatticeError
            The lattice is not settled; the net has another shape, holds numbers that are not
            finite or weights that are not positive, or displaces locked control points.
        """
        at_rest = self._at_rest(self._require_settled())
        net = np.asarray(net, dtype=np.float64)
        counts = at_rest.shape
        forms = [(*counts, 3)] + [(*counts, 4)] * self.spec.weighted
        if net.shape not in forms or not np.isfinite(net).all():
            wanted = " or ".join(map(str, forms))
            message = f"a control net here is {wanted} finite numbers, not {net.shape}"
            raise LatticeError(message, file=self.source.name)
        if net.shape[-1] == 3:
            return self.with_control(net, at_rest.rest_weights)
        if not np.all(net[..., 3] > 0):
            message = "the net holds a weight that is not greater than 0"
            raise LatticeError(message, file=self.source.name)
        return self.with_control(net[..., :3] / net[..., 3:], net[..., 3])

    def with_control(self, points: Floats, weights: Floats) -> Lattice:
        """The lattice with other control points (nu, nv, nw, 3) and weights (nu, nv, nw).

        Raises
        ------
        LatticeError
            The lattice is not settled, or a locked control point is not at rest.
        """
        settled = self._require_settled()
        border = settled.border
        displaced, kept = require_locked_at_rest(
            points, self._at_rest(settled).rest_points, border, settled.layout.box
        )
        if displaced.any():
            message = f"the net displaces {describe_locked(displaced, border)}"
            raise LatticeError(message, file=self.source.name)
        rest_weights = self._at_rest(settled).rest_weights
        changed, kept_weights = require_locked_weights(weights, rest_weights, border)
        if changed.any():
            message = f"the net changes the weight of {describe_locked(changed, border)}"
            raise LatticeError(message, file=self.source.name)
        return replace(self, settled=settled.with_control(kept, kept_weights))

    def with_volume(self, volume: AdaptiveVolume) -> Lattice:
        """The lattice with a hierarchical volume in the place of its own, which it stands for."""
        settled = self._require_settled()
        rest = volume.with_net(np.zeros_like(volume.net))
        border = Border((0,) * 6, np.zeros((6, *volume.shape), dtype=bool))
        settled = replace(
            settled,
            layout=replace(settled.layout, volume=rest),
            border=border,
            volume=volume,
            points=rest.rest_points + volume.net,
            weights=rest.rest_weights,
        )
        return replace(self, settled=settled)

    def drag(
        self,
        sources: Any,
        targets: Any,
        *,
        by: bool = False,
        pin: Bools | Sequence[Any] | None = None,
        hold: Sequence[Any] = (),
        vary: Literal["points", "weights"] = "points",
        on_conflict: Literal["error", "least_squares"] = "error",
        level_cost: float = 1.0,
    ) -> Lattice:
        """A new lattice that takes points of the object to targets, control points moved least.

        Fast enough to be called while a mouse moves: only the control points that reach the
        sources are touched. Drags by displacement commute; drags to targets at different points
        do not, since each moves the other's image too.

        Parameters
        ----------
        sources : (m, 3) float, model coordinates
            Points of the undeformed object.
        targets : (m, 3) float, model coordinates
            Where their images must be; with ``by`` what the images are displaced by.
        by : bool
        pin : (nu, nv, nw) bool, or sequence of selectors as in a lattice file
            Control points that stay.
        hold : sequence of mappings, as in a lattice file
            ``{"point": [x, y, z]}``, ``{"inside": {"min": .., "max": ..}}`` or
            ``{"group": name}``, the last two with ``"rigid": True`` to move as one.
        vary : {"points", "weights"}
            Weights take ``volume: nurbs`` or ``tspline``.
        on_conflict : {"error", "least_squares"}
        level_cost : float
            ``volume: hierarchical``: how much more a move counts on each finer level.

        Raises
        ------
        LatticeError
            The lattice is not settled, the arrays do not fit together, or a target cannot be met:
            each is named with what it is missed by.

        Notes
        -----
        Hu et al. 2001, Eq. 7 and 12.
        """
        settled = self._require_settled()
        done = drag_points(
            settled.volume,
            settled.points,
            settled.weights,
            checked_pairs(sources, targets, by, self.source),
            places=self._places,
            locked=self._kept(settled),
            groups=settled.groups,
            pin=pin,
            hold=hold,
            vary=vary,
            on_conflict=on_conflict,
            level_cost=level_cost,
            rational=self.spec.weighted,
            source=self.source,
        )
        moved = settled.with_control(done.points, done.weights)
        if done.warnings:
            moved = replace(moved, warnings=(*settled.warnings, *done.warnings))
        return replace(self, settled=moved)

    def _kept(self, settled: Settled) -> Bools:
        """Control points that a drag may not move: locked or hidden ones."""
        at_rest = self._at_rest(settled)
        hidden = at_rest.hidden if isinstance(at_rest, AdaptiveVolume) else False
        return np.asarray(settled.border.locked | hidden)

    def _places(self) -> Floats:
        """Where control points rest before any edit, in the coordinates of selectors."""
        layout = self._require_settled().layout
        start = volume_at_rest(self.spec, layout, interior_fractions(self.spec))
        return start.rest_points + layout.written_origin

    def _at_rest(self, settled: Settled) -> BSplineVolume | AdaptiveVolume:
        return volume_at_rest(self.spec, settled.layout, settled.interior)

    def _require_settled(self) -> Settled:
        if self.settled is not None:
            return self.settled
        what = "its box is automatic" if self.spec.box == "auto" else "its borders depend on it"
        what = "its cells depend on it" if self.spec.adaptive else what
        raise LatticeError(
            f"the lattice needs a mesh before it can be used: {what}",
            file=self.source.name,
            hint="give the mesh too, as in read_lattice(path, mesh)",
        )


def _placement_warnings(triangles: Floats, box: Floats) -> list[str]:
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    if np.any(low > box[1]) or np.any(high < box[0]):
        return ["the lattice box lies beside the mesh: nothing is deformed"]
    return []
