"""Instances and triangles of COLLADA files (1.4 and 1.5)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

from ffdcli.mesh.io.threemf.package import Package, quote
from ffdcli.mesh.io.xml_scenes.tally import Refused, SceneCounts, count_places, local_name, total
from ffdcli.messages import counted

_LINES = ("lines", "linestrips")
_SURFACES = ("triangles", "polylist", "polygons", "tristrips", "trifans")


def root_of_zae(package: Package) -> str:
    """The document of an archive."""
    named = [part for part in package.entries if part.lower().endswith(".dae")]
    if len(named) != 1:
        raise Refused(f"the archive holds {len(named)} .dae files, where one is read")
    return named[0]


def count_collada(root: Any) -> SceneCounts:
    """What the scene of a document places; polygons of n corners count as n - 2 triangles.

    Raises
    ------
    Refused
        It places something in itself, in another file, missing, or by a controller.
    """
    by_id: dict[tuple[str, str], Any] = {}
    for element in root.iter():
        if "id" in element.attrib:
            by_id.setdefault((local_name(element), element.get("id")), element)

    def named(element: Any, kind: str) -> Any:
        url = (element.get("url") or "").strip()
        if not url.startswith("#"):
            message = f"the file places {quote(url)}, which lies in another file"
            raise Refused(message, "export it as one file")
        found = by_id.get((kind, url[1:]))
        if found is None:
            raise Refused(f"the file places the {kind} {quote(url[1:])}, which it does not hold")
        return found

    controllers = sum(1 for _ in root.iter("{*}instance_controller"))
    if controllers:
        what = counted(controllers, "mesh has a skin", "meshes have skins")
        message = f"{what} or morph targets (instance_controller), which are not read from COLLADA"
        raise Refused(message, "apply them in a mesh editor, or export the scene as glTF")
    stated = root.find("{*}scene/{*}instance_visual_scene")
    if stated is None:
        raise Refused("the file shows no scene")
    scene = named(stated, "visual_scene")
    inside: dict[Any, Counter[Any]] = {}
    lists: dict[Any, list[int]] = {}
    notes: list[str] = []
    waiting = [scene]
    while waiting:
        node = waiting.pop()
        if node in inside:
            continue
        children = inside.setdefault(node, Counter())
        for child in node:
            kind = local_name(child)
            if kind == "instance_geometry":
                child = named(child, "geometry")
                if child not in lists:
                    lists[child] = list(_geometry(child, notes))
            elif kind == "instance_node":
                child = named(child, "node")
            elif kind != "node":
                continue
            children[child] += 1
            if child not in lists:
                waiting.append(child)
    return total(lists, count_places(inside, scene), notes)


def _geometry(geometry: Any, notes: list[str]) -> Iterable[int]:
    """Triangles of each list of polygons of a geometry."""
    for kind in ("brep", "spline", "convex_mesh"):
        if geometry.find(f"{{*}}{kind}") is not None:
            notes.append(f"geometry of the kind `{kind}` is left out")
    for each in geometry.iterfind("{*}mesh/*"):
        kind = local_name(each)
        if kind in _LINES:
            notes.append("lines are left out")
        elif kind in _SURFACES:
            yield _primitive(each, kind)


def _primitive(element: Any, kind: str) -> int:
    """Triangles of a list of polygons, whose `count` must agree with its numbers."""
    stride = 1 + max((_whole(i.get("offset")) for i in element.iterfind("{*}input")), default=0)
    if element.find("{*}ph") is not None:
        raise Refused("a polygon of the file has holes", "export it as triangles")
    numbers = [_tokens(p) for p in element.iterfind("{*}p")]
    corners = [number // stride for number in numbers]
    broken = [number for number in numbers if number % stride]
    if kind == "triangles":
        held, triangles = sum(corners) / 3, sum(corners) // 3
    elif kind == "polylist":
        vcount = element.find("{*}vcount")
        sizes = [int(size) for size in ((vcount.text if vcount is not None else "") or "").split()]
        if sum(sizes) != sum(corners):
            message = f"a list of polygons has {sum(sizes)} corners by its sizes, but"
            raise Refused(f"{message} {sum(corners)} are there")
        held, triangles = len(sizes), sum(max(size - 2, 0) for size in sizes)
    else:
        held, triangles = len(corners), sum(max(each - 2, 0) for each in corners)
    stated = element.get("count")
    if broken or (stated is not None and _whole(stated) != held):
        message = f"a list of `{kind}` promises {stated}, but holds numbers for {held:g}"
        raise Refused(f"{message}, of {stride} at each corner")
    return triangles


def _whole(text: str | None) -> int:
    return int(text or "0")


def _tokens(element: Any) -> int:
    """How many numbers the text of an element holds."""
    return len((element.text or "").split())
