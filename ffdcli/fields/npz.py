"""Fields in .npz files of numpy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from lzma import LZMAError
from math import prod
from pathlib import Path
from tokenize import TokenError
from zipfile import BadZipFile, ZipFile, ZipInfo
from zlib import error as DeflateError

import numpy as np
from numpy.lib import format as npy

from ffdcli.arrays import Floats
from ffdcli.errors import FileError
from ffdcli.fields.record import MAX_POINTS, Field, checked_field
from ffdcli.files import require_file

_GOALS = ("displacements", "targets")
_KNOWN = ("points", *_GOALS, "weights")
_HINT = "write it with numpy.savez(file, points=..., displacements=...)"
# Bytes of a number, and of the header of an array.
_WIDEST = 16
_HEADER = 4096


def read_npz(file: Path, *, most: int = MAX_POINTS) -> Field:
    """The field of the arrays `points` (n, 3), `displacements` or `targets` (n, 3), `weights` (n,).

    Raises
    ------
    FileError
        The file cannot be read, or has other arrays.
    """

    def fault(message: str) -> FileError:
        return FileError(message, file=str(file), hint=_HINT)

    arrays = read_arrays(file, _KNOWN, most=most, hint=_HINT)
    if "points" not in arrays:
        raise fault("the array `points` is missing")
    given = [name for name in _GOALS if name in arrays]
    if len(given) != 1:
        both = "both `displacements` and `targets` are" if given else "neither is"
        raise fault(f"one of `displacements` and `targets` is needed; {both} given")
    for name, array in arrays.items():
        wanted = (len(arrays["points"]),) if name == "weights" else (len(arrays["points"]), 3)
        if array.shape != wanted:
            raise fault(f"`{name}` has the shape {array.shape}, not {wanted}")
    goals, by = arrays[given[0]], given[0] == "displacements"
    weights = arrays.get("weights")
    return checked_field(
        file, arrays["points"], goals, by=by, weights=weights, what="point", most=most
    )


def array_names(file: Path) -> tuple[str, ...]:
    """Names of the arrays in a file; none if it is no .npz file.

    Raises
    ------
    FileError
        The path is no regular file that can be read.
    """
    require_file(file)
    try:
        with ZipFile(file) as archive:
            return tuple(each.filename.removesuffix(".npy") for each in archive.infolist())
    except (BadZipFile, EOFError, RuntimeError, ValueError, OSError):
        return ()


def read_arrays(file: Path, known: Sequence[str], *, most: int, hint: str) -> dict[str, Floats]:
    """The arrays of real numbers in a file, by name.

    Parameters
    ----------
    file : Path
    known : sequence of str
        The names that arrays may have.
    most : int
        Largest number of rows.
    hint : str
        How to write such a file, for messages.

    Raises
    ------
    FileError
        The file cannot be read, or has other arrays.
    """

    def fault(message: str, hint: str = hint) -> FileError:
        return FileError(message, file=str(file), hint=hint)

    require_file(file)
    try:
        with ZipFile(file) as archive:
            members = {each.filename.removesuffix(".npy"): each for each in archive.infolist()}
            for name in members:
                if name not in known:
                    allowed = ", ".join(f"`{each}`" for each in known)
                    raise fault(f"the array {name[:60]!r} is not known here: known are {allowed}")
            if len(archive.infolist()) != len(members):
                raise fault("two arrays have the same name")
            return {
                name: _read_array(archive, member, name, most, fault)
                for name, member in members.items()
            }
    except (BadZipFile, DeflateError, LZMAError, EOFError, RuntimeError, ValueError) as error:
        raise fault(f"this is no .npz file, or not all of one: {str(error)[:80]}") from None
    except OSError as error:
        if isinstance(error, FileError):
            raise
        raise fault(f"the file cannot be read: {error}") from None


def _read_array(
    archive: ZipFile, member: ZipInfo, name: str, most: int, fault: Callable[..., FileError]
) -> Floats:
    """The numbers of an array, of which no more is read than the archive says that it has."""
    if member.file_size > most * 3 * _WIDEST + _HEADER:
        message = f"`{name}` has {member.file_size:,} bytes, too many for {most:,} points"
        raise fault(message, "give fewer points")
    with archive.open(member) as stream:
        try:
            version = npy.read_magic(stream)
            header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
            shape, in_columns, dtype = header(stream)
        # numpy parses headers as Python: what is no header raises any of these.
        except (ValueError, SyntaxError, TokenError, ArithmeticError, MemoryError, TypeError):
            raise fault(f"`{name}` is not an array of numpy") from None
        if dtype.kind not in "fiu" or dtype.itemsize > _WIDEST:
            raise fault(f"`{name}` holds {dtype}, not real numbers")
        content = stream.read(member.file_size)
        sound = len(shape) <= 2 and all(0 <= length <= len(content) + 3 for length in shape)
        if not sound or prod(shape) * dtype.itemsize != len(content):
            message = f"`{name}` should have the shape {shape}, and holds {len(content):,} bytes"
            raise fault(message)
    with np.errstate(over="ignore"):
        values = np.frombuffer(content, dtype=dtype).astype(np.float64)
    return values.reshape(shape[::-1]).T if in_columns else values.reshape(shape)
