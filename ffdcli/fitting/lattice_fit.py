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
from ffdcli.fitting.parametrization import Parametrization, find_preimages
from ffdcli.fitting.spread import Surface
from ffdcli.fitting.volume_fit import MORE_LEVELS, MOST_FUNCTIONS, Field, FieldFit, fit_field
from ffdcli.folds.model import ModelInBox, place_in_box
from ffdcli.lattice.border import SIDES
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
class FittedMember:
    """The fit of one lattice of a file.

    Parameters
    ----------
    number : int
        Of the lattice in its file, from 0.
    fit : FieldFit
    functions : int
        Number of fitting functions.
    solved : Parametrization
        What it took to find the parameters of the points that the fit used.
    """

    number: int
    fit: FieldFit
    functions: int
    solved: Parametrization

    @property
    def report(self) -> dict[str, Any]:
        """An entry of `fit.lattices` in the report."""
        return {
            "lattice": self.number,
            "largest_found": self.fit.error,
            "samples": self.fit.samples,
            "bound": self.fit.bound,
            "levels": list(self.fit.levels),
            "functions": self.functions,
            "parametrization": self.solved.report,
        }


@dataclass(frozen=True)
class FittedLattice:
    """A lattice and the lattice with volumes fitted to those of its maps that need it.

    Parameters
    ----------
    asked : Lattice
        The lattice of the file.
    lattice : Lattice
        The same with the fitted volumes.
    tolerance : float, model length
        Required distance of each fit.
    members : tuple of FittedMember
        What was fitted, at least one.
    """

    asked: Lattice
    lattice: Lattice
    tolerance: float
    members: tuple[FittedMember, ...]

    @property
    def bound(self) -> float:
        """Stated bound of the distance of the fitted surfaces, model length.

        Boxes are disjoint, so it is the largest of the members' bounds.
        """
        return max(member.fit.bound for member in self.members)

    @property
    def report(self) -> dict[str, Any]:
        """The `fit` section of the report."""
        fits = [member.fit for member in self.members]
        levels = [level for fit in fits for level in fit.levels]
        return {
            "tolerance": self.tolerance,
            "largest_found": max(fit.error for fit in fits),
            "samples": sum(fit.samples for fit in fits),
            "bound": self.bound,
            "levels": [min(levels), max(levels)],
            "functions": sum(member.functions for member in self.members),
            "lattices": [member.report for member in self.members],
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
    earlier: FittedLattice | None = None,
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
    earlier : FittedLattice, optional
        A fit of a lattice with the same functions, whose cells are taken again.

    Raises
    ------
    LatticeError
        The tolerance cannot be met, or none is needed; or points of the mesh have no parameters.
    """
    require_fit_tolerance(tolerance, lattice)
    if not lattice.needs_fit:
        return None
    allowed = DEFAULT_TOLERANCE * mesh.size if tolerance is None else tolerance
    known = {} if earlier is None else {each.number: each.fit.cells for each in earlier.members}
    fitted, made = lattice, []
    for number, member in enumerate(lattice.members):
        volume = member.map
        if volume.needs_fit:
            done, spent = _fit_member(mesh, nesting, member, volume, allowed, known.get(number, ()))
            replaced = done.volume(volume.box, volume.frame)
            fitted = fitted.with_member(number, member.with_volume(replaced))
            made.append(FittedMember(number, done, replaced.shape[0], spent))
    return FittedLattice(lattice, fitted, allowed, tuple(made))


def _fit_member(
    mesh: Mesh,
    nesting: ShellNesting,
    member: BoxLattice,
    volume: InverseMap,
    allowed: float,
    cells: tuple[CellCodes, ...],
) -> tuple[FieldFit, Parametrization]:
    """Fit the map of one box within a tolerance, and what its parameters cost."""
    model = member.cells
    assert model is not None
    embedded = place_in_box(mesh, nesting, volume)
    low, extent = volume.box[0], volume.box[1] - volume.box[0]
    spent = Parametrization()

    def moves(places: Floats) -> Floats:
        nonlocal spent
        found, more = find_preimages(volume, low + places * extent, member)
        spent += more
        return volume.moves(found)

    surface = Surface.clipped((embedded.corners - low) / extent)
    tree = _octree_of(model.tree, surface)
    used = _leaves_used(tree, surface, embedded, volume)
    leaves = _by_level(tree, used)
    if not leaves:
        return FieldFit((), (), 0.0, 0), spent
    places = _inner_places(tree, used)
    found = volume.parameters(low + places * extent)
    known = ~(volume.torn(found) | (found.folded & found.solved))
    closed = np.isin(SIDES, member.crossed).reshape(3, 2).T
    inner = places[known], volume.moves(found)[known]
    field = Field(moves, surface, inner, closed)
    done = fit_field(field, leaves, allowed, max(leaves) + MORE_LEVELS, cells)
    if done.bound > allowed:
        raise _not_within(member, done, allowed, again=bool(cells))
    return done, spent


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
