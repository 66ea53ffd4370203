"""Numbers in text files: coordinates, indices, colours, and how many decimals are printed."""

from __future__ import annotations

import codecs
from collections.abc import Iterable, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import FileError
from ffdcli.labels import Colour

# Longer numbers are rounded before they enter an array, whose rows are as long as the longest.
_LONGEST_NUMBER = 40


def plain_lines(data: bytes) -> bytes:
    """The text without byte order mark, as UTF-8 and with ``\\n`` as its only line end."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        data = data.decode("utf-16", "replace").encode()
    data = data.removeprefix(codecs.BOM_UTF8)
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def parse_coordinates(rows: Sequence[Sequence[bytes]], source: str) -> tuple[Floats, int]:
    """(V, 3) correctly rounded coordinates, and the most decimals printed for any of them.

    Raises
    ------
    FileError
        A row does not hold three numbers.
    """
    short = next((n for n, row in enumerate(rows) if len(row) != 3), None)
    if short is not None:
        raise FileError(
            f"vertex {short} (counted from 0) does not have three coordinates",
            file=source,
            hint="export the mesh again",
        )
    if not rows:
        return np.empty((0, 3)), 0
    tokens = number_table(chain.from_iterable(rows))
    try:
        numbers = tokens.astype(np.float64)
    except ValueError:
        bad = next(n for n, token in enumerate(tokens.tolist()) if not _is_number(token))
        raise FileError(
            f"a coordinate of vertex {bad // 3} (counted from 0) is not a number: "
            f"{tokens[bad].decode(errors='replace')}",
            file=source,
            hint="export the mesh again",
        ) from None
    return numbers.reshape(-1, 3), count_decimals(tokens)


def parse_indices(tokens: list[bytes], source: str) -> Ints:
    """(n,) int64 indices or counts of polygon corners.

    Raises
    ------
    FileError
        A token is not an integer.
    """
    if not tokens:
        return np.empty(0, dtype=np.int64)
    try:
        return number_table(tokens).astype(np.int64)
    except (ValueError, OverflowError):
        raise FileError(
            "a polygon has a corner that is not a whole number",
            file=source,
            hint="export the mesh again",
        ) from None


def number_table(tokens: Iterable[bytes]) -> NDArray[np.bytes_]:
    """Tokens (n,) of numbers as one array; the longest are rounded or, if no numbers, cut."""
    return np.array([t if len(t) <= _LONGEST_NUMBER else _shortened(t) for t in tokens])


def _shortened(token: bytes) -> bytes:
    try:
        return repr(float(token)).encode()
    except ValueError:
        return token[: _LONGEST_NUMBER - 3] + b"..."


def parse_colour(tokens: Sequence[Any]) -> Colour | None:
    """Red, green and blue limited to 0 .. 1; None if there are not three numbers."""
    try:
        red, green, blue = (min(1.0, max(0.0, float(token))) for token in tokens)
    except (TypeError, ValueError):
        return None
    return (red, green, blue) if red == red and green == green and blue == blue else None


def count_decimals(tokens: NDArray[np.bytes_]) -> int:
    """Most decimals printed in (n,) numbers; ``1.5e-3`` has four, ``2e3`` minus three."""
    characters = tokens.view(np.uint8).reshape(len(tokens), -1)
    exponent_mark = (characters | 0x20) == ord("e")
    with_exponent = exponent_mark.any(axis=1)
    end = np.where(with_exponent, exponent_mark.argmax(axis=1), np.char.str_len(tokens))
    point = characters == ord(".")
    decimals = np.where(point.any(axis=1), end - point.argmax(axis=1) - 1, 0)
    if with_exponent.any():
        parts = np.char.partition(np.char.lower(tokens[with_exponent]), b"e")
        # No double has an exponent beyond 400.
        exponent = np.clip(parts[:, 2].astype(np.float64), -400, 308)
        decimals[with_exponent] -= exponent.astype(np.int64)
    return int(decimals.max())


def truncated(source: str, message: str) -> FileError:
    """An error for a file that ends too early."""
    return FileError(message, file=source, hint="the file may be cut short: export it again")


def _is_number(token: bytes) -> bool:
    try:
        float(token)
    except ValueError:
        return False
    return True
