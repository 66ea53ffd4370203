"""Octrees that a fit divides: coarse cells first, then smaller ones where pairs are missed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.fit_edit import Problem, Solved, fit_lattice, pose, report_of, with_report
from ffdcli.lattice.edit.scan_fit import fit_to_scan
from ffdcli.lattice.edit.site import EditSite
from ffdcli.lattice.file.definition import Definition, PairTable
from ffdcli.lattice.file.fit_models import Fit
from ffdcli.lattice.file.spec import OctreeSpec
from ffdcli.lattice.fit.growth import Wanting, most_that_fit, wanting_cells, with_divided
from ffdcli.volume.adaptive.hierarchical import active_functions
from ffdcli.volume.adaptive.octree import Octree
from ffdcli.volume.adaptive.octree_growth import MAX_CELLS, balanced, tree_of

# Share of the predicted squared error by which smaller cells must lower it, and standard deviations
# where the residual is not surely more than noise.
_BETTER = 0.01
_CLEARLY = 3.0
# Codes of the divided cells of each level to the lattice at rest on these cells.
Rest = Callable[[Sequence[Ints]], BoxLattice]


def grow_by_fit(definition: Definition, rest: Rest, surface: Floats) -> BoxLattice:
    """The lattice with the first edit, a fit, applied, on cells that follow its pairs.

    Parameters
    ----------
    definition : Definition
    rest : callable
    surface : (T, 3, 3) float64, lattice frame
        Triangles of the mesh, for a fit onto a scan.

    Raises
    ------
    LatticeError
        The fit cannot be made.
    """
    edit, octree = definition.spec.edits[0].value, definition.spec.octree
    assert isinstance(edit, Fit)
    assert octree is not None
    if edit.target is None:
        return _grow(definition, rest, definition.pairs[0], edit)
    divided: Sequence[Ints] = [np.zeros(1, dtype=np.int64)]
    start = rest(divided)
    if octree.max_depth > 1:
        tree = _tree(start)
        start = rest(with_divided(tree, np.arange(len(tree.size))))
    site = EditSite(definition.source.within(("edits", 0, "fit")), 0, surface)
    return fit_to_scan(start, edit, site, partial(_grow, definition, rest))


def _grow(definition: Definition, rest: Rest, pairs: PairTable, edit: Fit) -> BoxLattice:
    octree = definition.spec.octree
    assert octree is not None
    source = definition.source.within(("edits", 0, "fit"))
    divided: Sequence[Ints] = [np.zeros(1, dtype=np.int64)]
    lattice = rest(divided)
    problem = pose(lattice, pairs, edit, source)
    best = fit_lattice(lattice, problem, edit, source)
    while True:
        tree, wanting = _tree(best.lattice), _wanting(best, problem)
        if not len(wanting.cells):
            stopped = "tolerance" if _met(best, problem) else "noise"
            break
        cells, stopped = _allowed(tree, wanting, octree, definition.spec.degree)
        if not len(cells):
            break
        finer = rest(with_divided(tree, cells))
        asked = fit_lattice(finer, problem, edit, source, start=best.fitted, rounds=1)
        # The mean square of normal noise in space varies by sqrt(2 / 3 m).
        vague = 0.0 if wanting.sure else _CLEARLY * np.sqrt(2 / (3 * len(problem.numbers)))
        if asked.fitted.score > (1 - _BETTER - vague) * best.fitted.score:
            stopped = "noise"
            break
        best = asked
    if edit.robust and problem.near is not None and best.fitted.unsettled(problem.near):
        # The weights of outliers came from larger cells.
        same = edit.model_copy(update={"smooth": best.fitted.smooth})
        best = fit_lattice(best.lattice.scaled(0), problem, same, source, start=best.fitted)
    report = replace(report_of(best, problem), stopped=stopped)
    return with_report(best.lattice, 0, report)


def _met(solved: Solved, problem: Problem) -> bool:
    """Whether all pairs but outliers are within the tolerance."""
    apart = np.linalg.norm(solved.fitted.left, axis=1)
    return bool(np.all(apart[~solved.fitted.outlier] <= problem.tolerance))


def _tree(lattice: BoxLattice) -> Octree:
    assert lattice.cells is not None
    tree = lattice.cells.tree
    assert isinstance(tree, Octree)
    return tree


def _wanting(solved: Solved, problem: Problem) -> Wanting:
    box = solved.lattice.layout.box
    share = (problem.data.places - box[0]) / (box[1] - box[0])
    return wanting_cells(
        _tree(solved.lattice), share, solved.fitted, problem.near, problem.tolerance
    )


def _allowed(
    tree: Octree, wanting: Wanting, octree: OctreeSpec, degrees: tuple[int, int, int]
) -> tuple[Ints, str]:
    """The worst cells that the limits of the file allow to divide, and the limit that ends."""
    cells = wanting.cells[tree.levels[wanting.cells] < octree.max_depth]
    if not len(cells):
        return cells, "max_depth"

    def fits(some: Ints) -> bool:
        finer = tree_of(balanced(with_divided(tree, some)))
        few = len(finer.size) <= MAX_CELLS
        return few and len(active_functions(finer, degrees)[0]) <= octree.max_points

    return (cells if fits(cells) else most_that_fit(cells, fits)), "max_points"
