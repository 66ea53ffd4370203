"""Orientation: polygons of one sense on each surface, closed bodies that face outwards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffdcli.arrays import Bools
from ffdcli.graphs import connected_components
from ffdcli.mesh.edges import EdgeUses
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.shells import ShellNesting, find_overlaps, shells


def turn(mesh: Mesh, chosen: Bools) -> Mesh:
    """The mesh with the chosen polygons (P,) reversed; first corners stay first."""
    first = np.repeat(mesh.starts[:-1], np.diff(mesh.starts))
    last = np.repeat(mesh.starts[1:], np.diff(mesh.starts))
    here = np.arange(len(mesh.corners))
    reverse = np.where(here == first, first, first + last - here)
    turned = chosen[mesh.polygon_of_corner]
    came = np.where(turned, reverse, here)
    uv = None if mesh.uv is None else mesh.uv[came]
    return replace(mesh, corners=mesh.corners[came], uv=uv)


def find_miswound(mesh: Mesh, edges: EdgeUses) -> Bools:
    """(P,) polygons to reverse, so that two polygons alone on an edge have one sense.

    The minority of each connected surface is reversed. A one-sided surface, such as a Möbius band,
    stays as it is.
    """
    count = mesh.polygon_count
    order = np.argsort(edges.edge_of_corner, kind="stable")
    order = order[edges.uses[edges.edge_of_corner[order]] == 2]
    first, second = mesh.polygon_of_corner[order].reshape(-1, 2).T
    against = mesh.corners[order[0::2]] == mesh.corners[order[1::2]]
    # Nodes of the graph are all polygons as they are, then reversed; neighbours of one sense link.
    rows = np.concatenate([first, first + count])
    columns = np.concatenate([second + count * against, second + count * ~against])
    label = connected_components(2 * count, rows, columns)
    kept, turned = label[:count], label[count:]
    # A surface takes the sense of its majority.
    as_is = np.bincount(kept, minlength=int(label.max()) + 1)
    fewer = as_is[kept] < as_is[turned]
    return np.asarray(fewer | ((as_is[kept] == as_is[turned]) & (kept > turned)))


def find_inverted_bodies(mesh: Mesh, nesting: ShellNesting) -> Bools:
    """(B,) bodies to reverse, so that closed bodies face outwards and cavities inwards.

    If a whole file is inside out, so are its cavities; and a body that faces inwards may be a
    cavity once the body round it is reversed. Three choices are tried: the outermost of the bodies
    inside out, all of these, and all closed bodies. The first that leaves the fewest bodies inside
    out, then the fewest overlaps, is taken.
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
