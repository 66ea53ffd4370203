"""Position of an edit in the file, and the control points that its selectors name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.file.load import first_error
from ffdcli.lattice.file.problems import selector_problems
from ffdcli.lattice.file.selectors import Numbered, Selector, entry_indices, select
from ffdcli.lattice.file.source import KeyPath, Source

Options = TypeVar("Options", bound=BaseModel)


@dataclass(frozen=True)
class EditSite:
    """Position of an edit in the file, and the mesh that it applies to.

    Parameters
    ----------
    source : Source
        For messages; key paths count from the edit.
    number : int
        Position of the edit in the list.
    surface : (T, 3, 3) float64, lattice frame
        Triangles of the mesh.
    """

    source: Source
    number: int
    surface: Floats


def choose(lattice: BoxLattice, at: Selector, source: Source, key: KeyPath) -> Bools:
    """(nu, nv, nw) control points that a selector names.

    Raises
    ------
    LatticeError
        It names no control point, a missing one, or a hidden one by its index.
    """
    start = lattice.start
    if not isinstance(at, tuple):
        for path, message, hint in selector_problems(start.shape, at, key):
            raise source.error(path, message, hint)
        if isinstance(at, Numbered) and not at.hidden:
            named = entry_indices(at.index, len(start.hidden))
            hidden = named[start.hidden[named]]
            if len(hidden):
                message = f"control point {hidden[0]} is hidden: its cells hold no part of the mesh"
                hint = "add `hidden: true` to the selector to edit it anyway"
                raise source.error((*key, "index"), message, hint)
    places = start.rest_points
    if not isinstance(at, tuple):
        places = places + lattice.layout.written_origin
    chosen = select(at, places, start)
    if not chosen.any():
        low, high = (ends(places.reshape(-1, 3), axis=0).tolist() for ends in (np.min, np.max))
        hint = f"at rest the control points lie between {low} and {high}"
        raise source.error(key, "selects no control point", hint)
    return chosen


def require_count(lattice: BoxLattice, given: Floats, source: Source) -> None:
    """Reject an array for another number of control points than the octree of this mesh has."""
    if given.shape != lattice.start.shape:
        count = lattice.start.shape[0]
        message = f"holds {given.shape[0]} control points; for this mesh there are {count}"
        raise source.error((), message, "use it with the mesh it was made for")


def locked_error(lattice: BoxLattice, source: Source, key: KeyPath, message: str) -> LatticeError:
    """An error about an edit that names locked control points."""
    hint = "choose other control points, more `points`, a larger `box`, or "
    unclamped = lattice.spec.ends == "unclamped"
    hint += "clamped `ends`" if unclamped else "a lower `border` (c0 locks one layer)"
    if lattice.spec.adaptive:
        hint = "choose other control points, smaller cells, or a larger `box`"
    return source.error(key, message, hint)


def options_from_python(
    lattice: BoxLattice, model: type[Options], options: Mapping[str, Any]
) -> tuple[Source, Bools | None, Options]:
    """Check the keyword arguments of an edit from Python.

    Returns
    -------
    source : Source
        For messages: what is wrong is on no line of the file.
    pinned : (nu, nv, nw) bool or None
        ``pin``, where it is given as booleans.
    options : model
        With ``pin`` as selectors otherwise.

    Raises
    ------
    LatticeError
        Naming the keyword.
    """
    source = replace(lattice.source, lines={})
    pin, pinned = options["pin"], None
    if isinstance(pin, np.ndarray):
        if pin.shape != lattice.locked.shape or pin.dtype != bool:
            message = f"must be {lattice.locked.shape} booleans, or selectors"
            raise source.error(("pin",), message, None)
        pin, pinned = None, pin
    given = {**options, "pin": pin or ()}
    try:
        return source, pinned, model.model_validate(given)
    except ValidationError as error:
        raise first_error(error.errors(include_url=False), given, source) from None
