"""The journal of edits that are not saved yet: a line for each step, on disk before it is shown.

It lies beside the lattice file as ``.NAME.edits.jsonl``. Its first line says which version of the
lattice file the steps belong to. Each other line tells how the entries of the lattices changed. A
line that was cut off by a crash is the last one, and is left out.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from ffdcli.editor.document import Edits
from ffdcli.errors import FileError, LatticeError
from ffdcli.files import read_file

_VERSION = 1


@dataclass(frozen=True)
class Recorded:
    """What a journal holds.

    Parameters
    ----------
    path : Path
    digest : str or None
        SHA-256 of the lattice file that the steps belong to; None for one that was not saved yet.
    model : str
        Name of the model that was edited.
    start : str
        Text of a lattice file that was not saved yet; empty otherwise.
    steps : sequence of steps
        See :func:`step_between`.
    saved : str or None
        SHA-256 of the lattice file that was about to hold them all when the journal ended.
    """

    path: Path
    digest: str | None
    model: str
    start: str
    steps: Sequence[Any]
    saved: str | None


def journal_path(lattice: Path) -> Path:
    """The journal of a lattice file."""
    return lattice.with_name(f".{lattice.name}.edits.jsonl")


def step_between(old: Edits, new: Edits) -> list[list[Any]]:
    """How entries changed: lattice, place, entries that went, and entries that came.

    Of lattices that changed alone. The place is None where entries came at the end.
    """
    found: list[list[Any]] = []
    for number, (before, after) in enumerate(zip(old, new, strict=True)):
        if before == after:
            continue
        most, first = min(len(before), len(after)), 0
        while first < most and before[first] == after[first]:
            first += 1
        last = 0
        while last < most - first and before[-1 - last] == after[-1 - last]:
            last += 1
        gone, come = before[first : len(before) - last], after[first : len(after) - last]
        place = None if first == len(before) else first
        found.append([number, place, list(gone), list(come)])
    return found


def apply_step(edits: Edits, step: Any) -> Edits:
    """The entries after a step.

    Raises
    ------
    ValueError
        The step does not fit the entries.
    """
    lists = list(edits)
    for number, place, gone, come in step:
        if not 0 <= number < len(lists):
            raise ValueError("there is no such lattice")
        before = lists[number]
        places = [len(before) if place is None else int(place)]
        # In another version of the file they may stand elsewhere; the last ones are meant.
        places += reversed(range(len(before))) if gone else []
        fits = (at for at in places if at <= len(before) and _stand_at(before, at, gone))
        first = next(fits, None)
        if first is None:
            raise ValueError("other entries stand there")
        lists[number] = (*before[:first], *come, *before[first + len(gone) :])
    return tuple(lists)


def _stand_at(entries: Sequence[Any], place: int, some: Sequence[Any]) -> bool:
    return list(entries[place : place + len(some)]) == list(some)


def read_journal(path: Path) -> Recorded | None:
    """What a journal holds; None where it holds no step.

    Raises
    ------
    FileError
        The file is no journal.
    """
    if not path.exists():
        return None
    lines = read_file(path).split(b"\n")
    # What follows the last line break was not written to its end.
    whole = lines[:-1]
    try:
        head, *steps = (json.loads(line) for line in whole)
        if not isinstance(head, dict) or head.get("journal") != _VERSION:
            raise ValueError
        digest, model, start = head["digest"], str(head["model"]), str(head.get("start", ""))
    except (ValueError, KeyError):
        if not b"".join(whole).strip(b"\0"):
            return None
        raise FileError(
            "this is no journal of `ffd edit`", file=str(path), hint="move or remove it"
        ) from None
    saved = steps[-1]["saved"] if steps and isinstance(steps[-1], dict) else None
    steps = [step for step in steps if not isinstance(step, dict)]
    return Recorded(path, digest, model, start, steps, saved) if steps else None


def states_after(found: Recorded, now: Edits) -> list[Edits]:
    """The entries after each step of a journal, beginning with those as they are.

    Raises
    ------
    LatticeError
        A step does not fit.
    """
    states = list[Edits]()
    try:
        for step in found.steps:
            now = apply_step(now, step)
            states.append(now)
    except (ValueError, TypeError, KeyError):
        message = "the steps of the journal do not fit the lattice file"
        raise LatticeError(message, file=str(found.path)) from None
    return states


class Journal:
    """The journal of a session; it holds a lock, so that two sessions do not edit one file."""

    def __init__(self, lattice: Path) -> None:
        """Lock the journal of a lattice file, which is made where it does not exist.

        Raises
        ------
        FileError
            Another session has the lattice file open, or the folder cannot be written to.
        """
        self.path = journal_path(lattice)
        self._stream = _locked(self.path, lattice)
        self._begun = False

    def record(self, step: Any, digest: str | None, model: str, start: str) -> None:
        """Append a step; it is on disk when this returns.

        Parameters
        ----------
        step
            See :func:`step_between`.
        digest, model, start
            For the first line; see :class:`Recorded`.
        """
        if not self._begun:
            self._stream.truncate(0)
            head = {"journal": _VERSION, "digest": digest, "model": model}
            self._write(head | ({} if digest else {"start": start}), step)
            _sync_folder(self.path.parent)
        else:
            self._write(step)
        self._begun = True

    def saving(self, digest: str) -> None:
        """Say that all steps are about to be in a file with this SHA-256."""
        if self._begun:
            self._write({"saved": digest})

    def _write(self, *lines: Any) -> None:
        end = os.fstat(self._stream.fileno()).st_size
        try:
            self._stream.write("".join(json.dumps(each) + "\n" for each in lines).encode())
            os.fsync(self._stream.fileno())
        except OSError as error:
            with suppress(OSError):
                self._stream.truncate(end)
            message = f"the edit cannot be kept in the journal: {error.strerror or error}"
            hint = "free some space, then edit on"
            raise FileError(message, file=str(self.path), hint=hint) from error

    def continues(self) -> None:
        """Let the next steps follow those that the journal holds."""
        self._begun = True
        # A line that was cut off would swallow the next one.
        content = read_file(self.path)
        self._stream.truncate(content.rfind(b"\n") + 1)

    def clear(self) -> None:
        """Forget all steps: they are saved."""
        self._stream.truncate(0)
        os.fsync(self._stream.fileno())
        self._begun = False

    def set_aside(self) -> Path:
        """Keep the steps under another name, and begin anew; return that name."""
        number = 1
        while (place := self.path.with_name(f"{self.path.name}.{number}")).exists():
            number += 1
        with open(place, "xb") as stream:
            stream.write(read_file(self.path))
            stream.flush()
            os.fsync(stream.fileno())
        self.clear()
        return place

    def close(self) -> None:
        """Release the lock; a journal without steps is removed."""
        if self._stream.closed:
            return
        with suppress(OSError):
            if not os.fstat(self._stream.fileno()).st_size:
                self.path.unlink(missing_ok=True)
        self._stream.close()


def _locked(path: Path, lattice: Path) -> BinaryIO:
    try:
        stream = open(path, "ab", buffering=0)  # noqa: SIM115
    except OSError as error:
        message = f"the journal cannot be written: {error.strerror or error}"
        hint = "edits are journaled beside the lattice file; check the folder's permissions"
        raise FileError(message, file=str(path), hint=hint) from error
    try:
        import fcntl
    except ImportError:  # Not on Windows: there two sessions can edit one file.
        return stream
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        stream.close()
        raise FileError(
            "another `ffd edit` has this lattice file open",
            file=str(lattice),
            hint="close that one, or edit a copy",
        ) from None
    return stream


def _sync_folder(folder: Path) -> None:
    """Make the name of a new file last; not all systems can."""
    with suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
