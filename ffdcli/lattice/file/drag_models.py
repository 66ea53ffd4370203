"""Pydantic models of the `drag` edit: pairs, pins and holds."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, Tag
from pydantic_core import PydanticCustomError

from ffdcli.lattice.file.model_base import Corners, Listed, StrictModel, Vector, by_type
from ffdcli.lattice.file.selectors import Selector


class Pair(StrictModel):
    """A point of the object and the target or displacement of its image."""

    source: Vector = Field(alias="from", description="A point of the undeformed object.")
    to: Vector | None = Field(default=None, description="Position of its image after this edit.")
    by: Vector | None = Field(default=None, description="Displacement of its image by this edit.")


class HoldPoint(StrictModel):
    """A point of the object whose image does not move."""

    point: Vector = Field(description="A point of the undeformed object.")


class HoldInside(StrictModel):
    """A box of the object that does not move, or moves as a rigid body."""

    inside: Corners = Field(description="The box, in model coordinates.")
    rigid: bool = Field(default=False, description="true: move as a rigid body.")


class HoldGroup(StrictModel):
    """A named group of the mesh that does not move, or moves as a rigid body."""

    group: str = Field(description="Name of the group in the mesh file.")
    rigid: bool = Field(default=False, description="true: move as a rigid body.")


def _pair_file(name: str) -> str:
    if not name.lower().endswith(".csv"):
        raise PydanticCustomError("pair_file", "must name a .csv file")
    return name


Pairs = Annotated[
    Annotated[str, AfterValidator(_pair_file), Tag("pairs-file")]
    | Annotated[Listed[Pair], Field(min_length=1), Tag("pairs-list")],
    by_type(
        "pairs",
        "must be a list of {from, to} or {from, by}, or a .csv file name",
        text="pairs-file",
        list="pairs-list",
    ),
]


_HOLDS = ("point", "inside", "group")


def _one_known_hold(value: Any) -> Any:
    if isinstance(value, dict) and len(set(value) & set(_HOLDS)) > 1:
        both = " and ".join(name for name in _HOLDS if name in value)
        raise PydanticCustomError("hold", f"has {both}; write one entry for each")
    if isinstance(value, dict) and "point" in value and "rigid" in value:
        message = "a single point has no rigid motion; remove `rigid`"
        raise PydanticCustomError("hold", message)
    return value


Hold = Annotated[
    Annotated[HoldPoint, Tag("hold-point")]
    | Annotated[HoldInside, Tag("hold-inside")]
    | Annotated[HoldGroup, Tag("hold-group")],
    by_type(
        "hold_kind",
        "must be {point: [x, y, z]}, {inside: {min, max}} or {group: name}",
        mapping=lambda keys: next((f"hold-{name}" for name in _HOLDS if name in keys), None),
    ),
    BeforeValidator(_one_known_hold),
]


class DragPairs(StrictModel):
    """The pairs of a drag, for which Python takes arrays."""

    pairs: Pairs = Field(
        description="{from, to} or {from, by} for each point, in model coordinates; or a .csv "
        "file with the header row x,y,z,tx,ty,tz (targets) or x,y,z,dx,dy,dz (displacements). "
        "The order of several drags matters where they have targets, because each drag also moves "
        "the images of the other points; it does not matter for displacements."
    )


class DragOptions(StrictModel):
    """The keys of a drag besides its pairs."""

    pin: Listed[Selector] = Field(
        default=(),
        description="Selectors (as in `at`) of control points that do not move.",
    )
    hold: Listed[Hold] = Field(
        default=(),
        description="Parts that do not move: {point: [x, y, z]}, {inside: {min, max}} or {group: "
        "name}, in model coordinates. With rigid: true (not tspline) a box or group moves as a "
        "rigid body instead.",
    )
    vary: Literal["points", "weights"] = Field(
        default="points",
        description="What the drag changes: points, or weights (nurbs, tspline). Each weight keeps "
        "at least a hundredth of its value.",
    )
    level_cost: float = Field(
        default=1.0,
        gt=0,
        description="hierarchical: cost of a move on each level relative to the next coarser one. "
        "With 1 all levels share the drag; with 4 mostly the coarse levels move.",
    )
    on_conflict: Literal["error", "least_squares"] = Field(
        default="error",
        description="What happens if not all targets can be met. error: the edit fails. "
        "least_squares: the images come as close as possible, with a warning.",
    )


# The order of the bases puts `pairs` first.
class Drag(DragOptions, DragPairs):
    """Move points of the object to targets, with the least move of control points."""
