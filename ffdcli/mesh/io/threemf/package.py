"""The package of a 3MF file: a zip archive of named parts and their relations.

Source: Open Packaging Conventions (ECMA-376, part 2). Sizes are checked before anything is
decompressed, and parts are decompressed piece by piece.
"""

from __future__ import annotations

import io
import posixpath
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote

from ffdcli.errors import FileError

# Most bytes of the XML of all parts that are read; some eight million triangles.
MOST_BYTES = 2**29
# XML is packed to a tenth or so. What is packed more than this, and is not small, is no model.
MOST_PACKED = 100
_SMALL = 2**26
_PIECE = 2**18
_MOST_RELATIONS = 10_000
_RELATIONS = "_rels/.rels"
_START = "/3dmodel"
# Where nearly all files have it, for those that do not say.
_USUAL = "3D/3dmodel.model"
_LONGEST_QUOTE = 100
# What zipfile raises on damaged archives.
_DAMAGED = (zipfile.BadZipFile, struct.error, NotImplementedError, OSError, ValueError)


@dataclass(frozen=True)
class Package:
    """An opened archive, with its parts by their names."""

    archive: zipfile.ZipFile
    entries: dict[str, list[zipfile.ZipInfo]]
    folded: dict[str, list[str]]
    size: int
    source: str

    def refuse(self, message: str, hint: str = "export the file again") -> NoReturn:
        """Raise a FileError on this file."""
        raise FileError(message, file=self.source, hint=hint)

    def find(self, name: str, folder: str = "") -> str | None:
        """The part with a name: counted from the root, else from a folder, else in other case."""
        plain = name.replace("\\", "/").strip()
        for start in ("", folder):
            for text in (plain, unquote(plain)):
                path = posixpath.normpath(posixpath.join("/", start, text.lstrip("/"))).lstrip("/")
                if path in self.entries:
                    return path
                alike = self.folded.get(path.lower(), ())
                if len(alike) == 1:
                    return alike[0]
        return None

    def check(self, part: str, beside: int = 0) -> int:
        """Bytes of a part and of those beside it.

        Raises
        ------
        FileError
            It is there twice, encrypted, packed in a way not known, or larger than a model can be.
        """
        first, *others = self.entries[part]
        if others:
            self.refuse(f"the file holds {1 + len(others)} parts of the name {quote(part)}")
        if first.flag_bits & 1:
            self.refuse(f"part {quote(part)} is encrypted", "export it without a password")
        if first.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            self.refuse(f"part {quote(part)} is packed by the unknown method {first.compress_type}")
        size = first.file_size + beside
        what = f"part {quote(part)} unpacks to {first.file_size} bytes"
        if beside:
            what += f", with the parts before it to {size}"
        if size > MOST_BYTES:
            self.refuse(f"{what}; at most {MOST_BYTES} are read", "export fewer triangles")
        packed = min(first.compress_size, self.size) if not beside else self.size
        if size > max(_SMALL, MOST_PACKED * packed):
            self.refuse(f"{what} from {packed}, which no mesh does")
        return size

    def pieces(self, part: str) -> Iterator[bytes]:
        """The content of a part, whose size has been checked.

        Raises
        ------
        FileError
            It is damaged.
        """
        try:
            # Reading ends at the size that was checked, whatever the packed data hold.
            with self.archive.open(self.entries[part][0]) as stream:
                while piece := stream.read(_PIECE):
                    yield piece
        except (*_DAMAGED, zlib.error, EOFError, RuntimeError) as error:
            self.unreadable(part, error)

    def unreadable(self, part: str, error: Exception) -> NoReturn:
        """Raise a FileError on a part that a library could not read."""
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        suffix = Path(self.source).suffix.lower()
        raise FileError(
            f"the file cannot be read as {suffix}: part {quote(part)}: {plain_text(reason)}",
            file=self.source,
            hint="export it again, or in another format such as .obj",
        ) from error


def quote(text: str) -> str:
    """A text of the file in quotes, without control characters, cut where it is long."""
    return repr(text if len(text) <= _LONGEST_QUOTE else text[:_LONGEST_QUOTE] + "...")


def plain_text(text: str) -> str:
    """A text without characters that do not print, cut where it is long."""
    return quote(text)[1:-1]


def open_package(data: bytes, source: str) -> Package:
    """The parts of a file.

    Raises
    ------
    FileError
        It is no zip archive.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except _DAMAGED as error:
        raise FileError(
            f"the file cannot be read as {Path(source).suffix.lower()}: it is no whole zip archive",
            file=source,
            hint="it may be cut short: export it again, or in another format such as .obj",
        ) from error
    entries: dict[str, list[zipfile.ZipInfo]] = {}
    for entry in archive.infolist():
        name = entry.filename.replace("\\", "/").lstrip("/")
        entries.setdefault(name, []).append(entry)
    folded: dict[str, list[str]] = {}
    for name in entries:
        folded.setdefault(name.lower(), []).append(name)
    return Package(archive, entries, folded, len(data), source)


def parse_part(package: Package, part: str, start: Callable[..., None], end: Any) -> None:
    """Stream the XML of a part through two functions: of start tags and of end tags.

    Parameters
    ----------
    start : callable
        Takes tag, attributes and namespaces by prefix; lxml looks for an argument ``*``.
    end : callable
        Takes the tag.

    Raises
    ------
    FileError
        The XML is damaged, too deep, or has a document type.
    """
    from lxml import etree

    class Target:
        """Receives the tags; a document type could define entities."""

        def __init__(self) -> None:
            self.start, self.end = start, end

        def doctype(self, *_: object) -> None:
            package.refuse(f"part {quote(part)} has a document type, which 3MF does not allow")

        def close(self) -> None:
            pass

    parser = etree.XMLParser(
        target=Target(), resolve_entities="internal", no_network=True, load_dtd=False
    )
    try:
        for piece in package.pieces(part):
            parser.feed(piece)
        parser.close()
    except etree.LxmlError as error:
        package.unreadable(part, error)


def find_root(package: Package) -> tuple[str, tuple[str, ...]]:
    """The part that holds the root model, and notes on how it was found.

    Raises
    ------
    FileError
        There is none, or there are several.
    """
    targets: list[str] = []
    seen = 0

    def start(tag: str, attributes: Any, *_: object) -> None:
        nonlocal seen
        seen += 1
        if seen > _MOST_RELATIONS:
            package.refuse(f"part {quote(_RELATIONS)} has more than {_MOST_RELATIONS} elements")
        if tag.rpartition("}")[2] != "Relationship":
            return
        if attributes.get("Type", "").strip().endswith(_START):
            if attributes.get("TargetMode", "") == "External":
                package.refuse("its model lies outside of the file", "export it as one file")
            targets.append(attributes.get("Target", ""))

    relations = package.find(_RELATIONS)
    if relations is not None:
        package.check(relations)
        parse_part(package, relations, start, lambda tag: None)
    known = dict.fromkeys(targets)
    if len(known) > 1:
        package.refuse(f"the file names {len(known)} root models, where one is allowed")
    for target in known:
        part = package.find(target)
        if part is None:
            package.refuse(f"the root model {quote(target)} is not in the file")
        return part, ()
    part = package.find(_USUAL)
    if part is None:
        package.refuse("the file does not say which of its parts is the model")
    return part, (f"the file does not say which part is its model: {part} was read",)
