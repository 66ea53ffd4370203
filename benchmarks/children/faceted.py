"""What people do today: subdivide, deform the vertices, write the facets as STEP."""

import json
import sys

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeShapeOnMesh
from OCP.gp import gp_Pnt
from OCP.Message import Message
from OCP.Poly import Poly_Triangle, Poly_Triangulation
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopoDS import TopoDS_Iterator, TopoDS_Shell, TopoDS_Solid
from trimesh.remesh import subdivide

from ffdcli.mesh import read_mesh
from ffdcli.pipeline import read_lattice

mesh_file, lattice_file, target, share = sys.argv[1:]
Message.DefaultMessenger_s().ChangePrinters().Clear()
mesh = read_mesh(mesh_file)
volume = read_lattice(lattice_file, mesh).volume
points, faces = mesh.vertices, mesh.corners.reshape(-1, 3)


def bent(places):
    """Where points are after the deformation."""
    return volume.frame.to_model(volume.evaluate(volume.frame.to_local(places)))


limit, deviation = float(share) * mesh.size, np.inf
while True:
    middles = points[faces][:, [[0, 1], [1, 2], [2, 0]]].mean(axis=2)
    image = bent(points)
    chords = image[faces][:, [[0, 1], [1, 2], [2, 0]]].mean(axis=2)
    deviation = np.linalg.norm(bent(middles.reshape(-1, 3)) - chords.reshape(-1, 3), axis=1).max()
    if deviation <= limit:
        break
    points, faces = subdivide(points, faces)
facets = Poly_Triangulation(len(image), len(faces), False)
for number, point in enumerate(image.tolist(), 1):
    facets.SetNode(number, gp_Pnt(*point))
for number, face in enumerate((faces + 1).tolist(), 1):
    facets.SetTriangle(number, Poly_Triangle(*face))
maker = BRepBuilderAPI_MakeShapeOnMesh(facets)
maker.Build()
builder, shell, solid = BRep_Builder(), TopoDS_Shell(), TopoDS_Solid()
builder.MakeShell(shell)
parts = TopoDS_Iterator(maker.Shape())
while parts.More():
    builder.Add(shell, parts.Value())
    parts.Next()
shell.Closed(True)
builder.MakeSolid(solid)
builder.Add(solid, shell)
writer = STEPControl_Writer()
writer.Transfer(solid, STEPControl_AsIs)
writer.Write(target)
print(json.dumps({"facets": len(faces), "deviation": deviation / mesh.size}))
