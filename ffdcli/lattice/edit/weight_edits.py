"""Edits of weights and knots: weight, weights and move_knots."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.box_lattice import BoxLattice, control_net
from ffdcli.lattice.edit.site import EditSite, choose, locked_error, require_count
from ffdcli.lattice.file.edit_models import MoveKnots, Weight, Weights
from ffdcli.lattice.file.problems import AXES
from ffdcli.lattice.file.source import KeyPath
from ffdcli.lattice.layout import bspline_at_rest
from ffdcli.lattice.locked import describe_locked, restore_locked_weights


def set_weight(lattice: BoxLattice, edit: Weight, site: EditSite) -> BoxLattice:
    """Give control points a weight."""
    weights = lattice.weights.copy()
    weights[choose(lattice, edit.at, site.source, ("at",))] = edit.value
    return _with_weights(lattice, weights, site, ("at",))


def set_weights(lattice: BoxLattice, edit: Weights, site: EditSite) -> BoxLattice:
    """Set all weights."""
    weights = lattice.definition.nets[site.number]
    require_count(lattice, weights, site.source)
    return _with_weights(lattice, weights, site, ())


def _with_weights(lattice: BoxLattice, weights: Floats, site: EditSite, key: KeyPath) -> BoxLattice:
    border = lattice.border
    changed, kept = restore_locked_weights(weights, lattice.start.rest_weights, border)
    if changed.any():
        message = f"changes the weight of {describe_locked(changed, border)}"
        raise locked_error(lattice, site.source, key, message)
    return lattice.with_points(lattice.points, kept)


def move_knots(lattice: BoxLattice, edit: MoveKnots, site: EditSite) -> BoxLattice:
    """Put other interior knots under the same control points.

    A locked control point must be at rest for a smooth join, and its place at rest depends on the
    knots. So knots may move only where no locked control point depends on them; where the mesh
    crosses sides of another axis, that is nowhere.
    """
    control = lattice.control
    knots = list(control.interior)
    knots[AXES.index(edit.axis)] = np.array(edit.values, dtype=np.float64)
    interior = (knots[0], knots[1], knots[2])
    rest = bspline_at_rest(lattice.spec, lattice.layout, interior)
    moved = np.any(control.at_rest.rest_points != rest.rest_points, axis=-1)
    displaced = lattice.locked & moved
    if displaced.any():
        message = f"moves the place at rest of {describe_locked(displaced, lattice.border)}"
        raise locked_error(lattice, site.source, (), message)
    return replace(lattice, control=control_net(rest, interior, control.points, control.weights))
