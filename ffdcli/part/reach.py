"""What of a deformation reaches the faces, edges and vertices of a part.

Each is covered by boxes. The polynomial cells that the boxes meet tell whether the deformation is
the identity there, one affine map, or neither.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, distinct_rows
from ffdcli.deformation import Deformation
from ffdcli.lattice import BoxLattice, Lattice
from ffdcli.lattice.border import SIDES
from ffdcli.part.cover import Cover
from ffdcli.surface.affine import fit_cells, fitting_matrix, rounding_of
from ffdcli.volume.protocol import BoxMap, Volume

# Points of the part lie on a lattice box up to this share of its size beyond a side that the part
# does not cross: there the deformation is continued.
_BESIDE = 1e-3
# Boxes that touch a crossed side by less than this share of the size do not pass it.
_TOUCH = 1e-9
# A box that meets more cells than this is not asked for an affine map.
_MOST_CELLS = 20_000


@dataclass(frozen=True, eq=False)
class Reached:
    """What reaches each of n items.

    Parameters
    ----------
    identity : (n,) bool
        The deformation leaves the item where it is.
    affine : (n,) bool
        It is one affine map there; also where it is the identity.
    matrix, offset : (n, 3, 3), (n, 3) float64
        ``D(x) = matrix @ x + offset`` in model coordinates; the identity where it is not affine.
    field : (n,) int64
        Index into ``fields``.
    fields : tuple of Deformation
        The deformation as it is to be evaluated on the items: it goes on smoothly beyond sides of
        boxes that the part does not cross, where the parameters of faces may reach.
    """

    identity: Bools
    affine: Bools
    matrix: Floats
    offset: Floats
    field: Ints
    fields: tuple[Deformation, ...]

    def map_of(self, item: int) -> BoxMap | None:
        """The only map that reaches an item; None where there are several, or there is none."""
        maps = self.fields[self.field[item]].maps
        return maps[0] if len(maps) == 1 else None

    def images(self, points: Floats, item: Ints) -> Floats:
        """Images (m, 3) of points (m, 3) of items (m,)."""
        out = np.empty(points.shape)
        for field, mine in self._by_field(item):
            out[mine] = field.images(points[mine])
        return out

    def denominators(self, points: Floats, item: Ints) -> Floats:
        """Denominators (m,) of the images, for items that one map reaches."""
        out = np.ones(len(points))
        for field, mine in self._by_field(item):
            one = field.maps[0]
            if one.net_kind.rational:
                local = np.clip(one.frame.to_local(points[mine]), one.box[0], one.box[1])
                matrix = one.basis_matrix(local)  # type: ignore[attr-defined]
                out[mine] = matrix @ one.net[..., 3].ravel()
        return out

    def stretch(self, points: Floats, item: Ints) -> Floats:
        """(m,) largest factor by which lengths grow at points (m, 3) of items (m,)."""
        out = np.empty(len(points))
        for field, mine in self._by_field(item):
            slopes = field.jacobian(points[mine])
            out[mine] = np.linalg.norm(slopes, ord=2, axis=(1, 2))
        return out

    def _by_field(self, item: Ints) -> Iterator[tuple[Deformation, Bools]]:
        """Each deformation with the items (m,) on which it is to be evaluated."""
        of = self.field[item]
        for number in np.unique(of).tolist():
            yield self.fields[number], of == number


def find_reached(lattice: Lattice, cover: Cover, size: float) -> Reached:
    """Ask the cells that the boxes of a cover meet.

    Parameters
    ----------
    lattice : Lattice
    cover : Cover
        Boxes of the items.
    size : float, model length
        Size of the part.
    """
    count, maps = cover.count, lattice.maps
    pieces = [_pieces(member, cover, size) for member in lattice.members]
    rounding = 64 * float(np.finfo(float).eps * np.abs(cover.boxes).max(initial=0.0))
    met, held = np.zeros((len(maps), count), dtype=bool), np.zeros(len(cover.boxes), dtype=bool)
    for number, (one, each) in enumerate(zip(maps, pieces, strict=True)):
        met[number, each.owner] = True
        held |= each.holds
        if not one.needs_fit:
            rounding = max(rounding, rounding_of(one))
    # Where no box of the lattice holds a box wholly, the identity is one of its maps.
    still = cover.owner[~held]
    owner = np.concatenate([*(each.owner for each in pieces), still])
    affine = np.ones(count, dtype=bool)
    for each in pieces:
        np.logical_and.at(affine, each.owner, each.affine)
    # The maps of an item are one map where they agree on the corners of its box.
    low, high = cover.bounds
    corners = low[:, None] + np.concatenate([np.zeros((1, 3)), np.eye(3)]) * (high - low)[:, None]
    eye = np.broadcast_to(np.eye(3), (len(still), 3, 3))
    matrix = np.concatenate([*(each.matrix for each in pieces), eye])
    offset = np.concatenate([*(each.offset for each in pieces), np.zeros((len(still), 3))])
    found = np.einsum("nij,npj->npi", matrix, corners[owner]) + offset[:, None]
    least, most = np.full((2, count, 4, 3), np.inf)
    most = -most
    np.minimum.at(least, owner, found)
    np.maximum.at(most, owner, found)
    affine &= (most - least).max(axis=(1, 2), initial=-np.inf) <= rounding
    last = np.zeros(count, dtype=np.int64)
    last[owner] = np.arange(len(owner))
    chosen = np.where(affine[:, None, None], matrix[last], np.eye(3))
    shift = np.where(affine[:, None], offset[last], 0.0)
    moved = np.abs(np.einsum("nij,npj->npi", chosen, corners) + shift[:, None] - corners)
    identity = affine & (moved.max(axis=(1, 2)) <= rounding)
    chosen[identity], shift[identity] = np.eye(3), 0.0
    # A map that flattens space gives no plane.
    volume = np.abs(np.linalg.det(chosen))
    affine &= volume > 1e-12 * np.linalg.norm(chosen, axis=(1, 2)) ** 3
    field, fields = _fields(lattice, met, cover, size)
    return Reached(identity, affine, chosen, shift, field, fields)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """The maps of one lattice box on the boxes of items.

    Parameters
    ----------
    owner : (k,) int64
        The item of each piece.
    affine : (k,) bool
    matrix, offset : (k, 3, 3), (k, 3) float64
    holds : (b,) bool
        Boxes that lie in the lattice box.
    """

    owner: Ints
    affine: Bools
    matrix: Floats
    offset: Floats
    holds: Bools


def _pieces(member: BoxLattice, cover: Cover, size: float) -> _Pieces:
    """The maps that one lattice box has on the boxes of a cover."""
    one: BoxMap = member.map
    local = _local_boxes(one, cover.boxes)
    crossed = _crossed(member)
    low, high = local[:, 0], local[:, 1]
    reach = np.where(crossed, -_TOUCH * size, _BESIDE * size)
    meets = ((low <= one.box[1] + reach[1]) & (high >= one.box[0] - reach[0])).all(axis=1)
    # A box of an item may reach beyond a side that the part does not cross, the item does not.
    reach = np.where(crossed, _TOUCH * size, np.inf)
    inside = ((low >= one.box[0] - reach[0]) & (high <= one.box[1] + reach[1])).all(axis=1)
    met = np.flatnonzero(meets)
    box, affine, matrix, offset = _cell_maps(one, np.clip(local[met], one.box[0], one.box[1]))
    return _Pieces(cover.owner[met[box]], affine, matrix, offset, meets & inside)


def _crossed(member: BoxLattice) -> Bools:
    """(2, 3) True for lower and upper sides that the part crosses."""
    return np.isin(SIDES, list(member.crossed)).reshape(3, 2).T


def _local_boxes(one: BoxMap, boxes: Floats) -> Floats:
    """Bounding boxes (b, 2, 3) in the frame of a map of boxes (b, 2, 3) of the model."""
    if one.frame.aligned:
        return one.frame.to_local(boxes)
    choice = np.indices((2, 2, 2)).reshape(3, -1).T
    corners = one.frame.to_local(boxes[:, choice, np.arange(3)])
    return np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)


def _cell_maps(one: BoxMap, boxes: Floats) -> tuple[Ints, Bools, Floats, Floats]:
    """The box, whether the map is affine, and the map, of each cell that boxes (b, 2, 3) meet."""
    box, middle = _cells(one, boxes)
    asked = np.unique(box)
    rest = np.setdiff1d(np.arange(len(boxes)), asked)
    matrix, offset = np.tile(np.eye(3), (len(box), 1, 1)), np.zeros((len(box), 3))
    affine = np.zeros(len(box), dtype=bool)
    if len(box):
        volume: Volume = one  # type: ignore[assignment]
        cells, which = distinct_rows(volume.cells(middle))
        bounds = volume.cell_bounds(cells)
        restriction = volume.restrict(cells, bounds[:, 0], bounds[:, 1])
        slopes, image, fits = fit_cells(volume, restriction, bounds, fitting_matrix(volume))
        turned = slopes if one.frame.aligned else one.frame.axes.T @ slopes @ one.frame.axes
        centre = one.frame.to_model(bounds.mean(axis=1))
        shift = one.frame.to_model(image) - np.einsum("nij,nj->ni", turned, centre)
        affine, matrix, offset = fits[which], turned[which], shift[which]
    return (
        np.concatenate([box, rest]),
        np.concatenate([affine, np.zeros(len(rest), dtype=bool)]),
        np.concatenate([matrix, np.tile(np.eye(3), (len(rest), 1, 1))]),
        np.concatenate([offset, np.zeros((len(rest), 3))]),
    )


def _cells(one: BoxMap, boxes: Floats) -> tuple[Ints, Floats]:
    """Middles (k, 3) of the cells that boxes meet, with the box (k,) of each.

    Boxes that meet too many cells have none, nor has a map without cells.
    """
    numbers, middles = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    if not one.needs_fit and len(boxes):
        steps = [_intervals(one, axis, boxes) for axis in range(3)]
        many = np.prod([(~np.isnan(each)).sum(axis=1) for each in steps], axis=0)
        for part in _runs(many):
            u, v, w = (each[part] for each in steps)
            shape = (len(part), u.shape[1], v.shape[1], w.shape[1])
            grid = np.stack(
                np.broadcast_arrays(u[:, :, None, None], v[:, None, :, None], w[:, None, None, :]),
                axis=-1,
            ).reshape(*shape, 3)
            kept = ~np.isnan(grid).any(axis=-1)
            numbers.append(part[np.nonzero(kept)[0]])
            middles.append(grid[kept])
    return np.concatenate(numbers), np.concatenate(middles)


def _intervals(one: BoxMap, axis: int, boxes: Floats) -> Floats:
    """Middles (b, n) of the intervals between the knot planes in boxes; NaN for none."""
    planes = one.knot_planes(axis, boxes).values
    ends = np.sort(np.concatenate([boxes[:, 0, axis, None], planes, boxes[:, 1, axis, None]], 1))
    middles = (ends[:, 1:] + ends[:, :-1]) / 2
    used = ~np.isnan(middles).all(axis=0)
    return np.asarray(middles[:, used])


def _runs(many: Ints) -> Iterator[Ints]:
    """Indices of boxes, in runs that meet about as many cells as one box may."""
    asked = np.flatnonzero(many <= _MOST_CELLS)
    total = np.cumsum(many[asked]) // _MOST_CELLS
    yield from np.split(asked, np.flatnonzero(np.diff(total)) + 1)


def _fields(
    lattice: Lattice, met: Bools, cover: Cover, size: float
) -> tuple[Ints, tuple[Deformation, ...]]:
    """The deformation as it is to be evaluated on each item.

    That of the one box that reaches an item goes on beyond all sides that are not crossed. Items
    that several boxes reach, or that lie beside one too, get the deformation as it is.
    """
    crossed = np.stack([_crossed(member) for member in lattice.members])
    maps = lattice.maps
    whole = Deformation(maps, np.where(crossed, 0.0, _BESIDE * size))
    fields = [whole]
    field = np.zeros(cover.count, dtype=np.int64)
    for number, one in enumerate(maps):
        fields.append(Deformation((one,), np.where(crossed[number], 0.0, np.inf)[None]))
        mine = met[number] & (met.sum(axis=0) == 1)
        local = one.frame.to_local(cover.points)
        far = (local < one.box[0] - _BESIDE * size) & ~crossed[number, 0]
        far |= (local > one.box[1] + _BESIDE * size) & ~crossed[number, 1]
        beside = np.zeros(cover.count, dtype=bool)
        beside[cover.point_owner[far.any(axis=1)]] = True
        field[mine & ~beside] = number + 1
    return field, tuple(fields)
