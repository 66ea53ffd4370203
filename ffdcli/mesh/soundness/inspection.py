"""Inspection of a mesh: counts and places of everything that makes it unsound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.mesh.edges import find_edges
from ffdcli.mesh.polygons import triangulate
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.shells import ShellNesting, find_overlaps, shells
from ffdcli.mesh.soundness.coincident import find_coincident
from ffdcli.mesh.soundness.degenerate import find_degenerate
from ffdcli.mesh.soundness.duplicates import find_duplicates
from ffdcli.mesh.soundness.fans import find_pinched
from ffdcli.mesh.soundness.t_junctions import find_t_junctions
from ffdcli.mesh.soundness.weld import find_near


@dataclass(frozen=True)
class Finding:
    """Number of occurrences of a fault, and the place (3,) of the first, model length.

    The place is the middle of the first edge or of the first polygon's corners; None without any.
    """

    count: int
    place: Floats | None = None


@dataclass(frozen=True)
class Soundness:
    """Result of `inspect`.

    Parameters
    ----------
    closed : bool
        Every edge is used exactly twice, in opposite senses.
    open_edges, nonmanifold_edges, inconsistent_edges : Finding
        Edges used once; more than twice; twice in the same sense.
    nonmanifold_vertices : Finding
        Vertices, not on a boundary, where surfaces touch in a point.
    degenerate : Finding
        Polygons whose area is zero up to the rounding of coordinates.
    crossing : Finding
        Polygons that cross themselves.
    duplicates : Finding
        Polygons on the same vertices as an earlier one.
    inside_out : Finding
        Closed bodies that face inwards and are no cavity.
    unwelded : Finding
        Vertices at open edges within rounding of another such vertex.
    t_junctions : Finding
        Vertices at open edges that lie within another open edge.
    overlaps : Finding
        Closed bodies with points in the material of others, as `find_overlaps` samples them.
    coincident : Finding
        Closed bodies on an earlier one, as `find_coincident` finds them.
    nesting : ShellNesting
        Labels, signed volumes and cavities of the bodies.
    """

    closed: bool
    open_edges: Finding
    nonmanifold_edges: Finding
    inconsistent_edges: Finding
    nonmanifold_vertices: Finding
    degenerate: Finding
    crossing: Finding
    duplicates: Finding
    inside_out: Finding
    unwelded: Finding
    t_junctions: Finding
    overlaps: Finding
    coincident: Finding
    nesting: ShellNesting

    @property
    def bodies(self) -> int:
        """Number of edge-connected bodies."""
        return len(self.nesting.volume)

    @property
    def volumes(self) -> Floats:
        """(B,) signed volume of each body, model length cubed; meaningless for open bodies."""
        return self.nesting.volume


def inspect(mesh: Mesh) -> Soundness:
    """Find everything that keeps a mesh from being the boundary of solids."""
    edges = find_edges(mesh)
    crossing = triangulate(mesh.vertices, mesh.corners, mesh.starts)[2]
    degenerate = find_degenerate(mesh)
    crossing &= ~degenerate
    nesting = shells(mesh, edges, nested=not crossing.any())
    twice = edges.uses == 2
    inverted = np.isin(nesting.body, nesting.inside_out)
    twins = find_coincident(mesh, nesting)[:, 0]

    def edge_finding(chosen: Bools) -> Finding:
        if not chosen.any():
            return Finding(0)
        ends = mesh.vertices[edges.ends[np.argmax(chosen)]]
        return Finding(int(np.count_nonzero(chosen)), ends.mean(axis=0))

    overlaps = np.empty((0, 3)) if crossing.any() else find_overlaps(mesh, nesting)
    return Soundness(
        closed=bool(np.all(nesting.closed)),
        open_edges=edge_finding(edges.uses == 1),
        nonmanifold_edges=edge_finding(edges.uses > 2),
        inconsistent_edges=edge_finding(twice & (edges.forward != 1)),
        nonmanifold_vertices=_point_finding(mesh.vertices[find_pinched(mesh, edges)]),
        degenerate=_polygon_finding(mesh, degenerate),
        crossing=_polygon_finding(mesh, crossing),
        duplicates=_polygon_finding(mesh, find_duplicates(mesh).again),
        inside_out=Finding(len(nesting.inside_out), _polygon_finding(mesh, inverted).place),
        unwelded=_point_finding(mesh.vertices[find_near(mesh, edges)[0]]),
        t_junctions=_point_finding(mesh.vertices[np.unique(find_t_junctions(mesh, edges)[1])]),
        overlaps=_point_finding(overlaps),
        coincident=Finding(
            len(twins), _polygon_finding(mesh, np.isin(nesting.body, twins[:1])).place
        ),
        nesting=nesting,
    )


def describe(mesh: Mesh, soundness: Soundness) -> dict[str, Any]:
    """The entry ``mesh`` of reports."""
    return {
        "vertices": len(np.unique(mesh.corners)),
        "polygons": mesh.polygon_count,
        "bodies": soundness.bodies,
        "closed": soundness.closed,
    }


def _point_finding(points: Floats) -> Finding:
    return Finding(len(points), points[0]) if len(points) else Finding(0)


def _polygon_finding(mesh: Mesh, chosen: Bools) -> Finding:
    if not chosen.any():
        return Finding(0)
    return Finding(int(np.count_nonzero(chosen)), mesh.middle(int(np.argmax(chosen))))
