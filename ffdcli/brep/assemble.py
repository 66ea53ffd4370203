"""Assembly of the boundary representation of a deformed mesh from planned geometry.

The B-rep is closed because the mesh is: one vertex per vertex of the cut mesh, one edge per shared
segment.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.geometry import Geometry
from ffdcli.brep.record import Brep, Curves, Planes, Surfaces
from ffdcli.errors import LatticeError
from ffdcli.surface.affine import AffineMaps, divide_equal_weights, find_affine
from ffdcli.surface.curves import EdgeBatch
from ffdcli.surface.spline_batch import SplineBatch, SurfaceBatch
from ffdcli.surface.tolerance import kernel_rounding, kernel_tolerance
from ffdcli.threads import in_threads
from ffdcli.volume.protocol import Volume


def assemble(geometry: Geometry, volumes: Sequence[Volume], gaps: Floats) -> Brep:
    """Build the B-rep of the deformed mesh.

    Parameters
    ----------
    geometry : Geometry
    volumes : sequence of Volume
        With the control nets to apply.
    gaps : (E,) float64, model length
        Bounds of the distance between the curve of each edge and its faces; see
        :class:`~ffdcli.surface.gaps.GapBounds`.

    Raises
    ------
    LatticeError
        A weight of some surface or curve is not positive.
    """
    parts, outlines, shells = geometry.parts, geometry.outlines, geometry.shells
    maps = find_affine(volumes, geometry.cells, len(parts.low))
    straight = straight_edges(geometry, maps)
    points = geometry.vertices.deformed(volumes)
    ends = geometry.vertices.number[outlines.edges]
    curves, surfaces = _curves_and_surfaces(geometry, volumes, straight, maps)
    lines = np.flatnonzero(straight)
    curves += _lines(lines, points[ends[lines]])
    planes = _planes(geometry, volumes, maps)
    floor = kernel_tolerance(points)
    # Bounds of gaps are attained where the volume is of degree 1.
    edge_tolerance = np.maximum(floor, gaps + kernel_rounding(points))
    vertex_tolerance = np.full(len(points), floor)
    np.maximum.at(vertex_tolerance, ends[:, 0], edge_tolerance)
    np.maximum.at(vertex_tolerance, ends[:, 1], edge_tolerance)
    brep = Brep(
        points=points,
        edges=ends,
        curves=curves,
        surfaces=surfaces,
        planes=planes,
        face_surface=parts.patch,
        face_reversed=np.zeros(len(parts.patch), dtype=bool),
        face_loops=outlines.region_loops,
        loop_coedges=outlines.loop_coedges,
        coedge_edge=outlines.coedge_edge,
        coedge_forward=outlines.coedge_forward,
        pcurves=geometry.pcurves,
        face_shell=shells.region_shell,
        shell_closed=shells.closed,
        shell_solid=shells.solid,
        edge_tolerance=edge_tolerance,
        vertex_tolerance=vertex_tolerance,
    )
    return reverse_shells(brep, shells.mirrored(volumes))


def straight_edges(geometry: Geometry, maps: AffineMaps) -> Bools:
    """(E,) True for edges beside a patch with an affine map, which takes lines to lines."""
    flat, sides = maps.affine[geometry.parts.patch], geometry.outlines.edge_regions
    return np.asarray(flat[sides[:, 0]] | ((sides[:, 1] >= 0) & flat[sides[:, 1]]))


def reverse_shells(brep: Brep, shells: Bools) -> Brep:
    """Reverse the faces of the chosen shells (S,).

    A deformation that mirrors a shell turns its outward normals inward.
    """
    if not shells.any():
        return brep
    turned = shells[brep.face_shell]
    loop = brep.loop_of_coedge
    place = np.arange(len(loop))
    mirrored = brep.loop_coedges[loop] + brep.loop_coedges[loop + 1] - 1 - place
    flip = turned[brep.face_of_coedge]
    order = np.where(flip, mirrored, place)
    return replace(
        brep,
        face_reversed=brep.face_reversed ^ turned,
        coedge_edge=brep.coedge_edge[order],
        coedge_forward=brep.coedge_forward[order] ^ flip,
        pcurves=brep.pcurves[order],
    )


def _curves_and_surfaces(
    geometry: Geometry, volumes: Sequence[Volume], straight: Bools, maps: AffineMaps
) -> tuple[tuple[Curves, ...], tuple[Surfaces, ...]]:
    """Curves and surfaces of all batches, composed in several threads."""
    jobs: list[Callable[[], list[Any]]] = [
        *(partial(_curves, batch, volumes[batch.zone], straight) for batch in geometry.curves),
        *(partial(_surfaces, batch, volumes[batch.zone], maps) for batch in geometry.patches),
    ]
    done = in_threads(jobs)
    count = len(geometry.curves)
    curves, surfaces = chain.from_iterable(done[:count]), chain.from_iterable(done[count:])
    return tuple(curves), tuple(surfaces)


def _curves(batch: EdgeBatch, volume: Volume, straight: Bools) -> list[Curves]:
    chosen = np.flatnonzero(~straight[batch.edges])
    (degree,), (breaks,), (mults,) = batch.degrees, batch.breaks, batch.full_mults
    return [
        Curves(batch.edges[rows], degree, breaks[rows], mults, poles)
        for rows, poles in _poles(volume, batch, chosen)
    ]


def _poles(volume: Volume, batch: SplineBatch, chosen: Ints) -> Iterator[tuple[Ints, Floats]]:
    """Chosen splines and their control points in model coordinates, polynomial and rational ones.

    Raises
    ------
    LatticeError
        A weight is not positive, since the cuts were planned for other weights.
    """
    if not len(chosen):
        return
    points = batch.control_points(volume.net, chosen)
    divided, equal = divide_equal_weights(points)
    if equal.any():
        yield chosen[equal], volume.frame.to_model(divided[equal])
    if equal.all():
        return
    rational = points[~equal]
    if rational[..., 3].min() <= 0:
        raise LatticeError(
            "the cuts were planned for other weights: some surface would have negative ones",
            hint="prepare a plan with this lattice",
        )
    turned = volume.frame.turn_to_model(rational[..., :3])
    turned = turned + rational[..., 3:] * volume.frame.origin
    yield chosen[~equal], np.concatenate([turned, rational[..., 3:]], axis=-1)


def _lines(edges: Ints, ends: Floats) -> tuple[Curves, ...]:
    """Straight lines between end points (m, 2, 3)."""
    if not len(edges):
        return ()
    knots = np.tile([0.0, 1.0], (len(edges), 1))
    return (Curves(edges, 1, knots, np.array([2, 2]), ends),)


def _surfaces(batch: SurfaceBatch, volume: Volume, maps: AffineMaps) -> list[Surfaces]:
    chosen = np.flatnonzero(~maps.affine[batch.patches])
    (p, q), (u, v), (u_mults, v_mults) = batch.degrees, batch.breaks, batch.full_mults
    return [
        Surfaces(batch.patches[rows], (p, q), u[rows], v[rows], u_mults, v_mults, poles)
        for rows, poles in _poles(volume, batch, chosen)
    ]


def _planes(geometry: Geometry, volumes: Sequence[Volume], maps: AffineMaps) -> Planes:
    """Planes of the patches with affine maps."""
    which = np.flatnonzero(maps.affine)
    graphs = geometry.parts.graphs.take(which)
    a, b, c = graphs.axes.T
    rows = np.arange(len(which))
    anchor = np.empty((len(which), 3))
    along_b, along_c = np.zeros((len(which), 3)), np.zeros((len(which), 3))
    for axis, place in zip((a, b, c), range(3), strict=True):
        anchor[rows, axis] = graphs.anchor[:, place]
    along_b[rows, b], along_c[rows, c] = 1.0, 1.0
    along_b[rows, a] = graphs.slopes[:, 0]
    along_c[rows, a] = graphs.slopes[:, 1]
    matrix, offset = maps.matrix[which], maps.offset[which]
    origin = np.einsum("nij,nj->ni", matrix, anchor) + offset
    x = np.einsum("nij,nj->ni", matrix, along_b)
    y = np.einsum("nij,nj->ni", matrix, along_c)
    for number, volume in enumerate(volumes):
        mine = geometry.parts.frame_volume[which] == number
        origin[mine] = volume.frame.to_model(origin[mine])
        x[mine] = volume.frame.turn_to_model(x[mine])
        y[mine] = volume.frame.turn_to_model(y[mine])
    normal = np.cross(x, y)
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    return Planes(which, origin, x, np.cross(normal, x))
