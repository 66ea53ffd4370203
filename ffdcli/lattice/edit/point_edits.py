"""Edits that place control points: move, transform, twist, taper, bend and net."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.point_maps import bend, taper, transform, twist
from ffdcli.lattice.edit.site import EditSite, choose, locked_error, require_count
from ffdcli.lattice.file.edit_models import Bend, Move, Net, ShiftedNet, Taper, Transform, Twist
from ffdcli.lattice.file.problems import AXES
from ffdcli.lattice.file.source import KeyPath
from ffdcli.lattice.locked import describe_locked, restore_locked_points, why_locked


def move_points(lattice: BoxLattice, edit: Move, site: EditSite) -> BoxLattice:
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


def transform_points(lattice: BoxLattice, edit: Transform, site: EditSite) -> BoxLattice:
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


def twist_lattice(lattice: BoxLattice, edit: Twist, site: EditSite) -> BoxLattice:
    """Turn the control points about the centre line of the box."""
    axis = AXES.index(edit.axis)
    return _place(lattice, twist(lattice.points, lattice.layout.box, axis, edit.angle), site)


def taper_lattice(lattice: BoxLattice, edit: Taper, site: EditSite) -> BoxLattice:
    """Scale the control points towards the centre line of the box."""
    axis = AXES.index(edit.axis)
    return _place(lattice, taper(lattice.points, lattice.layout.box, axis, edit.factor), site)


def bend_lattice(lattice: BoxLattice, edit: Bend, site: EditSite) -> BoxLattice:
    """Lay the centre line of the box on an arc."""
    axis, toward = AXES.index(edit.axis), AXES.index(edit.toward)
    return _place(lattice, bend(lattice.points, lattice.layout.box, axis, toward, edit.angle), site)


def set_net(lattice: BoxLattice, edit: Net, site: EditSite) -> BoxLattice:
    """Set all control points."""
    net = lattice.definition.nets[site.number]
    require_count(lattice, net[..., 0], site.source)
    origin = np.array(edit.origin) if isinstance(edit, ShiftedNet) else 0.0
    return _place(lattice, net + (origin - lattice.layout.written_origin), site, ())


def _place(
    lattice: BoxLattice, points: Floats, site: EditSite, named: KeyPath | None = None
) -> BoxLattice:
    """The lattice with other control points, the locked ones at rest.

    Parameters
    ----------
    named : key path, optional
        The key that names the control points: it may not displace locked ones. Edits of the whole
        lattice have none; they leave locked control points out, with a warning.
    """
    border, source = lattice.border, site.source
    if not np.isfinite(points).all():
        raise source.error((), "leads to coordinates too large for numbers", None)
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
