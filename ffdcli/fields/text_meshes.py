"""What text files of Abaqus, Nastran and Ansys say of their nodes.

meshio reads these formats in part only, and says nothing where it leaves something out. The
functions here return the numbers of all nodes, and refuse what meshio would misread.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.errors import FileError

# Keywords by which Abaqus makes, moves or copies nodes, or reads them from elsewhere.
_ABAQUS_REFUSED = {
    "INCLUDE": "another file is included",
    "NGEN": "nodes are generated",
    "NFILL": "nodes are generated",
    "NCOPY": "nodes are copied",
    "NMAP": "nodes are mapped",
    "SYSTEM": "nodes are in a coordinate system of their own",
    "TRANSFORM": "nodes have directions of their own",
}
_HINT = "write the nodes as a table, x,y,z,tx,ty,tz or x,y,z,dx,dy,dz"


def check_abaqus(file: Path) -> Ints:
    """(n,) numbers of the nodes of an Abaqus input file, in its order.

    Raises
    ------
    FileError
        There are several blocks of nodes, or nodes are made by keywords that meshio ignores.
    """
    ids: list[int] = []
    blocks, inside, instance = 0, False, False
    for number, line in _lines(file):
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            words = [word.strip().upper() for word in line[1:].split(",")]
            inside, instance = words[0] == "NODE", words[0] == "INSTANCE"
            if words[0] in _ABAQUS_REFUSED:
                raise _fault(file, number, f"{_ABAQUS_REFUSED[words[0]]} (*{words[0]})")
            if inside:
                blocks += 1
                other = [w for w in words[1:] if w and not w.startswith("NSET")]
                if other:
                    raise _fault(file, number, f"*NODE with {other[0]} is not read")
            if blocks > 1:
                raise _fault(file, number, "a second block *NODE begins; only one is read")
        elif instance and line.strip():
            raise _fault(file, number, "an instance is moved, which is not read")
        elif inside and line.strip():
            ids.append(_integer(file, number, line.split(",")[0]))
    return _distinct(file, ids)


def check_nastran(file: Path) -> Ints:
    """(n,) numbers of the nodes of a Nastran bulk data file, in its order.

    Raises
    ------
    FileError
        Another file is included, or nodes are in a coordinate system of their own.
    """
    ids: list[int] = []
    for number, line in _lines(file):
        word = line[:8].split(",")[0].strip().upper().rstrip("*")
        if word == "INCLUDE":
            raise _fault(file, number, "another file is included (INCLUDE)")
        if word == "GRDSET":
            raise _fault(file, number, "nodes have defaults of their own (GRDSET)")
        if word != "GRID":
            continue
        wide = 16 if line[:8].split(",")[0].strip().endswith("*") else 8
        if "," in line:
            fields = line.split(",")[1:3]
        else:
            fields = [line[8 + k * wide : 8 + (k + 1) * wide] for k in (0, 1)]
        ids.append(_integer(file, number, fields[0]))
        if len(fields) > 1 and fields[1].strip() not in ("", "0"):
            message = f"node {ids[-1]} is in the coordinate system {fields[1].strip()}"
            raise _fault(file, number, f"{message}, which is not read")
    return _distinct(file, ids)


def check_ansys(file: Path) -> Ints:
    """(n,) numbers of the nodes that an Ansys Fluent mesh file declares.

    Raises
    ------
    FileError
        The file is one of Gmsh, or declares no nodes.
    """
    with file.open("rb") as stream:
        start = stream.read(1 << 16)
    if start.lstrip().startswith(b"$"):
        message = "this is a file of Gmsh, not of Ansys Fluent"
        raise FileError(message, file=str(file), hint="write it as .vtu, with `meshio convert`")
    # (10 (0 first last type)): the declaration of all nodes.
    found = re.search(rb"\(\s*10\s*\(\s*0\s+([0-9a-fA-F]{1,9})\s+([0-9a-fA-F]{1,9})\b", start)
    if found is None:
        message = "it does not declare its nodes: no section (10 (0 ...)) is near its beginning"
        raise FileError(message, file=str(file), hint=_HINT)
    first, last = int(found[1], 16), int(found[2], 16)
    if not 0 <= last - first < 1 << 28:
        raise FileError(f"it declares nodes {first} to {last}", file=str(file), hint=_HINT)
    return np.arange(first, last + 1)


def _lines(file: Path) -> Iterator[tuple[int, str]]:
    """Numbers and text of the lines of a file."""
    with file.open(encoding="utf-8", errors="replace") as stream:
        yield from enumerate(stream, start=1)


def _integer(file: Path, number: int, text: str) -> int:
    if not text.strip().isdecimal() or len(text.strip()) > 18:
        raise _fault(file, number, f"{text.strip()[:40]!r} is no number of a node")
    return int(text)


def _distinct(file: Path, ids: list[int]) -> Ints:
    values = np.array(ids, dtype=np.int64)
    unique, counts = np.unique(values, return_counts=True)
    if (counts > 1).any():
        message = f"node {unique[counts > 1][0]} is given twice"
        raise FileError(message, file=str(file), hint="number the nodes anew")
    return values


def _fault(file: Path, number: int, message: str) -> FileError:
    return FileError(message, file=str(file), line=number, hint=_HINT)
