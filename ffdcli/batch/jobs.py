"""The list of jobs that a jobs file stands for: wildcards, combinations, output names."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import os
import posixpath
import re
import string
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ffdcli import __version__
from ffdcli.batch.load import jobs_error, load_jobs_file
from ffdcli.batch.places import exists, has_wildcard, identity, matching, stem
from ffdcli.batch.spec import BatchSpec, Entry, Value, Verify, VerifyOptions
from ffdcli.errors import FfdError
from ffdcli.lattice.file.source import KeyPath, Source, shortened

# More than this is taken for a mistake.
MAX_JOBS = 200_000
# Format of a field: sign, zeros, width and precision of at most two digits, and kind.
_FORMAT = re.compile(r"([^{}]?[<>=^])?[-+ ]?#?0?[0-9]{0,2}[,_]?(\.[0-9]{1,2})?[a-zA-Z%]?")


@dataclass(frozen=True)
class Job:
    """One deformation of a batch.

    Parameters
    ----------
    mesh, lattice, output : str
        Paths, relative to ``folder``, or URLs.
    folder : str
        Absolute path of the jobs file's folder.
    parameters : mapping of str to value
        Values of ``${name}`` in the lattice file.
    scale : float
        Share of the edits that is applied, from 0 (none) to 1.
    options : mapping of str to value
        Options of `ffd deform` that are given; the others have their defaults.
    verify : bool
        Whether the output is verified.
    tolerance : float or None, model length
        Tolerance of the verification; None for its default.
    """

    mesh: str
    lattice: str
    output: str
    folder: str = "."
    parameters: Mapping[str, Value] = field(default_factory=dict)
    scale: float = 1.0
    options: Mapping[str, Any] = field(default_factory=dict)
    verify: bool = False
    tolerance: float | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """All fields but the folder, as plain values."""
        return {
            "output": self.output,
            "mesh": self.mesh,
            "lattice": self.lattice,
            "parameters": {
                name: list(value) if isinstance(value, tuple) else value
                for name, value in self.parameters.items()
            },
            "scale": self.scale,
            "options": dict(self.options),
            "verify": self.verify,
            "tolerance": self.tolerance,
        }

    @property
    def fingerprint(self) -> str:
        """Hash of the settings and the program version, which with the inputs decide the output."""
        text = json.dumps([__version__, self.settings], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def list_jobs(path: str | Path) -> list[Job]:
    """The jobs of a jobs file, in the order of the file.

    Raises
    ------
    FileError
        The file cannot be read.
    BatchError
        The jobs file is not valid, a wildcard matches nothing, or two jobs have the same output.
        The error states line and key.
    """
    spec, source = load_jobs_file(path)
    return expand(spec, source)


def expand(spec: BatchSpec, source: Source) -> list[Job]:
    """The jobs of a checked jobs file; see :func:`list_jobs`."""
    folder = os.path.abspath(source.folder)
    jobs: list[Job] = []
    owners: dict[str, int] = {}
    for index, entry in enumerate(spec.jobs):
        for job in _jobs_of(spec, entry, index, folder, source, first=len(jobs) + 1):
            place = identity(folder, job.output)
            if place in owners:
                hint = "put {mesh}, {lattice}, {folder}, {scale}, {number} or a parameter into the "
                hint += "name, so that names differ"
                message = f"jobs {owners[place]} and {len(jobs) + 1} both write `{job.output}`"
                raise jobs_error(source, _output_path(entry, index), message, hint)
            jobs.append(job)
            owners[place] = len(jobs)
    _reject_overwritten_inputs(jobs, owners, source)
    return jobs


def _jobs_of(
    spec: BatchSpec, entry: Entry, index: int, folder: str, source: Source, first: int
) -> Iterator[Job]:
    path: KeyPath = ("jobs", index)
    pattern = entry.output or spec.output
    if pattern is None:
        hint = "add `output: NAME` here, or at the top of the file for all entries"
        raise jobs_error(source, path, "this entry has no output name", hint)
    verify, tolerance = _verify(spec.verify if entry.verify is None else entry.verify)
    options = {**spec.options.model_dump(by_alias=True, exclude_none=True)}
    options |= entry.options.model_dump(by_alias=True, exclude_none=True)
    if "max_degree" in options and "tolerance" not in options:
        message = "`max_degree` needs `tolerance`"
        raise jobs_error(source, path, message, "add `tolerance: T` to the options")
    meshes = _files(entry.mesh, folder, (*path, "mesh"), source)
    lattices = _files(entry.lattice, folder, (*path, "lattice"), source)
    # Counted first, because the combinations are held in memory.
    lists = (meshes, lattices, entry.scale, *entry.parameters.values())
    total = first - 1 + math.prod(len(values) for values in lists)
    if total > MAX_JOBS:
        message = f"this gives {total:,} jobs; {MAX_JOBS:,} are allowed"
        raise jobs_error(source, path, message, "split the file, or give fewer values")
    combinations = itertools.product(
        meshes, lattices, itertools.product(*entry.parameters.values()), entry.scale
    )
    for number, (mesh, lattice, values, scale) in enumerate(combinations, start=first):
        parameters = dict(zip(entry.parameters, values, strict=True))
        fields = {
            "mesh": stem(mesh),
            "lattice": stem(lattice),
            "folder": posixpath.basename(posixpath.dirname(mesh)) or ".",
            "scale": _plain(scale),
            "number": number,
            **{name: _plain(value) for name, value in parameters.items()},
        }
        output = _named(pattern, fields, _output_path(entry, index), source)
        yield Job(mesh, lattice, output, folder, parameters, scale, options, verify, tolerance)


def _verify(verify: Verify) -> tuple[bool, float | None]:
    if isinstance(verify, VerifyOptions):
        return True, verify.tolerance
    return bool(verify), None


def _files(names: tuple[str, ...], folder: str, path: KeyPath, source: Source) -> list[str]:
    """File names, wildcards replaced by the files they match; each file once."""
    found: list[str] = []
    for place, name in enumerate(names):
        here = (*path, place)
        # A name that exists is that file, brackets and all.
        if not has_wildcard(name) or exists(folder, name):
            found.append(name)
            continue
        try:
            files = matching(folder, name)
        except FfdError as error:
            raise jobs_error(source, here, error.message, error.hint) from error
        if not files:
            raise jobs_error(
                source,
                here,
                f"no file matches `{shortened(name)}`",
                "paths are relative to this file",
            )
        found.extend(files)
    return list(dict.fromkeys(found))


def _output_path(entry: Entry, index: int) -> KeyPath:
    return ("output",) if entry.output is None else ("jobs", index, "output")


def _named(pattern: str, fields: Mapping[str, Any], path: KeyPath, source: Source) -> str:
    known = ", ".join(f"{{{name}}}" for name in fields)
    try:
        for _, name, form, _ in string.Formatter().parse(pattern):
            if name is not None and name not in fields:
                message = f"`{{{shortened(name)}}}` is not defined here"
                raise jobs_error(source, path, message, f"defined here: {known}")
            if form and not _FORMAT.fullmatch(form):
                message = f"`{{{name}:{shortened(form)}}}` is not a format for a file name"
                hint = "use widths of at most two digits, as in {number:04}, and no inner fields"
                raise jobs_error(source, path, message, hint)
        return pattern.format_map(fields)
    except (ValueError, OverflowError) as error:
        if isinstance(error, FfdError):
            raise
        message = f"this is not a valid pattern: {str(error).lower()}"
        raise jobs_error(source, path, message, f"defined here: {known}") from None


def _plain(value: Value) -> Any:
    """A value for a file name: whole numbers without a point, text without path separators."""
    if isinstance(value, tuple):
        return "_".join(str(_plain(part)) for part in value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return int(value)
    return re.sub(r"[^\w.+-]", "_", value) if isinstance(value, str) else value


def _reject_overwritten_inputs(jobs: list[Job], owners: Mapping[str, int], source: Source) -> None:
    """Raise an error if the output of a job is the input of another."""
    for job in jobs:
        for place in (job.mesh, job.lattice):
            writer = owners.get(identity(job.folder, place))
            if writer is not None:
                message = f"job {writer} would overwrite the input `{shortened(place)}`"
                raise jobs_error(source, ("jobs",), message, "choose another output name")
