"""Reduction of a whole B-rep within a tolerance of the exact one.

Faces use a share of the tolerance and edges the rest, so surfaces and curves are within the
tolerance of the exact ones, and curves within it of their surfaces. Topology, parameters and
pcurves do not change.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.brep.record import Brep, Curves, Surfaces
from ffdcli.errors import CheckError
from ffdcli.surface.reduce.reduction import TensorSplines, reduce_patches
from ffdcli.surface.tolerance import kernel_tolerance

Batch = TypeVar("Batch", Curves, Surfaces)

# Share of the tolerance that faces may use; edges get the rest, and what faces do not use.
_FACE_SHARE = 0.85
# New control points are rounded to this share of the tolerance, down to a power of ten.
_STEP_SHARE = 0.03
# Change due to 13 digits in a file, relative to coordinates and parameters, with a margin for
# surfaces that stretch their parameters; and the share of the bound that it may use.
_TEXT_DIGITS = 1e-11
_TEXT_SHARE = 1e-3
# Share of the width of a face by which its outline may move; more might make it cross itself.
_WIDTH_SHARE = 0.1


def reduce_brep(brep: Brep, tolerance: float, max_degree: int | None = None) -> tuple[Brep, float]:
    """Reduce all surfaces and all curves of a B-rep.

    Parameters
    ----------
    brep : Brep
    tolerance : float, model length
    max_degree : int, optional
        Highest degree; spans are divided where it needs more knots.

    Returns
    -------
    Brep
        Tolerances of edges grow by the bounds of their curve and of their faces; those of vertices
        are the largest of their edges.
    float, model length
        Certified bound of the distance from the exact surfaces and curves, parameter by parameter,
        and of what the distance between curves and their surfaces has grown by; 0 where nothing
        has changed.

    Raises
    ------
    CheckError
        The tolerance is not met at that degree with any reasonable number of knots.
    """
    face = brep.face_of_coedge
    step = 10.0 ** math.floor(math.log10(_STEP_SHARE * tolerance))
    text = _text_rounding(brep)
    text = text if text < _TEXT_SHARE * tolerance else 0.0
    allowed = np.minimum(tolerance - text, _WIDTH_SHARE * _widths(brep, face))
    per_surface = _least(brep.face_surface, _FACE_SHARE * allowed, brep.surface_count)
    surfaces, surface_bounds = _surfaces(brep, per_surface, step, max_degree)
    beside = np.zeros(len(brep.edges))
    np.maximum.at(beside, brep.coedge_edge, surface_bounds[brep.face_surface[face]])
    per_edge = _least(brep.coedge_edge, allowed[face], len(brep.edges))
    curves, curve_bounds = _curves(brep, np.maximum(per_edge - beside, 0.0), step, max_degree)
    added = curve_bounds + beside
    reached = max(float(surface_bounds.max(initial=0.0)), float(added.max(initial=0.0)))
    reached += text if reached else 0.0
    if reached > tolerance:
        needed = max(float(surface_bounds.max(initial=0.0)) / _FACE_SHARE, reached)
        raise CheckError(
            f"degree {max_degree} does not come within {tolerance:.3g} of the exact surfaces, "
            "however many knots are added",
            hint=f"a tolerance of {_rounded_up(needed):.2g} would do, or a higher degree",
        )
    return _with_tolerances(replace(brep, surfaces=surfaces, curves=curves), added), reached


def digits_within(brep: Brep, max_error: float) -> int:
    """Significant digits that a reduced B-rep needs in files: 13, or 17 where 13 would show.

    New control points are short in any case; the bound includes the change of knots and vertices
    due to 13 digits.
    """
    return 13 if _text_rounding(brep) < _TEXT_SHARE * max_error else 17


def _text_rounding(brep: Brep) -> float:
    """Largest change of a point due to 13 digits of coordinates and parameters, model length."""
    largest = float(np.abs(brep.points).max(initial=0.0))
    parameter = float(np.abs(brep.pcurves).max(initial=0.0))
    return _TEXT_DIGITS * (largest + parameter)


def _least(owner: Ints, values: Floats, count: int) -> Floats:
    """(count,) least value of each owner."""
    out = np.full(count, np.inf)
    np.minimum.at(out, owner, values)
    return out


def _widths(brep: Brep, face: Ints) -> Floats:
    """(F,) approximate width of each face, model length, at most its shortest edge.

    It is twice the area over half the outline in parameters, times the least stretch of an edge.
    """
    ends = brep.pcurves
    sense = np.where(brep.coedge_forward, 0.5, -0.5)
    cross = ends[:, 0, 0] * ends[:, 1, 1] - ends[:, 1, 0] * ends[:, 0, 1]
    area = np.abs(np.bincount(face, sense * cross, minlength=brep.face_count))
    flat = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    around = np.bincount(face, flat, minlength=brep.face_count)
    chord = np.linalg.norm(np.diff(brep.points[brep.edges], axis=1)[:, 0], axis=1)
    chord = chord[brep.coedge_edge]
    stretch = _least(face, chord / flat, brep.face_count)
    return np.minimum(2 * area / around * stretch, _least(face, chord, brep.face_count))


def _surfaces(
    brep: Brep, tolerances: Floats, step: float, max_degree: int | None
) -> tuple[tuple[Surfaces, ...], Floats]:
    """Reduced surfaces, and the bound (S,) of every surface, 0 for planes."""
    bounds = np.zeros(brep.surface_count)
    out = []
    for same in _alike(brep.surfaces):
        number = np.concatenate([batch.surfaces for batch in same])
        first = same[0]
        patches = TensorSplines(
            first.degrees,
            (
                np.concatenate([batch.u_knots for batch in same]),
                np.concatenate([batch.v_knots for batch in same]),
            ),
            (first.u_mults, first.v_mults),
            np.concatenate([batch.poles for batch in same]),
        )
        for found in reduce_patches(patches, tolerances[number], step=step, max_degree=max_degree):
            made, rows = found.patches, number[found.rows]
            out.append(Surfaces(rows, made.degrees, *made.knots, *made.mults, made.poles))
            bounds[rows] = found.bounds
    return tuple(out), bounds


def _curves(
    brep: Brep, tolerances: Floats, step: float, max_degree: int | None
) -> tuple[tuple[Curves, ...], Floats]:
    """Reduced curves with the same ends, and the bound (E,) of every edge."""
    bounds = np.zeros(len(brep.edges))
    out = []
    point = np.array([1, 1])
    for same in _alike(brep.curves):
        number = np.concatenate([batch.edges for batch in same])
        first = same[0]
        patches = TensorSplines(
            (first.degree, 0),
            (
                np.concatenate([batch.knots for batch in same]),
                np.tile([0.0, 1.0], (len(number), 1)),
            ),
            (first.mults, point),
            np.concatenate([batch.poles for batch in same])[:, :, None],
        )
        for found in reduce_patches(
            patches, tolerances[number], step=step, max_degree=max_degree, keep_ends=True
        ):
            made, rows = found.patches, number[found.rows]
            poles = made.poles[:, :, 0]
            out.append(Curves(rows, made.degrees[0], made.knots[0], made.mults[0], poles))
            bounds[rows] = found.bounds
    return tuple(out), bounds


def _alike(batches: Sequence[Batch]) -> list[list[Batch]]:
    """Groups of batches with the same degrees, multiplicities and number of coordinates."""
    groups: dict[object, list[Batch]] = {}
    for batch in batches:
        if isinstance(batch, Surfaces):
            pattern = (batch.degrees, batch.u_mults.tobytes(), batch.v_mults.tobytes())
        else:
            pattern = ((batch.degree, 0), batch.mults.tobytes(), b"")
        groups.setdefault((pattern, batch.poles.shape[-1]), []).append(batch)
    return list(groups.values())


def _with_tolerances(brep: Brep, added: Floats) -> Brep:
    """The B-rep with tolerances that allow for what was added (E,) to the gaps at its edges."""
    floor = kernel_tolerance(brep.points)
    gaps = np.where(brep.edge_tolerance > floor, brep.edge_tolerance, 0.0)
    edges = np.maximum(brep.edge_tolerance, gaps + added)
    vertices = brep.vertex_tolerance.copy()
    for side in range(2):
        np.maximum.at(vertices, brep.edges[:, side], edges)
    return replace(brep, edge_tolerance=edges, vertex_tolerance=vertices)


def _rounded_up(value: float) -> float:
    """The next larger number of two digits."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / step) * step
