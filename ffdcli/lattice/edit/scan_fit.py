"""Fits by a lattice file: to its pairs, or onto a scan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.fit_edit import solve, with_report
from ffdcli.lattice.edit.site import EditSite
from ffdcli.lattice.file.definition import PairTable
from ffdcli.lattice.file.fit_models import Fit


def fit_by_file(lattice: BoxLattice, edit: Fit, site: EditSite) -> BoxLattice:
    """Apply a `fit` edit."""

    def fitted(pairs: PairTable, edit: Fit) -> BoxLattice:
        solved, report = solve(lattice, pairs, edit, site.source)
        return with_report(solved, site.number, report)

    if edit.target is None:
        return fitted(lattice.definition.pairs[site.number], edit)
    return fit_to_scan(lattice, edit, site, fitted)


def fit_to_scan(
    start: BoxLattice,
    edit: Fit,
    site: EditSite,
    fitted: Callable[[PairTable, Fit], BoxLattice],
) -> BoxLattice:
    """The lattice that bends the model onto the scan of an edit.

    Parameters
    ----------
    start : BoxLattice
        Before the edit, on cells for the search.
    edit : Fit
    site : EditSite
    fitted : callable
        The lattice fitted to pairs.

    Raises
    ------
    LatticeError
        No part of the scan is near the model.
    """
    # Only scans need this library.
    from ffdcli.lattice.edit.registration import register

    scan = start.definition.scans[site.number]
    # Distances from the scan are those of the whole displacement.
    whole = edit.model_copy(update={"scale": 1.0})

    def as_smooth(pairs: PairTable, smooth: float | None, edit: Fit = whole) -> BoxLattice:
        if smooth is not None:
            edit = edit.model_copy(update={"smooth": smooth})
        return fitted(pairs, edit)

    found = register(start, site.surface, scan, whole, site.source, as_smooth)
    lattice = found.lattice
    if edit.scale != 1:
        lattice = as_smooth(found.pairs, found.report.smooth, edit)
    report = replace(lattice.fits[site.number], scan=found.report)
    definition = lattice.definition
    tables = {**definition.pairs, site.number: found.pairs}
    warnings = (f"edits[{site.number}].fit: {text}" for text in found.report.warnings)
    return replace(
        lattice,
        fits={**lattice.fits, site.number: report},
        warnings=(*lattice.warnings, *warnings),
        definition=replace(definition, pairs=tables),
    )
