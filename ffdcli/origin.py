"""Where the faces of a result come from: the checked mesh and its polygons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Ints
from ffdcli.brep.labels import label_faces
from ffdcli.labels import Labels
from ffdcli.mesh import CheckedMesh
from ffdcli.surface.coplanar import Coplanar
from ffdcli.surface.partition import Partition


@dataclass(frozen=True)
class Origin:
    """The checked mesh that a result was made from, and how its polygons became faces.

    Parameters
    ----------
    checked : CheckedMesh
    epsilon : float, model length
        Distance within which the run takes points as lying on a plane or a line.
    sub_polygons : int
        Pieces of the input polygons after cutting.
    face_polygon : (F,) int64
        A polygon of the mesh that is part of each face.
    flattened : bool
        Whether a coplanar distance was asked for that took polygons off their own planes.
    faces : Labels or None
        Names and materials of the faces.
    """

    checked: CheckedMesh
    epsilon: float
    sub_polygons: int
    face_polygon: Ints
    flattened: bool
    faces: Labels | None = None


def origin_of(checked: CheckedMesh, parts: Partition, coplanar: Coplanar) -> Origin:
    """What the faces of a partition come from."""
    polygon = checked.polygon[parts.pieces.triangle]
    face_polygon = np.zeros(len(parts.patch), dtype=np.int64)
    face_polygon[parts.region] = polygon
    pieces = np.unique(np.column_stack([polygon, parts.region]), axis=0)
    labels = checked.mesh.labels and label_faces(checked.mesh.labels, polygon, parts.region)
    epsilon = parts.facets.tolerances.epsilon
    delta, off = checked.mesh.delta, parts.facets.groups.deviation.max(initial=0.0)
    flattened = coplanar.within(delta) > delta and bool(off > delta)
    return Origin(checked, epsilon, len(pieces), face_polygon, flattened, labels)
