"""Knots and poles of many of OpenCascade's splines at once, as arrays.

OpenCascade writes the splines to its binary stream (BinTools), and numpy reads that. A call through
the Python bindings for each pole takes ten times as long.
"""

from __future__ import annotations

import io
import struct
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.errors import KernelError

# Degrees, multiplicities, and shape of the poles: what the splines of a batch share.
_Key = tuple[tuple[int, ...], tuple[tuple[int, ...], ...], tuple[int, ...]]
# Numbers, knots along each parameter, and poles of some splines.
_Part = tuple[Ints, tuple[Floats, ...], Floats]


@dataclass(frozen=True)
class SplineBatch:
    """Curves or surfaces that share degrees and multiplicities, clamped and not periodic.

    Parameters
    ----------
    numbers : (m,) int64, rising
    degrees : one int for curves, two for surfaces
    mults : (nb,) int64 for each parameter
    knots : (m, nb) float64 for each parameter
        Distinct knots.
    poles : (m, n, d) or (m, nu, nv, d) float64
        With another component, the weight, homogeneous.
    """

    numbers: Ints
    degrees: tuple[int, ...]
    mults: tuple[Ints, ...]
    knots: tuple[Floats, ...]
    poles: Floats


def surface_splines(surfaces: Mapping[int, Any]) -> list[SplineBatch]:
    """B-spline surfaces (``Geom_BSplineSurface``) by number, in batches."""
    from OCP.BinTools import BinTools_SurfaceSet

    return _batches(_read(BinTools_SurfaceSet, surfaces, 2, 3, _clamped_surface))


def curve_splines(
    curves: Mapping[int, Any],
    dimension: int,
    span: Callable[[int], tuple[float, float]],
    name: Callable[[int], str],
) -> list[SplineBatch]:
    """Lines, Bézier and B-spline curves by number, in batches.

    Parameters
    ----------
    curves : mapping of number to ``Geom_Curve`` or ``Geom2d_Curve``
    dimension : int
        3 or 2.
    span : number to first and last parameter
        Of lines, which become curves of degree 1.
    name : number to the words for the curve

    Raises
    ------
    KernelError
        A curve of another kind.
    """
    from OCP.BinTools import BinTools_Curve2dSet, BinTools_CurveSet
    from OCP.Geom2dConvert import Geom2dConvert
    from OCP.GeomConvert import GeomConvert

    convert = GeomConvert if dimension == 3 else Geom2dConvert
    splines: dict[int, Any] = {}
    lines, ranges, ends = [], [], []
    for number, curve in curves.items():
        kind = _kind(curve)
        if kind == "TrimmedCurve":
            curve = curve.BasisCurve()
            kind = _kind(curve)
        if kind == "Line":
            lines.append(number)
            ranges.append(span(number))
            ends.append([curve.Value(at).Coord() for at in ranges[-1]])
        elif kind == "BSplineCurve":
            splines[number] = curve
        elif kind == "BezierCurve":
            splines[number] = convert.CurveToBSplineCurve_s(curve)
        else:
            raise KernelError(f"{name(number)} is neither a line nor a B-spline: {kind}")
    family = BinTools_CurveSet if dimension == 3 else BinTools_Curve2dSet
    parts = list(_read(family, splines, 1, dimension, _clamped_curve))
    if lines:
        key = (1,), ((2, 2),), (2, dimension)
        parts.append((key, (np.array(lines), (np.array(ranges),), np.array(ends))))
    return _batches(parts)


def _kind(curve: Any) -> str:
    return type(curve).__name__.rsplit("_", 1)[-1]


def _batches(parts: Iterator[tuple[_Key, _Part]] | list[tuple[_Key, _Part]]) -> list[SplineBatch]:
    """Parts of one key joined, with their numbers rising."""
    joined: dict[_Key, list[_Part]] = defaultdict(list)
    for key, part in parts:
        joined[key].append(part)
    made = []
    for (degrees, mults, _), found in sorted(joined.items(), key=lambda item: item[0]):
        numbers = np.concatenate([part[0] for part in found])
        order = np.argsort(numbers)
        knots = [
            np.concatenate([part[1][side] for part in found])[order] for side in range(len(degrees))
        ]
        poles = np.concatenate([part[2] for part in found])[order]
        repeated = tuple(np.array(times) for times in mults)
        made.append(SplineBatch(numbers[order], degrees, repeated, tuple(knots), poles))
    return made


def _read(
    family: Any, splines: Mapping[int, Any], params: int, dimension: int, clamp: Any
) -> Iterator[tuple[_Key, _Part]]:
    """Parts of the splines by what they share; ``clamp`` makes splines clamped that are not.

    Parameters
    ----------
    family : class of OpenCascade that writes such splines
    params : int
        1 for curves, 2 for surfaces.
    dimension : int
        Of the poles.
    """
    loose: dict[int, Any] = {}
    for number, head, rows in _records(family, splines, params, dimension):
        rational, periodic, degrees, counts = head
        sizes, pieces = counts[:params], counts[params:]
        knots = [rows[f"knots{side}"] for side in range(params)]
        poles = rows["poles"].reshape(len(rows), *sizes, -1)
        if any(rational):
            poles = homogeneous(poles[..., :-1], poles[..., -1])
        ends = np.stack([knot["times"][:, end] for knot in knots for end in (0, -1)], axis=1)
        open_ends = np.any(ends <= np.repeat(degrees, 2), axis=1) | any(periodic)
        loose.update({each: splines[each] for each in number[open_ends].tolist()})
        times = np.concatenate([knot["times"] for knot in knots], axis=1)
        cuts = np.cumsum(pieces)[:-1]
        for mults in np.unique(times[~open_ends], axis=0):
            chosen = np.flatnonzero(~open_ends & np.all(times == mults, axis=1))
            key = (
                degrees,
                tuple(tuple(part.tolist()) for part in np.split(mults, cuts)),
                poles.shape[1:],
            )
            yield key, (number[chosen], tuple(knot["at"][chosen] for knot in knots), poles[chosen])
    if loose:
        clamped = {number: clamp(spline) for number, spline in loose.items()}
        yield from _read(family, clamped, params, dimension, clamp)


def _records(
    family: Any, splines: Mapping[int, Any], params: int, dimension: int
) -> Iterator[tuple[Ints, tuple[tuple[int, ...], ...], Any]]:
    """The splines' records in the stream, by layout: numbers, head and structured array.

    The head of a layout is whether it is rational and periodic, the degrees, and the numbers of
    poles and knots, along each parameter.
    """
    if not splines:
        return
    sink, stream = family(), io.BytesIO()
    # A spline that was added before keeps its index.
    index = np.array([sink.Add(spline) for spline in splines.values()]) - 1
    sink.Write(stream)
    data = stream.getvalue()
    head = struct.Struct(f"<x{2 * params}B{params}h{2 * params}i")
    layouts: dict[bytes, np.dtype[Any]] = {}
    starts: dict[bytes, list[int]] = defaultdict(list)
    records: dict[bytes, list[int]] = defaultdict(list)
    at = data.index(b"\n") + 1
    for record in range(index.max() + 1):
        key = data[at : at + head.size]
        if key not in layouts:
            layouts[key] = _layout(head.unpack(key), params, dimension)
        starts[key].append(at)
        records[key].append(record)
        at += layouts[key].itemsize
    numbers, row_of = np.array(list(splines)), np.zeros(len(splines), dtype=np.int64)
    for key, layout in layouts.items():
        joined = b"".join(data[start : start + layout.itemsize] for start in starts[key])
        row_of[:] = -1
        row_of[records[key]] = np.arange(len(records[key]))
        mine = np.flatnonzero(row_of[index] >= 0)
        rows = np.frombuffer(joined, layout)[row_of[index[mine]]]
        values, cuts = head.unpack(key), [0, params, 2 * params, 3 * params, 5 * params]
        parts = tuple(values[start:stop] for start, stop in pairwise(cuts))
        yield numbers[mine], parts, rows


def _layout(head: tuple[int, ...], params: int, dimension: int) -> np.dtype[Any]:
    """Layout of a record: the head, poles with their weights if rational, and knots."""
    counts = head[3 * params :]
    poles = int(np.prod(counts[:params])), dimension + any(head[:params])
    knots = [
        (f"knots{side}", [("at", "<f8"), ("times", "<i4")], pieces)
        for side, pieces in enumerate(counts[params:])
    ]
    return np.dtype([("head", "V", 1 + 12 * params), ("poles", "<f8", poles), *knots])


def _clamped_curve(curve: Any) -> Any:
    curve = curve.Copy()
    if curve.IsPeriodic():
        curve.SetNotPeriodic()
    if min(curve.Multiplicity(i) for i in (1, curve.NbKnots())) <= curve.Degree():
        # Cut to the domain: later stages expect clamped knots.
        curve.Segment(curve.FirstParameter(), curve.LastParameter())
    return curve


def _clamped_surface(surface: Any) -> Any:
    surface = surface.Copy()
    surface.SetUNotPeriodic()
    surface.SetVNotPeriodic()
    ends = [surface.UMultiplicity(i) - surface.UDegree() for i in (1, surface.NbUKnots())]
    ends += [surface.VMultiplicity(i) - surface.VDegree() for i in (1, surface.NbVKnots())]
    if min(ends) <= 0:
        surface.Segment(*surface.Bounds())
    return surface


def homogeneous(poles: Floats, weights: Floats) -> Floats:
    """Cartesian poles and their weights as ``(wx, wy, ..., w)``."""
    return np.concatenate([poles * weights[..., None], weights[..., None]], axis=-1)
