"""Sides of the box that the mesh crosses, and the control points that are locked at them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

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
        Number of layers locked at each of :data:`SIDES`.
    held : (6, nu, nv, nw) or (6, n) bool
        Control points locked at each side.
    shared : frozenset of str
        Sides that lie on the box of another lattice.
    """

    layers: tuple[int, ...]
    held: Bools
    shared: frozenset[str] = frozenset()

    @cached_property
    def locked(self) -> Bools:
        """(nu, nv, nw) or (n,) control points locked at any side."""
        return np.asarray(self.held.any(axis=0))

    @property
    def crossed(self) -> tuple[str, ...]:
        """Names of the sides that the mesh crosses or another box lies on."""
        return tuple(side for side, count in zip(SIDES, self.layers, strict=True) if count)

    def sides_of(self, index: tuple[int, ...]) -> tuple[str, ...]:
        """Names of the sides at which a control point is locked."""
        return tuple(side for side, held in zip(SIDES, self.held, strict=True) if held[index])


def lock_layers(
    spec: LatticeSpec, crossed: tuple[str, ...], shared: frozenset[str] = frozenset()
) -> Border:
    """Layers that are locked at crossed and shared sides for the continuity in the file."""
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
    """Control points of an octree that are locked at crossed and shared sides.

    All control points that move the side are locked. The deformation then joins the identity
    beyond the side with the continuity that it has inside. A function that vanishes at the side
    needs no lock.
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
    """Number of layers at rest that make the map the identity up to derivatives of order r.

    Clamped ends: derivatives up to order r at the side depend on the first r + 1 layers.
    Unclamped ends: k basis functions are positive on the side, so the value depends on k layers.
    Derivatives up to order k - 1 depend on the same layers, because the next function begins
    with the k-th power. In both cases k + 1 layers at rest make the outermost span the identity.
    """
    wanted = _ORDERS[spec.continuity(side)] + 1
    layers = wanted if spec.ends == "clamped" else max(wanted, spec.degree[axis])
    return min(layers, spec.degree[axis] + 1)


def crossed_sides(triangles: Floats, box: Floats, delta: float) -> tuple[str, ...]:
    """Sides of the box that the mesh crosses, where a free side would tear it.

    A triangle crosses a side if it extends beyond the plane of the side by more than ``delta``
    and comes within ``delta`` of the side itself. Triangles (T, 3, 3) and box (2, 3) are in the
    lattice frame; the sides are some of :data:`SIDES`.
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
    """(T,) True for triangles (T, 3, 3) that touch a box (2, 3) enlarged by ``slack``.

    See :func:`ffdcli.volume.convex_overlap.touches_boxes`.
    """
    normals, edges = triangle_directions(triangles)
    return touches_boxes(triangles, normals, edges, box[:1] - slack, box[1:] + slack)


def restore_locked_points(
    net: Floats, rest: Floats, border: Border, box: Floats
) -> tuple[Bools, Floats]:
    """Locked points that a net displaces (nu, nv, nw), and the net with all of them at rest.

    Displacements up to 64 units in the last place of the box's coordinates count as rounding.
    """
    if not border.locked.any():
        return border.locked, net
    rounding = 64 * np.finfo(np.float64).eps * float(np.abs(box).max())
    displaced = border.locked & (np.abs(net - rest).max(axis=-1) > rounding)
    return displaced, np.where(border.locked[..., None], rest, net)


def restore_locked_weights(weights: Floats, rest: Floats, border: Border) -> tuple[Bools, Floats]:
    """Locked points whose weight is not that at rest, and the weights with all of them at rest.

    Changes up to 64 units in the last place count as rounding.
    """
    changed = border.locked & (np.abs(weights - rest) > 64 * np.finfo(np.float64).eps * rest)
    return changed, np.where(border.locked, rest, weights)


def describe_locked(displaced: Bools, border: Border) -> str:
    """Name the locked control points that are displaced, and the sides that lock them."""
    places = np.argwhere(displaced)
    first: tuple[int, ...] = tuple(places[0].tolist())
    named = ", ".join(str(place) for place in places[:3].tolist())
    if len(places) == 1:
        what = f"control point {named}, which is locked"
    else:
        more = f" and {len(places) - 3} more" if len(places) > 3 else ""
        what = f"control points {named}{more}, which are locked"
    if border.locked.all():
        return f"{what} like all others: {why_locked(border, border.crossed)}"
    return f"{what}: {why_locked(border, border.sides_of(first))}"


def why_locked(border: Border, sides: tuple[str, ...]) -> str:
    """Say why control points are locked at these sides."""
    crossed = [side for side in sides if side not in border.shared]
    reasons = [
        f"{what} its {'sides' if len(these) > 1 else 'side'} {', '.join(these)}"
        for what, these in (
            ("the mesh reaches out of the lattice box at", crossed),
            ("another lattice box lies on", sorted(border.shared.intersection(sides))),
        )
        if these
    ]
    return " and ".join(reasons)
