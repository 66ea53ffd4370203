"""Instances and triangles of 3DXML files."""

from __future__ import annotations

from collections import Counter
from typing import Any

from ffdcli.mesh.io.threemf.package import Package, quote
from ffdcli.mesh.io.xml_scenes.tally import Refused, SceneCounts, count_places, parse_part, total


def count_3dxml(package: Package) -> SceneCounts:
    """What the product structure of an archive places, coarser levels of detail left out.

    Raises
    ------
    Refused
        A part is missing, or placed in itself.
    """
    manifest = package.find("Manifest.xml")
    if manifest is None:
        raise Refused("the archive has no Manifest.xml")
    root = parse_part(package, manifest).find("{*}Root")
    part = package.find("" if root is None else root.text or "")
    if part is None:
        raise Refused("the archive has not the file that Manifest.xml names as its root")
    tree = parse_part(package, part)
    structure = tree.find("{*}ProductStructure")
    if structure is None:
        raise Refused("the file has no product structure")
    inside: dict[str, Counter[str]] = {}
    for kind in ("Instance3D", "InstanceRep"):
        for instance in tree.iter(f"{{*}}{kind}"):
            holder, held = (
                (instance.findtext(f"{{*}}{key}") or "").strip()
                for key in ("IsAggregatedBy", "IsInstanceOf")
            )
            inside.setdefault(holder, Counter())[held] += 1
    lists: dict[str, list[int]] = {}
    notes: list[str] = []
    for shape in tree.iter("{*}ReferenceRep"):
        form = shape.get("format") or ""
        file = package.find((shape.get("associatedFile") or "").rpartition(":")[2])
        if form != "TESSELLATED":
            notes.append(f"parts of the format {quote(form)} are left out")
        elif file is None:
            raise Refused(f"the file of the part {quote(shape.get('id') or '')} is missing")
        else:
            lists[shape.get("id")] = [_faces(parse_part(package, file))]
    return total(lists, count_places(inside, structure.get("root")), notes)


def _faces(tree: Any) -> int:
    """Triangles of the faces of a part, its coarser levels of detail left out."""
    triangles = 0
    for face in tree.iterfind(".//{*}Rep/{*}Faces/{*}Face"):
        triangles += len((face.get("triangles") or "").split()) // 3
        for key in ("strips", "fans"):
            runs = (face.get(key) or "").split(",")
            triangles += sum(max(len(run.split()) - 2, 0) for run in runs)
    return triangles
