"""The manifest: one line of JSON for every job that has ended, appended and on disk at once."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from ffdcli.batch.jobs import Job
from ffdcli.batch.work import PASSED, Record
from ffdcli.errors import BatchError
from ffdcli.files import require_place

# Of the file at a place, relative to a folder.
Digest = Callable[[str, str], str | None]


class Manifest:
    """A manifest, open and locked for one batch.

    Parameters
    ----------
    path : str or Path
        Made where it does not exist.

    Raises
    ------
    FileError
        There can be no such file.
    BatchError
        Another batch has it open.
    """

    def __init__(self, path: str | Path) -> None:
        require_place(path)
        self.path = Path(path)
        self._stream: BinaryIO = self.path.open("a+b")
        if not _lock(self._stream):
            self._stream.close()
            raise BatchError(
                "another batch is at work with this manifest",
                file=str(path),
                hint="wait for it to end, or name another with --manifest",
            )
        _sync_folder(self.path.parent)
        self._stream.seek(0)
        content = self._stream.read()
        if content and not content.endswith(b"\n"):
            # A batch was killed while it wrote this line; the next one needs a line of its own.
            self._write(b"\n")
        self.records = _last_records(content)

    def __enter__(self) -> Manifest:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stream.close()

    def append(self, record: Record) -> None:
        """Add a record; on return it is on disk."""
        self._write(json.dumps(record, ensure_ascii=False).encode() + b"\n")
        self.records[record["output"]] = record

    def _write(self, line: bytes) -> None:
        self._stream.write(line)
        self._stream.flush()
        os.fsync(self._stream.fileno())


def is_current(job: Job, record: Mapping[str, Any] | None, digest: Digest) -> bool:
    """Whether a record says that a job need not be done again.

    That is so if it passed, its settings and this program are the same, and inputs and output have
    the content they had.
    """
    return (
        record is not None
        and record.get("status") in PASSED
        and record.get("fingerprint") == job.fingerprint
        and all(digest(job.folder, place) == was for place, was in record.get("inputs", {}).items())
        and digest(job.folder, job.output) == record.get("sha256")
    )


def _last_records(content: bytes) -> dict[str, Record]:
    """The last record of every output; a line that a killed batch left unfinished is no record."""
    records: dict[str, Record] = {}
    for line in content.splitlines():
        try:
            record = json.loads(line)
        except ValueError:
            continue
        if isinstance(record, dict) and isinstance(record.get("output"), str):
            records[record["output"]] = record
    return records


def _lock(stream: BinaryIO) -> bool:
    """Claim a file until it is closed or the process ends, however that happens."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _sync_folder(folder: Path) -> None:
    """Have the name of a new file on disk too."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
