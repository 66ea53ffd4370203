"""Patches on which the deformation is affine: their exact images are planes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, distinct_rows, run_starts
from ffdcli.surface.partition import Partition
from ffdcli.surface.spline_batch import SurfaceBatch
from ffdcli.volume.protocol import Restriction, Volume

# Control points within this many units in the last place of an affine map count as affine.
_AFFINE_ULPS = 64.0


@dataclass(frozen=True)
class AffineMaps:
    """The affine maps of patches on which the volume is affine.

    Parameters
    ----------
    affine : (Q,) bool
    matrix : (Q, 3, 3) float64
        ``D(x) = matrix @ x + offset`` on patch q, in its own frame; the identity on patches that
        are not affine.
    offset : (Q, 3) float64
    """

    affine: Bools
    matrix: Floats
    offset: Floats


@dataclass(frozen=True)
class PatchCells:
    """The polynomial cells of one volume that patches lie in.

    Parameters
    ----------
    zone : int
        Index of the volume.
    patches : (q,) int64
    starts : (q,) int64
        Start of the cells of each patch in ``which``.
    which : (n,) int64
        Rows of the distinct cells.
    corners : (n, 4, 3) float64, lattice frame
        Corners of the box of the patch: the lowest, and its neighbours along u, v and w.
    cells : (c, 3) int64
        The distinct cells.
    bounds : (c, 2, 3) float64, lattice frame
        Corners of the distinct cells.
    restriction : Restriction
        Bézier form of the volume on the distinct cells.
    fitting : (3, p) float64
        Matrix from Bézier points to the slopes of the best affine map of the unit cell.
    """

    zone: int
    patches: Ints
    starts: Ints
    which: Ints
    corners: Floats
    cells: Ints
    bounds: Floats
    restriction: Restriction
    fitting: Floats

    @property
    def centre(self) -> Floats:
        """(c, 3) centres of the distinct cells."""
        return (self.bounds[:, 0] + self.bounds[:, 1]) / 2


def plan_cells(batches: Sequence[SurfaceBatch], parts: Partition) -> tuple[PatchCells, ...]:
    """The distinct cells that patches lie in, for each volume that has any.

    Parameters
    ----------
    batches : sequence of SurfaceBatch
        All patches in lattice boxes.
    parts : Partition
    """
    planned = []
    for number, volume in enumerate(parts.facets.volumes):
        mine = [batch for batch in batches if batch.zone == number]
        if not mine:
            continue
        patches = np.concatenate([batch.patches for batch in mine])
        counts = np.concatenate([np.full(batch.count, int(np.prod(batch.shape))) for batch in mine])
        owner = np.repeat(patches, counts)
        low, extent = parts.low[owner], (parts.high - parts.low)[owner]
        steps = np.concatenate([np.zeros((1, 3)), np.eye(3)])
        cells = np.concatenate([batch.cells for batch in mine])
        used, which = distinct_rows(cells)
        bounds = volume.cell_bounds(used)
        planned.append(
            PatchCells(
                zone=number,
                patches=patches,
                starts=run_starts(counts)[:-1],
                which=which,
                corners=low[:, None, :] + steps * extent[:, None, :],
                cells=used,
                bounds=bounds,
                restriction=volume.restrict(used, bounds[:, 0], bounds[:, 1]),
                fitting=fitting_matrix(volume),
            )
        )
    return tuple(planned)


def find_affine(volumes: Sequence[Volume], planned: Sequence[PatchCells], count: int) -> AffineMaps:
    """Find the patches on whose polynomial cells their volume is one affine map.

    Parameters
    ----------
    volumes : sequence of Volume
        With the control nets to apply.
    planned : sequence of PatchCells
    count : int
        Number of patches; those outside all lattice boxes have the identity.
    """
    maps = AffineMaps(
        np.ones(count, dtype=bool), np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    )
    for cells in planned:
        _find_in_box(volumes[cells.zone], cells, maps)
    return maps


def _find_in_box(volume: Volume, cells: PatchCells, maps: AffineMaps) -> None:
    """Fill in the rows of ``maps`` of the patches in the box of one volume."""
    slopes, image, fits = fit_cells(volume, cells.restriction, cells.bounds, cells.fitting)
    which, centre = cells.which, cells.centre
    # The maps of the cells of a patch are one map where they agree on the box of the patch.
    images = np.einsum("nij,npj->npi", slopes[which], cells.corners - centre[which, None])
    images = images + image[which, None]
    lowest = np.minimum.reduceat(images, cells.starts)
    highest = np.maximum.reduceat(images, cells.starts)
    agree = (highest - lowest).max(axis=(1, 2)) <= rounding_of(volume)
    # A singular map gives no plane.
    volume_change = np.abs(np.linalg.det(slopes))
    largest = np.linalg.norm(slopes, axis=(1, 2)) ** 3
    fits = fits & (volume_change > _AFFINE_ULPS * np.finfo(float).eps * largest)
    flat = agree & np.logical_and.reduceat(fits[which], cells.starts)
    maps.affine[cells.patches] = flat
    chosen = which[cells.starts[flat]]
    maps.matrix[cells.patches[flat]] = slopes[chosen]
    shift = np.einsum("nij,nj->ni", slopes[chosen], centre[chosen])
    maps.offset[cells.patches[flat]] = image[chosen] - shift


def _unit_points(volume: Volume) -> Floats:
    """(p, 3) undeformed Bézier points of the unit cell about the origin."""
    axes = [np.linspace(-0.5, 0.5, degree + 1) for degree in volume.degrees]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def fitting_matrix(volume: Volume) -> Floats:
    """(3, p) matrix from Bézier points to the slopes of the best affine map of the unit cell."""
    return np.asarray(np.linalg.pinv(_unit_points(volume)), dtype=np.float64)


def fit_cells(
    volume: Volume, restriction: Restriction, bounds: Floats, fitting: Floats
) -> tuple[Floats, Floats, Bools]:
    """Best affine map of each cell: slopes (c, 3, 3), image of the centre (c, 3), whether exact.

    Parameters
    ----------
    volume : Volume
    restriction : Restriction
        Bézier form of the volume on c cells.
    bounds : (c, 2, 3) float64, lattice frame
        Corners of the cells.
    fitting : (3, p) float64
        From :func:`fitting_matrix`.
    """
    points = restriction.apply(volume.net)
    values = points.reshape(len(points), -1, points.shape[-1])
    values, uniform = volume.net_kind.plain(values)
    mean = values.mean(axis=1)
    slopes = np.einsum("ai,nid->nda", fitting, values - mean[:, None])
    rest = _unit_points(volume)
    residual = values - mean[:, None] - np.einsum("nda,ia->nid", slopes, rest)
    fits = uniform & (np.abs(residual).max(axis=(1, 2)) <= rounding_of(volume))
    slopes = slopes / (bounds[:, 1] - bounds[:, 0])[:, None, :]
    if volume.net_kind.displaces:
        slopes, mean = slopes + np.eye(3), mean + bounds.mean(axis=1)
    return slopes, mean, fits


def divide_equal_weights(points: Floats) -> tuple[Floats, Bools]:
    """Points from homogeneous points, and whether the weights of each item are equal to 64 ulp.

    Parameters
    ----------
    points : (m, ..., 3 or 4) float64

    Returns
    -------
    (m, ..., 3) float64, (m,) bool
        Points divided by their weights; True where the weights of an item are equal, so that it
        is polynomial. Items without weights are.
    """
    if points.shape[-1] == 3:
        return points, np.ones(len(points), dtype=bool)
    weights = points[..., 3].reshape(len(points), -1)
    spread = np.ptp(weights, axis=1)
    equal = spread <= _AFFINE_ULPS * np.finfo(float).eps * np.abs(weights).max(axis=1)
    return points[..., :3] / points[..., 3:], equal


def rounding_of(volume: Volume) -> float:
    """Difference of control points that counts as rounding."""
    return float(_AFFINE_ULPS * np.finfo(float).eps * volume.largest)
