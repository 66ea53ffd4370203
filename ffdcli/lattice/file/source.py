"""YAML 1.2 text as plain values, with the line of every key and list item."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from ffdcli.errors import FileError, LatticeError

KeyPath = tuple[str | int, ...]

_TAG = "tag:yaml.org,2002:"


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
        return replace(self, root=self.root + path)

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
        It is not YAML, has a key twice, or has a value with a tag.
    """
    name = str(path)
    try:
        raw = Path(path).read_bytes()
    except FileNotFoundError:
        raise FileError("there is no such file", file=name, hint="check the path") from None
    except OSError as error:
        reason = (error.strerror or "unreadable").lower()
        raise FileError(f"the lattice file cannot be read: {reason}", file=name) from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        hint = "save it as UTF-8; is this a lattice file?"
        raise LatticeError("this is not UTF-8 text", file=name, line=line, hint=hint) from None
    return parse_yaml(text, name, Path(path).parent)


def parse_yaml(text: str, name: str = "lattice", folder: Path = Path()) -> tuple[Any, Source]:
    """Values of YAML text and their lines; see :func:`read_yaml`."""
    try:
        root = YAML(typ="safe", pure=True).compose(text)
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
        line = text.count("\n", 0, error.position) + 1
        message = "this is not valid YAML: it contains a control character"
        raise LatticeError(message, file=name, line=line) from None
    except (YAMLError, RecursionError, ValueError) as error:
        raise LatticeError(f"this is not valid YAML: {error}", file=name) from None
    if root is None:
        hint = "start from `ffd new MESH`"
        raise LatticeError("the lattice file is empty", file=name, line=1, hint=hint)
    reader = _Reader(name, {(): root.start_mark.line + 1}, [])
    value = reader.value(root, ())
    return value, Source(name, folder, reader.lines)


@dataclass(frozen=True)
class _Reader:
    """Converts YAML nodes to plain values and records their lines."""

    name: str
    lines: dict[KeyPath, int]
    open_nodes: list[int]

    def error(self, node: Node, path: KeyPath, message: str, hint: str | None) -> LatticeError:
        line = node.start_mark.line + 1
        return LatticeError(
            message, file=self.name, line=line, key=key_text(path) or None, hint=hint
        )

    def value(self, node: Node, path: KeyPath) -> Any:
        if isinstance(node, ScalarNode):
            return self.scalar(node, path)
        if id(node) in self.open_nodes or len(path) > 20:
            hint = "write the values out"
            raise self.error(node, path, "this contains itself or is nested too deeply", hint)
        self.open_nodes.append(id(node))
        found: Any = None
        if isinstance(node, MappingNode):
            found = self.mapping(node, path)
        elif isinstance(node, SequenceNode):
            found = self.sequence(node, path)
        self.open_nodes.pop()
        return found

    def sequence(self, node: SequenceNode, path: KeyPath) -> list[Any]:
        items = []
        for index, item in enumerate(node.value):
            here = (*path, index)
            self.lines[here] = item.start_mark.line + 1
            items.append(self.value(item, here))
        return items

    def mapping(self, node: MappingNode, path: KeyPath) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, ScalarNode):
                raise self.error(key_node, path, "a key must be a plain word", None)
            key = str(key_node.value)
            here = (*path, key)
            line = key_node.start_mark.line + 1
            if key in found:
                message = f"the key is given twice, first on line {self.lines[here]}"
                raise self.error(key_node, here, message, "keep one of the two")
            self.lines[here] = line
            found[key] = self.value(value_node, here)
        return found

    def scalar(self, node: ScalarNode, path: KeyPath) -> Any:
        text = str(node.value)
        tag = str(node.tag)
        kind = tag.removeprefix(_TAG)
        try:
            if kind == "int":
                return _whole(text)
            if kind == "float":
                return _real(text)
        except ValueError:
            message = f"`{shortened(text)}` is not a number in YAML 1.2"
            raise self.error(node, path, message, "write it as in 12, 0.5 or 1e-3") from None
        if kind == "bool":
            return text.lower() == "true"
        if kind == "null":
            return None
        if kind in ("str", "timestamp", "merge", "value"):
            return text
        message = f"the YAML tag {tag} is not used in lattice files"
        raise self.error(node, path, message, "remove it")


def _whole(text: str) -> int:
    plain = text.replace("_", "")
    based = plain.lstrip("+-")[:2].lower() in ("0x", "0o", "0b")
    return int(plain, 0) if based else int(plain)


def _real(text: str) -> float:
    plain = text.replace("_", "").lower()
    special = {".inf": "inf", "+.inf": "inf", "-.inf": "-inf", ".nan": "nan"}
    return float(special.get(plain, plain))
