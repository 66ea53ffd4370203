"""Cholesky factors of sparse matrices of functions with local supports, by nested dissection.

A plane divides the functions into those on either side, which share no entry, and those that it
cuts, which are eliminated last (George 1973). What is left of each part after elimination is a
dense matrix of its neighbours, so all arithmetic is that of LAPACK (Duff & Reid 1983).

With 13,000 unknowns, scipy's ``splu`` takes 4.7 times as long with its own order, 3.0 times with
this one, and CHOLMOD in the wheel ``cholespy`` 16 times; and none of them tells which rows depend
on others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats, Ints

# Functions that are not divided further.
_FEW = 150
# Share of the functions that a plane leaves on one side at most.
_UNEVEN = 0.8
# Pivot, relative to the diagonal, below which a row counts as dependent.
_DEPENDENT = 1e-9
# Columns whose products are subtracted together.
_PANEL = 64


@dataclass(frozen=True)
class _Node:
    """Rows ``start`` to ``stop``, eliminated together, after those of ``parts``."""

    start: int
    stop: int
    parts: tuple[_Node, ...]


@dataclass(frozen=True)
class _Eliminated:
    """Factors of the rows of one node: ``diagonal`` (s, s) lower, ``below`` (b, s)."""

    start: int
    stop: int
    outer: Ints
    diagonal: Floats
    below: Floats


class NotPositive(ValueError):
    """The matrix is not positive definite in floating point."""


@dataclass(frozen=True, eq=False)
class Order:
    """Order of elimination.

    Parameters
    ----------
    rows : (n,) int64
        Row of the matrix at each place of the order.
    root : _Node
    """

    rows: Ints
    root: _Node


def dissect(supports: Floats) -> Order:
    """Order of elimination of functions that vanish outside boxes (n, 2, 3)."""
    rows: list[Ints] = []
    root, _ = _divide(np.arange(len(supports)), supports, 0, rows)
    return Order(np.concatenate([*rows, np.zeros(0, dtype=np.int64)]), root)


def _divide(members: Ints, supports: Floats, start: int, rows: list[Ints]) -> tuple[_Node, int]:
    cut = _best_plane(supports[members]) if len(members) > _FEW else None
    if cut is None:
        rows.append(members)
        return _Node(start, start + len(members), ()), start + len(members)
    below, above = cut
    parts = []
    for side in (below, above):
        node, start = _divide(members[side], supports, start, rows)
        parts.append(node)
    own = members[~(below | above)]
    rows.append(own)
    return _Node(start, start + len(own), tuple(parts)), start + len(own)


def _best_plane(supports: Floats) -> tuple[Ints, Ints] | None:
    """Which functions (n,) lie below and above the plane that cuts fewest; None for no good one."""
    count, best, found = len(supports), len(supports), None
    middle = supports.mean(axis=1)
    for axis in range(3):
        for share in (0.5, 0.4, 0.6):
            plane = np.partition(middle[:, axis], int(share * count))[int(share * count)]
            # Supports end at planes of cells: the nearest one cuts fewest.
            ends = supports[:, :, axis].ravel()
            plane = ends[np.argmin(np.abs(ends - plane))]
            below, above = supports[:, 1, axis] <= plane, supports[:, 0, axis] >= plane
            few, most = sorted((int(below.sum()), int(above.sum())))
            own = count - few - most
            if own < best and few and most <= _UNEVEN * count:
                best, found = own, (below, above)
    return found if best < 0.7 * count else None


@dataclass(frozen=True, eq=False)
class Cholesky:
    """Factors of a matrix; :meth:`solve` divides by it.

    Parameters
    ----------
    order : Order
    scale : (n,) float64
        One over the root of the diagonal; the factors are of the matrix with unit diagonal.
    eliminated : sequence of _Eliminated
    """

    order: Order
    scale: Floats
    eliminated: Sequence[_Eliminated]

    def solve(self, right: Floats) -> Floats:
        """Solutions (n, c) for right sides (n, c)."""
        x = (self.scale[:, None] * right)[self.order.rows]
        for part in self.eliminated:
            own = dtrtrs(part.diagonal, x[part.start : part.stop], lower=1)[0]
            x[part.start : part.stop] = own
            x[part.outer] -= part.below @ own
        for part in reversed(self.eliminated):
            own = x[part.start : part.stop] - part.below.T @ x[part.outer]
            x[part.start : part.stop] = dtrtrs(part.diagonal, own, lower=1, trans=1)[0]
        out = np.empty_like(x)
        out[self.order.rows] = x
        return np.asarray(self.scale[:, None] * out)


def cholesky(matrix: csr_array, order: Order, shift: float) -> Cholesky:
    """Factors of a symmetric matrix whose diagonal grows by a share ``shift``.

    Raises
    ------
    NotPositive
        A pivot is not positive.
    """
    scale, ordered = _ordered(matrix, order)
    found: list[_Eliminated] = []
    _eliminate(order.root, ordered, shift, found, None)
    return Cholesky(order, scale, found)


def dependent(matrix: csr_array, order: Order) -> Bools:
    """(n,) rows of a positive semidefinite matrix that depend on rows before them in the order."""
    _, ordered = _ordered(matrix, order)
    dropped: list[int] = []
    _eliminate(order.root, ordered, 0.0, [], dropped)
    out = np.zeros(len(order.rows), dtype=bool)
    out[order.rows[dropped]] = True
    return out


def _ordered(matrix: csr_array, order: Order) -> tuple[Floats, csr_array]:
    """One over the root of the diagonal (n,), and the upper half in order with unit diagonal."""
    diagonal = matrix.diagonal()
    if not np.all(diagonal > 0):
        raise NotPositive
    scale = 1 / np.sqrt(diagonal)
    place = np.empty(len(scale), dtype=np.int64)
    place[order.rows] = np.arange(len(scale))
    row = np.repeat(np.arange(len(scale)), np.diff(matrix.indptr))
    values = matrix.data * scale[row] * scale[matrix.indices]
    entries = (place[row], place[matrix.indices])
    upper = entries[1] >= entries[0]
    places = (entries[0][upper], entries[1][upper])
    return scale, csr_array((values[upper], places), shape=matrix.shape)


def _eliminate(
    node: _Node,
    ordered: csr_array,
    shift: float,
    found: list[_Eliminated],
    dropped: list[int] | None,
) -> tuple[Ints, Floats]:
    """Eliminate a node after its parts; the rows left (b,) and the lower half left on them (b, b).

    The factors are appended to ``found``; with ``dropped`` only the rows that depend on others,
    which are left out.
    """
    left = [_eliminate(part, ordered, shift, found, dropped) for part in node.parts]
    start, stop = node.start, node.stop
    entries = slice(ordered.indptr[start], ordered.indptr[stop])
    column = ordered.indices[entries]
    row = np.repeat(np.arange(stop - start), np.diff(ordered.indptr[start : stop + 1]))
    own = stop - start
    outer = np.unique(np.concatenate([column[column >= stop], *(rows for rows, _ in left)]))
    outer = outer[outer >= stop].astype(np.int64)
    front = np.zeros((own + len(outer), own + len(outer)), order="F")

    def at(index: Ints) -> Ints:
        return np.where(index < stop, index - start, own + np.searchsorted(outer, index))

    # Only the lower half is used. Rows of the transpose are in one piece.
    front[at(column), row] = ordered.data[entries]
    front[np.arange(own), np.arange(own)] += shift
    for rows, matrix in left:
        places = at(rows)
        front.T[np.ix_(places, places)] += matrix.T
    if not own:
        return outer, front
    if dropped is not None:
        below, lost = _without_dependent(front[:, :own], own)
        dropped.extend((start + lost).tolist())
        return outer, front[own:, own:] - below @ below.T
    diagonal, fault = dpotrf(front[:own, :own], lower=1, clean=1)
    if fault:
        raise NotPositive
    below, rest = front[own:, :own], front[own:, own:]
    if len(outer):
        below = dtrsm(1.0, diagonal, below, side=1, lower=1, trans_a=1)
        rest = dsyrk(-1.0, below, beta=1.0, c=rest, lower=1)
    found.append(_Eliminated(start, stop, outer, diagonal, below))
    return outer, rest


def _without_dependent(columns: Floats, own: int) -> tuple[Floats, Ints]:
    """Factors (b, s) below a front's own columns (s + b, s), and which of these are dependent.

    Dependent columns count as absent.
    """
    factor, lost = columns.copy(), []
    for first in range(0, own, _PANEL):
        last = min(first + _PANEL, own)
        for j in range(first, last):
            factor[j:, j] -= factor[j:, first:j] @ factor[j, first:j]
            pivot = factor[j, j]
            if pivot > _DEPENDENT:
                factor[j:, j] /= np.sqrt(pivot)
            else:
                factor[j:, j] = 0.0
                lost.append(j)
        panel = factor[last:, first:last]
        factor[last:, last:] -= panel @ panel[: own - last].T
    return factor[own:], np.array(lost, dtype=np.int64)
