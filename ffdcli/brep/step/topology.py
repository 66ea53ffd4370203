"""Vertices, edges, loops, faces, shells and solids as entities."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Ints
from ffdcli.brep.labels import ShapeLabels, body_faces
from ffdcli.brep.occ.writing.step_texts import step_text
from ffdcli.brep.record import Brep
from ffdcli.brep.step.entities import Entities, Texts
from ffdcli.brep.step.geometry import Geometry
from ffdcli.brep.step.text import references


@dataclass(frozen=True)
class BodyEntities:
    """Entities of a solid or open shell.

    Parameters
    ----------
    item : int
        The solid, or the model of the shell.
    faces : (n,) int64
        In the order in which shapes are built.
    is_solid : bool
    """

    item: int
    faces: Ints
    is_solid: bool


def add_bodies(
    entities: Entities, brep: Brep, geometry: Geometry, labels: ShapeLabels
) -> list[BodyEntities]:
    """Add all solids, then all open shells, with their faces, edges and vertices.

    Parameters
    ----------
    entities : Entities
    brep : Brep
    geometry : Geometry
    labels : ShapeLabels
        Of all bodies, in the order in which shapes are built.
    """
    members = body_faces(brep)
    # The shell of a cavity is written as if it bounded a body, and used in the other sense.
    sense = brep.face_reversed == _cavities(brep)[brep.face_shell]
    face = _add_faces(entities, brep, geometry, sense, _face_names(brep, labels, members))
    order = np.argsort(brep.face_shell, kind="stable")
    bounds = np.searchsorted(brep.face_shell[order], np.arange(len(brep.shell_closed) + 1))
    shells = []
    for number, closed in enumerate(brep.shell_closed.tolist()):
        own = references(face[order[bounds[number] : bounds[number + 1]]])
        kind = b"CLOSED_SHELL" if closed else b"OPEN_SHELL"
        shells.append(entities.one(b"%s('',(%s))" % (kind, own)))
    made = []
    for faces, named in zip(members, labels.bodies, strict=True):
        shell = int(brep.face_shell[faces[0]])
        solid = int(brep.shell_solid[shell])
        own_shells = [shell] if solid < 0 else np.flatnonzero(brep.shell_solid == solid).tolist()
        numbers = [shells[each] for each in own_shells]
        item = _add_body(entities, text_of(named.name), numbers, is_solid=solid >= 0)
        made.append(BodyEntities(item, face[faces], solid >= 0))
    return made


def text_of(value: str) -> bytes:
    """A text between apostrophes."""
    return b"'%s'" % step_text(value).encode("ascii")


def _add_body(entities: Entities, name: bytes, shells: Sequence[int], *, is_solid: bool) -> int:
    if not is_solid:
        return entities.one(b"SHELL_BASED_SURFACE_MODEL(%s,(#%d))" % (name, shells[0]))
    if len(shells) == 1:
        return entities.one(b"MANIFOLD_SOLID_BREP(%s,#%d)" % (name, shells[0]))
    voids = [entities.one(b"ORIENTED_CLOSED_SHELL('',*,#%d,.F.)" % each) for each in shells[1:]]
    inner = references(np.array(voids))
    return entities.one(b"BREP_WITH_VOIDS(%s,#%d,(%s))" % (name, shells[0], inner))


def _cavities(brep: Brep) -> Bools:
    """(S,) whether each shell is a cavity: all shells of a solid but its first."""
    inner = brep.shell_solid >= 0
    inner[np.unique(brep.shell_solid, return_index=True)[1]] = False
    return inner


def _face_names(brep: Brep, labels: ShapeLabels, members: Sequence[Ints]) -> Texts:
    """The names of faces, each text once."""
    number = np.zeros(brep.face_count, dtype=np.int64)
    known = {"": 0}
    for faces, body in zip(members, labels.bodies, strict=True):
        if body.faces:
            number[faces] = [known.setdefault(name, len(known)) for name in body.faces]
    return Texts(number, [text_of(name) for name in known])


def _add_faces(
    entities: Entities, brep: Brep, geometry: Geometry, sense: Bools, names: Texts
) -> Ints:
    """Add faces with their loops, edges and vertices: their numbers (F,)."""
    used = np.unique(brep.coedge_edge)
    corners = np.unique(brep.edges[used])
    vertex = np.zeros(len(brep.points), dtype=np.int64)
    vertex[corners] = entities.add(b"VERTEX_POINT('',#%d)", geometry.point[corners])
    edge = np.zeros(len(brep.edges), dtype=np.int64)
    edge[used] = entities.add(
        b"EDGE_CURVE('',#%d,#%d,#%d,.T.)", vertex[brep.edges[used]], geometry.curve[used]
    )
    # A loop of a file runs about the normal of the surface; the bound says in which sense the face
    # has it, and loops of the B-rep run about the face's outward normal.
    turned = brep.face_reversed
    oriented = entities.add(
        b"ORIENTED_EDGE('',*,*,#%d,.%s.)",
        edge[brep.coedge_edge],
        brep.coedge_forward ^ turned[brep.face_of_coedge],
    )
    bound = np.zeros(len(brep.loop_coedges) - 1, dtype=np.int64)
    for loops, coedges in _runs(brep.loop_coedges):
        backward = turned[brep.face_of_loop[loops], None]
        members = oriented[np.where(backward, coedges[:, ::-1], coedges)]
        places = b",".join([b"#%d"] * coedges.shape[1])
        bound[loops] = entities.add(b"EDGE_LOOP('',(%s))" % places, members)
    bound = entities.add(b"FACE_BOUND('',#%d,.%s.)", bound, sense[brep.face_of_loop])
    face = np.zeros(brep.face_count, dtype=np.int64)
    for faces, loops in _runs(brep.face_loops):
        places = b",".join([b"#%d"] * loops.shape[1])
        face[faces] = entities.add(
            b"ADVANCED_FACE(%%s,(%s),#%%d,.%%s.)" % places,
            Texts(names.number[faces], names.texts),
            bound[loops],
            geometry.surface[brep.face_surface[faces]],
            sense[faces],
        )
    return face


def _runs(starts: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield owners grouped by the number of their items, and the items (n, count)."""
    counts = np.diff(starts)
    for count in np.unique(counts).tolist():
        owners = np.flatnonzero(counts == count)
        yield owners, starts[owners, None] + np.arange(count)
