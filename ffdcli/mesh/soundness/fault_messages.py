"""What people are told about a mesh: faults that no face can be made of, and remarks."""

from __future__ import annotations

from typing import Literal

from ffdcli.errors import MeshError
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.soundness.inspection import Finding, Soundness, inspect
from ffdcli.mesh.soundness.repair import repair
from ffdcli.messages import counted, place_text

# Share of the size that the file's numbers must tell apart, or nothing is certainly flat.
COARSEST_RESOLUTION = 1e-4

# Kinds of fault: name in `Soundness`, what one and what several are, what to do.
_FAULTS = (
    (
        "degenerate",
        "polygon has no area",
        "polygons have no area",
        "delete such polygons in a mesh editor",
    ),
    (
        "crossing",
        "polygon crosses itself or doubles back",
        "polygons cross themselves or double back",
        "split such polygons into triangles in a mesh editor",
    ),
    (
        "duplicates",
        "polygon lies on the same vertices as another",
        "polygons lie on the same vertices as others",
        "delete such polygons in a mesh editor",
    ),
    (
        "nonmanifold_edges",
        "edge is shared by more than two polygons",
        "edges are shared by more than two polygons",
        "separate the bodies that touch there, or delete the polygons inside",
    ),
    (
        "inconsistent_edges",
        "edge joins polygons wound in opposite directions",
        "edges join polygons wound in opposite directions",
        "make the normals consistent in a mesh editor",
    ),
    (
        "inside_out",
        "closed body is inside out (its polygons face inwards)",
        "closed bodies are inside out (their polygons face inwards)",
        "flip the normals in a mesh editor",
    ),
)


def describe_faults(soundness: Soundness) -> list[tuple[str, str]]:
    """Every kind of fault that keeps faces from being made: count and place, and what to do."""
    told = []
    for name, one, several, hint in _FAULTS:
        finding: Finding = getattr(soundness, name)
        if finding.place is not None:
            told.append((_counted(finding, one, several, "first near"), hint))
    return told


def require_usable(mesh: Mesh, soundness: Soundness) -> None:
    """Refuse what cannot be turned into faces. An open mesh is fine: it gives an open shell.

    Raises
    ------
    MeshError
        Naming every kind of fault met, how many there are, and where the first one is; and whether
        repair would mend them, which is found out by trying.
    """
    if mesh.delta > COARSEST_RESOLUTION * mesh.size:
        raise MeshError(
            f"the file's numbers tell points apart only to {mesh.delta:.2g}, too coarse for a model"
            f" of size {mesh.size:.3g}",
            file=mesh.source,
            hint="move the model near the origin, or export it with more digits",
        )
    faults = describe_faults(soundness)
    if not faults:
        return
    mended, done = repair(mesh)
    left = describe_faults(inspect(mended)) if done else faults
    if not left:
        hint = "run again with --repair, which mends this without moving the surface"
    else:
        hint = "; ".join(dict.fromkeys(each for _, each in left))
        if len(left) < len(faults):
            hint = f"--repair leaves {', '.join(what for what, _ in left)}: {hint}"
    raise MeshError("; ".join(what for what, _ in faults), file=mesh.source, hint=hint)


def require_closed(mesh: Mesh, soundness: Soundness) -> None:
    """Refuse an open mesh, where a solid is asked for.

    Raises
    ------
    MeshError
        Saying how many edges are open, and where the first one is.
    """
    found = soundness.open_edges
    if found.place is not None:
        mended, done = repair(mesh)
        closes = bool(done) and inspect(mended).open_edges.place is None
        raise MeshError(
            "the mesh is open, and a solid is required: "
            + _counted(
                found,
                "edge belongs to one polygon only",
                "edges belong to one polygon only",
                "first near",
            ),
            file=mesh.source,
            hint="run again with --repair, which closes it"
            if closes
            else "close it in a mesh editor, or do without a solid",
        )


def describe_remarks(mesh: Mesh, soundness: Soundness) -> list[str]:
    """Sentences on what is no hindrance, and yet worth knowing: openings, near misses, overlaps."""
    told = []
    if soundness.open_edges.place is not None:
        what = _counted(
            soundness.open_edges,
            "edge belongs to one polygon only",
            "edges belong to one polygon only",
            "first at",
        )
        partly = bool(soundness.nesting.closed.any())
        gives = "open bodies give open shells" if partly else "the result is an open shell"
        told.append(f"the mesh is open: {what}; {gives}")
    for finding, one, several, advice in (
        (
            soundness.unwelded,
            "vertex at an open edge lies within rounding of another",
            "vertices at open edges lie within rounding of others",
            "--repair welds them",
        ),
        (
            soundness.t_junctions,
            "vertex lies in the middle of another polygon's open edge",
            "vertices lie in the middle of other polygons' open edges",
            "--repair joins them",
        ),
        (
            soundness.nonmanifold_vertices,
            "vertex joins surfaces that touch in a point",
            "vertices join surfaces that touch in a point",
            "CAD programs may refuse that; --repair gives each surface its own",
        ),
        (
            soundness.overlaps,
            "closed body reaches into another",
            "closed bodies reach into others",
            "the file will hold them as solids that overlap; unite them first if they are one part",
        ),
    ):
        if finding.place is not None:
            told.append(f"{_counted(finding, one, several, 'first at')}; {advice}")
    return told


def usability(mesh: Mesh, soundness: Soundness) -> Literal["yes", "with --repair", "no"]:
    """Whether faces can be made of the mesh."""
    if mesh.delta > COARSEST_RESOLUTION * mesh.size:
        return "no"
    if not describe_faults(soundness):
        return "yes"
    mended, done = repair(mesh)
    return "no" if not done or describe_faults(inspect(mended)) else "with --repair"


def _counted(finding: Finding, one: str, several: str, where: str) -> str:
    place = "" if finding.place is None else place_text(finding.place)
    first = where.removeprefix("first ") if finding.count == 1 else f"the {where}"
    return f"{counted(finding.count, one, several)}, {first} {place}"
