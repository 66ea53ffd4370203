"""Edits of the lattice file as models."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, Discriminator, Field, Strict, Tag
from pydantic_core import PydanticCustomError

from ffdcli.lattice.file.drag_models import Drag
from ffdcli.lattice.file.model_base import Axis, Fractions, StrictModel, Vector, unknown_key
from ffdcli.lattice.file.selector_models import Selector

_AT = (
    "Which control points: three entries along u, v, w, each an index (negative from the end), a "
    'list of indices or a quoted slice "start:stop", stop excluded; or {inside: {min, max}} or '
    "{near: [x, y, z]}, by where control points rest before any edit."
)
_ANGLE = "Degrees, right-handed about the axis."


class Move(StrictModel):
    """Displace control points, or put one somewhere."""

    at: Selector = Field(description=_AT)
    by: Vector | None = Field(default=None, description="Displacement.")
    to: Vector | None = Field(default=None, description="New place; for one control point only.")


class Rotation(StrictModel):
    """A rotation about a lattice axis."""

    axis: Axis
    angle: float = Field(description=_ANGLE)


class Transform(StrictModel):
    """Scale, then rotate, both about `center`, then translate control points."""

    at: Selector = Field(description=_AT)
    scale: Vector | None = Field(default=None, description="Factors along u, v and w.")
    rotate: Rotation | None = Field(default=None, description="Rotation about `center`.")
    translate: Vector | None = Field(default=None, description="Displacement, last.")
    center: Vector | None = Field(default=None, description="Fixed point; default: box centre.")


class Twist(StrictModel):
    """Turn about the box's centre line: not at all at the axis minimum, fully at its maximum."""

    axis: Axis
    angle: float = Field(description=_ANGLE)


class Taper(StrictModel):
    """Scale towards the box's centre line: by 1 at the axis minimum, by factor at its maximum."""

    axis: Axis
    factor: float = Field(gt=0, description="Scale of the cross-section at the axis maximum.")


class Bend(StrictModel):
    """Lay the box's centre line on an arc of the same length, its minimum end fixed."""

    axis: Axis = Field(description="The axis that is bent.")
    toward: Axis = Field(description="The axis it bends towards; the other way for angle < 0.")
    angle: float = Field(description="Degrees between the two ends.")


class Weight(StrictModel):
    """Give control points a weight: more than 1 draws the object towards them."""

    at: Selector = Field(description=_AT)
    value: float = Field(
        gt=0, description="The weight; at rest 1, for volume: tspline as octree.weights says."
    )


class MoveKnots(StrictModel):
    """New interior knots under unmoved control points (Hu 2001, section 2)."""

    axis: Axis
    values: Fractions = Field(description="The interior knots, rising, as fractions of the box.")


class Hammer(StrictModel):
    """Change the height of a peak, not its shape."""

    point: Vector = Field(description="A point of the undeformed object, where the peak is.")
    height: float = Field(
        description="How far its image then lies from it, along the peak; where nothing has moved "
        "yet, outwards from the surface."
    )


class Crimp(StrictModel):
    """Change the shape of a peak, not its height (with volume: nurbs or tspline)."""

    point: Vector = Field(description="A point of the undeformed object, where the peak is.")
    sharpness: float = Field(
        gt=0, description="What the weights of the peak's control points are multiplied by."
    )


def _net_file(name: str) -> str:
    if not name.lower().endswith((".npy", ".csv")):
        raise PydanticCustomError("net_file", "must name a .npy or .csv file")
    return name


def _depth(value: Any) -> int:
    """How deep lists are nested, by their first entries."""
    depth = 0
    while isinstance(value, (list, tuple)) and len(value):
        depth, value = depth + 1, value[0]
    return depth


def _kind_of_net(value: Any) -> str | None:
    if isinstance(value, str):
        return "net-file"
    if isinstance(value, (list, tuple)):
        return "net-rows" if _depth(value) == 2 else "net-lists"
    return "net-shifted" if isinstance(value, (dict, BaseModel)) else None


NetFile = Annotated[str, AfterValidator(_net_file)]
_Row = Annotated[tuple[Vector, ...], Strict(False)]
_Layer = Annotated[tuple[_Row, ...], Strict(False)]
NetLists = Annotated[tuple[_Layer, ...], Strict(False)]
NetRows = Annotated[tuple[Vector, ...], Strict(False)]


def _kind_of_points(value: Any) -> str | None:
    kind = _kind_of_net(value)
    return None if kind == "net-shifted" else kind


NetPoints = Annotated[
    Annotated[NetFile, Tag("net-file")]
    | Annotated[NetLists, Tag("net-lists")]
    | Annotated[NetRows, Tag("net-rows")],
    Discriminator(
        _kind_of_points,
        custom_error_type="net",
        custom_error_message="must be a .npy or .csv file name or nested lists",
    ),
]


class ShiftedNet(StrictModel):
    """A control net counted from a point of its own, which saves digits far from the origin."""

    origin: Vector = Field(description="What the control points count from.")
    points: NetPoints = Field(description="The net: file name or nested lists.")


Net = Annotated[
    Annotated[NetFile, Tag("net-file")]
    | Annotated[NetLists, Tag("net-lists")]
    | Annotated[NetRows, Tag("net-rows")]
    | Annotated[ShiftedNet, Tag("net-shifted")],
    Discriminator(
        _kind_of_net,
        custom_error_type="net",
        custom_error_message="must be a .npy or .csv file name, nested lists or {origin, points}",
    ),
]


_WeightRow = Annotated[tuple[float, ...], Strict(False)]
_WeightLayer = Annotated[tuple[_WeightRow, ...], Strict(False)]
WeightLists = Annotated[tuple[_WeightLayer, ...], Strict(False)]

WeightRow = Annotated[tuple[float, ...], Strict(False)]


def _kind_of_weights(value: Any) -> str | None:
    if isinstance(value, (list, tuple)):
        return "net-rows" if _depth(value) == 1 else "net-lists"
    return "net-file" if isinstance(value, str) else None


Weights = Annotated[
    Annotated[NetFile, Tag("net-file")]
    | Annotated[WeightLists, Tag("net-lists")]
    | Annotated[WeightRow, Tag("net-rows")],
    Discriminator(
        _kind_of_weights,
        custom_error_type="net",
        custom_error_message="must be a .npy or .csv file name or nested lists",
    ),
]


class MoveEdit(StrictModel):
    """Displace control points, or put one somewhere."""

    move: Move


class TransformEdit(StrictModel):
    """Scale, rotate, translate control points."""

    transform: Transform


class TwistEdit(StrictModel):
    """Twist the whole lattice about an axis."""

    twist: Twist


class TaperEdit(StrictModel):
    """Taper the whole lattice along an axis."""

    taper: Taper


class BendEdit(StrictModel):
    """Bend the whole lattice."""

    bend: Bend


class WeightEdit(StrictModel):
    """Give control points a weight (with volume: nurbs or tspline)."""

    weight: Weight


class MoveKnotsEdit(StrictModel):
    """Give an axis other interior knots."""

    move_knots: MoveKnots


class DragEdit(StrictModel):
    """Move points of the object to where they should be, control points moved least."""

    drag: Drag


class HammerEdit(StrictModel):
    """Give a peak another height, its shape unchanged."""

    hammer: Hammer


class CrimpEdit(StrictModel):
    """Make a peak fuller or sharper, its height unchanged (with volume: nurbs or tspline)."""

    crimp: Crimp


class NetEdit(StrictModel):
    """Set the whole control net."""

    net: Net = Field(
        description="All control points, (nu, nv, nw, 3), on an octree (n, 3): a .npy file, a .csv "
        "file of x,y,z rows with w fastest (paths relative to this file), or nested lists."
    )


class WeightsEdit(StrictModel):
    """Set all weights (with volume: nurbs or tspline)."""

    weights: Weights = Field(
        description="All weights, (nu, nv, nw), on an octree (n,): a .npy file, a .csv file of one "
        "number a row with w fastest (paths relative to this file), or nested lists."
    )


EDITS: dict[str, type[BaseModel]] = {
    "move": MoveEdit,
    "transform": TransformEdit,
    "twist": TwistEdit,
    "taper": TaperEdit,
    "bend": BendEdit,
    "weight": WeightEdit,
    "move_knots": MoveKnotsEdit,
    "drag": DragEdit,
    "hammer": HammerEdit,
    "crimp": CrimpEdit,
    "net": NetEdit,
    "weights": WeightsEdit,
}


def _one_known_edit(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return value
    if not isinstance(value, dict) or len(value) != 1:
        known = ", ".join(EDITS)
        raise PydanticCustomError("edit", f"must be a mapping with one key, of: {known}")
    key = next(iter(value))
    if key not in EDITS:
        raise unknown_key(key, list(EDITS))
    return value


def _kind_of_edit(value: Any) -> str:
    fields = type(value).model_fields if isinstance(value, BaseModel) else value
    return f"edit-{next(iter(fields))}"


Edit = Annotated[
    Annotated[MoveEdit, Tag("edit-move")]
    | Annotated[TransformEdit, Tag("edit-transform")]
    | Annotated[TwistEdit, Tag("edit-twist")]
    | Annotated[TaperEdit, Tag("edit-taper")]
    | Annotated[BendEdit, Tag("edit-bend")]
    | Annotated[WeightEdit, Tag("edit-weight")]
    | Annotated[MoveKnotsEdit, Tag("edit-move_knots")]
    | Annotated[DragEdit, Tag("edit-drag")]
    | Annotated[HammerEdit, Tag("edit-hammer")]
    | Annotated[CrimpEdit, Tag("edit-crimp")]
    | Annotated[NetEdit, Tag("edit-net")]
    | Annotated[WeightsEdit, Tag("edit-weights")],
    Discriminator(_kind_of_edit),
    BeforeValidator(_one_known_edit),
]
