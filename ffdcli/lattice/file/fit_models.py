"""Pydantic models of the `fit` edit: many pairs, met by least squares with a bending energy."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, Tag
from pydantic_core import PydanticCustomError

from ffdcli.fields.formats import FIELD_SUFFIXES
from ffdcli.lattice.file.drag_models import Hold, Pair
from ffdcli.lattice.file.model_base import Listed, StrictModel, by_type
from ffdcli.lattice.file.selectors import Selector
from ffdcli.units import UnitName

Smooth = Annotated[
    Annotated[Literal["auto"], Tag("smooth-auto")]
    | Annotated[float, Field(ge=0), Tag("smooth-number")],
    by_type(
        "smooth",
        "must be auto or a number of at least 0",
        text="smooth-auto",
        number="smooth-number",
        fraction="smooth-number",
    ),
]


def _field_file(name: str) -> str:
    if not name.lower().endswith(FIELD_SUFFIXES):
        *names, last = FIELD_SUFFIXES
        raise PydanticCustomError("field_file", f"must name a {', '.join(names)} or {last} file")
    return name


FieldPairs = Annotated[
    Annotated[str, AfterValidator(_field_file), Tag("field-file")]
    | Annotated[Listed[Pair], Field(min_length=1), Tag("pairs-list")],
    by_type(
        "pairs",
        "must be a list of {from, to} or {from, by}, or a file name",
        text="field-file",
        list="pairs-list",
    ),
]


class FitPairs(StrictModel):
    """The pairs of a fit, for which Python takes arrays."""

    pairs: FieldPairs | None = Field(
        default=None,
        description="{from, to} or {from, by} for each point, in model coordinates; or a file: a "
        ".csv table with the header row x,y,z,tx,ty,tz (targets) or x,y,z,dx,dy,dz "
        "(displacements) and perhaps a last column weight; an .npz file with the arrays points, "
        "displacements or targets, and perhaps weights; or a mesh file with a result, such as "
        ".vtu, .vtk or .xdmf (see the formats).",
    )
    field: str | None = Field(
        default=None,
        description="Name of the displacement field in a mesh file. Default: the only field of "
        "three numbers for each node.",
    )
    targets: str | None = Field(
        default=None,
        description="For mesh files without a result (.inp, .msh, .bdf): the same mesh with its "
        "nodes moved, or a .csv table node,dx,dy,dz or node,tx,ty,tz by the numbers of nodes.",
    )
    unit: UnitName | None = Field(
        default=None,
        description="Length unit of the numbers in pairs; needs the unit of the lattice. Default: "
        "that of the lattice.",
    )

    target: str | None = Field(
        default=None,
        description="In place of pairs: a scan onto which the model is bent. It is a mesh file, or "
        "points: a .ply file without faces, a table of x, y and z (.csv, .xyz), or an .npz file "
        "with the array points. It must lie where the model lies.",
    )
    reach: float | None = Field(
        default=None,
        gt=0,
        description="With a target: largest distance from the model, while it bends, at which a "
        "point of the scan counts. null: a tenth of the diagonal of the lattice box.",
    )


class FitOptions(StrictModel):
    """The keys of a fit besides its pairs."""

    tolerance: float | None = Field(
        default=None,
        gt=0,
        description="Distance from its target within which an image is to be. With `octree: "
        "{depth: auto}` cells are divided until all are, or the rest is noise. null: a "
        "ten-thousandth of the diagonal of the lattice box.",
    )
    smooth: Smooth = Field(
        default="auto",
        description="Weight of the bending energy: the mean squared second derivative over the "
        "box, times the fourth power of its diagonal, beside the mean squared residual. auto: by "
        "generalised cross-validation, so that exact data is met and noise is not.",
    )
    scale: float = Field(
        default=1.0,
        description="Factor of all displacements. -1 compensates: it deforms the other way.",
    )
    robust: bool = Field(
        default=True,
        description="true: pairs that disagree with all their neighbours are named, and count "
        "less or not at all.",
    )
    pin: Listed[Selector] = Field(
        default=(),
        description="Selectors (as in `at`) of control points that do not move.",
    )
    hold: Listed[Hold] = Field(
        default=(),
        description="Parts that do not move: {point: [x, y, z]}, {inside: {min, max}} or {group: "
        "name}, in model coordinates. A part cannot be held rigid by a fit.",
    )


# The order of the bases puts `pairs` first.
class Fit(FitOptions, FitPairs):
    """Move many points to targets by least squares, as smoothly as the data allows."""
