"""Edges that are too short for STEP files, whose readers collapse them to points."""

from __future__ import annotations

import numpy as np

from ffdcli.brep.record import Brep
from ffdcli.errors import CheckError
from ffdcli.messages import counted, place_text

# OpenCascade and others merge points nearer than this when they read STEP files, model length.
SHORTEST_STEP_EDGE = 1e-7


def require_kept_edges(brep: Brep) -> None:
    """Reject edges that readers of STEP files collapse to points, losing their faces.

    Raises
    ------
    CheckError
        Saying how many there are, and where the first one is.
    """
    ends = brep.points[brep.edges]
    # The ends of a closed edge also coincide, but its poles do not.
    short = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) < SHORTEST_STEP_EDGE
    for batch in brep.curves:
        points = batch.poles[..., :3]
        if batch.poles.shape[-1] == 4:
            points = points / batch.poles[..., 3:]
        wide = np.linalg.norm(np.ptp(points, axis=1), axis=1) >= SHORTEST_STEP_EDGE
        short[batch.edges[wide]] = False
    if short.any():
        raise CheckError(
            f"{counted(int(short.sum()), 'edge is', 'edges are')} shorter than"
            f" {SHORTEST_STEP_EDGE:g}, which readers of STEP files take for points; the first near"
            f" {place_text(ends[np.argmax(short)].mean(axis=0))}",
            hint="scale the model up; or move the lattice's box or knots away from vertices that"
            " they pass just beside; or write .brep",
        )
