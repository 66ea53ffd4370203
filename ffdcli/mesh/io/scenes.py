"""Files that trimesh reads or writes: scenes of placed parts, joined to one mesh."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints, run_numbers, run_starts
from ffdcli.errors import FileError
from ffdcli.labels import Labels, Material, number_names
from ffdcli.mesh.io.raw_mesh import RawMesh, binary_resolution, text_resolution
from ffdcli.units import UNITS

# Names of units that trimesh reports; those of 3MF, and others.
_UNITS = {unit.threemf: unit.name for unit in UNITS if unit.threemf is not None}
_UNITS |= {"micrometer": "um", "inches": "inch", "feet": "ft"}


@dataclass(frozen=True)
class SceneMaterials:
    """Materials of a scene, and those of its geometries in the order of the file.

    A geometry has a name, empty for none, and the material of each triangle (T,) or of all (1,); -1
    for none.
    """

    materials: tuple[Material, ...] = ()
    geometries: tuple[tuple[str, Ints], ...] = ()


def decode_scene(data: bytes, path: Path) -> RawMesh:
    """All meshes of a file in a format that only trimesh knows."""
    return join_scene(load_scene(path))


def load_scene(path: Path) -> Any:
    """The scene that trimesh makes of a file, without materials.

    Raises
    ------
    FileError
        trimesh cannot read the file.
    """
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return trimesh.load_scene(
                str(path), process=False, maintain_order=True, skip_materials=True
            )
    except Exception as error:  # a broken file can raise anything in a third-party reader
        first_line = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise FileError(
            f"the file cannot be read as {path.suffix.lower()}: {first_line}",
            file=str(path),
            hint="export it again, as triangles or in another format such as .obj",
        ) from error


def join_scene(
    scene: Any,
    materials: SceneMaterials | None = None,
    uv: Sequence[Floats | None] = (),
    decimals: int | None = None,
) -> RawMesh:
    """All meshes of a scene in world coordinates.

    Parameters
    ----------
    materials : SceneMaterials, optional
        For formats that hold names and materials.
    uv : sequence of (n, 2) float64 or None
        Texture coordinates of the vertices of each geometry, instead of those that trimesh has.
    decimals : int, optional
        Most decimals printed for any coordinate, for text formats.
    """
    import trimesh

    geometries = list(scene.geometry)
    stored = dict(zip(geometries, uv, strict=True)) if len(uv) == len(geometries) else {}
    parts: list[RawMesh] = []
    nodes: list[str] = []
    names: list[str] = []
    stretch, notes = 0.0, dict[str, None]()
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if not isinstance(geometry, trimesh.Trimesh) or len(geometry.faces) == 0:
            continue
        if geometry.metadata.get("processed"):
            notes["the reader of this format welded vertices closer than 1e-8"] = None
        transform = np.asarray(transform, dtype=np.float64)
        parts.append(_place(geometry, transform, stored.get(name)))
        stretch = max(stretch, float(np.linalg.norm(transform[:3, :3], 2)))
        nodes.append(str(node))
        names.append(str(name))
    if not parts:
        none = np.zeros(0, dtype=np.int64)
        return RawMesh(np.empty((0, 3)), none, run_starts(none), 0.0)
    first = run_starts(np.array([len(part.vertices) for part in parts]))
    polygons = run_starts(np.array([len(part.starts) - 1 for part in parts]))
    vertices = np.concatenate([part.vertices for part in parts])
    stated = [_stated_name(scene, node) for node in nodes]
    return RawMesh(
        vertices,
        np.concatenate([part.corners + at for part, at in zip(parts, first, strict=False)]),
        3 * np.arange(polygons[-1] + 1),
        max(part.resolution for part in parts)
        if decimals is None
        else text_resolution(vertices, decimals, stretch),
        unit=_unit(scene.units),
        notes=tuple(notes),
        groups=_groups([own or node for own, node in zip(stated, nodes, strict=True)], polygons),
        labels=None
        if materials is None
        else _labels(stated, names, polygons, geometries, materials),
        uv=_join_uv(parts),
        part=run_numbers(first),
    )


def _unit(stated: str | None) -> str | None:
    name = (stated or "").lower()
    return _UNITS.get(name) or _UNITS.get(name.removesuffix("s"))


def _place(geometry: Any, transform: Floats, stored: Floats | None) -> RawMesh:
    """One mesh in world coordinates; the triangles of a mirrored one are turned round again."""
    vertices = np.asarray(geometry.vertices, dtype=np.float64)
    faces = np.asarray(geometry.faces, dtype=np.int64)
    uv = getattr(geometry.visual, "uv", None) if stored is None else stored
    if uv is None or np.shape(uv)[:1] != (len(vertices),) or np.shape(uv)[1] < 2:
        uv = None
    else:
        uv = np.asarray(uv, dtype=np.float64)[faces, :2]
    single = np.array_equal(vertices, vertices.astype(np.float32), equal_nan=True)
    resolution = binary_resolution(vertices, np.float32 if single else np.float64)
    if not np.array_equal(transform, np.eye(4)):
        linear = transform[:3, :3]
        if np.linalg.det(linear) < 0:
            faces, uv = faces[:, ::-1], None if uv is None else uv[:, ::-1]
        # 0 * nan: the vertex is rejected later, by number.
        with np.errstate(invalid="ignore"):
            vertices = vertices @ linear.T + transform[:3, 3]
        resolution = max(
            resolution * float(np.linalg.norm(linear, 2)), binary_resolution(vertices, np.float64)
        )
    return RawMesh(
        vertices,
        faces.ravel(),
        3 * np.arange(len(faces) + 1),
        resolution,
        uv=None if uv is None else uv.reshape(-1, 2),
    )


def _stated_name(scene: Any, node: str) -> str:
    """The name that the file gives a node, or "" for none.

    Parts of a glTF mesh have the name of the node above. trimesh numbers nodes without a name.
    """
    _, name = scene.graph[node]
    if scene.geometry[name].metadata.get("from_gltf_primitive"):
        node = str(scene.graph.transforms.parents.get(node, node))
    return "" if node.isdigit() else node


def _groups(names: list[str], polygons: Ints) -> dict[str, Ints]:
    """Polygons of each named part; a file with one name has no groups."""
    known, number = number_names(names)
    group = number[run_numbers(polygons)]
    return {name: np.flatnonzero(group == n) for n, name in enumerate(known) if len(known) > 1}


def _labels(
    stated: list[str],
    names: list[str],
    polygons: Ints,
    geometries: list[str],
    found: SceneMaterials,
) -> Labels | None:
    """Bodies and materials of the polygons; None if there are neither.

    Each part has a stated name, a geometry of this name, and the polygons between two numbers.
    """
    none = np.array([-1])
    known = {}
    if len(found.geometries) == len(geometries):
        known = dict(zip(geometries, found.geometries, strict=True))
    titles, material = [], []
    for own, name, count in zip(stated, names, np.diff(polygons).tolist(), strict=True):
        title, given = known.get(name, ("", none))
        titles.append(own or title)
        material.append(np.broadcast_to(given if len(given) in (1, count) else none, count))
    bodies, body = number_names(titles)
    if not bodies and not found.materials:
        return None
    body = body[run_numbers(polygons)]
    group = np.full(len(body), -1)
    return Labels(bodies, (), found.materials, body, group, np.concatenate(material))


def _join_uv(parts: list[RawMesh]) -> Floats | None:
    """(C, 2) texture coordinates, NaN for parts without them; None if no part has any."""
    if all(part.uv is None for part in parts):
        return None
    return np.concatenate(
        [np.full((len(p.corners), 2), np.nan) if p.uv is None else p.uv for p in parts]
    )


def export_body(
    vertices: Floats,
    triangles: Ints,
    kind: str,
    *,
    vertex_attributes: dict[str, Any] | None = None,
    face_colours: Ints | None = None,
    **options: Any,
) -> bytes:
    """All triangles as one body, encoded by trimesh as ``kind``: "stl", "ply" or "off"."""
    import trimesh

    body: Any = trimesh.Trimesh(
        vertices, triangles, process=False, vertex_attributes=vertex_attributes
    )
    if face_colours is not None:
        body.visual.face_colors = face_colours
    content = body.export(file_type=kind, **options)
    return content.encode() if isinstance(content, str) else bytes(content)
