"""What the holds of a drag mean for control points: boxes and groups that stay or move as one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ffdcli.errors import LatticeError
from ffdcli.lattice.drag_models import Hold, HoldInside, HoldPoint
from ffdcli.lattice.reach import reaching_box, reaching_triangles
from ffdcli.volume.protocol import Volume

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

Groups = Mapping[str, Floats]
Fault = Callable[[int, str, str | None], LatticeError]


@dataclass(frozen=True)
class Held:
    """Control points that holds of boxes and groups concern.

    Parameters
    ----------
    fixed : (nu, nv, nw) bool
        Those that reach a part that stays.
    pieces : tuple of (nu, nv, nw) bool
        Those that reach a part that moves as one; no two pieces share any.
    warnings : tuple of str
    """

    fixed: Bools
    pieces: tuple[Bools, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def any(self) -> bool:
        """True where a box or group is held."""
        return bool(self.fixed.any()) or bool(self.pieces)


def resolve_holds(
    holds: Sequence[Hold],
    volume: Volume,
    pinned: Bools,
    groups: Groups | None,
    fault: Fault,
) -> Held:
    """Control points of all held boxes and groups.

    Parameters
    ----------
    holds : sequence of Hold
    volume : Volume
        For its knots.
    pinned : (nu, nv, nw) bool
        Control points that stay anyway.
    groups : mapping of str to (T, 3, 3) float64, or None
        Triangles of the mesh's groups, model coordinates; None where they are not known.
    fault : callable
        The error to raise: number of the hold, message, hint.

    Raises
    ------
    LatticeError
        A group is not there, or a piece cannot move as one.
    """
    fixed = np.zeros(volume.shape, dtype=bool)
    pieces: list[tuple[int, Bools]] = []
    warnings = []
    for index, hold in enumerate(holds):
        if isinstance(hold, HoldPoint):
            continue
        if isinstance(hold, HoldInside):
            reached = reaching_box(volume, np.array(hold.inside.min), np.array(hold.inside.max))
        else:
            triangles = _triangles(hold.group, index, groups, fault)
            reached = reaching_triangles(volume, triangles)
        if not reached.any():
            message = "lies outside the lattice box, where nothing moves"
            if hold.rigid:
                raise fault(index, message, "enlarge the `box`, or leave `rigid` out")
            warnings.append(f"hold[{index}] {message}")
        if hold.rigid:
            pieces.append((index, reached))
        else:
            fixed |= reached
    for index, piece in pieces:
        _require_loose(index, piece, fixed, pinned, fault)
    merged, said = _merge(pieces)
    return Held(fixed, merged, (*warnings, *said))


def _triangles(name: str, index: int, groups: Groups | None, fault: Fault) -> Floats:
    if groups is None:
        message = "groups of the mesh are not known here"
        raise fault(index, message, "hold a box: {inside: {min, max}}")
    if name not in groups:
        known = ", ".join(sorted(groups)) or "none"
        raise fault(index, f"the mesh has no group `{name}`", f"its groups: {known}")
    return groups[name]


def _require_loose(index: int, piece: Bools, fixed: Bools, pinned: Bools, fault: Fault) -> None:
    """A rigid piece must have all its control points to itself."""
    reason = "belong to a part that is held fixed" if (piece & fixed).any() else ""
    reason = "are locked or pinned" if (piece & pinned).any() else reason
    if reason:
        place = np.argwhere(piece & (fixed | pinned))[0].tolist()
        message = f"cannot move as one: control points that reach it {reason}, the first is {place}"
        raise fault(index, message, "use more `points` or a larger `box`, or leave `rigid` out")


def _merge(pieces: list[tuple[int, Bools]]) -> tuple[tuple[Bools, ...], list[str]]:
    """Pieces that share control points move together."""
    merged: list[tuple[list[int], Bools]] = []
    for index, piece in pieces:
        apart = [each for each in merged if not (each[1] & piece).any()]
        joined = [each for each in merged if (each[1] & piece).any()]
        numbers = sorted([index, *(number for each in joined for number in each[0])])
        union = np.logical_or.reduce([piece, *(each[1] for each in joined)])
        merged = [*apart, (numbers, union)]
    said = [
        f"{' and '.join(f'hold[{n}]' for n in numbers)} share control points: they move as one"
        for numbers, _ in merged
        if len(numbers) > 1
    ]
    return tuple(piece for _, piece in merged), said
