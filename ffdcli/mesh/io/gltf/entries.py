"""JSON objects of a glTF file, with their places; every value that is taken is checked."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from ffdcli.arrays import Floats

# Most values in the JSON of a file, and most objects in a list of it: they take some hundred bytes
# of memory each, and time.
_MOST_VALUES = 5_000_000
_MOST_OBJECTS = 500_000
_LARGEST = 2**53
_SHOWN = 40


class Unreadable(ValueError):
    """A file is damaged or needs what is not known; ``hint`` says what to do."""

    def __init__(self, message: str, hint: str = "export the file again") -> None:
        super().__init__(message)
        self.hint = hint


@dataclass(frozen=True)
class Entry:
    """A JSON object, and its place in the file for messages: ``meshes[2].primitives[0]``."""

    values: Mapping[str, Any]
    place: str = ""

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def at(self, key: str) -> str:
        """Place of a value."""
        return f"{self.place}.{key}" if self.place else key

    def reject(self, key: str, wanted: str) -> NoReturn:
        """Raise Unreadable: a value is not what is wanted."""
        raise Unreadable(f"{self.at(key)} is {_shown(self.values.get(key))}, not {wanted}")

    def whole(self, key: str, default: int | None = None, *, most: int = _LARGEST) -> int:
        """A whole number from 0 to ``most``; without a default it must be there."""
        value = self.values.get(key, default)
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= most:
            self.reject(key, f"a whole number from 0 to {most}")
        return value

    def index(self, key: str, among: int) -> int | None:
        """Number of one of several entries; None if there is none."""
        if key not in self.values:
            return None
        number = self.whole(key)
        if number >= among:
            raise Unreadable(f"{self.at(key)} is {number}, but the file has only {among}")
        return number

    def indices(self, key: str, among: int) -> list[int]:
        """Numbers of several of several entries; empty if there are none."""
        listed = self._list(key)
        for place, value in enumerate(listed):
            if type(value) is not int or not 0 <= value < among:
                raise Unreadable(
                    f"{self.at(key)}[{place}] is {_shown(value)}, not one of {among} in the file"
                )
        return listed

    def text(self, key: str) -> str:
        """A text, empty if there is none; halves of surrogate pairs become U+FFFD."""
        value = self.values.get(key)
        if not isinstance(value, str):
            return ""
        return value.encode("utf-16", "surrogatepass").decode("utf-16", "replace")

    def numbers(self, key: str, count: int | None = None) -> Floats | None:
        """(n,) finite numbers; None if there are none."""
        if key not in self.values:
            return None
        listed = self._list(key)
        wanted = "numbers" if count is None else f"{count} numbers"
        if count is not None and len(listed) != count:
            self.reject(key, f"a list of {wanted}")
        if not all(type(value) in (int, float) and _finite(value) for value in listed):
            raise Unreadable(f"{self.at(key)} is not a list of {wanted} that are finite")
        return np.array([float(value) for value in listed])

    def entry(self, key: str) -> Entry:
        """An object, empty if there is none."""
        value = self.values.get(key, {})
        if not isinstance(value, dict):
            self.reject(key, "an object")
        return Entry(value, self.at(key))

    def entries(self, key: str) -> list[Entry]:
        """A list of objects, empty if there is none."""
        found, listed = [], self._list(key)
        if len(listed) > _MOST_OBJECTS:
            raise Unreadable(
                f"{self.at(key)} lists {len(listed)} objects, more than {_MOST_OBJECTS}"
            )
        for number, value in enumerate(listed):
            if not isinstance(value, dict):
                raise Unreadable(f"{self.at(key)}[{number}] is {_shown(value)}, not an object")
            found.append(Entry(value, f"{self.at(key)}[{number}]"))
        return found

    def texts(self, key: str) -> list[str]:
        """A list of texts, empty if there is none."""
        listed = self._list(key)
        if not all(isinstance(value, str) for value in listed):
            raise Unreadable(f"{self.at(key)} is not a list of texts")
        return listed

    def extension(self, *names: str) -> Entry | None:
        """What the first extension of these names says here; None if none does."""
        stated = self.entry("extensions")
        return next((stated.entry(name) for name in names if name in stated), None)

    def _list(self, key: str) -> list[Any]:
        value = self.values.get(key, [])
        if not isinstance(value, list):
            self.reject(key, "a list")
        return value


def parse_entry(text: bytes) -> Entry:
    """The JSON object that is a file's root.

    Raises
    ------
    Unreadable
        No JSON, too large, or nested too deeply.
    """
    count = sum(text.count(mark) for mark in (b",", b"[", b"{"))
    if count > _MOST_VALUES:
        raise Unreadable(f"its JSON holds {count} values, more than {_MOST_VALUES}")
    try:
        found = json.loads(text.decode("utf-8-sig"), parse_constant=_no_constant)
    except RecursionError:
        raise Unreadable("its JSON is nested too deeply") from None
    except UnicodeDecodeError:
        raise Unreadable("its JSON is not in UTF-8") from None
    except ValueError as error:
        raise Unreadable(f"its JSON is damaged: {error}") from error
    if not isinstance(found, dict):
        raise Unreadable(f"its JSON is {_shown(found)}, not an object")
    return Entry(found)


def _no_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number of JSON")


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond any float
        return False


def _shown(value: Any) -> str:
    """A value, short enough for a message."""
    if value is None:
        return "missing"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, int) and abs(value) >= 10**_SHOWN:
        return "a huge number"
    text = repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
