"""Lattices fitted to a field of displacements in a file."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ffdcli.lattice.export.fit_text import FitChoice, fit_text
from ffdcli.lattice.file.source import parse_yaml
from ffdcli.lattice.lattice_file import parse_lattice
from ffdcli.messages import printable
from ffdcli.models import settle_lattice

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
    """

    text: str
    lattice: Lattice


def fit_field(
    model: Mesh | Part,
    field: str | Path,
    choice: FitChoice | None = None,
    *,
    output: str | Path = "lattice.yaml",
    name: str = "model",
) -> FieldFit:
    """Fit a lattice to the displacements in a file; nothing is written.

    Parameters
    ----------
    model : Mesh or Part
        What the lattice deforms; its box is that of the lattice.
    field : str or Path
        See :func:`ffdcli.read_field`.
    choice : FitChoice, optional
        Kind of volume, tolerance and so on.
    output : str or Path
        Where the lattice file is to be: it names the field relative to its folder.
    name : str
        File of the model, for the comments.

    Raises
    ------
    LatticeError
        The field cannot be read or fitted; the key is one of the lattice file.
    """
    output, choice = Path(output), choice or FitChoice()
    if choice.targets is not None:
        choice = replace(choice, targets=_relative(Path(choice.targets), output.parent))
    text = fit_text(
        choice,
        model=printable(name),
        pairs=_relative(Path(field), output.parent),
        unit=model.unit,
        lattice=printable(str(output)),
    )
    data, source = parse_yaml(text, printable(str(field)), output.parent)
    # The file is not there yet: what is wrong is on no line of it.
    lattice = parse_lattice(data, replace(source, lines={}))
    return FieldFit(text, settle_lattice(lattice, model))


def _relative(file: Path, folder: Path) -> str:
    """Path of a file as the lattice file in a folder names it."""
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:
        # On another drive of Windows.
        return file.resolve().as_posix()
