"""3MF files, encoded (3MF core specification, 3MF Consortium, version 1.3).

The encoder is our own: that of trimesh leaves out materials and the unit, and writes random
identifiers; lib3mf holds single precision.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.graphs import connected_components
from ffdcli.labels import Colour
from ffdcli.mesh.io.painted_mesh import GREY, EncodedMesh, PaintedMesh, Parts, split_parts
from ffdcli.units import unit_named

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
