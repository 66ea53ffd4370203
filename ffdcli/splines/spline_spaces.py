"""B-spline spaces over [0, 1] and the linear maps between them, many at once.

Spaces with one degree and equal multiplicities are one record with a row of knots for each curve or
patch; a single row serves all where the knots are equal. A map is an array of matrices, one for
each row, that act on control points.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ffdcli.arrays import Floats, Ints


@dataclass(frozen=True)
class Space:
    """Many B-spline spaces of one degree and one pattern of multiplicities.

    Parameters
    ----------
    degree : int
    knots : (m or 1, nb) float64
        Distinct knots, from 0 to 1.
    mults : (nb,) int64
        Multiplicities; the end ones are ``degree + 1``.
    """

    degree: int
    knots: Floats
    mults: Ints

    @property
    def size(self) -> int:
        """Number of control points."""
        return int(self.mults.sum()) - self.degree - 1

    def take(self, rows: Ints) -> Space:
        """The spaces of the chosen rows."""
        if len(self.knots) == 1:
            return self
        return Space(self.degree, self.knots[rows], self.mults)


def bezier_points(space: Space, cells: Floats) -> Floats:
    """Matrices from control points to Bézier points on cells.

    Each Bézier point is the blossom of a polynomial piece at the ends of the cell; since a cell
    lies within a piece, all steps are convex combinations.

    Parameters
    ----------
    space : Space
    cells : (m or 1, I + 1) float64
        Bounds of consecutive cells; every knot of the space is among them.

    Returns
    -------
    (m or 1, I, degree + 1, size) float64
    """
    degree = space.degree
    first, flat = _spans(space, cells)
    rows, count = first.shape
    row = np.arange(rows)[:, None, None]
    low, high = cells[:, :-1, None, None], cells[:, 1:, None, None]
    point = np.arange(degree + 1)
    local = np.broadcast_to(np.eye(degree + 1), (rows, count, *(degree + 1,) * 3))
    for r in range(1, degree + 1):
        i = np.arange(degree + 1 - r)
        left = flat[row, first[:, :, None] + i + r][:, :, None, :]
        right = flat[row, first[:, :, None] + i + degree + 1][:, :, None, :]
        at = np.where(point[:, None] > degree - r, high, low)
        share = ((at - left) / (right - left))[..., None]
        local = (1 - share) * local[..., :-1, :] + share * local[..., 1:, :]
    out = np.zeros((rows, count, degree + 1, space.size))
    cell = np.arange(count)[None, :, None, None]
    column = first[:, :, None, None] + point
    out[row[..., None], cell, point[:, None], column] = local[..., 0, :]
    return out


@lru_cache(maxsize=64)
def quarters(degree: int) -> Floats:
    """(4 (degree + 1), degree + 1) matrix from Bézier points to those of the four quarters."""
    unit = Space(degree, np.array([[0.0, 1.0]]), np.array([degree + 1, degree + 1]))
    out = bezier_points(unit, np.linspace(0.0, 1.0, 5)[None]).reshape(-1, degree + 1)
    out.flags.writeable = False
    return out


def values(space: Space, cells: Floats, shares: Floats) -> Floats:
    """Matrices from control points to values at sites in cells.

    Parameters
    ----------
    space : Space
    cells : (m or 1, I + 1) float64
        Bounds of consecutive cells; every knot of the space is among them.
    shares : (g,) float64
        Sites within each cell, as shares of it.

    Returns
    -------
    (m or 1, I g, size) float64
        Basis functions, by the recurrence of Cox and de Boor.
    """
    degree = space.degree
    first, flat = _spans(space, cells)
    rows, count = first.shape
    row = np.arange(rows)[:, None, None]
    at = cells[:, :-1, None] + np.diff(cells, axis=1)[:, :, None] * shares
    near = flat[row, first[:, :, None] + np.arange(1, 2 * degree + 1)][..., None]
    right = near[:, :, degree:] - at[:, :, None, :]
    left = at[:, :, None, :] - near[:, :, degree - 1 :: -1] if degree else right
    local = np.zeros((degree + 1, rows, count, len(shares)))
    local[0] = 1.0
    for order in range(1, degree + 1):
        carried = np.zeros(at.shape)
        for r in range(order):
            share = local[r] / (right[:, :, r] + left[:, :, order - 1 - r])
            local[r] = carried + right[:, :, r] * share
            carried = left[:, :, order - 1 - r] * share
        local[order] = carried
    out = np.zeros((rows, count, len(shares), space.size))
    column = first[:, :, None, None] + np.arange(degree + 1)
    cell, site = np.arange(count)[:, None, None], np.arange(len(shares))[:, None]
    out[row[..., None], cell, site, column] = local.transpose(1, 2, 3, 0)
    return out.reshape(rows, -1, space.size)


def _spans(space: Space, cells: Floats) -> tuple[Ints, Floats]:
    """First function (m, I) that is not zero on each cell, and all knots (m, K)."""
    knots = space.knots
    middle = (cells[:, 1:] + cells[:, :-1]) / 2
    piece = (middle[:, :, None] >= knots[:, None, 1:-1]).sum(axis=2)
    first = np.cumsum(space.mults)[piece] - 1 - space.degree
    flat = np.repeat(np.broadcast_to(knots, (len(piece), knots.shape[1])), space.mults, axis=1)
    return first, flat


@dataclass(frozen=True)
class Grid:
    """Cells of a space, with Bézier points and values of its splines there.

    Parameters
    ----------
    cells : (m or 1, I + 1) float64
    pieces : (m or 1, I, degree + 1, size) float64
        Map from control points to Bézier points on the cells.
    shares : (g,) float64
        Sites within a cell.
    roots : (m or 1, I g) float64
        Square roots of the weights of the sites; the weights add up to 1.
    values : (m or 1, I g, size) float64
        Map from control points to values at the sites, times the roots.
    """

    cells: Floats
    pieces: Floats
    shares: Floats
    roots: Floats
    values: Floats

    def take(self, rows: Ints) -> Grid:
        """The grids of the chosen rows."""
        if len(self.cells) == 1:
            return self
        return Grid(
            self.cells[rows], self.pieces[rows], self.shares, self.roots[rows], self.values[rows]
        )


def chebyshev_grid(space: Space, cells: Floats) -> Grid:
    """Chebyshev sites in every cell, weighted by the Chebyshev weight of the whole interval.

    With one cell, least squares at these sites truncates the Chebyshev series (economisation),
    which is close to the best approximation in the maximum norm.
    """
    count = space.degree + 2
    angle = (np.arange(count) + 0.5) * (np.pi / count)
    shares = (1 - np.cos(angle)) / 2
    lengths = np.diff(cells, axis=1)
    place = cells[:, :-1, None] + lengths[:, :, None] * shares
    density = np.sin(angle) / np.sqrt(place * (1 - place))
    weights = (lengths[:, :, None] * density).reshape(len(cells), -1)
    roots = np.sqrt(weights / weights.sum(axis=1, keepdims=True))
    weighted = values(space, cells, shares) * roots[:, :, None]
    return Grid(cells, bezier_points(space, cells), shares, roots, weighted)


@dataclass(frozen=True)
class Projection:
    """Maps into a smaller space, close to the identity.

    Parameters
    ----------
    matrix : (m or 1, target size, source size) float64
    residual : (m or 1, N, source size) float64
        Error at the sites, times the square roots of their weights.
    """

    matrix: Floats
    residual: Floats


def project(target: Space, grid: Grid, *, keep_ends: bool) -> Projection:
    """Least squares at the sites of a grid, by QR factorisation.

    Parameters
    ----------
    target : Space
        Its knots are among the bounds of the grid's cells.
    grid : Grid
        Grid of the source space.
    keep_ends : bool
        Whether the first and last control points are kept.
    """
    basis = values(target, grid.cells, grid.shares) * grid.roots[:, :, None]
    rows, size = max(len(basis), len(grid.values)), grid.values.shape[2]
    basis = np.broadcast_to(basis, (rows, *basis.shape[1:]))
    wanted = np.broadcast_to(grid.values, (rows, *grid.values.shape[1:]))
    matrix = np.zeros((rows, target.size, size))
    free = slice(None)
    if keep_ends:
        matrix[:, 0, 0] = matrix[:, -1, -1] = 1.0
        wanted = wanted - basis @ matrix
        free = slice(1, -1)
    if basis[:, :, free].shape[2]:
        q, r = np.linalg.qr(basis[:, :, free])
        solved = np.linalg.solve(r, q.swapaxes(1, 2) @ wanted)
        wanted = wanted - basis[:, :, free] @ solved
        matrix[:, free] = solved
    return Projection(matrix, wanted)
