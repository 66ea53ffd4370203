"""Names and colours for CAD files: of faces, from the mesh's polygons; of bodies, from their faces.

The record for the writer is plain text and numbers, in the order in which shapes are built: solids
rising, then open shells; within a solid shells rising; within a shell faces rising.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.brep.record import Brep, MassProperties
from ffdcli.labels import Colour, Labels, Material


@dataclass(frozen=True)
class BodyLabels:
    """Labels of one solid or open shell.

    Parameters
    ----------
    name : str
    faces : tuple of str
        Name of each face, ``""`` for none.
    materials : tuple of int
        Of each face, -1 for none.
    mass : MassProperties or None
    """

    name: str
    faces: tuple[str, ...] = ()
    materials: tuple[int, ...] = ()
    mass: MassProperties | None = None


@dataclass(frozen=True)
class ShapeLabels:
    """Labels of all a file holds.

    Parameters
    ----------
    name : str
        Of the whole: the assembly of several bodies.
    materials : tuple of Material
    bodies : tuple of BodyLabels
        In the order of the shape.
    """

    name: str = "part"
    materials: tuple[Material, ...] = ()
    bodies: tuple[BodyLabels, ...] = ()


def paint(labels: ShapeLabels, body: BodyLabels) -> tuple[Colour | None, tuple[Colour | None, ...]]:
    """Colour of a body, and of those of its faces that differ from it.

    Where all faces have a colour, the commonest is the body's; else the body has none.

    Returns
    -------
    whole : colour or None
    faces : tuple of colour or None
        Empty where no face has a material.
    """
    colours = [
        labels.materials[number].colour if number >= 0 else None for number in body.materials
    ]
    whole = Counter(colours).most_common(1)[0][0] if colours and all(colours) else None
    return whole, tuple(None if colour == whole else colour for colour in colours)


def label_faces(labels: Labels, polygon: Ints, region: Ints) -> Labels:
    """What all polygons of a face share.

    Parameters
    ----------
    labels : Labels
        Of polygons.
    polygon, region : (N,) int64
        Polygon and face of every piece.

    Returns
    -------
    Labels
        Of faces: -1 also where the polygons of a face differ.
    """
    count = int(region.max(initial=-1)) + 1

    def shared(values: Ints) -> Ints:
        low, high = np.full(count, len(values)), np.full(count, -1)
        np.minimum.at(low, region, values[polygon])
        np.maximum.at(high, region, values[polygon])
        return np.where(low == high, low, -1)

    return replace(
        labels,
        body=shared(labels.body),
        group=shared(labels.group),
        material=shared(labels.material),
    )


def label_shape(
    brep: Brep, name: str, faces: Labels | None, masses: Sequence[MassProperties] = ()
) -> ShapeLabels:
    """Make the labels of a file.

    A face is called by its group, else by its material; a body by the object that all faces of its
    outer shell belong to, else by their group, else by the whole and a number. No two bodies have
    one name.

    Parameters
    ----------
    brep : Brep
    name : str
        Of the whole.
    faces : Labels or None
        Of the faces, as :func:`label_faces` makes them.
    masses : sequence of MassProperties
        Of every solid, or none at all.
    """
    solid = brep.shell_solid[brep.face_shell]
    # Open shells come after the solids, each a body of its own.
    bodies = np.where(solid >= 0, solid, brep.solid_count + brep.face_shell)
    order = np.lexsort((brep.face_shell, bodies))
    starts = np.flatnonzero(np.r_[True, np.diff(bodies[order]) != 0][: len(order)])
    members = np.split(order, starts[1:]) if len(order) else []
    taken: set[str] = set()
    made = []
    for number, own in enumerate(members):
        outer = own[brep.face_shell[own] == brep.face_shell[own[0]]]
        called = "" if faces is None else _body_name(faces, outer)
        plain = name if len(members) == 1 else f"{name}-{number + 1}"
        mass = masses[number] if number < len(masses) else None
        body = BodyLabels(_unused(called or plain, taken), mass=mass)
        if faces is not None:
            body = replace(body, faces=_face_names(faces, own))
            if (faces.material[own] >= 0).any():
                body = replace(body, materials=tuple(faces.material[own].tolist()))
        made.append(body)
    return ShapeLabels(name, () if faces is None else faces.materials, tuple(made))


def _body_name(faces: Labels, own: Ints) -> str:
    """Return the object, else the group, that all of these faces belong to."""
    for names, number in ((faces.bodies, faces.body[own]), (faces.groups, faces.group[own])):
        if number[0] >= 0 and (number == number[0]).all():
            return names[number[0]]
    return ""


def _face_names(faces: Labels, own: Ints) -> tuple[str, ...]:
    groups = [*faces.groups, ""]
    materials = [*(material.name for material in faces.materials), ""]
    pairs = zip(faces.group[own].tolist(), faces.material[own].tolist(), strict=True)
    names = tuple(groups[group] or materials[material] for group, material in pairs)
    return names if any(names) else ()


def _unused(name: str, taken: set[str]) -> str:
    """Return the name, with a number where it is taken already."""
    free, number = name, 1
    while free in taken:
        number += 1
        free = f"{name}-{number}"
    taken.add(free)
    return free
