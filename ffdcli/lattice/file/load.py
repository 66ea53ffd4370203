"""Plain values checked and made into models; errors name file, line and key."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from ffdcli.errors import LatticeError
from ffdcli.lattice.file.check_spec import check_spec
from ffdcli.lattice.file.source import KeyPath, Source, shortened
from ffdcli.lattice.file.spec import OUTER, LatticeSpec, LatticesSpec

_PLAIN = {
    "float_type": "must be a number, not {given}",
    "int_type": "must be a whole number, not {given}",
    "int_from_float": "must be a whole number, not {given}",
    "string_type": "must be text, not {given}",
    "finite_number": "must be a finite number, not {given}",
    "literal_error": "must be {expected}, not {given}",
    "greater_than": "must be greater than {gt:g}, not {given}",
    "greater_than_equal": "must be at least {ge:g}, not {given}",
    "too_short": "needs at least {min_length} entries, not {actual_length}",
    "too_long": "has {actual_length:,} entries; {max_length:,} are allowed",
    "model_type": "must be a mapping of keys, not {given}",
    "model_attributes_type": "must be a mapping of keys, not {given}",
    "dict_type": "must be a mapping of keys, not {given}",
    "tuple_type": "must be a list, not {given}",
}


def parse_spec(data: Any, source: Source | None = None) -> LatticeSpec:
    """Check plain values, as from YAML or JSON, and make a model of them.

    Raises
    ------
    LatticeError
        The first problem in the order of the file.
    """
    source = source or Source()
    if not isinstance(data, dict):
        message = f"a lattice file has keys such as `version: 1`, not {_given(data)}"
        raise source.error((), message, "start from `ffd new MESH`")
    try:
        spec = LatticeSpec.model_validate(data)
    except ValidationError as error:
        raise first_error(error.errors(include_url=False), data, source) from None
    check_spec(spec, source)
    return spec


def parse_parts(data: dict[str, Any], source: Source) -> tuple[LatticeSpec, ...]:
    """Check the plain values of a file with the key `lattices`, and make a model of each entry.

    Raises
    ------
    LatticeError
        The first problem of the outer keys, or else of the entries.
    """
    for key in data:
        if key in LatticeSpec.model_fields and key not in OUTER:
            message = f"`{key}` cannot stand beside `lattices`"
            raise source.error((key,), message, "move it into each entry of `lattices`")
    try:
        whole = LatticesSpec.model_validate(data)
    except ValidationError as error:
        raise first_error(error.errors(include_url=False), data, source) from None
    outer = {"version": whole.version, "unit": whole.unit}
    parts = []
    for number, part in enumerate(whole.lattices):
        here: KeyPath = ("lattices", number)
        for key in OUTER:
            if key in part:
                message = f"`{key}` applies to the whole file"
                raise source.error((*here, key), message, "move it out of the list")
        parts.append(parse_spec({**part, **outer}, source.within(here)))
    return tuple(parts)


def first_error(errors: Iterable[ErrorDetails], data: Any, source: Source) -> LatticeError:
    """The validation error that comes first in the file, as a LatticeError."""
    found = [(_path(error, data), error) for error in errors]
    path, error = min(found, key=lambda item: source.line(item[0]) or 0)
    message, hint = _message(path, error)
    return source.error(path, message, hint)


def _path(error: ErrorDetails, data: Any) -> KeyPath:
    """Key path of an error: the location from pydantic without the tags of union members."""
    path: list[str | int] = []
    value = data
    for part in error["loc"]:
        if isinstance(part, int):
            known = isinstance(value, (list, tuple)) and part < len(value)
        else:
            known = isinstance(value, dict) and part in value
        if known:
            path.append(part)
            value = value[part]
    if error["type"] == "unknown_key":
        path.append(error["ctx"]["key"])
    if error["type"] == "missing":
        path.append(error["loc"][-1])
    return tuple(path)


def _message(path: KeyPath, error: ErrorDetails) -> tuple[str, str | None]:
    """Message and hint of a validation error."""
    kind = error["type"]
    if kind == "unknown_key":
        return _unknown(str(path[-1]), error["ctx"]["known"])
    if kind == "missing":
        return "this key is missing", f"add `{path[-1]}`"
    if kind not in _PLAIN:
        return error["msg"], None
    context = dict(error.get("ctx", {}))
    if "expected" in context:
        context["expected"] = str(context["expected"]).replace("'", "")
    message = _PLAIN[kind].format(**context, given=_given(error["input"]))
    return message, _hint(kind, error["input"])


def _hint(kind: str, value: Any) -> str | None:
    if kind in ("float_type", "int_type") and isinstance(value, str):
        return "remove the quotes, or write the number in full"
    if (
        kind in ("int_type", "float_type")
        and isinstance(value, int)
        and not isinstance(value, bool)
    ):
        return "the number is too large"
    return None


def _unknown(key: str, known: list[str]) -> tuple[str, str]:
    close = difflib.get_close_matches(key, known, n=1, cutoff=0.7)
    if close:
        return f"`{shortened(key)}` is not a key here", f"did you mean `{close[0]}`?"
    return f"`{shortened(key)}` is not a key here", f"keys here: {', '.join(known)}"


def _given(value: Any) -> str:
    """A value as it is written in the file, for a message."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return "a list"
    if isinstance(value, dict):
        return "a mapping"
    return f"`{shortened(str(value))}`"
