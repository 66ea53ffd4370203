"""The jobs file as a model: what may be written in it, and what each key means."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import (
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

from ffdcli.brep.occ.formats import IgesMode, Schema
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
        raise PydanticCustomError("empty", "must hold at least one")
    return value


def _listed(value: Any) -> Any:
    return _some(value) if isinstance(value, list) else [value]


def _values(value: Any) -> Any:
    """One value or a list of values; a value that is a list itself holds numbers."""
    return tuple(_value(item) for item in _listed(value))


def _value(item: Any) -> Value:
    if isinstance(item, list) and item and all(_is_number(part) for part in item):
        return tuple(item)
    if isinstance(item, str) and ("\n" in item or "\r" in item):
        raise PydanticCustomError("parameter", "must be text of one line")
    if isinstance(item, (bool, str)) or _is_number(item):
        return item
    raise PydanticCustomError(
        "parameter",
        "must be a finite number, text, true or false, a list of numbers, or a list of such values",
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _named(parameters: Any) -> Any:
    for name in parameters if isinstance(parameters, dict) else ():
        if not str(name).isidentifier():
            message = f"the parameter name `{name}` must be a word of letters, digits and _"
            raise PydanticCustomError("parameter", "{message}", {"message": message})
        if name in RESERVED:
            message = f"`{name}` stands for something else in output names"
            raise PydanticCustomError("parameter", "{message}", {"message": message})
    return parameters


# What output names can hold besides parameters.
RESERVED = ("mesh", "lattice", "folder", "scale", "number")

Names = Annotated[
    tuple[Annotated[str, Field(min_length=1)], ...],
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
    """How outputs are verified."""

    tolerance: float | None = Field(
        default=None,
        gt=0,
        description="Largest deviation allowed, in model units. Default: 1e-6 of the mesh's size, "
        "or what a reduced or fitted output states.",
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


class DeformOptions(StrictModel):
    """Options of `ffd deform`."""

    patches: Literal["merged", "bezier"] | None = Field(
        default=None,
        description="One surface per planar region (merged, the default), or one Bézier patch per "
        "plane and knot box.",
    )
    tolerance: float | None = Field(
        default=None,
        gt=0,
        description="Write fewer control points, certified to stay within this distance of the "
        "exact result (model units). Default: exact.",
    )
    max_degree: int | None = Field(
        default=None,
        ge=3,
        description="With `tolerance`: no degree is higher; knots are added where that needs it.",
    )
    fit_tolerance: float | None = Field(
        default=None,
        gt=0,
        description="For volumes that are fitted: how far surfaces may be from the deformed mesh "
        "(model units). Default: 1e-5 of the mesh's size.",
    )
    unit: UnitName | None = Field(
        default=None, description="Unit of the numbers. Default: the lattice's, the mesh's, or mm."
    )
    check: bool | None = Field(
        default=None, description="Check the result before it is written. Default: true."
    )
    target: TargetName | None = Field(
        default=None, description="The program that will read the output. Default: generic."
    )
    # The name `schema` is pydantic's own.
    step_schema: Schema | None = Field(
        default=None,
        alias="schema",
        description="STEP application protocol. Default: the target's, ap214.",
    )
    iges_mode: IgesMode | None = Field(
        default=None,
        description="IGES as solids (brep) or as trimmed surfaces (faces). Default: the target's.",
    )
    repair: bool | None = Field(
        default=None,
        description="Mend the mesh where that does not move its surface. Default: false.",
    )
    require_solid: bool | None = Field(
        default=None, description="Refuse a mesh that is open. Default: false."
    )
    require_injective: bool | None = Field(
        default=None,
        description="Refuse a lattice that folds the model over, or where the contrary cannot be "
        "proved. Default: false.",
    )


_VERIFY = "Re-read each output and compare it with the deformation: true, false or {tolerance: T}."
_OPTIONS = "Options of `ffd deform`."
_OUTPUT = (
    "Name of the output. {mesh} and {lattice} stand for the names of the files without folder and "
    "extension, {folder} for the mesh's folder, {scale} and each {parameter} for their values, "
    "{number} for the job's number; {number:04} pads it."
)


class Entry(StrictModel):
    """Jobs: every mesh with every lattice, every combination of parameters and every scale."""

    mesh: Names = Field(
        description="A mesh, or a list; names with * ? or ** stand for all files that match."
    )
    lattice: Names = Field(description="A lattice file, or a list, likewise.")
    output: str | None = Field(default=None, min_length=1, description=_OUTPUT)
    parameters: Parameters = Field(
        default={},
        description="Values for ${name} in the text of the lattice files; each one value or a "
        "list of them.",
    )
    scale: Shares = Field(
        default=(1.0,),
        description="How far the edits are applied, from 0 (at rest) to 1; one number or a list.",
    )
    verify: Verify | None = Field(default=None, description=_VERIFY)
    options: DeformOptions = Field(default=DeformOptions(), description=_OPTIONS)


def _whole_one(value: Any) -> Any:
    if type(value) is not int or value != 1:
        raise PydanticCustomError("version", "must be 1, the only version so far")
    return value


class BatchSpec(StrictModel):
    """A jobs file for ffd: what to deform by what, and where to write it."""

    model_config = ConfigDict(title="ffd jobs file")

    version: Annotated[Literal[1], BeforeValidator(_whole_one)] = Field(
        description="Version of this file format."
    )
    output: str | None = Field(
        default=None, min_length=1, description=f"For entries that say nothing else. {_OUTPUT}"
    )
    verify: Verify = Field(
        default=False, description=f"For entries that say nothing else. {_VERIFY}"
    )
    options: DeformOptions = Field(
        default=DeformOptions(),
        description=f"{_OPTIONS} Those of an entry come before these.",
    )
    jobs: Annotated[tuple[Entry, ...], Strict(False), BeforeValidator(_some)] = Field(
        description="Entries, each one job or a matrix of jobs. Paths count from this file."
    )


def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of the jobs file, for editors."""
    schema = BatchSpec.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
