"""Planes as graphs over their dominant axes: ``u_a = a0 + beta (u_b - b0) + gamma (u_c - c0)``.

A deformed plane is then a tensor-product surface in ``(u_b, u_c)`` of bi-degree
``(k_b + [beta != 0] k_a) x (k_c + [gamma != 0] k_a)``. That is lower than in Table 1 of Feng 2002
for planes in general position, and equal for planes parallel to an axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.surface.needles import DOMINANCE
from ffdcli.surface.planes import PlaneGroups, describe_planes
from ffdcli.volume.protocol import Volume


@dataclass(frozen=True)
class PlaneGraphs:
    """Planes as graphs, each in the frame of a volume.

    Parameters
    ----------
    axes : (..., 3) int64
        The axes ``a, b, c``; ``(e_b, e_c, sign e_a)`` is right-handed with the outward normal on
        the side of ``sign e_a``.
    anchor : (..., 3) float64
        The point ``(a0, b0, c0)``, in the order of ``axes``.
    slopes : (..., 2) float64
        ``beta`` and ``gamma``; exactly 0 where the plane is parallel to that axis within epsilon.
    deviation : (...) float64, model length
        Largest distance along ``a`` between the vertices in the plane and the graph.
    low, high : (..., 3) float64
        Bounding box of these vertices.
    """

    axes: Ints
    anchor: Floats
    slopes: Floats
    deviation: Floats
    low: Floats
    high: Floats

    def take(self, index: Ints | tuple[Ints, Ints]) -> PlaneGraphs:
        """The graphs at an index of the leading axes."""
        return PlaneGraphs(*(getattr(self, field.name)[index] for field in fields(self)))

    def height(self, which: Ints, b: Floats, c: Floats) -> Floats:
        """Coordinate ``u_a`` of graphs ``which`` (m,) at ``(b, c)``, both (m, ...)."""
        shape = (len(which),) + (1,) * (np.ndim(b) - 1)
        a0, b0, c0 = (self.anchor[which, i].reshape(shape) for i in range(3))
        beta, gamma = (self.slopes[which, i].reshape(shape) for i in range(2))
        return np.asarray(a0 + beta * (b - b0) + gamma * (c - c0))

    @property
    def sloping(self) -> Bools:
        """(..., 2) True where beta, gamma differ from 0."""
        return self.slopes != 0


def plane_deviation(groups: PlaneGroups, delta: float) -> float:
    """The tolerance epsilon: the larger of delta and the deviation of any vertex from its plane."""
    return max(delta, float(groups.deviation.max(initial=0.0)))


def fit_graphs(
    vertices: Floats,
    triangles: Ints,
    groups: PlaneGroups,
    volumes: Sequence[Volume],
    epsilon: float,
) -> PlaneGraphs:
    """Choose the dominant axis of each of G groups and fit its graph, in the frames of n volumes.

    Among the axes with ``|n_a| >= max |n| / 2``, the axis that needs the fewest cuts is chosen,
    then the one with the fewest control points, then the lowest.

    Parameters
    ----------
    vertices : (V, n, 3) float64
        Coordinates in the frames of the volumes.
    triangles : (T, 3) int64
    groups : PlaneGroups
        In the frame of the first volume.
    volumes : sequence of Volume
    epsilon : float
        A slope that lifts the plane by no more than this over the group counts as 0.

    Returns
    -------
    PlaneGraphs
        With leading axes (n, G).
    """
    found = []
    for number, volume in enumerate(volumes):
        local = vertices[:, number]
        seen = describe_planes(local, triangles, groups.sides, groups.group) if number else groups
        found.append(_fit_in_frame(local, triangles, seen, volume, epsilon))
    columns = [[getattr(graphs, field.name) for graphs in found] for field in fields(PlaneGraphs)]
    return PlaneGraphs(*map(np.stack, columns))


def _fit_in_frame(
    vertices: Floats, triangles: Ints, groups: PlaneGroups, volume: Volume, epsilon: float
) -> PlaneGraphs:
    """PlaneGraphs (G,) of all groups, each over its best axis of one frame."""
    corner_group = np.repeat(groups.group, 3)
    points = vertices[triangles.ravel()]
    best: PlaneGraphs | None = None
    best_cost = np.full((len(groups.normal), 2), np.inf)
    size = np.abs(groups.normal)
    for axis in range(3):
        trial = _fit_over(axis, points, corner_group, groups, epsilon)
        cuts, poles = _cost(trial, axis, groups, volume, epsilon)
        allowed = size[:, axis] >= DOMINANCE * size.max(axis=1)
        cost = np.where(allowed[:, None], np.column_stack([cuts, poles]), np.inf)
        better = (cost[:, 0] < best_cost[:, 0]) | (
            (cost[:, 0] == best_cost[:, 0]) & (cost[:, 1] < best_cost[:, 1])
        )
        best = trial if best is None else _choose(better, trial, best)
        best_cost = np.where(better[:, None], cost, best_cost)
    assert best is not None
    return best


def _choose(mask: Bools, new: PlaneGraphs, old: PlaneGraphs) -> PlaneGraphs:
    """The new graphs where the mask (G,) is set, the old ones elsewhere."""
    return PlaneGraphs(
        axes=np.where(mask[:, None], new.axes, old.axes),
        anchor=np.where(mask[:, None], new.anchor, old.anchor),
        slopes=np.where(mask[:, None], new.slopes, old.slopes),
        deviation=np.where(mask, new.deviation, old.deviation),
        low=new.low,
        high=new.high,
    )


def _fit_over(
    axis: int, points: Floats, owner: Ints, groups: PlaneGroups, epsilon: float
) -> PlaneGraphs:
    """Graphs of all groups over one axis; meaningless where the normal has no such component."""
    count = len(groups.normal)
    upward = groups.normal[:, axis] > 0
    b = np.where(upward, (axis + 1) % 3, (axis + 2) % 3)
    c = np.where(upward, (axis + 2) % 3, (axis + 1) % 3)
    rows = np.arange(count)
    extent = groups.high - groups.low
    centre = (groups.high + groups.low) / 2
    origin = np.column_stack([groups.point[:, axis], centre[rows, b], centre[rows, c]])
    height = points[:, axis] - origin[owner, 0]
    across = np.column_stack(
        [
            points[np.arange(len(points)), b[owner]] - origin[owner, 1],
            points[np.arange(len(points)), c[owner]] - origin[owner, 2],
        ]
    )
    usable = groups.normal[:, axis] != 0
    divisor = np.where(usable, groups.normal[:, axis], 1.0)
    slopes = np.column_stack([-groups.normal[rows, b] / divisor, -groups.normal[rows, c] / divisor])
    span = np.column_stack([extent[rows, b], extent[rows, c]])
    live = np.ones((count, 2), dtype=bool)
    # The normal of a needle leaves residuals; two least-squares corrections remove them. Then
    # slopes that are negligible over the whole group are dropped, and the others fitted again.
    slopes = _correct(slopes, live, height, across, owner)
    live = np.abs(slopes) * span > epsilon
    part = np.flatnonzero(~live.all(axis=1))
    if len(part):
        number = np.full(count, -1)
        number[part] = np.arange(len(part))
        held = number[owner] >= 0
        slopes[part] = _correct(
            np.where(live[part], slopes[part], 0.0), live[part], height[held], across[held],
            number[owner[held]],
        )  # fmt: skip
    residual = height - np.einsum("ij,ij->i", across, slopes[owner])
    lowest = np.full(count, np.inf)
    highest = np.full(count, -np.inf)
    np.minimum.at(lowest, owner, residual)
    np.maximum.at(highest, owner, residual)
    origin[:, 0] += (lowest + highest) / 2
    return PlaneGraphs(
        axes=np.column_stack([np.full(count, axis), b, c]),
        anchor=origin,
        slopes=slopes,
        deviation=(highest - lowest) / 2,
        low=groups.low,
        high=groups.high,
    )


def _correct(slopes: Floats, live: Bools, height: Floats, across: Floats, owner: Ints) -> Floats:
    """Slopes (G, 2) after two least-squares corrections of the live ones, for all groups at once.

    Parameters
    ----------
    slopes, live : (G, 2) float64, bool
    height, across : (N,), (N, 2) float64
        Coordinates of points along ``a`` and ``b, c``, relative to their group's anchor.
    owner : (N,) int64
        Group of each point.
    """
    count = len(slopes)
    mean = np.column_stack(
        [np.bincount(owner, weights=across[:, i], minlength=count) for i in range(2)]
    )
    members = np.bincount(owner, minlength=count)
    centred = (across - (mean / members[:, None])[owner]) * live[owner]
    gram = np.empty((count, 2, 2))
    for i in range(2):
        for j in range(2):
            gram[:, i, j] = np.bincount(
                owner, weights=centred[:, i] * centred[:, j], minlength=count
            )
    inverse = np.linalg.pinv(gram, rcond=1e-13, hermitian=True)
    for _ in range(2):
        residual = height - np.einsum("ij,ij->i", across, slopes[owner])
        residual = (
            residual - (np.bincount(owner, weights=residual, minlength=count) / members)[owner]
        )
        moment = np.column_stack(
            [
                np.bincount(owner, weights=centred[:, i] * residual, minlength=count)
                for i in range(2)
            ]
        )
        slopes = slopes + np.einsum("gij,gj->gi", inverse, moment)
    return np.where(live, slopes, 0.0)


def _cost(
    graphs: PlaneGraphs, axis: int, groups: PlaneGroups, volume: Volume, epsilon: float
) -> tuple[Floats, Floats]:
    """Numbers of cuts (G,) and of control points (G,) that a dominant axis leads to."""
    boxes = np.stack([groups.low, groups.high], axis=1)
    crossed = []
    for along in range(3):
        values = volume.knot_planes(along, boxes).values
        inside = (values > groups.low[:, along, None] + epsilon) & (
            values < groups.high[:, along, None] - epsilon
        )
        crossed.append(inside.sum(axis=1))
    breaks = np.stack(crossed, axis=1)
    rows = np.arange(len(breaks))
    both = graphs.sloping.all(axis=1)
    cuts = np.where(both, breaks[:, axis], 0)
    degrees = np.array(volume.degrees)
    poles = np.ones(len(breaks))
    for i in range(2):
        flat = graphs.axes[:, 1 + i]
        sloping = graphs.sloping[:, i]
        degree = degrees[flat] + sloping * degrees[axis]
        # Every break adds degree - continuity control points; all knots are taken as simple.
        added = breaks[rows, flat] * (degree - degrees[flat] + 1)
        image = np.where(sloping & ~both, breaks[:, axis] * (degree - degrees[axis] + 1), 0)
        poles = poles * (degree + 1 + added + image)
    return cuts.astype(np.float64), poles
