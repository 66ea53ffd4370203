"""Parts as triangle meshes: exact for polyhedra, else near enough to settle and judge lattices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.occ.part.document import document_of, root_shapes
from ffdcli.brep.occ.part.labels import colours_in
from ffdcli.brep.occ.part.walk import Numbering, number_parts
from ffdcli.errors import KernelError
from ffdcli.labels import Colour, Labels, Material, number_names
from ffdcli.mesh import Mesh
from ffdcli.part.record import Part

# Largest distance of triangles from the surfaces, as a share of the size, and largest angle.
SHARE = 2e-4
_ANGLE = 0.2


@dataclass(frozen=True, eq=False)
class PartTriangles:
    """Triangles of the faces of a part.

    Parameters
    ----------
    points : (n, 3) float64, model length
        Faces do not share points; on a shared edge those of its faces are equal.
    parameters : (n, 2) float64
        Parameters of the points on their face.
    corners : (T, 3) int64
        Counter-clockwise seen from outside.
    face : (T,) int64
    chords : (c, 2) int64
        Points at the ends of the chords that edges are divided into; each edge once.
    chord_edge : (c,) int64
    chord_ends : (c, 2) float64
        Parameters of the edge there.
    """

    points: Floats
    parameters: Floats
    corners: Ints
    face: Ints
    chords: Ints
    chord_edge: Ints
    chord_ends: Floats


@lru_cache(maxsize=1)
def mesh_of_part(part: Part, share: float = SHARE) -> Mesh:
    """Triangles of a part, closed where it is.

    The corners of a polyhedron are its vertices to the bit. Names of faces and solids are groups.

    Parameters
    ----------
    part : Part
    share : float
        Largest distance from curved faces, as a share of the part's size.

    Raises
    ------
    KernelError
        OpenCascade could not divide a face.
    """
    return named_mesh(part, *joined_triangles(part, share))


@lru_cache(maxsize=1)
def joined_triangles(
    part: Part, share: float = SHARE
) -> tuple[Floats, Ints, Ints, list[Colour | None]]:
    """Triangles of a part whose faces share the points on common edges.

    Parameters and errors are those of :func:`mesh_of_part`.

    Returns
    -------
    (V, 3) float64, model length
    (T, 3) int64
    (T,) int64
        Face of each triangle.
    (F,) list of Colour or None
    """
    document = document_of(part.handle)
    shapes = root_shapes(document)
    found = number_parts(shapes)
    made = triangulate_parts(shapes, found, share * part.size)
    points, corners, face = made.points, made.corners, made.face
    colours = colours_in(document, found)
    if part.polyhedral:
        off, nearest = cKDTree(part.points).query(points)
        if (off > part.vertex_tolerance[nearest]).any():
            raise KernelError("a face of the polyhedron could not be divided at its vertices")
        vertices, corners = part.points, nearest[corners]
    else:
        # Triangles of neighbouring faces have equal corners on their edge.
        vertices, where = np.unique(points, axis=0, return_inverse=True)
        corners = where.reshape(-1)[corners]
    wide = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    return vertices, corners[wide], face[wide], colours


def named_mesh(
    part: Part, vertices: Floats, corners: Ints, face: Ints, colours: list[Colour | None]
) -> Mesh:
    """Triangles (T, 3) of the faces (T,) of a part as a mesh, with the part's names and colours.

    Parameters
    ----------
    part : Part
    vertices, corners, face
    colours : (F,) list of Colour or None
    """
    solid = part.shell_solid[part.face_shell[face]]
    groups = {
        name: np.flatnonzero(np.isin(owner, [n for n, each in enumerate(names) if each == name]))
        for names, owner in ((part.solid_names, solid), (part.face_names, face))
        for name in dict.fromkeys(names)
        if name is not None
    }
    return Mesh(
        vertices=vertices,
        corners=corners.ravel(),
        starts=np.arange(0, corners.size + 1, 3),
        unit=part.unit,
        source=part.source,
        notes=part.notes,
        groups=groups,
        labels=_labels(part, colours, face, solid),
    )


def triangulate_parts(shapes: list[Any], found: Numbering, tolerance: float) -> PartTriangles:
    """Triangulate shapes by OpenCascade's mesher.

    Parameters
    ----------
    shapes : list of TopoDS_Shape
    found : Numbering
        Of the faces of these shapes.
    tolerance : float, model length
        Largest distance from curved faces. Faces narrower than that may have none.

    Raises
    ------
    KernelError
        OpenCascade could not divide a face.
    """
    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopAbs import TopAbs_ShapeEnum as Kind
    from OCP.TopExp import TopExp
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS
    from OCP.TopTools import TopTools_IndexedMapOfShape

    for shape in shapes:
        BRepMesh_IncrementalMesh(shape, tolerance, False, _ANGLE, True)
    points: list[Any] = []
    parameters: list[Any] = []
    corners: list[Ints] = []
    faces: list[Ints] = []
    chords: list[Ints] = []
    chord_edges: list[Ints] = []
    chord_ends: list[Floats] = []
    seen: set[int] = set()
    count = 0
    for number, turned in enumerate(found.face_reversed):
        place = TopLoc_Location()
        face = TopoDS.Face_s(found.faces.FindKey(number + 1))
        mesh = BRep_Tool.Triangulation_s(face, place)
        if mesh is None or not mesh.NbTriangles():
            if _width(found, number) <= tolerance:
                continue
            raise KernelError(f"OpenCascade could not divide face {number + 1} into triangles")
        moved = place.Transformation()
        nodes = range(1, mesh.NbNodes() + 1)
        points.extend(mesh.Node(node).Transformed(moved).Coord() for node in nodes)
        parameters.extend(mesh.UVNode(node).Coord() for node in nodes)
        own = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)]) - 1
        corners.append(count + (own[:, ::-1] if turned else own))
        faces.append(np.full(len(own), number))
        edges = TopTools_IndexedMapOfShape()
        TopExp.MapShapes_s(face, Kind.TopAbs_EDGE, edges)
        for edge in (TopoDS.Edge_s(edges.FindKey(i + 1)) for i in range(edges.Extent())):
            which = found.edges.FindIndex(edge) - 1
            line = BRep_Tool.PolygonOnTriangulation_s(edge, mesh, place)
            if which in seen or line is None or BRep_Tool.Degenerated_s(edge):
                continue
            seen.add(which)
            steps = range(1, line.NbNodes() + 1)
            at = np.array([line.Node(step) for step in steps]) - 1 + count
            ends = np.array([line.Parameter(step) for step in steps])
            chords.append(np.stack([at[:-1], at[1:]], axis=1))
            chord_ends.append(np.stack([ends[:-1], ends[1:]], axis=1))
            chord_edges.append(np.full(len(at) - 1, which))
        count = len(points)
    none = np.zeros((0, 2), dtype=np.int64)
    return PartTriangles(
        np.array(points),
        np.array(parameters),
        np.concatenate(corners),
        np.concatenate(faces),
        np.concatenate([none, *chords]),
        np.concatenate([none[:, 0], *chord_edges]),
        np.concatenate([none.astype(np.float64), *chord_ends]),
    )


def _width(found: Numbering, number: int) -> float:
    """About how wide a face is: twice its area over the length of its edges, model length."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    face, area, length = found.faces.FindKey(number + 1), GProp_GProps(), GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, area)
    BRepGProp.LinearProperties_s(face, length)
    return float(2 * abs(area.Mass()) / max(length.Mass(), np.finfo(float).tiny))


def _labels(part: Part, colours: list[Colour | None], face: Ints, solid: Ints) -> Labels | None:
    """Names of solids and faces, and colours, of triangles; None where the file gives none."""
    bodies, body_of = number_names([name or "" for name in part.solid_names])
    groups, group_of = number_names([name or "" for name in part.face_names])
    kinds = list(dict.fromkeys(colour for colour in colours if colour is not None))
    if not (bodies or groups or kinds):
        return None
    material = np.array([-1 if each is None else kinds.index(each) for each in colours])
    return Labels(
        bodies,
        groups,
        tuple(Material("", colour) for colour in kinds),
        np.where(solid < 0, -1, np.append(body_of, -1)[solid]),
        group_of[face],
        material[face],
    )
