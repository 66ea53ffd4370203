"""CAD deformed the usual way, as PyGeM's CADDeformation is documented to do it.

Face by face: a B-spline surface, knots inserted evenly, poles moved; each wire one B-spline curve,
treated likewise; the surface trimmed by the curve. The faces go into a compound.
"""

import json
import sys

import numpy as np
from OCP.BinTools import BinTools
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
    BRepBuilderAPI_NurbsConvert,
    BRepBuilderAPI_Sewing,
)
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.GeomConvert import GeomConvert, GeomConvert_CompCurveToBSplineCurve
from OCP.gp import gp_Pnt
from OCP.Message import Message
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Shape

from ffdcli.deformation import Deformation
from ffdcli.mesh import read_mesh
from ffdcli.pipeline import read_lattice

source, mesh_file, lattice_file, inserted = sys.argv[1:]
KNOTS, JOIN = int(inserted), 1e-4
Message.DefaultMessenger_s().ChangePrinters().Clear()
mesh = read_mesh(mesh_file)
# Points that rounding puts outside the box are taken to be on it.
lattice = read_lattice(lattice_file, mesh)
bend = Deformation.of(lattice, mesh.delta).images


def bent(places):
    """Where points are after the deformation."""
    return bend(np.array(places))


def point(place):
    """A point's coordinates."""
    return place.X(), place.Y(), place.Z()


def parts(shape, kind):
    """The faces, wires or edges of a shape."""
    found = TopExp_Explorer(shape, kind)
    while found.More():
        yield found.Current()
        found.Next()


def even(low, high, count):
    """Parameters inside an interval."""
    return np.linspace(low, high, count + 2)[1:-1].tolist()


def off(at_rest, moved):
    """Largest distance of moved points from where the deformation takes them."""
    return float(np.linalg.norm(bent(at_rest) - np.array(moved), axis=1).max())


deviations, boundaries = [], []
builder, compound = BRep_Builder(), TopoDS_Compound()
builder.MakeCompound(compound)
shape = TopoDS_Shape()
BinTools.Read_s(shape, source)
for each in parts(shape, TopAbs_ShapeEnum.TopAbs_FACE):
    face = TopoDS.Face_s(BRepBuilderAPI_NurbsConvert(each).Shape())
    surface = GeomConvert.SurfaceToBSplineSurface_s(BRep_Tool.Surface_s(face))
    u0, u1, v0, v1 = surface.Bounds()
    for value in even(u0, u1, KNOTS):
        surface.InsertUKnot(value, 1, 1e-9)
    for value in even(v0, v1, KNOTS):
        surface.InsertVKnot(value, 1, 1e-9)
    samples = [(u, v) for u in np.linspace(u0, u1, 157) for v in np.linspace(v0, v1, 157)]
    at_rest = [point(surface.Value(*uv)) for uv in samples]
    pairs = [
        (i, j) for i in range(1, surface.NbUPoles() + 1) for j in range(1, surface.NbVPoles() + 1)
    ]
    moved = bent([point(surface.Pole(*pair)) for pair in pairs])
    for pair, place in zip(pairs, moved.tolist(), strict=True):
        surface.SetPole(*pair, gp_Pnt(*place))
    deviations.append(off(at_rest, [point(surface.Value(*uv)) for uv in samples]))
    (wire,) = parts(face, TopAbs_ShapeEnum.TopAbs_WIRE)
    joined = GeomConvert_CompCurveToBSplineCurve()
    for edge in parts(wire, TopAbs_ShapeEnum.TopAbs_EDGE):
        curve = BRep_Tool.Curve_s(TopoDS.Edge_s(edge), 0.0, 1.0)
        joined.Add(GeomConvert.CurveToBSplineCurve_s(curve), JOIN)
    curve = joined.BSplineCurve()
    for value in even(curve.FirstParameter(), curve.LastParameter(), KNOTS):
        curve.InsertKnot(value, 1, 1e-9)
    times = np.linspace(curve.FirstParameter(), curve.LastParameter(), 1571).tolist()
    at_rest = [point(curve.Value(t)) for t in times]
    numbers = range(1, curve.NbPoles() + 1)
    moved = bent([point(curve.Pole(number)) for number in numbers])
    for number, place in zip(numbers, moved.tolist(), strict=True):
        curve.SetPole(number, gp_Pnt(*place))
    boundaries.append(off(at_rest, [point(curve.Value(t)) for t in times]))
    outline = BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(curve).Edge()).Wire()
    builder.Add(compound, BRepBuilderAPI_MakeFace(surface, outline).Face())
sewing = BRepBuilderAPI_Sewing(1e-6 * mesh.size)
sewing.Add(compound)
sewing.Perform()
print(
    json.dumps(
        {
            "faces": len(deviations),
            "deviation": max(deviations) / mesh.size,
            "boundary": max(boundaries) / mesh.size,
            "valid": bool(BRepCheck_Analyzer(compound).IsValid()),
            "free": sewing.NbFreeEdges(),
        }
    )
)
