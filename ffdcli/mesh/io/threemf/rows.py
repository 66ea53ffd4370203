"""Vertices and triangles of a 3MF object: attributes of XML elements, converted in batches."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.io.text_numbers import count_decimals
from ffdcli.mesh.io.threemf.package import Package, quote

# Texts that are converted at once: bounds the memory that they take.
_BATCH = 3 * 2**16
# Decimals of no number at all.
FEWEST_DECIMALS = -400


class _Rows:
    """Three attributes of each element, as numbers of one type."""

    names = ("", "", "")
    kind: type[np.float64] | type[np.int64]
    # Most characters of a number.
    longest = 0
    fault = ""

    def __init__(self, package: Package, words: str) -> None:
        self.words = words
        self._package = package
        self._texts: list[str] = []
        self._batches: list[NDArray[Any]] = []
        self.decimals = FEWEST_DECIMALS

    def add(self, attributes: Mapping[str, str]) -> None:
        """Take the attributes of the next element."""
        get = attributes.get
        first, second, third = self.names
        self._texts += (get(first, ""), get(second, ""), get(third, ""))
        if len(self._texts) >= _BATCH:
            self._convert()

    def _rows(self) -> NDArray[Any]:
        self._convert()
        return np.concatenate(self._batches) if self._batches else np.empty((0, 3), self.kind)

    def _convert(self) -> None:
        texts, self._texts = self._texts, []
        if not texts:
            return
        try:
            numbers = self._numbers(texts)
        except ValueError:
            at = next((n for n, text in enumerate(texts) if not self._is_number(text)), 0)
            number = sum(map(len, self._batches)) + at // 3
            self._package.refuse(
                f"{self.fault.format(number)} of {self.words} (counted from 0) is no number that "
                f"can be read: {quote(texts[at])}"
            )
        self._batches.append(numbers.reshape(-1, 3))

    def _numbers(self, texts: list[str]) -> NDArray[Any]:
        if max(map(len, texts)) > self.longest:
            raise ValueError
        tokens = np.array(texts, dtype=np.bytes_)
        numbers = tokens.astype(self.kind)
        self.decimals = max(self.decimals, count_decimals(tokens))
        return numbers

    def _is_number(self, text: str) -> bool:
        try:
            self._numbers([text])
        except ValueError:
            return False
        return True


class VertexRows(_Rows):
    """Coordinates, correctly rounded."""

    names, kind, longest = ("x", "y", "z"), np.float64, 400
    fault = "a coordinate of vertex {}"

    def table(self) -> Floats:
        """(V, 3) float64 coordinates."""
        return self._rows()


class TriangleRows(_Rows):
    """Vertices of triangles, and the properties that they state."""

    names, kind, longest = ("v1", "v2", "v3"), np.int64, 18
    fault = "a corner of triangle {}"

    def __init__(self, package: Package, words: str) -> None:
        super().__init__(package, words)
        self._paint: list[int] = []
        # Number of each pair of property group and index, as stated.
        self.paints: dict[tuple[str | None, str | None], int] = {}

    def add(self, attributes: Mapping[str, str]) -> None:
        """Take the attributes of the next triangle."""
        paint = attributes.get("pid"), attributes.get("p1")
        self._paint.append(self.paints.setdefault(paint, len(self.paints)))
        super().add(attributes)

    def table(self, vertices: int) -> Ints:
        """(T, 3) int64 corners.

        Raises
        ------
        FileError
            A corner is none of the vertices.
        """
        corners = self._rows()
        beyond = np.argwhere((corners < 0) | (corners >= vertices))
        if len(beyond):
            triangle, corner = beyond[0].tolist()
            self._package.refuse(
                f"triangle {triangle} of {self.words} refers to vertex "
                f"{corners[triangle, corner]}, of {vertices} (counted from 0)"
            )
        return corners

    def paint(self) -> Ints:
        """(T,) number in `paints` of each triangle's properties."""
        return np.array(self._paint, dtype=np.int64)
