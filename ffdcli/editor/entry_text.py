"""Entries of the list `edits:` as a person would write them in a lattice file."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from ffdcli.errors import LatticeError
from ffdcli.lattice.file.source import parse_yaml

# Text that needs no quotes, in a list or mapping on one line too, and is no number or keyword.
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./-]*")
_WORDS = {"null", "true", "false", "yes", "no", "on", "off", "y", "n"}
# Longest line of an entry, unless a single value is longer.
WIDTH = 100


def plain_values(value: Any) -> Any:
    """A copy of an edit in lists, mappings and numbers of Python; arrays become lists."""
    if isinstance(value, dict):
        return {str(key): plain_values(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (list, tuple)):
        return [plain_values(each) for each in value]
    return value


def one_line(value: Any) -> str:
    """A value as YAML on one line."""
    if isinstance(value, dict):
        inside = ", ".join(f"{_key(key)}: {one_line(each)}" for key, each in value.items())
        return f"{{{inside}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(one_line, value))}]"
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, str) and _PLAIN.fullmatch(value) and value.lower() not in _WORDS:
        return value
    return json.dumps(value, ensure_ascii=False)


def entry_text(edit: dict[str, Any]) -> str:
    """An edit on one line, such as ``move: {at: [3, 3, 5], by: [0, 0, 10]}``."""
    return one_line(edit)[1:-1]


def entry_lines(edit: dict[str, Any], indent: int) -> list[str]:
    """Lines of an entry of the list, each at least so far indented; long lists go line by line."""
    space = " " * indent
    line = f"{space}- {entry_text(edit)}"
    if len(line) <= WIDTH:
        return [line]
    first, *others = _lines(edit, indent + 2)
    return [f"{space}- {first.lstrip()}", *others]


def _lines(value: Any, indent: int) -> list[str]:
    """Lines of a mapping or list that is too long for one."""
    space, found = " " * indent, list[str]()
    if isinstance(value, dict):
        for key, each in value.items():
            line = f"{space}{_key(key)}: {one_line(each)}"
            if len(line) <= WIDTH or not _has_parts(each):
                found.append(line)
            else:
                found += [f"{space}{_key(key)}:", *_lines(each, indent + 2)]
        return found
    for each in value:
        line = f"{space}- {one_line(each)}"
        if len(line) <= WIDTH or not _has_parts(each):
            found.append(line)
        else:
            first, *others = _lines(each, indent + 2)
            found += [f"{space}- {first.lstrip()}", *others]
    return found


def _has_parts(value: Any) -> bool:
    """Whether a value is a list or mapping that is better written in several lines."""
    if isinstance(value, list):
        return any(isinstance(each, (list, dict)) for each in value)
    return isinstance(value, dict) and bool(value)


def _key(key: str) -> str:
    return one_line(key)


def _number(value: float) -> str:
    """The shortest text of the same double; whole numbers without a point."""
    if value == 0 or not value.is_integer() or abs(value) >= 1e16:
        return repr(value) if value or str(value).startswith("-") else "0"
    return str(int(value))


def entry_of_text(text: str) -> dict[str, Any]:
    """An edit from text of a lattice file.

    Raises
    ------
    LatticeError
        It is no edit.
    """
    value, source = parse_yaml(text, "this edit")
    if isinstance(value, list) and len(value) == 1:
        (value,) = value
    if not isinstance(value, dict) or len(value) != 1:
        hint = "write one edit, such as `move: {at: [3, 3, 5], by: [0, 0, 10]}`"
        raise LatticeError("this is no edit", file=source.name, hint=hint)
    return dict(plain_values(value))
