"""A polynomial volume near any smooth deformation, as near as asked for on a model's surface.

What the deformation moves places by is approximated by uniform B-splines on the dyadic grid of an
octree: first on its leaves, then, where that is not near enough, by corrections on cells half as
large, and so on. Each stage is a least-squares problem on points of the surface (inside solids on
few more, of little weight, so that the volume stays sensible there). How near the result is, is
measured on points that no stage has seen.

The result is linear in what the deformation moves places by, so that stages found once serve all
nets of control points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, vstack

from ffdcli.arrays import Floats, Ints
from ffdcli.fitting.least_squares import solve_least_squares
from ffdcli.fitting.levels import Cells, Functions, around, codes_of, functions_on
from ffdcli.fitting.spread import Surface
from ffdcli.volume.adaptive.hierarchical import volume_of_levels
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from ffdcli.volume.frame import Frame

DEGREE = 3
# Levels that corrections may go beyond the octree's leaves.
MORE_LEVELS = 5
# Points to fit, and to judge, for each face-sized piece of surface in a cell.
_FITTED, _JUDGED = 12.0, 24.0
# The largest distance found is taken to be this share of the largest there is.
FOUND = 0.75
# Share of the tolerance at which a cell is left as it is.
_TARGET = 0.6
# No more stages than this, nor functions in all of them.
_MOST_STAGES = 12
MOST_FUNCTIONS = 60_000
# What points that are not on the surface count by.
_INNER_WEIGHT = 0.03


@dataclass(frozen=True)
class Field:
    """A deformation to be fitted, on the unit cube that stands for the lattice box.

    Parameters
    ----------
    moves : (n, 3) -> (n, 3)
        What places of the surface are moved by, model length. Raises where it cannot tell.
    surface : Surface
        Of the model.
    inner : (m, 3) float64, (m, 3) float64
        Other places where moves are known, and those.
    """

    moves: Callable[[Floats], Floats]
    surface: Surface
    inner: tuple[Floats, Floats]


@dataclass(frozen=True)
class Stage:
    """What one stage added.

    Parameters
    ----------
    functions : Functions
    moves : (n, 3) float64
        Their coefficients.
    """

    functions: Functions
    moves: Floats


@dataclass(frozen=True)
class Fit:
    """A fitted deformation.

    Parameters
    ----------
    stages : tuple of Stage
    cells : tuple of Cells
        What each stage was made on.
    error : float, model length
        The largest distance found between it and the deformation.
    samples : int
        Points that this was measured on.
    """

    stages: tuple[Stage, ...]
    cells: tuple[Cells, ...]
    error: float
    samples: int

    @property
    def bound(self) -> float:
        """What the distance is stated to be within: a third more than was found."""
        return self.error / FOUND

    @property
    def levels(self) -> tuple[int, int]:
        """Coarsest and finest level of its functions."""
        used = [level for stage in self.stages for level in stage.functions.keys]
        return (min(used), max(used)) if used else (0, 0)

    def volume(self, box: Floats, frame: Frame) -> AdaptiveVolume:
        """The volume, in the lattice box (2, 3) that the unit cube stands for."""
        # Stages that share functions share them in the volume.
        keys: Cells = {}
        for stage in self.stages:
            for level, more in stage.functions.keys.items():
                keys[level] = np.union1d(keys.get(level, more), more)
        if not keys:
            keys = functions_on({0: np.zeros(1, dtype=np.int64)}, DEGREE).keys
        every = Functions(DEGREE, dict(sorted(keys.items())))
        net = np.zeros((every.count, 3))
        for stage in self.stages:
            start = 0
            for level, own in stage.functions.keys.items():
                first = sum(len(keys[before]) for before in keys if before < level)
                place = first + np.searchsorted(keys[level], own)
                net[place] += stage.moves[start : start + len(own)]
                start += len(own)
        firsts, levels = every.firsts
        degrees = (DEGREE, DEGREE, DEGREE)
        rest = volume_of_levels(firsts, levels, max(keys), box, degrees, frame)
        return rest.with_net(net)


def fit(
    field: Field, leaves: Cells, tolerance: float, deepest: int, cells: Sequence[Cells] = ()
) -> Fit:
    """Fit a deformation within a tolerance, or as near as the levels allow.

    Parameters
    ----------
    field : Field
    leaves : Cells
        Leaves of an octree that hold the model.
    tolerance : float, model length
    deepest : int
        The finest level that corrections may be made on.
    cells : sequence of Cells
        Those of an earlier fit: its stages are made again, and no others.

    Returns
    -------
    Fit
        Its bound is greater than the tolerance where no more could be done.
    """
    target = _TARGET * tolerance
    stages: list[Stage] = []
    done: list[Cells] = []
    following = dict(cells[0]) if cells else _moving(field, leaves, target)
    while True:
        size = sum(stage.functions.count for stage in stages)
        full = size + functions_on(following, DEGREE).count > MOST_FUNCTIONS
        if following and not full:
            stages.append(_stage(field, stages, following, len(done)))
            done.append(following)
        if len(done) < len(cells) and not full:
            following = cells[len(done)]
            continue
        bad: list[Floats] = []
        worst, count = 0.0, 0
        for places in _to_judge(field.surface, leaves, done):
            off = np.linalg.norm(field.moves(places) - _sum(stages, places), axis=1)
            bad.append(places[off > target])
            worst, count = max(worst, float(off.max(initial=0.0))), count + len(places)
        far = np.concatenate([np.zeros((0, 3)), *bad])
        ended = cells or not len(far) or full or len(done) == _MOST_STAGES
        if not ended:
            following = _finer(field.surface, leaves, done, far, deepest)
        if ended or not following or worst <= FOUND * tolerance:
            return Fit(tuple(stages), tuple(done), worst, count)


def _moving(field: Field, leaves: Cells, target: float) -> Cells:
    """The leaves where something moves by more than the target."""
    out: Cells = {}
    inner, moved = field.inner
    for level, codes in leaves.items():
        places = _on_cells(field.surface, codes, level, _FITTED, seed=level)
        places = np.concatenate([places, inner])
        moves = np.concatenate([field.moves(places[: len(places) - len(inner)]), moved])
        far = np.linalg.norm(moves, axis=1) > target
        out[level] = np.intersect1d(codes_of(places[far], level), codes)
    return {level: codes for level, codes in out.items() if len(codes)}


def _stage(field: Field, stages: Sequence[Stage], cells: Cells, number: int) -> Stage:
    """Correct what earlier stages left, on some cells."""
    functions = functions_on(cells, DEGREE)
    found = [np.zeros((0, 3))]
    for level, codes in cells.items():
        near = around(codes, level, DEGREE)
        seed = 1000 * (number + 1) + level
        found.append(_on_cells(field.surface, near, level, _FITTED, seed))
    places = np.concatenate(found)
    wanted = field.moves(places) - _sum(stages, places)
    matrix = functions.matrix(places)
    if number == 0:
        inner, moved = field.inner
        weighed = _INNER_WEIGHT * functions.matrix(inner)
        matrix = csr_array(vstack([matrix, weighed], format="csr"))
        wanted = np.concatenate([wanted, _INNER_WEIGHT * moved])
    return Stage(functions, solve_least_squares(matrix, wanted, functions.order))


def _on_cells(surface: Surface, codes: Ints, level: int, density: float, seed: int) -> Floats:
    """Points (n, 3) of the surface in cells of a level, so many for each face-sized piece."""
    places = surface.meeting(codes, level).points(level, density, seed)
    return places[np.isin(codes_of(places, level), codes)]


def _sum(stages: Sequence[Stage], places: Floats) -> Floats:
    """What the stages together move places by."""
    out = np.zeros_like(places)
    for stage in stages:
        out += stage.functions.matrix(places) @ stage.moves
    return out


def _to_judge(surface: Surface, leaves: Cells, done: Sequence[Cells]) -> list[Floats]:
    """Points that no stage was fitted to: everywhere, and densely where cells are small."""
    seed = 1_000_000 * (len(done) + 1)
    coarsest = min(leaves)
    out = [surface.outlines(), surface.points(coarsest, _JUDGED, seed)]
    every = [leaves, *done]
    for level in sorted({level for cells in every for level in cells}):
        codes = np.unique(np.concatenate([cells[level] for cells in every if level in cells]))
        out.append(_on_cells(surface, codes, level, _JUDGED, seed + level + 1))
    return out


def _finer(
    surface: Surface, leaves: Cells, done: Sequence[Cells], far: Floats, deepest: int
) -> Cells:
    """Cells for the next stage: where points are far, half as large as those there are."""
    level_of = np.full(len(far), -1)
    for cells in done:
        for level, codes in cells.items():
            held = np.isin(codes_of(far, level), codes)
            level_of[held] = np.maximum(level_of[held], level)
    out: Cells = {}
    for level, codes in leaves.items():
        # A leaf where nothing seemed to move.
        bare = far[(level_of < 0) & np.isin(codes_of(far, level), codes)]
        if len(bare):
            out[level] = np.unique(codes_of(bare, level))
    for level in np.unique(level_of[(level_of >= 0) & (level_of < deepest)]).tolist():
        parents = np.unique(codes_of(far[level_of == level], level))
        places = _on_cells(surface, parents, level, 4 * _FITTED, seed=level)
        places = np.concatenate([places, far[level_of == level]])
        codes = np.unique(codes_of(places, level + 1))
        out[level + 1] = np.union1d(out.get(level + 1, codes), codes)
    return out
