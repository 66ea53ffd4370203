"""Pydantic models of the selectors that name control points."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, Discriminator, Field, Strict, Tag
from pydantic_core import PydanticCustomError

from ffdcli.lattice.file.model_base import Corners, StrictModel, Vector, three

_SLICE = re.compile(r"(-?\d+)?:(-?\d+)?")


def _slice(text: str) -> str:
    if not _SLICE.fullmatch(text):
        raise PydanticCustomError("slice", 'must be a slice like "1:3", ":2" or ":"')
    return text


def _kind_of_entry(value: Any) -> str | None:
    if isinstance(value, int) and not isinstance(value, bool):
        return "entry-index"
    if isinstance(value, str):
        return "entry-slice"
    return "entry-list" if isinstance(value, (list, tuple)) else None


Entry = Annotated[
    Annotated[int, Tag("entry-index")]
    | Annotated[str, AfterValidator(_slice), Tag("entry-slice")]
    | Annotated[tuple[int, ...], Strict(False), Field(min_length=1), Tag("entry-list")],
    Discriminator(
        _kind_of_entry,
        custom_error_type="entry",
        custom_error_message='must be an index, a list of indices or a quoted slice like "0:2"',
    ),
]
Indices = Annotated[
    tuple[Entry, Entry, Entry],
    Strict(False),
    BeforeValidator(three("entries (indices, lists of indices or quoted slices)")),
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


_SELECTORS = {"index": Numbered, "near": Near, "inside": Inside}


def _kind_of_selector(value: Any) -> str | None:
    if isinstance(value, (list, tuple)):
        return "at-indices"
    if isinstance(value, (dict, BaseModel)):
        keys = value if isinstance(value, dict) else type(value).model_fields
        return next((f"at-{name}" for name in _SELECTORS if name in keys), "at-inside")
    return None


Selector = Annotated[
    Annotated[Indices, Tag("at-indices")]
    | Annotated[Inside, Tag("at-inside")]
    | Annotated[Near, Tag("at-near")]
    | Annotated[Numbered, Tag("at-index")],
    Discriminator(
        _kind_of_selector,
        custom_error_type="selector",
        custom_error_message="must be a list of three entries, {inside: {min, max}} or "
        "{near: [x, y, z]}; on an octree also {index: n}",
    ),
]
