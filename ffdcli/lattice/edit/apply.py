"""The edits of a lattice file, applied one after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.drag_edit import drag_by_file
from ffdcli.lattice.edit.peak_edits import crimp_peak, hammer_peak
from ffdcli.lattice.edit.point_edits import (
    bend_lattice,
    move_points,
    set_net,
    taper_lattice,
    transform_points,
    twist_lattice,
)
from ffdcli.lattice.edit.site import EditSite
from ffdcli.lattice.edit.weight_edits import move_knots, set_weight, set_weights
from ffdcli.lattice.locked import why_locked

# What applies each edit, by its key: lattice, value of the key, and site to the edited lattice.
_APPLY: dict[str, Callable[[BoxLattice, Any, EditSite], BoxLattice]] = {
    "move": move_points,
    "transform": transform_points,
    "twist": twist_lattice,
    "taper": taper_lattice,
    "bend": bend_lattice,
    "weight": set_weight,
    "move_knots": move_knots,
    "drag": drag_by_file,
    "hammer": hammer_peak,
    "crimp": crimp_peak,
    "net": set_net,
    "weights": set_weights,
}


def apply_edits(lattice: BoxLattice, surface: Floats) -> BoxLattice:
    """Apply the edits of the file to a lattice at rest.

    Parameters
    ----------
    surface : (T, 3, 3) float64, lattice frame
        Triangles of the mesh.

    Raises
    ------
    LatticeError
        An edit selects nothing, displaces a locked control point that it names, moves knots that
        a locked control point rests on, or drags a point where it cannot go.
    """
    edits, border = lattice.spec.edits, lattice.border
    if border.locked.all() and edits:
        warning = f"all control points are locked: {why_locked(border, border.crossed)}"
        lattice = replace(lattice, warnings=(*lattice.warnings, warning))
    for number, edit in enumerate(edits):
        site = EditSite(lattice.source.within(("edits", number, edit.name)), number, surface)
        # Each edit checks its result for infinite coordinates itself.
        with np.errstate(over="ignore", invalid="ignore"):
            lattice = _APPLY[edit.name](lattice, edit.value, site)
    if not np.isfinite(lattice.map.net).all():
        message = "weights times coordinates are too large for numbers"
        raise lattice.source.error(("edits",), message, None)
    return lattice
