"""Lattices fitted to a field of displacements, or onto a scan, in a file."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ffdcli.errors import FileError
from ffdcli.fields.formats import FIELD_SUFFIXES
from ffdcli.lattice.export.fit_text import FitChoice, fit_text
from ffdcli.lattice.file.source import parse_yaml
from ffdcli.lattice.lattice_file import parse_lattice
from ffdcli.messages import printable
from ffdcli.models import settle_lattice
from ffdcli.scan.read import SCAN_SUFFIXES, is_scan

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice
    from ffdcli.mesh import Mesh
    from ffdcli.part.record import Part


@dataclass(frozen=True, eq=False)
class FieldFit:
    """A lattice fitted to a field, and the text of the lattice file that gives it.

    Parameters
    ----------
    text : str
    lattice : Lattice
        What the file gives with the model; ``lattice.fits[0]`` says what was reached.
    pairs : FoundPairs or None
        Of a fit onto a scan.
    """

    text: str
    lattice: Lattice
    pairs: FoundPairs | None = None


@dataclass(frozen=True, eq=False)
class FoundPairs:
    """Places of a model and the points of a scan that they are, in a file of their own.

    Parameters
    ----------
    file : Path
        Beside the lattice file.
    content : bytes
        Of an .npz file.
    text : str
        The lattice file that names it, and gives the same lattice without looking for the pairs.
    """

    file: Path
    content: bytes
    text: str


def fit_field(
    model: Mesh | Part,
    field: str | Path,
    choice: FitChoice | None = None,
    *,
    output: str | Path = "lattice.yaml",
    name: str = "model",
) -> FieldFit:
    """Fit a lattice to the displacements in a file, or onto a scan; nothing is written.

    Parameters
    ----------
    model : Mesh or Part
        What the lattice deforms; its box is that of the lattice.
    field : str or Path
        See :func:`ffdcli.read_field`; or a scan, see ``ffdcli.scan.read``.
    choice : FitChoice, optional
        Kind of volume, tolerance and so on.
    output : str or Path
        Where the lattice file is to be: it names the field relative to its folder.
    name : str
        File of the model, for the comments.

    Raises
    ------
    FileError
        The file is neither a field nor a scan by its extension.
    LatticeError
        The field cannot be read or fitted; the key is one of the lattice file.
    """
    output, choice, field = Path(output), choice or FitChoice(), Path(field)
    suffix = field.suffix.lower()
    if suffix not in (*FIELD_SUFFIXES, *SCAN_SUFFIXES):
        shown = repr(suffix) if suffix else "no extension"
        raise FileError(
            f"cannot tell the format: {shown} is neither that of a field nor that of a scan",
            file=str(field),
            hint=f"use {', '.join(FIELD_SUFFIXES)} for displacements, or "
            f"{', '.join(SCAN_SUFFIXES)} for a scan",
        )
    scanned = is_scan(field)
    _require_fitting(choice, field, scanned)
    if choice.targets is not None:
        choice = replace(choice, targets=_relative(Path(choice.targets), output.parent))
    named = _relative(field, output.parent)
    as_text = partial(
        fit_text, model=printable(name), unit=model.unit, lattice=printable(str(output))
    )
    if not scanned:
        text = as_text(choice, pairs=named)
        return FieldFit(text, _settled(text, field, output, model))
    text = as_text(choice, scan=named)
    lattice = _settled(text, field, output, model)
    member = lattice.member
    table, report = member.definition.pairs[0], member.fits[0].scan
    assert report is not None
    if report.smooth is not None:
        choice = replace(choice, smooth=report.smooth)
    file = pairs_file(output)
    buffer = io.BytesIO()
    if table.by.any():
        np.savez(buffer, points=table.sources, displacements=table.goals)
    else:
        np.savez(buffer, points=table.sources, targets=table.goals)
    # The pairs are in the unit of the lattice.
    kept = replace(choice, unit=None, reach=None)
    found = as_text(kept, pairs=file.name, scan=named)
    return FieldFit(text, lattice, FoundPairs(file, buffer.getvalue(), found))


def pairs_file(output: Path) -> Path:
    """The file for the pairs that a registration finds, beside a lattice file."""
    return output.with_name(f"{output.stem}.pairs.npz")


def _settled(text: str, field: Path, output: Path, model: Mesh | Part) -> Lattice:
    data, source = parse_yaml(text, printable(str(field)), output.parent)
    # The file is not there yet: what is wrong is on no line of it.
    return settle_lattice(parse_lattice(data, replace(source, lines={})), model)


def _require_fitting(choice: FitChoice, field: Path, scanned: bool) -> None:
    """Raise a FileError for what is chosen and belongs to the other kind of file."""
    for_fields = {"field": choice.field, "targets": choice.targets}
    named = for_fields if scanned else {"reach": choice.reach}
    for key, value in named.items():
        if value is not None:
            what = "a field of displacements" if scanned else "a scan"
            message = f"`{key}` is for {what}, and this is {'a scan' if scanned else 'none'}"
            raise FileError(message, file=printable(str(field)), hint="leave it out")


def _relative(file: Path, folder: Path) -> str:
    """Path of a file as the lattice file in a folder names it."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:
        # On another drive of Windows.
        return file.resolve().as_posix()
