"""Where folds are searched for: the model in a lattice box, or the whole box."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, gather_runs
from ffdcli.volume.protocol import LatticeMap


class SearchDomain(Protocol):
    """A closed part of the lattice box, in the lattice frame, bounded by triangles."""

    @property
    def bounds(self) -> Floats:
        """(2, 3) corners of a box around it, within the lattice box."""
        ...

    @property
    def samples(self) -> Floats:
        """(n, 3) sample points of it."""
        ...

    def slopes(self, volume: LatticeMap) -> Floats:
        """(n, 3, 3) derivatives of a map at the samples, as its ``jacobian`` gives them."""
        ...

    def touching(self, low: Floats, high: Floats, among: Ints | None) -> Ints:
        """Pairs (n, 2) of a box and a triangle of its surface that meet, sorted by box.

        Parameters
        ----------
        low, high : (m, 3) float64
            The boxes.
        among : (n, 2) int64 or None
            Candidate pairs, sorted by box; None for all.

        Returns
        -------
        (n, 2) int64
            All pairs that meet, and possibly some that do not.
        """
        ...

    def holds(self, points: Floats) -> Bools:
        """(n,) True for points (n, 3) inside it; none of them lies on the surface."""
        ...

    def nearest(self, pairs: Ints, points: Floats) -> Floats:
        """(n, 3) points of the pairs' triangles nearest to points (n, 3)."""
        ...


def in_model(
    domain: SearchDomain, low: Floats, high: Floats, deep: Bools, among: Ints | None
) -> tuple[Bools, Bools, Ints]:
    """Find the boxes that meet the model, and those that lie wholly in it.

    A box that the surface does not touch lies wholly inside or wholly outside.

    Parameters
    ----------
    low, high : (m, 3) float64
        The boxes; equal ones may occur.
    deep : (m,) bool
        Boxes known to lie wholly in the model.
    among : (n, 2) int64 or None
        As for :meth:`SearchDomain.touching`.

    Returns
    -------
    (m,) bool
        Boxes that meet the model.
    (m,) bool
        Those that lie wholly in it.
    (n, 2) int64
        Pairs of boxes and triangles that meet; see :meth:`SearchDomain.touching`.
    """
    if among is None:
        pairs = domain.touching(low, high, None)
    else:
        pairs = domain.touching(low, high, among) if len(among) else among
    touched = np.zeros(len(low), dtype=bool)
    touched[pairs[:, 0]] = True
    alone = np.flatnonzero(~touched & ~deep)
    deep = deep.copy()
    # Equal boxes are tested once.
    middle, which = np.unique((low[alone] + high[alone]) / 2, axis=0, return_inverse=True)
    deep[alone] = domain.holds(middle)[which.reshape(-1)]
    return touched | deep, deep, pairs


def repeat_pairs(pairs: Ints, count: int, chosen: Ints) -> Ints:
    """Pairs (n, 2) of ``count`` boxes, sorted by box, renumbered for the chosen boxes (m,)."""
    starts = np.searchsorted(pairs[:, 0], np.arange(count + 1))
    new_starts, index = gather_runs(starts, chosen)
    owner = np.repeat(np.arange(len(chosen)), np.diff(new_starts))
    return np.column_stack([owner, pairs[index, 1]])


@dataclass(frozen=True)
class WholeBox:
    """A whole box as a domain; it has no surface.

    Parameters
    ----------
    bounds : (2, 3) float64
    """

    bounds: Floats

    @property
    def samples(self) -> Floats:
        """(9, 3) corners and centre of the box."""
        shares = np.array([*product((0.0, 1.0), repeat=3), (0.5, 0.5, 0.5)])
        return np.asarray(self.bounds[0] + shares * (self.bounds[1] - self.bounds[0]))

    def slopes(self, volume: LatticeMap) -> Floats:
        """(9, 3, 3) derivatives at the samples."""
        return volume.jacobian(self.samples)

    def touching(self, low: Floats, high: Floats, among: Ints | None) -> Ints:
        """No pairs."""
        return np.empty((0, 2), dtype=np.int64)

    def holds(self, points: Floats) -> Bools:
        """(n,) True: only points of the box are asked for."""
        return np.ones(len(points), dtype=bool)

    def nearest(self, pairs: Ints, points: Floats) -> Floats:
        """(0, 3), as there are no pairs."""
        return points[: len(pairs)]
