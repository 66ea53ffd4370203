"""Arrays of a glTF file: accessors, checked against the bytes that are there before any is made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Floats
from ffdcli.mesh.io.gltf.buffers import load_buffer
from ffdcli.mesh.io.gltf.compression import decode_meshopt
from ffdcli.mesh.io.gltf.container import MESHOPT, requires
from ffdcli.mesh.io.gltf.entries import Entry, Unreadable

# Component types of the standard (table in 3.6.2.2), little-endian.
_KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_INDEX_KINDS = ("<u1", "<u2", "<u4")
# Most values of an accessor that are nowhere stored, and so are 0 (3.6.2.3).
_MOST_ZEROS = 10_000_000
# Most bytes of all arrays: what the stored bytes may swell to, and what small files may take.
_SWELLING, _SMALL = 32, 2**27


class Arrays:
    """The arrays of a file, each read once."""

    def __init__(self, root: Entry, binary: memoryview | None, path: Path) -> None:
        self._root, self._binary, self._path = root, binary, path
        self._accessors = root.entries("accessors")
        self._views = root.entries("bufferViews")
        self._buffers = root.entries("buffers")
        self._loaded: dict[int, memoryview] = {}
        self._viewed: dict[int, memoryview] = {}
        self._read: dict[int, NDArray[Any]] = {}
        self._stored = self._made = 0

    def accessor(self, owner: Entry, key: str) -> Entry | None:
        """The accessor that an entry names."""
        number = owner.index(key, len(self._accessors))
        return None if number is None else self._accessors[number]

    def has_data(self, accessor: Entry) -> bool:
        """Whether any value of an accessor is stored."""
        return "bufferView" in accessor or "sparse" in accessor

    def values(self, owner: Entry, key: str, *types: str) -> NDArray[Any] | None:
        """(n, width) numbers of the accessor that an entry names, as stored; None if it names none.

        Sparse values are put in; normalised integers stay integers.

        Raises
        ------
        Unreadable
            They are not of one of these types, damaged, or not there.
        """
        number = owner.index(key, len(self._accessors))
        if number is None:
            return None
        accessor = self._accessors[number]
        if accessor.values.get("type") not in types:
            accessor.reject("type", " or ".join(types))
        if number not in self._read:
            self._read[number] = self._read_accessor(accessor)
        return self._read[number]

    def view(self, owner: Entry) -> memoryview:
        """The bytes of the view that an entry names."""
        number = owner.index("bufferView", len(self._views))
        if number is None:
            owner.reject("bufferView", "the number of a view")
        if number not in self._viewed:
            view = self._views[number]
            packed = view.extension(*MESHOPT)
            if packed is not None and self._is_needed(view):
                count, stride = packed.whole("count"), packed.whole("byteStride")
                content = self._range(packed)
                self.make(packed, count * stride)
                self._viewed[number] = decode_meshopt(packed, content, count, stride)
            else:
                self._viewed[number] = self._range(view)
        return self._viewed[number]

    def _is_needed(self, view: Entry) -> bool:
        """Whether the bytes of a view are stored only packed."""
        number = view.index("buffer", len(self._buffers))
        return (
            requires(self._root, *MESHOPT)
            or number is None
            or self._buffers[number].extension(*MESHOPT) is not None
        )

    def _range(self, owner: Entry) -> memoryview:
        """The bytes of a buffer that an entry names by their place and length."""
        number = owner.index("buffer", len(self._buffers))
        if number is None:
            owner.reject("buffer", "the number of a buffer")
        if number not in self._loaded:
            # Only the first buffer can be in the binary part.
            binary = self._binary if number == 0 else None
            self._loaded[number] = load_buffer(self._buffers[number], binary, self._path)
            self._stored += len(self._loaded[number])
        found = self._loaded[number]
        at, length = owner.whole("byteOffset", 0), owner.whole("byteLength")
        if at + length > len(found):
            raise Unreadable(
                f"{owner.place} takes bytes {at} to {at + length} of a buffer of {len(found)}"
            )
        return found[at : at + length]

    def make(self, owner: Entry, size: int) -> None:
        """Count the bytes of an array that is to be made; raise Unreadable if they are too many."""
        self._made += size
        most = _SMALL + _SWELLING * self._stored
        if self._made > most:
            raise Unreadable(
                f"{owner.place}: arrays of {self._made} bytes are promised, "
                f"but the file stores {self._stored}"
            )

    def _read_accessor(self, accessor: Entry) -> NDArray[Any]:
        kind, width = _kind(accessor), _WIDTHS[accessor.values["type"]]
        count = accessor.whole("count")
        if "bufferView" in accessor:
            found = self._rows(accessor, kind, width, count)
        else:
            if count * width > _MOST_ZEROS:
                raise Unreadable(
                    f"{accessor.place} promises {count} values, but does not say where they are"
                )
            self.make(accessor, count * width * kind.itemsize)
            found = np.zeros((count, width), kind)
        if "sparse" not in accessor:
            return found
        sparse = accessor.entry("sparse")
        few = sparse.whole("count", most=count)
        place, value = sparse.entry("indices"), sparse.entry("values")
        at = self._rows(place, _kind(place, _INDEX_KINDS), 1, few)[:, 0].astype(np.int64)
        if few and ((np.diff(at) <= 0).any() or at[-1] >= count):
            raise Unreadable(f"{place.place} are not rising numbers below {count}")
        found = found.copy()
        found[at] = self._rows(value, kind, width, few)
        return found

    def _rows(self, owner: Entry, kind: np.dtype[Any], width: int, count: int) -> NDArray[Any]:
        """(count, width) numbers of the view that an entry names."""
        view, at = self.view(owner), owner.whole("byteOffset", 0)
        size = width * kind.itemsize
        stride = self._views[owner.whole("bufferView")].whole("byteStride", size)
        if stride < size:
            raise Unreadable(f"{owner.place}: a stride of {stride} is less than {size} bytes")
        if count and at + (count - 1) * stride + size > len(view):
            raise Unreadable(
                f"{owner.place} promises {count} values of {size} bytes from byte {at} on, "
                f"but the bytes are {len(view)}"
            )
        self.make(owner, count * size)
        strides = (stride, kind.itemsize)
        return np.ndarray((count, width), kind, view, at if count else 0, strides).copy()


def promised_shape(accessor: Entry) -> tuple[int, int]:
    """Number of entries of an accessor, and numbers of each."""
    return accessor.whole("count"), _WIDTHS.get(accessor.text("type"), 0)


def to_floats(stored: NDArray[Any], accessor: Entry) -> Floats:
    """Numbers of an accessor; normalised integers go from -1 or 0 to 1 (3.11 of the standard)."""
    with np.errstate(invalid="ignore"):  # what is not a number is rejected later, by vertex
        found = stored.astype(np.float64)
    if accessor.values.get("normalized") is not True or stored.dtype.kind == "f":
        return found
    return np.maximum(found / np.iinfo(stored.dtype).max, -1.0)


def _kind(owner: Entry, among: tuple[str, ...] = tuple(_KINDS.values())) -> np.dtype[Any]:
    kind = _KINDS.get(owner.whole("componentType"))
    if kind not in among:
        owner.reject("componentType", "the number of a type that is possible here")
    return np.dtype(kind)
