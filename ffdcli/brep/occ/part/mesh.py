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
from ffdcli.labels import Labels, Material, number_names
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
    """

    points: Floats
    parameters: Floats
    corners: Ints
    face: Ints


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
    document = document_of(part.handle)
    shapes = root_shapes(document)
    found = number_parts(shapes)
    made = triangulate_parts(shapes, found, share * part.size)
    points, corners, face = made.points, made.corners, made.face
    if part.polyhedral:
        off, nearest = cKDTree(part.points).query(points)
        if (off > part.vertex_tolerance[nearest]).any():
            raise KernelError("a face of the polyhedron could not be divided at its vertices")
        vertices, corners = part.points, nearest[corners]
    else:
        # Triangles of neighbouring faces have equal corners on their edge.
        vertices, where = np.unique(points, axis=0, return_inverse=True)
        corners = where.reshape(-1)[corners]
    thin = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    corners, face = corners[~thin], face[~thin]
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
        labels=_labels(part, document, found, face, solid),
    )


def triangulate_parts(shapes: list[Any], found: Numbering, tolerance: float) -> PartTriangles:
    """Triangulate shapes by OpenCascade's mesher.

    Parameters
    ----------
    shapes : list of TopoDS_Shape
    found : Numbering
        Of the faces of these shapes.
    tolerance : float, model length
        Largest distance from curved faces. Faces of less area than its square may have none.

    Raises
    ------
    KernelError
        OpenCascade could not divide a face.
    """
    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    for shape in shapes:
        BRepMesh_IncrementalMesh(shape, tolerance, False, _ANGLE, True)
    points: list[Any] = []
    parameters: list[Any] = []
    corners: list[Ints] = []
    faces: list[Ints] = []
    count = 0
    for number, turned in enumerate(found.face_reversed):
        place = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(TopoDS.Face_s(found.faces.FindKey(number + 1)), place)
        if mesh is None or not mesh.NbTriangles():
            if _area(found, number) <= tolerance**2:
                continue
            raise KernelError(f"OpenCascade could not divide face {number + 1} into triangles")
        moved = place.Transformation()
        nodes = range(1, mesh.NbNodes() + 1)
        points.extend(mesh.Node(node).Transformed(moved).Coord() for node in nodes)
        parameters.extend(mesh.UVNode(node).Coord() for node in nodes)
        own = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)]) - 1
        corners.append(count + (own[:, ::-1] if turned else own))
        faces.append(np.full(len(own), number))
        count = len(points)
    return PartTriangles(
        np.array(points), np.array(parameters), np.concatenate(corners), np.concatenate(faces)
    )


def _area(found: Numbering, face: int) -> float:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    area = GProp_GProps()
    BRepGProp.SurfaceProperties_s(found.faces.FindKey(face + 1), area)
    return abs(area.Mass())


def _labels(part: Part, document: Any, found: Numbering, face: Ints, solid: Ints) -> Labels | None:
    """Names of solids and faces, and colours, of triangles; None where the file gives none."""
    bodies, body_of = number_names([name or "" for name in part.solid_names])
    groups, group_of = number_names([name or "" for name in part.face_names])
    colours = colours_in(document, found)
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
