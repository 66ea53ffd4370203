"""The lattice file as a model: what may be written in it, and what each key means.

The descriptions here and in ``edit_models.py`` are the only ones: the starter file, the JSON Schema
and the messages about unknown keys all come from them. What several keys must satisfy together is
in ``check.py``.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Strict, Tag
from pydantic_core import PydanticCustomError

from ffdcli.lattice.file.edit_models import Edit
from ffdcli.lattice.file.model_base import Corners, Fractions, StrictModel, Vector, three
from ffdcli.lattice.file.octree_models import OctreeSpec
from ffdcli.units import UnitName

Continuity = Literal["c0", "c1", "c2"]

Axes = Annotated[
    tuple[Vector, Vector, Vector], Strict(False), BeforeValidator(three("unit vectors"))
]
Whole = Annotated[int, Field(ge=1)]
Counts = Annotated[
    tuple[Whole, Whole, Whole], Strict(False), BeforeValidator(three("whole numbers"))
]
Knots = Annotated[
    tuple[Fractions, Fractions, Fractions],
    Strict(False),
    BeforeValidator(three("lists of interior knots")),
]


class OrientedBox(StrictModel):
    """A box by its centre and size, turned if axes are given."""

    center: Vector = Field(description="Centre, in model coordinates.")
    size: Vector = Field(description="Full length along u, v and w.")
    axes: Axes | None = Field(
        default=None,
        description="Unit vectors of u, v and w, right-handed. Where they are given, coordinates "
        "in edits count from the centre of the box along these axes; without them they are the "
        "model's own.",
    )


def _kind_of_box(value: Any) -> str | None:
    if isinstance(value, (dict, BaseModel)):
        keys = value if isinstance(value, dict) else type(value).model_fields
        return "box-by-center" if {"center", "size", "axes"} & set(keys) else "box-by-corners"
    return "box-auto" if isinstance(value, str) else None


Box = Annotated[
    Annotated[Literal["auto"], Tag("box-auto")]
    | Annotated[Corners, Tag("box-by-corners")]
    | Annotated[OrientedBox, Tag("box-by-center")],
    Discriminator(
        _kind_of_box,
        custom_error_type="box",
        custom_error_message="must be auto, {min, max} or {center, size, axes}",
    ),
]


class SideBorders(StrictModel):
    """Continuity of the join for each side of the box."""

    u_min: Continuity = "c1"
    u_max: Continuity = "c1"
    v_min: Continuity = "c1"
    v_max: Continuity = "c1"
    w_min: Continuity = "c1"
    w_max: Continuity = "c1"


def _kind_of_border(value: Any) -> str | None:
    if isinstance(value, str):
        return "border-all"
    return "border-by-side" if isinstance(value, (dict, BaseModel)) else None


Border = Annotated[
    Annotated[Continuity, Tag("border-all")] | Annotated[SideBorders, Tag("border-by-side")],
    Discriminator(
        _kind_of_border,
        custom_error_type="border",
        custom_error_message="must be c0, c1, c2, or one of these per side as in {u_min: c0}",
    ),
]


def _whole_one(value: Any) -> Any:
    # A literal would take 1.0 and true for 1.
    if type(value) is not int or value != 1:
        raise PydanticCustomError("version", "must be 1, the only version so far")
    return value


def _empty_for_nothing(value: Any) -> Any:
    # `edits:` with everything below it commented out reads as null.
    return () if value is None else value


class LatticeSpec(StrictModel):
    """A lattice file for ffd: a deforming volume, and edits of its control points."""

    model_config = ConfigDict(title="ffd lattice file")

    version: Annotated[Literal[1], BeforeValidator(_whole_one)] = Field(
        description="Version of this file format."
    )
    volume: Literal["bspline", "nurbs", "tspline", "hierarchical"] = Field(
        default="bspline",
        description="Kind of volume. bspline: polynomial; nurbs: rational, control points have "
        "weights too; tspline and hierarchical: finer where the mesh is, see octree.",
    )
    degree: Counts = Field(
        default=(3, 3, 3),
        description="Degree along u, v and w, from 1; together at most 25. Higher is smoother.",
    )
    points: Counts | None = Field(
        default=None,
        description="Control points along u, v and w, each more than the degree. More make edits "
        "more local. Default: degree + 3.",
    )
    box: Box = Field(
        default="auto",
        description="What the lattice spans. auto: the bounding box of the mesh, with a twentieth "
        "of the mesh's size added either side along an axis where the mesh is flat; or {min: "
        "[x, y, z], max: [x, y, z]}; or {center: [x, y, z], size: [du, dv, dw], axes: [[..], "
        "[..], [..]]}, whose rows are the unit vectors of u, v, w.",
    )
    knots: Knots | None = Field(
        default=None,
        description="Interior knots along u, v and w (points - degree - 1 of each) as rising "
        "fractions between 0 and 1 of the box; null spaces them evenly.",
    )
    ends: Literal["clamped", "unclamped"] = Field(
        default="clamped",
        description="clamped: the outer control points lie on the box; unclamped: knots and "
        "control points go on beyond it.",
    )
    unit: UnitName | None = Field(
        default=None,
        description="Length unit of the numbers; default: the mesh file's, else mm.",
    )
    border: Border = Field(
        default="c1",
        description="How smooth the join is where the mesh reaches out of the box: c0, c1 or c2 "
        "locks 1, 2 or 3 layers of control points there (unclamped: at least as many as the "
        "degree); or per side, as in {u_min: c0}.",
    )
    octree: OctreeSpec | None = Field(
        default=None,
        description="For volume: tspline (weighted, cubic) and hierarchical (levels of B-spline "
        "displacements): {depth: 4, refine: surface, also: [{min, max, depth}]}; in place of "
        "points, knots, ends and border.",
    )
    edits: Annotated[tuple[Edit, ...], Strict(False), BeforeValidator(_empty_for_nothing)] = Field(
        default=(),
        json_schema_extra={"type": ["array", "null"]},
        description="Edits of the control points, in order, each on what the ones before left. "
        "Coordinates are the model's own (for a box with axes: from its centre, along its axes).",
    )

    @property
    def adaptive(self) -> bool:
        """Whether the control points come from an octree."""
        return self.volume in ("tspline", "hierarchical")

    @property
    def inverted(self) -> bool:
        """Whether points are deformed where the volume at rest has them: `embedding: inverse`."""
        return self.octree is not None and self.octree.embedding == "inverse"

    @property
    def deepest(self) -> int:
        """Depth of the finest cells of the octree."""
        parts = () if self.octree is None else self.octree.also
        return max([0 if self.octree is None else self.octree.depth, *(p.depth for p in parts)])

    @property
    def weighted(self) -> bool:
        """Whether control points have weights."""
        return self.volume in ("nurbs", "tspline")

    @property
    def counts(self) -> tuple[int, int, int]:
        """Control points along u, v and w, the default worked out."""
        if self.points is not None:
            return self.points
        ku, kv, kw = self.degree
        return ku + 3, kv + 3, kw + 3

    def continuity(self, side: str) -> Continuity:
        """The border asked for at a side such as ``u_min``."""
        if isinstance(self.border, SideBorders):
            chosen: Continuity = getattr(self.border, side)
            return chosen
        return self.border


class LatticesSpec(StrictModel):
    """A lattice file with several lattices; each entry is a :class:`LatticeSpec` but for `OUTER`.

    The entries are checked one by one, since messages about them count from their own keys.
    """

    version: Annotated[Literal[1], BeforeValidator(_whole_one)] = Field(
        description="Version of this file format."
    )
    unit: UnitName | None = Field(default=None, description="Length unit of the numbers.")
    lattices: Annotated[tuple[dict[str, Any], ...], Strict(False)] = Field(
        min_length=1,
        description="Several lattices with disjoint boxes, each with the other keys of this file "
        "for itself; only version and unit stay outside. Boxes may touch side to side.",
    )


# Keys that hold for the whole file where it has several lattices.
OUTER = ("version", "unit")


def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of the lattice file, for editors."""
    schema = LatticeSpec.model_json_schema()
    whole = schema["properties"]
    inner = {key: value for key, value in whole.items() if key not in OUTER}
    entry = {"type": "object", "properties": inner, "additionalProperties": False}
    described = LatticesSpec.model_fields["lattices"].description
    several = {"type": "array", "items": entry, "minItems": 1, "description": described}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "properties": {**whole, "lattices": several},
        "dependentSchemas": {"lattices": {"properties": dict.fromkeys(inner, False)}},
    }
