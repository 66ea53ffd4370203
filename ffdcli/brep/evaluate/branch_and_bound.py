"""Nearest points by branch and bound, for points whose local searches found none near enough.

Local searches depend on where they start and may all miss. Here every piece of every surface has a
box that holds it. A piece whose box is farther than the tolerance is out; others are halved until a
point near enough is found or none is left. So "too far" is a statement about all of the surface.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bspline import chunks
from ffdcli.brep.evaluate.nearest import Feet, Solver, improve
from ffdcli.brep.evaluate.trim import expand

# Points of surfaces evaluated, and pairs of a point and a cell compared, at most in all; pairs
# compared at once; cells near one point, beyond its pieces; halvings of a piece.
EFFORT = 30_000_000
PAIRS = 1_000_000
CROWD = 2000
HALVINGS = 80
# Points searched first, and at once. A distance is known once no cell is nearer than this share
# of it.
FIRST, BLOCK = 50, 2000
SHARE = 0.9
# Cells sampled at once.
CELLS = 4096
# Margin for interpolation, as a multiple of the last two degrees' coefficients.
TAIL = 4.0


@dataclass(frozen=True)
class Sheets:
    """Surfaces in pieces over rectangles of parameters.

    Parameters
    ----------
    low, high : (P, 2) float64
        Parameters of each piece.
    at : (pieces (n,), parameters (n, 2)) -> homogeneous positions (n, 4), model length
    degree : int
        Of the interpolation, along each parameter.
    exact : bool
        Whether homogeneous positions on a piece are polynomials of at most this degree. The boxes
        are then bounds; otherwise their margin is estimated from the decay of the coefficients.
    params : parameters (n, 2) -> parameters of the solver (n, 2)
    holds : (pieces (n,), low (n, 2), high (n, 2)) -> (n,) whether the surface has points there
    """

    low: Floats
    high: Floats
    at: Callable[[Ints, Floats], Floats]
    degree: int
    exact: bool
    params: Callable[[Floats], Floats]
    holds: Callable[[Ints, Floats, Floats], Bools]

    @cached_property
    def roots(self) -> _Cells:
        """Every piece as one cell."""
        return _cells(self, np.arange(len(self.low)), self.low, self.high)


@dataclass(frozen=True)
class _Cells:
    """Parts of pieces, with boxes that hold them."""

    piece: Ints
    low: Floats
    high: Floats
    centre: Floats
    axes: Floats
    half: Floats
    longer: Ints

    def away(self, cell: Ints, points: Floats) -> Floats:
        """Distances (n,) of points (n, 3) from the boxes of cells (n,)."""
        arm = np.einsum("nij,nj->ni", self.axes[cell], points - self.centre[cell])
        beyond = np.maximum(np.abs(arm) - self.half[cell], 0)
        away: Floats = np.sqrt(np.einsum("ni,ni->n", beyond, beyond))
        return away


def search_all(
    sheets: Sheets, solver: Solver, points: Floats, feet: Feet, tolerance: float
) -> Feet:
    """Feet of points (n, 3) farther than ``tolerance``, with a lower bound of each distance.

    The worst points come first. The search ends where one of a block is proved to be too far: then
    the verdict is known. It also ends after ``EFFORT``; bounds then hold as far as it came.

    Parameters
    ----------
    sheets : Sheets
    solver : Solver
        Its owners are pieces.
    feet : Feet
        Of earlier searches.

    Returns
    -------
    Feet
        Owners are -1 where no nearer foot was found. ``least`` is at least ``tolerance`` where the
        distance is proved to be above it.
    """
    feet = replace(feet, owner=np.full(len(points), -1, dtype=np.int64))
    # Boxes cannot tell apart what is nearer than the rounding of the search.
    tolerance = max(tolerance, solver.settle)
    asked = np.flatnonzero(feet.distance > tolerance)
    if not len(asked):
        return feet
    asked = asked[np.argsort(-feet.distance[asked], kind="stable")]
    left = EFFORT
    size = int(np.clip(PAIRS // max(len(sheets.low), 1), 1, BLOCK))
    first = min(size, FIRST)
    blocks = [asked[:first], *(asked[first:][part] for part in chunks(len(asked) - first, size))]
    for block in blocks:
        feet, spent = _search(sheets, solver, points, feet, block, tolerance, left)
        left -= spent
        too_far = (feet.distance[block] > tolerance) & (feet.least[block] >= tolerance)
        if left <= 0 or too_far.any():
            break
    return feet


def _search(
    sheets: Sheets,
    solver: Solver,
    points: Floats,
    feet: Feet,
    which: Ints,
    tolerance: float,
    effort: int,
) -> tuple[Feet, int]:
    """Search all cells for some points; the feet, and the pairs examined."""
    cells = sheets.roots
    row, cell = (index.ravel() for index in np.indices((len(which), len(cells.piece))))
    away = np.zeros(len(row))
    least = np.full(len(which), np.inf)
    spent = 0
    for _ in range(HALVINGS):
        spent += len(row)
        away = np.maximum(cells.away(cell, points[which[row]]) - solver.settle, away)
        row, cell, away = _nearer(row, cell, away, feet.distance[which], tolerance)
        feet = _try_cells(sheets, solver, points, feet, which, cells, row, cell, away)
        row, cell, away = _nearer(row, cell, away, feet.distance[which], tolerance)
        crowded = np.bincount(row, minlength=len(which))[row] > CROWD + len(sheets.low)
        np.minimum.at(least, row[crowded], away[crowded])
        row, cell, away = row[~crowded], cell[~crowded], away[~crowded]
        if not len(row) or spent > effort:
            break
        used, place = np.unique(cell, return_inverse=True)
        cells, first, count = _halves(sheets, cells, used)
        spent += 2 * len(used) * (sheets.degree + 1) ** 2
        pair, child = expand(count[place])
        row, away, cell = row[pair], away[pair], first[place[pair]] + child
    np.minimum.at(least, row, away)
    bounds = feet.least.copy()
    distance = feet.distance[which]
    known = np.minimum(least, np.maximum(tolerance, SHARE * distance))
    bounds[which] = np.where(distance > tolerance, known, 0.0)
    return replace(feet, least=bounds), spent


def _try_cells(
    sheets: Sheets,
    solver: Solver,
    points: Floats,
    feet: Feet,
    which: Ints,
    cells: _Cells,
    row: Ints,
    cell: Ints,
    away: Floats,
) -> Feet:
    """Feet improved by the middle of each point's nearest cell, and by a search from there.

    Searches may end outside the outline although the cell reaches inside; so the nearest middle
    that lies inside counts by itself.
    """
    if not len(row):
        return feet
    gap = np.linalg.norm(points[which[row]] - cells.centre[cell], axis=1)
    middle = (cells.low + cells.high) / 2
    inner = np.zeros(len(middle), dtype=bool)
    used = np.unique(cell)
    inner[used] = solver.accept(cells.piece[used], sheets.params(middle[used]))
    gap[~inner[cell]] = np.inf
    best = _first(row, gap)
    best = best[inner[cell[best]]]
    mine, piece, start = (
        which[row[best]],
        cells.piece[cell[best]],
        sheets.params(middle[cell[best]]),
    )
    gap = np.linalg.norm(points[mine] - solver.evaluate(piece, start)[0], axis=1)
    nearer = gap < feet.distance[mine]
    distance, owner, params = feet.distance.copy(), feet.owner.copy(), feet.params.copy()
    mine = mine[nearer]
    distance[mine], owner[mine], params[mine] = gap[nearer], piece[nearer], start[nearer]
    feet = replace(feet, distance=distance, owner=owner, params=params)
    feet = improve(solver, points, feet, mine, piece[nearer], start[nearer])
    best = _first(row, away)
    start = sheets.params(middle[cell[best]])
    return improve(solver, points, feet, which[row[best]], cells.piece[cell[best]], start)


def _first(row: Ints, value: Floats) -> Ints:
    """Index of the least value in each row."""
    ranked = np.lexsort((value, row))
    return ranked[np.flatnonzero(np.diff(row[ranked], prepend=-1))]


def _nearer(
    row: Ints, cell: Ints, away: Floats, distance: Floats, tolerance: float
) -> tuple[Ints, Ints, Floats]:
    """The pairs that may still change the verdict or the distance by a tenth."""
    limit = np.where(distance > tolerance, np.maximum(tolerance, SHARE * distance), 0.0)
    keep = away < limit[row]
    return row[keep], cell[keep], away[keep]


def _halves(sheets: Sheets, cells: _Cells, used: Ints) -> tuple[_Cells, Ints, Ints]:
    """Halves of some cells across their longer side: with the first and number for each."""
    piece = np.repeat(cells.piece[used], 2)
    low, high = np.repeat(cells.low[used], 2, axis=0), np.repeat(cells.high[used], 2, axis=0)
    side = cells.longer[used]
    number = np.arange(len(used))
    middle = (low[::2][number, side] + high[::2][number, side]) / 2
    high[2 * number, side] = middle
    low[2 * number + 1, side] = middle
    held = sheets.holds(piece, low, high)
    count = held.reshape(-1, 2).sum(axis=1)
    return _cells(sheets, piece[held], low[held], high[held]), np.cumsum(count) - count, count


def _cells(sheets: Sheets, piece: Ints, low: Floats, high: Floats) -> _Cells:
    """Cells with boxes along their own tangents, whose thickness falls with the square of size."""
    order = sheets.degree + 1
    nodes, transform, middle = _chebyshev(order)
    centre, half = np.empty((len(piece), 3)), np.empty((len(piece), 3))
    axes = np.empty((len(piece), 3, 3))
    longer = np.empty(len(piece), dtype=np.int64)
    grid = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 2)
    for part in chunks(len(piece), CELLS):
        uv = low[part, None] + grid * (high[part] - low[part])[:, None]
        values = sheets.at(np.repeat(piece[part], len(grid)), uv.reshape(-1, 2))
        values = values.reshape(-1, order, order, 4)
        forms = np.einsum("ai,bj,mijc->mabc", transform, transform, values, optimize=True)
        weight = np.abs(forms[..., 3]).sum(axis=(1, 2))
        least = 2 * forms[:, 0, 0, 3] - weight
        at = np.einsum("a,b,mabc->mc", middle, middle, forms)
        centre[part] = at[:, :3] / at[:, 3:]
        rest = forms[..., :3] - forms[..., 3:] * centre[part, None, None]
        tangents = np.stack([rest[:, 1, 0], rest[:, 0, 1]], axis=2)
        turn = np.swapaxes(np.linalg.qr(tangents, mode="complete")[0], 1, 2)
        reach = np.abs(np.einsum("mxy,maby->mabx", turn, rest))
        wide = reach.sum(axis=(1, 2))
        if not sheets.exact:
            wide += TAIL * (wide - reach[:, :-2, :-2].sum(axis=(1, 2)))
        with np.errstate(divide="ignore"):
            half[part] = np.where(least > 0, 1 / np.maximum(least, 0), np.inf)[:, None] * wide
        axes[part] = turn
        sides = [reach[:, 1:].sum(axis=(1, 2, 3)), reach[:, :, 1:].sum(axis=(1, 2, 3))]
        longer[part] = np.argmax(sides, axis=0)
    return _Cells(piece, low, high, centre, axes, half, longer)


def _chebyshev(order: int) -> tuple[Floats, Floats, Floats]:
    """Nodes on [0, 1], the matrix from values there to coefficients, and the basis in the middle.

    At most ``order`` coefficients, by the roots of the next Chebyshev polynomial.
    """
    angle = np.pi * (np.arange(order) + 0.5) / order
    number = np.arange(order)
    transform = np.cos(number[:, None] * angle) * 2 / order
    transform[0] /= 2
    return (1 + np.cos(angle)) / 2, transform, np.cos(number * np.pi / 2)
