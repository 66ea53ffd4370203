"""Models of the selectors of control points, and the control points that they name."""

from __future__ import annotations

import re
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, Tag
from pydantic_core import PydanticCustomError

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.lattice.file.model_base import (
    Corners,
    Listed,
    StrictModel,
    Three,
    Vector,
    by_type,
    three,
)
from ffdcli.volume.protocol import LatticeMap

_SLICE = re.compile(r"(-?[0-9]{1,18})?:(-?[0-9]{1,18})?")


def _slice(text: str) -> str:
    if not _SLICE.fullmatch(text):
        raise PydanticCustomError("slice", 'must be a slice like "1:3", ":2" or ":"')
    return text


Entry = Annotated[
    Annotated[int, Tag("entry-index")]
    | Annotated[str, AfterValidator(_slice), Tag("entry-slice")]
    | Annotated[Listed[int], Field(min_length=1), Tag("entry-list")],
    by_type(
        "entry",
        'must be an index, a list of indices or a quoted slice like "0:2"',
        number="entry-index",
        text="entry-slice",
        list="entry-list",
    ),
]
Indices = Annotated[
    Three[Entry], BeforeValidator(three("entries (indices, lists of indices or quoted slices)"))
]


class _OnOctree(StrictModel):
    level: int | None = Field(
        default=None, ge=0, description="On an octree: only this level; 0 is the coarsest."
    )
    hidden: bool = Field(
        default=False,
        description="On an octree: true also selects control points of empty cells.",
    )


class Inside(_OnOctree):
    """Control points whose rest position is inside a box or on its sides."""

    inside: Corners = Field(description="The box, in the coordinates of the edits.")


class Near(_OnOctree):
    """The control point whose rest position is nearest to a point; the first of several."""

    near: Vector = Field(description="The point, in the coordinates of the edits.")


class Numbered(_OnOctree):
    """Control points of an octree by index."""

    index: Entry = Field(
        description="An index (negative: from the end), a list of indices, or a quoted slice."
    )


def _by_place(keys: Any) -> str:
    return next((f"at-{name}" for name in ("index", "near") if name in keys), "at-inside")


Selector = Annotated[
    Annotated[Indices, Tag("at-indices")]
    | Annotated[Inside, Tag("at-inside")]
    | Annotated[Near, Tag("at-near")]
    | Annotated[Numbered, Tag("at-index")],
    by_type(
        "selector",
        "must be a list of three entries, {inside: {min, max}} or {near: [x, y, z]}; on an octree "
        "also {index: n}",
        list="at-indices",
        mapping=_by_place,
    ),
]

# A control point this close to a side of an `inside` box, relative to the lattice, lies on it:
# rest positions are computed (0.30000000000000004), while the box is written by hand.
_ON_SIDE = 1e-9


def entry_indices(entry: Entry, count: int) -> Ints:
    """Ascending indices out of 0..count-1 that an entry (index, list, "start:stop") names.

    Indices must be in range; a slice may be empty.
    """
    if isinstance(entry, str):
        start, stop = (int(part) if part else None for part in entry.split(":"))
        return np.arange(count)[slice(start, stop)]
    if isinstance(entry, int):
        return np.array([entry % count])
    return np.unique(np.array(entry, dtype=np.int64) % count)


def select(at: Selector, places: Floats, rest: LatticeMap | None = None) -> Bools:
    """(nu, nv, nw) or (n,) control points that a selector with checked indices names.

    ``places`` (..., 3) are those before any edit, in the coordinates of the edits. With the map at
    rest, an octree's hidden control points are chosen only where asked for.
    """
    shape = places.shape[:-1]
    chosen = np.zeros(shape, dtype=bool)
    if isinstance(at, tuple):
        u, v, w = (entry_indices(entry, count) for entry, count in zip(at, shape, strict=True))
        chosen[u[:, None, None], v[:, None], w] = True
        return chosen
    allowed = np.ones(shape, dtype=bool)
    if rest is not None:
        if at.level is not None:
            allowed &= rest.levels == at.level
        if not at.hidden:
            allowed &= ~rest.hidden
    if isinstance(at, Numbered):
        chosen[entry_indices(at.index, len(chosen))] = True
    elif isinstance(at, Inside):
        slack = _ON_SIDE * np.ptp(places.reshape(-1, 3), axis=0)
        low, high = np.array(at.inside.min) - slack, np.array(at.inside.max) + slack
        chosen = np.asarray(np.all((places >= low) & (places <= high), axis=-1))
    elif allowed.any():
        distances = np.where(allowed, np.linalg.norm(places - np.array(at.near), axis=-1), np.inf)
        chosen.flat[int(np.argmin(distances))] = True
    return chosen & allowed
