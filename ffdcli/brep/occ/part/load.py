"""CAD files as XDE documents, with names, colours, layers and assemblies; numbers unscaled."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ffdcli.brep.occ.formats import CAD_FORMATS, cad_format
from ffdcli.brep.occ.part.document import new_document, root_shapes, shape_tool
from ffdcli.brep.occ.reading.brep import read_brep
from ffdcli.brep.occ.reading.iges import SHARING, iges_unit, is_complete
from ffdcli.brep.occ.reading.loading import (
    HEALING,
    HEALING_BUT_COMPLETING,
    HEALING_BUT_CONNECTING,
    limit_tolerance,
    load,
    switched_off,
    unreadable,
)
from ffdcli.brep.occ.reading.step import apply_tolerance, file_unit
from ffdcli.brep.occ.settings import exchange_settings, silent_kernel
from ffdcli.errors import FileError
from ffdcli.files import require_file
from ffdcli.units import Unit

# Text fields of STEP faces are names only if this is on.
_SETTINGS = {"read.precision.mode": "File", "read.stepcaf.subshapes.name": "On"}
# Do not cut splines where they are not C1.
_IGES_SETTINGS = {"read.precision.mode": "File", "read.iges.bspline.continuity": "0"}


def load_document(
    path: str | Path, *, repairs: bool, complete: bool = False
) -> tuple[Any, str | None]:
    """The document of a CAD file, and the unit of its numbers; None for BREP files.

    Parameters
    ----------
    path : str or Path
    repairs : bool
        Let OpenCascade's readers complete and repair what they read.
    complete : bool
        Without repairs: let them only add what files leave out, edges at poles and apexes, second
        sides of seams, and curves on planar splines.

    Raises
    ------
    FileError
        The file is missing, of no known kind, or holds nothing that OpenCascade can read.
    """
    kind = cad_format(path)
    if kind is None:
        raise FileError(
            "this is no CAD file by its extension",
            file=str(path),
            hint=f"use one of {', '.join(CAD_FORMATS)}",
        )
    require_file(path, f"give the name of {'an' if kind == 'IGES' else 'a'} {kind} file")
    if kind == "BREP":
        from OCP.TDataStd import TDataStd_Name

        document = new_document()
        label = shape_tool(document).AddShape(read_brep(path).shape, False)
        # OpenCascade calls it by its kind, such as COMPOUND.
        label.ForgetAttribute(TDataStd_Name.GetID_s())
        return document, None
    with silent_kernel():
        off = () if repairs else HEALING_BUT_COMPLETING if complete else HEALING
        return (_load_step if kind == "STEP" else _load_iges)(str(path), off)


def _load_step(name: str, off: tuple[str, ...]) -> tuple[Any, str]:
    from OCP.STEPCAFControl import STEPCAFControl_Reader

    with exchange_settings(_SETTINGS):
        reader = STEPCAFControl_Reader()
        for mode in ("Color", "Name", "Layer", "Props", "SHUO", "Mat", "GDT", "View"):
            getattr(reader, f"Set{mode}Mode")(True)
        base = reader.ChangeReader()
        load(base, name, "STEP")
        unit = file_unit(base, name)
        document = _transferred(reader, base, name, unit, off)
        if off:
            for shape in root_shapes(document):
                apply_tolerance(base, shape)
    return document, unit.name


def _load_iges(name: str, off: tuple[str, ...]) -> tuple[Any, str]:
    from OCP.IGESCAFControl import IGESCAFControl_Reader

    if not is_complete(Path(name)):
        raise unreadable(name, "IGES")
    with exchange_settings(_IGES_SETTINGS):
        reader = IGESCAFControl_Reader()
        for mode in ("Color", "Name", "Layer"):
            getattr(reader, f"Set{mode}Mode")(True)
        load(reader, name, "IGES")
        model = reader.IGESModel()
        section = model.GlobalSection()
        unit = iges_unit(section, name)
        section.SetCascadeUnit(unit.millimetres)
        model.SetGlobalSection(section)
        entities = map(model.Entity, range(1, model.NbEntities() + 1))
        shared = any(entity.TypeNumber() in SHARING for entity in entities)
        if off == HEALING and not shared:
            off = HEALING_BUT_CONNECTING
        document = _transferred(reader, reader, name, unit, off)
        for shape in root_shapes(document):
            limit_tolerance(shape, section.Resolution())
    return document, unit.name


def _transferred(reader: Any, base: Any, name: str, unit: Unit, off: tuple[str, ...]) -> Any:
    """The document of a loaded file, read with some repairs switched off."""
    document = new_document()
    # Numbers are left unscaled only if this unit is the file's.
    with exchange_settings({"xstep.cascade.unit": unit.kernel}), _without(base, off):
        done = reader.Transfer(document)
    if not done or not root_shapes(document):
        raise FileError("OpenCascade could make no shape of what the file holds", file=name)
    return document


@contextmanager
def _without(reader: Any, repairs: tuple[str, ...]) -> Iterator[None]:
    if not repairs:
        yield
        return
    with switched_off(reader, repairs):
        yield
