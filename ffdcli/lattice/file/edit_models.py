"""Pydantic models of the edits of a lattice file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

from ffdcli.lattice.file.drag_models import Drag
from ffdcli.lattice.file.fit_models import Fit
from ffdcli.lattice.file.model_base import Axis, Listed, StrictModel, Vector, by_type, unknown_key
from ffdcli.lattice.file.selectors import Selector

_AT = (
    "Which control points: three entries along u, v, w, each an index (negative: from the end), a "
    'list of indices or a quoted slice "start:stop", stop excluded; or {inside: {min, max}} or '
    "{near: [x, y, z]}, by the position of control points before any edit."
)
_ANGLE = "Degrees, right-handed about the axis."


class Move(StrictModel):
    """Displace control points, or move one to a position."""

    at: Selector = Field(description=_AT)
    by: Vector | None = Field(default=None, description="Displacement.")
    to: Vector | None = Field(default=None, description="New position; for one control point only.")


class Rotation(StrictModel):
    """A rotation about a lattice axis."""

    axis: Axis
    angle: float = Field(description=_ANGLE)


class Transform(StrictModel):
    """Scale, then rotate control points about `center`, then translate them."""

    at: Selector = Field(description=_AT)
    scale: Vector | None = Field(default=None, description="Factors along u, v and w.")
    rotate: Rotation | None = Field(default=None, description="Rotation about `center`.")
    translate: Vector | None = Field(default=None, description="Displacement, applied last.")
    center: Vector | None = Field(default=None, description="Fixed point. Default: box centre.")


class Twist(StrictModel):
    """Rotate about the centre line of the box: by 0 at the axis minimum, angle at the maximum."""

    axis: Axis
    angle: float = Field(description=_ANGLE)


class Taper(StrictModel):
    """Scale towards the centre line of the box: by 1 at the axis minimum, factor at the maximum."""

    axis: Axis
    factor: float = Field(gt=0, description="Scale of the cross-section at the axis maximum.")


class Bend(StrictModel):
    """Bend the centre line of the box into an arc of the same length; its minimum end is fixed."""

    axis: Axis = Field(description="The axis that is bent.")
    toward: Axis = Field(description="The axis that it bends towards, or away from if angle < 0.")
    angle: float = Field(description="Degrees between the two ends.")


class Weight(StrictModel):
    """Set the weight of control points: more than 1 draws the object towards them."""

    at: Selector = Field(description=_AT)
    value: float = Field(
        gt=0, description="The weight. At rest: 1, or octree.weights with volume: tspline."
    )


class MoveKnots(StrictModel):
    """Replace interior knots, control points unmoved (Hu 2001, section 2)."""

    axis: Axis
    values: Listed[float] = Field(
        description="The interior knots, ascending, as fractions of the box."
    )


class Hammer(StrictModel):
    """Change the height of a peak but not its shape."""

    point: Vector = Field(description="A point of the undeformed object, where the peak is.")
    height: float = Field(
        description="Distance of its image from it, along the peak. If nothing has moved there "
        "yet, a peak is raised along the outward normal of the surface."
    )
    by: Literal["displacement", "weights"] = Field(
        default="displacement",
        description="displacement: the displacements of the control points are scaled. weights "
        "(with volume: nurbs or tspline): no control point moves; two factors, of the weights of "
        "control points above the height and of the others that reach the point, give the height "
        "and change the profile least.",
    )


class Crimp(StrictModel):
    """Change the shape of a peak but not its height (with volume: nurbs or tspline)."""

    point: Vector = Field(description="A point of the undeformed object, where the peak is.")
    sharpness: float = Field(
        ge=0.01,
        le=100,
        description="From 0.01 to 100. More than 1 makes the peak sharper, less than 1 fuller: the "
        "weight of a control point is multiplied by 1 - (1 - 1 / sharpness) c, c being its basis "
        "function at the point over the largest one there.",
    )


def _net_file(name: str) -> str:
    if not name.lower().endswith((".npy", ".csv")):
        raise PydanticCustomError("net_file", "must name a .npy or .csv file")
    return name


def list_depth(value: Any) -> int:
    """Depth of nested lists, by their first entries."""
    depth = 0
    while isinstance(value, (list, tuple)) and len(value):
        depth, value = depth + 1, value[0]
    return depth


def _points_tag(rows: Any) -> str:
    return "net-rows" if list_depth(rows) == 2 else "net-lists"


NetFile = Annotated[str, AfterValidator(_net_file), Tag("net-file")]
NetLists = Annotated[Listed[Listed[Listed[Vector]]], Tag("net-lists")]
NetRows = Annotated[Listed[Vector], Tag("net-rows")]
_FILE_OR_LISTS = "must be a .npy or .csv file name or nested lists"


class ShiftedNet(StrictModel):
    """A control net relative to a point, which keeps all digits far from the origin."""

    origin: Vector = Field(description="Point that the control points are relative to.")
    points: Annotated[
        NetFile | NetLists | NetRows,
        by_type("net", _FILE_OR_LISTS, text="net-file", list=_points_tag),
    ] = Field(description="The control points: file name or nested lists.")


Net = Annotated[
    NetFile | NetLists | NetRows | Annotated[ShiftedNet, Tag("net-shifted")],
    by_type(
        "net",
        "must be a .npy or .csv file name, nested lists or {origin, points}",
        text="net-file",
        list=_points_tag,
        mapping="net-shifted",
    ),
]
Weights = Annotated[
    NetFile
    | Annotated[Listed[Listed[Listed[float]]], Tag("net-lists")]
    | Annotated[Listed[float], Tag("net-rows")],
    by_type(
        "net",
        _FILE_OR_LISTS,
        text="net-file",
        list=lambda rows: "net-rows" if list_depth(rows) == 1 else "net-lists",
    ),
]


class EditModel(StrictModel):
    """A mapping with one key, the name of the edit."""

    @property
    def name(self) -> str:
        """The key."""
        return next(iter(self.model_fields_set))

    @property
    def value(self) -> Any:
        """The value of the key."""
        return getattr(self, self.name)


class MoveEdit(EditModel):
    """Displace control points, or move one to a position."""

    move: Move


class TransformEdit(EditModel):
    """Scale, rotate and translate control points."""

    transform: Transform


class TwistEdit(EditModel):
    """Twist the whole lattice about an axis."""

    twist: Twist


class TaperEdit(EditModel):
    """Taper the whole lattice along an axis."""

    taper: Taper


class BendEdit(EditModel):
    """Bend the whole lattice."""

    bend: Bend


class WeightEdit(EditModel):
    """Set the weight of control points (with volume: nurbs or tspline)."""

    weight: Weight


class MoveKnotsEdit(EditModel):
    """Replace the interior knots along an axis."""

    move_knots: MoveKnots


class DragEdit(EditModel):
    """Move points of the object to targets, with the least move of control points."""

    drag: Drag


class FitEdit(EditModel):
    """Move many points to targets by least squares, as smoothly as the data allows."""

    fit: Fit


class HammerEdit(EditModel):
    """Change the height of a peak but not its shape."""

    hammer: Hammer


class CrimpEdit(EditModel):
    """Make a peak sharper or fuller at the same height (with volume: nurbs or tspline)."""

    crimp: Crimp


class NetEdit(EditModel):
    """Set the whole control net."""

    net: Net = Field(
        description="All control points, (nu, nv, nw, 3), or (n, 3) on an octree: a .npy file, a "
        ".csv file with rows x,y,z, w fastest, or nested lists. Paths are relative to this file."
    )


class WeightsEdit(EditModel):
    """Set all weights (with volume: nurbs or tspline)."""

    weights: Weights = Field(
        description="All weights, (nu, nv, nw), or (n,) on an octree: a .npy file, a .csv file "
        "with one number per row, w fastest, or nested lists. Paths are relative to this file."
    )


EDITS = {next(iter(model.model_fields)): model for model in EditModel.__subclasses__()}


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
    | Annotated[FitEdit, Tag("edit-fit")]
    | Annotated[HammerEdit, Tag("edit-hammer")]
    | Annotated[CrimpEdit, Tag("edit-crimp")]
    | Annotated[NetEdit, Tag("edit-net")]
    | Annotated[WeightsEdit, Tag("edit-weights")],
    Discriminator(_kind_of_edit),
    BeforeValidator(_one_known_edit),
]
