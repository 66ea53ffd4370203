"""Lattices whose deformation is no polynomial, fitted on a mesh by volumes that are one.

All stages after this one go on exactly, with the fitted volume; how far that is from the lattice's
own deformation, on the surface of the mesh, is measured and stated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import LatticeError
from ffdcli.fitting.levels import Cells, codes_of
from ffdcli.fitting.spread import Surface
from ffdcli.fitting.volume_fit import MORE_LEVELS, MOST_FUNCTIONS, Field, Fit, fit
from ffdcli.folds.model import ModelInBox, place_in_box
from ffdcli.lattice.preimages import require_preimages
from ffdcli.mesh import Mesh, ShellNesting
from ffdcli.volume.adaptive.inverse_map import InverseMap
from ffdcli.volume.adaptive.octree import Cells as LatticeCells
from ffdcli.volume.adaptive.octree import Octree, interleave
from ffdcli.volume.adaptive.octree_growth import grow

if TYPE_CHECKING:
    from ffdcli.lattice import BoxLattice, Lattice


# Share of the mesh's size that the fit may be off by where nothing else is said.
DEFAULT_TOLERANCE = 1e-5
# Points along each axis of a cell, inside solids, and on its surface to see that it has some.
_INNER = 3
_SEEN = 12.0


@dataclass(frozen=True)
class Fitted:
    """A lattice and the fitted one that stands for it.

    Parameters
    ----------
    asked : Lattice
        The lattice as it is.
    lattice : Lattice
        With the fitted volume.
    tolerance : float, model length
        What the fit was to stay within.
    fit : Fit
    """

    asked: Lattice
    lattice: Lattice
    tolerance: float
    fit: Fit

    @property
    def bound(self) -> float:
        """What the fitted surfaces are stated to be off at most, model length."""
        return self.fit.bound

    @property
    def report(self) -> dict[str, Any]:
        """The report's `fit`."""
        return {
            "tolerance": self.tolerance,
            "largest_found": self.fit.error,
            "samples": self.fit.samples,
            "bound": self.fit.bound,
            "levels": list(self.fit.levels),
            "functions": self.lattice.volume.shape[0],
        }


def require_fit_tolerance(tolerance: float | None, lattice: Lattice) -> None:
    """Refuse a tolerance that is none, or that the lattice has no use for.

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
    cells: tuple[Cells, ...] = (),
) -> Fitted | None:
    """Fit a lattice on a mesh, if it needs that.

    Parameters
    ----------
    mesh : Mesh
    nesting : ShellNesting
        The mesh's bodies.
    lattice : Lattice
        Settled by the mesh.
    tolerance : float, optional, model length
        1e-5 of the mesh's size by default.
    cells : tuple of Cells
        Those of an earlier fit, for a volume of the same functions.

    Raises
    ------
    LatticeError
        The tolerance cannot be met, or is for nothing; or points of the mesh have no parameters.
    """
    require_fit_tolerance(tolerance, lattice)
    if not lattice.needs_fit:
        return None
    # Such lattices stand alone in their file.
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
    done = fit(field, leaves, allowed, max(leaves) + MORE_LEVELS, cells)
    if done.bound > allowed:
        raise _not_within(member, done, allowed, again=bool(cells))
    fitted = member.with_volume(done.volume(volume.box, volume.frame))
    return Fitted(lattice, lattice.with_member(0, fitted), allowed, done)


def _not_within(lattice: BoxLattice, done: Fit, allowed: float, *, again: bool) -> LatticeError:
    message = (
        f"the surfaces could be fitted within {done.bound:.3g}, but not within {allowed:.3g}, with "
        f"{MORE_LEVELS} levels more than the octree has and {MOST_FUNCTIONS:,} functions at most"
    )
    hint = f"give --fit-tolerance {2 * done.bound:.1g}, a smaller `depth`, or say "
    hint += "`embedding: displacement`"
    if again:
        hint = "prepare a plan with this lattice, or with a larger fit tolerance"
    return lattice.source.error(("octree", "embedding"), message, hint)


def _octree_of(cells: LatticeCells, surface: Surface) -> Octree:
    """The lattice's octree; where its cells were given, one as fine as they are."""
    return cells.as_octree or grow(surface.triangles, None, int(cells.levels.max()), []).tree


def _leaves_used(tree: Octree, surface: Surface, embedded: ModelInBox, volume: InverseMap) -> Bools:
    """Leaves (N,) that the surface passes, or that lie inside solids."""
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
    # What the surface does not pass is inside or outside as a whole.
    passed[rest] = embedded.holds(middle)
    return passed


def _inner_places(tree: Octree, used: Bools) -> Floats:
    """(n, 3) places spread over leaves, in the unit cube: also beside the surface."""
    grid = (np.indices((_INNER,) * 3).reshape(3, -1).T + 0.5) / _INNER
    places = tree.low[used][:, None] + grid * tree.size[used][:, None, None]
    return np.asarray(places.reshape(-1, 3) / 2.0**tree.depth)


def _by_level(tree: Octree, used: Bools) -> Cells:
    """Codes of chosen leaves (N,), rising, by level."""
    levels = tree.levels
    return {
        int(level): np.sort(
            interleave(tree.low[used & (levels == level)] >> (tree.depth - int(level)))
        )
        for level in np.unique(levels[used])
    }
