"""Division of regions that touch themselves at a vertex.

The outline of such a region passes a vertex twice. OpenCascade rejects it where the gap between the
two passages is narrower than the face. As two loops with a common vertex it is not valid in STEP,
says OpenCascade's documentation (ShapeFix_SplitCommonVertex), and its writer splits the vertex,
which opens the faces beside it. So the region is divided along edges of its pieces, and each of its
wedges at the vertex goes to another region.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from ffdcli.arrays import Bools, Ints
from ffdcli.corners import next_corners
from ffdcli.graphs import connected_components
from ffdcli.surface.cut import Pieces


def divide_at_touches(pieces: Pieces, twins: Ints, region: Ints) -> Ints:
    """Regions (N,) such that the outline of each passes every vertex once.

    A piece goes with the wedge that is fewest pieces away.

    Parameters
    ----------
    pieces : Pieces
    twins : (C,) int64
        The other side of the edge that starts at each corner, -1 for none.
    region : (N,) int64
        Edge-connected regions.
    """
    owner, following = pieces.owner, next_corners(pieces.starts)
    while True:
        inner = (twins >= 0) & (region[owner] == region[owner[twins]])
        touching = _touching_corners(pieces, region[owner], inner)
        if not len(touching):
            return region
        sides = np.flatnonzero(inner)
        first, second = owner[sides], owner[twins[sides]]
        # Corners at one vertex whose pieces share an edge there are in one wedge.
        wedge = connected_components(len(owner), sides, following[twins[sides]])
        links = coo_array((np.ones(len(sides)), (first, second)), shape=2 * (pieces.count,))
        _, _, nearest = dijkstra(
            links.tocsr(),
            indices=owner[touching],
            min_only=True,
            unweighted=True,
            return_predecessors=True,
        )
        part = np.full(pieces.count, -1, dtype=np.int64)
        part[owner[touching]] = wedge[touching]
        reached = nearest >= 0
        part[reached] = part[nearest[reached]]
        same = part[first] == part[second]
        region = connected_components(pieces.count, first[same], second[same])


def _touching_corners(pieces: Pieces, region: Ints, inner: Bools) -> Ints:
    """Corners at one vertex of each region that touches itself, of that region.

    Parameters
    ----------
    pieces : Pieces
    region : (C,) int64
        Region of each corner.
    inner : (C,) bool
        True for sides between pieces of one region.
    """
    count = np.int64(len(pieces.vertices))
    place = region * count + pieces.corners
    places, passages = np.unique(place[~inner], return_counts=True)
    touched = places[passages > 1]
    _, first = np.unique(touched // count, return_index=True)
    return np.flatnonzero(np.isin(place, touched[first]))
