"""Fits of a polynomial volume to a smooth deformation, within a tolerance on a model's surface.

The displacement is approximated by uniform B-splines on the dyadic grid of an octree: first on its
leaves, then, where the error is too large, by corrections on cells half as large, and so on. Each
stage is a least-squares problem on points of the surface; a few points inside solids, of small
weight, keep the volume regular there. The error of the result is measured on other points.

The fit is linear in the displacement, so the cells of one fit serve all control nets.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, vstack

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.fitting.least_squares import solve_least_squares
from ffdcli.fitting.levels import CellCodes, Functions, around, codes_of, functions_on
from ffdcli.fitting.spread import Surface
from ffdcli.volume.adaptive.hierarchical import volume_of_levels
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from ffdcli.volume.frame import Frame

DEGREE = 3
# Levels of corrections beyond the leaves of the octree, at most.
MORE_LEVELS = 5
# Points for the fit, and for the measurement, per face-sized piece of surface in a cell.
_FITTED, _JUDGED = 12.0, 24.0
# Fewest points for the measurement, spread over the whole surface.
_FEWEST = 5000
# Assumed ratio of the largest distance found to the largest there is.
FOUND = 0.75
# Share of the tolerance below which a cell is not refined.
_TARGET = 0.6
# Largest number of stages, and of functions in all of them.
_MOST_STAGES = 12
MOST_FUNCTIONS = 60_000
# Weight of the points off the surface.
_INNER_WEIGHT = 0.03


@dataclass(frozen=True)
class Field:
    """A displacement field to be fitted, on the lattice box scaled to the unit cube.

    Parameters
    ----------
    moves : (n, 3) -> (n, 3)
        Displacements at points of the surface, model length. Raises where there are none.
    surface : Surface
        Of the model.
    inner : (m, 3) float64, (m, 3) float64
        Points off the surface, and their displacements.
    closed : (2, 3) bool
        Lower and upper sides of the cube at which, and beyond which, the fit must vanish. The
        displacements do so too, with C2.
    """

    moves: Callable[[Floats], Floats]
    surface: Surface
    inner: tuple[Floats, Floats]
    closed: Bools


@dataclass(frozen=True)
class FitStage:
    """Functions and coefficients of one stage.

    Parameters
    ----------
    functions : Functions
    moves : (n, 3) float64
        Coefficients of the functions.
    """

    functions: Functions
    moves: Floats


@dataclass(frozen=True)
class FieldFit:
    """A fitted deformation.

    Parameters
    ----------
    stages : tuple of FitStage
    cells : tuple of CellCodes
        Cells of each stage.
    error : float, model length
        Largest distance found between the fit and the deformation.
    samples : int
        Number of points of that measurement.
    """

    stages: tuple[FitStage, ...]
    cells: tuple[CellCodes, ...]
    error: float
    samples: int

    @property
    def bound(self) -> float:
        """Stated bound of the distance: a third more than was found."""
        return self.error / FOUND

    @property
    def levels(self) -> tuple[int, int]:
        """Coarsest and finest level of its functions."""
        used = [level for stage in self.stages for level in stage.functions.keys]
        return (min(used), max(used)) if used else (0, 0)

    def volume(self, box: Floats, frame: Frame) -> AdaptiveVolume:
        """The fitted volume in the lattice box (2, 3), the identity outside it."""
        # A function of several stages occurs once in the volume.
        keys: CellCodes = {}
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
        return replace(rest.with_net(net), box=box)


def fit_field(
    field: Field, leaves: CellCodes, tolerance: float, deepest: int, cells: Sequence[CellCodes] = ()
) -> FieldFit:
    """Fit a displacement field within a tolerance, or as closely as the levels allow.

    Parameters
    ----------
    field : Field
    leaves : CellCodes
        Leaves of an octree that hold the model.
    tolerance : float, model length
    deepest : int
        Finest level of corrections.
    cells : sequence of CellCodes
        Cells of an earlier fit: its stages are repeated, and no others added.

    Returns
    -------
    FieldFit
        Its bound exceeds the tolerance where the limits of levels or functions are reached.
    """
    target = _TARGET * tolerance
    stages: list[FitStage] = []
    done: list[CellCodes] = []
    following = dict(cells[0]) if cells else _moving(field, leaves, target)
    while True:
        size = sum(stage.functions.count for stage in stages)
        full = size + functions_on(following, DEGREE, field.closed).count > MOST_FUNCTIONS
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
            return FieldFit(tuple(stages), tuple(done), worst, count)


def _moving(field: Field, leaves: CellCodes, target: float) -> CellCodes:
    """Leaves with displacements larger than the target."""
    out: CellCodes = {}
    inner, moved = field.inner
    for level, codes in leaves.items():
        places = _on_cells(field.surface, codes, level, _FITTED, seed=level)
        places = np.concatenate([places, inner])
        moves = np.concatenate([field.moves(places[: len(places) - len(inner)]), moved])
        far = np.linalg.norm(moves, axis=1) > target
        out[level] = np.intersect1d(codes_of(places[far], level), codes)
    return {level: codes for level, codes in out.items() if len(codes)}


def _stage(field: Field, stages: Sequence[FitStage], cells: CellCodes, number: int) -> FitStage:
    """Fit the residual of earlier stages on some cells."""
    functions = functions_on(cells, DEGREE, field.closed)
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
    return FitStage(functions, solve_least_squares(matrix, wanted, functions.order))


def _on_cells(surface: Surface, codes: Ints, level: int, density: float, seed: int) -> Floats:
    """Points (n, 3) of the surface in cells of a level, ``density`` per face-sized piece."""
    places = surface.meeting(codes, level).points(level, density, seed)
    return places[np.isin(codes_of(places, level), codes)]


def _sum(stages: Sequence[FitStage], places: Floats) -> Floats:
    """Displacements (n, 3) of all stages together at points (n, 3)."""
    out = np.zeros_like(places)
    for stage in stages:
        out += stage.functions.matrix(places) @ stage.moves
    return out


def _to_judge(surface: Surface, leaves: CellCodes, done: Sequence[CellCodes]) -> list[Floats]:
    """Points (n, 3) that no stage was fitted to, denser where cells are small."""
    seed = 1_000_000 * (len(done) + 1)
    coarsest = min(leaves)
    out = [surface.outlines(), surface.points(coarsest, _JUDGED, seed, _FEWEST)]
    every = [leaves, *done]
    for level in sorted({level for cells in every for level in cells}):
        codes = np.unique(np.concatenate([cells[level] for cells in every if level in cells]))
        out.append(_on_cells(surface, codes, level, _JUDGED, seed + level + 1))
    return out


def _finer(
    surface: Surface, leaves: CellCodes, done: Sequence[CellCodes], far: Floats, deepest: int
) -> CellCodes:
    """Cells of the next stage: around points with large errors, half the size of the last."""
    level_of = np.full(len(far), -1)
    for cells in done:
        for level, codes in cells.items():
            held = np.isin(codes_of(far, level), codes)
            level_of[held] = np.maximum(level_of[held], level)
    out: CellCodes = {}
    for level, codes in leaves.items():
        # Leaves left out of the first stage, as nothing seemed to move there.
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
