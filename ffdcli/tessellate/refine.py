"""Refine nets of triangles, uniformly or adaptively, until they are within a tolerance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.deformation import Deformation
from ffdcli.errors import CheckError
from ffdcli.mesh.flip import flip_to_delaunay
from ffdcli.mesh.triangle_net import TriangleNet
from ffdcli.tessellate.deviations import COARSE, DENSE, Deviations, measure, unknown
from ffdcli.tessellate.split import split

# Largest number of triangles.
MOST_TRIANGLES = 4_000_000
# The side with the largest deviation is halved if this is at least this share of the triangle's
# deviation, else the longest side.
_BENT_SHARE = 0.1


@dataclass(frozen=True)
class RefinedNet:
    """A refined net, its deformed vertices (V, 3), and its deviation, both in model length.

    The deviation is the largest distance found between the flat triangles and the exact surface.
    """

    net: TriangleNet
    points: Floats
    deviation: float


def deform_net(net: TriangleNet, deformation: Deformation) -> RefinedNet:
    """Deform the vertices of a net without refinement."""
    points = deformation.images(net.rest)
    found = measure(net, points, deformation, unknown(net), DENSE)
    return RefinedNet(net, points, found.largest)


def refine_uniformly(
    net: TriangleNet,
    deformation: Deformation,
    tolerance: float | None = None,
    levels: int | None = None,
) -> RefinedNet:
    """Halve all edges repeatedly (Feng 2002, section 1.1).

    Parameters
    ----------
    tolerance : float, optional, model length
        Stop if the deviation is at most this.
    levels : int, optional
        Stop after this number of rounds.

    Raises
    ------
    CheckError
        Too many triangles are needed.
    """
    level = 0
    while True:
        done = deform_net(net, deformation)
        near = tolerance is not None and done.deviation <= tolerance
        if near or level == levels:
            return done
        # Halving all edges reduces the deviation to a quarter at best.
        rounds = 1.0
        if tolerance is not None:
            rounds = max(1.0, np.log(done.deviation / tolerance) / np.log(4) - 1)
        _require_few(len(net.triangles) * 4**rounds)
        net, _ = split(net, np.ones(len(net.ends), dtype=bool), done.points)
        level += 1


def refine_adaptively(net: TriangleNet, deformation: Deformation, tolerance: float) -> RefinedNet:
    """Halve edges whose exact images deviate by more than the tolerance.

    If only the interior of a triangle deviates, its side with the largest deviation is halved, or
    the longest. After each round, edges inside flat faces are flipped to be Delaunay.

    Raises
    ------
    CheckError
        Too many triangles are needed.
    """
    net, _ = flip_to_delaunay(net)
    points = deformation.images(net.rest)
    known, density = unknown(net), COARSE
    while True:
        known = measure(net, points, deformation, known, density)
        marked = _marks(net, points, known, tolerance)
        if not marked.any():
            if density == DENSE:
                return RefinedNet(net, points, known.largest)
            known, density = unknown(net), DENSE
            continue
        worst = np.maximum(known.triangles, known.edges[net.sides].max(axis=1))
        # Halving all edges makes four triangles with a quarter of the deviation: a triangle becomes
        # at least sqrt(deviation / tolerance) triangles.
        _require_few(float(np.sqrt(np.maximum(1.0, worst / tolerance)).sum()))
        net, points, known = _round(net, points, known, marked, deformation)


def _round(
    net: TriangleNet, points: Floats, known: Deviations, marked: Bools, deformation: Deformation
) -> tuple[TriangleNet, Floats, Deviations]:
    """Split the marked edges, flip edges, and discard the deviations of all that changed."""
    finer, origin = split(net, marked, points)
    touched: Bools = np.asarray(marked[net.sides[origin]].any(axis=1))
    new = finer.rest[len(points) :]
    points = np.concatenate([points, deformation.images(new)])
    before = len(net.ends)
    finer, flipped = flip_to_delaunay(finer, touched)
    fresh = touched | flipped
    edges = np.full(len(finer.ends), np.nan)
    edges[:before] = np.where(marked, np.nan, known.edges)
    edges[finer.sides[fresh]] = np.where(
        finer.inner[finer.sides[fresh]], np.nan, edges[finer.sides[fresh]]
    )
    triangles = np.where(fresh, np.nan, known.triangles[origin])
    return finer, points, Deviations(edges, triangles)


def _marks(net: TriangleNet, points: Floats, known: Deviations, tolerance: float) -> Bools:
    """Edges to halve, (E,) bool."""
    marked = np.zeros(len(net.ends), dtype=bool)
    marked[known.edges > tolerance] = True
    bulging = np.flatnonzero((known.triangles > tolerance) & ~marked[net.sides].any(axis=1))
    if len(bulging):
        sides = net.sides[bulging]
        ends = points[net.ends[sides]]
        length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
        bent = known.edges[sides]
        enough = bent.max(axis=1) >= _BENT_SHARE * known.triangles[bulging]
        place: Ints = np.argmax(np.where(enough[:, None], bent, length), axis=1)
        marked[sides[np.arange(len(bulging)), place]] = True
    return marked


def _require_few(triangles: float) -> None:
    if triangles > MOST_TRIANGLES:
        raise CheckError(
            f"a mesh within this tolerance needs more than {MOST_TRIANGLES} triangles",
            hint="increase --mesh-tolerance, or write a CAD file",
        )
