"""Holds of boxes and groups: the control points that they fix, or move rigidly."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.file.drag_models import Hold, HoldInside, HoldPoint
from ffdcli.lattice.file.source import Source
from ffdcli.volume.convex_overlap import touches_boxes, triangle_directions
from ffdcli.volume.protocol import LatticeMap

Groups = Mapping[str, Floats]


@dataclass(frozen=True)
class RigidPiece:
    """Control points of a part that moves as a rigid body.

    Parameters
    ----------
    members : (nu, nv, nw) or (n,) bool
        Control points of the piece; no two pieces share any.
    level : int
        Level whose control points follow the motion. On other levels the displacements from rest
        rotate with it.
    """

    members: Bools
    level: int


@dataclass(frozen=True)
class Held:
    """Control points that held boxes and groups fix or move rigidly.

    Parameters
    ----------
    fixed : (nu, nv, nw) bool
        Control points that reach a fixed part.
    pieces : tuple of RigidPiece
        Control points that reach a rigid part.
    warnings : tuple of str
    """

    fixed: Bools
    pieces: tuple[RigidPiece, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def any(self) -> bool:
        """Whether a box or group is held."""
        return bool(self.fixed.any()) or bool(self.pieces)


@dataclass(frozen=True)
class _Part:
    """Held parts by number, control points that reach them, and boxes (m, 2, 3) round them."""

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
    """Find the control points that all held boxes and groups fix or move rigidly.

    Parameters
    ----------
    points : (nu, nv, nw, 3) float64
    pinned : (nu, nv, nw) bool
        Control points that are locked, hidden or pinned.
    groups : mapping of str to (T, 3, 3) float64, or None
        Triangles of the mesh's groups, model coordinates; None where they are not known.
    source : Source
        For messages; key paths count from the drag.

    Raises
    ------
    LatticeError
        A group does not exist, or a part cannot move as a rigid body.
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
                raise source.error(("hold", index), message, "enlarge the `box`, or remove `rigid`")
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
    return Held(fixed, tuple(pieces), (*warnings, *_joined_warnings(parts)))


def _piece(part: _Part, volume: LatticeMap, points: Floats, source: Source) -> RigidPiece:
    """The control points of a part that its rigid motion moves."""
    level = volume.complete_level(part.boxes)
    if level is None:
        message = "cannot move rigidly: it extends beyond the lattice box"
        raise source.error(
            ("hold", part.numbers[0]), message, "enlarge the `box`, or remove `rigid`"
        )
    # On other levels displacements from rest rotate; control points at rest stay there.
    moved = np.any(points != volume.rest_points, axis=-1)
    return RigidPiece(part.reached & ((volume.levels == level) | moved), level)


def _triangles(name: str, index: int, groups: Groups | None, source: Source) -> Floats:
    if groups is None:
        message = "the groups of the model are not available here"
        raise source.error(("hold", index), message, "hold a box: {inside: {min, max}}")
    if name not in groups:
        known = ", ".join(sorted(groups)) or "none"
        raise source.error(
            ("hold", index), f"the model has no group `{name}`", f"its groups: {known}"
        )
    return groups[name]


def _require_loose(index: int, piece: Bools, fixed: Bools, pinned: Bools, source: Source) -> None:
    """Reject a rigid piece whose control points may not all move."""
    reason = "belong to a part that is held fixed" if (piece & fixed).any() else ""
    reason = "are locked or pinned" if (piece & pinned).any() else reason
    if reason:
        place = np.argwhere(piece & (fixed | pinned))[0].tolist()
        message = f"cannot move rigidly: control points that reach it {reason}, such as {place}"
        raise source.error(
            ("hold", index), message, "use more `points` or a larger `box`, or remove `rigid`"
        )


def _merge(
    parts: list[_Part], volume: LatticeMap, points: Floats, source: Source
) -> tuple[list[_Part], list[RigidPiece]]:
    """Join parts whose pieces share control points, until no two pieces share any."""
    pieces = [_piece(part, volume, points, source) for part in parts]
    for first, second in itertools.combinations(range(len(parts)), 2):
        if (pieces[first].members & pieces[second].members).any():
            others = [part for n, part in enumerate(parts) if n not in (first, second)]
            joined = parts[first].joined(parts[second])
            return _merge([*others, joined], volume, points, source)
    return parts, pieces


def _joined_warnings(parts: Sequence[_Part]) -> list[str]:
    return [
        f"{' and '.join(f'hold[{n}]' for n in part.numbers)} share control points and move together"
        for part in parts
        if len(part.numbers) > 1
    ]


# Number of pairs of triangle and control point tested at once, which bounds the memory.
_CHUNK = 200_000


def reaching_box(volume: LatticeMap, low: Floats, high: Floats) -> Bools:
    """(nu, nv, nw) control points that reach a box in model coordinates with corners (3,), (3,).

    The box may have no thickness along an axis.
    """
    share = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
    corners = volume.frame.to_local(low + share * (high - low))
    axes = volume.frame.to_local(np.eye(3)) - volume.frame.to_local(np.zeros((1, 3)))
    first, last = volume.supports()
    count = len(first)
    found = touches_boxes(
        np.broadcast_to(corners, (count, 8, 3)),
        np.broadcast_to(axes, (count, 3, 3)),
        np.broadcast_to(axes, (count, 3, 3)),
        first,
        last,
    )
    return found.reshape(volume.shape)


def reaching_triangles(volume: LatticeMap, triangles: Floats) -> Bools:
    """(nu, nv, nw) control points that reach some triangle (T, 3, 3) in model coordinates."""
    local = volume.frame.to_local(triangles)
    first, last = volume.supports()
    found = np.zeros(len(first), dtype=bool)
    corners = local.reshape(-1, 3)
    at_corners = volume.basis_matrix(corners[volume.contains(corners)])
    found[at_corners.indices[at_corners.data > 0]] = True
    # Control points that only the inside of a triangle meets are among the remaining ones.
    low, high = local.min(axis=1), local.max(axis=1)
    normals, edges = triangle_directions(local)
    within = np.all((low.min(axis=0) <= last) & (high.max(axis=0) >= first), axis=1)
    open_points = np.flatnonzero(within & ~found)
    step = max(1, _CHUNK // len(local))
    for start in range(0, len(open_points), step):
        part = open_points[start : start + step]
        near = np.all((low[None] <= last[part, None]) & (high[None] >= first[part, None]), axis=-1)
        point, triangle = np.nonzero(near)
        meets = touches_boxes(
            local[triangle],
            normals[triangle],
            edges[triangle],
            first[part[point]],
            last[part[point]],
        )
        found[part[point[meets]]] = True
    return found.reshape(volume.shape)
