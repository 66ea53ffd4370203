"""Whether a lattice folds a model, for reports."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.mesh import Mesh


def folding_facts(mesh: Mesh, lattice: Lattice, fit_tolerance: float | None) -> dict[str, Any]:
    """Verdict on whether the deformation that `ffd deform` writes folds the mesh over."""
    from ffdcli.fitting.lattice_fit import fit_lattice
    from ffdcli.folds.model import place_in_each
    from ffdcli.folds.verdict import judge
    from ffdcli.mesh import shells

    nesting = shells(mesh)
    fitted = fit_lattice(mesh, nesting, lattice, fit_tolerance)
    written = lattice if fitted is None else fitted.lattice
    return judge(written, place_in_each(mesh, nesting, written.maps)).report
