"""Panels of a scene: the mesh before and the faces after the deformation."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.view import colours
from ffdcli.view.panel import Arrows, Balls, Panel, Part, Strokes, Triangles
from ffdcli.view.scene import Scene, Skin

# Width of the outlines of faces in pixels; thin if there are many faces.
_EDGE, _FINE_EDGE, _MANY = 1.6, 0.8, 800


def before_and_after(scene: Scene) -> list[Panel]:
    """The mesh in the lattice at rest, and the exact faces in the edited lattice."""
    width = _EDGE if len(scene.faces.degrees) < _MANY else _FINE_EDGE
    faces = tinted(scene.after, scene.faces.colour, width=width)
    after = Panel(scene.facts, (*faces, *_lattice(scene, -1), *_drags(scene)))
    if scene.before is None:
        return [after]
    before = one_colour(scene.before, scene.before.frames[0], colours.BEFORE, smooth=False)
    edges = outline(scene.before, scene.before.frames[0], 0.8)
    cells = Strokes(scene.cells, colours.CELL, 0.6)
    parts = (before, edges, *_lattice(scene, 0), *((cells,) if len(scene.cells) else ()))
    return [Panel(scene.title, parts), after]


def _lattice(scene: Scene, frame: int) -> tuple[Part, ...]:
    parts: list[Part] = []
    for net in scene.lattices:
        points = net.frames[frame]
        parts.append(Strokes(points[net.lines], colours.LATTICE, 1.2))
        for locked, colour in ((False, colours.POINT), (True, colours.LOCKED)):
            chosen = points[net.locked == locked]
            if len(chosen):
                parts.append(Balls(chosen, colour))
    return tuple(parts)


def _drags(scene: Scene) -> tuple[Part, ...]:
    return (Arrows(scene.drags, colours.DRAG),) if len(scene.drags) else ()


def one_colour(skin: Skin, points: Floats, colour: str, *, smooth: bool) -> Triangles:
    """Triangles of a skin in one colour."""
    paint = np.tile(colours.rgb(colour), (len(skin.triangles), 1))
    return Triangles(points, skin.triangles, paint, smooth)


def outline(skin: Skin, points: Floats, width: float) -> Strokes:
    """Outlines of the faces of a skin."""
    return Strokes(points[skin.outline], colours.LINE, width)


def tinted(
    skin: Skin, number: Ints, *, smooth: bool = True, width: float = 1.0
) -> tuple[Part, ...]:
    """Skin at its last amplitude with outlines; the faces have the colours with numbers (F,)."""
    tints = np.array([colours.rgb(colour) for colour in colours.FACES])
    paint, points = tints[number[skin.face] % len(tints)], skin.frames[-1]
    return Triangles(points, skin.triangles, paint, smooth), outline(skin, points, width)
