"""The edits of a lattice file, applied one after the other to control points, weights and knots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.fields.table import MAX_MAGNITUDE, bad_numbers
from ffdcli.lattice.border import (
    describe_locked,
    restore_locked_points,
    restore_locked_weights,
    why_locked,
)
from ffdcli.lattice.box_lattice import BoxLattice, control_net
from ffdcli.lattice.edit.point_maps import bend, taper, transform, twist
from ffdcli.lattice.edit.site import EditSite, choose, locked_error, require_count
from ffdcli.lattice.file import drag_models, edit_models, fit_models
from ffdcli.lattice.file.problems import AXES
from ffdcli.lattice.file.source import KeyPath
from ffdcli.lattice.layout import bspline_at_rest

# Largest weight, and one over the least: a sum of functions with weights further apart has no digit
# of the lighter ones.
MAX_WEIGHT = 1e15


def move_points(lattice: BoxLattice, edit: edit_models.Move, site: EditSite) -> BoxLattice:
    """Displace control points, or put one at a place."""
    chosen = choose(lattice, edit.at, site.source, ("at",))
    points = lattice.points.copy()
    if edit.to is None:
        points[chosen] += np.array(edit.by)
    elif chosen.sum() > 1:
        message = f"`to` places one control point, but `at` selects {chosen.sum()}"
        raise site.source.error(("to",), message, "select one, or use `by`")
    else:
        points[chosen] = np.array(edit.to) - lattice.layout.written_origin
    return _place(lattice, points, site, ("at",))


def transform_points(
    lattice: BoxLattice, edit: edit_models.Transform, site: EditSite
) -> BoxLattice:
    """Scale, rotate and translate control points."""
    chosen = choose(lattice, edit.at, site.source, ("at",))
    layout, turn = lattice.layout, edit.rotate
    centre = layout.box.mean(axis=0)
    if edit.center is not None:
        centre = np.array(edit.center) - layout.written_origin
    points = lattice.points.copy()
    points[chosen] = transform(
        points[chosen],
        scale=np.array(edit.scale or (1.0, 1.0, 1.0)),
        rotation=(AXES.index(turn.axis), turn.angle) if turn else None,
        translate=np.array(edit.translate or (0.0, 0.0, 0.0)),
        centre=centre,
    )
    return _place(lattice, points, site, ("at",))


def twist_lattice(lattice: BoxLattice, edit: edit_models.Twist, site: EditSite) -> BoxLattice:
    """Turn the control points about the centre line of the box."""
    axis = AXES.index(edit.axis)
    return _place(lattice, twist(lattice.points, lattice.layout.box, axis, edit.angle), site)


def taper_lattice(lattice: BoxLattice, edit: edit_models.Taper, site: EditSite) -> BoxLattice:
    """Scale the control points towards the centre line of the box."""
    axis = AXES.index(edit.axis)
    return _place(lattice, taper(lattice.points, lattice.layout.box, axis, edit.factor), site)


def bend_lattice(lattice: BoxLattice, edit: edit_models.Bend, site: EditSite) -> BoxLattice:
    """Lay the centre line of the box on an arc."""
    axis, toward = AXES.index(edit.axis), AXES.index(edit.toward)
    return _place(lattice, bend(lattice.points, lattice.layout.box, axis, toward, edit.angle), site)


def set_net(lattice: BoxLattice, edit: edit_models.Net, site: EditSite) -> BoxLattice:
    """Set all control points."""
    net = lattice.definition.nets[site.number]
    require_count(lattice, net[..., 0], site.source)
    origin = np.array(edit.origin) if isinstance(edit, edit_models.ShiftedNet) else 0.0
    return _place(lattice, net + (origin - lattice.layout.written_origin), site, ())


def _place(
    lattice: BoxLattice, points: Floats, site: EditSite, named: KeyPath | None = None
) -> BoxLattice:
    """The lattice with other control points, the locked ones at rest.

    The key ``named`` names the control points and may not displace locked ones. Edits of the whole
    lattice have none; they leave locked control points out, with a warning.
    """
    border, source = lattice.border, site.source
    if bad_numbers(points).any():
        message = f"leads to coordinates that are too large, beyond {MAX_MAGNITUDE:g}"
        raise source.error((), message, None)
    rest = lattice.control.at_rest.rest_points
    displaced, kept = restore_locked_points(points, rest, border, lattice.layout.box)
    if named is not None and displaced.any():
        message = f"displaces {describe_locked(displaced, border)}"
        raise locked_error(lattice, source, named, message)
    moved = lattice.with_points(kept, lattice.weights)
    if not displaced.any():
        return moved
    warning = (
        f"edits[{site.number}].{source.root[-1]} leaves {displaced.sum()} locked control points "
        f"where they are: {why_locked(border, border.crossed)}"
    )
    return replace(moved, warnings=(*lattice.warnings, warning))


def set_weight(lattice: BoxLattice, edit: edit_models.Weight, site: EditSite) -> BoxLattice:
    """Give control points a weight."""
    weights = lattice.weights.copy()
    weights[choose(lattice, edit.at, site.source, ("at",))] = edit.value
    return _with_weights(lattice, weights, site, ("at",))


def set_weights(lattice: BoxLattice, edit: edit_models.Weights, site: EditSite) -> BoxLattice:
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


def move_knots(lattice: BoxLattice, edit: edit_models.MoveKnots, site: EditSite) -> BoxLattice:
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


def drag_points(lattice: BoxLattice, edit: drag_models.Drag, site: EditSite) -> BoxLattice:
    """Move points of the object to their targets."""
    # Only drags, fits and peaks need these libraries.
    from ffdcli.lattice.edit.drag_edit import drag_by_file

    return drag_by_file(lattice, edit, site)


def fit_points(lattice: BoxLattice, edit: fit_models.Fit, site: EditSite) -> BoxLattice:
    """Move many points near their targets, or the model onto a scan."""
    from ffdcli.lattice.edit.scan_fit import fit_by_file

    return fit_by_file(lattice, edit, site)


def hammer(lattice: BoxLattice, edit: edit_models.Hammer, site: EditSite) -> BoxLattice:
    """Give a peak another height, or raise one."""
    from ffdcli.lattice.edit.peaks import hammer_peak

    return hammer_peak(lattice, edit, site)


def crimp(lattice: BoxLattice, edit: edit_models.Crimp, site: EditSite) -> BoxLattice:
    """Make a peak sharper or fuller."""
    from ffdcli.lattice.edit.peaks import crimp_peak

    return crimp_peak(lattice, edit, site)


# What applies each edit, by its key: lattice, value of the key, and site to the edited lattice.
_APPLY: dict[str, Callable[[BoxLattice, Any, EditSite], BoxLattice]] = {
    "move": move_points,
    "transform": transform_points,
    "twist": twist_lattice,
    "taper": taper_lattice,
    "bend": bend_lattice,
    "weight": set_weight,
    "move_knots": move_knots,
    "drag": drag_points,
    "fit": fit_points,
    "hammer": hammer,
    "crimp": crimp,
    "net": set_net,
    "weights": set_weights,
}


def apply_edits(lattice: BoxLattice, surface: Floats, done: int = 0) -> BoxLattice:
    """Apply the edits of the file to a lattice at rest, or on which the first are done.

    Parameters
    ----------
    surface : (T, 3, 3) float64, lattice frame
        Triangles of the mesh.
    done : int
        Number of edits that the lattice has already.

    Raises
    ------
    LatticeError
        An edit selects nothing, displaces a locked control point that it names, moves knots that
        a locked control point rests on, or drags a point where it cannot go; or coordinates or
        weights end up too large.
    """
    edits, border = lattice.spec.edits, lattice.border
    if border.locked.all() and edits and not done:
        warning = f"all control points are locked: {why_locked(border, border.crossed)}"
        lattice = replace(lattice, warnings=(*lattice.warnings, warning))
    for number, edit in enumerate(edits[done:], done):
        site = EditSite(lattice.source.within(("edits", number, edit.name)), number, surface)
        # Each edit checks its result for infinite coordinates itself.
        with np.errstate(over="ignore", invalid="ignore"):
            lattice = _APPLY[edit.name](lattice, edit.value, site)
    if not np.isfinite(lattice.map.net).all():
        message = "weights times coordinates are too large for numbers"
        raise lattice.source.error(("edits",), message, None)
    least, most = float(lattice.weights.min()), float(lattice.weights.max())
    if least < 1 / MAX_WEIGHT or most > MAX_WEIGHT:
        message = f"there are weights from {least:g} to {most:g}; they may go from "
        message += f"{1 / MAX_WEIGHT:g} to {MAX_WEIGHT:g}"
        key: KeyPath = ("edits",) if edits else ("octree", "weights")
        raise lattice.source.error(key, message, "1 is the weight at rest")
    return lattice
