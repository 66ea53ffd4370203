"""Parts of a file and their places in the world, joined to one mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ffdcli.arrays import Floats, Ints, run_numbers, run_starts
from ffdcli.errors import FileError
from ffdcli.labels import Labels, Material, number_names
from ffdcli.mesh.io.raw_mesh import RawMesh, binary_resolution, text_resolution

# Most triangles that copies may add to those that the file stores.
MOST_COPIED = 1_000_000
_PRINTABLE_NAME = 60


@dataclass(frozen=True)
class PlacedPart:
    """Triangles in coordinates of their own, and the places where the file puts them.

    Parameters
    ----------
    number : int
        Number of what is placed: an item, a node. Parts with one number belong to one body.
    name : str
        Its name as the file states it; empty for none.
    vertices : (V, 3) float64, part's own length
    triangles : (T, 3) int64
    resolution : float, part's own length
        Smallest distance that the number format of the vertices resolves.
    transforms : (n, 4, 4) float64
        A place for each copy: to world coordinates, applied to columns (x, y, z, 1).
    material : (T,) or (1,) int64
        Number of the material of each triangle, or of all; -1 for none.
    uv : (V, 2) float64 or None
        Texture coordinates of the vertices, v upwards.
    """

    number: int
    name: str
    vertices: Floats
    triangles: Ints
    resolution: float = 0.0
    transforms: Floats = field(default_factory=lambda: np.eye(4)[None])
    material: Ints = field(default_factory=lambda: np.full(1, -1))
    uv: Floats | None = None


def join_parts(
    parts: Sequence[PlacedPart],
    source: Path,
    *,
    materials: tuple[Material, ...] | None = (),
    unit: str | None = None,
    notes: tuple[str, ...] = (),
    decimals: int | None = None,
) -> RawMesh:
    """All copies of all parts in world coordinates, as one mesh.

    Triangles of mirrored copies are turned round, so that they face outwards again.

    Parameters
    ----------
    materials : tuple of Material or None
        None for formats whose names of bodies and materials are not read.
    unit : str, optional
        Unit of world coordinates.
    decimals : int, optional
        Most decimals printed for any coordinate, for text formats; instead of resolutions.

    Raises
    ------
    FileError
        A place is not finite, or the copies are too many.
    """
    parts = [part for part in parts if len(part.triangles) and len(part.transforms)]
    _check(parts, source)
    if not parts:
        none = np.zeros(0, dtype=np.int64)
        return RawMesh(np.empty((0, 3)), none, run_starts(none), 0.0, unit=unit, notes=notes)
    placed = [_place(part) for part in parts]
    vertices = np.concatenate([points for points, *_ in placed])
    triangles = run_starts(np.array([len(corners) // 3 for _, corners, *_ in placed]))
    first = run_starts(np.array([len(points) for points, *_ in placed]))
    corners = np.concatenate([c + at for (_, c, *_), at in zip(placed, first, strict=False)])
    resolution = max(step for *_, step in placed)
    if decimals is not None:
        stretch = max(_stretch(part.transforms).max() for part in parts)
        resolution = text_resolution(vertices, decimals, float(stretch))
    return RawMesh(
        vertices,
        corners,
        3 * np.arange(triangles[-1] + 1),
        resolution,
        unit=unit,
        notes=notes,
        groups=_groups(parts, triangles),
        labels=None if materials is None else _labels(parts, triangles, materials),
        uv=_join_uv(parts, triangles, [uv for _, _, uv, _ in placed]),
        part=_copies(parts),
    )


def _check(parts: list[PlacedPart], source: Path) -> None:
    """Reject places that are no places, and copies without measure, before any is made."""
    for part in parts:
        wrong = np.flatnonzero(~np.isfinite(part.transforms).all(axis=(1, 2)))
        if len(wrong):
            name = part.name[:_PRINTABLE_NAME]
            raise FileError(
                f"a place of part {name or part.number!r} has a number that is not finite",
                file=str(source),
                hint="export the file again",
            )
    stored = sum({id(part.triangles): len(part.triangles) for part in parts}.values())
    count = sum(len(part.triangles) * len(part.transforms) for part in parts)
    if count - stored > MOST_COPIED:
        raise FileError(
            f"the file has {stored} triangles and places copies of them, {count} in all",
            file=str(source),
            hint="export fewer copies",
        )


def _place(part: PlacedPart) -> tuple[Floats, Ints, Floats | None, float]:
    """Vertices (nV, 3), corners (3nT,), their texture coordinates (3nT, 2), and resolution."""
    count, size = len(part.transforms), len(part.vertices)
    if np.array_equal(part.transforms, np.eye(4)[None]):
        uv = None if part.uv is None else part.uv[part.triangles.ravel()]
        return part.vertices, part.triangles.ravel(), uv, part.resolution
    # Sums term by term round equal vertices alike, wherever they stand in an array; a product of
    # matrices need not. 0 * nan and overflow: the vertex is rejected later, by number.
    with np.errstate(invalid="ignore", over="ignore"):
        linear = part.transforms[:, None, :3, :3]
        x, y, z = (part.vertices[None, :, axis, None] for axis in range(3))
        vertices = x * linear[..., 0] + y * linear[..., 1] + z * linear[..., 2]
        vertices = (vertices + part.transforms[:, None, :3, 3]).reshape(-1, 3)
        resolution = max(
            part.resolution * float(_stretch(part.transforms).max()),
            binary_resolution(vertices, np.float64),
        )
        mirrored = np.linalg.slogdet(part.transforms[:, :3, :3])[0] < 0
    corners = np.where(mirrored[:, None, None], part.triangles[:, ::-1], part.triangles)
    uv = None if part.uv is None else part.uv[corners.ravel()]
    corners = corners + size * np.arange(count)[:, None, None]
    return vertices, corners.ravel(), uv, resolution


def _stretch(transforms: Floats) -> Floats:
    """(n,) largest factor by which each transform lengthens; infinite for huge ones."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.linalg.norm(transforms[:, :3, :3], 2, axis=(1, 2))


def _copies(parts: list[PlacedPart]) -> Ints:
    """(V,) number of the copy of the same thing that each vertex belongs to."""
    keys = [(part.number, copy) for part in parts for copy in range(len(part.transforms))]
    known: dict[tuple[int, int], int] = {}
    number = np.array([known.setdefault(key, len(known)) for key in keys], dtype=np.int64)
    sizes = [len(part.vertices) for part in parts for _ in range(len(part.transforms))]
    return np.repeat(number, sizes)


def _groups(parts: list[PlacedPart], triangles: Ints) -> dict[str, Ints]:
    """Triangles of each named thing; of several things those without a name go by number."""
    known, number = number_names([part.name or str(part.number) for part in parts])
    if len(known) == 1:
        return {}
    group = number[run_numbers(triangles)]
    order = np.argsort(group, kind="stable")
    runs = np.split(order, np.cumsum(np.bincount(group, minlength=len(known)))[:-1])
    return dict(zip(known, runs, strict=True))


def _labels(
    parts: list[PlacedPart], triangles: Ints, materials: tuple[Material, ...]
) -> Labels | None:
    """Bodies and materials of the triangles; None if there are neither."""
    bodies, body = number_names([part.name for part in parts])
    if not bodies and not materials:
        return None
    material = [
        np.tile(np.broadcast_to(part.material, len(part.triangles)), len(part.transforms))
        for part in parts
    ]
    body = body[run_numbers(triangles)]
    return Labels(bodies, (), materials, body, np.full(len(body), -1), np.concatenate(material))


def _join_uv(parts: list[PlacedPart], triangles: Ints, found: list[Floats | None]) -> Floats | None:
    """(C, 2) texture coordinates, NaN for parts without them; None if no part has any."""
    if all(part.uv is None for part in parts):
        return None
    counts = 3 * np.diff(triangles)
    return np.concatenate(
        [
            np.full((count, 2), np.nan) if uv is None else uv
            for uv, count in zip(found, counts.tolist(), strict=True)
        ]
    )
