"""Where rays meet the drawn model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.editor.drawn import Drawn
from ffdcli.lattice.box_lattice import BoxLattice


@dataclass(frozen=True, eq=False)
class Hit:
    """A point of the drawn model.

    Parameters
    ----------
    point, rest : (3,) float64, model length
        As it is drawn, and of the undeformed model.
    triangle : int
    """

    point: Floats
    rest: Floats
    triangle: int


def first_hit(drawn: Drawn, vertices: Floats, origin: Any, direction: Any) -> Hit | None:
    """The first point that a ray meets of triangles with vertices (V, 3); None for none.

    Moeller and Trumbore 1997, all triangles at once.
    """
    start, way = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
    corners = vertices[drawn.triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(way, second)
    scale = np.einsum("ij,ij->i", first, across)
    arm = start - corners[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", arm, across) / scale
        turned = np.cross(arm, first)
        v = turned @ way / scale
        along = np.einsum("ij,ij->i", second, turned) / scale
        inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (along > 0)
    if not inside.any():
        return None
    triangle = int(np.argmin(np.where(inside, along, np.inf)))
    shares = np.array([1 - u[triangle] - v[triangle], u[triangle], v[triangle]])
    corner = drawn.triangles[triangle]
    return Hit(
        point_of_triangle(vertices, corner, shares),
        point_of_triangle(drawn.rest, corner, shares),
        triangle,
    )


def point_of_triangle(vertices: Floats, corner: Ints, shares: Any) -> Floats:
    """(3,) point of a triangle by its shares (3,) of the corners."""
    ends = vertices[corner]
    found = np.asarray(shares, dtype=np.float64) @ ends
    # Rounding must not carry it off a flat side, on which the lattice box may lie.
    return np.asarray(np.clip(found, ends.min(axis=0), ends.max(axis=0)))


def into_boxes(lattices: Sequence[BoxLattice], points: Floats, near: float) -> Floats:
    """Points (m, 3), those outside all lattice boxes but this near to one put onto its side."""
    out, free = points.copy(), lattice_of(lattices, points) < 0
    for member in lattices:
        frame, box = member.map.frame, member.map.box
        local = frame.to_local(out[free])
        nearest = np.clip(local, box[0], box[1])
        close = np.abs(nearest - local).max(axis=1, initial=0.0) <= near
        # A little inside, where the way to model coordinates and back is rounded.
        inner = nearest if frame.aligned else nearest + (box.mean(axis=0) - nearest) * 1e-13
        rows = np.flatnonzero(free)[close]
        out[rows] = frame.to_model(inner[close])
        free[rows] = False
    return out


def lattice_of(lattices: Sequence[BoxLattice], points: Floats) -> Ints:
    """Number (m,) of the first lattice whose box holds each of the points (m, 3); -1 for none."""
    out = np.full(len(points), -1, dtype=np.int64)
    for number, member in reversed(list(enumerate(lattices))):
        out[member.map.contains(member.map.frame.to_local(points))] = number
    return out
