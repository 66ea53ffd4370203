"""Text of a lattice file in which nothing but the entries of its lists `edits:` changes.

Where each entry stands is read off the events of the YAML parser. Entries that stay, and all
comments, keys and blank lines round them, keep their bytes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

from ffdcli.editor.entry_text import entry_lines, entry_text, plain_values
from ffdcli.editor.marks import Node, Text, read_marks
from ffdcli.errors import LatticeError
from ffdcli.files import read_file
from ffdcli.lattice.file.source import MAX_BYTES, Source, parse_yaml

# Entries of the list `edits:` of each lattice of a file.
Edits = tuple[tuple[dict[str, Any], ...], ...]


@dataclass(frozen=True, eq=False)
class Document:
    """A lattice file as it was read.

    Parameters
    ----------
    path : Path
    text : str
        Without a byte order mark.
    marked : bool
        Whether the file begins with a byte order mark.
    values : mapping
        Its plain values.
    digest : str or None
        SHA-256 of the file's bytes; None where there is no file yet.
    """

    path: Path
    text: str
    marked: bool
    values: dict[str, Any]
    digest: str | None

    @property
    def listed(self) -> bool:
        """Whether the file has the key `lattices`, a list."""
        return "lattices" in self.values

    @property
    def edits(self) -> Edits:
        """The entries of each lattice."""
        parts = self.values["lattices"] if self.listed else [self.values]
        return tuple(tuple(part.get("edits") or ()) for part in parts)

    @property
    def source(self) -> Source:
        """Name and folder for messages; edits made by hand have no line yet."""
        return Source(str(self.path), self.path.parent)

    def lattice_values(self, number: int) -> dict[str, Any]:
        """The keys of one lattice with those that stand outside a list."""
        if not self.listed:
            return self.values
        outer = {key: value for key, value in self.values.items() if key != "lattices"}
        return {**self.values["lattices"][number], **outer}

    def with_entries(self, edits: Edits) -> dict[str, Any]:
        """The plain values of the file with other entries."""
        return _with_entries(self.values, edits)

    def with_edits(self, edits: Edits) -> Document:
        """The document with other entries; its file is still the old one.

        Raises
        ------
        LatticeError
            An anchor in an entry that goes is used elsewhere in the file.
        """
        wanted = _with_entries(self.values, edits)
        for rewritten in (False, True):
            text = _spliced(self.text, self.edits, edits, aliases=rewritten)
            if _reads_as(text, wanted):
                return replace(self, text=text, values=wanted)
        message = "an entry that changes holds an anchor (`&`) that is used elsewhere in the file"
        raise LatticeError(message, file=str(self.path), hint="write its values out there")

    @property
    def content(self) -> bytes:
        """The bytes of the file."""
        return (b"\xef\xbb\xbf" if self.marked else b"") + self.text.encode()


def digest_of(path: Path) -> str | None:
    """SHA-256 of a file's bytes; None where there is none."""
    if not path.exists():
        return None
    return hashlib.sha256(read_file(path)).hexdigest()


def read_document(path: Path) -> Document:
    """Read a lattice file; what it says is checked where it is settled.

    Raises
    ------
    FileError, LatticeError
    """
    raw = read_file(path, most=MAX_BYTES + 1)
    if len(raw) > MAX_BYTES:
        message = f"this file has more than {MAX_BYTES >> 20} MiB"
        raise LatticeError(message, file=str(path), hint="put long lists into .csv or .npy files")
    return _document(path, raw, hashlib.sha256(raw).hexdigest())


def new_document(path: Path, text: str) -> Document:
    """A document that is no file yet."""
    return _document(path, text.encode(), None)


def _document(path: Path, raw: bytes, digest: str | None) -> Document:
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        hint = "save it as UTF-8; is this a lattice file?"
        raise LatticeError("this is not UTF-8 text", file=str(path), line=line, hint=hint) from None
    values, source = parse_yaml(text, str(path), path.parent)
    from ffdcli.lattice import parse_lattice

    # The whole file is checked before any part of it is used; messages name its lines.
    parse_lattice(values, source)
    return Document(path, text, raw.startswith(b"\xef\xbb\xbf"), plain_values(values), digest)


def _with_entries(values: dict[str, Any], edits: Edits) -> dict[str, Any]:
    """Plain values of a file with other entries."""
    if "lattices" not in values:
        return {**values, "edits": list(edits[0])}
    parts = zip(values["lattices"], edits, strict=True)
    return {**values, "lattices": [{**part, "edits": list(mine)} for part, mine in parts]}


def _reads_as(text: str, wanted: dict[str, Any]) -> bool:
    try:
        found = parse_yaml(text)[0]
    except LatticeError:
        return False
    if not isinstance(found, dict):
        return False
    parts = found.get("lattices", [found])
    lists = tuple(tuple(part.get("edits") or ()) for part in parts)
    return bool(_with_entries(found, lists) == wanted)


def _spliced(text: str, old: Edits, new: Edits, *, aliases: bool) -> str:
    """The text with other entries; with ``aliases``, entries that hold any are written out."""
    source = Text(text)
    root = read_marks(text)
    parts = root.get("lattices")
    nodes = [root] if parts is None else parts.items
    changes: list[tuple[int, int, str]] = []
    for node, before, after in zip(nodes, old, new, strict=True):
        changes += _changes(source, node, before, after, aliases=aliases)
    for start, end, put in sorted(changes, reverse=True):
        text = text[:start] + put + text[end:]
    return text


def _changes(
    text: Text,
    lattice: Node,
    old: Sequence[dict[str, Any]],
    new: Sequence[dict[str, Any]],
    *,
    aliases: bool,
) -> Iterator[tuple[int, int, str]]:
    """Parts of the text of one lattice to replace: start, end and the new text."""
    value = lattice.get("edits")
    dirty = (
        [aliases and value is not None and each.aliased for each in value.items] if value else []
    )
    if _keys(old) == _keys(new) and not any(dirty):
        return
    if lattice.flow:
        # As JSON, which a file in brackets often is.
        whole = json.dumps(list(new), ensure_ascii=False)
        if value is not None:
            yield value.start, value.end, whole
        else:
            yield lattice.end - 1, lattice.end - 1, f', "edits": {whole}'
    elif value is None:
        column = text.column(lattice.start)
        end = text.over_comments(text.line_end(lattice.end), column)
        lines = [" " * column + "edits:", *_block(new, column + 2)]
        yield end, end, text.after(end, lines)
    elif value.kind != "list" or value.flow or not value.items:
        column = text.column(lattice.keys["edits"].start)
        said = [" " * (column + 2) + each for each in text.comments(value)]
        end = text.line_end(value.end)
        start = text.back_over_spaces(value.start)
        if value.end > value.start:
            yield start, value.end, ""
        yield end, end, text.after(end, [*said, *_block(new, column + 2)])
    else:
        yield from _items(text, value, old, new, dirty)


def _items(
    text: Text,
    value: Node,
    old: Sequence[dict[str, Any]],
    new: Sequence[dict[str, Any]],
    dirty: Sequence[bool],
) -> Iterator[tuple[int, int, str]]:
    """Changes of a list with an entry on each line."""
    dashes = text.dashes(value)
    column = text.column(dashes[0])
    starts = [text.line_start(dash) for dash in dashes]
    # Comments below an entry that are indented further than its dash belong to it.
    ends = [text.over_comments(text.line_end(item.end), column) for item in value.items]
    before = [f"{key}{number if bad else ''}" for number, (key, bad) in enumerate(
        zip(_keys(old), dirty, strict=True))]  # fmt: skip
    match = SequenceMatcher(None, before, _keys(new), autojunk=False)
    for kind, i, k, j, m in match.get_opcodes():
        if kind == "equal":
            continue
        lines = _block(new[j:m], column)
        if kind == "insert":
            at = ends[i - 1] if i else starts[0]
            yield at, at, text.after(at, lines)
            continue
        # What stands between the entries that go is no part of them.
        for number in range(i, k):
            put = text.after(starts[number], lines) if number == i and lines else ""
            yield starts[number], ends[number], put


def _block(edits: Sequence[dict[str, Any]], column: int) -> list[str]:
    return [line for edit in edits for line in entry_lines(edit, column)]


def _keys(edits: Sequence[dict[str, Any]]) -> list[str]:
    # 3 and 3.0 are the same number.
    return [entry_text(each) for each in edits]
