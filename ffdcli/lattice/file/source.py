"""YAML 1.2 text as plain values, with the line of every key and list item."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml
from yaml import events
from yaml.error import MarkedYAMLError, YAMLError
from yaml.reader import ReaderError

from ffdcli.errors import LatticeError
from ffdcli.fields.table import MAX_MAGNITUDE
from ffdcli.files import read_file

KeyPath = tuple[str | int, ...]

# Largest file, in bytes.
MAX_BYTES = 64 * 1024**2
# Largest number of values; the values behind an alias count each time it is used.
MAX_VALUES = 2_000_000
# Largest number of lists and mappings inside each other.
MAX_NESTING = 20

_TAG = "tag:yaml.org,2002:"
_LIST, _MAPPING = f"{_TAG}seq", f"{_TAG}map"
# Plain words that are no text in YAML 1.2, with underscores between digits as in 1.1.
_FORMS = {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?(?:0b[01][01_]*|0o[0-7][0-7_]*|0x[0-9a-fA-F][0-9a-fA-F_]*|[0-9][0-9_]*)",
    "float": r"[-+]?(?:[0-9][0-9_]*(?:\.[0-9_]*)?|\.[0-9][0-9_]*)(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
    "str": r"(?s:.*)",
}
_KINDS = {kind: re.compile(form) for kind, form in _FORMS.items()}
# The first of these forms that a plain word has.
_PLAIN = re.compile("|".join(f"(?P<{kind}>(?:{form})\\Z)" for kind, form in _FORMS.items()))
# Longest text of a number.
_MAX_DIGITS = 1000


@dataclass(frozen=True)
class Source:
    """The file and lines that values come from.

    Parameters
    ----------
    name : str
        File name for messages.
    folder : Path
        Folder that relative paths in the file start from.
    lines : mapping of key path to int
        1-based line of every key and list item.
    root : key path
        Key path of the part of the file that other key paths start from.
    """

    name: str = "lattice"
    folder: Path = Path()
    lines: Mapping[KeyPath, int] = field(default_factory=dict)
    root: KeyPath = ()

    def within(self, path: KeyPath) -> Source:
        """The source of a part of the file; key paths start from this part."""
        return Source(self.name, self.folder, self.lines, self.root + path)

    def line(self, path: KeyPath) -> int | None:
        """Line of a key path, or of the longest part of it that is in the file."""
        path = self.root + path
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path)

    def error(self, path: KeyPath, message: str, hint: str | None = None) -> LatticeError:
        """An error about the value at a key path."""
        return LatticeError(
            message, file=self.name, line=self.line(path), key=self.key(path), hint=hint
        )

    def key(self, path: KeyPath) -> str | None:
        """A key path as text such as ``edits[2].move.at``; None for the whole file."""
        return key_text(self.root + path) or None


def key_text(path: KeyPath) -> str:
    """A key path as text such as ``edits[2].move.at``."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".")


def shortened(text: str) -> str:
    """Text for quoting in a message, at most 40 characters."""
    return text if len(text) <= 40 else f"{text[:37]}..."


def read_yaml(path: str | Path) -> tuple[Any, Source]:
    """Values of a YAML file and their lines.

    Raises
    ------
    FileError
        The file is missing or cannot be read.
    LatticeError
        It is not YAML, has a key twice, has a value with a tag, or exceeds a limit.
    """
    name = str(path)
    raw = read_file(path, most=MAX_BYTES + 1)
    if len(raw) > MAX_BYTES:
        message = f"this file has more than {MAX_BYTES >> 20} MiB"
        raise LatticeError(message, file=name, hint="put long lists into .csv or .npy files")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        hint = "save it as UTF-8; is this a lattice file?"
        raise LatticeError("this is not UTF-8 text", file=name, line=line, hint=hint) from None
    return parse_yaml(text, name, Path(path).parent)


def parse_yaml(text: str, name: str = "lattice", folder: Path = Path()) -> tuple[Any, Source]:
    """Values of YAML text and their lines; see :func:`read_yaml`."""
    reader = _Reader(name, {})
    try:
        value = reader.document(yaml.parse(text, Loader=yaml.CSafeLoader))
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = " ".join(str(part) for part in (error.problem, error.context) if part)
        raise LatticeError(
            f"this is not valid YAML: {problem}",
            file=name,
            line=mark.line + 1 if mark else None,
            hint="look for a missing bracket, colon or indent on this line or the line before",
        ) from None
    except ReaderError as error:
        line = text.encode().count(b"\n", 0, error.position) + 1
        message = "this is not valid YAML: it contains a control character"
        raise LatticeError(message, file=name, line=line) from None
    except (YAMLError, UnicodeEncodeError) as error:
        detail = " ".join(str(error).split())
        raise LatticeError(f"this is not valid YAML: {detail}", file=name) from None
    return value, Source(name, folder, reader.lines)


@dataclass(frozen=True)
class _Anchored:
    """A value that aliases may repeat, the number of values in it, and how deep they are nested."""

    value: Any
    count: int
    height: int


class _Reader:
    """Converts YAML events to plain values and records their lines.

    A line is recorded where it differs from that of the list or mapping around it.
    """

    def __init__(self, name: str, lines: dict[KeyPath, int]) -> None:
        self.name = name
        self.lines = lines
        self.count = 0
        self.anchors: dict[str, _Anchored | None] = {}

    def error(
        self, event: events.Event, path: KeyPath, message: str, hint: str | None
    ) -> LatticeError:
        line = event.start_mark.line + 1
        key = key_text(path) or None
        return LatticeError(message, file=self.name, line=line, key=key, hint=hint)

    def document(self, stream: Iterator[events.Event]) -> Any:
        """The value of the only document of a stream of events."""
        value: Any = None
        for event in stream:
            if isinstance(event, events.DocumentStartEvent) and self.lines:
                message = "this is not valid YAML: a second document begins here"
                raise self.error(event, (), message, "keep one document, without lines `---`")
            if isinstance(event, events.NodeEvent):
                self.lines[()] = event.start_mark.line + 1
                value = self.value(event, stream, (), self.lines[()])[0]
        if not self.lines:
            hint = "start from `ffd new MESH`"
            raise LatticeError("the lattice file is empty", file=self.name, line=1, hint=hint)
        return value

    def value(
        self, event: events.NodeEvent, stream: Iterator[events.Event], path: KeyPath, line: int
    ) -> tuple[Any, int]:
        """The value that begins with an event on a known line, and how deep it is nested."""
        if isinstance(event, events.AliasEvent):
            return self.repeated(event, path)
        before = self.count
        self.counted(event, path, 1)
        if event.anchor is not None:
            self.anchors[event.anchor] = None
        found: Any
        if isinstance(event, events.ScalarEvent):
            found, height = self.scalar(event, path), 0
        else:
            self.require_height(event, path, 1)
            if event.tag not in (None, "!", _LIST, _MAPPING):
                raise self.unused_tag(event, path)
            mapping = isinstance(event, events.MappingStartEvent)
            found, height = (self.mapping if mapping else self.sequence)(stream, path, line)
        if event.anchor is not None:
            self.anchors[event.anchor] = _Anchored(found, self.count - before, height)
        return found, height

    def repeated(self, event: events.AliasEvent, path: KeyPath) -> tuple[Any, int]:
        """The value behind an alias, and how deep it is nested."""
        if event.anchor not in self.anchors:
            message = f"there is no anchor `&{shortened(event.anchor)}` before this alias"
            raise self.error(event, path, message, "write the values out")
        found = self.anchors[event.anchor]
        if found is None:
            raise self.error(event, path, "this contains itself", "write the values out")
        self.counted(event, path, found.count)
        self.require_height(event, path, found.height)
        return found.value, found.height

    def counted(self, event: events.NodeEvent, path: KeyPath, number: int) -> None:
        """Count values, before any list of them is walked."""
        self.count += number
        if self.count > MAX_VALUES:
            message = f"with what aliases repeat, this is more than {MAX_VALUES:,} values"
            hint = "put long lists into .csv or .npy files, and repeat less by aliases"
            raise self.error(event, path, message, hint)

    def require_height(self, event: events.NodeEvent, path: KeyPath, height: int) -> None:
        """Refuse values nested too deeply."""
        if len(path) + height > MAX_NESTING:
            message = f"lists and mappings are nested more than {MAX_NESTING} deep"
            raise self.error(event, path, message, "write them flatter")

    def sequence(
        self, stream: Iterator[events.Event], path: KeyPath, line: int
    ) -> tuple[list[Any], int]:
        """The items of a list up to its end, and how deep it is nested."""
        items: list[Any] = []
        height = 0
        for event in stream:
            if isinstance(event, events.SequenceEndEvent):
                break
            here, on = (*path, len(items)), event.start_mark.line + 1
            if on != line:
                self.lines[here] = on
            item, inside = self.value(event, stream, here, on)
            items.append(item)
            height = max(height, inside)
        return items, height + 1

    def mapping(
        self, stream: Iterator[events.Event], path: KeyPath, line: int
    ) -> tuple[dict[str, Any], int]:
        """The keys and values of a mapping up to its end, and how deep it is nested."""
        found: dict[str, Any] = {}
        height = 0
        for event in stream:
            if isinstance(event, events.MappingEndEvent):
                break
            if not isinstance(event, events.ScalarEvent):
                raise self.error(event, path, "a key must be a plain word", None)
            if event.tag not in (None, "!", f"{_TAG}str"):
                raise self.unused_tag(event, path)
            key, on = event.value, event.start_mark.line + 1
            here = (*path, key)
            if key in found:
                message = f"the key is given twice, first on line {self.lines.get(here, line)}"
                raise self.error(event, here, message, "keep one of the two")
            if on != line:
                self.lines[here] = on
            found[key], inside = self.value(next(stream), stream, here, on)
            height = max(height, inside)
        return found, height + 1

    def scalar(self, event: events.ScalarEvent, path: KeyPath) -> Any:
        """The value of a word, by its tag or by what it looks like."""
        text: str = event.value
        if event.tag is None:
            value: Any = _plain_value(text) if event.implicit[0] else text
        else:
            kind = "str" if event.tag == "!" else event.tag.removeprefix(_TAG)
            if kind not in _KINDS:
                raise self.unused_tag(event, path)
            if not _KINDS[kind].fullmatch(text):
                message = f"`{shortened(text)}` is not of the kind `!!{kind}` in YAML 1.2"
                raise self.error(event, path, message, "remove the tag")
            value = _value(text, kind)
        if type(value) in (int, float) and abs(value) > MAX_MAGNITUDE and "n" not in text.lower():
            message = f"`{shortened(text)}` is too large: numbers are finite, "
            message += f"and at most {MAX_MAGNITUDE:g}"
            raise self.error(event, path, message, None)
        return value

    def unused_tag(self, event: events.Event, path: KeyPath) -> LatticeError:
        """An error about a tag."""
        tag = shortened(event.tag.replace(_TAG, "!!"))
        return self.error(
            event, path, f"the YAML tag {tag} is not used in lattice files", "remove it"
        )


@lru_cache(maxsize=4096)
def _plain_value(text: str) -> Any:
    """The value of a word without quotes, by what it looks like."""
    found = _PLAIN.match(text)
    assert found is not None
    return _value(text, str(found.lastgroup))


def _value(text: str, kind: str) -> Any:
    """The value of text of a kind."""
    if kind == "str":
        return text
    if kind == "null":
        return None
    plain = text.replace("_", "").lower()
    if kind == "bool":
        return plain == "true"
    if len(text) > _MAX_DIGITS:
        return math.inf  # Python takes long for thousands of digits, or refuses them.
    if kind == "float":
        return float(plain.replace(".inf", "inf").replace(".nan", "nan"))
    based = plain.lstrip("+-")[:2] in ("0x", "0o", "0b")
    return int(plain, 0) if based else int(plain)
