"""Panels of a scene: the mesh before and the faces after the deformation."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.view import colours
from ffdcli.view.panel import Arrows, Balls, Panel, Part, Strokes, Triangles
from ffdcli.view.scene import DrawnNet, Scene, Skin

# Width of the outlines of faces in pixels; thin if there are many faces.
_EDGE, _FINE_EDGE, _MANY = 1.6, 0.8, 800
# Outlines of more faces than this let the faces shine through; they would cover them otherwise.
_CROWD, _FAINTEST = 2000, 0.15


def before_and_after(scene: Scene) -> list[Panel]:
    """The mesh in the lattice at rest, and the exact faces in the edited lattice."""
    width = _EDGE if len(scene.faces.degrees) < _MANY else _FINE_EDGE
    faces = tinted(scene.after, scene.faces.colour, width=width)
    after = Panel(scene.facts, (*faces, *_lattice(scene, -1), *_drags(scene)))
    if scene.before is None:
        return [after]
    before = one_colour(scene.before, scene.before.frames[0], colours.BEFORE, smooth=False)
    edges = outline(scene.before, scene.before.frames[0], 0.8)
    parts = (before, edges, *_lattice(scene, 0), *cell_parts(scene.cells))
    count, hidden = sum(len(net.hidden) for net in scene.lattices), scene.hidden_count
    said = f" ({hidden} of {count} control points hidden)"
    return [Panel(scene.title + said * (hidden > 0 and not scene.hidden_points), parts), after]


def _lattice(scene: Scene, frame: int) -> tuple[Part, ...]:
    shown = (net_parts(net, frame, hidden_points=scene.hidden_points) for net in scene.lattices)
    return tuple(part for parts in shown for part in parts)


def net_parts(
    net: DrawnNet, frame: int, *, hidden_points: bool, width: float = 1.2, radius: float = 4.5
) -> tuple[Part, ...]:
    """Lines and control points of a net at one of its amplitudes, sizes in pixels."""
    points, shown = net.frames[frame], ~net.hidden
    kinds = [(shown & ~net.locked, colours.POINT), (shown & net.locked, colours.LOCKED)]
    kinds += [(net.hidden, colours.HIDDEN)] if hidden_points else []
    balls = (Balls(points[chosen], colour, radius) for chosen, colour in kinds if chosen.any())
    return Strokes(points[net.lines], colours.LATTICE, width), *balls


def cell_parts(cells: Floats) -> tuple[Part, ...]:
    """Edges of octree cells, none where there are no cells."""
    return (Strokes(cells, colours.CELL, 0.6),) if len(cells) else ()


def _drags(scene: Scene) -> tuple[Part, ...]:
    return (Arrows(scene.drags, colours.DRAG),) if len(scene.drags) else ()


def one_colour(skin: Skin, points: Floats, colour: str, *, smooth: bool) -> Triangles:
    """Triangles of a skin in one colour."""
    paint = np.tile(colours.rgb(colour), (len(skin.triangles), 1))
    return Triangles(points, skin.triangles, paint, smooth)


def outline(skin: Skin, points: Floats, width: float) -> Strokes:
    """Outlines of the faces of a skin."""
    return edges_of(points[skin.outline], int(skin.face.max(initial=0)) + 1, width)


def edges_of(segments: Floats, count: int, width: float) -> Strokes:
    """Outlines (m, 2, 3) of a number of faces."""
    return Strokes(segments, colours.LINE, width, max(_FAINTEST, min(1.0, _CROWD / count)))


def tinted(
    skin: Skin, number: Ints, *, smooth: bool = True, width: float = 1.0
) -> tuple[Part, ...]:
    """Skin at its last amplitude with outlines; the faces have the colours with numbers (F,)."""
    tints = np.array([colours.rgb(colour) for colour in colours.FACES])
    paint, points = tints[number[skin.face] % len(tints)], skin.frames[-1]
    return Triangles(points, skin.triangles, paint, smooth), outline(skin, points, width)
