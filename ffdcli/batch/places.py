"""Places of inputs and outputs: local paths, or URLs that fsspec opens.

A place is a string: a path relative to the folder of the jobs file, or a URL such as
``s3://...``.
"""

from __future__ import annotations

import functools
import glob
import hashlib
import os
import posixpath
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from ffdcli.errors import BatchError, FfdError, FileError
from ffdcli.files import fault_of

# A download that exceeds either is refused.
MOST_BYTES, MOST_SECONDS = 4 << 30, 600
# A server that is silent for longer is given up, seconds.
SILENCE = 30
_BLOCK = 1 << 20
_WILD = frozenset("*?[")


def is_url(place: str) -> bool:
    """Whether a place is a URL; ``file://`` counts as a path."""
    return "://" in place and not place.startswith("file://")


def absolute(folder: str, place: str) -> str:
    """The place as an absolute path or a URL."""
    if is_url(place):
        return place
    if place.startswith("file://"):
        place = unquote(urlsplit(place).path)
    return os.path.abspath(os.path.join(folder, place))


def identity(folder: str, place: str) -> str:
    """A text that is the same for all places of a file: through links, or in another case.

    Case counts unless the file system ignores it.
    """
    path = absolute(folder, place)
    if is_url(path):
        return path
    if os.path.islink(path):
        path = os.path.realpath(path)
    parent, ignores_case = _real_folder(os.path.dirname(path))
    path = os.path.join(parent, os.path.basename(path))
    return path.casefold() if ignores_case else path


@functools.cache
def _real_folder(folder: str) -> tuple[str, bool]:
    """The path of a folder without links, and whether its file system ignores case."""
    real = os.path.realpath(folder)
    there = real
    while not os.path.exists(there):
        there = os.path.dirname(there)
    try:
        return real, os.path.samefile(there, there.swapcase()) and there != there.swapcase()
    except OSError:
        return real, False


def beside(place: str, name: str) -> str:
    """The place of a file whose name stands in another file, relative to that file."""
    return name if is_url(name) else posixpath.join(posixpath.dirname(place), name)


def stem(place: str) -> str:
    """File name without folder and extension."""
    return posixpath.splitext(posixpath.basename(place))[0]


def has_wildcard(place: str) -> bool:
    """Whether a place contains a wildcard."""
    return bool(_WILD & set(place))


def exists(folder: str, place: str) -> bool:
    """Whether a place, taken literally, exists on this machine."""
    return not is_url(place) and os.path.lexists(absolute(folder, place))


def matching(folder: str, place: str) -> list[str]:
    """Files that match a place with wildcards, sorted."""
    if is_url(place):
        with _remote(place) as (system, path):
            found = [system.unstrip_protocol(item) for item in system.glob(path)]
        return sorted(found)
    if place.startswith("file://"):
        place = absolute(folder, place)
    names = glob.glob(place, root_dir=folder, recursive=True)
    files = [name for name in names if os.path.isfile(os.path.join(folder, name))]
    return sorted(name.replace(os.sep, "/") for name in files)


def digest(folder: str, place: str) -> str | None:
    """SHA-256 of a regular file; None if there is none.

    Raises
    ------
    FileError
        A URL cannot be opened.
    """
    if is_url(place):
        with _remote(place) as (system, path):
            if not system.isfile(path):
                return None
            found = hashlib.sha256()
            for block in _blocks(system, path, place):
                found.update(block)
            return found.hexdigest()
    if fault_of(absolute(folder, place)) is not None:
        return None
    with open(absolute(folder, place), "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def fetch(folder: str, place: str, scratch: str) -> Path:
    """Local path of a file: its own, or for a URL that of a copy in ``scratch``.

    Raises
    ------
    FileError
        A URL cannot be read.
    """
    if not is_url(place):
        return Path(absolute(folder, place))
    copy = Path(scratch, posixpath.basename(place))
    with _remote(place) as (system, path), copy.open("wb") as stream:
        stream.writelines(_blocks(system, path, place))
    return copy


def _blocks(system: Any, path: str, url: str) -> Iterator[bytes]:
    """The content of a file of a file system; FileError if it is too long or takes too long."""
    size, end = 0, time.monotonic() + MOST_SECONDS
    with system.open(path, "rb") as stream:
        while block := stream.read(_BLOCK):
            yield block
            size += len(block)
            if size > MOST_BYTES or time.monotonic() > end:
                raise FileError(
                    f"more than {MOST_BYTES >> 30} GiB or {MOST_SECONDS} s of data were sent",
                    file=url,
                    hint="download it, and name the local file",
                )


def store(source: Path, place: str) -> None:
    """Upload a finished file; it appears complete or not at all if the store supports that.

    Raises
    ------
    FileError
    """
    with _remote(place) as (system, path):
        system.makedirs(posixpath.dirname(path), exist_ok=True)
        # In a transaction fsspec gives a file its name after all of it has arrived.
        with system.transaction, source.open("rb") as content, system.open(path, "wb") as stream:
            shutil.copyfileobj(content, stream)


def _patience(url: str) -> dict[str, Any]:
    """Options of a file system by which a silent web server is given up."""
    if urlsplit(url).scheme not in ("http", "https"):
        return {}
    from aiohttp import ClientTimeout

    limits = ClientTimeout(total=MOST_SECONDS, sock_connect=SILENCE, sock_read=SILENCE)
    return {"client_kwargs": {"timeout": limits}}


@contextmanager
def _remote(url: str) -> Iterator[tuple[Any, str]]:
    """File system and path of a URL; exceptions of the file system are raised as FileError."""
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise BatchError(
            "URLs need the package fsspec", file=url, hint="pip install 'ffdcli[cluster]'"
        ) from None
    try:
        yield url_to_fs(url, **_patience(url))
    except FfdError:
        raise
    except FileNotFoundError:
        raise FileError("there is no such file", file=url, hint="check the URL") from None
    except Exception as error:
        # Each store raises exceptions of different types.
        detail = " ".join(str(error).split()) or type(error).__name__
        hint = "check the URL and your access rights"
        raise FileError(f"the URL cannot be accessed: {detail}", file=url, hint=hint) from error
