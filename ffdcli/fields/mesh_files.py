"""Fields in mesh files with results, which meshio reads in a process of its own."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import FileError
from ffdcli.fields.formats import MESH_FORMATS
from ffdcli.fields.record import MAX_POINTS, Field, checked_field
from ffdcli.fields.table import read_table
from ffdcli.files import require_file

# Formats that hold nodes and elements, and no results.
_WITHOUT_RESULTS = {"abaqus": "Abaqus", "ansys": "Ansys", "nastran": "Nastran"}
# Bytes of memory, and seconds of processor time: for any file, and for each of its bytes. XDMF may
# have a gigabyte in a file beside it.
_MEMORY, _MEMORY_PER_BYTE = 1 << 30, 60
_BESIDE = {"xdmf": 3 << 30}
_SECONDS, _BYTES_PER_SECOND = 10, 100_000
# Columns of a table that gives nodes by their numbers.
_NODE_TABLES = (("node", "dx", "dy", "dz"), ("node", "tx", "ty", "tz"))
_HINT = "write the result as .vtu, or as a table x,y,z,dx,dy,dz in a .csv file"


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Nodes of a file, with a field of vectors if there is one."""

    points: Floats
    ids: Ints
    values: Floats | None
    name: str | None
    cells: str
    notes: tuple[str, ...]


def read_mesh_field(
    file: Path, *, name: str | None = None, targets: Path | None = None, most: int = MAX_POINTS
) -> Field:
    """The displacement field of a mesh file, or the way from its nodes to those of another file.

    Parameters
    ----------
    file : Path
        VTU, VTK (legacy), XDMF, Abaqus, Ansys Fluent or Nastran, by the extension.
    name : str, optional
        Name of the field. By default the only one of three numbers for each node.
    targets : Path, optional
        Another file of the same format, with the same nodes and elements, the nodes moved; or a
        .csv table ``node,dx,dy,dz`` or ``node,tx,ty,tz``, by the numbers of nodes.
    most : int
        Largest number of nodes.

    Raises
    ------
    FileError
        meshio is missing or cannot read the file, the field is not there or there are several, or
        the files have other nodes.
    """
    form = MESH_FORMATS[file.suffix.lower()]
    if targets is not None:
        pair = _by_number if targets.suffix.lower() == ".csv" else _pair
        return pair(_read(file, form, "", most), file, targets, most)
    hint = (
        "give as `targets` the deformed mesh with the same nodes, or a table node,dx,dy,dz; or the "
        "result as .vtu"
    )
    if form in _WITHOUT_RESULTS:
        what = f"{_WITHOUT_RESULTS[form]} files hold nodes and elements, and no displacements"
        raise FileError(what, file=str(file), hint=hint)
    nodes = _read(file, form, name, most)
    if nodes.values is None:
        what = "it holds no field of three numbers for each node"
        raise FileError(what, file=str(file), hint=hint)
    return checked_field(
        file,
        nodes.points,
        nodes.values,
        by=True,
        name=nodes.name,
        notes=nodes.notes,
        what="node",
        most=most,
    )


def _pair(nodes: _Nodes, file: Path, targets: Path, most: int) -> Field:
    """The field from the nodes of one file to those of another."""
    if targets.suffix.lower() != file.suffix.lower():
        message = f"`{file.name}` and `{targets.name}` are of different formats"
        hint = "the number of a node means the same in files of one format only"
        raise FileError(message, file=str(targets), hint=hint)
    moved = _read(targets, MESH_FORMATS[targets.suffix.lower()], "", most)
    what = None
    if len(nodes.points) != len(moved.points):
        what = f"it has {len(moved.points):,} nodes, and `{file.name}` has {len(nodes.points):,}"
    elif not np.array_equal(nodes.ids, moved.ids):
        what = f"its nodes are numbered otherwise than those of `{file.name}`"
    elif nodes.cells != moved.cells:
        what = f"it has other elements than `{file.name}`"
    if what is not None:
        hint = "give the same mesh twice, before and after"
        raise FileError(what, file=str(targets), hint=hint)
    return checked_field(
        file,
        nodes.points,
        moved.points,
        by=False,
        notes=nodes.notes + moved.notes,
        what="node",
        most=most,
    )


def _by_number(nodes: _Nodes, file: Path, table: Path, most: int) -> Field:
    """The field of a table with a row for each number of a node."""

    def fault(message: str, hint: str) -> FileError:
        return FileError(message, file=str(table), hint=hint)

    if not len(nodes.ids):
        message = f"`{file.name}` does not number its nodes"
        raise fault(message, "give a table x,y,z,dx,dy,dz in place of both")
    header, rows = read_table(table, _NODE_TABLES, most=most, need_header=True)
    order = np.argsort(nodes.ids)
    place = np.searchsorted(nodes.ids, rows[:, 0], sorter=order).clip(max=len(order) - 1)
    which = order[place]
    strange = np.flatnonzero(nodes.ids[which] != rows[:, 0])
    if len(strange):
        message = f"row {strange[0] + 1} is for node {rows[strange[0], 0]:.15g}"
        raise fault(f"{message}, which `{file.name}` does not have", "compare the two files")
    numbers, uses = np.unique(rows[:, 0], return_counts=True)
    if (uses > 1).any():
        message = f"node {numbers[uses > 1][0]:.15g} is given twice"
        raise fault(message, "give one row for each node")
    missing = len(nodes.ids) - len(rows)
    notes = (f"`{table.name}` moves {len(rows):,} nodes; {missing:,} others are left out",)
    return checked_field(
        table,
        nodes.points[which],
        rows[:, 1:],
        by=header == _NODE_TABLES[0],
        notes=nodes.notes + notes * (missing > 0),
        what="row",
        most=most,
    )


def _read(file: Path, form: str, name: str | None, most: int) -> _Nodes:
    """The nodes of a file, and its field; see :func:`.mesh_contents.read_contents`."""
    require_file(file)
    if find_spec("meshio") is None:
        message = f"{file.suffix} files need the package meshio"
        hint = "install it with `python -m pip install 'ffdcli[fields]'`"
        raise FileError(message, file=str(file), hint=hint)
    size = file.stat().st_size
    request = {
        "file": str(file),
        "format": form,
        "name": name,
        "most": most,
        "memory": _MEMORY + _BESIDE.get(form, 0) + _MEMORY_PER_BYTE * size,
        "seconds": _SECONDS + size // _BYTES_PER_SECOND,
    }
    arrays = _ask(file, request)
    facts: dict[str, Any] = json.loads(arrays["header"].tobytes())
    if "message" in facts:
        hint = facts["hint"] or _HINT
        raise FileError(facts["message"], file=str(file), line=facts.get("line"), hint=hint)
    notes = tuple(facts["notes"])
    values = arrays.get("values")
    return _Nodes(arrays["points"], arrays["ids"], values, facts["name"], facts["cells"], notes)


def _ask(file: Path, request: dict[str, Any]) -> dict[str, Any]:
    """The arrays that the other process writes for a request."""
    # -P: do not import modules from the current folder.
    command = [sys.executable, "-P", "-m", "ffdcli.fields.mesh_process", json.dumps(request)]
    seconds = request["seconds"]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            # A busy machine may take many times as long as the processor does.
            timeout=60 + 20 * seconds,
            # Ctrl-C goes to this process, which ends the other.
            process_group=0,
            check=False,
        )
    except subprocess.TimeoutExpired:
        done = None
    if done is None or done.returncode != 0 or not done.stdout:
        megabytes = request["memory"] >> 20
        message = f"meshio does not read it within {seconds} s and {megabytes:,} MiB of memory"
        raise FileError(message, file=str(file), hint=f"the file may be damaged; {_HINT}")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as found:
        return {name: found[name] for name in found.files}
