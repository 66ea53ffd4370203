"""Packed arrays of glTF files, unpacked by the libraries of their formats where installed."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffdcli.mesh.io.gltf.entries import Entry, Unreadable


def decode_meshopt(packed: Entry, data: memoryview, count: int, stride: int) -> memoryview:
    """The bytes of a view that ``EXT_meshopt_compression`` packs.

    Parameters
    ----------
    packed : Entry
        What the extension says of the view.
    data : memoryview
    count, stride : int
        Of the unpacked array: rows, and bytes of each.

    Raises
    ------
    Unreadable
        meshoptimizer is not installed, or the data are damaged.
    """
    library = _load("meshoptimizer", "meshoptimizer", "meshopt", packed)
    mode, filtering = packed.text("mode"), packed.text("filter") or "NONE"
    try:
        if mode == "ATTRIBUTES":
            table = library.decode_vertex_buffer(count, stride, bytes(data))
            rows = np.ascontiguousarray(table).view(np.uint8).reshape(-1)
            if filtering == "EXPONENTIAL":
                rows = library.decode_filter_exp(rows, count, stride)
            elif filtering == "OCTAHEDRAL":
                rows = library.decode_filter_oct(rows, count, stride)
            elif filtering == "QUATERNION":
                rows = library.decode_filter_quat(rows, count, stride)
            elif filtering != "NONE":
                packed.reject("filter", "a filter that is known here")
            return memoryview(rows.tobytes())
        if stride not in (2, 4):
            packed.reject("byteStride", "2 or 4")
        # The library checks whole triangles, and always makes integers of four bytes.
        if mode == "TRIANGLES":
            numbers = library.decode_index_buffer(count, 4, bytes(data))
        elif mode == "INDICES":
            numbers = library.decode_index_sequence(count, 4, bytes(data))
        else:
            packed.reject("mode", "ATTRIBUTES, TRIANGLES or INDICES")
    except (ValueError, RuntimeError) as error:
        if isinstance(error, Unreadable):
            raise
        raise Unreadable(f"{packed.place} is damaged: {error}") from error
    return memoryview(numbers.astype(f"<u{stride}").tobytes())


def decode_draco(packed: Entry, data: memoryview) -> tuple[NDArray[Any], dict[str, NDArray[Any]]]:
    """Triangles (T, 3) and attributes (V, width) that ``KHR_draco_mesh_compression`` packs.

    Raises
    ------
    Unreadable
        DracoPy is not installed, or the data are damaged.
    """
    library = _load("DracoPy", "DracoPy", "draco", packed)
    try:
        mesh = library.decode(bytes(data))
        faces = np.asarray(mesh.faces)
        numbers = packed.entry("attributes")
        found = {
            name: mesh.get_attribute_by_unique_id(numbers.whole(name)) for name in numbers.values
        }
    except Unreadable:
        raise
    except Exception as error:  # of damaged data the library raises what it likes
        raise Unreadable(f"{packed.place} is damaged: {error}") from error
    if any(each is None for each in found.values()):
        raise Unreadable(f"{packed.place} names an attribute that its data do not have")
    return faces, {name: np.asarray(each["data"]) for name, each in found.items()}


def _load(module: str, package: str, extra: str, packed: Entry) -> Any:
    """A library that unpacks, by its module."""
    name = packed.place.rpartition(".")[2]
    try:
        return importlib.import_module(module)
    except ImportError:
        raise Unreadable(
            f"it is packed by {name}, which {package} unpacks: it is not installed",
            f"pip install 'ffdcli[{extra}]', or export the file without compression",
        ) from None
