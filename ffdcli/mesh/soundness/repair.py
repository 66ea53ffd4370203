"""Repair of a mesh without moving its surface: the steps, and their order.

No step fills a hole or moves a vertex further than the weld reach. A sound mesh is returned as it
is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.mesh.edges import find_edges
from ffdcli.mesh.polygons import split_bent, triangulate
from ffdcli.mesh.record import Mesh
from ffdcli.mesh.shells import shells
from ffdcli.mesh.soundness.degenerate import cut_spikes, find_degenerate, find_needle_ends
from ffdcli.mesh.soundness.duplicates import find_redundant
from ffdcli.mesh.soundness.fans import pair_polygons, split_fans
from ffdcli.mesh.soundness.orientation import find_inverted_bodies, find_miswound, turn
from ffdcli.mesh.soundness.t_junctions import find_t_junctions, insert_vertices
from ffdcli.mesh.soundness.weld import find_near, weld_reach
from ffdcli.messages import counted, place_text

# One step can uncover work for an earlier one, so all are repeated until none changes anything.
_MOST_ROUNDS = 5

_VERTICES = ("vertex", "vertices")

# Returns the repaired mesh and a sentence on what was done; "" if the mesh is unchanged.
Step = Callable[[Mesh], tuple[Mesh, str]]


def repair(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """Repair a mesh without moving its surface.

    Vertices that are roundings of one point are welded. Polygons without area, spikes and redundant
    duplicates are dropped. Vertices in the middle of open edges are inserted into them. Polygons
    are wound alike, closed bodies outwards. Surfaces that touch in points or along edges get
    vertices of their own. Holes, walls inside bodies and surfaces that cross are left.

    Returns
    -------
    mesh : Mesh
        The same object if there was nothing to do. Otherwise its `notes` say what was done, and its
        `resolution` is at least the distance by which vertices were welded.
    done : tuple of str
        What was done: one sentence for each kind, with count and first place.
    """
    repaired, done = mesh, []
    for _ in range(_MOST_ROUNDS):
        found = []
        for step in _STEPS:
            trial, what = step(repaired)
            # A mesh that would lose all polygons is left for the checks to reject.
            if what and trial.polygon_count:
                repaired = trial
                found.append(what)
        done += found
        if not found:
            break
    if not done:
        return mesh, ()
    repaired = split_bent(_without_unused_vertices(repaired))
    done = [f"repaired: {what}" for what in done]
    return replace(repaired, notes=(*repaired.notes, *done)), tuple(done)


def _weld(mesh: Mesh) -> tuple[Mesh, str]:
    moved, target = find_near(mesh, find_edges(mesh))
    return _merged(mesh, moved, target, *_VERTICES)


def _collapse_needles(mesh: Mesh) -> tuple[Mesh, str]:
    moved, target = find_needle_ends(mesh, find_degenerate(mesh), weld_reach(mesh))
    return _merged(
        mesh, moved, target, "end of a polygon without area", "ends of polygons without area"
    )


def _merged(mesh: Mesh, moved: Ints, target: Ints, one: str, several: str) -> tuple[Mesh, str]:
    if not len(moved):
        return mesh, ""
    index = np.arange(len(mesh.vertices))
    index[moved] = target
    distances = np.linalg.norm(mesh.vertices[moved] - mesh.vertices[target], axis=1)
    furthest = float(distances.max())
    resolution = max(mesh.resolution, furthest)
    welded = replace(mesh, corners=index[mesh.corners], resolution=resolution)
    distance = f"at most {furthest:.2g} away" if furthest else "at the same place"
    return welded, (
        _were(len(moved), one, several, f"welded to {'another' if len(moved) == 1 else 'others'}")
        + f" {distance}{_first('at', mesh.vertices[target[0]])}"
    )


def _drop_degenerate(mesh: Mesh) -> tuple[Mesh, str]:
    cut = cut_spikes(mesh)
    spikes = (len(mesh.corners) - len(cut.corners)) // 2
    if cut.polygon_count:
        cut = cut.without(find_degenerate(cut))
    gone = mesh.polygon_count - cut.polygon_count
    if gone:
        thin = find_degenerate(mesh)
        first = _first("near", mesh.middle(int(np.argmax(thin)))) if thin.any() else ""
        what = ("polygon without area", "polygons without area")
        return cut, _were(gone, *what, "dropped") + first
    what = ("spike of an outline", "spikes of outlines")
    return cut, _were(spikes, *what, "removed") if spikes else ""


def _drop_duplicates(mesh: Mesh) -> tuple[Mesh, str]:
    did = "dropped because others have the same vertices"
    return _changed(mesh, find_redundant(mesh), Mesh.without, did)


def _join_t_junctions(mesh: Mesh) -> tuple[Mesh, str]:
    corner, vertex = find_t_junctions(mesh, find_edges(mesh))
    if not len(corner):
        return mesh, ""
    what = _were(len(corner), *_VERTICES, "inserted into open edges")
    return insert_vertices(mesh, corner, vertex), what + _first("at", mesh.vertices[vertex[0]])


def _wind_alike(mesh: Mesh) -> tuple[Mesh, str]:
    miswound = find_miswound(mesh, find_edges(mesh))
    return _changed(mesh, miswound, turn, "flipped to match the neighbours")


def _separate_surfaces(mesh: Mesh) -> tuple[Mesh, str]:
    edges = find_edges(mesh)
    parted = split_fans(mesh, edges, pair_polygons(mesh, edges, weld_reach(mesh)))
    count = len(mesh.vertices)
    if len(parted.vertices) == count:
        return mesh, ""
    did = "doubled to separate surfaces that touch"
    what = _were(len(parted.vertices) - count, *_VERTICES, did)
    return parted, what + _first("at", parted.vertices[count])


def _face_outwards(mesh: Mesh) -> tuple[Mesh, str]:
    if triangulate(mesh.vertices, mesh.corners, mesh.starts)[2].any():
        return mesh, ""
    nesting = shells(mesh)
    inverted = find_inverted_bodies(mesh, nesting)
    if not inverted.any():
        return mesh, ""
    chosen = inverted[nesting.body]
    count = int(np.count_nonzero(inverted))
    what = _were(count, "closed body", "closed bodies", "flipped to face outwards")
    return turn(mesh, chosen), what + _first("near", mesh.middle(int(np.argmax(chosen))))


def _changed(
    mesh: Mesh, chosen: Bools, change: Callable[[Mesh, Bools], Mesh], did: str
) -> tuple[Mesh, str]:
    """Change the chosen polygons (P,)."""
    if not chosen.any():
        return mesh, ""
    what = _were(int(np.count_nonzero(chosen)), "polygon", "polygons", did)
    return change(mesh, chosen), what + _first("near", mesh.middle(int(np.argmax(chosen))))


def _were(count: int, one: str, several: str, did: str) -> str:
    return counted(count, f"{one} was {did}", f"{several} were {did}")


def _first(where: str, point: Floats) -> str:
    return f", the first {where} {place_text(point)}"


def _without_unused_vertices(mesh: Mesh) -> Mesh:
    kept, corners = np.unique(mesh.corners, return_inverse=True)
    return replace(mesh, vertices=mesh.vertices[kept], corners=corners.astype(np.int64))


_STEPS: tuple[Step, ...] = (
    _weld,
    _collapse_needles,
    _drop_degenerate,
    _drop_duplicates,
    _join_t_junctions,
    _wind_alike,
    _separate_surfaces,
    _face_outwards,
)
