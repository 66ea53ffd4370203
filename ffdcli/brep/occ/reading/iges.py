"""IGES files as OpenCascade shapes, without repairs."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from ffdcli.brep.occ.reading.loading import (
    HEALING,
    HEALING_BUT_CONNECTING,
    ReadModel,
    limit_tolerance,
    load,
    switched_off,
    transfer,
    unreadable,
)
from ffdcli.brep.occ.settings import exchange_settings, silent_kernel
from ffdcli.errors import FileError
from ffdcli.files import require_file
from ffdcli.units import UNITS, Unit

# IGES entities with shared edges: solids, faces, shells.
SHARING = (186, 510, 514)


def read_iges(path: str | Path) -> ReadModel:
    """Read an IGES file with OpenCascade's healing switched off and its numbers unscaled.

    The boundary curves of trimmed surfaces (entity 144) have no vertices: the ends of consecutive
    curves are merged into vertices, as no face is valid without them.

    Raises
    ------
    FileError
        The file is missing, is no IGES file, holds no shape, states no unit this program knows, or
        holds something OpenCascade cannot read.
    """
    from OCP.IGESControl import IGESControl_Reader

    require_file(path, "give the name of an IGES file")
    name = str(path)
    if not is_complete(Path(name)):
        raise unreadable(name, "IGES")
    # Do not cut splines where they are not C1.
    settings = {"read.precision.mode": "File", "read.iges.bspline.continuity": "0"}
    with silent_kernel(), exchange_settings(settings):
        reader = IGESControl_Reader()
        roots = load(reader, name, "IGES")
        model = reader.IGESModel()
        section = model.GlobalSection()
        unit = iges_unit(section, name)
        section.SetCascadeUnit(unit.millimetres)
        model.SetGlobalSection(section)
        entities = map(model.Entity, range(1, model.NbEntities() + 1))
        shared = any(entity.TypeNumber() in SHARING for entity in entities)
        with switched_off(reader, HEALING if shared else HEALING_BUT_CONNECTING):
            shape = transfer(reader, roots, name)
        resolution = section.Resolution()
        limit_tolerance(shape, resolution)
        return ReadModel(shape, unit.name, None if shared else resolution)


def is_complete(path: Path) -> bool:
    """True if the last line of an IGES file states the line count of each section correctly.

    OpenCascade does not check it, and may crash on a truncated file.
    """
    lines = [line for line in path.read_bytes().splitlines() if line.strip()]
    found = Counter(line[72:73] for line in lines)
    # Columns 1 to 32 of the last line: S, G, D and P, each with seven digits.
    last = lines[-1] if lines else b""
    counts = {last[at : at + 1]: last[at + 1 : at + 8].strip() for at in range(0, 32, 8)}
    sections = {key: b"%d" % found[key] for key in (b"S", b"G", b"D", b"P")}
    return last[72:73] == b"T" and counts == sections


def iges_unit(section: Any, name: str) -> Unit:
    """Return the unit of length that a global section states."""
    for unit in UNITS:
        if unit.iges == section.UnitFlag():
            return unit
    raise FileError(
        "unknown unit of length: the file's flag is "
        f"{section.UnitFlag()}, its name {section.UnitName().ToCString()!r}",
        file=name,
    )
