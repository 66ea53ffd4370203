"""Maps from nets of local functions to polynomial forms on cells, and on boxes in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Floats, Ints, gather_runs, places_in_runs
from ffdcli.volume.adaptive.reach import Reach

# Pairs of cell and function treated together: bounds the memory.
_CHUNK_PAIRS = 500_000


@dataclass(frozen=True)
class Extraction:
    """Polynomial forms of functions on the cells they reach, stored as three factors.

    Parameters
    ----------
    reach : Reach
        Of the cells.
    factors : three (q, k_a + 1) float64
        Bézier points, or other coefficients, of the factors listed in ``reach``.
    """

    reach: Reach
    factors: tuple[Floats, Floats, Floats]

    def apply(self, net: Floats, cells: Ints) -> Floats:
        """Forms (m, ku + 1, kv + 1, kw + 1, c) on chosen cells for a net (n, c)."""
        lengths = np.diff(self.reach.starts)[cells]
        step = max(1, _CHUNK_PAIRS // max(1, int(lengths.max(initial=1))))
        shape = (*(factor.shape[1] for factor in self.factors), net.shape[1])
        out = np.empty((len(cells), *shape))
        for start in range(0, len(cells), step):
            out[start : start + step] = self._some(net, cells[start : start + step])
        return out

    def _some(self, net: Floats, cells: Ints) -> Floats:
        starts, index = gather_runs(self.reach.starts, cells)
        lengths = np.diff(starts)
        u, v, w = (
            factor[
                np.repeat(self.reach.factor_starts[axis][cells], lengths)
                + self.reach.places[index, axis]
            ]
            for axis, factor in enumerate(self.factors)
        )
        c = net.shape[1]
        nu, nv, nw = u.shape[1], v.shape[1], w.shape[1]
        first = (u[:, :, None] * v[:, None, :]).reshape(-1, nu * nv)
        second = (w[:, :, None] * net[self.reach.functions[index]][:, None, :]).reshape(-1, nw * c)
        # Rows are padded to one length, so that one matrix product serves many cells.
        longest = int(lengths.max(initial=0))
        place = places_in_runs(lengths)
        row = np.repeat(np.arange(len(cells)), lengths)
        left = np.zeros((len(cells), longest, nu * nv))
        right = np.zeros((len(cells), longest, nw * c))
        left[row, place], right[row, place] = first, second
        return (left.transpose(0, 2, 1) @ right).reshape(len(cells), nu, nv, nw, c)


@dataclass(frozen=True)
class CellRestriction:
    """The map to Bézier points of boxes: extraction on their cells, then three matrices each.

    Parameters
    ----------
    extraction : Extraction
        Extraction on the cells used.
    which : (m,) int64
        Cell of each box, as the extraction counts.
    weights : three (m, k_a + 1, k_a + 1) float64
        Matrices from the cell's Bézier points to the box's.
    """

    extraction: Extraction
    which: Ints
    weights: tuple[Floats, Floats, Floats]

    @property
    def as_tensor(self) -> None:
        """None: the functions of a cell are no grid of products."""
        return None

    @property
    def growth(self) -> Floats:
        """(m,) largest sum of the absolute weights of a Bézier point of each box."""
        u, v, w = (np.abs(weights).sum(axis=2).max(axis=1) for weights in self.weights)
        return np.asarray(u * v * w)

    def take(self, part: Ints) -> CellRestriction:
        """The map to the boxes in ``part``."""
        u, v, w = (weights[part] for weights in self.weights)
        return CellRestriction(self.extraction, self.which[part], (u, v, w))

    def apply(self, net: Floats, part: slice | Ints = slice(None)) -> Floats:
        """Bézier points (m, ku + 1, kv + 1, kw + 1, c) for a net (n, c)."""
        mu, mv, mw = (weights[part] for weights in self.weights)
        used, which = np.unique(self.which[part], return_inverse=True)
        local = self.extraction.apply(net, used)[which.reshape(-1)]
        m, nu, nv, nw, c = local.shape
        pu, pv, pw = mu.shape[1], mv.shape[1], mw.shape[1]
        along_u = (mu @ local.reshape(m, nu, nv * nw * c)).reshape(m * pu, nv, nw * c)
        along_v = (np.repeat(mv, pu, axis=0) @ along_u).reshape(m, pu * pv, nw, c)
        return np.matmul(mw[:, None], along_v).reshape(m, pu, pv, pw, c)
