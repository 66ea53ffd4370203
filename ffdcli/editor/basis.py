"""The functions of a settled lattice at points of the model, kept for many control nets.

A preview is a product with them: all at once, or, where few control points move, of their columns
alone. Weights make quotients of the sums, as in the lattice's own evaluation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, csr_array

from ffdcli.arrays import Floats, Ints
from ffdcli.deformation import Deformation
from ffdcli.lattice import Lattice
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.volume.adaptive.inverse_map import AnyMap, InverseMap

# Points further beyond a side of the box, relative to it, get the derivative there too.
_BEYOND = 1e-13
# Share of the control points up to which only the columns of those that move are multiplied.
_FEW = 0.3


@dataclass(frozen=True, eq=False)
class Functions:
    """The functions of one lattice at those of the points that it deforms.

    Parameters
    ----------
    rows : (r,) int64
        Numbers of these points.
    places : (r, 3) float64, lattice frame
        The points, or the nearest ones of the box.
    beyond : (r, 3) float64, lattice frame
        What the points lie beyond the box, as rounding may carry them.
    basis : (r, n) sparse
        Values of the functions; of an inverse map, at the parameters.
    """

    rows: Ints
    places: Floats
    beyond: Floats
    basis: csr_array

    @classmethod
    def of(cls, one: AnyMap, rows: Ints, local: Floats) -> Functions:
        """The functions of a map at points (r, 3) of its frame that it deforms."""
        nearest = np.clip(local, one.box[0], one.box[1])
        basis = one.basis_matrix(nearest)
        if isinstance(one, InverseMap):
            # Points without parameters stay.
            lost = ~one.parameters(nearest).solved
            basis.data[np.repeat(lost, np.diff(basis.indptr))] = 0.0
        return cls(rows, nearest, local - nearest, basis)

    @cached_property
    def columns(self) -> csc_array:
        """The functions, column by column."""
        return self.basis.tocsc()

    @cached_property
    def off(self) -> Ints:
        """Points beyond the box by more than rounding."""
        size = np.ptp(self.places, axis=0).max(initial=1e-300)
        return np.flatnonzero(np.abs(self.beyond).max(axis=1, initial=0.0) > _BEYOND * size)

    def images(self, lattice: BoxLattice) -> Floats:
        """Images (r, 3) of the points, model coordinates; the knots are those of the functions."""
        one = lattice.map
        values = self.basis @ one.net.reshape(-1, one.net.shape[-1])
        with np.errstate(invalid="ignore"):
            images = one.net_kind.images(values, self.places)
        if isinstance(one, InverseMap):
            images = np.where(np.isfinite(images), images, self.places)
        images = one.frame.to_model(images)
        images[self.off] = self.images_beyond(lattice)
        return images

    def images_beyond(self, lattice: BoxLattice) -> Floats:
        """Images of the points :attr:`off` the box, model coordinates."""
        one, at = lattice.map, self.places[self.off]
        if not len(at):
            return at
        moved = np.einsum("nij,nj->ni", one.jacobian(at), self.beyond[self.off])
        return one.frame.to_model(one.evaluate(at) + moved)

    def reach(self, lattice: BoxLattice) -> Reach:
        """Derivatives of images by control points: of weighted functions their quotients."""
        if lattice.map.net_kind.components == 3:
            return Reach(self.basis, self.columns)
        weights, rows, columns = lattice.weights.ravel(), self.basis, self.columns
        totals = rows @ weights
        # Points without parameters have no function.
        totals[totals == 0] = 1.0
        by_row = rows.data * weights[rows.indices]
        by_row /= np.repeat(totals, np.diff(rows.indptr))
        by_column = columns.data * np.repeat(weights, np.diff(columns.indptr))
        by_column /= totals[columns.indices]
        return Reach(
            csr_array((by_row, rows.indices, rows.indptr), shape=rows.shape),
            csc_array((by_column, columns.indices, columns.indptr), shape=columns.shape),
        )


@dataclass(frozen=True, eq=False)
class Reach:
    """Derivatives of images by the control points of one lattice with certain weights.

    Parameters
    ----------
    by_row, by_column : (r, n) sparse
        The same numbers, in the order of rows and of columns.
    """

    by_row: csr_array
    by_column: csc_array

    def sums(self, moves: Floats) -> Floats:
        """Sums (r, c) of the functions with coefficients (n, c), most of which may be zero."""
        moving = np.flatnonzero(moves.any(axis=1))
        if len(moving) > _FEW * len(moves):
            return np.asarray(self.by_row @ moves)
        return np.asarray(self.by_column[:, moving] @ moves[moving])


def functions_of(lattice: Lattice, points: Floats, delta: float) -> tuple[Functions, ...]:
    """The functions of each lattice at those of the model points (V, 3) that it deforms."""
    owner = Deformation.of(lattice, delta).boxes_of(points)
    found = []
    for number, one in enumerate(lattice.maps):
        rows = np.flatnonzero(owner == number)
        found.append(Functions.of(one, rows, one.frame.to_local(points[rows])))
    return tuple(found)
