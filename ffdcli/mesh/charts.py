"""Charts: parts of flat faces on which the texture coordinates are one affine map.

A mesh has texture coordinates at corners, and they are linear on its triangles. A flat face can be
triangulated anew within a chart, but not across its border.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.corners import find_twins, number_sides
from ffdcli.graphs import connected_components

# Texture coordinates closer than this are equal: a tenth of a pixel of a large image.
_SLACK = 1e-5


def find_charts(vertices: Floats, triangles: Ints, uv: Floats, face: Ints) -> Ints:
    """Chart of each triangle of flat faces.

    Parameters
    ----------
    vertices : (V, 3) float64, model length
    triangles : (T, 3) int64
    uv : (T, 3, 2) float64
        Texture coordinates of the corners; NaN for triangles without them.
    face : (T,) int64
        Flat face of each triangle; a chart lies in one face.

    Returns
    -------
    (T,) int64
        Numbered from 0. Within a chart a vertex has one pair of texture coordinates. Triangles
        without texture coordinates are never in one chart with others.
    """
    twin = find_twins(number_sides(triangles, face, len(vertices)).ravel(), triangles.ravel())
    first = np.flatnonzero(twin > np.arange(len(twin)))
    first = first[face[first // 3] == face[twin[first] // 3]]
    joined = _agree(vertices[triangles], uv, first, twin[first])
    pairs = np.column_stack([first // 3, twin[first] // 3])[joined]
    chart = connected_components(len(triangles), *pairs.T)
    # Small differences between neighbours can add up across a chart.
    drifts = _misfit(vertices[triangles], uv, chart) > 2 * _SLACK
    return connected_components(len(triangles), *pairs[~drifts[chart[pairs[:, 0]]]].T)


def _agree(corners: Floats, uv: Floats, side: Ints, twin: Ints) -> Bools:
    """(n,) whether one affine map holds on both triangles of each shared edge.

    The last corner of two coplanar triangles abc and bad is ``d = α a + β b + γ c``, and one affine
    map gives its texture coordinates by the same formula. The large factors of a needle enlarge
    rounding errors, so the difference is divided by the largest factor.
    """

    def corner(of: Floats, sides: Ints, ahead: int) -> Floats:
        # Side 3 t + i begins at corner i of triangle t.
        return np.asarray(of[sides // 3, (sides % 3 + ahead) % 3])

    a, b, c = (corner(corners, side, n) for n in range(3))
    d = corner(corners, twin, 2)
    normal = np.cross(b - a, c - a)
    square = np.einsum("ni,ni->n", normal, normal)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        second = np.einsum("ni,ni->n", np.cross(d - a, c - a), normal) / square
        third = np.einsum("ni,ni->n", np.cross(b - a, d - a), normal) / square
        factors = np.column_stack([1 - second - third, second, third])
        at = np.stack([corner(uv, side, n) for n in range(3)], axis=1)
        off = np.einsum("nk,nkj->nj", factors, at) - corner(uv, twin, 2)
        off = np.abs(off).max(axis=1) / np.maximum(1.0, np.abs(factors).max(axis=1))
        seam = np.abs(
            np.stack([at[:, 0] - corner(uv, twin, 1), at[:, 1] - corner(uv, twin, 0)], axis=1)
        ).max(axis=(1, 2))
    without = np.isnan(uv[:, 0, 0])
    bare = without[side // 3] & without[twin // 3]
    return np.asarray(bare | ((off <= _SLACK) & (seam <= _SLACK)))


def _misfit(corners: Floats, uv: Floats, chart: Ints) -> Floats:
    """(K,) largest distance of texture coordinates from the best affine map of each chart."""
    count = int(chart.max(initial=-1)) + 1
    chosen = np.flatnonzero((np.bincount(chart)[chart] > 1) & ~np.isnan(uv[:, 0, 0]))
    out = np.zeros(count)
    if not len(chosen):
        return out
    _, owner = np.unique(chart[chosen], return_inverse=True)
    number = int(owner.max()) + 1
    # Plane coordinates without the dominant axis of the normal, centred and scaled to size 1.
    area = np.zeros((number, 3))
    arms = corners[chosen][:, 1:] - corners[chosen][:, :1]
    np.add.at(area, owner, np.cross(arms[:, 0], arms[:, 1]))
    dropped = np.argmax(np.abs(area), axis=1)
    kept = np.stack([(dropped + 1) % 3, (dropped + 2) % 3], axis=1)[np.repeat(owner, 3)]
    flat = np.take_along_axis(corners[chosen].reshape(-1, 3), kept, axis=1)
    owner = np.repeat(owner, 3)
    share = np.bincount(owner).astype(np.float64)[:, None]
    flat -= (_sums(flat, owner, number) / share)[owner]
    size = np.zeros(number)
    np.maximum.at(size, owner, np.abs(flat).max(axis=1))
    flat /= np.where(size > 0, size, 1.0)[owner, None]
    rows = np.column_stack([np.ones(len(flat)), flat])
    values = uv[chosen].reshape(-1, 2)
    products = _sums((rows[:, :, None] * rows[:, None]).reshape(-1, 9), owner, number)
    sides = _sums((rows[:, :, None] * values[:, None]).reshape(-1, 6), owner, number)
    fit = np.linalg.pinv(products.reshape(-1, 3, 3), hermitian=True) @ sides.reshape(-1, 3, 2)
    off = np.abs(np.einsum("ni,nij->nj", rows, fit[owner]) - values).max(axis=1)
    np.maximum.at(out, np.repeat(chart[chosen], 3), off)
    return out


def _sums(values: Floats, owner: Ints, count: int) -> Floats:
    """(count, n) sum of the rows (m, n) of each owner."""
    columns = [np.bincount(owner, weights=column, minlength=count) for column in values.T]
    return np.stack(columns, axis=1)
