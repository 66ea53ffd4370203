"""Find the facets (flat faces) of a checked mesh: the bridge from ffdcli.mesh to ffdcli.surface."""

from __future__ import annotations

from collections.abc import Collection
from typing import Literal

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.mesh import CheckedMesh
from ffdcli.mesh.charts import find_charts
from ffdcli.surface.coplanar import Coplanar
from ffdcli.surface.facets import Facets, Patches
from ffdcli.surface.needles import fold_width
from ffdcli.surface.overlaps import overlapping_polygons
from ffdcli.surface.plane_graphs import fit_graphs, plane_deviation
from ffdcli.surface.planes import divide, find_planes, join_parallel
from ffdcli.surface.tolerance import Tolerances, kernel_tolerance
from ffdcli.volume.protocol import Volume

Kept = Literal["names", "texture"]


def find_facets(
    checked: CheckedMesh,
    volumes: tuple[Volume, ...],
    patches: Patches,
    keep: Collection[Kept],
    coplanar: Coplanar,
) -> tuple[Facets, Floats]:
    """Find the planes of coplanar polygons, and each plane as a graph over its dominant axis.

    Polygons of different materials are never in one facet.

    Parameters
    ----------
    checked : CheckedMesh
    volumes : tuple of Volume
    patches : {"merged", "bezier", "paper"}
        Unless `merged`, parallel planes that coincide are one, connected or not.
    coplanar : Coplanar
    keep : collection of {"names", "texture"}
        Keep polygons apart that have different names, or different maps into the texture.

    Returns
    -------
    Facets
    (V, n, 3) float64
        The mesh's vertices in the frames of the n volumes.
    """
    mesh, corners, polygon = checked.mesh, checked.triangles, checked.polygon
    local = np.stack([volume.frame.to_local(mesh.vertices) for volume in volumes], axis=1)
    rest = local[:, 0]
    groups = find_planes(rest, corners, polygon, mesh.delta, coplanar)
    if patches != "merged":
        groups = join_parallel(rest, corners, groups, mesh.delta, coplanar)
    groups = divide(rest, corners, groups, overlapping_polygons(rest, corners, polygon, groups))
    if mesh.labels is not None:
        groups = divide(rest, corners, groups, mesh.labels.material[polygon])
        if "names" in keep:
            groups = divide(rest, corners, groups, mesh.labels.group[polygon])
            groups = divide(rest, corners, groups, mesh.labels.body[polygon])
    if mesh.uv is not None and "texture" in keep:
        charts = find_charts(mesh.vertices, corners, mesh.uv[checked.corner], groups.group)
        groups = divide(rest, corners, groups, charts)
    # A looser distance says what may share a plane, not that vertices are less accurate.
    loose = coplanar.within(mesh.delta) > mesh.delta
    epsilon = mesh.delta if loose else plane_deviation(groups, mesh.delta)
    tolerances = Tolerances(mesh.size, epsilon, kernel_tolerance(mesh.vertices))
    graphs = fit_graphs(local, corners, groups, volumes, epsilon)
    folds = max(
        fold_width(local[:, number], corners, groups.sides, groups.group, axes, mesh.delta)
        for number, axes in enumerate(graphs.axes)
    )
    return Facets(groups, graphs, volumes, tolerances, folds, patches), local
