"""The manifest of a batch: one line of JSON for each job that has ended, flushed to disk."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

from ffdcli.batch.jobs import Job
from ffdcli.batch.single_job import PASSED, Record
from ffdcli.errors import BatchError
from ffdcli.files import require_place
from ffdcli.messages import json_text

# Digest of a file, given a folder and a path relative to it.
Digest = Callable[[str, str], str | None]


class Manifest:
    """A manifest file, opened and locked by one batch.

    Parameters
    ----------
    path : str or Path
        Created if it does not exist.

    Raises
    ------
    FileError
        The file cannot be created.
    BatchError
        Another batch has locked it.
    """

    def __init__(self, path: str | Path) -> None:
        require_place(path)
        self.path = Path(path)
        self._stream: BinaryIO = self.path.open("a+b")
        if not _lock(self._stream):
            self._stream.close()
            raise BatchError(
                "another batch is using this manifest",
                file=str(path),
                hint="wait until it has ended, or choose another manifest with --manifest",
            )
        _sync_folder(self.path.parent)
        self._stream.seek(0)
        content = self._stream.read()
        if content and not content.endswith(b"\n"):
            # A batch was killed while it wrote the last line: end that line.
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
        """Append a record and flush it to disk."""
        self._write(json_text(record).encode() + b"\n")
        self.records[record["output"]] = record

    def _write(self, line: bytes) -> None:
        self._stream.write(line)
        self._stream.flush()
        os.fsync(self._stream.fileno())


def is_current(job: Job, record: Mapping[str, Any] | None, digest: Digest) -> bool:
    """Whether a record shows that a job need not run again.

    The job passed, its settings and the program version are the same, and inputs and output have
    the same digests.
    """
    return (
        record is not None
        and record.get("status") in PASSED
        and record.get("fingerprint") == job.fingerprint
        and all(digest(job.folder, place) == was for place, was in record.get("inputs", {}).items())
        and digest(job.folder, job.output) == record.get("sha256")
    )


def _last_records(content: bytes) -> dict[str, Record]:
    """The last record of each output; lines that a killed batch left incomplete are skipped."""
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
    """Lock a file until it is closed or the process ends; returns False if it is locked already."""
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
    """Flush a folder to disk, so that the name of a new file is stored too."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
