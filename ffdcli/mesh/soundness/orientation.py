"""One way round for all polygons of a surface, and outwards for those of closed bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ffdcli.arrays import Bools
from ffdcli.mesh.edges import EdgeUses
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.shells import ShellNesting, shells
from ffdcli.mesh.soundness.overlaps import find_overlaps


def turn(mesh: Mesh, chosen: Bools) -> Mesh:
    """The mesh with the chosen polygons (P,) the other way round, first corners kept first."""
    first = np.repeat(mesh.starts[:-1], np.diff(mesh.starts))
    last = np.repeat(mesh.starts[1:], np.diff(mesh.starts))
    here = np.arange(len(mesh.corners))
    reverse = np.where(here == first, first, first + last - here)
    turned = chosen[mesh.polygon_of_corner]
    came = np.where(turned, reverse, here)
    uv = None if mesh.uv is None else mesh.uv[came]
    return replace(mesh, corners=mesh.corners[came], uv=uv)


def find_miswound(mesh: Mesh, edges: EdgeUses) -> Bools:
    """(P,) the polygons to turn so that neighbours across edges of two run one way.

    Of each connected surface the fewer ones are turned. A one-sided surface, such as a Möbius band,
    stays as it is.
    """
    count = mesh.polygon_count
    order = np.argsort(edges.edge_of_corner, kind="stable")
    order = order[edges.uses[edges.edge_of_corner[order]] == 2]
    first, second = mesh.polygon_of_corner[order].reshape(-1, 2).T
    against = mesh.corners[order[0::2]] == mesh.corners[order[1::2]]
    # Every polygon stands there twice, as it is and turned; neighbours link those that agree.
    rows = np.concatenate([first, first + count])
    columns = np.concatenate([second + count * against, second + count * ~against])
    graph = coo_array(
        (np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(2 * count, 2 * count)
    )
    label = connected_components(graph, directed=False)[1]
    kept, turned = label[:count], label[count:]
    # Of the two ways round of a surface the one that more polygons have already.
    as_is = np.bincount(kept, minlength=int(label.max()) + 1)
    fewer = as_is[kept] < as_is[turned]
    return np.asarray(fewer | ((as_is[kept] == as_is[turned]) & (kept > turned)))


def find_inverted_bodies(mesh: Mesh, nesting: ShellNesting) -> Bools:
    """(B,) the bodies to turn so that closed ones face outwards, cavities inwards.

    In a file that is inside out as a whole cavities are so, too; and what faces inwards inside a
    body that is turned may be its cavity. Of the ways to turn bodies the first that leaves the
    fewest inside out, then the fewest overlapping, is taken.
    """
    bad = np.zeros(len(nesting.volume), dtype=bool)
    bad[nesting.inside_out] = True
    if not bad.any() or nesting.closed.sum() == 1:
        return bad
    low, high = nesting.boxes[:, bad]
    within = np.all((low[:, None] > low) & (high[:, None] < high), axis=2).any(axis=1)
    outermost = bad.copy()
    outermost[bad] = ~within
    trials = []
    for chosen in (outermost, bad, nesting.closed):
        trial = turn(mesh, chosen[nesting.body])
        after = shells(trial)
        trials.append((len(after.inside_out), len(find_overlaps(trial, after)), chosen))
    return min(trials, key=lambda trial: trial[:2])[2]
