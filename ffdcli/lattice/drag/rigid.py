"""Drags in which pieces of the object move as rigid bodies.

A piece moves rigidly if all control points that reach it share one motion. The unknowns are a
rotation and a shift for each piece and a displacement for each other control point; the solution
has the least sum of squared moves of control points. For given motions this is the problem of
``least_norm.py``, and its solution leaves a smooth function of six numbers per piece::

    F(motions) = sum over pieces |Q p + t - p|^2 + e^T (B B^T)^+ e

where ``e`` is the part of the wanted displacements that the motions leave, under the constraint
that moves of the other control points can give it. Sequential quadratic programming with exact
second derivatives and line search finds the minimum; near it steps shrink quadratically, and the
iteration stops when they are below 1e-13 of the size of the pieces. Gauss-Newton steps from the
identity find a start that satisfies the constraint. If none does, they find the motions with the
least violation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.lattice.drag.least_norm import Factored

_STEP = 1e-13
_MOST_STEPS = 200
_LARGEST_TURN = 0.5
# Relative size below which a curvature counts as zero, and size below which a slope does.
_FLAT = 1e-9
_NONE = 1e-6
# Contradiction of the wanted displacements that counts as rounding, relative to the size.
_MISSED = 1e-12


class NotConverged(ArithmeticError):
    """No rigid motion was found within the allowed number of steps."""


@dataclass(frozen=True)
class Piece:
    """Control points of a rigid piece, and the dependence of constrained points on them.

    Parameters
    ----------
    members : (b,) int64
        Control points that share the motion.
    arms : (b, 3) float64
        Positions relative to the mean of the carried control points; displacements from rest of
        the others.
    carried : (b,) float64
        1 for control points that follow rotation and shift, 0 for those that only rotate.
    radius : float
        Root mean square length of the arms.
    shares : (m,) float64
        Sum of the basis functions of carried control points at each constrained point.
    levers : (m, 3) float64
        Sum of basis function times arm.
    """

    members: Ints
    arms: Floats
    carried: Floats
    radius: float
    shares: Floats
    levers: Floats


@dataclass(frozen=True)
class Motion:
    """Rotation (3, 3) about the mean of a piece's carried control points, and shift (3,)."""

    rotation: Floats
    shift: Floats

    def displace(self, arms: Floats, shares: Floats) -> Floats:
        """Displacements (..., 3) of points with arms (..., 3) and shares (...) of the shift."""
        return np.asarray(arms @ self.rotation.T - arms + np.multiply.outer(shares, self.shift))


def make_piece(rows: csr_array, members: Ints, places: Floats, carried: Bools) -> Piece:
    """The piece of the control points ``members`` (b,); see :class:`Piece`.

    ``rows`` (m, n) holds the basis functions of all control points at the constrained points, and
    ``places`` (b, 3) positions of carried control points, displacements from rest of the others.
    """
    arms = places - carried[:, None] * places[carried].mean(axis=0)
    part = rows[:, members]
    radius = float(np.sqrt((arms**2).sum() / len(arms)))
    shift = carried.astype(np.float64)
    return Piece(members, arms, shift, radius, np.asarray(part @ shift), np.asarray(part @ arms))


def solve_motions(
    factored: Factored, pieces: Sequence[Piece], wanted: Floats
) -> tuple[list[Motion], Floats]:
    """Motions of the pieces with the least sum of squared moves of control points.

    Parameters
    ----------
    factored : Factored
        Rows of the constraints, with zeros for control points that may not move by themselves.
    pieces : sequence of Piece
        Pieces without common control points.
    wanted : (m, 3) float64
        Displacements of the constrained points.

    Returns
    -------
    list of Motion
    (m, 3) float64
        The part of ``wanted`` that is left to the other control points. If the constraints
        contradict each other, these cannot give all of it.
    """
    size = max(max(piece.radius for piece in pieces), float(np.abs(wanted).max(initial=0.0)))
    problem = _MotionProblem(factored, pieces, wanted, np.zeros(wanted.size))
    problem, motions = _approach(problem, size)
    state = problem.examine(motions)
    penalty = 0.0
    for _ in range(_MOST_STEPS):
        step, price = _newton_step(pieces, motions, state)
        length = float(np.abs(step).max(initial=0.0))
        if length <= _STEP * size:
            return motions, state.left_over
        penalty = max(penalty, 2 * price)
        bar = state.value + penalty * state.violation
        bar += 1e-12 * abs(bar)
        share = _bounded(pieces, step)
        while True:
            moved = _advance(pieces, motions, share * step)
            trial = problem.examine(moved)
            # Close to the solution differences of the merit are rounding: take the full step.
            if trial.value + penalty * trial.violation <= bar or share * length < 1e-7 * size:
                break
            share /= 2
        motions, state = moved, trial
    raise NotConverged


def _approach(problem: _MotionProblem, size: float) -> tuple[_MotionProblem, list[Motion]]:
    """Motions for which the other control points can give the rest, by Gauss-Newton steps.

    If there are none: the motions with the least violation, and the problem with that violation.
    """
    pieces = problem.pieces
    motions = [Motion(np.eye(3), np.zeros(3)) for _ in pieces]
    state = problem.examine(motions)
    for _ in range(_MOST_STEPS):
        if state.violation <= _STEP * size:
            return problem, motions
        step, _ = _restore(state)
        share = _bounded(pieces, step)
        while share * float(np.abs(step).max()) > _STEP * size:
            moved = _advance(pieces, motions, share * step)
            trial = problem.examine(moved)
            if trial.violation < state.violation:
                break
            share /= 2
        else:
            break
        motions, state = moved, trial
    if state.violation > _MISSED * size:
        problem = replace(problem, aim=state.out_of_reach)
    return problem, motions


@dataclass(frozen=True)
class _MotionProblem:
    """Arguments of :func:`solve_motions`, and the violation (3 m,) that cannot be avoided."""

    factored: Factored
    pieces: Sequence[Piece]
    wanted: Floats
    aim: Floats

    def examine(self, motions: Sequence[Motion]) -> _State:
        """Evaluate the problem at some motions."""
        left_over = self.wanted.copy()
        value = 0.0
        columns = []
        for piece, motion in zip(self.pieces, motions, strict=True):
            left_over -= motion.displace(piece.levers, piece.shares)
            value += float((motion.displace(piece.arms, piece.carried) ** 2).sum())
            arms = piece.levers @ motion.rotation.T
            # d(phi x g)/d phi has the columns e_i x g; left_over has their negatives.
            turning = [-np.cross(axis, arms) / (piece.radius or 1.0) for axis in np.eye(3)]
            shifting = [-np.multiply.outer(piece.shares, axis) for axis in np.eye(3)]
            columns.extend([*turning, *shifting])
        multipliers = self.factored.multipliers(left_over)
        value += float((multipliers * left_over).sum())
        wide = np.concatenate(columns, axis=1)
        lost, pulled = self.factored.unreachable(wide), self.factored.multipliers(wide)
        slope = _by_unknown(wide)
        return _State(
            value,
            left_over,
            multipliers,
            slope,
            _by_unknown(lost),
            self.factored.unreachable(left_over).ravel() - self.aim,
            2 * slope.T @ _by_unknown(pulled),
        )


def _by_unknown(wide: Floats) -> Floats:
    """Columns (3 m, 6 p) by unknown, from arrays (m, 3) side by side (m, 18 p)."""
    return wide.reshape(len(wide), -1, 3).transpose(0, 2, 1).reshape(3 * len(wide), -1)


@dataclass(frozen=True)
class _State:
    """Value and derivatives of the problem at some motions.

    The unknowns of each piece are a further rotation vector times the radius, and a shift.
    """

    value: float
    left_over: Floats
    # M of `left_over` (m, 3); twice M is the derivative of F with respect to it.
    multipliers: Floats
    # Derivatives (3 m, 6 p) of `left_over` and of its unreachable part, and that part (3 m,).
    slope: Floats
    reach_slope: Floats
    out_of_reach: Floats
    # Second derivatives of the second term of F without those of `left_over`.
    curvature: Floats

    @property
    def violation(self) -> float:
        """Norm of the part of the displacements that cannot be given."""
        return float(np.linalg.norm(self.out_of_reach))


def _newton_step(
    pieces: Sequence[Piece], motions: Sequence[Motion], state: _State
) -> tuple[Floats, float]:
    """Step (6 p,) to the minimum of the quadratic model, and the norm of the multipliers."""
    gradient = 2 * state.slope.T @ state.multipliers.ravel()
    for i, (piece, motion) in enumerate(zip(pieces, motions, strict=True)):
        twist = np.cross(piece.arms @ motion.rotation.T, piece.arms).sum(axis=0)
        gradient[6 * i : 6 * i + 3] += -2 * twist / (piece.radius or 1.0)
        gradient[6 * i + 3 : 6 * i + 6] += 2 * piece.carried.sum() * motion.shift
    step, (left, values, along, across) = _restore(state)
    price = -left @ ((along.T @ gradient) / values)
    curvature = state.curvature + _bending(
        pieces, motions, 2 * state.multipliers + price.reshape(-1, 3)
    )
    reduced = across.T @ curvature @ across
    bends, directions = np.linalg.eigh((reduced + reduced.T) / 2)
    # Downhill also where the model is concave; no step where it is flat.
    bends = np.abs(bends)
    usable = bends > _FLAT * bends.max(initial=0.0)
    push = directions.T @ (across.T @ (gradient + curvature @ step))
    push[~usable] = 0.0
    step = step - across @ (directions @ (push / np.where(usable, bends, 1.0)))
    return step, float(np.linalg.norm(price))


def _restore(state: _State) -> tuple[Floats, tuple[Floats, Floats, Floats, Floats]]:
    """Shortest step that satisfies the linearized constraint, and the decomposition used for it.

    That is of the constraint's derivatives: left singular vectors, singular values, right
    singular vectors, and a basis of the directions along which the constraint does not change.
    """
    left, values, right = np.linalg.svd(state.reach_slope, full_matrices=True)
    # Columns have the size of basis functions, at most 1.
    rank = int((values > _NONE).sum())
    left, values, along = left[:, :rank], values[:rank], right[:rank].T
    return -along @ ((left.T @ state.out_of_reach) / values), (left, values, along, right[rank:].T)


def _bounded(pieces: Sequence[Piece], step: Floats) -> float:
    """Factor of a step (6 p,) that limits the rotation of each piece."""
    turns = [np.abs(_turn(piece, step[6 * i :])).max() for i, piece in enumerate(pieces)]
    return _LARGEST_TURN / max(_LARGEST_TURN, float(max(turns)))


def _bending(pieces: Sequence[Piece], motions: Sequence[Motion], prices: Floats) -> Floats:
    """Second derivatives (6 p, 6 p) that the rotations contribute."""
    out = np.zeros((6 * len(pieces), 6 * len(pieces)))
    for i, (piece, motion) in enumerate(zip(pieces, motions, strict=True)):
        own = piece.arms.T @ (piece.arms @ motion.rotation.T)
        pulled = prices.T @ (piece.levers @ motion.rotation.T)
        turn = 2 * np.trace(own) * np.eye(3) - own - own.T
        turn += np.trace(pulled) * np.eye(3) - (pulled + pulled.T) / 2
        out[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = turn / (piece.radius or 1.0) ** 2
        out[range(6 * i + 3, 6 * i + 6), range(6 * i + 3, 6 * i + 6)] = 2 * piece.carried.sum()
    return out


def _turn(piece: Piece, step: Floats) -> Floats:
    return step[:3] / (piece.radius or 1.0)


def _advance(pieces: Sequence[Piece], motions: Sequence[Motion], step: Floats) -> list[Motion]:
    moved = []
    for i, (piece, motion) in enumerate(zip(pieces, motions, strict=True)):
        turn = Rotation.from_rotvec(_turn(piece, step[6 * i :])).as_matrix()
        shift = motion.shift + step[6 * i + 3 : 6 * i + 6]
        moved.append(Motion(turn @ motion.rotation, shift))
    return moved
