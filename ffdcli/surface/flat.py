"""Where the deformation is affine: there the exact result is a plane with straight edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ffdcli.surface.partition import Partition
from ffdcli.surface.patches import PatchBatch
from ffdcli.volume.protocol import Volume

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Control points within this many units in the last place of one affine map count as affine.
_AFFINE_ULPS = 64.0


@dataclass(frozen=True)
class AffineMaps:
    """The affine map of each patch, where the volume is one there.

    Parameters
    ----------
    affine : (Q,) bool
    matrix : (Q, 3, 3) float64
        ``D(x) = matrix @ x + offset`` on patch q, in its own frame; the identity where it is not
        affine.
    offset : (Q, 3) float64
    """

    affine: NDArray[np.bool_]
    matrix: Floats
    offset: Floats


def find_affine(
    volumes: Sequence[Volume], batches: Sequence[PatchBatch], parts: Partition
) -> AffineMaps:
    """Find the patches on whose polynomial cells their volume is one affine map.

    Parameters
    ----------
    volumes : sequence of Volume
        With the control nets to apply.
    batches : sequence of PatchBatch
        All patches in lattice boxes; those outside have the identity.
    parts : Partition
    """
    count = len(parts.low)
    maps = AffineMaps(
        np.ones(count, dtype=bool), np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    )
    for number, volume in enumerate(volumes):
        mine = [batch for batch in batches if batch.zone == number]
        if mine:
            there = np.concatenate([batch.patches for batch in mine])
            found = _find_in_box(volume, mine, parts)
            maps.affine[there] = found.affine[there]
            maps.matrix[there] = found.matrix[there]
            maps.offset[there] = found.offset[there]
    return maps


def _find_in_box(volume: Volume, batches: Sequence[PatchBatch], parts: Partition) -> AffineMaps:
    """The same for the patches in the box of one volume."""
    low, high = parts.low, parts.high
    count = len(low)
    matrix = np.tile(np.eye(3), (count, 1, 1))
    offset = np.zeros((count, 3))
    cells = np.concatenate([batch.cells for batch in batches])
    owner = np.concatenate(
        [np.repeat(batch.patches, batch.shape[0] * batch.shape[1]) for batch in batches]
    )
    used, which = np.unique(cells, axis=0, return_inverse=True)
    which = which.reshape(-1)
    slopes, origin, fits = _fit_cells(volume, used)
    scale = _rounding(volume)

    # Maps of neighbouring cells are one map where they agree on the patch's own box.
    corner = (
        low[owner][:, None, :]
        + np.concatenate([np.zeros((1, 3)), np.eye(3)]) * ((high - low)[owner][:, None, :])
    )
    images = np.einsum("nij,npj->npi", slopes[which], corner - origin[which, None, 0])
    images = images + origin[which, None, 1]
    lowest = np.full((count, 4, 3), np.inf)
    highest = np.full((count, 4, 3), -np.inf)
    np.minimum.at(lowest, owner, images)
    np.maximum.at(highest, owner, images)
    with np.errstate(invalid="ignore"):
        agree = (highest - lowest).max(axis=(1, 2)) <= scale
    bent = np.zeros(count, dtype=bool)
    # A map that flattens space leaves no plane to write.
    volume_change = np.abs(np.linalg.det(slopes))
    largest = np.linalg.norm(slopes, axis=(1, 2)) ** 3
    fits &= volume_change > _AFFINE_ULPS * np.finfo(float).eps * largest
    bent[owner[~fits[which]]] = True
    present = np.zeros(count, dtype=bool)
    present[owner] = True
    affine = ~present | (agree & ~bent)
    chosen = np.zeros(count, dtype=np.int64)
    chosen[owner] = which
    flat = np.flatnonzero(affine & present)
    matrix[flat] = slopes[chosen[flat]]
    shift = np.einsum("nij,nj->ni", slopes[chosen[flat]], origin[chosen[flat], 0])
    offset[flat] = origin[chosen[flat], 1] - shift
    return AffineMaps(affine, matrix, offset)


def _fit_cells(volume: Volume, cells: Ints) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Best affine map of each cell: slopes (n, 3, 3), (centre, image) (n, 2, 3), does it fit."""
    bounds = volume.cell_bounds(cells)
    points = volume.restrict(cells, bounds[:, 0], bounds[:, 1]).apply(volume.net)
    axes = [np.linspace(-0.5, 0.5, degree + 1) for degree in volume.degrees]
    rest = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    values = points.reshape(len(cells), -1, points.shape[-1])
    values, uniform = volume.embedding.plain(values)
    mean = values.mean(axis=1)
    slopes = np.einsum("ai,nid->nda", np.linalg.pinv(rest), values - mean[:, None])
    residual = values - mean[:, None] - np.einsum("nda,ia->nid", slopes, rest)
    fits = uniform & (np.abs(residual).max(axis=(1, 2)) <= _rounding(volume))
    extent = bounds[:, 1] - bounds[:, 0]
    centre = (bounds[:, 0] + bounds[:, 1]) / 2
    slopes = slopes / extent[:, None, :]
    if volume.embedding.displaces:
        slopes, mean = slopes + np.eye(3), mean + centre
    return slopes, np.stack([centre, mean], axis=1), fits


def divide_equal_weights(points: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Plain points of homogeneous ones, and where that is all: weights equal to 64 ulp.

    Parameters
    ----------
    points : (m, ..., 3 or 4) float64

    Returns
    -------
    (m, ..., 3) float64, (m,) bool
        Points divided by their own weights; True where an item's weights are all equal, so that
        it is polynomial. Without weights everything is.
    """
    if points.shape[-1] == 3:
        return points, np.ones(len(points), dtype=bool)
    weights = points[..., 3].reshape(len(points), -1)
    spread = np.ptp(weights, axis=1)
    equal = spread <= _AFFINE_ULPS * np.finfo(float).eps * np.abs(weights).max(axis=1)
    return points[..., :3] / points[..., 3:], equal


def _rounding(volume: Volume) -> float:
    """What counts as rounding of control points."""
    return float(_AFFINE_ULPS * np.finfo(float).eps * volume.largest)
