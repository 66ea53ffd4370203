"""The eight panels of Feng et al. 2002, Figs. 7-13, for any mesh and lattice.

They show how earlier methods and this one cut the mesh, and the surfaces that they produce.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.compare.subdivide import cut_mesh
from ffdcli.compare.triangular import interpolate_triangles
from ffdcli.deformation import Deformation
from ffdcli.formats import Subdivision
from ffdcli.plan import Plan
from ffdcli.splines.polynomials import bernstein
from ffdcli.tessellate.signed_errors import grid
from ffdcli.tessellate.subdivided import subdivide_mesh
from ffdcli.view import colours
from ffdcli.view.before_after import (
    cell_parts,
    edges_of,
    net_parts,
    one_colour,
    outline,
    tinted,
)
from ffdcli.view.deformation_scene import CHORD, cell_edges, drawn_net, mesh_skin
from ffdcli.view.panel import Panel, Part, Triangles
from ffdcli.view.scene import colour_faces, skin
from ffdcli.volume.protocol import Volume
from ffdcli.volume.weights import cartesian

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice

# Number of segments along each side of a drawn patch.
_FINE = 6
_LEVELS = 2


def eight_panels(plan: Plan, lattice: Lattice, *, hidden_points: bool = False) -> list[Panel]:
    """Panels of the stages of earlier methods and of this one.

    On octrees the polynomial cells take the place of knot boxes. Where the lattice is fitted, the
    panels with surfaces show the fitted volume, and say so.

    Parameters
    ----------
    plan : Plan
        Of a lattice alone in its file, prepared with ``patches="paper"``.
    lattice : Lattice
        The lattice that the plan was prepared for.
    hidden_points : bool
        Draw the hidden control points of octrees.

    Raises
    ------
    MeshError, LatticeError, CheckError
        As for :func:`ffdcli.pipeline.deform`.
    """
    mesh = plan.origin.checked.mesh
    before = mesh_skin(mesh)
    still = before.frames[0]
    (volume,) = plan.volumes
    cut, inside = cut_mesh(mesh, volume)
    net = drawn_net(lattice.member, np.array([0.0, 1.0]))
    rest, edited = (
        net_parts(net, frame, hidden_points=hidden_points, width=1.0, radius=3.5)
        for frame in range(2)
    )
    fitted = "" if plan.fitted is None else " (fitted)"
    return [
        Panel(
            "1  original, with its lattice",
            (
                one_colour(before, still, colours.BEFORE, smooth=False),
                outline(before, still, 1.0),
                *rest,
                *cell_parts(cell_edges(lattice.members)),
            ),
        ),
        Panel("2  vertices deformed", (*_subdivided(plan, lattice, 0), *edited)),
        Panel(f"3  subdivided {_LEVELS} times, deformed", _subdivided(plan, lattice, _LEVELS)),
        Panel(
            f"4  previous: cut into triangles{fitted}", _flat_triangles(volume.frame.to_model(cut))
        ),
        Panel(
            f"5  previous: triangular Bézier{fitted}",
            _triangular(volume, cut[inside], cut[~inside]),
        ),
        Panel(f"6  coplanar sub-polygons{fitted}", _sub_polygons(plan)),
        Panel(f"7  tensor-product, whole{fitted}", _whole_patches(plan, volume)),
        Panel(f"8  trimmed: the result{fitted}", _trimmed(plan, lattice)),
    ]


def _subdivided(plan: Plan, lattice: Lattice, levels: int) -> tuple[Part, ...]:
    checked = plan.origin.checked
    deformation = Deformation.of(lattice, checked.mesh.delta)
    mode: Subdivision = "uniform" if levels else "vertices"
    made = subdivide_mesh(checked, deformation, mode, None, levels or None, keep_texture=False)
    number = np.arange(len(made.triangles))
    every = skin(made.refined.points[None], made.triangles, number)
    points = every.frames[0]
    return one_colour(every, points, colours.FACES[0], smooth=False), outline(every, points, 0.8)


def _flat_triangles(corners: Floats) -> tuple[Part, ...]:
    """Triangles (N, 3, 3), each with its own points and outline."""
    index = np.arange(corners.size // 3).reshape(-1, 3)
    paint = np.tile(colours.rgb(colours.BEFORE), (len(index), 1))
    facets = Triangles(corners.reshape(-1, 3), index, paint, smooth=False)
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    return facets, edges_of(sides, len(corners), 0.8)


def _triangular(volume: Volume, inside: Floats, outside: Floats) -> tuple[Part, ...]:
    made = interpolate_triangles(volume, inside)
    places, cells = grid(_FINE)
    images = volume.frame.to_model(made.evaluate(places))
    parts = _patches(images, cells)
    flat = _flat_triangles(volume.frame.to_model(outside)) if len(outside) else ()
    return *parts, *flat


def _patches(points: Floats, cells: Ints, number: Ints | None = None) -> tuple[Part, ...]:
    """Patches with points (m, q, 3), all with triangles (s, 3); their numbers give the colours."""
    count, each = points.shape[:2]
    corners = (np.arange(count)[:, None, None] * each + cells).reshape(-1, 3)
    face = np.repeat(np.arange(count), len(cells))
    made = skin(points.reshape(1, -1, 3), corners, face)
    return tinted(made, np.arange(count) if number is None else number)


def _sub_polygons(plan: Plan) -> tuple[Part, ...]:
    """The undeformed pieces, divided into triangle fans: they are convex."""
    parts = plan.geometry.parts
    pieces = parts.pieces
    counts = np.diff(pieces.starts)
    piece = np.repeat(np.arange(pieces.count), counts - 2)
    step = np.arange(len(piece)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    first = pieces.starts[:-1][piece]
    corners = pieces.corners[np.stack([first, first + step + 1, first + step + 2], axis=1)]
    points = plan.volumes[0].frame.to_model(parts.pieces.vertices[:, 0])
    made = skin(points[None], corners, piece)
    return tinted(made, parts.patch[parts.region], smooth=False)


def _whole_patches(plan: Plan, volume: Volume) -> tuple[Part, ...]:
    share = np.linspace(0, 1, _FINE + 1)
    images, numbers = [np.zeros((0, (_FINE + 1) ** 2, 3))], [np.zeros(0, dtype=np.int64)]
    for batch in plan.geometry.patches:
        points = batch.control_points(volume.net, np.arange(batch.count))
        along_s, along_t = (bernstein(degree, share) for degree in batch.degrees)
        made = cartesian(np.einsum("ai,bj,mijd->mabd", along_s, along_t, points))
        images.append(volume.frame.to_model(made.reshape(batch.count, -1, 3)))
        numbers.append(batch.patches)
    return _patches(np.concatenate(images), _grid_cells(), np.concatenate(numbers))


def _grid_cells() -> Ints:
    """Triangles of a square grid, (2 n², 3)."""
    number = np.arange((_FINE + 1) ** 2).reshape(_FINE + 1, _FINE + 1)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    halves = [np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]
    return np.concatenate([half.reshape(-1, 3) for half in halves])


def _trimmed(plan: Plan, lattice: Lattice) -> tuple[Part, ...]:
    result = plan.deform(lattice, check=False)
    fine = result.tessellate(CHORD * plan.origin.checked.mesh.size)
    made = skin(fine.points[None], fine.triangles, fine.owner)
    return tinted(made, colour_faces(fine.triangles, fine.owner, result.brep.face_count))
