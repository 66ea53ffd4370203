"""Inputs of a job: mesh, lattice, the files that these refer to, and the digests of all."""

from __future__ import annotations

import json
import os
import posixpath
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.batch.jobs import Job
from ffdcli.batch.places import absolute, beside, digest, fetch, is_url
from ffdcli.batch.template import fill
from ffdcli.errors import FfdError, FileError, LatticeError
from ffdcli.files import read_file, require_file

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.mesh import Mesh
    from ffdcli.part.record import Part

Digests = dict[str, str]


def fetch_mesh(job: Job, scratch: str) -> tuple[Path, Digests]:
    """Local path of the mesh, and digests of it and of the files it refers to.

    Raises
    ------
    FileError
        The file does not exist or cannot be read.
    """
    path = fetch(job.folder, job.mesh, scratch)
    digests = _digests(job, [job.mesh])
    for name in _buffers(path):
        place = beside(job.mesh, name)
        if is_url(place):
            copy = path.with_name(name)
            copy.parent.mkdir(parents=True, exist_ok=True)
            fetch(job.folder, place, str(copy.parent))
        digests |= _digests(job, [place])
    return path, digests


def fetch_lattice(job: Job, mesh: Mesh | Part, scratch: str) -> tuple[Lattice, Digests, list[str]]:
    """The job's lattice with its parameters filled in, fitted to the mesh.

    Returns
    -------
    Lattice
    dict of str to str
        Digests of the lattice file and of the files it refers to.
    list of str
        Warnings.

    Raises
    ------
    FileError, LatticeError
    """
    from ffdcli.models import read_lattice

    path = fetch(job.folder, job.lattice, scratch)
    shown = job.lattice if is_url(job.lattice) else str(path)
    text = _text(path, shown)
    filled, unused = fill(text, job.parameters, shown)
    links = [
        name
        for name in dict.fromkeys(_texts(filled, shown))
        if "\0" not in name and digest(job.folder, _linked(job, name)) is not None
    ]
    digests = _digests(job, [job.lattice, *(_linked(job, name) for name in links)])
    warnings = [f"the lattice file does not use the parameter {name}" for name in unused]
    if filled == text and not is_url(job.lattice):
        return read_lattice(path, mesh), digests, warnings
    # The filled text is read from a copy; the files it refers to are copied beside it.
    depth = max((name.split("/").count("..") for name in links), default=0)
    home = Path(scratch, "lattice", *("x" for _ in range(depth)))
    home.mkdir(parents=True)
    for name in links:
        if not (is_url(name) or os.path.isabs(name)):
            copy = Path(os.path.normpath(home / name))
            copy.parent.mkdir(parents=True, exist_ok=True)
            found = fetch(job.folder, _linked(job, name), str(copy.parent))
            if found != copy:
                shutil.copyfile(found, copy)
    copy = home / path.name
    copy.write_text(filled, encoding="utf-8")
    try:
        return read_lattice(copy, mesh), digests, warnings
    except FfdError as error:
        raise _renamed(error, str(copy), shown) from None


def _renamed(error: FfdError, copy: str, shown: str) -> FfdError:
    """The error, with the name of the copy replaced by that of the file itself."""
    if error.file == copy:
        error.file = shown
    folders = f"{posixpath.dirname(copy)}/", f"{posixpath.dirname(shown)}/"
    error.message = error.message.replace(copy, shown).replace(*folders)
    return error


def _text(path: Path, shown: str) -> str:
    try:
        return read_file(path).decode("utf-8-sig")
    except FileError as error:
        error.file = shown
        raise
    except UnicodeDecodeError:
        hint = "save it as UTF-8, and check that it is a lattice file"
        raise LatticeError("this is not UTF-8 text", file=shown, hint=hint) from None


def _linked(job: Job, name: str) -> str:
    return beside(job.lattice, name)


def _texts(text: str, name: str) -> Iterator[str]:
    """All text values of a YAML file; none if it is not valid, which its reader will report."""
    from ffdcli.lattice.file.source import parse_yaml

    try:
        data, _ = parse_yaml(text, name)
    except LatticeError:
        return
    yield from _strings(data)


def _strings(data: Any) -> Iterator[str]:
    if isinstance(data, str):
        yield data
    elif isinstance(data, dict | list):
        for item in data.values() if isinstance(data, dict) else data:
            yield from _strings(item)


def _buffers(path: Path) -> list[str]:
    """Names of the buffer files of a .gltf file."""
    if path.suffix.lower() != ".gltf":
        return []
    try:
        buffers = json.loads(read_file(path)).get("buffers", [])
        names = [str(buffer["uri"]) for buffer in buffers if "uri" in buffer]
    except (OSError, ValueError, AttributeError, TypeError, RecursionError):
        # The mesh reader will report what is wrong with it.
        return []
    return [name for name in names if not name.startswith("data:")]


def _digests(job: Job, places: Iterable[str]) -> Digests:
    found = {place: digest(job.folder, place) for place in places}
    for place, value in found.items():
        if value is None:
            if not is_url(place):
                require_file(absolute(job.folder, place))
            raise FileError("there is no such file", file=place, hint="check the URL")
    return {place: value for place, value in found.items() if value is not None}
