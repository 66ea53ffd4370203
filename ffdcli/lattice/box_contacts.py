"""Whether the boxes of several lattices keep clear of one another, or touch side by side."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.lattice.border import SIDES
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
    layouts: Sequence[Layout], slack: float, size: float
) -> tuple[list[set[str]], tuple[int, int, Contact] | None]:
    """The sides on which each box touches another, and the first pair that may not lie as it does.

    Parameters
    ----------
    layouts : sequence of Layout
    slack : float, model length
        Distance within which sides count as touching.
    size : float, model length
        Of the mesh.

    Returns
    -------
    list of set of str
        Some of :data:`SIDES` for each box.
    (int, int, Contact) or None
        Two boxes that overlap, come too near, or touch otherwise than side to side.
    """
    shared: list[set[str]] = [set() for _ in layouts]
    for i, j in itertools.combinations(range(len(layouts)), 2):
        contact = find_contact(layouts[i], layouts[j], slack)
        if contact.gap >= max(LEAST_GAP * size, slack):
            continue
        if contact.gap < -slack or contact.sides is None:
            return shared, (i, j, contact)
        shared[i].add(contact.sides[0])
        shared[j].add(contact.sides[1])
    return shared, None
