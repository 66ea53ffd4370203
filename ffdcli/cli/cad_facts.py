"""Facts of CAD files, for `ffd info`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ffdcli.errors import KernelError

if TYPE_CHECKING:
    from ffdcli.brep.readback import ReadBrep


def cad_facts(file: Path) -> dict[str, Any]:
    """Solids, faces, degrees, names and bounds of a CAD file, as `ffd info` prints them."""
    from ffdcli.brep.occ.part.read import read_names
    from ffdcli.brep.occ.reading.read import read_cad, record_of

    model = read_cad(file)
    try:
        read = record_of(model)
    except KernelError:
        # It has geometry other than planes, lines and splines.
        return _part_facts(file)
    bounds = _bounds(read)
    return {
        "solids": read.solid_count,
        "shells": len(read.shell_closed),
        "faces": read.face_count,
        "edges": len(read.edges),
        "vertices": len(read.points),
        "closed": bool(read.shell_closed.all()) and len(read.shell_closed) > 0,
        **read.surface_facts,
        "min": bounds[0],
        "max": bounds[1],
        "unit": model.unit,
        "names": read_names(file),
        "warnings": [],
    }


def _part_facts(file: Path) -> dict[str, Any]:
    """The same facts of a file of any surfaces, which OpenCascade's reader may repair."""
    from ffdcli import read_part
    from ffdcli.brep.occ.part.labels import distinct_names
    from ffdcli.part.result import surface_facts

    part = read_part(file)
    return {
        "solids": part.solid_count,
        "shells": len(part.shell_closed),
        "faces": part.face_count,
        "edges": len(part.edges),
        "vertices": len(part.points),
        "closed": bool(part.shell_closed.all()),
        **surface_facts(part.surfaces),
        "min": part.bounds[0].tolist(),
        "max": part.bounds[1].tolist(),
        "unit": part.unit,
        "names": distinct_names(part.solid_names, part.face_names),
        "warnings": list(part.notes),
    }


def _bounds(read: ReadBrep) -> list[list[float]]:
    """Lowest and highest coordinates of many points on faces and edges."""
    import numpy as np

    from ffdcli.brep.evaluate.face_points import edge_points, face_points
    from ffdcli.brep.evaluate.lookup import model_of_read
    from ffdcli.brep.evaluate.trim import outlines

    model = model_of_read(read)
    inner = face_points(model, outlines(model), 10_000).position
    points = np.concatenate([read.points, inner, edge_points(model).position])
    return [points.min(axis=0).tolist(), points.max(axis=0).tolist()]
