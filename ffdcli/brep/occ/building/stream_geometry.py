"""Curves and surfaces as records of OpenCascade's binary stream.

Numbers are little-endian; the first byte of a record is its kind. The records of a batch have one
layout, so they are one structured array.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.record import Brep, Curves, Planes, Surfaces
from ffdcli.errors import KernelError

Records = NDArray[Any]

BYTE, SHORT, INT, REAL = "u1", "<i2", "<i4", "<f8"
_KNOT = [("at", REAL), ("times", INT)]
# Kinds of curves and surfaces.
_LINE, _BSPLINE_CURVE = 1, 7
_PLANE, _BSPLINE_SURFACE = 1, 9
# OpenCascade's limits: the largest degree, and the smallest weight and length of a direction.
_MAX_DEGREE = 25
_SMALLEST = float(np.finfo(np.float64).tiny)


def fill(layout: list[Any], count: int, **fields: Any) -> Records:
    """An array of ``count`` records; fields that are not named are 0."""
    records = np.zeros(count, dtype=np.dtype(layout))
    for name, value in fields.items():
        records[name] = value
    return records


def curve_records(brep: Brep, straight: Bools) -> Iterator[tuple[Ints, Records]]:
    """Yield the 3D curves batch by batch: the edges' numbers and their curves' records.

    Parameters
    ----------
    brep : Brep
    straight : (E,) bool
        Edges that become lines with their length as parameter.

    Raises
    ------
    KernelError
        A curve that OpenCascade would refuse.
    """
    for batch in brep.curves:
        lines = straight[batch.edges]
        what = f"the curve of edge {{}} (degree {batch.degree}, {batch.poles.shape[1]} poles)"
        if lines.any():
            edges = batch.edges[lines]
            start, stop = batch.poles[lines, 0], batch.poles[lines, 1]
            _refuse(what, edges, lengths(stop - start) <= _SMALLEST, "its ends are one point")
            layout = [("kind", BYTE), ("origin", REAL, 3), ("direction", REAL, 3)]
            yield (
                edges,
                fill(layout, len(edges), kind=_LINE, origin=start, direction=stop - start),
            )
        if not lines.all():
            yield batch.edges[~lines], _bspline_curves(batch, ~lines, what)


def lengths(vectors: Floats) -> Floats:
    """(n,) lengths of vectors (n, 3), summed in OpenCascade's order."""
    x, y, z = vectors.T
    return np.sqrt(x * x + y * y + z * z)


def _bspline_curves(batch: Curves, rows: Bools, what: str) -> Records:
    edges, poles, knots = batch.edges[rows], batch.poles[rows], batch.knots[rows]
    _check_poles(what, edges, poles)
    _check_basis(what, edges, batch.degree, knots)
    size, pieces = poles.shape[1], knots.shape[1]
    layout = [
        ("kind", BYTE),
        ("rational", BYTE),
        ("periodic", BYTE),
        ("degree", SHORT),
        ("counts", INT, 2),
        ("poles", REAL, poles.shape[1:]),
        ("knots", _KNOT, pieces),
    ]
    records = fill(
        layout,
        len(edges),
        kind=_BSPLINE_CURVE,
        rational=poles.shape[-1] == 4,
        degree=batch.degree,
        counts=(size, pieces),
        poles=_divided(poles),
    )
    records["knots"]["at"], records["knots"]["times"] = knots, batch.mults
    return records


def pcurve_records(ends: Floats) -> Records:
    """Straight pcurves on [0, 1] between two points each, (n, 2, 2), as B-splines of degree 1."""
    layout = [
        ("kind", BYTE),
        ("rational", BYTE),
        ("periodic", BYTE),
        ("degree", SHORT),
        ("counts", INT, 2),
        ("poles", REAL, (2, 2)),
        ("knots", _KNOT, 2),
    ]
    records = fill(layout, len(ends), kind=_BSPLINE_CURVE, degree=1, counts=(2, 2), poles=ends)
    records["knots"]["at"], records["knots"]["times"] = (0.0, 1.0), 2
    return records


def surface_records(brep: Brep) -> Iterator[tuple[Ints, Records]]:
    """Yield the surfaces batch by batch: their numbers and records.

    Raises
    ------
    KernelError
        A surface that OpenCascade would refuse.
    """
    if len(brep.planes.surfaces):
        yield brep.planes.surfaces, _planes(brep.planes)
    for batch in brep.surfaces:
        yield batch.surfaces, _bspline_surfaces(batch)


def _planes(planes: Planes) -> Records:
    normal = np.cross(planes.x_axis, planes.y_axis)
    _refuse("plane {}", planes.surfaces, lengths(normal) <= _SMALLEST, "its axes are parallel")
    layout = [
        ("kind", BYTE),
        ("origin", REAL, 3),
        ("normal", REAL, 3),
        ("x_axis", REAL, 3),
        ("y_axis", REAL, 3),
    ]
    return fill(
        layout,
        len(normal),
        kind=_PLANE,
        origin=planes.origin,
        normal=normal,
        x_axis=planes.x_axis,
        y_axis=planes.y_axis,
    )


def _bspline_surfaces(batch: Surfaces) -> Records:
    count, size_u, size_v, _ = batch.poles.shape
    degree_u, degree_v = batch.degrees
    what = f"surface {{}} (degrees {degree_u} x {degree_v}, {size_u} x {size_v} poles)"
    _check_poles(what, batch.surfaces, batch.poles.reshape(count, size_u * size_v, -1))
    for degree, knots in zip(batch.degrees, (batch.u_knots, batch.v_knots), strict=True):
        _check_basis(what, batch.surfaces, degree, knots)
    pieces_u, pieces_v = batch.u_knots.shape[1], batch.v_knots.shape[1]
    layout = [
        ("kind", BYTE),
        ("rational", BYTE, 2),
        ("periodic", BYTE, 2),
        ("degrees", SHORT, 2),
        ("counts", INT, 4),
        ("poles", REAL, batch.poles.shape[1:]),
        ("u_knots", _KNOT, pieces_u),
        ("v_knots", _KNOT, pieces_v),
    ]
    records = fill(
        layout,
        count,
        kind=_BSPLINE_SURFACE,
        rational=batch.poles.shape[-1] == 4,
        degrees=batch.degrees,
        counts=(size_u, size_v, pieces_u, pieces_v),
        poles=_divided(batch.poles),
    )
    records["u_knots"]["at"], records["u_knots"]["times"] = batch.u_knots, batch.u_mults
    records["v_knots"]["at"], records["v_knots"]["times"] = batch.v_knots, batch.v_mults
    return records


def _divided(poles: Floats) -> Floats:
    """Poles as OpenCascade stores them: Cartesian, followed by the weight if rational."""
    if poles.shape[-1] == 3:
        return poles
    return np.concatenate([poles[..., :3] / poles[..., 3:], poles[..., 3:]], axis=-1)


def _check_poles(what: str, numbers: Ints, poles: Floats) -> None:
    finite = np.isfinite(poles).reshape(len(poles), -1)
    _refuse(what, numbers, _any(~finite), "a control point is not finite")
    if poles.shape[-1] == 4:
        _refuse(what, numbers, _any(poles[..., 3] <= _SMALLEST), "a weight is not positive")


def _check_basis(what: str, numbers: Ints, degree: int, knots: Floats) -> None:
    high = np.full(len(numbers), degree > _MAX_DEGREE)
    _refuse(what, numbers, high, f"it takes no degree above {_MAX_DEGREE}")
    rising = np.diff(knots, axis=1) > np.spacing(np.abs(knots[:, :-1]))
    _refuse(what, numbers, _any(~rising), "its knots do not rise")


def _any(wrong: Bools) -> Bools:
    """(n,) True for rows (n, m) with any True entry."""
    found: Bools = np.logical_or.reduce(wrong, axis=1)
    return found


def _refuse(what: str, numbers: Ints, wrong: Bools, reason: str) -> None:
    """Raise an error that names the first wrong item, which OpenCascade would not do."""
    if wrong.any():
        number = int(numbers[np.argmax(wrong)])
        raise KernelError(f"OpenCascade refuses to make {what.format(number)}: {reason}")
