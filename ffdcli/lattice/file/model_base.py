"""Base of all models of the lattice file: strict validation, unknown keys, vectors, corners."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict, model_validator
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
            known = [info.alias or name for name, info in cls.model_fields.items()]
            for key in value:
                if key not in known:
                    raise unknown_key(key, known)
        return value


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


# Lists of the file become tuples; their items are still validated strictly.
Vector = Annotated[tuple[float, float, float], Strict(False), BeforeValidator(three("numbers"))]
Fractions = Annotated[tuple[float, ...], Strict(False)]


class Corners(StrictModel):
    """A box given by two opposite corners."""

    min: Vector = Field(description="Lowest x, y, z.")
    max: Vector = Field(description="Highest x, y, z.")
