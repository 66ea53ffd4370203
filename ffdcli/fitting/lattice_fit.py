"""Fits of lattices whose map has no polynomial pieces, by hierarchical volumes.

Later stages are exact for the fitted volume. Its distance from the map of the lattice, on the
surface of the mesh, is measured and reported.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import LatticeError
from ffdcli.fitting.levels import CellCodes, codes_of
from ffdcli.fitting.spread import Surface
from ffdcli.fitting.volume_fit import MORE_LEVELS, MOST_FUNCTIONS, Field, FieldFit, fit_field
from ffdcli.folds.model import ModelInBox, place_in_box
from ffdcli.lattice.octree_placement import require_preimages
from ffdcli.mesh import Mesh, ShellNesting
from ffdcli.volume.adaptive.inverse_map import InverseMap
from ffdcli.volume.adaptive.octree import Cells, Octree, interleave
from ffdcli.volume.adaptive.octree_growth import grow

if TYPE_CHECKING:
    from ffdcli.lattice import BoxLattice, Lattice


# Default tolerance of the fit, as a share of the mesh's size.
DEFAULT_TOLERANCE = 1e-5
# Points along each axis of a cell inside solids; points per face-sized piece of surface, to find
# the cells that the surface passes.
_INNER = 3
_SEEN = 12.0


@dataclass(frozen=True)
class FittedLattice:
    """A lattice and the lattice with the volume fitted to its map.

    Parameters
    ----------
    asked : Lattice
        The lattice of the file.
    lattice : Lattice
        The same with the fitted volume.
    tolerance : float, model length
        Required distance of the fit.
    fit : FieldFit
    """

    asked: Lattice
    lattice: Lattice
    tolerance: float
    fit: FieldFit

    @property
    def bound(self) -> float:
        """Stated bound of the distance of the fitted surfaces, model length."""
        return self.fit.bound

    @property
    def report(self) -> dict[str, Any]:
        """The `fit` section of the report."""
        return {
            "tolerance": self.tolerance,
            "largest_found": self.fit.error,
            "samples": self.fit.samples,
            "bound": self.fit.bound,
            "levels": list(self.fit.levels),
            "functions": self.lattice.volume.shape[0],
        }


def require_fit_tolerance(tolerance: float | None, lattice: Lattice) -> None:
    """Reject a tolerance that is not positive, or given for a lattice that needs no fit.

    Raises
    ------
    LatticeError
    """
    if tolerance is None:
        return
    if not 0 < tolerance < np.inf:
        raise LatticeError(f"the fit tolerance must be a positive length, not {tolerance:g}")
    if not lattice.needs_fit:
        raise LatticeError(
            "the fit tolerance is for volumes that are fitted, and this one is exact",
            file=lattice.source.name,
            hint="leave --fit-tolerance out, or say `embedding: inverse`",
        )


def fit_lattice(
    mesh: Mesh,
    nesting: ShellNesting,
    lattice: Lattice,
    tolerance: float | None = None,
    cells: tuple[CellCodes, ...] = (),
) -> FittedLattice | None:
    """Fit a lattice on a mesh; None where its maps have polynomial pieces already.

    Parameters
    ----------
    mesh : Mesh
    nesting : ShellNesting
        The mesh's bodies.
    lattice : Lattice
        Settled by the mesh.
    tolerance : float, optional, model length
        1e-5 of the mesh's size by default.
    cells : tuple of CellCodes
        Cells of an earlier fit, for a volume with the same functions.

    Raises
    ------
    LatticeError
        The tolerance cannot be met, or none is needed; or points of the mesh have no parameters.
    """
    require_fit_tolerance(tolerance, lattice)
    if not lattice.needs_fit:
        return None
    # Such lattices are alone in their file.
    (member,) = lattice.members
    volume, model = member.map, member.cells
    assert volume.needs_fit
    assert model is not None
    allowed = DEFAULT_TOLERANCE * mesh.size if tolerance is None else tolerance
    embedded = place_in_box(mesh, nesting, volume)
    low, extent = volume.box[0], volume.box[1] - volume.box[0]

    def moves(places: Floats) -> Floats:
        points = low + places * extent
        moved, found = volume.moves(points)
        require_preimages(found, points, volume.frame, member.source)
        return moved

    surface = Surface((embedded.corners - low) / extent)
    tree = _octree_of(model.tree, surface)
    used = _leaves_used(tree, surface, embedded, volume)
    places = _inner_places(tree, used)
    moved, found = volume.moves(low + places * extent)
    known = found.solved & ~found.folded
    leaves = _by_level(tree, used)
    field = Field(moves, surface, (places[known], moved[known]))
    done = fit_field(field, leaves, allowed, max(leaves) + MORE_LEVELS, cells)
    if done.bound > allowed:
        raise _not_within(member, done, allowed, again=bool(cells))
    fitted = member.with_volume(done.volume(volume.box, volume.frame))
    return FittedLattice(lattice, lattice.with_member(0, fitted), allowed, done)


def _not_within(
    lattice: BoxLattice, done: FieldFit, allowed: float, *, again: bool
) -> LatticeError:
    message = (
        f"the surfaces could be fitted within {done.bound:.3g}, but not within {allowed:.3g}, with "
        f"{MORE_LEVELS} levels more than the octree has and {MOST_FUNCTIONS:,} functions at most"
    )
    hint = f"give --fit-tolerance {2 * done.bound:.1g}, a smaller `depth`, or say "
    hint += "`embedding: displacement`"
    if again:
        hint = "prepare a plan with this lattice, or with a larger fit tolerance"
    return lattice.source.error(("octree", "embedding"), message, hint)


def _octree_of(cells: Cells, surface: Surface) -> Octree:
    """The octree of the lattice, or one as fine as the cells that the file gives."""
    return cells.as_octree or grow(surface.triangles, None, int(cells.levels.max()), []).tree


def _leaves_used(tree: Octree, surface: Surface, embedded: ModelInBox, volume: InverseMap) -> Bools:
    """(N,) True for leaves that the surface passes, or that lie inside solids."""
    every = _by_level(tree, np.ones(len(tree.size), dtype=bool))
    passed = np.zeros(len(tree.size), dtype=bool)
    for level, codes in every.items():
        places = surface.meeting(codes, level).points(level, _SEEN, seed=0)
        places = np.concatenate([places, surface.triangles.reshape(-1, 3)])
        seen = np.unique(codes_of(places, level))
        at = np.flatnonzero(tree.levels == level)
        passed[at] = np.isin(tree.codes[at] >> 3 * (tree.depth - level), seen)
    rest = np.flatnonzero(~passed)
    share = (tree.low[rest] + tree.size[rest, None] / 2) / 2.0**tree.depth
    middle = volume.box[0] + share * (volume.box[1] - volume.box[0])
    # A leaf that the surface does not pass lies wholly inside or wholly outside.
    passed[rest] = embedded.holds(middle)
    return passed


def _inner_places(tree: Octree, used: Bools) -> Floats:
    """(n, 3) points on a grid in each used leaf, in the unit cube, also off the surface."""
    grid = (np.indices((_INNER,) * 3).reshape(3, -1).T + 0.5) / _INNER
    places = tree.low[used][:, None] + grid * tree.size[used][:, None, None]
    return np.asarray(places.reshape(-1, 3) / 2.0**tree.depth)


def _by_level(tree: Octree, used: Bools) -> CellCodes:
    """Increasing codes of the chosen leaves (N,), by level."""
    levels = tree.levels
    return {
        int(level): np.sort(
            interleave(tree.low[used & (levels == level)] >> (tree.depth - int(level)))
        )
        for level in np.unique(levels[used])
    }
