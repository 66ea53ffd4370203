"""Messages about the faults of a deformed part's file: kind, amount and place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.brep.evaluate.bspline import sums
from ffdcli.brep.evaluate.closedness import describe
from ffdcli.brep.evaluate.nearest import Feet
from ffdcli.verify.part.spots import Spots
from ffdcli.verify.reasons import VOLUME

if TYPE_CHECKING:
    from ffdcli.brep.occ.part.sample import SampledShape

Names = Sequence[str | None]
_OTHER = {"part": "file", "file": "deformed part"}
_SIDE = {"part": "deformed part", "file": "file"}


@dataclass(frozen=True, eq=False)
class Found:
    """Distances of faces or lines of one side, ``part`` or ``file``, from those of the other."""

    spots: Spots
    feet: Feet
    side: str
    faces: bool


def face_name(face: int, names: Names) -> str:
    """Number of a face, and its name."""
    name = names[face] if face < len(names) else None
    return f"face {face + 1}" + (f" ({name})" if name else "")


def border_edges(shape: SampledShape, ending: Bools, wrong: Bools) -> list[str]:
    """Messages for open edges of a closed part, and for edges that are used wrongly."""
    reasons = []
    for bad, what in (
        (ending, "belong to one face only: a face is missing or not joined"),
        (wrong, "are used twice in one sense or more than twice: a face is flipped or doubled"),
    ):
        if bad.any():
            edge = int(np.argmax(bad))
            faces = np.unique(shape.coedge_face[shape.coedge_edge == edge]) + 1
            place = describe(shape.points[shape.edges[edge]].mean(axis=0))
            listed = ", ".join(str(face) for face in faces)
            reasons.append(f"{bad.sum()} edges {what} (the first at face {listed}, near {place})")
    return reasons


def moved_vertices(off: Floats, points: Floats, tolerance: float) -> list[str]:
    """Messages for vertices at points (V, 3) that are too far off (V,) their places."""
    beyond = off > tolerance
    if not beyond.any():
        return []
    worst = int(np.argmax(off))
    return [
        f"{beyond.sum()} vertices are not where the deformation moves them, the worst should be "
        f"at {describe(points[worst])}, {off[worst]:.3g} away"
    ]


def too_far(found: Found, tolerance: float, edges: int, names: Names) -> list[str]:
    """Messages for distances above the tolerance, where at least one is proved to be."""
    feet, spots = found.feet, found.spots
    proved = _proved(feet, tolerance)
    if not proved.any():
        return []
    far = feet.distance > tolerance
    worst = int(np.argmax(np.where(proved, feet.distance, 0)))
    owner = int(spots.owner[worst])
    if found.faces:
        kind, what = "faces", face_name(owner, names)
    else:
        kind = "edges"
        what = f"edge {owner + 1}" if owner < edges else f"pcurve {owner - edges + 1}"
    return [
        f"{far.sum()} of {len(far)} points on {kind} of the {_SIDE[found.side]} are off the "
        f"{_OTHER[found.side]}'s, the worst on {what} at {describe(spots.position[worst])}, by "
        f"{feet.distance[worst]:.3g}"
    ]


def not_decided(found: Found, tolerance: float) -> list[str]:
    """Messages for points found nowhere near enough, without a proof that none is."""
    feet, spots = found.feet, found.spots
    open_ = np.flatnonzero((feet.distance > tolerance) & (feet.least < tolerance))
    if not len(open_):
        return []
    worst = open_[np.argmax(feet.distance[open_])]
    return [
        f"{len(open_)} of {len(feet.distance)} points of the {_SIDE[found.side]} are not decided "
        f"within the effort allowed: the one at {describe(spots.position[worst])} is between "
        f"{feet.least[worst]:.3g} and {feet.distance[worst]:.3g} away"
    ]


def off_outline(found: Found, which: Ints, away: Floats, limit: float, names: Names) -> list[str]:
    """Messages for spots (``which``) whose feet lie outside the outline, by distances ``away``."""
    if not np.any(away > limit):
        return []
    worst = which[np.argmax(away)]
    what = face_name(int(found.spots.owner[worst]), names)
    return [
        f"{(away > limit).sum()} points on faces of the {_SIDE[found.side]} lie outside the "
        f"outlines of the {_OTHER[found.side]}'s, the worst on {what} at "
        f"{describe(found.spots.position[worst])}, {away.max():.3g} from them"
    ]


def loose_pcurves(excess: Floats, coedge: Ints, place: Floats, tolerance: float) -> list[str]:
    """Messages for pcurves that leave their edges: by how much (n,) more than in the part."""
    beyond = excess > 2 * tolerance
    if not beyond.any():
        return []
    worst = int(np.argmax(excess))
    return [
        f"{len(np.unique(coedge[beyond]))} pcurves leave the curves of their edges, the worst, "
        f"pcurve {coedge[worst] + 1}, at {describe(place[worst])} by {excess[worst]:.3g} more than "
        f"in the part"
    ]


def turned_faces(face: Ints, vote: Floats, count: int, names: Names) -> list[str]:
    """Messages for faces whose normals, by votes at spots (n,), look to the wrong side."""
    turned = np.flatnonzero(sums(face, vote, count) < 0)
    if not len(turned):
        return []
    return [
        f"{len(turned)} faces look to the other side than in the deformed part, the first "
        f"{face_name(int(turned[0]), names)}"
    ]


def wrong_volume(
    volume: float, expected: float, error: float, area: float, tolerance: float, closed: bool
) -> tuple[list[str], list[str]]:
    """Messages if the volume is not that of the deformed part, and if ``error`` leaves that open.

    Parameters
    ----------
    volume, expected, error : float, cubed model length
        Of the file, of the deformed part, of both together.
    area : float, squared model length
        A displacement of all of it by the tolerance is allowed.
    """
    allowed = max(VOLUME * abs(expected), tolerance * area)
    what = "volume" if closed else "flux through the open shells"
    found = f"the file's {what} is {volume:.12g}, the deformed part's {expected:.12g}"
    if abs(volume - expected) > allowed + error:
        return [found], []
    if abs(volume - expected) > allowed:
        return [], [f"{found}, known within {error:.3g} only"]
    return [], []


def _proved(feet: Feet, tolerance: float) -> Bools:
    proved: Bools = (feet.distance > tolerance) & (feet.least >= tolerance)
    return proved
