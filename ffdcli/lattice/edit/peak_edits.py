"""Edits of peaks: hammer and crimp."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.drag_edit import solve_drag
from ffdcli.lattice.edit.peaks import crimp, find_peak, hammer, outward_normal
from ffdcli.lattice.edit.site import EditSite
from ffdcli.lattice.file.drag_models import DragOptions
from ffdcli.lattice.file.edit_models import Crimp, Hammer
from ffdcli.lattice.file.pairs import PairTable


def hammer_peak(lattice: BoxLattice, edit: Hammer, site: EditSite) -> BoxLattice:
    """Give a peak another height; where nothing has moved yet, raise one along the normal."""
    control, place = lattice.control, _place(lattice, edit.point, site)
    rest = control.at_rest
    peak = find_peak(rest, control.points, control.weights, place, lattice.free)
    if peak is not None:
        points = hammer(rest, control.points, peak, edit.height)
        return lattice.with_points(points, control.weights)
    normal = lattice.layout.frame.turn_to_model(outward_normal(site.surface, place))
    pairs = PairTable(np.array([edit.point]), edit.height * normal[None], np.array([True]))
    try:
        done = solve_drag(lattice, pairs, DragOptions(), site.source, lambda _: ())
    except LatticeError as error:
        hint = "choose a point that free control points reach, or more `points`"
        raise site.source.error((), error.message, hint) from None
    return lattice.with_points(done.points, control.weights)


def crimp_peak(lattice: BoxLattice, edit: Crimp, site: EditSite) -> BoxLattice:
    """Make a peak fuller or sharper by the weights of its control points."""
    control, place = lattice.control, _place(lattice, edit.point, site)
    rest = control.at_rest
    peak = find_peak(rest, control.points, control.weights, place, lattice.free)
    done = None
    if peak is not None:
        done = crimp(rest, control.points, control.weights, place, peak, edit.sharpness)
    if done is None:
        message = "there is no peak: no control point that reaches the point has moved it"
        raise site.source.error(("point",), message, "raise one first, as with `hammer`")
    return lattice.with_points(*done)


def _place(lattice: BoxLattice, point: tuple[float, float, float], site: EditSite) -> Floats:
    """(3,) a point of the object in the lattice frame."""
    place = lattice.layout.frame.to_local(np.array(point))
    if not lattice.start.contains(place[None])[0]:
        message = "the point lies outside the lattice box, where nothing moves"
        raise site.source.error(("point",), message, "choose a point inside it")
    if not lattice.start.has_parameters(place[None])[0]:
        message = "the point has no parameters in the volume at rest"
        raise site.source.error(("point",), message, "choose a point of the mesh")
    return place
