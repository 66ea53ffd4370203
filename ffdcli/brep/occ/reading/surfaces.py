"""Surfaces of OpenCascade shapes as plain arrays: planes and B-splines."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np

from ffdcli.arrays import Floats
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
    """Return a plane's ``(3, 3)`` origin and axes, or a B-spline's degrees, knots and poles."""
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
    if surface.IsUPeriodic() or surface.IsVPeriodic():
        surface = surface.Copy()
        surface.SetUNotPeriodic()
        surface.SetVNotPeriodic()
    ends = [(surface.UMultiplicity(i), surface.UDegree()) for i in (1, surface.NbUKnots())]
    ends += [(surface.VMultiplicity(i), surface.VDegree()) for i in (1, surface.NbVKnots())]
    if any(multiplicity <= degree for multiplicity, degree in ends):
        # Cut to the domain: later stages expect clamped knots.
        surface = surface.Copy()
        surface.Segment(*surface.Bounds())
    nu, nv = surface.NbUPoles(), surface.NbVPoles()
    pole = surface.Pole
    poles = np.array([[pole(i, j).Coord() for j in range(1, nv + 1)] for i in range(1, nu + 1)])
    if surface.IsURational() or surface.IsVRational():
        weight = surface.Weight
        weights = [[weight(i, j) for j in range(1, nv + 1)] for i in range(1, nu + 1)]
        poles = homogeneous(poles, np.array(weights))
    u_count, v_count = range(1, surface.NbUKnots() + 1), range(1, surface.NbVKnots() + 1)
    return (
        (surface.UDegree(), surface.VDegree()),
        tuple(surface.UMultiplicity(i) for i in u_count),
        tuple(surface.VMultiplicity(i) for i in v_count),
        [surface.UKnot(i) for i in u_count],
        [surface.VKnot(i) for i in v_count],
        poles,
    )


def homogeneous(poles: Floats, weights: Floats) -> Floats:
    """Cartesian poles and their weights as ``(wx, wy, ..., w)``."""
    return np.concatenate([poles * weights[..., None], weights[..., None]], axis=-1)


def surface_batches(surfaces: list[Any]) -> tuple[Surfaces, ...]:
    """The B-splines among surfaces, grouped by degrees, multiplicities and shape of the poles."""
    groups: dict[Any, list[int]] = defaultdict(list)
    for number, surface in enumerate(surfaces):
        if not isinstance(surface, np.ndarray):
            degrees, u_mults, v_mults, _, _, poles = surface
            groups[degrees, u_mults, v_mults, poles.shape].append(number)
    return tuple(
        Surfaces(
            np.array(numbers),
            degrees,
            np.array([surfaces[number][3] for number in numbers]),
            np.array([surfaces[number][4] for number in numbers]),
            np.array(u_mults),
            np.array(v_mults),
            np.array([surfaces[number][5] for number in numbers]),
        )
        for (degrees, u_mults, v_mults, _), numbers in sorted(groups.items())
    )


def plane_batch(surfaces: list[Any]) -> Planes:
    """The planes among surfaces."""
    numbers = [i for i, surface in enumerate(surfaces) if isinstance(surface, np.ndarray)]
    frames = np.array([surfaces[i] for i in numbers]).reshape(-1, 3, 3)
    return Planes(np.array(numbers, dtype=np.int64), frames[:, 0], frames[:, 1], frames[:, 2])
