"""Surfaces of patches: exact tensor-product B-splines over their rectangles.

What depends on the mesh and the knots alone is planned once (``plan_patches``); a control net is
then applied to all patches of a kind at once (``PatchBatch.control_points``).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.splines.composition import compose_plane, merge_variables
from ffdcli.surface.partition import Partition
from ffdcli.surface.rectangle_patches import plan_rectangles
from ffdcli.surface.spline_batch import SurfaceBatch, plan_joints
from ffdcli.volume.protocol import Volume


@dataclass(frozen=True, kw_only=True)
class PatchBatch(SurfaceBatch):
    """Surfaces in one box with one dominant axis; their parameters are ``u_b`` and ``u_c``.

    Parameters
    ----------
    order : (int, int, int)
        The axes ``a, b, c``.
    sloping : (bool, bool)
        Whether beta, gamma differ from 0.
    share : (m Jb Jc, 2, 2) float64
        Height of the plane at the corners of each piece as a share of its height range.
    """

    order: tuple[int, int, int]
    sloping: tuple[bool, bool]
    share: Floats

    def rounding(self, volume: Volume) -> float:
        """0: compositions are accurate to some units in the last place."""
        return 0.0

    def _compose(self, points: Floats, index: Ints) -> Floats:
        a, b, c = self.order
        points = points.transpose(0, 1 + a, 1 + b, 1 + c, 4)
        if all(self.sloping):
            return compose_plane(points, self.share[index])
        if not any(self.sloping):
            return points[:, 0]
        # With one slope the height runs through its range with that parameter, up or down.
        rising = self.share[index, 1, 1] > 0.5
        points = np.where(rising[:, None, None, None, None], points, points[:, ::-1])
        if self.sloping[0]:
            return merge_variables(points.transpose(0, 2, 1, 3, 4), 1, 2)
        return merge_variables(points.transpose(0, 2, 3, 1, 4), 2, 3)


@dataclass(frozen=True)
class _Kind:
    """Patches (m,) in one box that share the dominant axis and the pattern of zero slopes."""

    zone: int
    patches: Ints
    order: tuple[int, int, int]
    sloping: tuple[bool, bool]


def plan_patches(parts: Partition) -> tuple[SurfaceBatch, ...]:
    """Rectangles, breaks and cells of all patches in lattice boxes, grouped by pattern."""
    if parts.rectangles is not None:
        return plan_rectangles(parts, parts.rectangles)
    planned: list[PatchBatch] = []
    inside = np.flatnonzero(parts.inside)
    graphs = parts.graphs.take(inside)
    pattern = np.column_stack([parts.zone[inside], graphs.axes, graphs.sloping])
    patterns, which = np.unique(pattern, axis=0, return_inverse=True)
    for number, row in enumerate(patterns.tolist()):
        members = inside[which.reshape(-1) == number]
        order, sloping = (row[1], row[2], row[3]), (bool(row[4]), bool(row[5]))
        planned += _plan_kind(_Kind(row[0], members, order, sloping), parts)
    return tuple(planned)


def _plan_kind(kind: _Kind, parts: Partition) -> list[PatchBatch]:
    """Batches of the patches of one kind, one for each pattern of knots."""
    volume = parts.facets.volumes[kind.zone]
    a, b, c = (volume.degrees[axis] for axis in kind.order)
    degrees = (
        volume.net_kind.degree(b + kind.sloping[0] * a),
        volume.net_kind.degree(c + kind.sloping[1] * a),
    )
    tables = [_breaks(kind, i, degrees[i], parts) for i in range(2)]
    pattern = np.concatenate([tables[0][1], tables[1][1]], axis=1)
    patterns, which = np.unique(pattern, axis=0, return_inverse=True)
    batches = []
    for number, row in enumerate(patterns):
        chosen = np.flatnonzero(which.reshape(-1) == number)
        patches = kind.patches[chosen]
        breaks, mults = [], []
        for i, (values, counts) in enumerate(tables):
            first = 0 if i == 0 else len(row) - counts.shape[1]
            used = row[first : first + counts.shape[1]] > 0
            low, high = (ends[patches, kind.order[1 + i]] for ends in (parts.low, parts.high))
            breaks.append(np.column_stack([low, values[chosen][:, used], high]))
            mults.append(counts[chosen[0]][used])
        alike = replace(kind, patches=patches)
        pair = (breaks[0], breaks[1]), (mults[0], mults[1])
        batches.append(_plan_batch(alike, degrees, *pair, parts))
    return batches


def _breaks(kind: _Kind, i: int, degree: int, parts: Partition) -> tuple[Floats, Ints]:
    """Breaks of each patch along b (i = 0) or c (i = 1), rising, and their multiplicities.

    Where one slope alone differs from 0, knots of the dominant axis are iso-lines too. Where one of
    them coincides with a knot of the axis itself, the larger multiplicity counts, at the value of
    the latter.

    Returns
    -------
    (m, n) float64, (m, n) int64
        Padded with multiplicity 0.
    """
    volume, tolerances = parts.facets.volumes[kind.zone], parts.facets.tolerances
    along = kind.order[1 + i]
    boxes = np.stack([parts.low[kind.patches], parts.high[kind.patches]], axis=1)
    low, high = boxes[:, 0, along], boxes[:, 1, along]
    own = volume.knot_planes(along, boxes)
    values, mults, snap = own.values, degree - own.continuity, tolerances.snap(own.continuity)
    if kind.sloping[i] and not kind.sloping[1 - i]:
        graphs = parts.graphs.take(kind.patches)
        other = volume.knot_planes(kind.order[0], boxes)
        rise = other.values - graphs.anchor[:, :1]
        image = rise / graphs.slopes[:, i, None] + graphs.anchor[:, 1 + i, None]
        extra = degree - other.continuity
        for column in range(values.shape[1]):
            meets = np.abs(image - values[:, column, None]) <= tolerances.epsilon
            most = np.where(meets, extra, 0).max(axis=1, initial=0)
            mults[:, column] = np.maximum(mults[:, column], most)
            extra[meets] = 0
        wide = tolerances.snap(other.continuity)
        values = np.concatenate([values, image], axis=1)
        mults = np.concatenate([mults, extra], axis=1)
        snap = np.concatenate([snap, wide], axis=1)
    within = (values > low[:, None] + snap) & (values < high[:, None] - snap)
    mults = np.where(within, mults, 0)
    values = np.where(mults > 0, values, np.inf)
    rank = np.argsort(values, axis=1, kind="stable")
    values = np.take_along_axis(values, rank, axis=1)
    return values, np.take_along_axis(mults, rank, axis=1)


def _plan_batch(
    kind: _Kind,
    degrees: tuple[int, int],
    breaks: tuple[Floats, Floats],
    mults: tuple[Ints, Ints],
    parts: Partition,
) -> PatchBatch:
    """Cells, their heights and the restriction of the volume to them."""
    volume, patches = parts.facets.volumes[kind.zone], kind.patches
    a, b, c = kind.order
    m, jb, jc = len(patches), breaks[0].shape[1] - 1, breaks[1].shape[1] - 1
    low, high = np.empty((m, jb, jc, 3)), np.empty((m, jb, jc, 3))
    low[..., b], high[..., b] = breaks[0][:, :-1, None], breaks[0][:, 1:, None]
    low[..., c], high[..., c] = breaks[1][:, None, :-1], breaks[1][:, None, 1:]
    corner = np.empty((m, jb, jc, 2, 2))
    for i in range(2):
        for j in range(2):
            at_b, at_c = (low, high)[i][..., b], (low, high)[j][..., c]
            corner[..., i, j] = parts.graphs.height(patches, at_b, at_c)
    floor, ceiling = corner.min(axis=(-2, -1)), corner.max(axis=(-2, -1))
    low[..., a], high[..., a] = floor, ceiling
    middle = (low + high) / 2
    if all(kind.sloping):
        # The patch lies in one slab: that of its pieces, not that of the rectangle's corners.
        middle[..., a] = ((parts.low + parts.high) / 2)[patches, a][:, None, None]
    extent = np.where(ceiling > floor, ceiling - floor, 1.0)
    share = (corner - floor[..., None, None]) / extent[..., None, None]
    ends = np.empty((m, jb, jc, 2, 2, 3))
    ends[..., b] = np.stack([low[..., b], high[..., b]], axis=-1)[..., :, None]
    ends[..., c] = np.stack([low[..., c], high[..., c]], axis=-1)[..., None, :]
    ends[..., a] = corner
    flat = (-1, 3)
    cells = volume.cells(middle.reshape(flat))
    return PatchBatch(
        zone=kind.zone,
        patches=patches,
        order=kind.order,
        sloping=kind.sloping,
        degrees=degrees,
        breaks=breaks,
        mults=mults,
        joints=plan_joints(breaks, mults, degrees),
        restriction=volume.restrict(cells, low.reshape(flat), high.reshape(flat)),
        share=share.reshape(-1, 2, 2),
        ends=ends.reshape(-1, 2, 2, 3),
        cells=cells,
        net_kind=volume.net_kind,
    )
