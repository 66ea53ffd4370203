"""Where the mesh reaches out of the lattice box, and the control points that must stay there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.file.spec import LatticeSpec
from ffdcli.volume.convex_overlap import touches_boxes, triangle_directions
from ffdcli.volume.protocol import LatticeMap

SIDES = ("u_min", "u_max", "v_min", "v_max", "w_min", "w_max")

_ORDERS = {"c0": 0, "c1": 1, "c2": 2}


@dataclass(frozen=True)
class Border:
    """Locked layers of control points.

    Parameters
    ----------
    layers : (6,) tuple of int
        Layers locked at each of :data:`SIDES`; 0 where the mesh does not cross it.
    held : (6, nu, nv, nw) or (6, n) bool
        Control points locked by each side.
    shared : frozenset of str
        Those of the sides that lie on another lattice's box.
    """

    layers: tuple[int, ...]
    held: Bools
    shared: frozenset[str] = frozenset()

    @property
    def locked(self) -> Bools:
        """(nu, nv, nw) or (n,) control points locked by any side."""
        return np.asarray(self.held.any(axis=0))

    @property
    def crossed(self) -> tuple[str, ...]:
        """Names of the sides that the mesh crosses, or that another lattice's box lies on."""
        return tuple(side for side, count in zip(SIDES, self.layers, strict=True) if count)

    def sides_of(self, index: tuple[int, ...]) -> tuple[str, ...]:
        """The crossed sides that lock a control point."""
        return tuple(side for side, held in zip(SIDES, self.held, strict=True) if held[index])


def lock_layers(
    spec: LatticeSpec, crossed: tuple[str, ...], shared: frozenset[str] = frozenset()
) -> Border:
    """The layers to lock at crossed and shared sides for the continuity that the file asks for."""
    crossed = (*crossed, *shared)
    layers = tuple(
        _layer_count(spec, side, SIDES.index(side) // 2) if side in crossed else 0 for side in SIDES
    )
    held = np.zeros((6, *spec.counts), dtype=bool)
    for number, count in enumerate(layers):
        if count:
            axis, high = divmod(number, 2)
            part = slice(-count, None) if high else slice(0, count)
            held[(number, *(slice(None),) * axis, part)] = True
    return Border(layers, held, shared)


def lock_octree(
    volume: LatticeMap, crossed: tuple[str, ...], shared: frozenset[str] = frozenset()
) -> Border:
    """The control points of an octree to lock at crossed and shared sides.

    Those are all that move the side; the deformation then joins the identity beyond it with the
    continuity it has inside. What fades out before the box ends needs no lock.
    """
    low, high = volume.supports()
    held = np.zeros((6, len(low)), dtype=bool)
    layers = [0] * 6
    for side in (*crossed, *shared):
        number = SIDES.index(side)
        axis, upper = divmod(number, 2)
        bound = volume.box[upper, axis]
        held[number] = high[:, axis] > bound if upper else low[:, axis] < bound
        layers[number] = int(held[number].any())
    return Border(tuple(layers), held, shared)


def _layer_count(spec: LatticeSpec, side: str, axis: int) -> int:
    """Layers that must rest for the map to agree with the identity up to order r at a side.

    Clamped ends: derivatives up to order r there depend on the first r + 1 layers alone.
    Unclamped ends: k basis functions are positive on the side, so even the value is right only
    with k layers at rest; the first k - 1 derivatives then are too, since the next function
    starts with the k-th power. Either way k + 1 layers at rest make the outermost span the
    identity, which serves any order.
    """
    wanted = _ORDERS[spec.continuity(side)] + 1
    layers = wanted if spec.ends == "clamped" else max(wanted, spec.degree[axis])
    return min(layers, spec.degree[axis] + 1)


def crossed_sides(triangles: Floats, box: Floats, delta: float) -> tuple[str, ...]:
    """Sides of the box across which a mesh would tear, were they free to move.

    That is where a triangle reaches beyond the side's plane by more than ``delta`` and touches
    the side itself, from whichever direction: within ``delta`` of the rectangle.

    Parameters
    ----------
    triangles : (T, 3, 3) float64, lattice frame
    box : (2, 3) float64, lattice frame
    delta : float

    Returns
    -------
    tuple of str
        Some of :data:`SIDES`.
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    near_box = np.all((low <= box[1] + delta) & (high >= box[0] - delta), axis=1)
    crossed = []
    for number, side in enumerate(SIDES):
        axis, upper = divmod(number, 2)
        plane = box[upper, axis]
        beyond = high[:, axis] > plane + delta if upper else low[:, axis] < plane - delta
        reaches = (low[:, axis] <= plane + delta) & (high[:, axis] >= plane - delta)
        candidates = np.flatnonzero(beyond & reaches & near_box)
        rectangle = box.copy()
        rectangle[:, axis] = plane
        if bool(touches_box(triangles[candidates], rectangle, delta).any()):
            crossed.append(side)
    return tuple(crossed)


def touches_box(triangles: Floats, box: Floats, slack: float) -> Bools:
    """Which triangles (T, 3, 3) touch a box (2, 3) made larger by ``slack`` all round.

    See :func:`ffdcli.volume.convex_overlap.touches_boxes`.
    """
    normals, edges = triangle_directions(triangles)
    return touches_boxes(triangles, normals, edges, box[:1] - slack, box[1:] + slack)
