"""Models of the jobs file: its keys, their types and their descriptions."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Strict,
    Tag,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError

from ffdcli import option_texts as texts
from ffdcli.brep.occ.formats import Checks, IgesMode, Schema, Writer
from ffdcli.brep.occ.targets import TargetName
from ffdcli.lattice.file.model_base import StrictModel
from ffdcli.units import UnitName

Value = bool | int | float | str | tuple[int | float, ...]

_SCALAR = {"type": ["string", "number", "boolean"]}
_NUMBERS = {"type": "array", "items": {"type": "number"}}


def _one_or_many(kind: dict[str, Any]) -> WithJsonSchema:
    return WithJsonSchema({"anyOf": [kind, {"type": "array", "items": kind, "minItems": 1}]})


def _some(value: Any) -> Any:
    if isinstance(value, list) and not value:
        raise PydanticCustomError("empty", "must have at least one entry")
    return value


def _listed(value: Any) -> Any:
    return _some(value) if isinstance(value, list) else [value]


def _values(value: Any) -> Any:
    """One value or a list of values, as a tuple; a value that is itself a list holds numbers."""
    return tuple(_value(item) for item in _listed(value))


def _value(item: Any) -> Value:
    if isinstance(item, list) and item and all(_is_number(part) for part in item):
        return tuple(item)
    if isinstance(item, str) and ("\n" in item or "\r" in item):
        raise PydanticCustomError("parameter", "must be a string of one line")
    if isinstance(item, (bool, str)) or _is_number(item):
        return item
    raise PydanticCustomError(
        "parameter",
        "must be a finite number, a string, true, false, a list of numbers, or a list of these",
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _named(parameters: Any) -> Any:
    for name in parameters if isinstance(parameters, dict) else ():
        if not str(name).isidentifier():
            message = f"the parameter name `{name}` may consist of letters, digits and _ only"
            raise PydanticCustomError("parameter", "{message}", {"message": message})
        if name in RESERVED:
            message = f"the name `{name}` is reserved in output names"
            raise PydanticCustomError("parameter", "{message}", {"message": message})
    return parameters


# Fields of output names besides the parameters.
RESERVED = ("mesh", "lattice", "folder", "scale", "number")


def _file_name(name: str) -> str:
    if "\0" in name:
        raise PydanticCustomError("file_name", "must not hold the character NUL")
    return name


FileName = Annotated[str, Field(min_length=1), AfterValidator(_file_name)]
Names = Annotated[
    tuple[FileName, ...],
    Strict(False),
    BeforeValidator(_listed),
    _one_or_many({"type": "string"}),
]
Shares = Annotated[
    tuple[float, ...], Strict(False), BeforeValidator(_listed), _one_or_many({"type": "number"})
]
Values = Annotated[
    tuple[Any, ...], BeforeValidator(_values), _one_or_many({"anyOf": [_SCALAR, _NUMBERS]})
]
Parameters = Annotated[dict[str, Values], BeforeValidator(_named)]


class VerifyOptions(StrictModel):
    """Options of the verification of outputs."""

    tolerance: float | None = Field(
        default=None,
        gt=0,
        description="Largest deviation allowed, in model units. Default: 1e-6 of the mesh size; "
        "for reduced or fitted outputs, the bound in their report.",
    )


def _kind_of_verify(value: Any) -> str | None:
    if isinstance(value, bool):
        return "verify-or-not"
    return "verify-options" if isinstance(value, (dict, BaseModel)) else None


Verify = Annotated[
    Annotated[bool, Tag("verify-or-not")] | Annotated[VerifyOptions, Tag("verify-options")],
    Discriminator(
        _kind_of_verify,
        custom_error_type="verify",
        custom_error_message="must be true, false or {tolerance: T}",
    ),
]


_FALSE = "Default: false."


class CoplanarOptions(StrictModel):
    """When polygons count as coplanar."""

    distance: float | None = Field(default=None, gt=0, description=texts.COPLANAR_DISTANCE)
    angle: float = Field(gt=0, le=30, description=texts.COPLANAR_ANGLE)


class DeformOptions(StrictModel):
    """Options of `ffd deform`."""

    patches: Literal["merged", "bezier", "paper"] | None = Field(
        default=None, description=texts.PATCHES
    )
    coplanar: CoplanarOptions | None = Field(
        default=None, description="{distance: T, angle: A}: when polygons count as coplanar."
    )
    tolerance: float | None = Field(default=None, gt=0, description=texts.TOLERANCE)
    max_degree: int | None = Field(default=None, ge=3, description=texts.MAX_DEGREE)
    fit_tolerance: float | None = Field(default=None, gt=0, description=texts.FIT_TOLERANCE)
    unit: UnitName | None = Field(default=None, description=texts.UNIT)
    check: bool | Checks | None = Field(default=None, description=texts.CHECK)
    target: TargetName | None = Field(default=None, description=texts.TARGET)
    # Pydantic uses the name `schema` itself.
    step_schema: Schema | None = Field(default=None, alias="schema", description=texts.SCHEMA)
    iges_mode: IgesMode | None = Field(default=None, description=texts.IGES_MODE)
    writer: Writer | None = Field(default=None, description=texts.WRITER)
    repair: bool | None = Field(default=None, description=f"{texts.REPAIR} {_FALSE}")
    require_solid: bool | None = Field(default=None, description=f"{texts.REQUIRE_SOLID} {_FALSE}")
    require_injective: bool | None = Field(
        default=None, description=f"{texts.REQUIRE_INJECTIVE} {_FALSE}"
    )


_VERIFY = (
    "Read each output again and compare it with the deformation: true, false or {tolerance: T}. "
    "By default the largest deviation allowed is what the output's report states."
)
_OPTIONS = "Options of `ffd deform`."
_OUTPUT = (
    "Name of the output file. Fields are replaced: {mesh} and {lattice} by the file names without "
    "folder and extension, {folder} by the folder of the mesh, {scale} and each {parameter} by "
    "their values, {number} by the number of the job ({number:04} pads it with zeros)."
)


class Entry(StrictModel):
    """Jobs: each mesh with each lattice, each combination of parameters, and each scale."""

    mesh: Names = Field(
        description="A mesh file, or a list of them. Names with *, ? or ** match several files."
    )
    lattice: Names = Field(description="A lattice file, or a list of them, likewise.")
    output: FileName | None = Field(default=None, description=_OUTPUT)
    parameters: Parameters = Field(
        default={},
        description="Values of ${name} in the text of the lattice files; each is one value or a "
        "list of values.",
    )
    scale: Shares = Field(
        default=(1.0,),
        description="Share of the edits that is applied, from 0 (none) to 1; one number or a list.",
    )
    verify: Verify | None = Field(default=None, description=_VERIFY)
    options: DeformOptions = Field(default=DeformOptions(), description=_OPTIONS)


def _whole_one(value: Any) -> Any:
    if type(value) is not int or value != 1:
        raise PydanticCustomError("version", "must be 1")
    return value


class BatchSpec(StrictModel):
    """A jobs file of `ffd batch`: meshes, lattices, options and output names."""

    model_config = ConfigDict(title="ffd jobs file")

    version: Annotated[Literal[1], BeforeValidator(_whole_one)] = Field(
        description="Version of this file format."
    )
    output: FileName | None = Field(default=None, description=f"Default for all entries. {_OUTPUT}")
    verify: Verify = Field(default=False, description=f"Default for all entries. {_VERIFY}")
    options: DeformOptions = Field(
        default=DeformOptions(),
        description=f"{_OPTIONS} Default for all entries.",
    )
    jobs: Annotated[tuple[Entry, ...], Strict(False), BeforeValidator(_some)] = Field(
        fail_fast=True,
        description="Entries, each for one or more jobs. Paths are relative to this file.",
    )


def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of the jobs file, for editors."""
    schema = BatchSpec.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
