"""Read regular files only, and write files so that they appear complete or not at all."""

from __future__ import annotations

import os
import re
import secrets
import shutil
import stat
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from ffdcli.errors import FileError

# Seconds after which a temporary file that no process holds has been abandoned.
_ABANDONED = 60.0
# Name of a temporary file: target name, process id and a random number.
_REMNANT = re.compile(r"(\..*\.)([0-9a-f]{8})[0-9a-f]{8}\.part", re.DOTALL)


def fault_of(path: str | Path) -> str | None:
    """What keeps a path from being a regular file that can be read; None if it is one.

    Links are followed. Nothing is opened: to open a pipe, a socket or a device may wait for ever.
    """
    try:
        mode = os.stat(path).st_mode
    except ValueError:
        return "the name holds a null character"
    except FileNotFoundError:
        return "there is no such file"
    except OSError as error:
        return f"the file cannot be read: {_reason(error)}"
    if stat.S_ISDIR(mode):
        return "this is a folder, not a file"
    if not stat.S_ISREG(mode):
        return "this is not a regular file, but a pipe, a socket or a device"
    return None if os.access(path, os.R_OK) else "the file cannot be read: permission denied"


def require_file(path: str | Path, hint: str = "check the path") -> None:
    """Raise a FileError if a path is no regular file that can be read.

    Raises
    ------
    FileError
    """
    fault = fault_of(path)
    if fault is not None:
        raise FileError(fault, file=str(path), hint=hint)


def read_file(path: str | Path, hint: str = "check the path", most: int = -1) -> bytes:
    """The content of a regular file, or the first bytes of it if ``most`` of them are given.

    Raises
    ------
    FileError
        The path is no regular file, or it cannot be read.
    """
    require_file(path, hint)
    try:
        with open(path, "rb") as stream:
            return stream.read(most)
    except OSError as error:
        message = f"the file cannot be read: {_reason(error)}"
        raise FileError(message, file=str(path), hint="check its permissions") from error


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()


@contextmanager
def whole_file(path: str | Path) -> Iterator[BinaryIO]:
    """Open a temporary file beside ``path``, and rename it to ``path`` at the end of the block.

    If the block fails or is interrupted, the temporary file is removed and an existing file at
    ``path`` is unchanged. Of a symbolic link the target is replaced. Temporary files that killed
    processes have left beside it are removed.

    Raises
    ------
    FileError
        The folder is missing or cannot be written to, ``path`` is a folder or a device, or the
        disk is full.
    """
    require_place(path)
    target = Path(os.path.realpath(path))
    own = f"{os.getpid():08x}{secrets.token_hex(4)}"
    temporary = target.with_name(f"{_prefix(target)}{own}.part")
    _remove_abandoned(target)
    try:
        with temporary.open("xb") as stream:
            _lock(stream)
            yield stream
        if target.exists():
            shutil.copymode(target, temporary)
        temporary.replace(target)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and not isinstance(error, FileError):
            raise FileError(
                f"cannot write the file: {_reason(error)}",
                file=str(path),
                hint="check the folder's permissions and the free space",
            ) from error
        raise


def write_whole(path: str | Path, content: bytes) -> None:
    """Write a file completely or not at all; see :func:`whole_file`."""
    with whole_file(path) as stream:
        stream.write(content)


def remove_remnants(paths: Iterable[str | Path], *, process: int | None = None) -> None:
    """Remove temporary files of killed runs for ``paths``.

    Call it only if no other run writes to these paths, or with the id of the killed ``process``.
    """
    prefixes: dict[Path, set[str]] = {}
    for path in paths:
        target = Path(os.path.realpath(path))
        prefixes.setdefault(target.parent, set()).add(_prefix(target))
    for folder, known in prefixes.items():
        with suppress(OSError):
            for name in os.listdir(folder):
                found = _REMNANT.fullmatch(name)
                mine = process is None or (found and int(found[2], 16) == process)
                if found and found[1] in known and mine:
                    with suppress(OSError):
                        os.unlink(folder / name)


def _remove_abandoned(target: Path) -> None:
    """Remove temporary files for a target that no process holds, on this machine or another."""
    with suppress(OSError):
        for name in os.listdir(target.parent):
            found = _REMNANT.fullmatch(name)
            if found is None or found[1] != _prefix(target):
                continue
            # A file as young as this may be about to be locked.
            with suppress(OSError), (target.parent / name).open("r+b") as stream:
                if time.time() - os.stat(stream.fileno()).st_mtime > _ABANDONED and _lock(stream):
                    os.unlink(target.parent / name)


def _lock(stream: BinaryIO) -> bool:
    """Hold a file until it is closed, which the end of the process does too; False if it is held.

    File systems without locks, and Windows, do not hold it.
    """
    if sys.platform == "win32":
        return False
    import fcntl

    with suppress(OSError):
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def _prefix(target: Path) -> str:
    """Prefix of the names of temporary files for a path."""
    return f".{target.name[:64]}."


def require_place(path: str | Path) -> None:
    """Raise a FileError, before any work, if no file can be written at a path."""
    if "\0" in str(path):
        raise FileError("the name holds a null character", file=str(path), hint="give another name")
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise FileError("this is a folder", file=str(path), hint="give the name of a file")
    if target.exists() and not target.is_file():
        raise FileError("this is not an ordinary file", file=str(path), hint="give another name")
    if not target.parent.is_dir():
        raise FileError(
            "the folder for this file does not exist", file=str(path), hint="make the folder first"
        )
