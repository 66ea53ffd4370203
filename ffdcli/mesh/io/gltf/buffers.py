"""Bytes of a glTF file: in its binary part, in its URIs, or in files beside it."""

from __future__ import annotations

import base64
import binascii
import re
import stat
from pathlib import Path, PurePosixPath, PureWindowsPath
from urllib.parse import unquote, unquote_to_bytes

from ffdcli.mesh.io.gltf.entries import Entry, Unreadable

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")
_BLANKS = re.compile(rb"\s+")


def load_buffer(entry: Entry, binary: memoryview | None, path: Path) -> memoryview:
    """The bytes of an entry of ``buffers``, as many as it promises or more.

    Parameters
    ----------
    binary : memoryview or None
        Binary part of the file.
    path : Path
        The file. Other files are read only from its folder.

    Raises
    ------
    Unreadable
        They are not there, too few, or somewhere else.
    """
    promised = entry.whole("byteLength")
    if "uri" in entry:
        uri = entry.values["uri"]
        if not isinstance(uri, str):
            entry.reject("uri", "a text")
        stored = _decode_data(entry, uri) if uri[:5].lower() == "data:" else _beside(entry, path)
        found = memoryview(stored)
    elif binary is not None:
        found = binary
    else:
        raise Unreadable(f"{entry.place} has no data: neither a URI nor a binary part")
    if len(found) < promised:
        raise Unreadable(f"{entry.place} promises {promised} bytes, but has only {len(found)}")
    return found


def _decode_data(entry: Entry, uri: str) -> bytes:
    """The bytes that a data URI holds (RFC 2397)."""
    kind, comma, content = uri[5:].partition(",")
    if not comma:
        raise Unreadable(f"{entry.at('uri')} is no data URI: it has no comma")
    stored = unquote_to_bytes(content)
    if not kind.lower().endswith(";base64"):
        return stored
    try:
        return base64.b64decode(_BLANKS.sub(b"", stored), validate=True)
    except binascii.Error as error:
        raise Unreadable(f"{entry.at('uri')} is no base64: {error}") from error


def _beside(entry: Entry, path: Path) -> bytes:
    """The content of a file in the folder of the glTF file, or below it."""
    uri = entry.text("uri")
    name, place = unquote(uri), entry.at("uri")
    if _SCHEME.match(uri):
        raise Unreadable(
            f"{place} is {uri[:40]!r}: nothing is fetched from elsewhere",
            "put the data beside the file and name it there",
        )
    pure = (PurePosixPath(name), PureWindowsPath(name))
    if "\0" in name or any(p.anchor or p.is_absolute() or ".." in p.parts for p in pure):
        raise Unreadable(
            f"{place} names {name[:40]!r}, which is not in the folder of the file",
            "put the data beside the file and name it there",
        )
    other = path.parent / name
    try:
        real, homes = other.resolve(), {path.parent.resolve(), path.resolve().parent}
        if not any(real.is_relative_to(home) for home in homes):
            raise Unreadable(f"{place} names {name[:40]!r}, a link out of the folder of the file")
        if not stat.S_ISREG(real.stat().st_mode):
            raise Unreadable(f"{place} names {name[:40]!r}, which is not a regular file")
        return real.read_bytes()
    except (OSError, RuntimeError) as error:  # a loop of links
        what = (getattr(error, "strerror", None) or str(error)).lower()
        raise Unreadable(
            f"{place} names {name[:40]!r}, which cannot be read: {what}",
            "put it beside the file",
        ) from error
