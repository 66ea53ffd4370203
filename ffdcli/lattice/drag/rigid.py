"""Drags of a volume in which pieces move as rigid bodies.

A piece moves rigidly where all control points that reach it share one motion. So the unknowns are
a rotation and a shift per piece and a displacement per other control point, and the solution is
the one that moves control points least, in the sum of squares. For given motions the rest is the
least-norm problem of ``drag.py``; put in, it leaves a smooth function of six numbers per piece::

    F(motions) = sum over pieces |Q p + t - p|^2 + e^T (B B^T)^+ e

where ``e`` is what the motions leave of the displacements wanted, with the side condition that the
other control points can reach it. Sequential quadratic programming with exact second derivatives,
with line search, finds its minimum; near it the steps shrink quadratically, and it stops where they
are below 1e-13 of the piece's size. Gauss-Newton steps from the identity find its start, where the
side condition holds; where it cannot hold, they find the motions that miss it least.
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
# Relative size under which a curvature counts as none, and size under which a slope does.
_FLAT = 1e-9
_NONE = 1e-6
# Share of the size by which the displacements wanted may contradict each other as rounding.
_MISSED = 1e-12


class NotConverged(ArithmeticError):
    """No rigid motion was found in the steps allowed."""


@dataclass(frozen=True)
class Piece:
    """A rigid piece: its control points and how constrained points depend on them.

    Parameters
    ----------
    members : (b,) int64
        Control points that share the motion.
    arms : (b, 3) float64
        Their places from the middle of those carried; of others what they have moved by.
    carried : (b,) float64
        1 where the shift moves the control point too, 0 where it turns only.
    radius : float
        Root mean square length of the arms.
    shares : (m,) float64
        Sum of the basis functions of those carried at each constrained point.
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
    """Rotation (3, 3) about the middle of a piece's control points, and shift (3,)."""

    rotation: Floats
    shift: Floats

    def displace(self, arms: Floats, shares: Floats) -> Floats:
        """Displacements (..., 3) of points given by their arms; of sums of shares (...) of them."""
        return np.asarray(arms @ self.rotation.T - arms + np.multiply.outer(shares, self.shift))


def make_piece(rows: csr_array, members: Ints, places: Floats, carried: Bools) -> Piece:
    """Describe a piece.

    Parameters
    ----------
    rows : (m, n) sparse
        Basis functions of all control points at the constrained points.
    members : (b,) int64
    places : (b, 3) float64
        Current control points. Where several control points add up to a place (levels), those of
        one level are carried, and of the others this is what they have moved by.
    carried : (b,) bool
    """
    arms = places - carried[:, None] * places[carried].mean(axis=0)
    part = rows[:, members]
    radius = float(np.sqrt((arms**2).sum() / len(arms)))
    shift = carried.astype(np.float64)
    return Piece(members, arms, shift, radius, np.asarray(part @ shift), np.asarray(part @ arms))


def solve_motions(
    factored: Factored, pieces: Sequence[Piece], wanted: Floats
) -> tuple[list[Motion], Floats]:
    """The pieces' motions of the least total move of control points.

    Parameters
    ----------
    factored : Factored
        Of the constraints' rows with zeros for control points that may not move on their own.
    pieces : sequence of Piece
        No two share control points.
    wanted : (m, 3) float64
        Displacements of the constrained points.

    Returns
    -------
    list of Motion
    (m, 3) float64
        What they leave of ``wanted`` to the other control points. Where the wishes contradict
        each other, a part of it cannot be reached.

    Raises
    ------
    NotConverged
    """
    size = max(max(piece.radius for piece in pieces), float(np.abs(wanted).max(initial=0.0)))
    problem = _Problem(factored, pieces, wanted, np.zeros(wanted.size))
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
            # Close to the solution the merit is rounding, and the full step is right.
            if trial.value + penalty * trial.violation <= bar or share * length < 1e-7 * size:
                break
            share /= 2
        motions, state = moved, trial
    raise NotConverged


def _approach(problem: _Problem, size: float) -> tuple[_Problem, list[Motion]]:
    """Motions for which the other control points can reach the rest, by Gauss-Newton steps.

    Where there are none, those that come closest in the sum of squares, and the problem of
    staying as close.
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
class _Problem:
    """What :func:`solve_motions` is given, and the miss (3 m,) that cannot be avoided."""

    factored: Factored
    pieces: Sequence[Piece]
    wanted: Floats
    aim: Floats

    def examine(self, motions: Sequence[Motion]) -> _State:
        """The problem at some motions."""
        left_over = self.wanted.copy()
        value = 0.0
        columns = []
        for piece, motion in zip(self.pieces, motions, strict=True):
            left_over -= motion.displace(piece.levers, piece.shares)
            value += float((motion.displace(piece.arms, piece.carried) ** 2).sum())
            arms = piece.levers @ motion.rotation.T
            # d(phi x g)/d phi has the columns e_i x g; left_over loses them.
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
    """(3 m, 6 p) of the unknowns' columns (m, 3) side by side (m, 18 p)."""
    return wide.reshape(len(wide), -1, 3).transpose(0, 2, 1).reshape(3 * len(wide), -1)


@dataclass(frozen=True)
class _State:
    """The problem at some motions.

    Unknowns are, per piece, a further rotation vector times the piece's radius, and a shift.
    """

    value: float
    left_over: Floats
    # M of `left_over` (m, 3), whose double is the slope of F by it.
    multipliers: Floats
    # Slope (3 m, 6 p) of `left_over`; the same for its part out of reach, and that part (3 m,).
    slope: Floats
    reach_slope: Floats
    out_of_reach: Floats
    # Curvature of the second term of F that the slope alone makes.
    curvature: Floats

    @property
    def violation(self) -> float:
        """How far the displacements wanted are from what can be reached."""
        return float(np.linalg.norm(self.out_of_reach))


def _newton_step(
    pieces: Sequence[Piece], motions: Sequence[Motion], state: _State
) -> tuple[Floats, float]:
    """Step (6 p,) to the minimum of the quadratic model, and the side condition's price."""
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
    # Downhill even where the model is bent the wrong way; no step where it is flat.
    bends = np.abs(bends)
    usable = bends > _FLAT * bends.max(initial=0.0)
    push = directions.T @ (across.T @ (gradient + curvature @ step))
    push[~usable] = 0.0
    step = step - across @ (directions @ (push / np.where(usable, bends, 1.0)))
    return step, float(np.linalg.norm(price))


def _restore(state: _State) -> tuple[Floats, tuple[Floats, Floats, Floats, Floats]]:
    """Shortest step to where the rest can be reached; singular vectors and values behind it.

    These are those of the side condition's slope: left ones, values, right ones, and the other
    directions, along which it does not change.
    """
    left, values, right = np.linalg.svd(state.reach_slope, full_matrices=True)
    # Columns are of the size of basis functions, at most 1.
    rank = int((values > _NONE).sum())
    left, values, along = left[:, :rank], values[:rank], right[:rank].T
    return -along @ ((left.T @ state.out_of_reach) / values), (left, values, along, right[rank:].T)


def _bounded(pieces: Sequence[Piece], step: Floats) -> float:
    """The share of a step (6 p,) that turns no piece too far at once."""
    turns = [np.abs(_turn(piece, step[6 * i :])).max() for i, piece in enumerate(pieces)]
    return _LARGEST_TURN / max(_LARGEST_TURN, float(max(turns)))


def _bending(pieces: Sequence[Piece], motions: Sequence[Motion], prices: Floats) -> Floats:
    """Curvature (6 p, 6 p) that comes from rotations being no straight motions."""
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
