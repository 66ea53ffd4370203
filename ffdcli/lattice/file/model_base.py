"""What all models of the lattice file share: strictness, vectors, and how wrong keys are told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict, model_validator
from pydantic_core import PydanticCustomError

Axis = Literal["u", "v", "w"]


class StrictModel(BaseModel):
    """Strict: `true` is no number, unknown keys and non-finite numbers are refused."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, value: Any) -> Any:
        # Before all else, since a key missed is often the same word misspelt.
        if isinstance(value, dict):
            known = [info.alias or name for name, info in cls.model_fields.items()]
            for key in value:
                if key not in known:
                    raise unknown_key(key, known)
        return value


def unknown_key(key: str, known: list[str]) -> PydanticCustomError:
    """The error that `load.py` turns into a message with the nearest known key."""
    return PydanticCustomError("unknown_key", "unknown key", {"key": key, "known": known})


def three(what: str) -> Callable[[Any], Any]:
    """A check that a value is a list of three, for messages that say three of what."""

    def check(value: Any) -> Any:
        if not isinstance(value, (list, tuple)) or len(value) != 3:
            found = f", not {len(value)}" if isinstance(value, (list, tuple)) else ""
            raise PydanticCustomError("three", f"must be a list of three {what}{found}")
        return value

    return check


# A list in the file becomes a tuple here; strictness still holds for what is in it.
Vector = Annotated[tuple[float, float, float], Strict(False), BeforeValidator(three("numbers"))]
Fractions = Annotated[tuple[float, ...], Strict(False)]


class Corners(StrictModel):
    """A box by two opposite corners."""

    min: Vector = Field(description="Lowest x, y, z.")
    max: Vector = Field(description="Highest x, y, z.")
