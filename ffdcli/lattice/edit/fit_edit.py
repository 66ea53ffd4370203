"""Fits in model coordinates, by a lattice file or from Python, solved in the lattice frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import ValidationError
from scipy.sparse import csr_array, eye_array

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.drag.holds import resolve_holds
from ffdcli.lattice.edit.site import EditSite, choose
from ffdcli.lattice.file.check_edits import fit_problems
from ffdcli.lattice.file.definition import PairTable
from ffdcli.lattice.file.fit_models import Fit, FitOptions
from ffdcli.lattice.file.load import first_error
from ffdcli.lattice.file.source import Source
from ffdcli.lattice.fit.report import FitReport
from ffdcli.lattice.fit.solve import FitBasis, FitData, solve_fit
from ffdcli.volume.weights import rational_basis

# Distance from the lattice box, relative to its size, within which a pair counts as inside.
_ON_BOX = 1e-9
# Tolerance where none is given, relative to the diagonal of the lattice box.
TOLERANCE = 1e-4


def fit_by_file(lattice: BoxLattice, edit: Fit, site: EditSite) -> BoxLattice:
    """Apply a `fit` edit."""
    pairs = lattice.definition.pairs[site.number]
    fitted, report = solve(lattice, pairs, edit, site.source)
    return replace(fitted, fits={**lattice.fits, site.number: report})


def fit_by_python(lattice: BoxLattice, pairs: PairTable, options: Mapping[str, Any]) -> BoxLattice:
    """Apply a fit with the keyword arguments of :meth:`ffdcli.lattice.lattice.Lattice.fit`."""
    # What is wrong here is on no line of the file.
    source = replace(lattice.source, lines={})
    pin, mask = options["pin"], None
    if isinstance(pin, np.ndarray):
        if pin.shape != lattice.locked.shape or pin.dtype != bool:
            message = f"must be {lattice.locked.shape} booleans, or selectors"
            raise source.error(("pin",), message, None)
        pin, mask = None, pin
    given = {**options, "pin": pin or ()}
    try:
        checked = FitOptions.model_validate(given)
    except ValidationError as error:
        raise first_error(error.errors(include_url=False), given, source) from None
    for path, message, hint in fit_problems(lattice.spec, checked, ()):
        raise source.error(path, message, hint)
    fitted, report = solve(lattice, pairs, checked, source, mask)
    # Fits from Python follow the edits of the file.
    number = max([len(lattice.spec.edits) - 1, *lattice.fits]) + 1
    return replace(fitted, fits={**lattice.fits, number: report})


def solve(
    lattice: BoxLattice,
    pairs: PairTable,
    options: FitOptions,
    source: Source,
    pinned: Bools | None = None,
) -> tuple[BoxLattice, FitReport]:
    """The lattice with fitted control points, and what the fit reached."""
    volume = lattice.map
    box = lattice.layout.box
    size = float(np.linalg.norm(box[1] - box[0]))
    local = volume.frame.to_local(pairs.sources)
    inside = np.all((local >= box[0] - _ON_BOX * size) & (local <= box[1] + _ON_BOX * size), axis=1)
    numbers = np.flatnonzero(inside)
    places = local[inside].clip(*box)
    goals = np.where(pairs.by[:, None], pairs.goals, pairs.goals - pairs.sources) * options.scale
    goals = (goals if volume.frame.aligned else goals @ volume.frame.axes.T)[inside]
    # A displacement counts from the image before the edit, a target from the undeformed place.
    before = volume.evaluate(places) - places
    wanted = np.where(pairs.by[inside, None], goals, goals - before)
    fixed = ~lattice.free if pinned is None else ~lattice.free | pinned
    for number, selector in enumerate(options.pin):
        fixed = fixed | choose(lattice, selector, source, ("pin", number))
    held = resolve_holds(options.hold, volume, lattice.points, fixed, lattice.groups, source)
    unknowns = np.flatnonzero(~(fixed | held.fixed).ravel())
    data = FitData(places, wanted, pairs.weights[inside])
    smooth = None if options.smooth == "auto" else options.smooth
    basis = _basis(lattice, places, unknowns)
    found = solve_fit(basis, data, smooth, options.robust)
    points = lattice.points.copy()
    points.reshape(-1, 3)[unknowns] += found.moves
    levels = volume.levels.ravel()[unknowns]
    turned = found.left if volume.frame.aligned else found.left @ volume.frame.axes
    report = FitReport(
        numbers=numbers,
        sources=pairs.sources[inside],
        left=turned,
        outlier=found.outlier,
        outside=np.flatnonzero(~inside),
        tolerance=options.tolerance or TOLERANCE * size,
        noise=found.noise,
        smooth=found.smooth,
        levels=tuple(np.bincount(levels).tolist()),
    )
    return lattice.with_points(points, lattice.weights), report


def _basis(lattice: BoxLattice, places: Floats, unknowns: Any) -> FitBasis:
    count = lattice.weights.size
    values = rational_basis(lattice.map.basis_matrix(places), lattice.weights.ravel())
    chosen = csr_array(eye_array(count, format="csc")[:, unknowns])
    return FitBasis(values, csr_array((count, count)), chosen, unknowns)
