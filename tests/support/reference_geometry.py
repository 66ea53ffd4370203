"""The curves and surfaces of the record as OpenCascade's.

Bindings cost a microsecond or two a call, so the loops reuse one array and one point for all of
a batch (the kernel copies what it is given) and look names up once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.record import Brep, Curves, Surfaces
from ffdcli.errors import KernelError


@contextmanager
def asking(what: str) -> Iterator[Callable[..., None]]:
    """Turn what the kernel throws into a KernelError that names what was being made.

    The block calls the function it is given with the values of ``what``'s fields.
    """
    values: tuple[object, ...] = ()

    def at(*current: object) -> None:
        nonlocal values
        values = current

    try:
        yield at
    except (KernelError, MemoryError):
        raise
    except Exception as error:
        reason = str(error).strip() or type(error).__name__
        raise KernelError(
            f"OpenCascade refused to make {what.format(*values)}: {reason}"
        ) from error


def real_array(values: list[float]) -> Any:
    """Make a kernel array of numbers."""
    from OCP.TColStd import TColStd_Array1OfReal

    array = TColStd_Array1OfReal(1, len(values))
    for i, value in enumerate(values, 1):
        array.SetValue(i, value)
    return array


def integer_array(values: Ints) -> Any:
    """Make a kernel array of integers."""
    from OCP.TColStd import TColStd_Array1OfInteger

    array = TColStd_Array1OfInteger(1, len(values))
    for i, value in enumerate(values.tolist(), 1):
        array.SetValue(i, value)
    return array


def _split_weights(poles: Floats) -> tuple[Floats, Floats | None]:
    """Cartesian poles and weights; no weights for polynomial (3-component) ones."""
    if poles.shape[-1] == 3:
        return poles, None
    return poles[..., :3] / poles[..., 3:], poles[..., 3]


def surface_count(brep: Brep) -> int:
    """Count the surfaces of a record."""
    return len(brep.planes.surfaces) + sum(len(batch.surfaces) for batch in brep.surfaces)


def make_surfaces(brep: Brep) -> list[Any]:
    """Make every surface, by its number."""
    from OCP.Geom import Geom_Plane
    from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt

    surfaces: list[Any] = [None] * surface_count(brep)
    planes = brep.planes
    normals = np.cross(planes.x_axis, planes.y_axis)
    with asking("plane {}") as at:
        for number, origin, normal, x_axis in zip(
            planes.surfaces.tolist(),
            planes.origin.tolist(),
            normals.tolist(),
            planes.x_axis.tolist(),
            strict=True,
        ):
            at(number)
            frame = gp_Ax3(gp_Pnt(*origin), gp_Dir(*normal), gp_Dir(*x_axis))
            surfaces[number] = Geom_Plane(frame)
    for batch in brep.surfaces:
        for number, surface in zip(batch.surfaces.tolist(), _batch_surfaces(batch), strict=True):
            surfaces[number] = surface
    return surfaces


def _batch_surfaces(batch: Surfaces) -> list[Any]:
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array2OfPnt
    from OCP.TColStd import TColStd_Array2OfReal

    poles, weights = _split_weights(batch.poles)
    _, nu, nv, _ = poles.shape
    pole_array = TColgp_Array2OfPnt(1, nu, 1, nv)
    weight_array = TColStd_Array2OfReal(1, nu, 1, nv)
    u_mults, v_mults = integer_array(batch.u_mults), integer_array(batch.v_mults)
    point = gp_Pnt()
    set_coordinates, set_pole = point.SetCoord, pole_array.SetValue
    made = []
    what = f"surface {{}} (degrees {batch.degrees[0]} x {batch.degrees[1]}, {nu} x {nv} poles)"
    with asking(what) as at:
        for i, number in enumerate(batch.surfaces.tolist()):
            at(number)
            for r, row in enumerate(poles[i].tolist(), 1):
                for c, (x, y, z) in enumerate(row, 1):
                    set_coordinates(x, y, z)
                    set_pole(r, c, point)
            u_knots = real_array(batch.u_knots[i].tolist())
            v_knots = real_array(batch.v_knots[i].tolist())
            rest = (u_knots, v_knots, u_mults, v_mults, *batch.degrees)
            if weights is None:
                made.append(Geom_BSplineSurface(pole_array, *rest))
                continue
            for r, row in enumerate(weights[i].tolist(), 1):
                for c, weight in enumerate(row, 1):
                    weight_array.SetValue(r, c, weight)
            made.append(Geom_BSplineSurface(pole_array, weight_array, *rest))
    return made


def make_curves(batch: Curves, between_planes: Bools) -> Iterator[tuple[Any, float]]:
    """Make the curves of a batch, each with its last parameter (the first is 0)."""
    from OCP.Geom import Geom_BSplineCurve, Geom_Line
    from OCP.gp import gp_Dir, gp_Pnt
    from OCP.TColgp import TColgp_Array1OfPnt
    from OCP.TColStd import TColStd_Array1OfReal

    poles, weights = _split_weights(batch.poles)
    count = poles.shape[1]
    straight = batch.degree == 1 and count == 2
    pole_array = TColgp_Array1OfPnt(1, count)
    weight_array = TColStd_Array1OfReal(1, count)
    mults = integer_array(batch.mults)
    point = gp_Pnt()
    set_coordinates, set_pole = point.SetCoord, pole_array.SetValue
    with asking(f"the curve of edge {{}} (degree {batch.degree}, {count} poles)") as at:
        for i, number in enumerate(batch.edges.tolist()):
            at(number)
            rows = poles[i].tolist()
            if straight and between_planes[i]:
                step = poles[i, 1] - poles[i, 0]
                yield (
                    Geom_Line(gp_Pnt(*rows[0]), gp_Dir(*step.tolist())),
                    float(np.linalg.norm(step)),
                )
                continue
            for k, (x, y, z) in enumerate(rows, 1):
                set_coordinates(x, y, z)
                set_pole(k, point)
            knots = real_array(batch.knots[i].tolist())
            if weights is None:
                yield Geom_BSplineCurve(pole_array, knots, mults, batch.degree), 1.0
                continue
            for k, weight in enumerate(weights[i].tolist(), 1):
                weight_array.SetValue(k, weight)
            yield Geom_BSplineCurve(pole_array, weight_array, knots, mults, batch.degree), 1.0
