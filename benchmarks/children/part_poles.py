"""A CAD part whose poles are moved: converted to B-splines, knots inserted, trimming kept."""

import itertools
import json
import sys
import time

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepTools import BRepTools
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_ShapeEnum, TopAbs_State
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedMapOfShape

from ffdcli import read_lattice, read_part
from ffdcli.brep.occ.part.document import document_of, root_shapes
from ffdcli.deformation import Deformation

source, lattice_file, inserted = sys.argv[1:]
KNOTS, ACROSS, ALONG = int(inserted), 21, 41
part = read_part(source)
bend = Deformation.of(read_lattice(lattice_file, part), part.delta).images
(shape,) = root_shapes(document_of(part.handle))


def point(place):
    """A point's coordinates."""
    return place.X(), place.Y(), place.Z()


def even(low, high):
    """Parameters of the inserted knots."""
    return np.linspace(low, high, KNOTS + 2)[1:-1].tolist()


def move(geometry, poles):
    """Move the poles of a curve or surface through the deformation."""
    images = bend(np.array([point(geometry.Pole(*pole)) for pole in poles]))
    for pole, image in zip(poles, images.tolist(), strict=True):
        geometry.SetPole(*pole, gp_Pnt(*image))


def refine(surface):
    """Insert knots evenly in both directions."""
    low_u, high_u, low_v, high_v = surface.Bounds()
    for value in even(low_u, high_u):
        surface.InsertUKnot(value, 1, 1e-9)
    for value in even(low_v, high_v):
        surface.InsertVKnot(value, 1, 1e-9)


def inside(face):
    """Parameters inside the outline of a face."""
    low_u, high_u, low_v, high_v = BRepTools.UVBounds_s(face)
    known = BRepTopAdaptor_FClass2d(face, 1e-9)
    grid = itertools.product(
        np.linspace(low_u, high_u, ACROSS + 2)[1:-1].tolist(),
        np.linspace(low_v, high_v, ACROSS + 2)[1:-1].tolist(),
    )
    return [uv for uv in grid if known.Perform(gp_Pnt2d(*uv)) == TopAbs_State.TopAbs_IN]


begun = time.process_time()
shape = BRepBuilderAPI_NurbsConvert(shape, True).Shape()
taken = time.process_time() - begun
faces, edges = TopTools_IndexedMapOfShape(), TopTools_IndexedMapOfShape()
TopExp.MapShapes_s(shape, TopAbs_ShapeEnum.TopAbs_FACE, faces)
TopExp.MapShapes_s(shape, TopAbs_ShapeEnum.TopAbs_EDGE, edges)
off, beside = [], {}
for number in range(1, faces.Extent() + 1):
    face = TopoDS.Face_s(faces.FindKey(number))
    surface = BRep_Tool.Surface_s(face)
    assert isinstance(surface, Geom_BSplineSurface)
    spots = inside(face)
    wanted = bend(np.array([point(surface.Value(*uv)) for uv in spots]))
    begun = time.process_time()
    refine(surface)
    move(
        surface,
        list(itertools.product(range(1, surface.NbUPoles() + 1), range(1, surface.NbVPoles() + 1))),
    )
    taken += time.process_time() - begun
    found = np.array([point(surface.Value(*uv)) for uv in spots])
    off.append(np.linalg.norm(found - wanted, axis=1).max())
    ring = TopExp_Explorer(face, TopAbs_ShapeEnum.TopAbs_EDGE)
    while ring.More():
        edge = TopoDS.Edge_s(ring.Current())
        pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0)
        at = map(pcurve.Value, np.linspace(*BRep_Tool.Range_s(edge), ALONG).tolist())
        line = [point(surface.Value(uv.X(), uv.Y())) for uv in at]
        beside.setdefault(edges.FindIndex(edge), []).append(np.array(line))
        ring.Next()
for number in range(1, edges.Extent() + 1):
    curve = BRep_Tool.Curve_s(TopoDS.Edge_s(edges.FindKey(number)), 0.0, 1.0)
    if isinstance(curve, Geom_BSplineCurve):
        begun = time.process_time()
        for value in even(curve.FirstParameter(), curve.LastParameter()):
            curve.InsertKnot(value, 1, 1e-9)
        move(curve, [(pole,) for pole in range(1, curve.NbPoles() + 1)])
        taken += time.process_time() - begun
gaps = [
    np.linalg.norm(first - second, axis=1).max()
    for first, *others in beside.values()
    for second in others
]
print(
    json.dumps(
        {
            "deviation": max(off) / part.size,
            "gap": max(gaps) / part.size,
            "size": part.size,
            "valid": bool(BRepCheck_Analyzer(shape).IsValid()),
            "seconds": taken,
        }
    )
)
