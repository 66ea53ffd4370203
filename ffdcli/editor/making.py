"""Edits made from points of the model and chosen control points, as mappings of a lattice file.

With a plane they are symmetric: one drag of the points and their mirror images, or an edit for each
side and one for the control points on the plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from ffdcli.arrays import Bools, Floats
from ffdcli.editor.mirror import (
    NEAR,
    Plane,
    frame_reflection,
    halves,
    mirrored_pairs,
    mirrored_transform,
)
from ffdcli.editor.picking import into_boxes
from ffdcli.editor.selecting import selectors_of
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.edit.site import choose
from ffdcli.lattice.file.load import first_error
from ffdcli.lattice.file.selectors import Selector

Edit = dict[str, Any]


def neat(values: Any, size: float) -> Any:
    """Numbers rounded to a millionth of a size, as a person would write them; nested lists."""
    step = int(np.ceil(6 - np.log10(size)))
    rounded = np.round(np.asarray(values, dtype=np.float64), step)
    return (rounded + 0.0).tolist()


def drag_edits(
    points: Floats,
    by: Floats,
    lattices: Sequence[BoxLattice],
    *,
    size: float,
    pin: Sequence[Any] = (),
    hold: Sequence[Any] = (),
    plane: Plane | None = None,
    vary: str = "points",
) -> list[Edit]:
    """A drag of points (m, 3) by displacements (m, 3).

    Points that rounding has carried out of the boxes of the lattices are put onto their sides.
    """
    given = len(points)
    if plane is not None:
        points, by = mirrored_pairs(plane, points, by, size)
    # Mirror images are rounded; those given stay as they are.
    put = np.array([*points[:given].tolist(), *neat(points[given:], size)])
    put = into_boxes(lattices, put, NEAR * size).tolist()
    moves = [*by[:given].tolist(), *neat(by[given:], size)]
    value: Edit = {"pairs": [{"from": a, "by": b} for a, b in zip(put, moves, strict=True)]}
    value |= {"pin": list(pin)} if len(pin) else {}
    value |= {"hold": list(hold)} if len(hold) else {}
    value |= {"vary": vary} if vary != "points" else {}
    return [{"drag": value}]


def move_edits(
    lattice: BoxLattice, mask: Bools, by: Floats, size: float, plane: Plane | None
) -> list[Edit]:
    """Moves of chosen control points (m,) by a displacement in the coordinates of the edits."""

    def moves(chosen: Bools, vector: Floats | list[float]) -> list[Edit]:
        return [{"move": {"at": at, "by": list(vector)}} for at in selectors_of(lattice, chosen)]

    by = np.asarray(by, dtype=np.float64)
    if plane is None:
        return moves(mask, by.tolist())
    turn, parts = frame_reflection(lattice, plane), halves(lattice, plane, mask)
    image = neat(turn @ by, size)
    flat = neat((by + turn @ by) / 2, size)
    return [*moves(parts.near, by.tolist()), *moves(parts.far, image), *moves(parts.on, flat)]


def transform_edits(
    lattice: BoxLattice, mask: Bools, value: Edit, plane: Plane | None
) -> list[Edit]:
    """Transformations of chosen control points (m,); ``value`` is without `at`."""

    def made(chosen: Bools, one: Edit) -> list[Edit]:
        return [{"transform": {"at": at, **one}} for at in selectors_of(lattice, chosen)]

    if plane is None:
        return made(mask, value)
    parts, image = halves(lattice, plane, mask), mirrored_transform(lattice, plane, value)
    if image == value:
        # The transformation is its own mirror image.
        return made(parts.near | parts.far | parts.on, value)
    return [*made(parts.near, value), *made(parts.far, image)]


def weight_edits(lattice: BoxLattice, mask: Bools, value: float, plane: Plane | None) -> list[Edit]:
    """The weight of chosen control points (m,)."""
    if plane is not None:
        parts = halves(lattice, plane, mask)
        mask = parts.near | parts.far | parts.on
    return [{"weight": {"at": at, "value": float(value)}} for at in selectors_of(lattice, mask)]


def peak_edits(
    name: str, point: Floats, value: Edit, plane: Plane | None, size: float
) -> list[Edit]:
    """A hammer or crimp at a point of the model, and one at its mirror image."""
    edits = [{name: {"point": np.asarray(point, dtype=float).tolist(), **value}}]
    if plane is not None and abs(float(plane.distance(point))) > NEAR * size:
        edits.append({name: {"point": neat(plane.points(point), size), **value}})
    return edits


def mask_of(lattice: BoxLattice, selectors: Sequence[Any]) -> Bools:
    """(m,) control points that values of `at` select.

    Raises
    ------
    LatticeError
        One is no selector, or selects nothing.
    """
    mask = np.zeros(lattice.locked.size, dtype=bool)
    for at in selectors:
        try:
            checked = _SELECTOR.validate_python(at)
        except ValidationError as error:
            raise first_error(error.errors(include_url=False), at, lattice.source) from None
        mask |= choose(lattice, checked, lattice.source, ("at",)).ravel()
    return mask


_SELECTOR: TypeAdapter[Selector] = TypeAdapter(Selector)
