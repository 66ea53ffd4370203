"""Join faces at coincident edges, for files that state no topology.

Files of trimmed surfaces (IGES entity 144) have separate edges for each face, and no solids. As
receivers do, edges that coincide within the file's resolution are merged, faces that share edges
form shells, and closed shells form solids. No curve, surface or outline changes; one of the
coincident curves represents all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.closedness import edge_uses
from ffdcli.brep.evaluate.integrate import centre_of, shell_volumes
from ffdcli.brep.evaluate.lookup import model_of_read
from ffdcli.brep.evaluate.trim import outlines
from ffdcli.brep.readback import Pcurves, ReadBrep
from ffdcli.brep.record import Curves
from ffdcli.graphs import connected_components

# Shares of the parameter range at which coincident edges must agree.
_BETWEEN = np.array([0.25, 0.5, 0.75])


def join_faces(read: ReadBrep, resolution: float) -> ReadBrep:
    """Join faces where their edges coincide.

    Edges coincide if their ends do, and points between at the same shares of their parameter
    ranges.

    Parameters
    ----------
    read : ReadBrep
    resolution : float, model length
        Distance within which points coincide.

    Returns
    -------
    ReadBrep
        Shells are connected faces. A closed shell that faces outwards is a solid. One that faces
        inwards is a cavity of the smallest solid whose bounding box contains its own, or a solid
        if there is none.
    """
    joined = _with_shared_edges(_with_shared_vertices(read, resolution), resolution)
    return _with_solids(_with_shells(joined))


def _with_shared_vertices(read: ReadBrep, resolution: float) -> ReadBrep:
    first, number = _clusters(read.points, resolution)
    distance = np.linalg.norm(read.points - read.points[first][number], axis=1)
    tolerance = np.zeros(len(first))
    np.maximum.at(tolerance, number, read.vertex_tolerance + distance)
    ends = np.where(read.edges >= 0, number[read.edges], -1)
    return replace(read, points=read.points[first], edges=ends, vertex_tolerance=tolerance)


def _clusters(points: Floats, distance: float) -> tuple[Ints, Ints]:
    """Single-linkage clusters of points: first point of each cluster, cluster of each point."""
    pairs = KDTree(points).query_pairs(distance, output_type="ndarray")
    label = connected_components(len(points), *pairs.T)
    _, first, number = np.unique(label, return_index=True, return_inverse=True)
    return first, number


def _with_shared_edges(read: ReadBrep, resolution: float) -> ReadBrep:
    count = len(read.edges)
    start, stop = read.edge_range.T
    at = start[:, None] + _BETWEEN * (stop - start)[:, None]
    which = np.repeat(np.arange(count), len(_BETWEEN))
    places = model_of_read(read).on_edges(which, at.ravel())[0].reshape(count, len(_BETWEEN), 3)
    turned = _turned(read.edges, places)
    places[turned] = places[turned, ::-1]
    ends = np.sort(read.edges, axis=1)
    known = np.isfinite(places).all(axis=(1, 2)) & (ends[:, 0] >= 0)
    # Edges without a curve or without ends are not merged.
    group = np.arange(count) + count
    _, group[known] = _clusters(places[known].reshape(-1, places[0].size), resolution)
    key = np.column_stack([group, ends])
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    number = number.ravel()
    backwards = turned != turned[first][number]
    tolerance = np.zeros(len(first))
    np.maximum.at(tolerance, number, read.edge_tolerance)
    flipped = backwards[read.coedge_edge]
    return replace(
        read,
        edges=read.edges[first],
        edge_range=read.edge_range[first],
        curves=tuple(_kept(read.curves, first)),
        coedge_edge=number[read.coedge_edge],
        coedge_forward=read.coedge_forward ^ flipped,
        pcurves=tuple(_with_range_of(read, first[number], flipped)),
        edge_tolerance=tolerance,
    )


def _turned(edges: Ints, places: Floats) -> Bools:
    """(E,) True for edges from a higher vertex to a lower; coordinates decide for closed edges."""
    ring = edges[:, 0] == edges[:, 1]
    ahead, behind = places[:, 0], places[:, -1]
    axis = np.argmax(np.abs(ahead - behind), axis=1)
    row = np.arange(len(edges))
    return np.where(ring, ahead[row, axis] > behind[row, axis], edges[:, 0] > edges[:, 1])


def _kept(batches: tuple[Curves, ...], first: Ints) -> list[Curves]:
    """Curves of the edges that are kept, by their new numbers."""
    place = np.full(max((int(batch.edges.max()) + 1 for batch in batches), default=0), -1)
    known = first[first < len(place)]
    place[known] = np.flatnonzero(first < len(place))
    kept = []
    for batch in batches:
        rows = np.flatnonzero(place[batch.edges] >= 0)
        if len(rows):
            kept.append(
                replace(
                    batch,
                    edges=place[batch.edges[rows]],
                    knots=batch.knots[rows],
                    poles=batch.poles[rows],
                )
            )
    return kept


def _with_range_of(read: ReadBrep, standing: Ints, flipped: Bools) -> list[Pcurves]:
    """Pcurves with the parameters and the sense of the edges that replace theirs."""
    own = read.edge_range[read.coedge_edge]
    new = read.edge_range[standing[read.coedge_edge]]
    made = []
    for batch in read.pcurves:
        for turn in (False, True):
            rows = np.flatnonzero(flipped[batch.coedges] == turn)
            if not len(rows):
                continue
            coedges = batch.coedges[rows]
            start, span = own[coedges, :1], np.diff(own[coedges], axis=1)
            share = (batch.knots[rows] - start) / span
            to, width = new[coedges, :1], np.diff(new[coedges], axis=1)
            moved = turn | (own[coedges] != new[coedges]).any(axis=1)[:, None]
            step = -1 if turn else 1
            knots = (to + width * (1 - share if turn else share))[:, ::step]
            made.append(
                Pcurves(
                    coedges,
                    batch.degree,
                    np.where(moved, knots, batch.knots[rows]),
                    batch.mults[::step],
                    batch.poles[rows, ::step],
                )
            )
    return made


def _with_shells(read: ReadBrep) -> ReadBrep:
    """The record with connected faces as shells."""
    face = read.face_of_coedge
    # Nodes of the graph are faces and edges.
    nodes = read.face_count + len(read.edges)
    linked = connected_components(nodes, face, read.face_count + read.coedge_edge)
    shell = linked[: read.face_count]
    count = int(shell.max(initial=-1)) + 1
    forward, backward = edge_uses(read)
    closed = np.ones(count, dtype=bool)
    closed[shell[face[((forward + backward) != 2)[read.coedge_edge]]]] = False
    return replace(
        read,
        face_shell=shell.astype(np.int64),
        shell_closed=closed,
        shell_solid=np.full(count, -1, dtype=np.int64),
    )


def _with_solids(read: ReadBrep) -> ReadBrep:
    """The record with closed shells as solids."""
    model = model_of_read(read)
    volume, _, _ = shell_volumes(model, outlines(model), centre_of(model))
    low, high = _shell_boxes(read)
    outer = np.flatnonzero(read.shell_closed & (volume > 0))
    solid = read.shell_solid.copy()
    solid[outer] = np.arange(len(outer))
    solids = len(outer)
    for inner in np.flatnonzero(read.shell_closed & ~(volume > 0)):
        around = outer[((low[outer] <= low[inner]) & (high[outer] >= high[inner])).all(axis=1)]
        if len(around):
            solid[inner] = solid[around[np.argmin(volume[around])]]
        else:
            solid[inner] = solids
            solids += 1
    return replace(read, shell_solid=solid)


def _shell_boxes(read: ReadBrep) -> tuple[Floats, Floats]:
    """Lowest and highest vertex coordinates (S, 3) of every shell."""
    ends = read.edges[read.coedge_edge]
    shell = np.repeat(read.face_shell[read.face_of_coedge], 2)[ends.ravel() >= 0]
    points = read.points[ends[ends >= 0]]
    low = np.full((len(read.shell_closed), 3), np.inf)
    high = -low
    np.minimum.at(low, shell, points)
    np.maximum.at(high, shell, points)
    return low, high
