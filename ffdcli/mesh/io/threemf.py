"""3MF files, decoded and encoded (3MF core specification, 3MF Consortium, version 1.3).

trimesh reads the geometry; materials are taken from the XML. The encoder is our own: that of
trimesh leaves out materials and the unit, and writes random identifiers; lib3mf holds single
precision.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.graphs import connected_components
from ffdcli.labels import Colour, Material
from ffdcli.mesh.io.painted_mesh import GREY, EncodedMesh, PaintedMesh, Parts, split_parts
from ffdcli.mesh.io.raw_mesh import RawMesh
from ffdcli.mesh.io.scenes import SceneMaterials, join_scene, load_scene
from ffdcli.mesh.io.text_numbers import count_decimals
from ffdcli.units import unit_named

_MAIN_MODEL = "3d/3dmodel.model"
_VERTEX = re.compile(rb"<(?:\w+:)?vertex\s([^>]*)>")
_COORDINATE = re.compile(rb"\b[xyz]\s*=\s*[\"']\s*([^\"'\s]+)")

_HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
_SCHEMAS = "http://schemas.openxmlformats.org/package/2006"
_MODEL = "http://schemas.microsoft.com/3dmanufacturing"
_TYPES = f"""{_HEAD}<Types xmlns="{_SCHEMAS}/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
"""
_RELATIONS = f"""{_HEAD}<Relationships xmlns="{_SCHEMAS}/relationships">
<Relationship Target="/3D/3dmodel.model" Id="rel0" Type="{_MODEL}/2013/01/3dmodel"/>
</Relationships>
"""
# Characters that XML does not allow.
_FORBIDDEN = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
# Identifier of the materials; those of the objects follow.
_MATERIALS = 1


def decode_3mf(data: bytes, path: Path) -> RawMesh:
    """All objects of a file, with names and materials; texture coordinates are left out."""
    scene = load_scene(path)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        models = {n: archive.read(n) for n in archive.namelist() if n.lower().endswith(".model")}
    tags = b" ".join(tag for text in models.values() for tag in _VERTEX.findall(text))
    decimals = count_decimals(np.array(_COORDINATE.findall(tags) or [b"0"]))
    mesh = join_scene(scene, _materials(models), decimals=decimals)
    if not any(b"tex2coord" in text for text in models.values()):
        return mesh
    return replace(mesh, notes=(*mesh.notes, "texture coordinates of 3MF files are left out"))


def _materials(models: dict[str, bytes]) -> SceneMaterials:
    """Base materials and colour groups, none if unreadable.

    A triangle whose corners differ has the material of its first corner.
    """
    data = next((text for name, text in models.items() if _MAIN_MODEL in name.lower()), b"")
    if b"pid" not in data:
        return SceneMaterials()
    from lxml import etree

    root = etree.fromstring(data, etree.XMLParser(resolve_entities=False, huge_tree=True))
    materials: list[Material] = []
    place: dict[tuple[str, int], int] = {}
    for group in root.iter("{*}basematerials", "{*}colorgroup"):
        for index, each in enumerate(group.iter("{*}base", "{*}color")):
            shown = each.get("displaycolor") or each.get("color") or ""
            place[group.get("id", ""), index] = len(materials)
            materials.append(Material(each.get("name", shown), _hex_colour(shown)))

    def number(group: str | None, index: str | None) -> int:
        if group is None or index is None or not index.isdecimal():
            return -1
        return place.get((group, int(index)), -1)

    objects = []
    for thing in root.iter("{*}object"):
        triangles = list(thing.iterfind("{*}mesh/{*}triangles/{*}triangle"))
        if not triangles:
            continue
        own, index = thing.get("pid"), thing.get("pindex")
        found = [
            number(t.get("pid", own), t.get("p1")) if t.get("p1") else number(own, index)
            for t in triangles
        ]
        objects.append((thing.get("name", ""), np.array(found, dtype=np.int64)))
    return SceneMaterials(tuple(materials), tuple(objects))


def _hex_colour(text: str) -> Colour | None:
    if re.fullmatch(r"#[0-9A-Fa-f]{6}([0-9A-Fa-f]{2})?", text) is None:
        return None
    red, green, blue = (int(text[at : at + 2], 16) / 255 for at in (1, 3, 5))
    return red, green, blue


def encode_3mf(mesh: PaintedMesh, path: Path) -> EncodedMesh:
    """A file with the unit, every digit, an object for each named body, and materials."""
    parts = _whole_bodies(mesh.triangles, split_parts(mesh, by_material=False))
    texts = {
        "[Content_Types].xml": _TYPES,
        "_rels/.rels": _RELATIONS,
        "3D/3dmodel.model": "".join(_model(mesh, parts.label, parts.titles(mesh.name))),
    }
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, text in texts.items():
            # A fixed date: the same mesh gives the same bytes.
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            archive.writestr(entry, text.encode(), zipfile.ZIP_DEFLATED)
    unnamed = sorted(set(mesh.groups).difference(*parts.names))
    return EncodedMesh(out.getvalue(), unnamed=tuple(unnamed))


def _whole_bodies(triangles: Ints, parts: Parts) -> Parts:
    """Parts joined to edge-connected bodies, with the names that all parts of a body have.

    The standard requires closed objects, so a part of a body cannot be an object.
    """
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    _, edge = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    # Nodes of the graph are parts and edges: two parts on one edge are two links apart.
    count = len(parts.names)
    linked = connected_components(
        count + len(ends), np.repeat(parts.label, 3), count + edge.ravel()
    )
    bodies, body = np.unique(linked[:count], return_inverse=True)
    names = []
    for number in range(len(bodies)):
        first, *others = [set(parts.names[row]) for row in np.flatnonzero(body == number)]
        names.append(sorted(first.intersection(*others)))
    return Parts(body[parts.label], names, [-1] * len(names))


def _model(mesh: PaintedMesh, label: Ints, titles: list[str]) -> Iterator[str]:
    """The XML of a model with an object for each title, whose triangles have its label.

    An object with materials must have one for every triangle: grey stands in for none.
    """
    paint, none = mesh.paint, len(mesh.paint.materials)
    unit = unit_named(mesh.unit).threemf
    yield f'{_HEAD}<model unit="{unit}" xml:lang="en-US" xmlns="{_MODEL}/core/2015/02">\n'
    yield "<resources>\n"
    bodies = [np.flatnonzero(label == number) for number in range(len(titles))]
    painted = [mesh.material[rows] for rows in bodies]
    if paint.materials:
        yield f'<basematerials id="{_MATERIALS}">\n'
        for each in paint.materials:
            yield _base(each.name or "material", each.colour or GREY)
        if any((some < 0).any() and (some >= 0).any() for some in painted):
            yield _base("no material", GREY)
        yield "</basematerials>\n"
    for number, (rows, material) in enumerate(zip(bodies, painted, strict=True)):
        used, corners = np.unique(mesh.triangles[rows], return_inverse=True)
        # Triangles without an entry have the material of the object: the commonest.
        material = np.where(material < 0, none, material)
        own = int(np.bincount(material).argmax()) if len(rows) else none
        paints = "" if (material == none).all() else f' pid="{_MATERIALS}" pindex="{own}"'
        yield f'<object id="{_MATERIALS + 1 + number}" name={_quoted(titles[number])} type="model"'
        yield f"{paints}>\n<mesh>\n<vertices>\n"
        for x, y, z in mesh.vertices[used].tolist():
            yield f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>\n'
        yield "</vertices>\n<triangles>\n"
        for (a, b, c), m in zip(corners.reshape(-1, 3).tolist(), material.tolist(), strict=True):
            other = "" if m == own else f' pid="{_MATERIALS}" p1="{m}"'
            yield f'<triangle v1="{a}" v2="{b}" v3="{c}"{other}/>\n'
        yield "</triangles>\n</mesh>\n</object>\n"
    yield "</resources>\n<build>\n"
    for number, title in enumerate(titles):
        yield f'<item objectid="{_MATERIALS + 1 + number}" partnumber={_quoted(title)}/>\n'
    yield "</build>\n</model>\n"


def _base(name: str, colour: Colour) -> str:
    shown = "#" + "".join(f"{round(255 * level):02X}" for level in colour)
    return f'<base name={_quoted(name)} displaycolor="{shown}"/>\n'


def _quoted(text: str) -> str:
    """The value of an attribute, in quotes."""
    return quoteattr(_FORBIDDEN.sub("", text))
