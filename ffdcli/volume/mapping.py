"""The deformation as a map of model points: what everything beside the surfaces is measured by."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence

import numpy as np

from ffdcli.arrays import Floats, Ints
from ffdcli.volume.protocol import Volume

# (n, 3) -> (n, 3), or (n, 3, 3) for derivatives; both in model coordinates.
Map = Callable[[Floats], Floats]

# How far beyond the lower and upper sides (2, 3) of each box points count as lying on it; a number
# is for all sides.
Slack = float | Sequence[Floats]

# Points are on the lattice box within this many delta of the mesh.
_SLACK = 16.0


def side_slack(crossed: Sequence[Collection[str]], delta: float) -> list[Floats]:
    """What a mesh's noise may carry points of it out of lattice boxes.

    Nothing at sides that the mesh crosses: there it goes on, and stays as it is.

    Parameters
    ----------
    crossed : sequence of collections of str
        Of each volume the sides that the mesh crosses, such as ``u_min``.
    delta : float, model length
        The mesh's.
    """
    sides = [[f"{axis}_{end}" for axis in "uvw"] for end in ("min", "max")]
    return [np.where(np.isin(sides, list(names)), 0.0, _SLACK * delta) for names in crossed]


def deformation(volumes: Sequence[Volume], slack: Slack) -> Map:
    """Direct evaluation, point by point, in model coordinates.

    Points on a box are inside, and the mesh's own points lie there; a rounding must not carry
    them out. So a point no further beyond its sides than ``slack`` gets the deformation at the
    nearest point of the box, continued by its derivative. Points near none stay.
    """

    def deform(points: Floats) -> Floats:
        out = np.array(points, dtype=np.float64)
        for volume, mine, local, beyond in _by_box(volumes, points, slack):
            images = volume.evaluate(local)
            off = np.flatnonzero(beyond.any(axis=1))
            slopes = volume.jacobian(local[off])
            images[off] += np.einsum("nij,nj->ni", slopes, beyond[off])
            out[mine] = volume.frame.to_model(images)
        return out

    return deform


def derivatives(volumes: Sequence[Volume], slack: Slack) -> Map:
    """Jacobians in model coordinates: the frame's axes turn both sides."""

    def jacobian(points: Floats) -> Floats:
        out = np.tile(np.eye(3), (len(points), 1, 1))
        for volume, mine, local, _ in _by_box(volumes, points, slack):
            slopes, frame = volume.jacobian(local), volume.frame
            out[mine] = slopes if frame.aligned else frame.axes.T @ slopes @ frame.axes
        return out

    return jacobian


def count_pieces(volumes: Sequence[Volume], points: Floats) -> Ints:
    """(m,) at most how many polynomial pieces of the map segments in each hull may cross.

    Parameters
    ----------
    points : (m, n, 3) float64, model length
        Corners of each hull.
    """
    pieces = np.ones(len(points), dtype=np.int64)
    for volume in volumes:
        local = volume.frame.to_local(points)
        low, high = local.min(axis=1), local.max(axis=1)
        for axis in range(3):
            inner = volume.knot_planes(axis, volume.box[None]).values[0]
            planes = np.unique(np.concatenate([inner, volume.box[:, axis]]))
            first = np.searchsorted(planes, low[:, axis], side="right")
            pieces += np.maximum(0, np.searchsorted(planes, high[:, axis], side="left") - first)
    return pieces


def _by_box(
    volumes: Sequence[Volume], points: Floats, slack: Slack
) -> Iterator[tuple[Volume, Ints, Floats, Floats]]:
    """Each volume with the points (m, 3) no further beyond its box than ``slack``.

    Yields the volume, which points, the nearest points of the box, and what the points lie beyond
    these, both in its frame.
    Where boxes touch a point belongs to the first; there both leave it where it is.
    """
    free = np.ones(len(points), dtype=bool)
    beside = [np.full((2, 3), slack)] * len(volumes) if isinstance(slack, float) else slack
    for volume, (below, above) in zip(volumes, beside, strict=True):
        local = volume.frame.to_local(points)
        nearest = np.clip(local, volume.box[0], volume.box[1])
        beyond = local - nearest
        mine = np.flatnonzero(free & ((beyond >= -below) & (beyond <= above)).all(axis=1))
        free[mine] = False
        yield volume, mine, nearest[mine], beyond[mine]
