"""Distances and contacts of the boxes of several lattices, which may touch only side to side."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.boxes import meeting_boxes
from ffdcli.errors import LatticeError
from ffdcli.lattice.border import SIDES
from ffdcli.lattice.file.definition import Definition
from ffdcli.lattice.layout import Layout

# Least gap between boxes that do not touch, relative to the size of the mesh: avoids slivers.
LEAST_GAP = 1e-6
# Edges whose angle has a smaller sine than this count as parallel.
_PARALLEL = 1e-9


@dataclass(frozen=True)
class Contact:
    """Gap between two boxes, and the sides on which they touch.

    Parameters
    ----------
    gap : float, model length
        Width of the widest slab between two parallel planes that separates the boxes. If they
        overlap: minus the length of the shortest move that separates them.
    sides : (str, str) or None
        The side of each box if they touch side to side.
    """

    gap: float
    sides: tuple[str, str] | None


def find_contact(first: Layout, second: Layout, slack: float) -> Contact:
    """Gap and contact of two boxes in any orientation, by separating axes.

    Sides within ``slack``, a model length, count as touching.
    """
    centre = first.box.mean(axis=0)
    half = np.ptp(first.box, axis=0) / 2, np.ptp(second.box, axis=0) / 2
    # Frame of the first box; the rows of `turn` are the axes of the second.
    turn = second.frame.axes @ first.frame.axes.T
    middle = second.frame.to_model(second.box.mean(axis=0))
    way = first.frame.to_local(middle) - centre
    across = np.cross(np.eye(3)[:, None], turn[None]).reshape(-1, 3)
    length = np.linalg.norm(across, axis=1)
    across = across[length > _PARALLEL] / length[length > _PARALLEL, None]
    directions = np.concatenate([np.eye(3), turn, across])
    reach = np.abs(directions) @ half[0] + np.abs(directions @ turn.T) @ half[1]
    gap = float((np.abs(directions @ way) - reach).max())

    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    corners = way + (signs * half[1]) @ turn
    for axis in range(3):
        up = way[axis] > 0
        height = (corners[:, axis] if up else -corners[:, axis]) - half[0][axis]
        meeting = np.abs(height) <= slack
        if meeting.sum() != 4 or height.min() < -slack:
            continue
        facing = signs[meeting]
        along = int(np.argmin(np.ptp(facing, axis=0)))
        top = facing[0, along] > 0
        return Contact(gap, (SIDES[2 * axis + int(up)], SIDES[2 * along + int(top)]))
    return Contact(gap, None)


def shared_sides(
    definitions: Sequence[Definition], layouts: Sequence[Layout], slack: float, size: float
) -> list[set[str]]:
    """Sides of each box, out of :data:`SIDES`, that touch a side of another box.

    ``size`` is that of the mesh; sides within ``slack`` count as touching. Both are model lengths.

    Raises
    ------
    LatticeError
        Two boxes overlap, are too close, or touch other than side to side.
    """
    shared: list[set[str]] = [set() for _ in layouts]
    least = max(LEAST_GAP * size, slack)
    for i, j in _pairs_within(layouts, least):
        contact = find_contact(layouts[i], layouts[j], slack)
        if contact.gap >= least:
            continue
        if contact.gap < -slack or contact.sides is None:
            raise _too_near(definitions, i, j, contact)
        shared[i].add(contact.sides[0])
        shared[j].add(contact.sides[1])
    return shared


def _pairs_within(layouts: Sequence[Layout], gap: float) -> list[tuple[int, int]]:
    """Pairs of boxes whose extents along x, y and z are nearer than a gap; others are clear."""
    corners = np.stack([_corners(layout) for layout in layouts])
    pairs = meeting_boxes(corners.min(axis=1), corners.max(axis=1) + gap)
    return sorted((i, j) for i, j in pairs.tolist())


def _corners(layout: Layout) -> Floats:
    """The corners (8, 3) of a box, in model coordinates."""
    upper = np.array(list(itertools.product((0, 1), repeat=3)))
    return layout.frame.to_model(np.where(upper == 1, layout.box[1], layout.box[0]))


def require_clear(definitions: Sequence[Definition]) -> None:
    """Reject lattices that no given box bounds, and that are not alone in their file."""
    for one in definitions if len(definitions) > 1 else ():
        octree, error = one.spec.octree, one.source.error
        if octree is None:
            continue
        if one.spec.volume == "hierarchical":
            message = "a hierarchical volume fades out beyond its box, into the other lattices"
            raise error(("volume",), message, "give it a file of its own, or use tspline")
        if octree.region != "auto":
            message = "beside other lattices a box must be given"
            hint = "say `region: auto` and give a `box`"
            raise error(("octree", "region"), message, hint)


def _too_near(
    definitions: Sequence[Definition], first: int, second: int, contact: Contact
) -> LatticeError:
    error = definitions[second].source.error
    automatic = "auto" in (definitions[first].spec.box, definitions[second].spec.box)
    names = f"lattices[{first}] and lattices[{second}]"
    lengths = f"{abs(contact.gap):.3g}"
    if contact.sides is None and contact.gap < 0 and automatic:
        message = f"the boxes of {names} overlap: an automatic box spans the whole mesh"
        return error((), message, "give each its own `box`")
    found = f"overlap by {lengths}"
    if contact.gap >= 0:
        found = f"are only {lengths} apart, and do not touch"
    hint = "move them apart, or let them touch side to side"
    return error(("box",), f"the boxes of {names} {found}", hint)
