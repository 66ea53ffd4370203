"""The errors a user can cause: one small hierarchy, each also a built-in type.

Library code raises these and never prints or exits; the command line turns them into one plain
message, an exit status and, with ``--json``, the ``error`` object of the contract.
"""

from __future__ import annotations


class FfdError(Exception):
    """What is wrong, where, and what to do about it.

    Parameters
    ----------
    message : str
        One plain sentence: what is wrong.
    file, line, key : optional
        The file, the line in it (1-based) and the key of the lattice file concerned.
    hint : str, optional
        What to do.
    """

    kind = "error"
    exit_status = 1

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

    # OSError.__new__ consumes positional arguments of its own; the fields above are the truth.
    __str__ = FfdError.__str__


class MeshError(FfdError, ValueError):
    """The mesh cannot be used as it is."""

    kind = "mesh"


class LatticeError(FfdError, ValueError):
    """The lattice file, or what it asks for, cannot be used."""

    kind = "lattice"


class BatchError(FfdError, ValueError):
    """The jobs file, or what it asks for, cannot be used."""

    kind = "batch"


class KernelError(FfdError, RuntimeError):
    """The CAD kernel refused something; says what it was asked to do."""

    kind = "kernel"


class CheckError(FfdError, RuntimeError):
    """The result was built but failed our own check; nothing was written."""

    kind = "check"


class VerificationError(FfdError, RuntimeError):
    """A written file does not hold the deformation it is compared with."""

    kind = "verification"
    exit_status = 3
