"""Materials of OBJ, glTF and 3MF files: names, colours, and of OBJ the names of images.

OBJ materials are in files of their own. Those of glTF and 3MF the general reader leaves out, so
they are read here and matched with its parts by order and by the number of triangles.
"""

from __future__ import annotations

import re
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.labels import Colour, Material
from ffdcli.mesh.io.gltf import gltf_parts, gltf_tree

_MTL_STATEMENT = re.compile(rb"^[ \t]*(newmtl|Kd|map_Kd)[ \t]+([^\r\n]*)", re.MULTILINE)
_3MF_MODEL = "3d/3dmodel.model"


@dataclass(frozen=True)
class PartMaterials:
    """Materials of one part of a scene.

    Parameters
    ----------
    name : str
        Name of the mesh or object; empty where the file gives none.
    material : (T,) or (1,) int64
        Material of each triangle or of all; -1 for none.
    """

    name: str
    material: Ints


@dataclass(frozen=True)
class SceneMaterials:
    """Materials of a scene, part by part in the file's order."""

    materials: tuple[Material, ...]
    parts: tuple[PartMaterials, ...]


def read_libraries(folder: Path, names: tuple[str, ...]) -> tuple[dict[str, Material], list[str]]:
    """Materials in OBJ material files, and a note for all that is missing or left out.

    A statement may name several files, and files may have spaces in their names.
    """
    found: dict[str, Material] = {}
    notes = []
    files = [
        part
        for name in dict.fromkeys(names)
        for part in ([name] if (folder / name).is_file() else name.split())
    ]
    for name in files:
        path = folder / name.replace("\\", "/")
        try:
            data = path.read_bytes()
        except OSError:
            notes.append(f"the material file {name} cannot be read: its colours are left out")
            continue
        material = ""
        for kind, rest in _MTL_STATEMENT.findall(data):
            if kind == b"newmtl":
                material = plain_name(rest)
                found.setdefault(material, Material(material))
            elif material not in found:
                continue
            elif kind == b"Kd":
                colour = _colour(rest.split()[:3]) or found[material].colour
                found[material] = replace(found[material], colour=colour)
            elif rest.startswith(b"-"):
                notes.append(f"the image of material {material} has options: it is left out")
            else:
                image = str(path.parent / plain_name(rest).replace("\\", "/"))
                found[material] = replace(found[material], image=image)
    return found, notes


def plain_name(rest: bytes) -> str:
    """The name in the rest of a line; a comment needs a space before its mark."""
    return re.sub(rb"(^|\s)#.*", b"", rest).decode("utf-8", "replace").strip()


def _colour(tokens: list[Any]) -> Colour | None:
    try:
        red, green, blue = (min(1.0, max(0.0, float(token))) for token in tokens)
    except (TypeError, ValueError):  # a spectral file, or nonsense
        return None
    return (red, green, blue) if red == red and green == green and blue == blue else None


def gltf_materials(data: bytes) -> SceneMaterials:
    """Materials of a .glb or .gltf file that has been read already; its colours are linear."""
    tree = gltf_tree(data)
    materials = []
    for number, material in enumerate(tree.get("materials", [])):
        # Without a factor the colour is that of a texture.
        factor = material.get("pbrMetallicRoughness", {}).get("baseColorFactor")
        colour = None if factor is None else _colour(factor[:3])
        if colour is not None:
            colour = (_encoded(colour[0]), _encoded(colour[1]), _encoded(colour[2]))
        materials.append(Material(str(material.get("name", f"material {number + 1}")), colour))
    parts = [
        PartMaterials(
            str(mesh.get("name", "")), np.array([part.get("material", -1)], dtype=np.int64)
        )
        for mesh, part in gltf_parts(tree)
    ]
    return SceneMaterials(tuple(materials), tuple(parts))


def _encoded(linear: float) -> float:
    """Linear light as sRGB (IEC 61966-2-1)."""
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055


def threemf_materials(path: Path) -> SceneMaterials:
    """Base materials and colour groups of a .3mf file that has been read already.

    Where a triangle's corners differ, the first one's counts.
    """
    with zipfile.ZipFile(path) as archive:
        name = next(n for n in archive.namelist() if _3MF_MODEL in n.lower())
        data = archive.read(name)
    if b"pid" not in data:
        return SceneMaterials((), ())
    from lxml import etree

    root = etree.fromstring(data, etree.XMLParser(resolve_entities=False, huge_tree=True))
    materials: list[Material] = []
    first: dict[str, int] = {}
    size: dict[str, int] = {}
    for group in root.iter("{*}basematerials", "{*}colorgroup"):
        first[group.get("id", "")] = len(materials)
        for each in group.iter("{*}base", "{*}color"):
            shown = each.get("displaycolor") or each.get("color") or ""
            materials.append(Material(each.get("name", shown), _hex_colour(shown)))
        size[group.get("id", "")] = len(materials) - first[group.get("id", "")]

    def number(group: str | None, place: str | None) -> int:
        if group not in first or place is None or not place.isdigit():
            return -1
        return first[group] + int(place) if int(place) < size[group] else -1

    parts = []
    for thing in root.iter("{*}object"):
        triangles = list(thing.iterfind("{*}mesh/{*}triangles/{*}triangle"))
        if not triangles:
            continue
        own, place = thing.get("pid"), thing.get("pindex")
        found = [
            number(t.get("pid", own), t.get("p1")) if t.get("p1") else number(own, place)
            for t in triangles
        ]
        parts.append(PartMaterials(thing.get("name", ""), np.array(found, dtype=np.int64)))
    return SceneMaterials(tuple(materials), tuple(parts))


def _hex_colour(text: str) -> Colour | None:
    if re.fullmatch(r"#[0-9A-Fa-f]{6}([0-9A-Fa-f]{2})?", text) is None:
        return None
    red, green, blue = (int(text[at : at + 2], 16) / 255 for at in (1, 3, 5))
    return red, green, blue
