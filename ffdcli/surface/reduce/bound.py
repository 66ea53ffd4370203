"""Certified upper bounds of the distance between spline patches.

The difference of two Bézier patches is a Bézier patch and lies in the hull of its control points;
on quarters of its sides that hull is tight. For rational patches the difference of the quotients is
``(dN W1 - N1 dW) / (W1 W2)`` with ``dN = N1 - N2``, ``dW = W1 - W2``: products of Bernstein
polynomials, divided by the least weights.
"""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.splines.polynomials import elevation, multiply
from ffdcli.splines.spline_spaces import Grid, Space, bezier_points, quarters

# Numbers held at once.
_CHUNK_NUMBERS = 4_000_000
_ULP = float(np.finfo(float).eps)


def on_both(first: Floats, points: Floats, second: Floats) -> Floats:
    """Apply a map to either direction of control points.

    Parameters
    ----------
    first : (m or 1, a, n) float64
    points : (m, n, d, k) float64
        Coordinates are between the two directions.
    second : (m or 1, b, k) float64

    Returns
    -------
    (m, a, d, b) float64
    """
    m, n, d, k = points.shape
    half = first @ points.reshape(m, n, d * k)
    a, b = first.shape[1], second.shape[1]
    other = second.swapaxes(1, 2)
    return np.asarray((half.reshape(m, a * d, k) @ other).reshape(m, a, d, b))


def certified_distance(
    grids: tuple[Grid, Grid],
    points: Floats,
    targets: tuple[Space, Space],
    fitted: Floats,
) -> Floats:
    """Upper bounds of the distance between patches over the same parameters.

    Parameters
    ----------
    grids : (Grid, Grid)
        Cells of the first patches along both directions; all knots of both patches are among the
        bounds of the cells.
    points : (m, nu, d, nv) float64
        Control points of the first patches, coordinates between the directions; homogeneous where
        d is 4.
    targets, fitted
        Spaces and control points of the second patches; no degree is higher.

    Returns
    -------
    (m,) float64, model length
        Includes rounding of this computation. Infinite where a weight may not be positive.
    """
    maps = [grid.pieces for grid in grids]
    p, q = (pieces.shape[2] - 1 for pieces in maps)
    iu, iv = (pieces.shape[1] for pieces in maps)
    raised = [
        elevation(target.degree, degree) @ bezier_points(target, grid.cells)
        for grid, target, degree in zip(grids, targets, (p, q), strict=True)
    ]
    m, d = len(points), points.shape[2]
    strip_size = 16 * (p + 1) * iv * (q + 1) * d * (4 if d == 3 else 40)
    strips = max(1, min(iu, _CHUNK_NUMBERS // strip_size))
    rows = max(1, _CHUNK_NUMBERS // (strip_size * strips))
    bound = np.zeros(m)
    for begin in range(0, m, rows):
        part = slice(begin, min(begin + rows, m))
        for cell in range(0, iu, strips):
            strip = slice(cell, min(cell + strips, iu))
            own = on_both(_some(maps[0], part, strip), points[part], _some(maps[1], part))
            new = on_both(_some(raised[0], part, strip), fitted[part], _some(raised[1], part))
            found = _hull(own, own - new, (p, q), (strip.stop - cell, iv))
            bound[part] = np.maximum(bound[part], found)
    return bound + _rounding(points, fitted, p + q)


def _some(maps: Floats, rows: slice, cells: slice = slice(None)) -> Floats:
    """The maps of some rows and cells, as matrices (m or 1, I (degree + 1), size)."""
    chosen = maps[rows if len(maps) > 1 else slice(None), cells]
    return chosen.reshape(len(chosen), -1, chosen.shape[3])


def _hull(own: Floats, gap: Floats, degrees: tuple[int, int], cells: tuple[int, int]) -> Floats:
    """(m,) largest Bézier point of the difference ``gap``, on quarters of all cells."""
    gap = _quartered(gap, degrees, cells)
    if gap.shape[2] == 3:
        return np.asarray(np.sqrt((gap**2).sum(axis=2).max(axis=(1, 2))))
    own = _quartered(own, degrees, cells)
    (p, q), (iu, iv), m = degrees, cells, len(gap)

    def forms(points: Floats) -> Floats:
        """(m 4 I 4 J, p + 1, q + 1, 4) one form for each quarter of each cell."""
        blocks = points.reshape(m, 4 * iu, p + 1, 4, 4 * iv, q + 1)
        return blocks.transpose(0, 1, 4, 2, 5, 3).reshape(-1, p + 1, q + 1, 4)

    own, gap = forms(own), forms(gap)
    cross = multiply(gap[..., :3], own[..., 3:]) - multiply(own[..., :3], gap[..., 3:])
    size = np.sqrt((cross**2).sum(axis=3).max(axis=(1, 2)))
    least = own[..., 3].min(axis=(1, 2))
    other = (own - gap)[..., 3].min(axis=(1, 2))
    positive = (least > 0) & (other > 0)
    weight = np.where(positive, least * other, 1.0)
    return np.asarray(np.where(positive, size / weight, np.inf).reshape(m, -1).max(axis=1))


def _quartered(points: Floats, degrees: tuple[int, int], cells: tuple[int, int]) -> Floats:
    """Bézier points of every cell (m, I (p + 1), d, J (q + 1)) on quarters of its sides."""
    (p, q), (iu, iv) = degrees, cells
    m, _, d, _ = points.shape
    half = quarters(p) @ points.reshape(m * iu, p + 1, -1)
    half = half.reshape(-1, q + 1) @ quarters(q).T
    return np.asarray(half.reshape(m, iu * 4 * (p + 1), d, iv * 4 * (q + 1)))


def _rounding(points: Floats, fitted: Floats, degree: int) -> Floats:
    """(m,) bound of rounding errors: steps of convex combinations, a few ulp each."""
    scale = np.zeros(len(points))
    for one in (points, fitted):
        largest = np.abs(one).max(axis=(1, 2, 3))
        if one.shape[2] == 4:
            # In quotients, errors of both parts are divided by the least weight.
            weight = one[:, :, 3]
            largest = largest * weight.max(axis=(1, 2)) / weight.min(axis=(1, 2)) ** 2
        scale = np.maximum(scale, largest)
    return np.asarray(8 * (degree + 4) * _ULP * scale)
