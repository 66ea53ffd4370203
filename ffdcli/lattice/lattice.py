"""The lattice: a file's spec, settled by a mesh, and the volume that its edits lead to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ffdcli.errors import LatticeError
from ffdcli.lattice.border import Border, crossed_sides, lock_layers
from ffdcli.lattice.layout import Interior, Layout, lay_out, volume_at_rest
from ffdcli.lattice.load import load_spec
from ffdcli.lattice.nets import load_nets
from ffdcli.lattice.solve import describe_locked, require_locked_at_rest, solve
from ffdcli.lattice.source import Source
from ffdcli.lattice.spec import LatticeSpec
from ffdcli.volume.bspline import BSplineVolume

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Settled:
    """What a mesh settles: the box, the locked layers, and so the edits.

    Parameters
    ----------
    layout : Layout
    border : Border
    volume : BSplineVolume
        Knots and control net after all edits.
    interior : three float64 arrays
        Interior knots as fractions of the box.
    warnings : tuple of str
    """

    layout: Layout
    border: Border
    volume: BSplineVolume
    interior: Interior
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Lattice:
    """A lattice file, read; immutable.

    Parameters
    ----------
    spec : LatticeSpec
        The file as a model.
    source : Source
        Where it was read, for messages.
    nets : mapping of int to (nu, nv, nw, 3) float64
        Control nets of the `net` edits, by the edit's number.
    settled : Settled or None
        None until :meth:`settle` has been told the mesh.
    """

    spec: LatticeSpec
    source: Source
    nets: Mapping[int, Floats]
    settled: Settled | None = None

    @property
    def unit(self) -> str | None:
        """Length unit that the file states."""
        return self.spec.unit

    @property
    def volume(self) -> BSplineVolume:
        """The deforming volume, all edits applied.

        Raises
        ------
        LatticeError
            The lattice was read without a mesh, so its box or its borders are open.
        """
        return self._require_settled().volume

    @property
    def locked(self) -> Bools:
        """(nu, nv, nw) True for control points that hold the join where the mesh leaves the box."""
        return self._require_settled().border.locked

    @property
    def crossed(self) -> tuple[str, ...]:
        """Sides of the box that the mesh crosses, such as ``u_min``."""
        return self._require_settled().border.crossed

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know about how the edits were applied."""
        return self.settled.warnings if self.settled else ()

    def settle(self, *, bounds: Floats, triangles: Floats, delta: float) -> Lattice:
        """The lattice fitted to a mesh: `box: auto`, locked layers, edits applied.

        Parameters
        ----------
        bounds : (2, 3) float64, model length
            Bounding box of the mesh.
        triangles : (T, 3, 3) float64, model length
            The mesh's polygons as triangles.
        delta : float, model length
            Distance within which points count as coplanar (design, section 4).

        Raises
        ------
        LatticeError
            The box has no extent, or an edit cannot be applied; names the edit.
        """
        layout = lay_out(self.spec, self.source, bounds, delta)
        local = layout.frame.to_local(triangles)
        border = lock_layers(self.spec, crossed_sides(local, layout.box, delta))
        solved = solve(self.spec, self.source, layout, border, self.nets)
        warnings = (*_placement_warnings(local, layout.box), *solved.warnings)
        settled = Settled(layout, border, solved.volume, solved.interior, warnings)
        return replace(self, settled=settled)

    def scaled(self, share: float) -> Lattice:
        """The lattice part of the way: control points linearly from rest (0) to edited (1).

        Raises
        ------
        LatticeError
            The lattice is not settled, or ``share`` is not finite.
        """
        settled = self._require_settled()
        if not np.isfinite(share):
            raise LatticeError(f"a lattice cannot be scaled by {share}", file=self.source.name)
        if share == 1:
            return self
        rest = self._rest_net(settled)
        net = rest + share * (settled.volume.net - rest)
        return replace(self, settled=replace(settled, volume=settled.volume.with_net(net)))

    def with_net(self, net: Floats) -> Lattice:
        """The lattice with another control net (nu, nv, nw, 3), in the frame of ``volume.net``.

        Raises
        ------
        LatticeError
            The lattice is not settled; the net has another shape, holds numbers that are not
            finite, or displaces locked control points.
        """
        settled = self._require_settled()
        net = np.asarray(net, dtype=np.float64)
        if net.shape != settled.volume.net.shape or not np.isfinite(net).all():
            wanted = settled.volume.net.shape
            message = f"a control net here is {wanted} finite numbers, not {net.shape}"
            raise LatticeError(message, file=self.source.name)
        displaced, kept = require_locked_at_rest(
            net, self._rest_net(settled), settled.border, settled.layout.box
        )
        if displaced.any():
            message = f"the net displaces {describe_locked(displaced, settled.border)}"
            raise LatticeError(message, file=self.source.name)
        return replace(self, settled=replace(settled, volume=settled.volume.with_net(kept)))

    def _rest_net(self, settled: Settled) -> Floats:
        return volume_at_rest(self.spec, settled.layout, settled.interior).net

    def _require_settled(self) -> Settled:
        if self.settled is not None:
            return self.settled
        what = "its box is automatic" if self.spec.box == "auto" else "its borders depend on it"
        raise LatticeError(
            f"the lattice needs a mesh before it can be used: {what}",
            file=self.source.name,
            hint="give the mesh too, as in read_lattice(path, mesh)",
        )


def load_lattice(path: str | Path) -> Lattice:
    """Read and check a lattice file and the control nets it names; no mesh is needed yet.

    Raises
    ------
    FileError
        The file cannot be read.
    LatticeError
        It is no valid lattice file; names line and key.
    """
    spec, source = load_spec(path)
    return Lattice(spec, source, load_nets(spec, source))


def _placement_warnings(triangles: Floats, box: Floats) -> list[str]:
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    if np.any(low > box[1]) or np.any(high < box[0]):
        return ["the lattice box lies beside the mesh: nothing is deformed"]
    return []
