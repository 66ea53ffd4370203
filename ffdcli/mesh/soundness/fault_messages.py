"""Messages about the faults of a mesh, and the errors for meshes that cannot be used."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from ffdcli.errors import MeshError
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.soundness.coincident import find_coincident
from ffdcli.mesh.soundness.inspection import Finding, Soundness, inspect
from ffdcli.mesh.soundness.repair import repair
from ffdcli.messages import counted, place_text

# Coarsest usable delta as a share of the size: beyond it no polygon is certainly flat.
COARSEST_RESOLUTION = 1e-4
_LONGEST_NAME = 60


class _FindingKind(NamedTuple):
    """A kind of finding: its name in `Soundness`, one, several, and what to do or know."""

    name: str
    one: str
    several: str
    advice: str


# Faults: no faces can be made of the mesh.
FAULTS = (
    _FindingKind(
        "degenerate",
        "polygon has no area",
        "polygons have no area",
        "delete such polygons in a mesh editor",
    ),
    _FindingKind(
        "crossing",
        "polygon crosses itself or doubles back",
        "polygons cross themselves or double back",
        "split such polygons into triangles in a mesh editor",
    ),
    _FindingKind(
        "duplicates",
        "polygon lies on the same vertices as another",
        "polygons lie on the same vertices as others",
        "delete such polygons in a mesh editor",
    ),
    _FindingKind(
        "nonmanifold_edges",
        "edge is shared by more than two polygons",
        "edges are shared by more than two polygons",
        "separate the bodies that touch there, or delete the polygons inside",
    ),
    _FindingKind(
        "inconsistent_edges",
        "edge joins polygons wound in opposite directions",
        "edges join polygons wound in opposite directions",
        "make the normals consistent in a mesh editor",
    ),
    _FindingKind(
        "inside_out",
        "closed body is inside out (its polygons face inwards)",
        "closed bodies are inside out (their polygons face inwards)",
        "flip the normals in a mesh editor",
    ),
)
_OPEN = _FindingKind(
    "open_edges",
    "edge belongs to only one polygon",
    "edges belong to only one polygon",
    "close it in a mesh editor, or do not require a solid",
)
# Remarks: the mesh can be used.
_REMARKS = (
    _FindingKind(
        "unwelded",
        "vertex at an open edge lies within rounding of another",
        "vertices at open edges lie within rounding of others",
        "--repair welds them",
    ),
    _FindingKind(
        "t_junctions",
        "vertex lies in the middle of another polygon's open edge",
        "vertices lie in the middle of other polygons' open edges",
        "--repair joins them",
    ),
    _FindingKind(
        "nonmanifold_vertices",
        "vertex joins surfaces that touch in a point",
        "vertices join surfaces that touch in a point",
        "CAD programs may refuse that; --repair gives each surface a vertex of its own",
    ),
    _FindingKind(
        "overlaps",
        "closed body reaches into another",
        "closed bodies reach into others",
        "the file will hold them as overlapping solids; unite them first if they are one part",
    ),
)


def describe_faults(soundness: Soundness) -> list[tuple[str, str]]:
    """Count and place of each kind of fault that prevents faces, and what to do."""
    found = [(_counted(soundness, kind, "first near"), kind.advice) for kind in FAULTS]
    return [(what, advice) for what, advice in found if what]


def require_usable(mesh: Mesh, soundness: Soundness) -> None:
    """Reject a mesh that faces cannot be made of. An open mesh is accepted: it gives open shells.

    Raises
    ------
    MeshError
        With count and first place of each kind of fault. The hint says whether repair helps, which
        is found out by trying.
    """
    if mesh.delta > COARSEST_RESOLUTION * mesh.size:
        raise MeshError(
            f"the coordinates are precise only to {mesh.delta:.2g}, too coarse for a model of size"
            f" {mesh.size:.3g}",
            file=mesh.source,
            hint="move the model near the origin, or export it with more digits",
        )
    faults = describe_faults(soundness)
    if not faults:
        return
    repaired, done = repair(mesh)
    left = describe_faults(inspect(repaired)) if done else faults
    if not left:
        hint = "run again with --repair, which repairs this without moving the surface"
    else:
        hint = "; ".join(dict.fromkeys(advice for _, advice in left))
        if len(left) < len(faults):
            hint = f"--repair does not repair all: {', '.join(what for what, _ in left)}; {hint}"
    raise MeshError("; ".join(what for what, _ in faults), file=mesh.source, hint=hint)


def require_closed(mesh: Mesh, soundness: Soundness) -> None:
    """Reject an open mesh, for callers that require a solid.

    Raises
    ------
    MeshError
        With the number of open edges and the place of the first.
    """
    what = _counted(soundness, _OPEN, "first near")
    if what:
        repaired, done = repair(mesh)
        closes = bool(done) and inspect(repaired).open_edges.place is None
        raise MeshError(
            f"the mesh is open, and a solid is required: {what}",
            file=mesh.source,
            hint="run again with --repair, which closes it" if closes else _OPEN.advice,
        )


def describe_remarks(mesh: Mesh, soundness: Soundness) -> list[str]:
    """Sentences on openings, near misses and overlaps, which do not prevent faces."""
    remarks = []
    what = _counted(soundness, _OPEN, "first at")
    if what:
        partly = bool(soundness.nesting.closed.any())
        gives = "open bodies give open shells" if partly else "the result is an open shell"
        remarks.append(f"the mesh is open: {what}; {gives}")
    found = [(_counted(soundness, kind, "first at"), kind.advice) for kind in _REMARKS]
    remarks += [f"{what}; {advice}" for what, advice in found if what]
    return remarks + _describe_coincident(mesh, soundness)


def _describe_coincident(mesh: Mesh, soundness: Soundness) -> list[str]:
    """A sentence on closed bodies that lie on one another, with the names of the first two."""
    count, place = soundness.coincident.count, soundness.coincident.place
    if place is None:
        return []
    later, earlier = (
        _name_of_body(mesh, soundness, body)
        for body in find_coincident(mesh, soundness.nesting)[0].tolist()
    )
    what = counted(
        count,
        f"closed body has the vertices and volume of another, {later} those of {earlier}",
        f"closed bodies have the vertices and volume of others, the first, {later}, of {earlier}",
    )
    return [
        f"{what}, near {place_text(place)}; the file will hold them as solids on one another; "
        "delete what is doubled in a mesh editor"
    ]


def _name_of_body(mesh: Mesh, soundness: Soundness, body: int) -> str:
    """Name of a body in quotes: of an object, else of a group; else its number, from 0."""
    polygon = int(np.argmax(soundness.nesting.body == body))
    named = [name for name, polygons in mesh.groups.items() if polygon in polygons]
    if mesh.labels is not None and mesh.labels.body[polygon] >= 0:
        named.insert(0, mesh.labels.bodies[mesh.labels.body[polygon]])
    return repr(named[0][:_LONGEST_NAME]) if named else f"body {body}"


def usability(mesh: Mesh, soundness: Soundness) -> Literal["yes", "with --repair", "no"]:
    """Whether faces can be made of the mesh."""
    if mesh.delta > COARSEST_RESOLUTION * mesh.size:
        return "no"
    if not describe_faults(soundness):
        return "yes"
    repaired, done = repair(mesh)
    return "no" if not done or describe_faults(inspect(repaired)) else "with --repair"


def _counted(soundness: Soundness, kind: _FindingKind, where: str) -> str:
    """Count and place of what was found of a kind; "" for nothing."""
    finding: Finding = getattr(soundness, kind.name)
    if finding.place is None:
        return ""
    first = where.removeprefix("first ") if finding.count == 1 else f"the {where}"
    return f"{counted(finding.count, kind.one, kind.several)}, {first} {place_text(finding.place)}"
