"""VTU and XDMF files: what meshio would leave out, and data that lie in other files."""

from __future__ import annotations

import re
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.errors import FileError
from ffdcli.files import fault_of
from ffdcli.messages import counted

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# Most bytes of all arrays in HDF5 files.
_MOST_BYTES = 1 << 30
_NO_LZ4 = "write it with the compressor ZLib, or with none"
_ONE_GRID = "write one grid, or a .vtu file"
_POINT_DATA = re.compile(rb"<PointData\b[^>]*?(?:/>|>(.*?)</PointData>)", re.DOTALL)
_ARRAY_NAME = re.compile(rb"<DataArray\b[^>]*?\bName=\"([^\"]*)\"")

# Points, arrays at nodes, arrays of elements, elements and notes of a file.
Read = tuple[Any, dict[str, Any], dict[str, Any], Any, tuple[str, ...]]


def check_vtu(file: Path) -> Ints:
    """No numbers of nodes, of which VTU has none; refuses what meshio reads in part only.

    Raises
    ------
    FileError
        The compressor is one that meshio lacks, a name stands for two arrays, or pieces of the
        grid have different arrays.
    """
    content = file.read_bytes()
    if b"vtkLZ4DataCompressor" in content[:1000]:
        message = "it is compressed with LZ4, which meshio does not read"
        raise FileError(message, file=str(file), hint=_NO_LZ4)
    pieces = [_ARRAY_NAME.findall(each) for each in _POINT_DATA.findall(content)]
    for names in pieces:
        for name in names:
            shown = name.decode(errors="replace")[:60]
            if names.count(name) > 1:
                message = f"two arrays at nodes have the name `{shown}`, for two times perhaps"
                raise FileError(message, file=str(file), hint="write a file of one time step")
        if sorted(names) != sorted(pieces[0]):
            message = "the pieces of its grid have different arrays at nodes"
            raise FileError(message, file=str(file), hint="write the grid as one piece")
    return np.zeros(0, dtype=np.int64)


def read_xdmf(file: Path) -> Read:
    """Nodes, fields and elements of an XDMF file: of one grid, or of the last of several times.

    Raises
    ------
    FileError
        h5py is missing, data lie in a file elsewhere, or there are several grids.
    """
    try:
        import h5py  # noqa: F401
    except ImportError:
        hint = "install it with `python -m pip install 'ffdcli[fields]'`"
        raise FileError("XDMF needs the package h5py", file=str(file), hint=hint) from None
    from meshio.xdmf import TimeSeriesReader
    from meshio.xdmf.main import XdmfReader

    root = ElementTree.parse(file).getroot()
    total = sum(_data_bytes(file, item) for item in root.iter("DataItem"))
    if total > _MOST_BYTES:
        message = f"its arrays take {total >> 20:,} MiB; {_MOST_BYTES >> 20:,} MiB are allowed"
        raise FileError(message, file=str(file), hint="write the displacements alone")
    grids = root.findall("./Domain/*")
    series = [grid for grid in grids if grid.get("GridType") == "Collection"]
    if series:
        _check_series(file, grids, series)
        with TimeSeriesReader(file) as reader:
            points, cells = reader.read_points_cells()
            last = reader.num_steps - 1
            time, data, cell_data = reader.read_data(last)
        steps = counted(last + 1, "time step", "time steps")
        return points, data, cell_data, cells, (f"the last of {steps} is taken, at {time:g}",)
    for grid in grids:
        # A time of a grid alone says nothing more, and meshio stops at it.
        for time in grid.findall("Time"):
            grid.remove(time)
    reader = XdmfReader(str(file))
    second = root.get("Version", "3").startswith("2")
    mesh = reader.read_xdmf2(root) if second else reader.read_xdmf3(root)
    return mesh.points, mesh.point_data, mesh.cell_data, mesh.cells, ()


def _check_series(file: Path, grids: list[Element], series: list[Element]) -> None:
    """Refuse what a series of times may hold besides one grid that stays."""
    steps = list(series[0])
    uniform = [grid for grid in grids if grid.get("GridType") == "Uniform"]
    if len(series) > 1 or len(uniform) > 1 or len(grids) > len(series) + len(uniform) or not steps:
        raise FileError("it holds several grids", file=str(file), hint=_ONE_GRID)
    first = uniform[0] if uniform else steps[0]
    own = [step for step in steps if step is not first and step.findall("Geometry")]
    nodes = {_words(step.find("Geometry")) for step in (first, *own)}
    if len(nodes) > 1:
        raise FileError("its nodes are other ones at each time", file=str(file), hint=_ONE_GRID)


def _words(element: Element | None) -> tuple[str, ...]:
    return () if element is None else tuple("".join(element.itertext()).split())


def _data_bytes(file: Path, item: Element) -> int:
    """Bytes of an array in a file beside it; refuses files elsewhere, and of other formats."""
    form = item.get("Format", "XML" if item.get("Reference") else "")
    if form == "XML":
        return 0
    if form != "HDF":
        message = f"it holds data of the format {form[:40]!r}; read are XML and HDF"
        raise FileError(message, file=str(file), hint="write it with the format HDF or XML")
    name, colon, place = (item.text or "").strip().partition(":")
    beside = Path(name).name == name and name not in ("", ".", "..") and "\\" not in name
    if not beside or not colon:
        message = f"its data lie in {name[:80]!r}, and are read only from a file beside it"
        raise FileError(message, file=str(file), hint="put the HDF5 file into the same folder")
    other = file.resolve().parent / name
    fault = "this is a link" if other.is_symlink() else fault_of(other)
    if fault is not None:
        message = f"its data lie in {name[:80]!r}: {fault}"
        raise FileError(message, file=str(file), hint="put the HDF5 file into the same folder")
    return _dataset_bytes(file, other, place, item.get("Dimensions", ""))


def _dataset_bytes(file: Path, other: Path, place: str, stated: str) -> int:
    """Bytes of an array of an HDF5 file; refuses what lies elsewhere or is no array of numbers."""
    import h5py

    def fault(message: str) -> FileError:
        text = f"its data `{place[:60]}` in {other.name!r}: {message}"
        return FileError(text, file=str(file), hint="write the file anew")

    with h5py.File(other, "r") as found:
        for part in place.strip("/").split("/"):
            if not isinstance(found, h5py.Group) or found.get(part, getlink=True) is None:
                raise fault("there is no such array")
            if not isinstance(found.get(part, getlink=True), h5py.HardLink):
                raise fault("this is a link to another place")
            found = found[part]
        if not isinstance(found, h5py.Dataset) or found.dtype.kind not in "fiu":
            raise fault("this is no array of numbers")
        if found.external or found.is_virtual:
            raise fault("its numbers lie in another file")
        count = prod(found.shape)
        if count != prod(int(length) for length in stated.split()):
            raise fault(f"it has the shape {found.shape}, and should have {stated!r}")
        return int(count * found.dtype.itemsize)
