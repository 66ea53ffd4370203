"""Parameters at which the image of a surface or curve is not smooth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.lattice import BoxLattice, Lattice
from ffdcli.lattice.border import SIDES
from ffdcli.splines.knots import KnotPlanes
from ffdcli.volume.frame import Frame
from ffdcli.volume.protocol import BoxMap

# Samples along an axis between which at most one crossing of each plane is looked for.
_SAMPLES = 65
# Steps of bisection, after which brackets are as short as rounding.
_HALVINGS = 52
# An iso-line lies in a plane if its points keep within this share of the size from it.
_FLAT = 1e-10
# Jumps of derivatives below this do not count.
_SMOOTH = 1e-7


@dataclass(frozen=True, eq=False)
class Planes:
    """Planes of one lattice box across which its map is C^continuity.

    Parameters
    ----------
    member : BoxLattice
    sides : six int
        Continuity across each side of the box: of the join to the identity where the part
        crosses the side, else of the continuation.
    """

    member: BoxLattice
    sides: tuple[int, ...]

    @cached_property
    def _everywhere(self) -> tuple[KnotPlanes, ...]:
        """The knot planes along each axis."""
        one: BoxMap = self.member.map
        return tuple(one.knot_planes(axis, one.box[None]) for axis in range(3))

    def across(self, axis: int, box: Floats) -> KnotPlanes:
        """The planes along an axis of the lattice frame within a box (2, 3) of that frame."""
        one: BoxMap = self.member.map
        # The planes of a tensor product are the same in all boxes.
        found = self._everywhere[axis] if one.knots else one.knot_planes(axis, box[None])
        values = np.concatenate([found.values[0], one.box[:, axis]])
        continuity = np.concatenate([found.continuity[0], self.sides[2 * axis : 2 * axis + 2]])
        within = (values >= box[0, axis]) & (values <= box[1, axis])
        return KnotPlanes(values[within], continuity[within])


def planes_of(lattice: Lattice) -> tuple[Planes, ...]:
    """The planes of all boxes of a lattice."""
    return tuple(
        Planes(member, tuple(_continuity(member, number) for number in range(6)))
        for member in lattice.members
    )


def _continuity(member: BoxLattice, side: int) -> int:
    """Continuity of a map and what goes on beyond a side of its box."""
    if SIDES[side] not in member.crossed:
        return 1
    axis, upper = divmod(side, 2)
    one: BoxMap = member.map
    shares = np.stack(np.meshgrid(*[np.linspace(0, 1, 9)] * 2), axis=-1).reshape(-1, 2)
    points = np.insert(shares, axis, upper, axis=1)
    extent = one.box[1] - one.box[0]
    if np.abs(one.jacobian(one.box[0] + points * extent) - np.eye(3)).max() > _SMOOTH:
        return 0
    step = 1e-4
    points[:, axis] += -step if upper else step
    bent = np.abs(one.jacobian(one.box[0] + points * extent) - np.eye(3)).max()
    # Where second derivatives vanish at the side, first ones grow with the square of the step.
    return 2 if bent <= 100 * step**2 else 1


def breaks_along(
    place: Callable[[Floats, Floats], Floats], planes: tuple[Planes, ...], size: float
) -> KnotPlanes:
    """Shares of one axis at which iso-lines lie in planes.

    Parameters
    ----------
    place : callable
        Model points (n, m, 3) at shares (n,) along the axis and (m,) across it; one share across
        it serves a curve.
    planes : tuple of Planes
    size : float, model length
    """
    shares, across = np.linspace(0, 1, _SAMPLES), np.linspace(0, 1, 9)
    samples = place(shares, across)
    values, continuity = [np.zeros(0)], [np.zeros(0, dtype=np.int64)]
    for each in planes:
        frame = each.member.map.frame
        local = frame.to_local(samples)
        box = np.stack([local.min(axis=(0, 1)), local.max(axis=(0, 1))])
        for axis in range(3):
            heights = local[:, :, axis]
            if np.ptp(heights, axis=1).max() > _FLAT * size:
                continue
            found = each.across(axis, box)
            if not len(found.values):
                continue

            def height(at: Floats, axis: int = axis, frame: Frame = frame) -> Floats:
                return frame.to_local(place(at, across[4:5]))[:, 0, axis]

            roots, which = _crossings(height, shares, heights[:, 4], found.values)
            values.append(roots)
            continuity.append(found.continuity[which])
    return KnotPlanes(np.concatenate(values), np.concatenate(continuity))


def _crossings(
    height: Callable[[Floats], Floats], shares: Floats, heights: Floats, levels: Floats
) -> tuple[Floats, Ints]:
    """Shares (k,) at which a function crosses levels, and the level (k,) of each."""
    off = heights[:, None] - levels
    at, which = np.nonzero((off[:-1] <= 0) != (off[1:] <= 0))
    low, high = shares[at], shares[at + 1]
    if not len(at):
        return low, which
    level, rising = levels[which], off[at, which] <= 0
    # Straight pieces, as of planes and along cylinders, need no search.
    first, last = off[at, which], off[at + 1, which]
    root = low - first * (high - low) / (last - first)
    scale = 4 * np.finfo(float).eps * np.abs(heights).max()
    if (np.abs(height(root) - level) <= scale).all():
        return root, which
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        below = (height(middle) <= level) == rising
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return (low + high) / 2, which
