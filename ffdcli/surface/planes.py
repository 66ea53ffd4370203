"""Groups of coplanar, edge-connected triangles, and their planes.

Coplanar means near the plane of the *group*: comparing neighbours would drift round a cylinder.
Normals of needles are inaccurate, so angles are weighed by the altitudes of the triangles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints, distinct_rows
from ffdcli.corners import find_twins, number_sides
from ffdcli.graphs import connected_components
from ffdcli.surface.coplanar import DEFAULT, Coplanar
from ffdcli.surface.needles import beyond_sides, faces_away, is_needle, is_spike, triangle_areas

# Neighbours may be coplanar where noise of this many delta could explain the angle between them.
_ANGLE_SLACK = 4.0


@dataclass(frozen=True)
class PlaneGroups:
    """Planar groups of triangles.

    Parameters
    ----------
    group : (T,) int64
        Group of each triangle.
    normal : (G, 3) float64
        Unit normals.
    point : (G, 3) float64
        A point in each plane.
    deviation : (G,) float64, model length
        Largest distance between the vertices of a group and its plane.
    low, high : (G, 3) float64
        Bounding box of each group's vertices.
    sides : (T, 3) int64
        Number of the edge along each side of each triangle.
    """

    group: Ints
    normal: Floats
    point: Floats
    deviation: Floats
    low: Floats
    high: Floats
    sides: Ints


def find_planes(
    vertices: Floats,
    triangles: Ints,
    polygon: Ints,
    delta: float,
    coplanar: Coplanar = DEFAULT,
) -> PlaneGroups:
    """Group coplanar, edge-connected triangles.

    Parameters
    ----------
    vertices : (V, 3) float64
    triangles : (T, 3) int64
    polygon : (T,) int64
        Polygon of each triangle; the triangles of a polygon are always in one group.
    delta : float
        Noise of the mesh: normals count only as far as it allows, and vertices within it of a
        plane lie in that plane.
    coplanar : Coplanar
        Other limits.
    """
    limits = _Limits(coplanar.within(delta), coplanar.sine, delta)
    sides = number_sides(triangles, polygon, len(vertices))
    pairs = _neighbours(triangles, sides)
    forced = pairs[polygon[pairs[:, 0]] == polygon[pairs[:, 1]]]
    likely = _likely_links(vertices, triangles, pairs, limits)
    links = _Links(forced, np.concatenate([forced, likely]))
    groups = describe_planes(
        vertices, triangles, sides, connected_components(len(triangles), *links.all.T)
    )
    label = _confirm(vertices, triangles, groups, links, limits)
    return describe_planes(vertices, triangles, sides, label)


class _Links(NamedTuple):
    """Pairs of neighbours (m, 2): those within one polygon, and all that may be coplanar."""

    forced: Ints
    all: Ints


class _Limits(NamedTuple):
    """Distance of vertices from a plane, sine of the angle to it, noise of the vertices."""

    distance: float
    sine: float
    noise: float


def join_parallel(
    vertices: Floats,
    triangles: Ints,
    groups: PlaneGroups,
    delta: float,
    coplanar: Coplanar = DEFAULT,
) -> PlaneGroups:
    """Unite groups in one plane with one normal, connected or not.

    In the partition of Feng 2002 all coplanar polygons of a knot box share a patch.
    """
    size = float(np.linalg.norm(groups.high.max(axis=0) - groups.low.min(axis=0)))
    centre = (groups.high.max(axis=0) + groups.low.min(axis=0)) / 2
    offset = np.einsum("gi,gi->g", groups.normal, groups.point - centre)
    noise, distance = _ANGLE_SLACK * delta / size, coplanar.within(delta)
    reach = _ANGLE_SLACK * distance / size
    turned = min(reach, noise + coplanar.sine)
    features = np.column_stack([groups.normal / turned, offset / size / reach])
    # Only `paper` patches need it.
    from scipy.spatial import cKDTree

    near = cKDTree(features).query_pairs(1.0, output_type="ndarray")
    if not len(near):
        return groups
    family = connected_components(len(offset), *near.T)
    united = describe_planes(vertices, triangles, groups.sides, family[groups.group])
    # Families that do not fit one plane are divided again.
    divided = (united.deviation > distance)[family]
    family = np.where(divided, family.max() + 1 + np.arange(len(family)), family)
    family = np.unique(family, return_inverse=True)[1].astype(np.int64)
    return describe_planes(vertices, triangles, groups.sides, family[groups.group])


def divide(vertices: Floats, triangles: Ints, groups: PlaneGroups, label: Ints) -> PlaneGroups:
    """Divide groups where the labels (T,) of their triangles differ; the parts keep the plane.

    Labels are those a face has one of: a material, a group, a body, a texture chart.
    """
    pairs, part = distinct_rows(np.column_stack([groups.group, label]))
    if len(pairs) == len(groups.normal):
        return groups
    source = pairs[:, 0]
    divided = describe_planes(vertices, triangles, groups.sides, part)
    return replace(
        divided,
        normal=groups.normal[source],
        point=groups.point[source],
        deviation=groups.deviation[source],
    )


def _neighbours(triangles: Ints, sides: Ints) -> Ints:
    """(m, 2) triangles on both sides of each edge that has two."""
    twins = find_twins(sides.ravel(), triangles.ravel())
    corner = np.flatnonzero(twins > np.arange(len(twins)))
    return np.column_stack([corner // 3, twins[corner] // 3])


def _likely_links(vertices: Floats, triangles: Ints, pairs: Ints, limits: _Limits) -> Ints:
    """Neighbours (m, 2) at an angle that their limits allow, and noise of a few delta."""
    area = triangle_areas(vertices, triangles)
    length = np.linalg.norm(area, axis=1)
    sides = vertices[np.roll(triangles, -1, axis=1)] - vertices[triangles]
    longest = np.sqrt((sides**2).sum(axis=2).max(axis=1))
    i, j = pairs.T
    # The slack over both altitudes, 2 length / longest, times both lengths, which may be 0.
    slack = _ANGLE_SLACK / 2 * (longest[i] * length[j] + longest[j] * length[i])
    allowed = slack * limits.distance
    if limits.sine < 1:
        twice = 2 * limits.sine * length[i] * length[j]
        allowed = np.minimum(allowed, slack * limits.noise + twice)
    sine = np.linalg.norm(np.cross(area[i], area[j]), axis=1)
    facing = (np.einsum("ij,ij->i", area[i], area[j]) > 0) | (allowed >= length[i] * length[j])
    return pairs[facing & (sine <= allowed)]


def describe_planes(vertices: Floats, triangles: Ints, sides: Ints, label: Ints) -> PlaneGroups:
    """Planes of groups: normals by vector area, offsets at the middle of the residuals.

    Parameters
    ----------
    vertices : (V, 3) float64
        In the frame of the planes.
    triangles, sides : (T, 3) int64
    label : (T,) int64
        Group of each triangle, from 0.
    """
    count = int(label.max(initial=-1)) + 1
    area = triangle_areas(vertices, triangles)
    total = np.zeros((count, 3))
    np.add.at(total, label, area)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    normal = total / np.where(length > 0, length, 1.0)

    owner = np.repeat(label, 3)
    order = np.argsort(owner, kind="stable")
    points = vertices[triangles.ravel()][order]
    owner = owner[order]
    first = np.searchsorted(owner, np.arange(count))
    low = np.minimum.reduceat(points, first, axis=0)
    high = np.maximum.reduceat(points, first, axis=0)
    anchor = points[first]
    distance = np.einsum("ij,ij->i", points - anchor[owner], normal[owner])
    nearest = np.minimum.reduceat(distance, first)
    furthest = np.maximum.reduceat(distance, first)
    middle = (nearest + furthest) / 2
    return PlaneGroups(
        group=label,
        normal=normal,
        point=anchor + middle[:, None] * normal,
        deviation=(furthest - nearest) / 2,
        low=low,
        high=high,
        sides=sides,
    )


def _confirm(
    vertices: Floats, triangles: Ints, groups: PlaneGroups, links: _Links, limits: _Limits
) -> Ints:
    """(T,) group of each triangle, after dividing the groups that do not fit one plane."""
    label = groups.group
    area, normal = triangle_areas(vertices, triangles), groups.normal[label]
    facing = np.einsum("ij,ij->i", area, normal)
    bad = groups.deviation > limits.distance
    # The normal of a sheet thinner than the distance is 0, as its sides cancel; so is `facing`.
    needle = is_needle(vertices, triangles, limits.noise)
    bad[label[(facing <= 0) & ~needle]] = True
    # The outline of a polygon is its own, whatever triangles it is divided into.
    needle[links.forced.ravel()] = False
    beyond = beyond_sides(vertices, triangles, groups.sides)
    spike = is_spike((beyond >= 0) & (label[beyond] == label[:, None]))
    bad[label[needle & spike & faces_away(area, normal)]] = True
    bad[label[_is_steep(vertices[triangles], area, normal, limits)]] = True
    members = np.flatnonzero(bad[label])
    if not len(members):
        return label
    grown = _grow(vertices, triangles, members, beyond, links, limits)
    merged = label.copy()
    merged[members] = label.max() + 1 + grown
    return np.unique(merged, return_inverse=True)[1].astype(np.int64)


def _is_steep(corners: Floats, area: Floats, normal: Floats, limits: _Limits) -> Bools:
    """(m,) True for triangles (m, 3, 3) at a larger angle to planes than the limits allow."""
    if limits.sine == 1:
        return np.zeros(len(area), dtype=bool)
    sides = np.roll(corners, -1, axis=1) - corners
    longest = np.sqrt((sides**2).sum(axis=2).max(axis=1))
    noise = _ANGLE_SLACK / 2 * limits.noise * longest
    turned = np.linalg.norm(np.cross(area, normal), axis=1)
    return np.asarray(turned > limits.sine * np.linalg.norm(area, axis=1) + noise)


def _grow(
    vertices: Floats,
    triangles: Ints,
    members: Ints,
    beyond: Ints,
    links: _Links,
    limits: _Limits,
) -> Ints:
    """(m,) regions of triangles, grown from the largest down against the plane of each region.

    Needles that face away from the plane do not join as spikes.

    This visits triangles one by one, but only those of groups that are almost planar. The plane is
    fitted again each time the region has doubled.
    """
    local = np.full(len(triangles), -1, dtype=np.int64)
    local[members] = np.arange(len(members))
    unit = connected_components(len(triangles), *links.forced.T)[members]
    inside = (local[links.all] >= 0).all(axis=1)
    neighbours: list[list[int]] = [[] for _ in members]
    for i, j in local[links.all[inside]].tolist():
        neighbours[i].append(j)
        neighbours[j].append(i)
    corners = vertices[triangles[members]]
    area = triangle_areas(vertices, triangles[members])
    needle = is_needle(vertices, triangles[members], limits.noise)
    beside = np.where(beyond[members] >= 0, local[beyond[members]], -1)
    together: dict[int, list[int]] = {}
    for i, u in enumerate(unit.tolist()):
        together.setdefault(u, []).append(i)

    label = np.full(len(members), -1, dtype=np.int64)
    region = 0
    for seed in np.argsort(-np.linalg.norm(area, axis=1), kind="stable").tolist():
        if label[seed] >= 0:
            continue
        taken = list(together[int(unit[seed])])
        label[taken] = region
        normal, point = _fit(corners[taken], area[taken])
        fitted = len(taken)
        queue = list(taken)
        while queue:
            for j in neighbours[queue.pop()]:
                if label[j] >= 0:
                    continue
                candidate = together[int(unit[j])]
                distance = np.abs((corners[candidate] - point) @ normal).max()
                turned = (area[candidate] @ normal < 0) & ~needle[candidate]
                if len(candidate) == 1 and needle[j]:
                    shared = (beside[candidate] >= 0) & (label[beside[candidate]] == region)
                    turned |= is_spike(shared) & faces_away(area[candidate], normal)
                if distance > limits.distance or turned.any():
                    continue
                if _is_steep(corners[candidate], area[candidate], normal, limits).any():
                    continue
                label[candidate] = region
                taken += candidate
                queue += candidate
            if len(taken) >= 2 * fitted:
                trial = _fit(corners[taken], area[taken])
                off = np.abs((corners[taken] - trial[1]) @ trial[0]).max()
                steep = _is_steep(corners[taken], area[taken], trial[0], limits).any()
                if off <= limits.distance and not steep:
                    normal, point = trial
                fitted = len(taken)
        region += 1
    return label


def _fit(corners: Floats, area: Floats) -> tuple[Floats, Floats]:
    """Unit normal and a point of the plane of triangles (m, 3, 3) with vector areas (m, 3)."""
    normal = area.sum(axis=0)
    normal = normal / max(float(np.linalg.norm(normal)), np.finfo(float).tiny)
    distance = (corners - corners[0, 0]) @ normal
    return normal, corners[0, 0] + normal * (distance.min() + distance.max()) / 2
