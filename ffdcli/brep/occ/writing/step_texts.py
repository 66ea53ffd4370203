"""Texts of STEP files, written so that receivers' parsers read them."""

from __future__ import annotations

import re

from ffdcli.labels import plain_text

# OpenCascade's scanner holds 16,384 bytes of a text, and no character takes more than nine.
_LONGEST = 1800
# Texts that OpenCascade prints as they are, in one piece.
_SIMPLE = re.compile(r"[ -&(-\[\]-~]{0,60}")
# Apostrophes that OpenCascade's scanner takes for the end of a text, even if they are doubled.
_ENDING = re.compile("'(?=[ \"]*[),])")
_ESCAPED = re.compile(r"[^ -\[\]-~]+")
_MARK = re.compile(rb"\x1e(\d+)\x1e")


class StepTexts:
    """Stands for texts while OpenCascade prints, and puts them into what it printed.

    OpenCascade breaks long texts into lines, also within escapes, which its reader then misreads.
    """

    def __init__(self) -> None:
        self._marks: dict[str, str] = {}

    def __call__(self, value: str) -> str:
        """The text itself, or a mark that stands for it."""
        if _SIMPLE.fullmatch(value):
            return value
        return self._marks.setdefault(value, f"\x1e{len(self._marks)}\x1e")

    def put_into(self, content: bytes) -> bytes:
        """The content with texts in place of the marks."""
        if not self._marks:
            return content
        texts = [step_text(value).encode("ascii") for value in self._marks]
        return _MARK.sub(lambda found: texts[int(found[1])], content)


def step_text(value: str) -> str:
    """Text in the characters that STEP files allow (ISO 10303-21, 6.4.3), quotes doubled.

    Other characters are written in UTF-16 (``\\X2\\``), which more readers know than UTF-32
    (``\\X4\\``). So is an apostrophe before a parenthesis or a comma: OpenCascade reads it as the
    end of the text.
    """
    marked = _ENDING.sub("\0", plain_text(value, _LONGEST))
    return _ESCAPED.sub(_escape, marked).replace("'", "''")


def _escape(found: re.Match[str]) -> str:
    characters = found[0].replace("\0", "'")
    return f"\\X2\\{characters.encode('utf-16-be').hex().upper()}\\X0\\"
