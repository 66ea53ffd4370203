"""What pairs of a fit say of themselves: contradictions, and directions that they leave open."""

from __future__ import annotations

import numpy as np

from ffdcli.arrays import Floats, Ints, run_starts
from ffdcli.lattice.fit.affine import nearest_affine

_SHAPES = {1: "in one point", 2: "on a line", 3: "in a plane"}


def notes_on(places: Floats, wanted: Floats, numbers: Ints, tolerance: float) -> tuple[str, ...]:
    """Sentences on pairs.

    Parameters
    ----------
    places, wanted : (m, 3) float64
    numbers : (m,) int64
        Their numbers, from 0.
    tolerance : float
        Distance of two targets from which on they contradict each other.
    """
    found = []
    clash = _worst_clash(places, wanted)
    if clash is not None and clash[2] > tolerance:
        first, second, apart = clash
        text = f"pairs {numbers[first] + 1} and {numbers[second] + 1} give one point two targets, "
        found.append(f"{text}{apart:.3g} apart: the fit comes between them")
    rank = nearest_affine(places, wanted, np.ones(len(places))).rank
    if rank < 4:
        many = "all pairs lie" if len(places) > 1 else "the only pair lies"
        text = f"{many} {_SHAPES[rank]}: away from there the field goes on as smoothly as it can"
        found.append(text)
    return tuple(found)


def _worst_clash(places: Floats, wanted: Floats) -> tuple[int, int, float] | None:
    """Two pairs of one place whose targets are furthest apart, and by how much."""
    order = np.lexsort(places.T)
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = np.any(places[order[1:]] != places[order[:-1]], axis=1)
    if fresh.all():
        return None
    starts = run_starts(np.diff(np.append(np.flatnonzero(fresh), len(order))))[:-1]
    group = np.cumsum(fresh) - 1
    # The first of each place against the others: the two furthest apart may be others.
    apart = np.linalg.norm(wanted[order] - wanted[order[starts[group]]], axis=1)
    worst = int(np.argmax(apart))
    return int(order[starts[group[worst]]]), int(order[worst]), float(apart[worst])
