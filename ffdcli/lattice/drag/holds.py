"""What the holds of a drag mean for control points: boxes and groups that stay or move as one."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.drag.reach import reaching_box, reaching_triangles
from ffdcli.lattice.file.drag_models import Hold, HoldInside, HoldPoint
from ffdcli.lattice.file.source import Source
from ffdcli.volume.protocol import LatticeMap

Groups = Mapping[str, Floats]


@dataclass(frozen=True)
class RigidPiece:
    """Control points of a part that moves as one.

    Parameters
    ----------
    members : (nu, nv, nw) or (n,) bool
        No two pieces share any.
    level : int
        The level that carries the motion; members of others turn what they have moved by.
    """

    members: Bools
    level: int


@dataclass(frozen=True)
class Held:
    """Control points that holds of boxes and groups concern.

    Parameters
    ----------
    fixed : (nu, nv, nw) bool
        Those that reach a part that stays.
    pieces : tuple of RigidPiece
        Those that reach a part that moves as one.
    warnings : tuple of str
    """

    fixed: Bools
    pieces: tuple[RigidPiece, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def any(self) -> bool:
        """True where a box or group is held."""
        return bool(self.fixed.any()) or bool(self.pieces)


@dataclass(frozen=True)
class _Part:
    """What reaches a held part: control points, and boxes (m, 2, 3) round it in lattice frame."""

    numbers: tuple[int, ...]
    reached: Bools
    boxes: Floats

    def joined(self, other: _Part) -> _Part:
        return _Part(
            tuple(sorted((*self.numbers, *other.numbers))),
            self.reached | other.reached,
            np.concatenate([self.boxes, other.boxes]),
        )


def resolve_holds(
    holds: Sequence[Hold],
    volume: LatticeMap,
    points: Floats,
    pinned: Bools,
    groups: Groups | None,
    source: Source,
) -> Held:
    """Control points of all held boxes and groups.

    Parameters
    ----------
    holds : sequence of Hold
    volume : LatticeMap
        For its knots.
    points : (nu, nv, nw, 3) float64
        Control points.
    pinned : (nu, nv, nw) bool
        Control points that stay anyway.
    groups : mapping of str to (T, 3, 3) float64, or None
        Triangles of the mesh's groups, model coordinates; None where they are not known.
    source : Source
        For messages; key paths count from the drag.

    Raises
    ------
    LatticeError
        A group is not there, or a piece cannot move as one.
    """
    fixed = np.zeros(volume.shape, dtype=bool)
    parts: list[_Part] = []
    warnings = []
    for index, hold in enumerate(holds):
        if isinstance(hold, HoldPoint):
            continue
        if isinstance(hold, HoldInside):
            low, high = np.array(hold.inside.min), np.array(hold.inside.max)
            reached = reaching_box(volume, low, high)
            span = np.array(list(itertools.product(*np.stack([low, high], axis=1))))[None]
        else:
            span = _triangles(hold.group, index, groups, source)
            reached = reaching_triangles(volume, span)
        if not reached.any():
            message = "lies outside the lattice box, where nothing moves"
            if hold.rigid:
                raise source.error(
                    ("hold", index), message, "enlarge the `box`, or leave `rigid` out"
                )
            warnings.append(f"hold[{index}] {message}")
        if not hold.rigid:
            fixed |= reached
        else:
            local = volume.frame.to_local(span)
            boxes = np.stack([local.min(axis=1), local.max(axis=1)], axis=1)
            parts.append(_Part((index,), reached, boxes))
    parts, pieces = _merge(parts, volume, points, source)
    for part, piece in zip(parts, pieces, strict=True):
        _require_loose(part.numbers[0], piece.members, fixed, pinned, source)
    for part, piece in zip(parts, pieces, strict=True):
        fixed |= part.reached & ~piece.members
    return Held(fixed, tuple(pieces), (*warnings, *_said(parts)))


def _piece(part: _Part, volume: LatticeMap, points: Floats, source: Source) -> RigidPiece:
    """Those of the control points of a part that a rigid motion of it moves."""
    level = volume.complete_level(part.boxes)
    if level is None:
        message = "cannot move as one: it reaches out of the lattice box"
        raise source.error(
            ("hold", part.numbers[0]), message, "enlarge the `box`, or leave `rigid` out"
        )
    # Others turn what they have moved by; where that is nothing they stay.
    moved = np.any(points != volume.rest_points, axis=-1)
    return RigidPiece(part.reached & ((volume.levels == level) | moved), level)


def _triangles(name: str, index: int, groups: Groups | None, source: Source) -> Floats:
    if groups is None:
        message = "groups of the mesh are not known here"
        raise source.error(("hold", index), message, "hold a box: {inside: {min, max}}")
    if name not in groups:
        known = ", ".join(sorted(groups)) or "none"
        raise source.error(
            ("hold", index), f"the mesh has no group `{name}`", f"its groups: {known}"
        )
    return groups[name]


def _require_loose(index: int, piece: Bools, fixed: Bools, pinned: Bools, source: Source) -> None:
    """A rigid piece must have all its control points to itself."""
    reason = "belong to a part that is held fixed" if (piece & fixed).any() else ""
    reason = "are locked or pinned" if (piece & pinned).any() else reason
    if reason:
        place = np.argwhere(piece & (fixed | pinned))[0].tolist()
        message = f"cannot move as one: control points that reach it {reason}, the first is {place}"
        raise source.error(
            ("hold", index), message, "use more `points` or a larger `box`, or leave `rigid` out"
        )


def _merge(
    parts: list[_Part], volume: LatticeMap, points: Floats, source: Source
) -> tuple[list[_Part], list[RigidPiece]]:
    """Pieces that share control points move together; together they may share more with others."""
    pieces = [_piece(part, volume, points, source) for part in parts]
    for first, second in itertools.combinations(range(len(parts)), 2):
        if (pieces[first].members & pieces[second].members).any():
            others = [part for n, part in enumerate(parts) if n not in (first, second)]
            joined = parts[first].joined(parts[second])
            return _merge([*others, joined], volume, points, source)
    return parts, pieces


def _said(parts: Sequence[_Part]) -> list[str]:
    return [
        f"{' and '.join(f'hold[{n}]' for n in part.numbers)} share control points: they move as one"
        for part in parts
        if len(part.numbers) > 1
    ]
