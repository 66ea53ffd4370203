"""From regions, patches and curves to a boundary representation in integers.

The B-rep is closed because the mesh was: one vertex per mesh vertex, one edge per shared segment.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffdcli.brep.record import Brep, Curves, Planes, Surfaces
from ffdcli.brep.shells import Shells
from ffdcli.errors import LatticeError
from ffdcli.surface.curves import CurveBatch
from ffdcli.surface.flat import AffineMaps, divide_equal_weights
from ffdcli.surface.graph import Graphs
from ffdcli.surface.outlines import Outlines
from ffdcli.surface.partition import OUTSIDE, Partition
from ffdcli.surface.patches import PatchBatch
from ffdcli.surface.tolerance import Tolerances, kernel_rounding, kernel_tolerance
from ffdcli.threads import in_threads
from ffdcli.volume.protocol import Volume

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Geometry:
    """All that the mesh and the knots determine."""

    parts: Partition
    graphs: Graphs
    outlines: Outlines
    patches: tuple[PatchBatch, ...]
    curves: tuple[CurveBatch, ...]
    shells: Shells
    model_vertices: Floats
    tolerances: Tolerances


def assemble(geometry: Geometry, volumes: Sequence[Volume], maps: AffineMaps, gaps: Floats) -> Brep:
    """Build the B-rep of the deformed mesh.

    Parameters
    ----------
    geometry : Geometry
    volumes : sequence of Volume
        With the control nets to apply.
    maps : AffineMaps
        Patches that become planes.
    gaps : (E,) float64, model length
        Bound of the distance between each edge's curve and its faces; see :func:`edge_gaps`.
    """
    parts, outlines = geometry.parts, geometry.outlines
    region_affine = maps.affine[parts.patch]
    edges = outlines.edges
    sides = outlines.edge_regions
    straight = region_affine[sides[:, 0]] | ((sides[:, 1] >= 0) & region_affine[sides[:, 1]])

    used = np.unique(edges)
    number = np.full(len(parts.pieces.vertices), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    points = _vertex_points(geometry, volumes, used)
    ends = number[edges]

    curves, surfaces = _curves_and_surfaces(geometry, volumes, straight, maps)
    lines = np.flatnonzero(straight)
    curves += _lines(lines, points[ends[lines]])
    planes = _planes(geometry, volumes, maps)

    coedge_region = _coedge_region(outlines)
    pcurves = _pcurves(geometry, coedge_region)
    floor = kernel_tolerance(points)
    # Bounds of gaps are attained where the volume is of degree 1.
    edge_tolerance = np.maximum(floor, gaps + kernel_rounding(points))
    vertex_tolerance = np.full(len(points), floor)
    np.maximum.at(vertex_tolerance, ends[:, 0], edge_tolerance)
    np.maximum.at(vertex_tolerance, ends[:, 1], edge_tolerance)
    return Brep(
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
        pcurves=pcurves,
        face_shell=geometry.shells.region_shell,
        shell_closed=geometry.shells.closed,
        shell_solid=geometry.shells.solid,
        edge_tolerance=edge_tolerance,
        vertex_tolerance=vertex_tolerance,
    )


def deviation_bound(geometry: Geometry, volumes: Sequence[Volume], gaps: Floats) -> float:
    """Upper bound of the distance of the deformed mesh from the result, model length.

    It is nothing but rounding where the mesh's coplanar polygons are coplanar. Elsewhere it is
    what their vertices lie off the planes and straight edges that stand for them, times the
    largest stretch of the volume there (design, section 6).
    """
    slope = _slopes(geometry, volumes)
    graphs, parts = geometry.graphs, geometry.parts
    steepest = slope[parts.zone, graphs.axes[parts.group, 0]]
    off_planes = float((graphs.deviation[parts.group] * steepest).max(initial=0.0))
    off_lines = geometry.outlines.straightened * float(np.linalg.norm(slope, axis=1).max())
    return max(off_planes, off_lines, float(gaps.max(initial=0.0)))


def _slopes(geometry: Geometry, volumes: Sequence[Volume]) -> Floats:
    """(n + 1, 3) largest stretch along each axis, by zone; the last row is that of the outside."""
    bounds = []
    for number, volume in enumerate(volumes):
        cells = [batch.cells for batch in geometry.patches if batch.zone == number]
        bounds.append(volume.slope_bounds(np.concatenate([np.zeros((0, 3), np.int64), *cells])))
    return np.stack([*bounds, np.ones(3)])


def reverse_shells(brep: Brep, shells: Bools) -> Brep:
    """The same B-rep with the faces of the chosen shells (S,) turned over.

    A deformation that mirrors turns every outward normal inward; turning the faces mends it.
    """
    if not shells.any():
        return brep
    turned = shells[brep.face_shell]
    loop_face = np.repeat(np.arange(brep.face_count), np.diff(brep.face_loops))
    lengths = np.diff(brep.loop_coedges)
    loop = np.repeat(np.arange(len(lengths)), lengths)
    place = np.arange(len(loop))
    mirrored = brep.loop_coedges[loop] + brep.loop_coedges[loop + 1] - 1 - place
    flip = turned[loop_face[loop]]
    order = np.where(flip, mirrored, place)
    return replace(
        brep,
        face_reversed=brep.face_reversed ^ turned,
        coedge_edge=brep.coedge_edge[order],
        coedge_forward=brep.coedge_forward[order] ^ flip,
        pcurves=brep.pcurves[order],
    )


def _coedge_region(outlines: Outlines) -> Ints:
    loops = np.repeat(np.arange(len(outlines.region_loops) - 1), np.diff(outlines.region_loops))
    return np.repeat(loops, np.diff(outlines.loop_coedges))


def rest_points(geometry: Geometry, volumes: Sequence[Volume]) -> Floats:
    """(V, 3) where the B-rep's vertices were, model length; the mesh's own to the last bit."""
    used = np.unique(geometry.outlines.edges)
    points = volumes[0].frame.to_model(geometry.parts.in_frame(0)[used])
    original = used < len(geometry.model_vertices)
    points[original] = geometry.model_vertices[used[original]]
    return points


def _vertex_points(geometry: Geometry, volumes: Sequence[Volume], used: Ints) -> Floats:
    """Images of the vertices; those no deformed region touches keep every bit they had."""
    parts = geometry.parts
    # The seam with the part outside belongs to it: there the lattice is locked to the identity.
    # So it is where two boxes touch, and the vertices on their common side belong to neither.
    zone = parts.zone[parts.patch[parts.region]][parts.pieces.owner]
    lowest = np.full(len(parts.pieces.vertices), len(volumes))
    highest = np.full(len(parts.pieces.vertices), OUTSIDE)
    np.minimum.at(lowest, parts.pieces.corners, zone)
    np.maximum.at(highest, parts.pieces.corners, zone)
    home = np.where(lowest == highest, highest, OUTSIDE)[used]
    points = rest_points(geometry, volumes)
    for number, volume in enumerate(volumes):
        moved = home == number
        at = parts.in_frame(number)[used[moved]]
        values = volume.restrict(volume.cells(at), at, at).apply(volume.net)[:, 0, 0, 0]
        points[moved] = volume.frame.to_model(volume.embedding.images(values, at))
    return points


def _curves_and_surfaces(
    geometry: Geometry, volumes: Sequence[Volume], straight: Bools, maps: AffineMaps
) -> tuple[tuple[Curves, ...], tuple[Surfaces, ...]]:
    """Composed batch by batch, some batches at once."""
    jobs: list[Callable[[], list[Any]]] = [
        *(partial(_curves, batch, volumes[batch.zone], straight) for batch in geometry.curves),
        *(partial(_surfaces, batch, volumes[batch.zone], maps) for batch in geometry.patches),
    ]
    done = in_threads(jobs)
    count = len(geometry.curves)
    curves, surfaces = chain.from_iterable(done[:count]), chain.from_iterable(done[count:])
    return tuple(curves), tuple(surfaces)


def _curves(batch: CurveBatch, volume: Volume, straight: Bools) -> list[Curves]:
    chosen = np.flatnonzero(~straight[batch.edges])
    mults = np.concatenate([[batch.degree + 1], batch.mults, [batch.degree + 1]])
    return [
        Curves(batch.edges[rows], batch.degree, batch.breaks[rows], mults, poles)
        for rows, poles in _poles(volume, batch.control_points, chosen)
    ]


def _poles(
    volume: Volume, control_points: Callable[[Floats, Ints], Floats], chosen: Ints
) -> Iterator[tuple[Ints, Floats]]:
    """Control points of the chosen items in model coordinates, polynomial and rational apart.

    Raises
    ------
    LatticeError
        A weight is not positive: the cuts were planned for other weights.
    """
    if not len(chosen):
        return
    points = control_points(volume.net, chosen)
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


def _surfaces(batch: PatchBatch, volume: Volume, maps: AffineMaps) -> list[Surfaces]:
    chosen = np.flatnonzero(~maps.affine[batch.patches])
    mults = [
        np.concatenate([[d + 1], m, [d + 1]])
        for d, m in zip(batch.degrees, batch.mults, strict=True)
    ]
    return [
        Surfaces(
            surfaces=batch.patches[rows],
            degrees=batch.degrees,
            u_knots=batch.breaks[0][rows],
            v_knots=batch.breaks[1][rows],
            u_mults=mults[0],
            v_mults=mults[1],
            poles=poles,
        )
        for rows, poles in _poles(volume, batch.control_points, chosen)
    ]


def _planes(geometry: Geometry, volumes: Sequence[Volume], maps: AffineMaps) -> Planes:
    """Images of planar patches under their affine maps."""
    which = np.flatnonzero(maps.affine)
    group = geometry.parts.group[which]
    a, b, c = geometry.graphs.axes[group].T
    rows = np.arange(len(which))
    anchor = np.empty((len(which), 3))
    along_b, along_c = np.zeros((len(which), 3)), np.zeros((len(which), 3))
    for axis, place in zip((a, b, c), range(3), strict=True):
        anchor[rows, axis] = geometry.graphs.anchor[group, place]
    along_b[rows, b], along_c[rows, c] = 1.0, 1.0
    along_b[rows, a] = geometry.graphs.slopes[group, 0]
    along_c[rows, a] = geometry.graphs.slopes[group, 1]
    matrix, offset = maps.matrix[which], maps.offset[which]
    origin = np.einsum("nij,nj->ni", matrix, anchor) + offset
    x = np.einsum("nij,nj->ni", matrix, along_b)
    y = np.einsum("nij,nj->ni", matrix, along_c)
    for number, volume in enumerate(volumes):
        mine = geometry.parts.frame[which] == number
        origin[mine] = volume.frame.to_model(origin[mine])
        x[mine] = volume.frame.turn_to_model(x[mine])
        y[mine] = volume.frame.turn_to_model(y[mine])
    normal = np.cross(x, y)
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    return Planes(which, origin, x, np.cross(normal, x))


def _pcurves(geometry: Geometry, region: Ints) -> Floats:
    """Surface parameters ``(u_b, u_c)`` at the start and end of each coedge's edge."""
    outlines, parts = geometry.outlines, geometry.parts
    ends = parts.pieces.vertices[outlines.edges[outlines.coedge_edge]]
    patch = parts.patch[region]
    columns = geometry.graphs.axes[parts.group[patch], 1:] + 3 * parts.frame[patch, None]
    return np.take_along_axis(ends, columns[:, None, :], axis=2)


def edge_gaps(geometry: Geometry, volumes: Sequence[Volume]) -> Floats:
    """(E,) bound of the distance between each edge's curve and the surfaces beside it.

    Where mesh vertices lie off their region's plane by ``d`` along the dominant axis the two
    differ by up to ``d max |dD/du_a|``; where an edge counts as standing still along an axis, by
    half its rise times the slope along that axis. Where an end counts as lying on a plane across
    which the volume is only C0, a knot plane or a side of the box, and lies ``d`` beside it, the
    polynomials of its two sides part by up to twice ``d`` times the slope.
    """
    outlines, parts = geometry.outlines, geometry.parts
    region = _coedge_region(outlines)
    patch = parts.patch[region]
    group, zone = parts.group[patch], parts.zone[patch]
    ends = parts.pieces.vertices[outlines.edges[outlines.coedge_edge]]
    axes = geometry.graphs.axes[group]
    columns = axes + 3 * parts.frame[patch, None]
    local = np.take_along_axis(ends, columns[:, None, :], axis=2)
    height = geometry.graphs.height(group, local[:, :, 1], local[:, :, 2])
    off = np.abs(local[:, :, 0] - height).max(axis=1)
    slope = _slopes(geometry, volumes)
    gap = np.zeros(len(outlines.edges))
    np.maximum.at(gap, outlines.coedge_edge, off * slope[zone, axes[:, 0]])
    for batch in geometry.curves:
        rise = np.ptp(parts.in_frame(batch.zone)[outlines.edges[batch.edges]], axis=1)
        still = [axis for axis in range(3) if axis not in batch.running]
        gap[batch.edges] += rise[:, still] @ slope[batch.zone, still] / 2
    for number, volume in enumerate(volumes):
        mine = np.unique(outlines.coedge_edge[zone == number])
        for axis in range(3):
            planes = volume.knot_planes(axis, volume.box[None])
            creases = np.concatenate([planes.values[planes.continuity == 0], volume.box[:, axis]])
            places = parts.in_frame(number)[outlines.edges[mine], axis]
            beside = np.abs(places[:, :, None] - creases).min(axis=2)
            beside = np.where(beside <= geometry.tolerances.epsilon, beside, 0.0).max(axis=1)
            gap[mine] += 2 * beside * slope[number, axis]
    return gap
