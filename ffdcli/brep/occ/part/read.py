"""CAD parts as records of arrays, with names, colours, layers and assemblies kept for writing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.brep.occ.part.document import bytes_of, root_shapes
from ffdcli.brep.occ.part.extract import extract
from ffdcli.brep.occ.part.faults import describe_faults, settle_edges
from ffdcli.brep.occ.part.labels import distinct_names, names_in
from ffdcli.brep.occ.part.load import load_document
from ffdcli.brep.occ.part.validity import is_valid, lacking_pcurve
from ffdcli.brep.occ.part.walk import Numbering, number_parts
from ffdcli.errors import FileError, KernelError
from ffdcli.messages import counted
from ffdcli.part.record import Part


def read_part(path: str | Path) -> Part:
    """Read a CAD part: STEP, IGES or BREP, by its extension.

    The file is taken as it is if OpenCascade finds it valid. Else its reader completes what the
    file leaves out, such as curves in surface parameters, and repairs what it can; notes say what
    has changed.

    Raises
    ------
    FileError
        The file is missing, of no known kind, or holds nothing that OpenCascade can read; or it
        holds no faces, or geometry that cannot be deformed.
    """
    document, unit, found, notes = read_document(path)
    if not found.faces.Extent():
        raise FileError("the file holds no faces", file=str(path))
    notes += settle_edges(found)
    try:
        fields = extract(found)
    except KernelError as error:
        raise FileError(error.message, file=str(path)) from error
    faces, solids = names_in(document, found)
    part = Part(
        **fields,
        face_names=faces,
        solid_names=solids,
        unit=unit,
        valid=is_valid(document),
        source=str(path),
        handle=bytes_of(document),
    )
    return replace(part, notes=(*notes, *describe_faults(document, found, part)))


def read_document(path: str | Path) -> tuple[Any, str | None, Numbering, list[str]]:
    """The document of a CAD file, as it is if it is valid, else repaired by OpenCascade's reader.

    Returns the unit too, the numbers of its parts, and sentences on what was repaired.

    Raises
    ------
    FileError
        As for :func:`read_part`.
    """
    document, unit = load_document(path, repairs=False)
    found = number_parts(root_shapes(document))
    if lacking_pcurve(found) is None and is_valid(document):
        return document, unit, found, []
    before = _structure(found)
    document, unit = load_document(path, repairs=True)
    found = number_parts(root_shapes(document))
    face = lacking_pcurve(found)
    if face is not None:
        raise FileError(
            f"face {face} has an edge without a curve in the face's parameters, and OpenCascade "
            "could make none",
            file=str(path),
            hint="export the part anew, with curves on surfaces",
        )
    return document, unit, found, _changes(before, _structure(found))


def read_names(path: str | Path) -> list[str]:
    """Names of the bodies and faces of a CAD file, each once: the groups of lattice files."""
    document, _ = load_document(path, repairs=False)
    faces, solids = names_in(document, number_parts(root_shapes(document)))
    return distinct_names(solids, faces)


def _structure(found: Numbering) -> dict[str, Any]:
    from OCP.BRep import BRep_Tool

    return {
        "faces": found.faces.Extent(),
        "solids": len(found.solids),
        "open": [shell is None or not BRep_Tool.IsClosed_s(shell) for shell, _ in found.shells],
        "reversed": list(found.face_reversed),
    }


def _changes(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """Sentences on what OpenCascade's reader has changed beyond completing the file."""
    notes = []
    for what in ("face", "solid"):
        old, new = before[f"{what}s"], after[f"{what}s"]
        if old != new:
            notes.append(
                "OpenCascade's reader repaired the part: it has "
                f"{counted(new, what, f'{what}s')}, as written it has {old}"
            )
    if before["faces"] == after["faces"]:
        turned = int(np.sum(np.array(before["reversed"]) != np.array(after["reversed"])))
        if turned:
            faces = counted(turned, "face", "faces")
            notes.append(f"OpenCascade's reader repaired the part: it turned {faces}")
    return notes
