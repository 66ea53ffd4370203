"""3MF files made from XML: boxes, objects, components, items and parts."""

import itertools
import zipfile

import numpy as np

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
MATERIAL = "http://schemas.microsoft.com/3dmanufacturing/material/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
ROOT = "3D/3dmodel.model"
START = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
RELATIONS = "http://schemas.openxmlformats.org/package/2006/relationships"
SIDES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def box(size=(10, 20, 30), at=(0, 0, 0), paint=()):
    """A mesh element; the triangles named in ``paint`` have further attributes."""
    corners = np.array(list(itertools.product((0, 1), repeat=3))) * size + at
    points = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*p) for p in corners.tolist())
    further = [*paint, *[""] * 12]
    triangles = "".join(
        f'<triangle v1="{a}" v2="{b}" v3="{c}" {more}/>'
        for (a, b, c), more in zip(SIDES.tolist(), further, strict=False)
    )
    return f"<mesh><vertices>{points}</vertices><triangles>{triangles}</triangles></mesh>"


def thing(number, content=None, stated=""):
    """An object, by default a box of 10 × 20 × 30."""
    return f'<object id="{number}" {stated}>{box() if content is None else content}</object>'


def assembly(number, *components, stated=""):
    """An object of components, each given by its attributes."""
    inside = "".join(f"<component {each}/>" for each in components)
    return thing(number, f"<components>{inside}</components>", stated)


def matrix(linear=((1, 0, 0), (0, 1, 0), (0, 0, 1)), by=(0, 0, 0)):
    """A transform attribute: ``linear`` and then a shift, applied to columns."""
    rows = np.vstack([np.transpose(linear), by]).ravel().tolist()
    return f'transform="{" ".join(map(str, rows))}"'


def model(resources, *items, unit='unit="millimeter"', stated=""):
    """A model element; items are given by their attributes."""
    build = "".join(f"<item {each}/>" for each in items)
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><model {unit} xmlns="{CORE}" '
        f'xmlns:m="{MATERIAL}" xmlns:p="{PRODUCTION}" {stated}>'
        f"<resources>{resources}</resources><build>{build}</build></model>"
    )


def relations(*targets):
    """The relations of a package with root models."""
    entries = "".join(
        f'<Relationship Target="{target}" Id="r{n}" Type="{START}"/>'
        for n, target in enumerate(targets)
    )
    return f'<Relationships xmlns="{RELATIONS}">{entries}</Relationships>'


def save(path, root, parts=None, start="/" + ROOT, packing=zipfile.ZIP_STORED):
    """Write a package of a root model and further parts."""
    content = {"_rels/.rels": relations(start), start.lstrip("/"): root, **(parts or {})}
    with zipfile.ZipFile(path, "w", packing) as archive:
        for name, text in content.items():
            # A fixed date: the same content gives the same bytes.
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), text, packing)
    return path
