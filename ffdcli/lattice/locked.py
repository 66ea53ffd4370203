"""Locked control points: find those that an edit displaces, and say why they are locked."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.lattice.border import Border


def restore_locked_points(
    net: Floats, rest: Floats, border: Border, box: Floats
) -> tuple[Bools, Floats]:
    """Locked points that a net displaces (nu, nv, nw), and the net with all of them at rest.

    Displacements up to 64 units in the last place of the box's coordinates count as rounding.
    """
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
