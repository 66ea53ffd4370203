"""Base of all models of the lattice file: strict validation, unknown keys, vectors, corners."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Strict,
    model_validator,
)
from pydantic_core import PydanticCustomError

Axis = Literal["u", "v", "w"]


class StrictModel(BaseModel):
    """A strict model: `true` is not a number; unknown keys and non-finite numbers are errors."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, value: Any) -> Any:
        # First, because a missing key is often a misspelt one.
        if isinstance(value, dict):
            known = _known_keys(cls)
            for key in value:
                if key not in known:
                    raise unknown_key(key, list(known))
        return value


@cache
def _known_keys(model: type[BaseModel]) -> tuple[str, ...]:
    return tuple(info.alias or name for name, info in model.model_fields.items())


def unknown_key(key: str, known: list[str]) -> PydanticCustomError:
    """Return the error that `load.py` turns into a message with the most similar known key."""
    return PydanticCustomError("unknown_key", "unknown key", {"key": key, "known": known})


def three(what: str) -> Callable[[Any], Any]:
    """Return a check that a value is a list of three; ``what`` names the items in its message."""

    def check(value: Any) -> Any:
        if not isinstance(value, (list, tuple)) or len(value) != 3:
            found = f", not {len(value)}" if isinstance(value, (list, tuple)) else ""
            raise PydanticCustomError("three", f"must be a list of three {what}{found}")
        return value

    return check


def by_type(error: str, message: str, **tags: str | Callable[[Any], str | None]) -> Discriminator:
    """Return the discriminator of a union by the type of the value.

    ``tags`` are those for `number` (whole), `fraction`, `text`, `list` and `mapping`, or functions
    that return the tag of a value, and of the keys of a mapping. Other values get the error.
    """

    def tag(value: Any) -> str | None:
        kind = ""
        if isinstance(value, str):
            kind = "text"
        elif isinstance(value, (list, tuple)):
            kind = "list"
        elif isinstance(value, (dict, BaseModel)):
            kind = "mapping"
            value = value if isinstance(value, dict) else type(value).model_fields
        elif isinstance(value, int) and not isinstance(value, bool):
            kind = "number"
        elif isinstance(value, float):
            kind = "fraction"
        found = tags.get(kind)
        return found(value) if callable(found) else found

    return Discriminator(tag, custom_error_type=error, custom_error_message=message)


# Lists of the file become tuples; their items are still validated strictly. The first wrong item
# ends the check: a million errors would take gigabytes.
_T = TypeVar("_T")
Listed = Annotated[tuple[_T, ...], Strict(False), Field(fail_fast=True)]
Three = Annotated[tuple[_T, _T, _T], Strict(False)]
Vector = Annotated[Three[float], BeforeValidator(three("numbers"))]


class Corners(StrictModel):
    """A box given by two opposite corners."""

    min: Vector = Field(description="Lowest x, y, z.")
    max: Vector = Field(description="Highest x, y, z.")
