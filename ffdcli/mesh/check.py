"""What is wrong with a mesh, counted and placed; and what the pipeline cannot take."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffdcli.corners import next_corners
from ffdcli.errors import MeshError
from ffdcli.mesh.edges import find_edges
from ffdcli.mesh.polygons import area_vectors, place_text, repeats_a_vertex
from ffdcli.mesh.record import Floats, Ints, Mesh
from ffdcli.mesh.shells import ShellNesting, shells

Bools = NDArray[np.bool_]


# Share of the size that the file's numbers must tell apart, or nothing is certainly flat.
COARSEST_RESOLUTION = 1e-4


@dataclass(frozen=True)
class Finding:
    """How often something occurs, and where first.

    Parameters
    ----------
    count : int
    place : (3,) float64 or None, model length
        Middle of the first edge, or of the first polygon's corners; None where there is none.
    """

    count: int
    place: Floats | None = None


@dataclass(frozen=True)
class Soundness:
    """What `inspect` found.

    Parameters
    ----------
    closed : bool
        Every edge is used exactly twice, in opposite senses.
    open_edges, nonmanifold_edges, inconsistent_edges : Finding
        Edges used once; more than twice; twice in the same sense.
    degenerate : Finding
        Polygons that repeat a vertex, or whose area is zero up to the rounding of coordinates.
    duplicates : Finding
        Polygons on the same vertices as an earlier one.
    inside_out : Finding
        Closed bodies that face inwards and are no cavity.
    nesting : ShellNesting
        The bodies themselves: labels, signed volumes, cavities.
    """

    closed: bool
    open_edges: Finding
    nonmanifold_edges: Finding
    inconsistent_edges: Finding
    degenerate: Finding
    duplicates: Finding
    inside_out: Finding
    nesting: ShellNesting

    @property
    def bodies(self) -> int:
        """Number of edge-connected bodies."""
        return len(self.nesting.volume)

    @property
    def volumes(self) -> Floats:
        """(B,) signed volume of each body, model length cubed; means nothing for open ones."""
        return self.nesting.volume


def inspect(mesh: Mesh) -> Soundness:
    """Look for everything that keeps a mesh from being the boundary of solids."""
    edges = find_edges(mesh)
    nesting = shells(mesh, edges)
    twice = edges.uses == 2
    inverted = np.isin(nesting.body, nesting.inside_out)
    first_inverted = _polygon_finding(mesh, inverted)

    def edge_finding(chosen: Bools) -> Finding:
        if not chosen.any():
            return Finding(0)
        ends = mesh.vertices[edges.ends[np.argmax(chosen)]]
        return Finding(int(np.count_nonzero(chosen)), ends.mean(axis=0))

    return Soundness(
        closed=bool(np.all(nesting.closed)),
        open_edges=edge_finding(edges.uses == 1),
        nonmanifold_edges=edge_finding(edges.uses > 2),
        inconsistent_edges=edge_finding(twice & (edges.forward != 1)),
        degenerate=_polygon_finding(mesh, _find_degenerate(mesh)),
        duplicates=_polygon_finding(mesh, _find_duplicates(mesh)),
        inside_out=Finding(len(nesting.inside_out), first_inverted.place),
        nesting=nesting,
    )


def describe(mesh: Mesh, soundness: Soundness) -> dict[str, Any]:
    """What reports say of a mesh."""
    return {
        "vertices": len(np.unique(mesh.corners)),
        "polygons": mesh.polygon_count,
        "bodies": soundness.bodies,
        "closed": soundness.closed,
    }


def require_usable(mesh: Mesh, soundness: Soundness) -> None:
    """Refuse what cannot be turned into faces. An open mesh is fine: it gives an open shell.

    Raises
    ------
    MeshError
        Naming the first kind of fault met, how many there are, and where the first one is.
    """
    if mesh.delta > COARSEST_RESOLUTION * mesh.size:
        raise MeshError(
            f"the file's numbers tell points apart only to {mesh.delta:.2g}, too coarse for a model"
            f" of size {mesh.size:.3g}",
            file=mesh.source,
            hint="move the model near the origin, or export it with more digits",
        )
    mend = "mend it in a mesh editor and export it again"
    faults = (
        (soundness.degenerate, "polygons have no area or repeat a vertex", mend),
        (soundness.duplicates, "polygons lie on the same vertices as another", mend),
        (
            soundness.nonmanifold_edges,
            "edges are shared by more than two polygons",
            "separate the bodies that touch there, or delete the inner polygons",
        ),
        (
            soundness.inconsistent_edges,
            "edges join polygons wound in opposite directions",
            "make the normals consistent in a mesh editor and export it again",
        ),
        (
            soundness.inside_out,
            "closed bodies are inside out (their polygons face inwards)",
            "flip their normals in a mesh editor and export it again",
        ),
    )
    for finding, what, hint in faults:
        if finding.count and finding.place is not None:
            raise MeshError(
                f"{finding.count} {what}, the first near {place_text(finding.place)}",
                file=mesh.source,
                hint=hint,
            )


def _polygon_finding(mesh: Mesh, chosen: Bools) -> Finding:
    if not chosen.any():
        return Finding(0)
    first = int(np.argmax(chosen))
    loop = mesh.corners[mesh.starts[first] : mesh.starts[first + 1]]
    return Finding(int(np.count_nonzero(chosen)), mesh.vertices[loop].mean(axis=0))


def require_closed(mesh: Mesh, soundness: Soundness) -> None:
    """Refuse an open mesh, where a solid is asked for.

    Raises
    ------
    MeshError
        Saying how many edges are open, and where the first one is.
    """
    found = soundness.open_edges
    if found.place is not None:
        raise MeshError(
            f"the mesh is open, and a solid is required: {found.count} edges belong to one polygon"
            f" only, the first near {place_text(found.place)}",
            file=mesh.source,
            hint="close it in a mesh editor, or do without a solid",
        )


def _find_degenerate(mesh: Mesh) -> Bools:
    """(P,) polygons that repeat a vertex, or are thinner than coordinates can tell."""
    points = mesh.vertices[mesh.corners]
    sides = np.linalg.norm(points[next_corners(mesh.starts)] - points, axis=1)
    perimeter = np.add.reduceat(sides, mesh.starts[:-1])
    area = np.linalg.norm(area_vectors(mesh.vertices, mesh.corners, mesh.starts), axis=1)
    # Coordinates rounded by half a unit in the last place move the area by at most so much.
    rounding = 4 * np.spacing(np.abs(points).max()) * perimeter
    degenerate: Bools = repeats_a_vertex(mesh.corners, mesh.starts) | (area <= rounding)
    return degenerate


def _find_duplicates(mesh: Mesh) -> Bools:
    """(P,) polygons whose set of vertices an earlier polygon has already."""
    counts = np.diff(mesh.starts)
    again = np.zeros(mesh.polygon_count, dtype=bool)
    for count in np.unique(counts).tolist():
        polygon: Ints = np.flatnonzero(counts == count)
        loops = np.sort(mesh.corners[mesh.starts[polygon][:, None] + np.arange(count)], axis=1)
        _, first = np.unique(loops, axis=0, return_index=True)
        later = np.ones(len(polygon), dtype=bool)
        later[first] = False
        again[polygon[later]] = True
    return again
