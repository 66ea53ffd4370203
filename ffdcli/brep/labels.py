"""Names and colours of faces and bodies in CAD files.

Faces get them from the polygons of the mesh, bodies from their faces. The order is that in which
shapes are built: solids, then open shells; within a solid its shells; within a shell its faces.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.brep.occ.formats import UNPAINTED, Schema
from ffdcli.brep.record import Brep, MassProperties
from ffdcli.labels import Colour, Labels, Material

# Largest relative error of stated mass properties that passes without a word.
STATED = 1e-9


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
    """Labels of all bodies of a file.

    Parameters
    ----------
    name : str
        Name of the part, or of the assembly of several bodies.
    materials : tuple of Material
    bodies : tuple of BodyLabels
        In the order in which shapes are built.
    """

    name: str = "part"
    materials: tuple[Material, ...] = ()
    bodies: tuple[BodyLabels, ...] = ()


def paint(labels: ShapeLabels, body: BodyLabels) -> tuple[Colour | None, tuple[Colour | None, ...]]:
    """Colour of a body, and colours of the faces that differ from it.

    The colour of the body is the most common one of its faces, if all have one.

    Returns
    -------
    colour or None
        Of the body.
    tuple of colour or None
        Of each face; None where it is that of the body. Empty where no face has a material.
    """
    colours = [
        labels.materials[number].colour if number >= 0 else None for number in body.materials
    ]
    common = Counter(colours).most_common(1)[0][0] if colours and all(colours) else None
    return common, tuple(None if colour == common else colour for colour in colours)


def label_faces(labels: Labels, polygon: Ints, region: Ints) -> Labels:
    """Labels of faces: those that all polygons of a face share.

    Parameters
    ----------
    labels : Labels
        Of polygons.
    polygon, region : (N,) int64
        Polygon and face of every piece.

    Returns
    -------
    Labels
        Of faces; -1 also where the polygons of a face differ.
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


def body_faces(brep: Brep) -> list[Ints]:
    """Faces of each body, in the order in which shapes are built."""
    solid = brep.shell_solid[brep.face_shell]
    # Each open shell is a body; they come after the solids.
    bodies = np.where(solid >= 0, solid, brep.solid_count + brep.face_shell)
    order = np.lexsort((brep.face_shell, bodies))
    starts = np.flatnonzero(np.r_[True, np.diff(bodies[order]) != 0][: len(order)])
    return np.split(order, starts[1:]) if len(order) else []


def label_shape(
    brep: Brep, name: str, faces: Labels | None, masses: Sequence[MassProperties] = ()
) -> ShapeLabels:
    """Labels of the bodies of a file.

    A face is named after its group, else its material. A body is named after the object that all
    faces of its outer shell belong to, else after their group, else after the file, with a number.
    Names of bodies are distinct.

    Parameters
    ----------
    brep : Brep
    name : str
        Name of the part or assembly.
    faces : Labels or None
        Labels of the faces; see :func:`label_faces`.
    masses : sequence of MassProperties
        Of all solids; empty if unknown.
    """
    members = body_faces(brep)
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
    """Name of the object, else of the group, that all of these faces belong to."""
    for names, number in ((faces.bodies, faces.body[own]), (faces.groups, faces.group[own])):
        if number[0] >= 0 and (number == number[0]).all():
            return names[number[0]]
    return ""


def _face_names(faces: Labels, own: Ints) -> tuple[str, ...]:
    """Names of chosen faces (n,); empty where none has a name."""
    groups = [*faces.groups, ""]
    materials = [*(material.name for material in faces.materials), ""]
    pairs = zip(faces.group[own].tolist(), faces.material[own].tolist(), strict=True)
    names = tuple(groups[group] or materials[material] for group, material in pairs)
    return names if any(names) else ()


def _unused(name: str, taken: set[str]) -> str:
    """The name, with a number if it is in ``taken``; adds the result to ``taken``."""
    free, number = name, 1
    while free in taken:
        number += 1
        free = f"{name}-{number}"
    taken.add(free)
    return free


def lost_colours(faces: Labels | None, kind: str | None, schema: Schema) -> list[str]:
    """Warn of names or colours of faces that a format or a schema of STEP cannot hold."""
    if faces is None or all(material.colour is None for material in faces.materials):
        return []
    if kind == "BREP":
        return ["BREP files have no place for names and colours: they are left out"]
    if kind == "STEP" and schema in UNPAINTED:
        return [f"{schema.upper()} has no place for colours: they are left out"]
    return []


def doubtful_masses(masses: Sequence[MassProperties]) -> list[str]:
    """Warn of solids whose volume, area or centroid is stated less exactly than to 1e-9."""
    found = []
    for number, mass in enumerate(masses):
        length = mass.area**0.5
        errors = (
            ("volume", mass.volume_error, abs(mass.volume)),
            ("area", mass.area_error, mass.area),
            ("centroid", mass.centroid_error, length),
        )
        known = [f"{what} within {error:.1e}" for what, error, size in errors
                 if error > STATED * size]  # fmt: skip
        if known:
            found.append(f"solid {number + 1}: the file states its {', '.join(known)} only")
    return found
