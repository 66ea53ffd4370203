"""A written STEP file opened again, and read as receivers' parsers read it, piece by piece."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ffdcli.brep.occ.writing.reopen import STEP_BEGIN, STEP_END, read_statements
from ffdcli.errors import KernelError

# Bytes that are read at once.
_PIECE = 2_000_000


def require_sound_file(path: Path, count: int, size: int = _PIECE) -> None:
    """Reject a file whose structure is not the one that was meant.

    Its texts and parentheses end where they should, its entities are numbered from 1 without gaps,
    and all that they refer to are among them.

    Parameters
    ----------
    path : Path
    count : int
        Number of entities.
    size : int
        Bytes to read at once.

    Raises
    ------
    KernelError
        Naming the first fault.
    """
    fault = _fault_of(path, count, size)
    if fault:
        raise KernelError(
            f"the STEP file could not be read again: {fault}",
            hint="nothing was written; please report it with the files",
        )


def _fault_of(path: Path, count: int, size: int) -> str:
    before, last, tail = 0, 0, b""
    for piece in _statements(path, size):
        if before == 0 and not piece.startswith(STEP_BEGIN):
            return "its first line is missing"
        fault, defined, numbers = read_statements(piece, before)
        if fault:
            return fault
        wrong = defined != np.arange(last + 1, last + 1 + len(defined))
        if wrong.any():
            return f"entity #{last + 1 + np.argmax(wrong)} is not where it should be"
        if len(numbers) and not 1 <= numbers.min() <= numbers.max() <= count:
            return f"it refers to an entity that is not among #1 to #{count}"
        before, last, tail = before + len(piece), last + len(defined), piece[-len(STEP_END) :]
    if last != count:
        return f"it has {last} entities instead of {count}"
    return "" if tail == STEP_END else "its last line is missing"


def _statements(path: Path, size: int) -> Iterator[bytes]:
    """Yield a file in pieces that end with a statement, if some statement ends in them."""
    rest = b""
    with path.open("rb") as stream:
        while block := stream.read(size):
            text = rest + block
            # The last two statements stay together.
            end = text.rfind(b";\n", 0, -2 * len(STEP_END))
            if end < 0:
                rest = text
                continue
            yield text[: end + 2]
            rest = text[end + 2 :]
    if rest:
        yield rest
