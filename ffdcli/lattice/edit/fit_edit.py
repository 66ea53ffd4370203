"""Fits in model coordinates, by a lattice file or from Python, solved in the lattice frame."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.drag.holds import resolve_holds
from ffdcli.lattice.edit.site import choose, options_from_python
from ffdcli.lattice.file.check_edits import fit_problems
from ffdcli.lattice.file.definition import PairTable
from ffdcli.lattice.file.drag_models import HoldPoint
from ffdcli.lattice.file.fit_models import FitOptions
from ffdcli.lattice.file.source import Source
from ffdcli.lattice.fit.affine import AffineField, nearest_affine
from ffdcli.lattice.fit.basis import FitBasis
from ffdcli.lattice.fit.level_basis import level_basis
from ffdcli.lattice.fit.notes import notes_on
from ffdcli.lattice.fit.report import FitReport
from ffdcli.lattice.fit.robust import FEWEST, Neighbours
from ffdcli.lattice.fit.smoothing import MANY
from ffdcli.lattice.fit.solve import Anchors, FitData, FitSettings, Fitted, solve_fit
from ffdcli.lattice.fit.tensor_basis import tensor_basis
from ffdcli.splines.knots import make_knots
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from ffdcli.volume.bspline import BSplineVolume
from ffdcli.volume.weights import rational_basis

# Distance from the lattice box, relative to its size, within which a pair counts as inside.
ON_BOX = 1e-9
# Tolerance where none is given, relative to the diagonal of the lattice box.
TOLERANCE = 1e-4
# Times that the weights of outliers follow the residual, at most.
ROUNDS = 4
# Cells of the lattice that a fit by many functions starts from.
_PILOT = 1000


def fit_by_python(lattice: BoxLattice, pairs: PairTable, options: Mapping[str, Any]) -> BoxLattice:
    """Apply a fit with the keyword arguments of :meth:`ffdcli.lattice.lattice.Lattice.fit`."""
    source, mask, checked = options_from_python(lattice, FitOptions, options)
    for path, message, hint in fit_problems(lattice.spec, checked, ()):
        raise source.error(path, message, hint)
    fitted, report = solve(lattice, pairs, checked, source, mask)
    # Fits from Python follow the edits of the file.
    number = max([len(lattice.spec.edits) - 1, *lattice.fits]) + 1
    done = replace(fitted, fits={**lattice.fits, number: report})
    return replace(done, warnings=(*lattice.warnings, *report.warnings))


def with_report(fitted: BoxLattice, number: int, report: FitReport) -> BoxLattice:
    """A lattice fitted by an edit of the file, with what that reached and its warnings."""
    warnings = (f"edits[{number}].fit: {text}" for text in report.warnings)
    fits = {**fitted.fits, number: report}
    return replace(fitted, fits=fits, warnings=(*fitted.warnings, *warnings))


def solve(
    lattice: BoxLattice,
    pairs: PairTable,
    options: FitOptions,
    source: Source,
    pinned: Bools | None = None,
) -> tuple[BoxLattice, FitReport]:
    """The lattice with fitted control points, and what the fit reached."""
    problem = pose(lattice, pairs, options, source)
    solved = fit_lattice(lattice, problem, options, source, pinned)
    return solved.lattice, report_of(solved, problem)


@dataclass(frozen=True, eq=False)
class Problem:
    """A fit as the lattice frame has it, whatever the cells.

    Parameters
    ----------
    data : FitData
        Displacements from the images before the fit.
    numbers : (m,) int64
        Numbers of these pairs.
    sources : (m, 3) float64
        Their points, model coordinates.
    outside : (q,) int64
        Numbers of the pairs outside the box.
    near : Neighbours or None
        None for few pairs.
    tolerance : float
    notes : tuple of str
        Sentences on the pairs.
    """

    data: FitData
    numbers: Ints
    sources: Floats
    outside: Ints
    near: Neighbours | None
    tolerance: float
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Solved:
    """A fitted lattice.

    Parameters
    ----------
    lattice : BoxLattice
    fitted : Fitted
    levels : tuple of int
        Unknowns on each level.
    """

    lattice: BoxLattice
    fitted: Fitted
    levels: tuple[int, ...]


def pose(lattice: BoxLattice, pairs: PairTable, options: FitOptions, source: Source) -> Problem:
    """The pairs of a fit in the lattice frame.

    Raises
    ------
    LatticeError
        No pair lies in the box.
    """
    volume, box = lattice.map, lattice.layout.box
    size = float(np.linalg.norm(box[1] - box[0]))
    local = volume.frame.to_local(pairs.sources)
    inside = np.all((local >= box[0] - ON_BOX * size) & (local <= box[1] + ON_BOX * size), axis=1)
    if not inside.any():
        low, high = lattice.layout.written_box.tolist()
        message = "no pair lies inside the lattice box"
        hint = f"the box goes from {low} to {high}; compare the units of the field and the model"
        raise source.error(("pairs",), message, hint)
    places = local[inside].clip(*box)
    goals = np.where(pairs.by[:, None], pairs.goals, pairs.goals - pairs.sources) * options.scale
    goals = (goals if volume.frame.aligned else goals @ volume.frame.axes.T)[inside]
    # A displacement counts from the image before the edit, a target from the undeformed place.
    before = volume.evaluate(places) - places
    wanted = np.where(pairs.by[inside, None], goals, goals - before)
    tolerance = options.tolerance or TOLERANCE * size
    near = Neighbours.of(places, tolerance) if len(places) >= FEWEST else None
    return Problem(
        FitData(places, wanted, pairs.weights[inside]),
        np.flatnonzero(inside),
        pairs.sources[inside],
        np.flatnonzero(~inside),
        near,
        tolerance,
        notes_on(places, wanted, np.flatnonzero(inside), tolerance),
    )


def fit_lattice(
    lattice: BoxLattice,
    problem: Problem,
    options: FitOptions,
    source: Source,
    pinned: Bools | None = None,
    start: Fitted | None = None,
    rounds: int = ROUNDS,
) -> Solved:
    """The lattice with the control points that fit best; ``start`` is a fit on any cells.

    The weights of outliers follow the residual ``rounds`` times at most.
    """
    volume, data = lattice.map, problem.data
    free = free_points(lattice, options, source, pinned)
    points = lattice.points.copy()
    base = _affine(lattice, data, free)
    still = [hold.point for hold in options.hold if isinstance(hold, HoldPoint)]
    at_rest = volume.frame.to_local(np.array(still).reshape(-1, 3))
    wanted, moves, corners = data.wanted, np.zeros_like(at_rest), base.rank < 4
    if base.applies:
        coarse = volume.levels == 0
        points[coarse] += base.at(volume.rest_points[coarse])
        wanted, moves = wanted - base.at(data.places), -base.at(at_rest)
    basis = basis_at(lattice, data.places, free)
    anchors = Anchors(
        _effect(lattice, at_rest, basis.unknowns),
        moves,
        _effect(lattice, _corners(lattice.layout.box), basis.unknowns) if corners else None,
    )
    smooth = None if options.smooth == "auto" else options.smooth
    settings = FitSettings(smooth, problem.near if options.robust else None, start, rounds)
    data = replace(data, wanted=wanted)
    if start is None and len(basis.unknowns) > MANY:
        settings = replace(settings, start=_pilot(lattice, data, settings))
    found = solve_fit(basis, data, anchors, settings)
    points.reshape(-1, 3)[basis.unknowns] += found.moves
    if not np.isfinite(points).all():
        raise source.error((), "leads to coordinates too large for numbers", None)
    levels = np.bincount(volume.levels.ravel()[basis.unknowns]).tolist()
    return Solved(lattice.with_points(points, lattice.weights), found, tuple(levels))


def free_points(
    lattice: BoxLattice, options: FitOptions, source: Source, pinned: Bools | None = None
) -> Bools:
    """Control points that a fit may move.

    Raises
    ------
    LatticeError
        There are none.
    """
    fixed = ~lattice.free if pinned is None else ~lattice.free | pinned
    for number, selector in enumerate(options.pin):
        fixed = fixed | choose(lattice, selector, source, ("pin", number))
    held = resolve_holds(options.hold, lattice.map, lattice.points, fixed, lattice.groups, source)
    free = ~(fixed | held.fixed)
    if not free.any():
        message = "no control point is free to move: they are locked, pinned or held"
        raise source.error((), message, "use more `points`, or a larger `box`")
    return np.asarray(free)


def basis_at(lattice: BoxLattice, places: Floats, free: Bools) -> FitBasis:
    """The functions of the free control points at places (m, 3), lattice frame."""
    volume = lattice.map
    if isinstance(volume, AdaptiveVolume):
        return level_basis(volume, lattice.layout.box, places, free)
    assert isinstance(volume, BSplineVolume)
    return tensor_basis(volume, lattice.weights, places, np.flatnonzero(free.ravel()))


def _pilot(lattice: BoxLattice, data: FitData, settings: FitSettings) -> Fitted:
    """A fit by few functions, whose smoothing and outliers are a start for many."""
    box, degrees = lattice.layout.box, lattice.map.degrees
    extent = box[1] - box[0]
    even = extent * (_PILOT / float(extent.prod())) ** (1 / 3)
    counts = np.maximum(np.rint(even).astype(np.int64), 1) + degrees
    knots = [
        make_knots(degree, int(count), float(low), float(high), interior=None, clamped=True)
        for degree, count, low, high in zip(degrees, counts, *box, strict=True)
    ]
    net = np.zeros((*counts.tolist(), 3))
    volume = BSplineVolume(degrees, (knots[0], knots[1], knots[2]), net, lattice.map.frame)
    every = np.arange(int(counts.prod()))
    basis = tensor_basis(volume, volume.rest_weights, data.places, every)
    free = Anchors(csr_array((0, len(every))), np.zeros((0, 3)), None)
    return solve_fit(basis, data, free, settings)


def report_of(solved: Solved, problem: Problem) -> FitReport:
    """What a fit reached, in model coordinates."""
    frame, found = solved.lattice.map.frame, solved.fitted
    return FitReport(
        numbers=problem.numbers,
        sources=problem.sources,
        left=found.left if frame.aligned else found.left @ frame.axes,
        outlier=found.outlier,
        outside=problem.outside,
        tolerance=problem.tolerance,
        noise=found.noise,
        smooth=0.0 if found.silent else found.smooth,
        levels=solved.levels,
        notes=problem.notes,
    )


def _affine(lattice: BoxLattice, data: FitData, free: Bools) -> AffineField:
    """The affine field next to the pairs; it applies where the coarsest level can have it."""
    field = nearest_affine(data.places, data.wanted, data.weights)
    volume = lattice.map
    even = bool(np.all(lattice.weights == lattice.weights.flat[0]))
    able = volume.linear_precision and even and bool(free[volume.levels == 0].all())
    return replace(field, applies=able)


def _effect(lattice: BoxLattice, places: Floats, unknowns: Ints) -> csr_array:
    """(h, n) effect of the unknowns at places (h, 3)."""
    inside = lattice.map.contains(places)
    rows = lattice.map.basis_matrix(np.where(inside[:, None], places, lattice.layout.box[0]))
    rows = rational_basis(rows, lattice.weights.ravel())
    kept = csr_array(inside[:, None] * 1.0).multiply(rows)
    return csr_array(csr_array(kept)[:, unknowns])


def _corners(box: Floats) -> Floats:
    return np.array(list(itertools.product(*box.T)))
