"""The `drag` edit as a model: pairs, pins and holds."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, Discriminator, Field, Strict, Tag
from pydantic_core import PydanticCustomError

from ffdcli.lattice.file.model_base import Corners, StrictModel, Vector
from ffdcli.lattice.file.selector_models import Selector


class Pair(StrictModel):
    """A point of the object, and where its image goes."""

    source: Vector = Field(alias="from", description="A point of the undeformed object.")
    to: Vector | None = Field(default=None, description="Where its image must be after this edit.")
    by: Vector | None = Field(
        default=None, description="What its image is displaced by, from where it is before it."
    )


class HoldPoint(StrictModel):
    """A point of the object whose image stays."""

    point: Vector = Field(description="A point of the undeformed object.")


class HoldInside(StrictModel):
    """A box of the object that stays, or moves as one."""

    inside: Corners = Field(description="The box, in model coordinates.")
    rigid: bool = Field(default=False, description="true: it moves as a rigid body.")


class HoldGroup(StrictModel):
    """A named group of the mesh that stays, or moves as one."""

    group: str = Field(description="Name of the group in the mesh file.")
    rigid: bool = Field(default=False, description="true: it moves as a rigid body.")


def _pair_file(name: str) -> str:
    if not name.lower().endswith(".csv"):
        raise PydanticCustomError("pair_file", "must name a .csv file")
    return name


def _kind_of_pairs(value: Any) -> str | None:
    if isinstance(value, str):
        return "pairs-file"
    return "pairs-list" if isinstance(value, (list, tuple)) else None


Pairs = Annotated[
    Annotated[str, AfterValidator(_pair_file), Tag("pairs-file")]
    | Annotated[tuple[Pair, ...], Strict(False), Field(min_length=1), Tag("pairs-list")],
    Discriminator(
        _kind_of_pairs,
        custom_error_type="pairs",
        custom_error_message="must be a list of {from, to} or {from, by}, or a .csv file name",
    ),
]


_HOLDS = {"point": HoldPoint, "inside": HoldInside, "group": HoldGroup}


def _one_known_hold(value: Any) -> Any:
    if isinstance(value, dict) and len(set(value) & set(_HOLDS)) > 1:
        both = " and ".join(name for name in _HOLDS if name in value)
        raise PydanticCustomError("hold", f"has {both}; give each an entry of its own")
    if isinstance(value, dict) and "point" in value and "rigid" in value:
        message = "a single point has no rigid motion of its own; leave `rigid` out"
        raise PydanticCustomError("hold", message)
    return value


def _kind_of_hold(value: Any) -> str | None:
    if not isinstance(value, (dict, BaseModel)):
        return None
    keys = value if isinstance(value, dict) else type(value).model_fields
    return next((f"hold-{name}" for name in _HOLDS if name in keys), None)


Hold = Annotated[
    Annotated[HoldPoint, Tag("hold-point")]
    | Annotated[HoldInside, Tag("hold-inside")]
    | Annotated[HoldGroup, Tag("hold-group")],
    Discriminator(
        _kind_of_hold,
        custom_error_type="hold_kind",
        custom_error_message="must be {point: [x, y, z]}, {inside: {min, max}} or {group: name}",
    ),
    BeforeValidator(_one_known_hold),
]

Pins = Annotated[tuple[Selector, ...], Strict(False)]
Holds = Annotated[tuple[Hold, ...], Strict(False)]


class DragPairs(StrictModel):
    """The key of a drag that only a file has; Python gives arrays."""

    pairs: Pairs = Field(
        description="{from, to} or {from, by} for each point, in model coordinates; or a .csv "
        "file, whose header row is x,y,z,tx,ty,tz (targets) or x,y,z,dx,dy,dz (displacements). "
        "Drags by displacement can be given in any order; those to targets at different points "
        "cannot, since each moves the other's image too."
    )


class DragOptions(StrictModel):
    """The keys of a drag besides its pairs."""

    pin: Pins = Field(
        default=(),
        description="Selectors (as in `at`) of control points that stay as they are.",
    )
    hold: Holds = Field(
        default=(),
        description="What stays: {point: [x, y, z]}, {inside: {min, max}} or {group: name}, in "
        "model coordinates; box or group with rigid: true move as one instead (not tspline).",
    )
    vary: Literal["points", "weights"] = Field(
        default="points",
        description="What changes: control points, or (nurbs, tspline) their weights, of which "
        "each keeps at least a hundredth.",
    )
    level_cost: float = Field(
        default=1.0,
        gt=0,
        description="hierarchical: how much more a move counts on each finer level. 1 spreads the "
        "drag over all levels; 4 keeps it mostly coarse.",
    )
    on_conflict: Literal["error", "least_squares"] = Field(
        default="error",
        description="Where not all can be met: refuse, or come as close as possible and say so.",
    )


# The order of the bases puts `pairs` first.
class Drag(DragOptions, DragPairs):
    """Move points of the object to where they should be; control points follow, moved least."""
