"""Split a net of triangles: halve edges, and divide triangles by their halved sides.

Vertices and edges are identified by number, not by coordinates, and an edge is split once for all
its triangles. So nets stay conforming, and closed nets stay closed.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.mesh.triangle_net import TriangleNet


def split(net: TriangleNet, marked: Bools, place: Floats) -> tuple[TriangleNet, Ints]:
    """Halve the marked edges (E,), and divide each triangle according to its halved sides.

    Parameters
    ----------
    place : (V, 3) float64
        Positions of the vertices: of two diagonals the shorter one is taken.

    Returns
    -------
    TriangleNet
        New vertices and edges follow the old ones; one half of an edge keeps its number.
    (T',) int64
        Original triangle of each.
    """
    halved = np.flatnonzero(marked)
    count, edges = len(net.rest), len(net.ends)
    middle = np.full(edges, -1, dtype=np.int64)
    middle[halved] = count + np.arange(len(halved))
    far = np.arange(edges)
    far[halved] = edges + np.arange(len(halved))
    first, second = net.ends[halved].T
    rest = np.concatenate([net.rest, (net.rest[first] + net.rest[second]) / 2])
    ends = net.ends.copy()
    ends[halved, 1] = middle[halved]
    grown = [ends, np.column_stack([middle[halved], second])]
    images = np.concatenate([place, (place[first] + place[second]) / 2])

    hit = marked[net.sides]
    amount = hit.sum(axis=1)
    whole = np.flatnonzero(amount == 0)
    triangles, sides, origin = [net.triangles[whole]], [net.sides[whole]], [whole]
    number = edges + len(halved)
    for pattern in (1, 2, 3):
        rows = np.flatnonzero(amount == pattern)
        # Rotate the corners so that the halved sides come first: side 0, or sides 0 and 1.
        lead = np.argmax(hit[rows], axis=1)
        if pattern == 2:
            lead = (np.argmin(hit[rows], axis=1) + 1) % 3
        turn = (lead[:, None] + np.arange(3)) % 3
        v = np.take_along_axis(net.triangles[rows], turn, axis=1)
        s = np.take_along_axis(net.sides[rows], turn, axis=1)
        ahead = net.ends[s, 0] == v
        near, away = np.where(ahead, s, far[s]), np.where(ahead, far[s], s)
        m = middle[s]
        fresh = number + np.arange(pattern * len(rows)).reshape(len(rows), pattern)
        number += fresh.size
        corner, side, made = _patterns[pattern](v, s, near, away, m, fresh, images)
        triangles.append(corner.reshape(-1, 3))
        sides.append(side.reshape(-1, 3))
        origin.append(np.repeat(rows, pattern + 1))
        grown.append(made.reshape(-1, 2))
    came = np.concatenate(origin)
    order = np.argsort(came, kind="stable")
    return (
        TriangleNet(
            rest,
            np.concatenate(triangles)[order],
            np.concatenate(sides)[order],
            np.concatenate(grown),
            net.owner[came[order]],
            np.concatenate([net.parents, np.column_stack([first, second])]),
        ),
        came[order],
    )


def _one(
    v: Ints, s: Ints, near: Ints, away: Ints, m: Ints, n: Ints, _: Floats
) -> tuple[Ints, Ints, Ints]:
    """Side 0 halved: two triangles."""
    corner = [v[:, 0], m[:, 0], v[:, 2], m[:, 0], v[:, 1], v[:, 2]]
    side = [near[:, 0], n[:, 0], s[:, 2], away[:, 0], s[:, 1], n[:, 0]]
    return np.stack(corner, 1), np.stack(side, 1), np.stack([m[:, 0], v[:, 2]], 1)


def _two(
    v: Ints, s: Ints, near: Ints, away: Ints, m: Ints, n: Ints, images: Floats
) -> tuple[Ints, Ints, Ints]:
    """Sides 0 and 1 halved: three triangles, two of them by the shorter diagonal."""
    tip = [m[:, 0], v[:, 1], m[:, 1]]
    tip_side = [away[:, 0], near[:, 1], n[:, 0]]
    back = [v[:, 0], m[:, 0], m[:, 1], v[:, 0], m[:, 1], v[:, 2]]
    back_side = [near[:, 0], n[:, 0], n[:, 1], n[:, 1], away[:, 1], s[:, 2]]
    fore = [v[:, 0], m[:, 0], v[:, 2], m[:, 0], m[:, 1], v[:, 2]]
    fore_side = [near[:, 0], n[:, 1], s[:, 2], n[:, 0], away[:, 1], n[:, 1]]
    across = [np.linalg.norm(images[a] - images[b], axis=1) for a, b in (
        (v[:, 0], m[:, 1]), (m[:, 0], v[:, 2]))]  # fmt: skip
    shorter = (across[0] <= across[1])[:, None]
    corner = np.where(shorter, np.stack(tip + back, 1), np.stack(tip + fore, 1))
    side = np.where(shorter, np.stack(tip_side + back_side, 1), np.stack(tip_side + fore_side, 1))
    diagonal = np.where(shorter, np.stack([v[:, 0], m[:, 1]], 1), np.stack([m[:, 0], v[:, 2]], 1))
    return corner, side, np.concatenate([m[:, [1, 0]], diagonal], axis=1)


def _three(
    v: Ints, _s: Ints, near: Ints, away: Ints, m: Ints, n: Ints, _: Floats
) -> tuple[Ints, Ints, Ints]:
    """All sides halved: four triangles."""
    corner, side = [], []
    for i in range(3):
        j = (i + 2) % 3
        corner += [v[:, i], m[:, i], m[:, j]]
        side += [near[:, i], n[:, i], away[:, j]]
    corner += [m[:, 0], m[:, 1], m[:, 2]]
    side += [n[:, 1], n[:, 2], n[:, 0]]
    made = [m[:, 0], m[:, 2], m[:, 1], m[:, 0], m[:, 2], m[:, 1]]
    return np.stack(corner, 1), np.stack(side, 1), np.stack(made, 1)


_patterns = {1: _one, 2: _two, 3: _three}
