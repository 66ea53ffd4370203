"""Whether the boxes of several lattices keep clear of one another, or touch side by side."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.errors import LatticeError
from ffdcli.lattice.border import SIDES
from ffdcli.lattice.file.definition import Definition
from ffdcli.lattice.layout import Layout

# Boxes that neither touch nor are this share of the size apart leave slivers between them.
LEAST_GAP = 1e-6
# Sines below this tell no direction across two edges: they are parallel.
_PARALLEL = 1e-9


@dataclass(frozen=True)
class Contact:
    """How two boxes lie to each other.

    Parameters
    ----------
    gap : float, model length
        Width of the widest slab between two parallel planes that keeps them apart; negative where
        they overlap, by as much as the least move that would part them.
    sides : (str, str) or None
        The side of each on which they touch, where they touch side to side.
    """

    gap: float
    sides: tuple[str, str] | None


def find_contact(first: Layout, second: Layout, slack: float) -> Contact:
    """How two boxes lie to each other, by separating axes.

    Parameters
    ----------
    first, second : Layout
        Boxes that may be turned against each other.
    slack : float, model length
        Distance within which sides count as touching.
    """
    centre = first.box.mean(axis=0)
    half = np.ptp(first.box, axis=0) / 2, np.ptp(second.box, axis=0) / 2
    # All in the frame of the first, where the second's axes are the rows of `turn`.
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
    """Some of :data:`SIDES` for each box: those that touch a side of another box.

    Parameters
    ----------
    slack : float, model length
        Distance within which sides count as touching.
    size : float, model length
        Size of the mesh.

    Raises
    ------
    LatticeError
        Two boxes overlap, come too near, or touch otherwise than side to side.
    """
    shared: list[set[str]] = [set() for _ in layouts]
    for i, j in itertools.combinations(range(len(layouts)), 2):
        contact = find_contact(layouts[i], layouts[j], slack)
        if contact.gap >= max(LEAST_GAP * size, slack):
            continue
        if contact.gap < -slack or contact.sides is None:
            raise _too_near(definitions, i, j, contact)
        shared[i].add(contact.sides[0])
        shared[j].add(contact.sides[1])
    return shared


def require_clear(definitions: Sequence[Definition]) -> None:
    """Refuse lattices that reach beyond a given box where there are others.

    Raises
    ------
    LatticeError
    """
    for one in definitions if len(definitions) > 1 else ():
        octree, error = one.spec.octree, one.source.error
        if octree is None:
            continue
        if one.spec.volume == "hierarchical":
            message = "a hierarchical volume fades out beyond its box, into the other lattices"
            raise error(("volume",), message, "give it a file of its own, or use tspline")
        if octree.embedding == "inverse":
            message = "an inverted volume needs the whole mesh in its box"
            hint = "give it a file of its own, or remove this key"
            raise error(("octree", "embedding"), message, hint)
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
    if contact.gap < 0:
        message = f"the boxes of {names} overlap by {lengths}"
        hint = "move them apart, or let them touch side to side"
    else:
        message = f"the boxes of {names} are only {lengths} apart, and do not touch"
        hint = "move them apart, or let whole sides lie in one plane"
    return error(("box",), message, hint)
