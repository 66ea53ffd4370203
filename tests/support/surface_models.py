"""Meshes, volumes and the chain of stages, for the tests of the surface package."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import NdBSpline

from ffdcli.corners import next_corners
from ffdcli.splines.knots import make_knots
from ffdcli.surface.curves import EdgeBatch, plan_curves
from ffdcli.surface.cut import Pieces
from ffdcli.surface.facets import Facets, Patches
from ffdcli.surface.outlines import Outlines, trace_outlines
from ffdcli.surface.partition import Partition, partition
from ffdcli.surface.patches import plan_patches
from ffdcli.surface.plane_graphs import fit_graphs, plane_deviation
from ffdcli.surface.planes import PlaneGroups, find_planes, join_parallel
from ffdcli.surface.refine import keep_overshoot_small
from ffdcli.surface.spline_batch import SplineBatch, SurfaceBatch
from ffdcli.surface.tolerance import Tolerances, kernel_tolerance
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.frame import Frame
from support.jobs import CUBE as UNIT_CUBE

Floats = Any
Triple = tuple[int, int, int]

CUBE = UNIT_CUBE - 0.5
CUBE_TRIANGLES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def make_volume(
    low: Floats,
    high: Floats,
    degrees: Triple,
    counts: Triple,
    *,
    clamped: bool = True,
    interior: tuple[Floats, Floats, Floats] | None = None,
    amount: float = 0.05,
    seed: int = 0,
) -> BSplineVolume:
    """A volume over a box whose control points are shaken by ``amount`` of its longest side."""
    low, high = np.broadcast_to(low, 3).astype(float), np.broadcast_to(high, 3).astype(float)
    inner = interior or (None, None, None)
    knots = [
        make_knots(k, n, a, b, interior=f, clamped=clamped)
        for k, n, a, b, f in zip(degrees, counts, low, high, inner, strict=True)
    ]
    frame = Frame(np.zeros(3), np.eye(3))
    volume = BSplineVolume(degrees, (knots[0], knots[1], knots[2]), np.zeros((*counts, 3)), frame)
    rest = volume.rest_points
    shake = np.random.default_rng(seed).uniform(-1, 1, rest.shape)
    return volume.with_net(rest + amount * (high - low).max() * shake)


def turn(axis: Floats, angle: float) -> Floats:
    """Rotation matrix (Rodrigues)."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def box_mesh(
    size: Floats = 1.0, rotation: Floats | None = None, centre: Floats = 0.0
) -> tuple[Floats, Floats]:
    """A box of 12 triangles."""
    vertices = CUBE * size
    if rotation is not None:
        vertices = vertices @ np.asarray(rotation).T
    return vertices + centre, CUBE_TRIANGLES.copy()


def together(*meshes: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Several bodies in one mesh."""
    offset = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    triangles = [t + o for (_, t), o in zip(meshes, offset, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(triangles)


def zoo() -> tuple[Floats, Floats]:
    """Bodies in the unit cube about the origin whose faces have all seven kinds of normal.

    The last three are needles that run diagonally across the cube: long diagonal strips.
    """
    return together(
        box_mesh(1.0),
        box_mesh(0.62, turn([1, 0, 0], 0.37)),
        box_mesh(0.61, turn([0, 1, 0], 0.93)),
        box_mesh(0.63, turn([0, 0, 1], 0.61)),
        box_mesh(0.54, turn([0.3, -0.5, 0.8], 0.83)),
        *strips(),
    )


def strips() -> list[tuple[Floats, Floats]]:
    """Needles along (1, -1, 0.03) and its like: across many knots, along one slab."""
    bodies = []
    for shift in range(3):
        along = np.roll([1.0, -0.93, 0.03], shift)
        along = along / np.linalg.norm(along)
        side = np.cross(along, np.roll([0.2, 0.35, 1.0], shift))
        side = side / np.linalg.norm(side)
        frame = np.column_stack([along, side, np.cross(along, side)])
        bodies.append(box_mesh([1.25, 0.03, 0.02], frame))
    return bodies


@dataclass(frozen=True)
class Stages:
    """Everything from planes to plans, for one volume."""

    vertices: Floats
    triangles: Floats
    volume: BSplineVolume
    delta: float
    size: float
    parts: Partition
    outlines: Outlines
    patches: tuple[SurfaceBatch, ...]
    curves: tuple[EdgeBatch, ...]

    @property
    def facets(self) -> Facets:
        return self.parts.facets

    @property
    def groups(self) -> PlaneGroups:
        return self.facets.groups

    @property
    def limits(self) -> Tolerances:
        return self.facets.tolerances

    @property
    def epsilon(self) -> float:
        return self.limits.epsilon

    @property
    def places(self) -> Floats:
        """(V, 3) vertices of the cut mesh."""
        return self.parts.pieces.vertices[:, 0]


def find_facets(
    vertices: Floats,
    triangles: Floats,
    volume: BSplineVolume,
    *,
    patches: Patches = "merged",
    delta: float | None = None,
    polygon: Floats | None = None,
) -> Facets:
    """The facets of a mesh and their graphs."""
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    delta = 1e-9 * size if delta is None else delta
    polygon = np.arange(len(triangles)) if polygon is None else polygon
    groups = find_planes(vertices, triangles, polygon, delta)
    if patches != "merged":
        groups = join_parallel(vertices, triangles, groups, delta)
    epsilon = plane_deviation(groups, delta)
    graphs = fit_graphs(vertices[:, None], triangles, groups, [volume], epsilon)
    limits = Tolerances(size, epsilon, kernel_tolerance(vertices))
    return Facets(groups, graphs, (volume,), limits, 0.0, patches)


def run(
    vertices: Floats,
    triangles: Floats,
    volume: BSplineVolume,
    *,
    patches: Patches = "merged",
    delta: float | None = None,
    polygon: Floats | None = None,
) -> Stages:
    """The stages of the main path, on arrays."""
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    delta = 1e-9 * size if delta is None else delta
    facets = find_facets(vertices, triangles, volume, patches=patches, delta=delta, polygon=polygon)
    parts, *_ = keep_overshoot_small(partition(vertices[:, None], triangles, facets))
    outlines = trace_outlines(parts)
    inside = parts.inside[parts.patch[outlines.edge_regions]] & (outlines.edge_regions >= 0)
    zone = np.where(inside.any(axis=1), 0, -1)
    limits = facets.tolerances
    return Stages(
        vertices=vertices,
        triangles=triangles,
        volume=volume,
        delta=delta,
        size=size,
        parts=parts,
        outlines=outlines,
        patches=plan_patches(parts),
        curves=plan_curves(parts.pieces.vertices, outlines.edges, zone, [volume], limits),
    )


def vector_areas(pieces: Pieces) -> Floats:
    """(N, 3) vector areas of pieces in the frame of the first volume."""
    points = pieces.vertices[pieces.corners, 0]
    first = points[np.repeat(pieces.starts[:-1], np.diff(pieces.starts))]
    after = points[next_corners(pieces.starts)]
    return np.add.reduceat(np.cross(points - first, after - first) / 2, pieces.starts[:-1], axis=0)


def evaluate_spline(batch: SplineBatch, i: int, poles: Floats, at: Floats) -> Floats:
    """(m, 3) points of one spline of a batch at parameters (m, 1 or 2), clipped to its domain."""
    knots = [
        np.repeat(breaks[i], mults)
        for breaks, mults in zip(batch.breaks, batch.full_mults, strict=True)
    ]
    clipped = np.clip(at, [t[0] for t in knots], [t[-1] for t in knots])
    return NdBSpline(tuple(knots), poles, batch.degrees)(clipped)
