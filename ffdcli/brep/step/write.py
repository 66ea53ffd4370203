"""Write a boundary representation as a STEP file, piece by piece, whole or not at all."""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

from ffdcli.brep.labels import ShapeLabels
from ffdcli.brep.occ.formats import UNPAINTED, Schema
from ffdcli.brep.occ.writing.header import FileHeader, program, stamp_time
from ffdcli.brep.record import Brep
from ffdcli.brep.step.entities import PIECE, Entities
from ffdcli.brep.step.geometry import add_geometry
from ffdcli.brep.step.properties import add_properties
from ffdcli.brep.step.structure import PROTOCOLS, add_structure
from ffdcli.brep.step.topology import add_bodies, text_of
from ffdcli.errors import KernelError
from ffdcli.files import whole_file
from ffdcli.units import Unit, unit_named

# Bytes that are read at once.
_BLOCK = 1 << 20
_END = b"ENDSEC;\nEND-ISO-10303-21;\n"


def write_step(
    brep: Brep,
    path: str | Path,
    *,
    labels: ShapeLabels,
    unit: str = "mm",
    schema: Schema = "ap214",
    pcurves: bool = True,
    header: FileHeader | None = None,
    digits: int = 17,
    values: int = PIECE,
    before_place: Callable[[Path], None] = lambda _path: None,
) -> int:
    """Write a STEP file; a failure leaves no partial file, and an old one as it is.

    The same arguments give the same bytes except for the time stamp, which ``SOURCE_DATE_EPOCH``
    sets. Several bodies are the parts of an assembly.

    Parameters
    ----------
    brep : Brep
        Its numbers are written as they are.
    path : str or Path
    labels : ShapeLabels
        Names, colours, layers (one for each material) and mass properties of all bodies.
    unit : str
        The unit the numbers are in; see ``units.UNITS``.
    schema : {"ap203", "ap214", "ap242"}
        AP203 has no place for colours, layers and mass properties.
    pcurves : bool
        Give edges their curves in the parameters of their faces too.
    header : FileHeader, optional
    digits : int
        Significant digits; 17 name every double.
    values : int
        How many numbers are printed at once.
    before_place : callable
        Called with the finished file before it gets its name; an error it raises leaves no file.

    Returns
    -------
    int
        Size of the file in bytes.

    Raises
    ------
    KernelError
        An unknown unit, numbers that no file can hold, or a disk that holds something else.
    FileError
        The file cannot be written.
    """
    header, length = header or FileHeader(), unit_named(unit)
    entities = _entities_of(brep, labels, length, schema, pcurves, header, digits)
    with whole_file(path) as stream:
        checksum = 0
        for piece in _pieces(entities, Path(path).name, schema, header, values):
            stream.write(piece)
            checksum = zlib.crc32(piece, checksum)
        stream.flush()
        size = stream.tell()
        _require_bytes(Path(stream.name), checksum)
        before_place(Path(stream.name))
    return size


def _require_bytes(path: Path, checksum: int) -> None:
    """Reject a file that does not hold the bytes that were written to it."""
    found = 0
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK):
            found = zlib.crc32(block, found)
    if found != checksum:
        raise KernelError(
            "the STEP file, read again, is not what was written",
            hint="nothing was kept; check the disk",
        )


def _entities_of(
    brep: Brep,
    labels: ShapeLabels,
    unit: Unit,
    schema: Schema,
    pcurves: bool,
    header: FileHeader,
    digits: int,
) -> Entities:
    entities = Entities()
    geometry = add_geometry(entities, brep, pcurves=pcurves, digits=digits)
    bodies = add_bodies(entities, brep, geometry, labels)
    tolerances = brep.edge_tolerance, brep.vertex_tolerance
    largest = max(float(each.max(initial=0.0)) for each in tolerances)
    structure = add_structure(entities, bodies, labels, schema, unit, largest, header)
    if schema not in UNPAINTED:
        add_properties(entities, bodies, labels, structure, unit.millimetres)
    return entities


def _pieces(
    entities: Entities, name: str, schema: Schema, header: FileHeader, values: int
) -> Iterator[bytes]:
    """Yield the text of a file."""
    stamp = time.strftime("%Y-%m-%dT%H:%M:%S+00:00", stamp_time())
    yield b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((%s),'2;1');\n" % text_of(header.description)
    yield b"FILE_NAME(%s,%s,(%s),(%s),%s,%s,%s);\n" % tuple(
        map(
            text_of,
            (
                name,
                stamp,
                header.author,
                header.organisation,
                program(),
                program(),
                header.authorisation,
            ),
        )
    )
    yield b"FILE_SCHEMA(('%s'));\nENDSEC;\nDATA;\n" % PROTOCOLS[schema].schema
    yield from entities.pieces(values)
    yield _END
