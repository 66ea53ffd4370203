"""Mend what can be mended without moving the surface: the steps, in their order.

No step fills a hole or moves a point further than the weld reach. A sound mesh comes back as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ffdcli.arrays import Bools, Ints
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

# One step can uncover work for an earlier one: rounds are made until none finds any.
_MOST_ROUNDS = 5

_VERTICES = ("vertex", "vertices")

Step = Callable[[Mesh], tuple[Mesh, str]]


def repair(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """Mend a mesh without moving its surface.

    Vertices that are roundings of one point are welded; polygons without area, spikes and useless
    copies are dropped; vertices in the middle of open edges are put into them; polygons are wound
    one way, outwards; surfaces that touch in points or along edges get vertices of their own. Holes
    stay, and so do walls inside bodies and surfaces that cross.

    Parameters
    ----------
    mesh : Mesh

    Returns
    -------
    mesh : Mesh
        The very same object where nothing was to be done. Otherwise its `notes` say what was; its
        `resolution` is at least the distance by which vertices were welded.
    done : tuple of str
        What was done: one plain sentence for each kind, with count and first place.
    """
    mended, done = mesh, []
    for _ in range(_MOST_ROUNDS):
        found = []
        for step in _STEPS:
            trial, what = step(mended)
            # A mesh of nothing but faults is left for the checks to refuse.
            if what and trial.polygon_count:
                mended = trial
                found.append(what)
        done += found
        if not found:
            break
    if not done:
        return mesh, ()
    mended = split_bent(_without_strays(mended))
    done = [f"repaired: {what}" for what in done]
    return replace(mended, notes=(*mended.notes, *done)), tuple(done)


def _weld(mesh: Mesh) -> tuple[Mesh, str]:
    moved, target = find_near(mesh, find_edges(mesh))
    return _moved(mesh, moved, target, *_VERTICES)


def _collapse_needles(mesh: Mesh) -> tuple[Mesh, str]:
    moved, target = find_needle_ends(mesh, find_degenerate(mesh), weld_reach(mesh))
    return _moved(
        mesh, moved, target, "end of a polygon without area", "ends of polygons without area"
    )


def _moved(mesh: Mesh, moved: Ints, target: Ints, one: str, several: str) -> tuple[Mesh, str]:
    if not len(moved):
        return mesh, ""
    index = np.arange(len(mesh.vertices))
    index[moved] = target
    apart = np.linalg.norm(mesh.vertices[moved] - mesh.vertices[target], axis=1)
    furthest = float(apart.max())
    resolution = max(mesh.resolution, furthest)
    welded = replace(mesh, corners=index[mesh.corners], resolution=resolution)
    distance = f"at most {furthest:.2g} away" if furthest else "at the same place"
    did = f"welded to another {distance}, the first at {place_text(mesh.vertices[target[0]])}"
    return welded, f"{_were(len(moved), one, several)} {did}"


def _drop_degenerate(mesh: Mesh) -> tuple[Mesh, str]:
    cut = cut_spikes(mesh)
    spikes = (len(mesh.corners) - len(cut.corners)) // 2
    if cut.polygon_count:
        cut = cut.without(find_degenerate(cut))
    gone = mesh.polygon_count - cut.polygon_count
    if gone:
        thin = find_degenerate(mesh)
        place = (
            f", the first near {_polygon_place(mesh, int(np.argmax(thin)))}" if thin.any() else ""
        )
        area = _were(gone, "polygon without area", "polygons without area")
        return cut, f"{area} dropped{place}"
    return cut, f"{_were(spikes, 'spike', 'spikes')} cut off outlines" if spikes else ""


def _drop_duplicates(mesh: Mesh) -> tuple[Mesh, str]:
    return _chosen(
        mesh, find_redundant(mesh), Mesh.without, "dropped for having another's vertices"
    )


def _join_t_junctions(mesh: Mesh) -> tuple[Mesh, str]:
    corner, vertex = find_t_junctions(mesh, find_edges(mesh))
    if not len(corner):
        return mesh, ""
    did = f"put into open edges, the first at {place_text(mesh.vertices[vertex[0]])}"
    return insert_vertices(mesh, corner, vertex), f"{_were(len(corner), *_VERTICES)} {did}"


def _wind_alike(mesh: Mesh) -> tuple[Mesh, str]:
    return _chosen(
        mesh, find_miswound(mesh, find_edges(mesh)), turn, "turned to match the neighbours"
    )


def _part_surfaces(mesh: Mesh) -> tuple[Mesh, str]:
    edges = find_edges(mesh)
    parted = split_fans(mesh, edges, pair_polygons(mesh, edges, weld_reach(mesh)))
    added = len(parted.vertices) - len(mesh.vertices)
    if not added:
        return mesh, ""
    did = "doubled to part surfaces that touch, the first at"
    place = place_text(parted.vertices[len(mesh.vertices)])
    return parted, f"{_were(added, *_VERTICES)} {did} {place}"


def _face_outwards(mesh: Mesh) -> tuple[Mesh, str]:
    if triangulate(mesh.vertices, mesh.corners, mesh.starts)[2].any():
        return mesh, ""
    nesting = shells(mesh)
    turned = find_inverted_bodies(mesh, nesting)
    if not turned.any():
        return mesh, ""
    chosen = turned[nesting.body]
    place = _polygon_place(mesh, int(np.argmax(chosen)))
    bodies = _were(int(np.count_nonzero(turned)), "closed body", "closed bodies")
    return turn(mesh, chosen), f"{bodies} turned the right side out, the first near {place}"


def _chosen(
    mesh: Mesh, chosen: Bools, change: Callable[[Mesh, Bools], Mesh], did: str
) -> tuple[Mesh, str]:
    """Change the chosen polygons (P,), and say how many they are."""
    if not chosen.any():
        return mesh, ""
    place = _polygon_place(mesh, int(np.argmax(chosen)))
    polygons = _were(int(np.count_nonzero(chosen)), "polygon", "polygons")
    return change(mesh, chosen), f"{polygons} {did}, the first near {place}"


def _were(count: int, one: str, several: str) -> str:
    return counted(count, f"{one} was", f"{several} were")


def _without_strays(mesh: Mesh) -> Mesh:
    kept, corners = np.unique(mesh.corners, return_inverse=True)
    return replace(mesh, vertices=mesh.vertices[kept], corners=corners.astype(np.int64))


_STEPS: tuple[Step, ...] = (
    _weld,
    _collapse_needles,
    _drop_degenerate,
    _drop_duplicates,
    _join_t_junctions,
    _wind_alike,
    _part_surfaces,
    _face_outwards,
)


def _polygon_place(mesh: Mesh, polygon: int) -> str:
    """The middle of a polygon's corners, for a message."""
    loop = mesh.corners[mesh.starts[polygon] : mesh.starts[polygon + 1]]
    return place_text(mesh.vertices[loop].mean(axis=0))
