"""Surfaces of patches as Feng 2002 makes them: interpolated over their bounding rectangles.

The polynomial of the patch's knot box is sampled on the rectangle, also where the rectangle leaves
the box (section 3.4.2); its bi-degree is that of Table 1. In exact arithmetic the surfaces are the
same as those of :mod:`ffdcli.surface.patches`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.surface.interpolation import interpolate, lebesgue
from ffdcli.surface.partition import Partition
from ffdcli.surface.rectangles import Rectangles
from ffdcli.surface.spline_batch import SurfaceBatch, plan_joints
from ffdcli.volume.protocol import Volume

# Rounding error of a sample, in units in the last place of the largest coordinate.
_SAMPLE_ULPS = 64.0


@dataclass(frozen=True, kw_only=True)
class RectangleBatch(SurfaceBatch):
    """Surfaces in one box with one pair of degrees; their parameters are s and t.

    The boxes of the restriction are points: the samples of each patch, t fastest.

    Parameters
    ----------
    reach : float
        Largest factor by which the continuation outside a cell may enlarge rounding errors.
    """

    reach: float

    @property
    def boxes_each(self) -> int:
        """Number of samples of a patch."""
        return int(np.prod(self.pole_counts))

    def rounding(self, volume: Volume) -> float:
        """Bound of the rounding error of the surfaces on their rectangles, model length.

        That of samples, times the Lebesgue constants of both degrees.
        """
        s, t = self.degrees
        sample = _SAMPLE_ULPS * np.finfo(float).eps * self.reach * volume.largest
        growth = lebesgue(s) * lebesgue(t)
        if self.net_kind.rational:
            weights = self.weights(volume.net, np.arange(self.count))
            growth *= 2 * float(weights.max() / weights.min())
        return float(growth * sample)

    def _compose(self, points: Floats, index: Ints) -> Floats:
        return points[:, 0, 0, 0]

    def _join(self, forms: Floats, chosen: Ints) -> Floats:
        return interpolate(forms.reshape(len(chosen), *self.pole_counts, -1))


def plan_rectangles(parts: Partition, rectangles: Rectangles) -> tuple[RectangleBatch, ...]:
    """Samples and cells of all patches in lattice boxes, grouped by box and degrees."""
    batches = []
    for zone, volume in enumerate(parts.facets.volumes):
        which = np.flatnonzero(parts.zone == zone)
        net_degrees = (rectangles.axes[which] != 0) @ np.array(volume.degrees)
        for pair in np.unique(net_degrees, axis=0).tolist():
            patches = which[(net_degrees == pair).all(axis=1)]
            s, t = (volume.net_kind.degree(degree) for degree in pair)
            batches.append(_plan_batch(parts, rectangles, zone, patches, (s, t)))
    return tuple(batches)


def _plan_batch(
    parts: Partition, rectangles: Rectangles, zone: int, patches: Ints, degrees: tuple[int, int]
) -> RectangleBatch:
    volume, extent = parts.facets.volumes[zone], rectangles.extent[patches]
    cells = volume.cells((parts.low + parts.high)[patches] / 2)
    shares = np.meshgrid(*(np.arange(n + 1) / n for n in degrees), indexing="ij")
    sites = np.stack(shares, axis=-1).reshape(-1, 2)
    places = rectangles.points(sites * extent[:, None], patches)
    bounds = volume.cell_bounds(cells)
    low, high = bounds[:, None, 0], bounds[:, None, 1]
    # A Bernstein form of degree k at a distance of x lengths from its cell: (1 + 2 x)^k.
    beyond = np.maximum(np.maximum(places - high, low - places), 0.0) / (high - low)
    reach = ((1 + 2 * beyond) ** np.array(volume.degrees)).prod(axis=2).max()
    breaks = (np.zeros((len(patches), 2)), np.zeros((len(patches), 2)))
    for i in range(2):
        breaks[i][:, 1] = extent[:, i]
    none = np.zeros(0, dtype=np.int64)
    at = places.reshape(-1, 3)
    return RectangleBatch(
        zone=zone,
        patches=patches,
        degrees=degrees,
        breaks=breaks,
        mults=(none, none),
        joints=plan_joints(breaks, (none, none), degrees),
        restriction=volume.at_points(np.repeat(cells, len(sites), axis=0), at),
        ends=at,
        cells=cells,
        net_kind=volume.net_kind,
        reach=float(reach),
    )
