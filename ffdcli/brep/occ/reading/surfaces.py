"""Surfaces of OpenCascade shapes as plain arrays: planes and B-splines."""

from __future__ import annotations

from typing import Any

import numpy as np

from ffdcli.brep.occ.reading.splines import surface_splines
from ffdcli.brep.record import Planes, Surfaces
from ffdcli.errors import KernelError

_UNPLACED = tuple(np.eye(3, 4).ravel().tolist())


def surface_numbers(faces: list[Any], surface_of: dict[Any, Any]) -> list[int]:
    """Number of each face's surface, in the order of the faces that come first."""
    from OCP.BRep import BRep_Tool
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    # A surface is the same Python object as long as that object lives.
    known: dict[Any, int] = {}
    numbers = []
    for face in faces:
        own = BRep_Tool.Surface_s(TopoDS.Face_s(face.Located(TopLoc_Location())))
        surface = surface_of.get(face.TShape(), own)
        numbers.append(known.setdefault((surface, _placement(face)), len(known)))
    return numbers


def _placement(face: Any) -> tuple[float, ...]:
    """The matrix (3, 4) that places a face, row by row."""
    if face.Location().IsIdentity():
        return _UNPLACED
    matrix = face.Location().Transformation()
    return tuple(matrix.Value(i, j) for i in range(1, 4) for j in range(1, 5))


def read_surface(face: Any, number: int) -> Any:
    """Return a plane's ``(3, 3)`` origin and axes, or a B-spline surface of OpenCascade."""
    from OCP.BRep import BRep_Tool
    from OCP.Geom import (
        Geom_BezierSurface,
        Geom_BSplineSurface,
        Geom_Plane,
        Geom_RectangularTrimmedSurface,
    )
    from OCP.GeomConvert import GeomConvert

    surface = BRep_Tool.Surface_s(face)
    if isinstance(surface, Geom_RectangularTrimmedSurface):
        surface = surface.BasisSurface()
    if isinstance(surface, Geom_Plane):
        frame = surface.Position()
        return np.array(
            [
                frame.Location().Coord(),
                frame.XDirection().Coord(),
                frame.YDirection().Coord(),
            ]
        )
    if isinstance(surface, Geom_BezierSurface):
        surface = GeomConvert.SurfaceToBSplineSurface_s(surface)
    if not isinstance(surface, Geom_BSplineSurface):
        kind = "none" if surface is None else type(surface).__name__.removeprefix("Geom_")
        raise KernelError(
            f"face {number} lies on a surface that is neither plane nor B-spline: {kind}"
        )
    return surface


def surface_batches(surfaces: list[Any]) -> tuple[Surfaces, ...]:
    """The B-splines among surfaces, grouped by degrees, multiplicities and shape of the poles."""
    splines = {i: each for i, each in enumerate(surfaces) if not isinstance(each, np.ndarray)}
    made = []
    for batch in surface_splines(splines):
        (u_degree, v_degree), (u_knots, v_knots) = batch.degrees, batch.knots
        u_mults, v_mults = batch.mults
        degrees = u_degree, v_degree
        made.append(
            Surfaces(batch.numbers, degrees, u_knots, v_knots, u_mults, v_mults, batch.poles)
        )
    return tuple(made)


def plane_batch(surfaces: list[Any]) -> Planes:
    """The planes among surfaces."""
    numbers = [i for i, surface in enumerate(surfaces) if isinstance(surface, np.ndarray)]
    frames = np.array([surfaces[i] for i in numbers]).reshape(-1, 3, 3)
    return Planes(np.array(numbers, dtype=np.int64), frames[:, 0], frames[:, 1], frames[:, 2])
