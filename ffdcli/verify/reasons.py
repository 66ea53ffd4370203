"""Messages about the faults of a file: kind, amount and place."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.brep.evaluate.bspline import sums
from ffdcli.brep.evaluate.closedness import describe
from ffdcli.brep.evaluate.face_points import EdgePoints, FacePoints
from ffdcli.brep.evaluate.lookup import Model
from ffdcli.brep.evaluate.nearest import Feet
from ffdcli.verify.deformed_mesh import DeformedMesh
from ffdcli.verify.nearest_on_deformed_mesh import distances_to_deformed_mesh

# Least relative tolerance of volumes.
VOLUME = 1e-9


@dataclass(frozen=True)
class Measured:
    """Distances in both directions, with the points they were measured at."""

    from_mesh: Feet
    mesh_points: Floats
    from_faces: Feet
    from_edges: Feet


def unusable(model: Model) -> list[str]:
    """Messages for missing faces, surfaces, curves and pcurves."""
    if not model.read.face_count:
        return ["the file holds no faces"]
    reasons = []
    for missing, what, of in (
        (model.face_at[0] < 0, "surface", "face"),
        (model.curve_at[0] < 0, "curve", "edge"),
        (model.pcurve_at[0] < 0, "curve on its surface", "edge use"),
    ):
        if missing.any():
            reasons.append(
                f"{missing.sum()} {of}s have no {what}, the first {of} "
                f"{int(np.argmax(missing)) + 1} of {len(missing)}"
            )
    return reasons


def open_or_turned(model: Model, closed: bool, ending: Bools, wrong: Bools) -> list[str]:
    """Messages for open edges of a closed mesh, and for edges that are used wrongly."""
    read = model.read
    reasons = []
    for bad, what in (
        (ending, "belong to one face only: a face is missing or not joined"),
        (
            wrong,
            "are used twice in one sense or more than twice: a face is flipped or doubled",
        ),
    ):
        if bad.any():
            edge = int(np.argmax(bad))
            faces = np.unique(model.read.face_of_coedge[read.coedge_edge == edge]) + 1
            names = ", ".join(str(face) for face in faces)
            place = describe(read.points[read.edges[edge]].mean(axis=0))
            reasons.append(f"{bad.sum()} edges {what} (the first at face {names}, near {place})")
    if closed and not read.solid_count:
        reasons.append("the mesh is closed, but the file holds no solid")
    return reasons


def too_far(
    measured: Measured,
    spots: FacePoints,
    on_edges: EdgePoints,
    tolerance: float,
    model: Model,
) -> list[str]:
    """Messages for distances above the tolerance, where at least one is proved to be.

    The worst is proved; the numbers count all points that the searches found no nearer.
    """
    reasons = []
    count = model.read.face_count
    missed = np.ones(count, dtype=bool)
    missed[spots.face] = False
    if missed.any():
        face = int(np.argmax(missed)) + 1
        reasons.append(
            f"{missed.sum()} faces have no inside that could be measured, the first face {face} "
            f"of {count}"
        )
    far = measured.from_mesh.distance
    proved = _proved(measured.from_mesh, tolerance)
    if np.any(proved):
        worst = int(np.argmax(np.where(proved, far, 0)))
        place = describe(measured.mesh_points[worst])
        reasons.append(
            f"{(far > tolerance).sum()} of {len(far)} points of the deformed mesh are not on the "
            f"file's faces, the worst at {place}, {far[worst]:.3g} away"
        )
    for feet, owner, position, what in (
        (measured.from_faces, spots.face, spots.position, "face"),
        (measured.from_edges, on_edges.edge, on_edges.position, "edge"),
    ):
        proved = _proved(feet, tolerance)
        if np.any(proved):
            beyond = feet.distance > tolerance
            worst = int(np.argmax(np.where(proved, feet.distance, 0)))
            reasons.append(
                f"{len(np.unique(owner[beyond]))} {what}s of the file are not on the deformed "
                f"mesh, the worst {what} {owner[worst] + 1} at {describe(position[worst])}, "
                f"{feet.distance[worst]:.3g} away"
            )
    return reasons


def _proved(feet: Feet, tolerance: float) -> Bools:
    """(n,) True for points whose distance is proved to be above the tolerance."""
    proved: Bools = (feet.distance > tolerance) & (feet.least >= tolerance)
    return proved


def not_decided(
    measured: Measured, spots: FacePoints, on_edges: EdgePoints, tolerance: float
) -> list[str]:
    """Messages for points that were found nowhere near enough, without a proof that none is."""
    messages = []
    for feet, position, what in (
        (measured.from_mesh, measured.mesh_points, "the deformed mesh"),
        (measured.from_faces, spots.position, "the file's faces"),
        (measured.from_edges, on_edges.position, "the file's edges"),
    ):
        open_ = np.flatnonzero((feet.distance > tolerance) & (feet.least < tolerance))
        if len(open_):
            worst = open_[np.argmax(feet.distance[open_])]
            messages.append(
                f"{len(open_)} of {len(feet.distance)} points of {what} are not decided within the "
                f"effort allowed: the one at {describe(position[worst])} is between "
                f"{feet.least[worst]:.3g} and {feet.distance[worst]:.3g} away"
            )
    return messages


def looking_inwards(
    image: DeformedMesh,
    feet: Feet,
    spots: FacePoints,
    tolerance: float,
    mirror: Floats,
    doubtful: Bools,
    settle: float,
) -> list[str]:
    """Messages for doubtful faces (F,) whose normal is opposite to that of the deformed mesh.

    ``mirror`` (T,) is -1 for triangles of bodies that the deformation turns inside out. ``settle``
    is as of :func:`~ffdcli.verify.nearest_on_deformed_mesh.distances_to_deformed_mesh`.
    """
    sides = _sides(image, feet, spots.normal, tolerance, mirror)
    inward = np.flatnonzero((sums(spots.face, sides, len(doubtful)) < 0) & doubtful)
    if not len(inward):
        return []
    # Sheets of a mesh may lie on one another; the nearest triangle may then be of the other sheet.
    at = np.flatnonzero(np.isin(spots.face, inward))
    rest = np.setdiff1d(np.arange(len(image.corners)), feet.owner[at[sides[at] < 0]])
    others = replace(image, corners=image.corners[rest], neighbours=np.full((len(rest), 3), -1))
    none = (np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 3)))
    if len(rest):
        again = distances_to_deformed_mesh(
            others, none, spots.position[at], settle, tolerance, np.inf
        )
        agree = (sides[at] > 0) | (
            _sides(others, again, spots.normal[at], tolerance, mirror[rest]) > 0
        )
        many = np.bincount(spots.face[at], minlength=len(doubtful))
        held = np.bincount(spots.face[at], weights=agree, minlength=len(doubtful))
        inward = inward[2 * held[inward] <= many[inward]]
    if not len(inward):
        return []
    place = spots.position[np.argmax(spots.face == inward[0])]
    return [
        f"{len(inward)} faces look inwards, the first face {inward[0] + 1} near {describe(place)}"
    ]


def _sides(
    image: DeformedMesh, feet: Feet, normals: Floats, tolerance: float, mirror: Floats
) -> Floats:
    """(n,) 1 where the triangle at a foot looks as the normal (n, 3) does, -1 where it does not.

    0 where the foot is farther than the tolerance.
    """
    near = np.flatnonzero((feet.distance <= tolerance) & (feet.owner >= 0))
    _, tangents = image.on_triangles(feet.owner[near], feet.params[near])
    normal = mirror[feet.owner[near], None] * np.cross(tangents[:, 0], tangents[:, 1])
    side = np.zeros(len(normals))
    side[near] = np.sign((normal * normals[near]).sum(axis=1))
    return side


def wrong_volume(
    volume: float,
    expected: float,
    error: float,
    image: DeformedMesh,
    tolerance: float,
    closed: bool,
) -> tuple[list[str], list[str]]:
    """Messages if the volume is not that of the deformed mesh, and if ``error`` leaves that open.

    The error is that of both volumes together, cubed model length.
    """
    third = np.full((len(image.corners), 2), 1 / 3)
    _, tangents = image.on_triangles(np.arange(len(image.corners)), third)
    area = np.linalg.norm(np.cross(tangents[:, 0], tangents[:, 1]), axis=1).sum() / 2
    allowed = max(VOLUME * abs(expected), tolerance * area)
    what = "volume" if closed else "flux through the open shell"
    found = f"the file's {what} is {volume:.12g}, the deformed mesh's {expected:.12g}"
    if abs(volume - expected) > allowed + error:
        return [found], []
    if abs(volume - expected) > allowed:
        return [], [f"{found}, known within {error:.3g} only"]
    return [], []
