"""The eight panels of Feng et al. 2002, Figs. 7-13, for any mesh and lattice.

They show how earlier methods and this one cut the mesh, and the surfaces that they produce.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.compare.subdivide import cut_mesh
from ffdcli.compare.triangular import interpolate_triangles
from ffdcli.mesh import Mesh
from ffdcli.pipeline import Plan, deform_mesh, prepare
from ffdcli.splines.polynomials import bernstein
from ffdcli.tessellate.signed_errors import grid
from ffdcli.view import colours
from ffdcli.view.before_after import one_colour, outline, tinted
from ffdcli.view.deformation_scene import CHORD, mesh_skin
from ffdcli.view.panel import Balls, Panel, Part, Strokes, Triangles
from ffdcli.view.scene import colour_faces, grid_lines, skin
from ffdcli.volume.protocol import Volume
from ffdcli.volume.weights import cartesian

if TYPE_CHECKING:
    from ffdcli.lattice import Lattice

# Number of segments along each side of a drawn patch.
_FINE = 6
_LEVELS = 2


def eight_panels(mesh: Mesh, lattice: Lattice) -> list[Panel]:
    """Panels of the stages of earlier methods and of this one.

    Parameters
    ----------
    mesh : Mesh
    lattice : Lattice
        Fitted to the mesh.

    Raises
    ------
    MeshError, LatticeError, CheckError
        As for :func:`ffdcli.pipeline.deform`.
    """
    before = mesh_skin(mesh)
    still = before.frames[0]
    rest = lattice.scaled(0)
    plan = prepare(mesh, lattice, patches="paper")
    volume = lattice.volume
    cut, inside = cut_mesh(mesh, volume)
    return [
        Panel(
            "1  original, with its lattice",
            (
                one_colour(before, still, colours.BEFORE, smooth=False),
                outline(before, still, 1.0),
                *_control_net(rest),
            ),
        ),
        Panel("2  vertices deformed", (*_subdivided(mesh, lattice, 0), *_control_net(lattice))),
        Panel(f"3  subdivided {_LEVELS} times, deformed", _subdivided(mesh, lattice, _LEVELS)),
        Panel("4  previous: cut into triangles", _flat_triangles(volume.frame.to_model(cut))),
        Panel(
            "5  previous: triangular Bézier",
            _triangular(volume, cut[inside], cut[~inside]),
        ),
        Panel("6  sub-polygons by coplanar group", _sub_polygons(plan)),
        Panel("7  tensor-product, whole", _whole_patches(plan, volume)),
        Panel("8  trimmed: the result", _trimmed(plan, lattice)),
    ]


def _control_net(lattice: Lattice) -> tuple[Part, ...]:
    points = lattice.volume.frame.to_model(lattice.points)
    flat = points.reshape(-1, 3)
    lines = grid_lines(points.shape[:3])
    return Strokes(flat[lines], colours.LATTICE, 1.0), Balls(flat, colours.POINT, 3.5)


def _subdivided(mesh: Mesh, lattice: Lattice, levels: int) -> tuple[Part, ...]:
    made = deform_mesh(
        mesh,
        lattice,
        mode="uniform" if levels else "vertices",
        levels=levels or None,
        keep=(),
        check=False,
    )
    every = skin(made.points[None], made.triangles, np.arange(len(made.triangles)))
    points = every.frames[0]
    return one_colour(every, points, colours.FACES[0], smooth=False), outline(every, points, 0.8)


def _flat_triangles(corners: Floats) -> tuple[Part, ...]:
    """Triangles (N, 3, 3), each with its own points and outline."""
    index = np.arange(corners.size // 3).reshape(-1, 3)
    paint = np.tile(colours.rgb(colours.BEFORE), (len(index), 1))
    facets = Triangles(corners.reshape(-1, 3), index, paint, smooth=False)
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    return facets, Strokes(sides, colours.LINE, 0.8)


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
    parts: list[Part] = []
    for batch in plan.geometry.patches:
        points = batch.control_points(volume.net, np.arange(batch.count))
        along_s, along_t = (bernstein(degree, share) for degree in batch.degrees)
        images = cartesian(np.einsum("ai,bj,mijd->mabd", along_s, along_t, points))
        placed = volume.frame.to_model(images.reshape(batch.count, -1, 3))
        parts += _patches(placed, _grid_cells(), batch.patches)
    return tuple(parts)


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
