"""The lattice that deforms a mesh: one or more boxes of control points that do not overlap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.file.source import Source
from ffdcli.volume.protocol import Volume

if TYPE_CHECKING:
    from ffdcli.lattice.fit.report import FitReport
    from ffdcli.volume.adaptive.inverse_map import AnyMap


@dataclass(frozen=True, eq=False)
class Lattice:
    """All lattices of a file, settled by a mesh; immutable.

    Parameters
    ----------
    members : tuple of BoxLattice
        In the order of the file.
    source : Source
        File and lines of the keys, for messages.
    """

    members: tuple[BoxLattice, ...]
    source: Source

    @property
    def unit(self) -> str | None:
        """Length unit that the file states."""
        return self.members[0].spec.unit

    @property
    def listed(self) -> bool:
        """Whether the file has the key `lattices`, a list."""
        return bool(self.members[0].source.root)

    @property
    def maps(self) -> tuple[AnyMap, ...]:
        """The map of each box, all edits applied."""
        return tuple(member.map for member in self.members)

    @property
    def needs_fit(self) -> bool:
        """Whether any of the maps has no polynomial or rational pieces."""
        return any(each.needs_fit for each in self.maps)

    @property
    def volumes(self) -> tuple[Volume, ...]:
        """The map of each box as a volume; see :attr:`BoxLattice.volume`."""
        return tuple(member.volume for member in self.members)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about boxes and edits."""
        return tuple(
            f"lattices[{number}]: {text}" if self.listed else text
            for number, member in enumerate(self.members)
            for text in member.warnings
        )

    @property
    def fits(self) -> tuple[FitReport, ...]:
        """What the fits of all boxes reached, in the order of the file."""
        return tuple(
            member.fits[number] for member in self.members for number in sorted(member.fits)
        )

    @property
    def member(self) -> BoxLattice:
        """The only box.

        Raises
        ------
        LatticeError
            There are several.
        """
        if len(self.members) > 1:
            message = f"this is about one lattice, but the file has {len(self.members)}"
            hint = "take one of `members`"
            raise LatticeError(message, file=self.source.name, hint=hint)
        return self.members[0]

    @property
    def volume(self) -> Volume:
        """The map of the only box as a volume; see :attr:`BoxLattice.volume`."""
        return self.member.volume

    @property
    def points(self) -> Floats:
        """Control points of the only box; see :attr:`BoxLattice.points`."""
        return self.member.points

    @property
    def weights(self) -> Floats:
        """Weights of the only box; see :attr:`BoxLattice.weights`."""
        return self.member.weights

    @property
    def locked(self) -> Bools:
        """Locked control points of the only box; see :attr:`BoxLattice.locked`."""
        return self.member.locked

    @property
    def crossed(self) -> tuple[str, ...]:
        """Locked sides of the only box; see :attr:`BoxLattice.crossed`."""
        return self.member.crossed

    def with_net(self, net: Floats) -> Lattice:
        """Replace the control net of the only box; see :meth:`BoxLattice.with_net`."""
        return self.with_member(0, self.member.with_net(net))

    def with_member(self, number: int, member: BoxLattice) -> Lattice:
        """Replace one box by an edited version of it."""
        members = list(self.members)
        members[number] = member
        return replace(self, members=tuple(members))

    def scaled(self, share: float) -> Lattice:
        """Control points and weights between rest (0) and edited (1).

        Both run linearly, so the path of a control point is a straight line.

        Raises
        ------
        LatticeError
            ``share`` is not finite, or so far outside 0 to 1 that a weight is not positive.
        """
        if share == 1:
            return self
        return replace(self, members=tuple(member.scaled(share) for member in self.members))

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
        """Move points of the object to targets, with the least move of control points.

        Each point is dragged by the box that it lies in. Only the control points that reach the
        sources are touched, so that this is fast enough to be called while a mouse moves. Drags by
        displacement commute; drags to targets at different points do not, since each moves the
        images of the others too.

        Parameters
        ----------
        sources : (m, 3) float, model coordinates
            Points of the undeformed object.
        targets : (m, 3) float, model coordinates
            Targets of their images; with ``by`` the displacements of their images.
        by : bool
        pin : (nu, nv, nw) bool, or sequence of selectors as in a lattice file
            Control points that stay.
        hold : sequence of mappings, as in a lattice file
            ``{"point": [x, y, z]}``, ``{"inside": {"min": .., "max": ..}}`` or
            ``{"group": name}``, the last two with ``"rigid": True`` to move as one.
        vary : {"points", "weights"}
            Weights need ``volume: nurbs`` or ``tspline``.
        on_conflict : {"error", "least_squares"}
        level_cost : float
            ``volume: hierarchical``: cost of a move on each finer level, relative to the coarser.

        Raises
        ------
        LatticeError
            The arrays do not fit together, a source lies in no box, or a target cannot be met:
            each is named with the distance that remains.

        Notes
        -----
        Hu et al. 2001, Eq. 7 and 12.
        """
        # Only drags need these libraries.
        from ffdcli.lattice.edit.drag_edit import checked_pairs, drag_by_python

        pairs = checked_pairs(sources, targets, by, self.source)
        options: dict[str, Any] = {"pin": pin, "hold": list(hold), "vary": vary}
        options |= {"on_conflict": on_conflict, "level_cost": level_cost}
        if len(self.members) == 1:
            return self.with_member(0, drag_by_python(self.members[0], pairs, options))
        dragged, free = self, np.ones(len(pairs.sources), dtype=bool)
        for number, member in enumerate(self.members):
            places = member.map.frame.to_local(pairs.sources)
            inside = free & member.map.contains(places)
            free &= ~inside
            if inside.any():
                moved = drag_by_python(member, pairs.take(inside), options)
                dragged = dragged.with_member(number, moved)
        if free.any():
            place = ", ".join(f"{value:g}" for value in pairs.sources[free][0])
            message = f"the point ({place}) lies in none of the lattice boxes"
            raise LatticeError(message, file=self.source.name, hint="drag points inside a box")
        return dragged

    def fit(
        self,
        sources: Any,
        targets: Any,
        *,
        by: bool = False,
        weights: Any = None,
        tolerance: float | None = None,
        smooth: float | Literal["auto"] = "auto",
        scale: float = 1.0,
        robust: bool = True,
        pin: Bools | Sequence[Any] | None = None,
        hold: Sequence[Any] = (),
    ) -> Lattice:
        """Move many points near their targets by least squares, as smoothly as the data allows.

        The only box of the lattice is fitted, and its octree stays as it is: cells are divided
        where a lattice file has `octree: {depth: auto}`. What the fit reached is the last of
        ``fits``.

        Parameters
        ----------
        sources : (m, 3) float, model coordinates
            Points of the undeformed object. Those outside the box are left out.
        targets : (m, 3) float, model coordinates
            Targets of their images; with ``by`` the displacements of their images.
        by : bool
        weights : (m,) float, optional
            Weights of the squared distances.
        tolerance, smooth, scale, robust
            As in the lattice file.
        pin : (nu, nv, nw) bool, or sequence of selectors as in a lattice file
            Control points that stay.
        hold : sequence of mappings, as in a lattice file

        Raises
        ------
        LatticeError
            The arrays do not fit together, no source lies in the box, or there are several boxes.
        """
        from ffdcli.lattice.edit.drag_edit import checked_pairs
        from ffdcli.lattice.edit.fit_edit import fit_by_python

        pairs = checked_pairs(sources, targets, by, self.source, weights)
        options: dict[str, Any] = {"tolerance": tolerance, "smooth": smooth, "scale": scale}
        options |= {"robust": robust, "pin": pin, "hold": list(hold)}
        return self.with_member(0, fit_by_python(self.member, pairs, options))
