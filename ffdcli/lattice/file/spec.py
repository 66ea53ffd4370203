"""Pydantic models of a lattice file's outer keys, with a description of each.

The starter file, the JSON Schema and the messages about unknown keys are all made from these
models and those of the edits. Conditions on several keys together are in ``check_spec.py``.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field, Strict, Tag
from pydantic_core import PydanticCustomError

from ffdcli.lattice.file.edit_models import Edit
from ffdcli.lattice.file.model_base import (
    Corners,
    Listed,
    StrictModel,
    Three,
    Vector,
    by_type,
    three,
)
from ffdcli.units import UnitName

MAX_DEPTH = 9
# Most control points of a lattice whose cells a fit divides.
MAX_FITTED = 100_000

Depth = Annotated[int, Field(ge=1, le=MAX_DEPTH)]
_AnyDepth = Annotated[
    Annotated[Literal["auto"], Tag("depth-auto")] | Annotated[Depth, Tag("depth-number")],
    by_type("depth", "must be auto or a whole number", text="depth-auto", number="depth-number"),
]
_Heavy = Annotated[float, Field(gt=0)]


class Refined(Corners):
    """A part of the box whose cells are divided to another depth."""

    depth: Depth = Field(description="Number of times that cells which meet the part are halved.")


class OctreeSpec(StrictModel):
    """Division of the box of a tspline or hierarchical volume into cells."""

    region: Literal["auto", "oriented", "minimum"] = Field(
        default="auto",
        description="The box of the octree. auto: as `box` says. oriented: a box along the "
        "principal axes of the mesh. minimum: the turned box of least volume round the mesh.",
    )
    depth: _AnyDepth = Field(
        default=4,
        description="Number of times that cells which hold part of the mesh are halved. auto "
        "(hierarchical, with `fit` as the first edit): cells are halved where the fit misses its "
        "pairs by more than the tolerance and the noise.",
    )
    max_depth: Depth = Field(
        default=7, description="depth: auto: most times that a cell is halved."
    )
    max_points: int = Field(
        default=20_000,
        ge=1,
        le=MAX_FITTED,
        description="depth: auto: most control points that the fit may use.",
    )
    refine: Literal["surface", "vertices"] = Field(
        default="surface",
        description="Which cells are divided: those that the surface passes through, or those that "
        "hold a vertex.",
    )
    also: Listed[Refined] = Field(
        default=(),
        description="Boxes {min, max, depth} whose cells are divided to another depth, in the "
        "coordinates of the edits.",
    )
    balance: bool = Field(
        default=True,
        description="true: further cells are halved, until cells that touch differ by at most one "
        "level. false: only cells that hold part of the mesh, or meet a box of `also`, are halved, "
        "as in Song & Yang (2005): fewer control points, but steeper changes of size.",
    )
    weights: Annotated[tuple[_Heavy, _Heavy], Strict(False)] = Field(
        default=(100.0, 1.0),
        description="tspline: weights at rest. The first is for control points of cells that hold "
        "part of the mesh, the second for all others, which are hidden.",
    )
    cells: str | None = Field(
        default=None,
        description="tspline: .csv file with the cells of a T-lattice, which replaces depth, "
        "also and balance. One row u0,v0,w0,u1,v1,w1 per cell, in whole units; the highest number "
        "along an axis is the upper side of the box. The path is relative to this file. null: the "
        "octree is refined round the mesh.",
    )
    embedding: Literal["displacement", "inverse"] = Field(
        default="displacement",
        description="displacement: a point is moved by the difference of the edited volume and the "
        "volume at rest, both evaluated at the point. This is the identity at rest, and surfaces "
        "are exact. inverse (tspline only): both are evaluated at the parameters for which the "
        "volume at rest gives the point (Song & Yang 2005), and surfaces are fitted within "
        "--fit-tolerance.",
    )

    @property
    def most(self) -> int:
        """Number of times that cells which hold part of the mesh are, or may be, halved."""
        return self.max_depth if self.depth == "auto" else self.depth

    def written(self) -> dict[str, Any]:
        """The keys that have an effect, as plain values: `cells` replaces those of an octree."""
        replaced = {"depth", "also", "balance"} if self.cells is not None else set()
        return self.model_dump(exclude=replaced | {"max_depth", "max_points"})


Continuity = Literal["c0", "c1", "c2"]

Axes = Annotated[Three[Vector], BeforeValidator(three("unit vectors"))]
Counts = Annotated[Three[Annotated[int, Field(ge=1)]], BeforeValidator(three("whole numbers"))]
Knots = Annotated[Three[Listed[float]], BeforeValidator(three("lists of interior knots"))]


class OrientedBox(StrictModel):
    """A box given by centre and size, and by axes if it is turned."""

    center: Vector = Field(description="Centre, in model coordinates.")
    size: Vector = Field(description="Full length along u, v and w.")
    axes: Axes | None = Field(
        default=None,
        description="Unit vectors of u, v and w, right-handed. If they are given, coordinates in "
        "edits count from the centre of the box along these axes; otherwise they are model "
        "coordinates.",
    )


Box = Annotated[
    Annotated[Literal["auto"], Tag("box-auto")]
    | Annotated[Corners, Tag("box-by-corners")]
    | Annotated[OrientedBox, Tag("box-by-center")],
    by_type(
        "box",
        "must be auto, {min, max} or {center, size, axes}",
        text="box-auto",
        mapping=lambda keys: (
            "box-by-center" if {"center", "size", "axes"} & {*keys} else "box-by-corners"
        ),
    ),
]


class SideBorders(StrictModel):
    """Continuity across each side of the box."""

    u_min: Continuity = "c1"
    u_max: Continuity = "c1"
    v_min: Continuity = "c1"
    v_max: Continuity = "c1"
    w_min: Continuity = "c1"
    w_max: Continuity = "c1"


Border = Annotated[
    Annotated[Continuity, Tag("border-all")] | Annotated[SideBorders, Tag("border-by-side")],
    by_type(
        "border",
        "must be c0, c1, c2, or one of these per side as in {u_min: c0}",
        text="border-all",
        mapping="border-by-side",
    ),
]


def _whole_one(value: Any) -> Any:
    # A Literal would accept 1.0 and true.
    if type(value) is not int or value != 1:
        raise PydanticCustomError("version", "must be 1, the only version so far")
    return value


def _empty_for_nothing(value: Any) -> Any:
    # `edits:` with all lines below it commented out is null in YAML.
    return () if value is None else value


class LatticeSpec(StrictModel):
    """A lattice file for ffd: a deforming volume, and edits of its control points."""

    model_config = ConfigDict(title="ffd lattice file")

    version: Annotated[Literal[1], BeforeValidator(_whole_one)] = Field(
        description="Version of this file format."
    )
    volume: Literal["bspline", "nurbs", "tspline", "hierarchical"] = Field(
        default="bspline",
        description="Kind of volume. bspline: polynomial. nurbs: rational, control points also "
        "have weights. tspline and hierarchical: finer near the mesh, see octree.",
    )
    degree: Counts = Field(
        default=(3, 3, 3),
        description="Degrees along u, v and w: 1 or more, with a sum of at most 25. A higher "
        "degree is smoother.",
    )
    points: Counts | None = Field(
        default=None,
        description="Numbers of control points along u, v and w, each greater than the degree. "
        "With more control points, edits are more local. Default: degree + 3.",
    )
    box: Box = Field(
        default="auto",
        description="The box of the lattice. auto: the bounding box of the mesh; along an axis "
        "where the mesh is flat, 5 % of the size of the mesh is added on both sides. Or {min: "
        "[x, y, z], max: [x, y, z]}. Or {center: [x, y, z], size: [du, dv, dw], axes: [[..], "
        "[..], [..]]}, where the rows of axes are the unit vectors of u, v and w.",
    )
    knots: Knots | None = Field(
        default=None,
        description="Interior knots along u, v and w: points - degree - 1 ascending fractions of "
        "the box each, between 0 and 1. null: evenly spaced.",
    )
    ends: Literal["clamped", "unclamped"] = Field(
        default="clamped",
        description="clamped: the outermost control points lie on the box. unclamped: knots and "
        "control points continue beyond it.",
    )
    unit: UnitName | None = Field(
        default=None,
        description="Length unit of the numbers. Default: the unit of the mesh file, or else mm.",
    )
    border: Border = Field(
        default="c1",
        description="Continuity where the mesh crosses a side of the box. c0, c1 and c2 lock 1, 2 "
        "and 3 layers of control points at that side (with unclamped ends at least as many as the "
        "degree). Or one value per side, as in {u_min: c0}. volume: tspline joins with c2, "
        "whichever is asked for.",
    )
    octree: OctreeSpec | None = Field(
        default=None,
        description="Cells of volume: tspline (cubic, with weights) and hierarchical (levels of "
        "B-spline displacements): {depth: 4, refine: surface, also: [{min, max, depth}]}. It "
        "replaces points, knots and ends.",
    )
    edits: Annotated[Listed[Edit], BeforeValidator(_empty_for_nothing)] = Field(
        default=(),
        json_schema_extra={"type": ["array", "null"]},
        description="Edits of the control points, applied in order. Each works on the result of "
        "those before. Coordinates are model coordinates; for a box with axes they count from its "
        "centre along its axes.",
    )

    @property
    def adaptive(self) -> bool:
        """Whether the control points come from an octree."""
        return self.volume in ("tspline", "hierarchical")

    @property
    def grown(self) -> bool:
        """Whether the first edit, a fit, divides the cells of the octree."""
        return self.octree is not None and self.octree.depth == "auto"

    @property
    def inverted(self) -> bool:
        """Whether the deformation goes through the inverse of the volume at rest."""
        return self.octree is not None and self.octree.embedding == "inverse"

    @property
    def deepest(self) -> int:
        """Depth of the finest cells of the octree."""
        parts = () if self.octree is None else self.octree.also
        return max([0 if self.octree is None else self.octree.most, *(p.depth for p in parts)])

    @property
    def weighted(self) -> bool:
        """Whether control points have weights."""
        return self.volume in ("nurbs", "tspline")

    @property
    def counts(self) -> tuple[int, int, int]:
        """Numbers of control points along u, v and w, also where the file gives none."""
        if self.points is not None:
            return self.points
        ku, kv, kw = self.degree
        return ku + 3, kv + 3, kw + 3

    def continuity(self, side: str) -> Continuity:
        """Continuity that the file asks for across a side such as ``u_min``."""
        if isinstance(self.border, SideBorders):
            chosen: Continuity = getattr(self.border, side)
            return chosen
        return self.border


# Most lattices of a file: each is judged by itself, in some hundredths of a second.
MAX_LATTICES = 1000


class LatticesSpec(StrictModel):
    """A lattice file with several lattices.

    Each entry has the keys of :class:`LatticeSpec` except those in ``OUTER``. The entries are
    checked one by one, because key paths in messages count from the entry.
    """

    version: Annotated[Literal[1], BeforeValidator(_whole_one)] = Field(
        description="Version of this file format."
    )
    unit: UnitName | None = Field(default=None, description="Length unit of the numbers.")
    lattices: Listed[dict[str, Any]] = Field(
        min_length=1,
        max_length=MAX_LATTICES,
        description="Several lattices with disjoint boxes. Each entry has all keys of this file "
        "except version and unit, which stay outside. Boxes may touch side to side.",
    )


# Keys that apply to all lattices of a file.
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
