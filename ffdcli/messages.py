"""Counts and points, formatted for messages; text from files, made harmless for terminals."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ffdcli.arrays import Floats


def counted(count: int, one: str, several: str) -> str:
    """``1 polygon was``, ``3 polygons were``."""
    return f"{count} {one if count == 1 else several}"


def amount_text(size: float) -> str:
    """``850 kB``, ``12.3 MB``, ``1.9 GB``."""
    if size < 1e6:
        return f"{size / 1e3:.0f} kB"
    return f"{size / 1e6:.1f} MB" if size < 1e9 else f"{size / 1e9:.1f} GB"


def place_text(point: Floats) -> str:
    """``(x, y, z)`` with nine digits."""
    return "(" + ", ".join(f"{x:.9g}" for x in point) + ")"


# Control characters (C0, DEL, C1), marks of line ends and of the direction of writing, and bytes of
# file names that are not UTF-8.
_UNSAFE = re.compile(
    "[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)


def printable(text: str) -> str:
    """Text on one line, with an escape such as ``\\x1b`` for each character that is not printed.

    Names in files can hold sequences that move the cursor, retitle a window or forge a line.
    """
    return _UNSAFE.sub(_escape, text)


def printable_lines(text: str) -> str:
    """The same for text of several lines."""
    return "\n".join(map(printable, text.split("\n")))


def json_text(value: Any, indent: int | None = None) -> str:
    """A value as JSON that can be printed, and written as UTF-8; no number may be infinite."""
    text = json.dumps(value, indent=indent, ensure_ascii=False, allow_nan=False)
    return _UNSAFE.sub(
        lambda found: found[0] if found[0] == "\n" else f"\\u{ord(found[0]):04x}", text
    )


def _escape(found: re.Match[str]) -> str:
    code = ord(found[0])
    # Python keeps a byte of a name that is not UTF-8 as this code plus the byte.
    code -= 0xDC00 if 0xDC80 <= code < 0xDD00 else 0
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"
