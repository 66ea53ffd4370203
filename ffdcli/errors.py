"""Errors that a user can cause: one hierarchy; each is also of a built-in type.

The library raises them and never prints or exits. The command line turns them into a message, an
exit status and, with ``--json``, an ``error`` object.
"""

from __future__ import annotations


class FfdError(Exception):
    """An error with its place and a hint.

    Parameters
    ----------
    message : str
        What is wrong, in one sentence.
    file, line, key : optional
        File, line (from 1) and key of the lattice file concerned.
    hint : str, optional
        What to do.
    """

    kind = "error"

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        line: int | None = None,
        key: str | None = None,
        hint: str | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.file = file
        self.line = line
        self.key = key
        self.hint = hint

    def __str__(self) -> str:
        place = ":".join(str(part) for part in (self.file, self.line) if part is not None)
        parts = [part for part in (place, self.key, self.message) if part]
        text = ": ".join(parts)
        return f"{text} ({self.hint})" if self.hint else text


class FileError(FfdError, OSError):
    """A file cannot be read or written."""

    kind = "file"

    # OSError has a __str__ of its own, which ignores the fields above.
    __str__ = FfdError.__str__


class MeshError(FfdError, ValueError):
    """The mesh cannot be used as it is."""

    kind = "mesh"


class LatticeError(FfdError, ValueError):
    """The lattice file is not valid, or its edits are not possible."""

    kind = "lattice"


class BatchError(FfdError, ValueError):
    """The jobs file is not valid, or the batch cannot run."""

    kind = "batch"


class KernelError(FfdError, RuntimeError):
    """The CAD kernel failed; the message says in which operation."""

    kind = "kernel"


class CheckError(FfdError, RuntimeError):
    """The result failed a check; nothing was written."""

    kind = "check"


class MemoryLimitError(FfdError, MemoryError):
    """A run would take more memory than can be had; it was not begun."""

    kind = "memory"


def lacks_memory(error: BaseException) -> bool:
    """Whether an error says that memory ran out: Python's, numpy's, or OpenCascade's."""
    return isinstance(error, MemoryError) or type(error).__name__ == "Standard_OutOfMemory"
