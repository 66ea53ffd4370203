"""Triangles as a 3MF file: bodies by name, materials with colours, every digit.

The general writer leaves out materials and the unit, and writes what differs from run to run; the
format's own library, lib3mf, holds coordinates in single precision. What is needed of the core
specification (3MF Consortium, version 1.3) is small.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.mesh.io.paint import GREY, Paint

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
# Characters that XML has no place for.
_FORBIDDEN = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
# The number of the materials; bodies come after.
_MATERIALS = 1


def as_3mf(
    vertices: Floats, triangles: Ints, label: Ints, titles: list[str], paint: Paint, unit: str
) -> bytes:
    """The file.

    Parameters
    ----------
    label : (T,) int64
        Position of each triangle's body in ``titles``.
    titles : list of str
    paint : Paint
        In a body some of whose triangles have a material all must have one: a grey one is added.
    unit : str
        As the format calls it.
    """
    parts = {
        "[Content_Types].xml": _TYPES,
        "_rels/.rels": _RELATIONS,
        "3D/3dmodel.model": "".join(_model(vertices, triangles, label, titles, paint, unit)),
    }
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, text in parts.items():
            # No time of day: the same triangles give the same bytes.
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            archive.writestr(entry, text.encode(), zipfile.ZIP_DEFLATED)
    return out.getvalue()


def _model(
    vertices: Floats, triangles: Ints, label: Ints, titles: list[str], paint: Paint, unit: str
) -> Iterator[str]:
    yield f'{_HEAD}<model unit="{unit}" xml:lang="en-US" xmlns="{_MODEL}/core/2015/02">\n'
    yield "<resources>\n"
    bodies = [np.flatnonzero(label == number) for number in range(len(titles))]
    painted = [paint.material[rows] for rows in bodies]
    if paint.materials:
        yield f'<basematerials id="{_MATERIALS}">\n'
        for each in paint.materials:
            yield _base(each.name or "material", each.colour or GREY)
        if any((some < 0).any() and (some >= 0).any() for some in painted):
            yield _base("no material", GREY)
        yield "</basematerials>\n"
    for number, (rows, material) in enumerate(zip(bodies, painted, strict=True)):
        used, corners = np.unique(triangles[rows], return_inverse=True)
        # Triangles that say nothing have the body's own material: its commonest.
        material = np.where(material < 0, len(paint.materials), material)
        own = int(np.bincount(material).argmax()) if len(rows) else len(paint.materials)
        if (material == len(paint.materials)).all():
            paints = ""
        else:
            paints = f' pid="{_MATERIALS}" pindex="{own}"'
        yield f'<object id="{_MATERIALS + 1 + number}" name={_text(titles[number])} type="model"'
        yield f"{paints}>\n<mesh>\n<vertices>\n"
        for x, y, z in vertices[used].tolist():
            yield f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>\n'
        yield "</vertices>\n<triangles>\n"
        for (a, b, c), m in zip(corners.reshape(-1, 3).tolist(), material.tolist(), strict=True):
            other = "" if m == own else f' pid="{_MATERIALS}" p1="{m}"'
            yield f'<triangle v1="{a}" v2="{b}" v3="{c}"{other}/>\n'
        yield "</triangles>\n</mesh>\n</object>\n"
    yield "</resources>\n<build>\n"
    for number, title in enumerate(titles):
        yield f'<item objectid="{_MATERIALS + 1 + number}" partnumber={_text(title)}/>\n'
    yield "</build>\n</model>\n"


def _base(name: str, colour: tuple[float, float, float]) -> str:
    shown = "#" + "".join(f"{round(255 * level):02X}" for level in colour)
    return f'<base name={_text(name)} displaycolor="{shown}"/>\n'


def _text(words: str) -> str:
    """An attribute's value, quoted."""
    return quoteattr(_FORBIDDEN.sub("", words))
