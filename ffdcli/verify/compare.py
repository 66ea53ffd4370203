"""Compare the content of a CAD file with a deformed mesh.

Distances are measured in both directions: from points of the deformed mesh to the file's trimmed
faces, and from points of every face and edge of the file to the deformed mesh. The deformation is
only evaluated, point by point, and the file only read.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bspline import sums
from ffdcli.brep.evaluate.closedness import describe, edge_faults, mesh_bodies
from ffdcli.brep.evaluate.face_points import (
    EdgePoints,
    FacePoints,
    distances,
    edge_points,
    face_points,
)
from ffdcli.brep.evaluate.integrate import centre_of, shell_volumes
from ffdcli.brep.evaluate.lookup import Model, model_of_brep, model_of_read
from ffdcli.brep.evaluate.own_check import edge_gaps, turned_faces, wrong_volumes
from ffdcli.brep.evaluate.quadrature import AGREE
from ffdcli.brep.evaluate.trim import TrimSegments, areas, outlines
from ffdcli.brep.readback import ReadBrep
from ffdcli.brep.record import Brep
from ffdcli.deformation import Deformation
from ffdcli.mesh import Mesh, triangles
from ffdcli.verify.deformed_mesh import DeformedMesh, ModelMap, spread_over
from ffdcli.verify.flux import fluxes
from ffdcli.verify.nearest_on_deformed_mesh import distances_to_deformed_mesh
from ffdcli.verify.reasons import (
    Measured,
    looking_inwards,
    not_decided,
    open_or_turned,
    too_far,
    unusable,
    wrong_volume,
)

# Rounding error of distances, relative to the size of the model.
ROUNDING = 1e-13
# Number of triangles across which a start point is passed on.
BESIDE = 8
# Distances of faces above this share of the size are searched for by bounds.
_KNOWN = 1e-9


@dataclass(frozen=True)
class Verification:
    """The result of verifying a file.

    Parameters
    ----------
    passed : bool
        Nothing is wrong, and nothing was left undecided.
    valid : bool
        OpenCascade's own check of the file.
    watertight : bool
        Every edge is used twice, in opposite senses, and there is a solid; counted here.
    solids, faces : int
        In the file.
    samples : int
        Points measured, in both directions together.
    max_deviation, rms_deviation : float, model length
        Largest and root mean square distance; the largest includes distances of edge curves
        from their faces (half of them if a reduction is expected) and from their vertices.
        Infinite if the file has nothing to measure.
    tolerance : float, model length
        Largest deviation allowed.
    volume, expected_volume : float or None, cubed model length
        Of the file and of the deformed mesh; None where the mesh is open.
    volume_error : float or None, cubed model length
        Estimate of the largest error of both together, beyond rounding.
    unit : str
    reasons : tuple of str
        Why it failed: what, and where. Empty where nothing was found wrong.
    undecided : tuple of str
        Points that no search found near enough, and that bounds did not prove to be too far within
        the effort allowed; volumes that are not known well enough. Empty where something is wrong.
    """

    passed: bool
    valid: bool
    watertight: bool
    solids: int
    faces: int
    samples: int
    max_deviation: float
    rms_deviation: float
    tolerance: float
    volume: float | None
    expected_volume: float | None
    volume_error: float | None
    unit: str
    reasons: tuple[str, ...]
    undecided: tuple[str, ...]


def verify(
    read: ReadBrep,
    kernel_valid: bool,
    mesh: Mesh,
    deformation: ModelMap,
    tolerance: float,
    samples: int = 10_000,
    unit: str = "mm",
    expected_error: float = 0.0,
    agree: float = AGREE,
) -> Verification:
    """Compare a file with the deformation of a mesh.

    Parameters
    ----------
    read : ReadBrep
        Content of the file, without repairs.
    kernel_valid : bool
        OpenCascade's own check.
    mesh : Mesh
    deformation : ModelMap
    tolerance : float, model length
        Distance up to which the file may deviate.
    samples : int
        Points spread over the mesh, and over the file, in addition to those of each triangle, face
        and edge.
    unit : str
        Unit of the file, for the report.
    expected_error : float, model length
        Known error of the file: distances up to half of it are not refined.
    agree : float
        As for :func:`ffdcli.verify.flux.fluxes`.
    """
    model = model_of_read(read)
    lines = outlines(model)
    corners, _ = triangles(mesh)
    body, body_closed, neighbours = mesh_bodies(corners)
    closed = bool(len(corners) and body_closed.all())
    image = DeformedMesh(mesh.vertices[corners], neighbours, deformation)
    reasons = [] if kernel_valid else ["OpenCascade does not find the file's shape valid"]
    reasons += unusable(model)
    ending, wrong = edge_faults(read)
    watertight = bool(read.solid_count > 0 and not ending.any() and not wrong.any())
    reasons += open_or_turned(model, closed, ending & closed, wrong)

    centre = centre_of(model)
    shells, solids, errors = shell_volumes(model, lines, centre)
    expected, doubts = fluxes(image, centre, agree=agree)
    flat, _ = fluxes(replace(image, deformation=Deformation.identity()), centre)
    mirror = _mirrored(expected, flat, body, body_closed)
    if not closed:
        # The flux through an open surface may be nearly zero.
        slopes = deformation.jacobian(image.corners.mean(axis=1))
        sense = float(np.sign(np.linalg.det(slopes)).sum())
        opened = ~body_closed[body]
        mirror[opened] = -1.0 if sense < 0 else 1.0
    expected *= mirror
    turned = wrong_volumes(read.shell_solid, shells, solids)
    reasons += turned_faces(model, areas(lines)) + turned
    if closed:
        bodies = int((sums(body, flat, len(body_closed)) > 0).sum())
        if bodies != read.solid_count:
            reasons.append(
                f"the file holds {read.solid_count} solids, but the mesh has {bodies} bodies"
            )

    span = _extent(np.concatenate([image.corners.reshape(-1, 3), read.points]))
    # Faces may be narrower than the expected error, so steps continue to rounding.
    settle = settling_distance(mesh.size, span)
    enough = max(settle, expected_error / 2, 1e-3 * tolerance)
    spots, on_edges = face_points(model, lines, samples), _some(edge_points(model))
    measured = _measure(model, lines, image, spots, on_edges, samples, settle, enough, tolerance)
    reasons += too_far(measured, spots, on_edges, tolerance, model)
    undecided = not_decided(measured, spots, on_edges, tolerance)
    # A closed shell with the right volume has no flipped face. Where bodies touch, the triangle
    # nearest to a face may belong to the other body.
    doubtful = np.full(len(read.shell_closed), bool(turned))
    doubtful[read.face_shell[model.read.face_of_coedge[(ending | wrong)[read.coedge_edge]]]] = True
    reasons += looking_inwards(
        image, measured.from_faces, spots, tolerance, mirror, doubtful[read.face_shell], settle
    )
    gaps, ends = edge_gaps(model)
    # Reduced curves and surfaces may err to opposite sides, so a gap proves an error of half its
    # size. The errors themselves are measured against the mesh.
    sides = 2 if expected_error > 0 else 1
    gap = np.maximum(gaps / sides, ends.max(axis=1, initial=0.0))
    if np.any(gap > tolerance):
        worst = int(np.argmax(gap))
        place = describe(read.points[read.edges[worst]].mean(axis=0))
        off = max(gaps[worst], ends[worst].max())
        reasons.append(f"edge {worst + 1} near {place} is {off:.3g} off its faces or vertices")
    error = float(errors.sum() + doubts.sum())
    failed, unknown = wrong_volume(shells.sum(), expected.sum(), error, image, tolerance, closed)
    reasons += failed
    undecided += unknown

    every = np.concatenate(
        [measured.from_mesh.distance, measured.from_faces.distance, measured.from_edges.distance]
    )
    found = len(measured.from_faces.distance) > 0 and len(measured.from_mesh.distance) > 0
    return Verification(
        passed=not reasons and not undecided,
        valid=kernel_valid,
        watertight=watertight,
        solids=read.solid_count,
        faces=read.face_count,
        samples=len(every),
        max_deviation=max(float(every.max()), float(gap.max(initial=0))) if found else np.inf,
        rms_deviation=float(np.sqrt(np.mean(every**2))) if found else np.inf,
        tolerance=float(tolerance),
        volume=float(shells.sum()) if closed else None,
        expected_volume=float(expected.sum()) if closed else None,
        volume_error=error if closed else None,
        unit=unit,
        reasons=tuple(reasons),
        undecided=() if reasons else tuple(undecided),
    )


def _mirrored(expected: Floats, flat: Floats, body: Ints, closed: Bools) -> Floats:
    """(T,) -1 for triangles of bodies that the deformation turns inside out, else 1.

    An edit may mirror one body and not another, while all solids of the file face outwards. The
    flux through one open body is meaningless, so all open bodies are judged together.
    """
    key = np.where(closed, np.arange(len(closed)), len(closed))[body]
    count = len(closed) + 1
    turned = sums(key, expected, count) * sums(key, flat, count) < 0
    return np.where(turned, -1.0, 1.0)[key]


def from_faces(brep: Brep, image: DeformedMesh, size: float, samples: int = 10_000) -> Floats:
    """(F,) largest sampled distance of each face from the deformed mesh, model length.

    Parameters
    ----------
    brep : Brep
    image : DeformedMesh
        The deformed mesh.
    size : float, model length
        Of the undeformed mesh.
    samples : int
        Points spread over the faces, in addition to those of each face.
    """
    model = model_of_brep(brep)
    spots = face_points(model, outlines(model), samples)
    settle = settling_distance(
        size, _extent(np.concatenate([image.corners.reshape(-1, 3), brep.points]))
    )
    triangle, params = spread_over(image, samples)
    seeds = (triangle, params, image.on_triangles(triangle, params)[0])
    back = distances_to_deformed_mesh(image, seeds, spots.position, settle, settle, _KNOWN * size)
    found = np.zeros(brep.face_count)
    np.maximum.at(found, spots.face, back.distance)
    return found


def settling_distance(size: float, span: float) -> float:
    """Distance at the level of rounding errors."""
    return max(ROUNDING * size, 8 * np.finfo(float).eps * span)


def _extent(points: Floats) -> float:
    return float(np.abs(points).max(initial=0.0))


def _some(points: EdgePoints) -> EdgePoints:
    """Every third point, at least two on each edge; faces are sampled as well."""
    return EdgePoints(points.edge[::3], points.at[::3], points.position[::3])


def _measure(
    model: Model,
    lines: TrimSegments,
    image: DeformedMesh,
    spots: FacePoints,
    on_edges: EdgePoints,
    samples: int,
    settle: float,
    enough: float,
    tolerance: float,
) -> Measured:
    triangle, params = spread_over(image, samples)
    points, _ = image.on_triangles(triangle, params)
    seeds = (triangle, params, points)
    back = distances_to_deformed_mesh(
        image,
        seeds,
        np.concatenate([spots.position, on_edges.position]),
        settle,
        enough,
        tolerance,
    )
    count = len(spots.face)
    hints = _spot_of_triangle(back.owner[:count], image.neighbours)[triangle]
    return Measured(
        distances(model, lines, spots, on_edges, points, hints, settle, enough, tolerance),
        points,
        back.take(slice(count)),
        back.take(slice(count, None)),
    )


def _spot_of_triangle(owner: Ints, neighbours: Ints) -> Ints:
    """(T,) a face point whose foot is on the triangle or near it, -1 for none.

    These are start points only. Among needles the nearest points are seldom on the right face.
    """
    spot = np.full(len(neighbours), -1, dtype=np.int64)
    known = np.flatnonzero(owner >= 0)
    spot[owner[known]] = known
    for _ in range(BESIDE):
        for side in range(3):
            bare = np.flatnonzero((spot < 0) & (neighbours[:, side] >= 0))
            spot[bare] = spot[neighbours[bare, side]]
    return spot
