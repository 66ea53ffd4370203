"""Compare the content of a CAD file with a deformed part."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.brep.evaluate.bspline import sums
from ffdcli.brep.evaluate.closedness import edge_faults
from ffdcli.brep.evaluate.own_check import wrong_volumes
from ffdcli.deformation import Deformation
from ffdcli.verify.compare import Verification, settling_distance
from ffdcli.verify.deformed_mesh import ModelMap
from ffdcli.verify.part.match import differing_counts
from ffdcli.verify.part.outlines import outside_outlines
from ffdcli.verify.part.pair import Pair
from ffdcli.verify.part.reasons import (
    Names,
    border_edges,
    loose_pcurves,
    moved_vertices,
    not_decided,
    too_far,
    turned_faces,
    wrong_volume,
)
from ffdcli.verify.part.search import Target
from ffdcli.verify.part.shape import DeformedShape
from ffdcli.verify.part.volume import shell_fluxes

if TYPE_CHECKING:
    from ffdcli.brep.occ.part.sample import SampledShape

# Accuracy wanted of volumes, as a share of what is allowed.
_SHARE = 1e-2


def verify_part(
    part: SampledShape,
    file: SampledShape,
    kernel_valid: bool,
    deformation: ModelMap,
    size: float,
    tolerance: float,
    *,
    samples: int = 10_000,
    unit: str = "mm",
    names: Names = (),
) -> Verification:
    """Compare a file with the deformation of a part.

    Parameters
    ----------
    part, file : SampledShape
        The part before its deformation, and the file's content, without repairs.
    kernel_valid : bool
        OpenCascade's own check of the file.
    deformation : ModelMap
    size : float, model length
        Of the part.
    tolerance : float, model length
        Distance up to which the file may deviate.
    samples : int
        Points spread over the faces of each, in addition to those on every polynomial piece.
    unit : str
        Unit of the file, for the report.
    names : sequence of str or None
        Of the part's faces, for messages.
    """
    image = DeformedShape(part, deformation)
    written = DeformedShape(file, Deformation.identity())
    reasons = [] if kernel_valid else ["OpenCascade does not find the file's shape valid"]
    reasons += differing_counts(part, file)
    if not written.face_count:
        return _nothing(file, kernel_valid, tolerance, unit, reasons)
    closed = bool(part.shell_closed.all())
    ending, wrong = edge_faults(file)
    ending &= ~file.degenerate
    watertight = bool(file.solid_count > 0 and not ending.any() and not wrong.any())
    reasons += border_edges(file, ending & closed, wrong)

    span = float(np.abs(np.concatenate([image.points, file.points])).max(initial=0.0))
    pair = Pair(image, written, samples, settling_distance(size, span), tolerance)
    for found in pair.found:
        reasons += too_far(found, tolerance, len(part.edges), names)
    undecided = [text for found in pair.found for text in not_decided(found, tolerance)]
    off = np.zeros(0)
    if pair.ordered:
        off = np.linalg.norm(image.points - file.points, axis=1)
        reasons += moved_vertices(off, image.points, tolerance)
        reasons += _loose(pair)
    reasons += outside_outlines(pair, names)

    centre = image.points.mean(axis=0) if len(image.points) else np.zeros(3)
    accuracy = _SHARE * tolerance
    expected, doubts, _ = shell_fluxes(image, centre, accuracy)
    volumes, errors, areas = shell_fluxes(written, centre, accuracy)
    mirror = _mirrored(pair, expected)
    expected *= mirror
    inner = file.shell_solid >= 0
    solids = sums(file.shell_solid[inner], volumes[inner], file.solid_count)
    reasons += wrong_volumes(file.shell_solid, volumes, solids)
    if pair.ordered:
        reasons += _turned(pair, mirror, names)
    error = float(errors.sum() + doubts.sum())
    failed, unknown = wrong_volume(
        float(volumes.sum()), float(expected.sum()), error, float(areas.sum()), tolerance, closed
    )
    every = np.concatenate([*(found.feet.distance for found in pair.found), off])
    return Verification(
        passed=not (reasons or undecided or failed or unknown),
        valid=kernel_valid,
        watertight=watertight,
        solids=file.solid_count,
        faces=written.face_count,
        samples=len(every),
        max_deviation=float(every.max()),
        rms_deviation=float(np.sqrt(np.mean(every**2))),
        tolerance=float(tolerance),
        volume=float(volumes.sum()) if closed else None,
        expected_volume=float(expected.sum()) if closed else None,
        volume_error=error if closed else None,
        unit=unit,
        reasons=(*reasons, *failed),
        undecided=() if reasons or failed else (*undecided, *unknown),
    )


def _nothing(
    file: SampledShape, valid: bool, tolerance: float, unit: str, reasons: list[str]
) -> Verification:
    """The verdict on a file without faces."""
    return Verification(
        passed=False,
        valid=valid,
        watertight=False,
        solids=file.solid_count,
        faces=0,
        samples=0,
        max_deviation=np.inf,
        rms_deviation=np.inf,
        tolerance=float(tolerance),
        volume=None,
        expected_volume=None,
        volume_error=None,
        unit=unit,
        reasons=(*reasons, "the file holds no faces"),
        undecided=(),
    )


def _loose(pair: Pair) -> list[str]:
    """Messages for pcurves that leave the curves of their edges more than in the part."""
    gaps = []
    for image, spots in ((pair.part, pair.lines[0]), (pair.file, pair.lines[1])):
        shape = image.shape
        edges = len(shape.edges)
        coedge = np.maximum(spots.owner - edges, 0)
        edge = shape.coedge_edge[coedge]
        mine = np.flatnonzero((spots.owner >= edges) & image.line_there[edge])
        lines = Target.lines(image, spots)
        shares = lines.shares(spots.owner[mine], spots.params[mine])
        place, _ = image.on_lines(edge[mine], lines.at_shares(edge[mine], shares))
        gaps.append((coedge[mine], np.linalg.norm(place - spots.position[mine], axis=1), place))
    known = np.zeros(len(pair.part.shape.coedge_edge))
    np.maximum.at(known, gaps[0][0], gaps[0][1])
    coedge, gap, place = gaps[1]
    gap -= known[coedge] + pair.slack[len(pair.file.shape.edges) :][coedge]
    return loose_pcurves(gap, coedge, place, pair.tolerance)


def _mirrored(pair: Pair, fluxes: Floats) -> Floats:
    """(S,) -1 for shells that the deformation turns inside out, else 1.

    Solids that it turns have a negative volume unless their faces are turned over. For sheets the
    sense of the deformation at their points decides.
    """
    shape, spots = pair.part.shape, pair.faces[0]
    count = len(shape.shell_closed)
    source, _ = shape.on_faces(spots.owner, spots.params)
    sense = np.sign(np.linalg.det(pair.part.deformation.jacobian(source)))
    votes = sums(shape.face_shell[spots.owner], sense, count)
    solid = shape.shell_solid
    inner = solid >= 0
    votes[inner] = sums(solid[inner], fluxes[inner], int(solid.max(initial=-1)) + 1)[solid[inner]]
    return np.where(votes < 0, -1.0, 1.0)


def _turned(pair: Pair, mirror: Floats, names: Names) -> list[str]:
    """Messages for faces that look to the other side than in the deformed part."""
    found, part, file = pair.found[0], pair.part.shape, pair.file.shape
    near = np.flatnonzero(found.feet.distance <= pair.tolerance)
    face, params = found.feet.owner[near], found.feet.params[near]
    sides = found.spots.tangents[near]
    _, others = pair.file.on_faces(face, params)
    normals = (np.cross(each[:, 0], each[:, 1]) for each in (sides, others))
    vote = np.sign(np.einsum("nx,nx->n", *normals))
    mine = found.spots.owner[near]
    vote *= np.where(part.face_reversed[mine], -1, 1) * np.where(file.face_reversed[face], -1, 1)
    return turned_faces(face, vote * mirror[part.face_shell[mine]], len(file.face_reversed), names)
