"""Read a jobs file into its model; errors state file, line and key."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from ffdcli.batch.spec import BatchSpec
from ffdcli.errors import BatchError, LatticeError
from ffdcli.files import read_file
from ffdcli.lattice.file.load import first_error
from ffdcli.lattice.file.source import KeyPath, Source, parse_yaml

_START = "start with `version: 1` and `jobs:`; `ffd schema batch` prints all keys"


def load_jobs_file(path: str | Path) -> tuple[BatchSpec, Source]:
    """Read and check a jobs file.

    Raises
    ------
    FileError
        The file cannot be read.
    BatchError
        The jobs file is not valid; the error states line and key.
    """
    path = Path(path)
    try:
        text = read_file(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        hint = "save it as UTF-8, and check that it is a jobs file"
        raise BatchError("this is not UTF-8 text", file=str(path), hint=hint) from None
    return parse_jobs(text, str(path), path.parent)


def parse_jobs(text: str, name: str = "jobs", folder: Path = Path()) -> tuple[BatchSpec, Source]:
    """Check the text of a jobs file; see :func:`load_jobs_file`."""
    if not text.strip():
        raise BatchError("the jobs file is empty", file=name, line=1, hint=_START)
    try:
        data, source = parse_yaml(text, name, folder)
        if not isinstance(data, dict):
            raise source.error((), "a jobs file has the keys `version` and `jobs`", _START)
        try:
            return BatchSpec.model_validate(data), source
        except ValidationError as error:
            raise first_error(error.errors(include_url=False), data, source) from None
    except LatticeError as error:
        raise _of_jobs(error) from None


def jobs_error(source: Source, path: KeyPath, message: str, hint: str | None = None) -> BatchError:
    """An error about the value at a key path."""
    return _of_jobs(source.error(path, message, hint))


def _of_jobs(error: LatticeError) -> BatchError:
    """The error as one about a jobs file: the YAML reader raises errors about lattice files."""
    message = error.message.replace("lattice files", "jobs files")
    return BatchError(message, file=error.file, line=error.line, key=error.key, hint=error.hint)
