"""Solve a drag: the least change of control points or weights, errors about missed targets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import csr_array

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.lattice.drag.holds import Held, RigidPiece
from ffdcli.lattice.drag.least_norm import TooManyConstraints, factor, free_rows
from ffdcli.lattice.drag.reweigh import reweigh
from ffdcli.lattice.drag.rigid import NotConverged, make_piece, solve_motions
from ffdcli.lattice.file.source import KeyPath, Source, key_text
from ffdcli.volume.protocol import LatticeMap
from ffdcli.volume.weights import rational_basis

# Distance within which a target counts as met, relative to the box or a longer displacement.
_MET = 1e-12
# Largest number of constraints that a message lists.
_NAMED = 8


@dataclass(frozen=True)
class Request:
    """A drag, in the lattice frame.

    Parameters
    ----------
    sources : (m, 3) float64
        Points of the undeformed object, including held points.
    goals : (m, 3) float64
        Targets of their images, or displacements.
    by : (m,) bool
        True for goals that are displacements.
    pinned : (nu, nv, nw) bool
        Control points that do not move: locked, hidden and pinned ones.
    held : Held
        Control points that held boxes and groups fix or move rigidly.
    vary, on_conflict
        As in the lattice file.
    cost : (nu, nv, nw) or (n,) float64, or None
        Factor of the squared move of each control point; None for 1.
    path : callable
        Key of a constraint, by its number.
    source : Source
        For messages; key paths count from the drag.
    """

    sources: Floats
    goals: Floats
    by: Bools
    pinned: Bools
    held: Held
    vary: Literal["points", "weights"]
    on_conflict: Literal["error", "least_squares"]
    cost: Floats | None
    path: Callable[[int], KeyPath]
    source: Source

    def label(self, number: int) -> str:
        """Name of a constraint for messages."""
        path = self.path(number)
        return key_text(path) if len(path) > 1 else f"pair {number + 1}"


@dataclass(frozen=True)
class Succession:
    """A drag as a succession of single-point drags (Hu 2001, section 6), in the lattice frame.

    Step q moves the image of source q by ``M_q sum R_q^2``, with M from Eq. 16. (Eq. 19 also
    divides by R, which is a misprint.)

    Parameters
    ----------
    sources : (m, 3) float64
    images : (m, 3) float64
        Images of the sources before the drag.
    rows : (m, n) sparse
        Rational basis at the sources, zero for control points that do not move, times the unit in
        which the move of each control point is measured.
    multipliers : (m, 3) float64
    """

    sources: Floats
    images: Floats
    rows: csr_array
    multipliers: Floats

    def steps(self) -> Iterator[tuple[Floats, Floats, Floats]]:
        """Source, displacement of its image, and its image after the step; (3,) each."""
        moved = np.zeros((self.rows.shape[1], 3))
        for q, multiplier in enumerate(self.multipliers):
            part = slice(self.rows.indptr[q], self.rows.indptr[q + 1])
            columns, values = self.rows.indices[part], self.rows.data[part]
            moved[columns] += np.multiply.outer(values, multiplier)
            displacement = multiplier * float(values @ values)
            yield self.sources[q], displacement, self.images[q] + values @ moved[columns]


@dataclass(frozen=True)
class Dragged:
    """Control points and weights after a drag.

    Parameters
    ----------
    points : (nu, nv, nw, 3) float64
    weights : (nu, nv, nw) float64
    warnings : tuple of str
    succession : Succession or None
        None if the drag is not a succession of point drags: of weights, or with rigid pieces.
    """

    points: Floats
    weights: Floats
    warnings: tuple[str, ...] = ()
    succession: Succession | None = None


def drag(volume: LatticeMap, points: Floats, weights: Floats, request: Request) -> Dragged:
    """Move points of the object to their targets with the least change of the lattice.

    The functions of the volume are used, not its control net: control points (nu, nv, nw, 3) and
    weights (nu, nv, nw) are given.

    Raises
    ------
    LatticeError
        A target cannot be met; names each such target with the distance that remains.
    """
    held = request.held
    fixed = request.pinned | held.fixed
    free = ~fixed
    for piece in held.pieces:
        free &= ~piece.members
    if held.any and not free.any() and not held.pieces:
        message = "the held parts leave no control point free: the lattice is too coarse"
        raise request.source.error((), message, "use more `points`, or hold less")
    inside = volume.contains(request.sources)
    if inside.all():
        basis = volume.basis_matrix(request.sources)
    else:
        clipped = np.clip(request.sources, volume.box[0], volume.box[1])
        basis = volume.basis_matrix(clipped)
        basis.data[np.repeat(~inside, np.diff(basis.indptr))] = 0.0
    size = float(np.linalg.norm(volume.box[1] - volume.box[0]))
    flat = points.reshape(-1, 3)
    problem = _DragArrays(request, volume, basis, inside, flat, weights.ravel(), free.ravel(), size)
    if request.vary == "weights":
        return Dragged(points, problem.vary_weights().reshape(weights.shape))
    try:
        moved, warnings, succession = problem.vary_points()
    except TooManyConstraints as error:
        raise request.source.error((), str(error), "give fewer pairs, or more `points`") from None
    except NotConverged:
        message = "no motion of the rigid parts was found that meets all targets"
        raise request.source.error(
            (), message, "ask for less, or hold with `rigid: false`"
        ) from None
    return Dragged(moved.reshape(points.shape), weights, warnings, succession)


@dataclass(frozen=True)
class _DragArrays:
    """A drag as arrays: n control points in one row, m constraints."""

    request: Request
    volume: LatticeMap
    # Polynomial basis (m, n), empty rows for sources outside the box.
    basis: csr_array
    inside: Bools
    points: Floats
    weights: Floats
    free: Bools
    # Diagonal of the lattice box.
    size: float

    def vary_points(self) -> tuple[Floats, tuple[str, ...], Succession | None]:
        request = self.request
        rational = self._rational(self.weights)
        before = rational @ self.points
        wanted = self._wanted(before)
        rows = free_rows(rational, self.free)
        # Least moves in units of the square root of the inverse cost.
        unit = np.ones(1) if request.cost is None else 1 / np.sqrt(request.cost.ravel())
        if request.cost is not None:
            rows = csr_array(
                (rows.data * unit[rows.indices], rows.indices, rows.indptr), rows.shape
            )
        factored = factor(rows)
        moved = self.points.copy()
        left_over = wanted
        carried = np.zeros(len(wanted), dtype=bool)
        if request.held.pieces:
            pieces = [make_piece(rational, *self._carriers(piece)) for piece in request.held.pieces]
            motions, left_over = solve_motions(factored, pieces, wanted)
            for piece, motion in zip(pieces, motions, strict=True):
                moved[piece.members] += motion.displace(piece.arms, piece.carried)
                carried |= piece.shares > 0
        multipliers = factored.multipliers(left_over)
        moved += unit[:, None] * factored.moves(left_over, multipliers)
        if not np.isfinite(moved).all():
            raise request.source.error((), "leads to coordinates too large for numbers", None)
        missed = np.linalg.norm(wanted - (rational @ moved - before), axis=1)
        causes = [
            (~self.inside, "it lies outside the lattice box"),
            (carried, "its rigid part cannot meet it together with the other targets"),
            (factored.norms == 0, "no control point that may move reaches it"),
            (factored.dependent, "it depends on other constraints"),
        ]
        warnings = self._judge(missed, wanted, causes)
        succession = None
        if not request.held.pieces:
            images = np.where(self.inside[:, None], before, request.sources)
            succession = Succession(request.sources, images, rows, multipliers)
        return moved, warnings, succession

    def _carriers(self, piece: RigidPiece) -> tuple[Ints, Floats, Bools]:
        """Members (b,), positions (b, 3) and carried (b,) of a piece, for :func:`make_piece`."""
        members = np.flatnonzero(piece.members.ravel())
        places, rest = self.points[members], self.volume.rest_points.reshape(-1, 3)[members]
        carried = self.volume.levels.ravel()[members] == piece.level
        return members, np.where(carried[:, None], places, places - rest), carried

    def vary_weights(self) -> Floats:
        before = self._rational(self.weights) @ self.points
        wanted = self._wanted(before)
        outside = np.linalg.norm(wanted, axis=1) * ~self.inside
        where = [(~self.inside, "it lies outside the lattice box")]
        self._judge(outside, wanted, where)
        at = np.flatnonzero(self.inside)
        targets = (before + wanted)[at]
        found = reweigh(self.basis[at], self.points, self.weights, self.free, targets)
        after = self._rational(found.weights) @ self.points
        missed = np.linalg.norm(before + wanted - after, axis=1) * self.inside
        beyond = np.zeros(len(missed))
        beyond[at] = found.beyond
        causes = [
            (
                beyond > 0,
                "its target is outside the hull of the control points that reach it, by {}",
            ),
            (np.full(len(missed), not found.met), "no positive weights meet all targets"),
        ]
        self._judge(missed, wanted, causes, beyond)
        return found.weights

    def _rational(self, weights: Floats) -> csr_array:
        if self.inside.all():
            return rational_basis(self.basis, weights)
        # Without empty rows, which would be divided by zero.
        values = np.zeros_like(self.basis.data)
        live = np.repeat(self.inside, np.diff(self.basis.indptr))
        values[live] = rational_basis(self.basis[np.flatnonzero(self.inside)], weights).data
        shape = self.basis.shape
        return csr_array((values, self.basis.indices, self.basis.indptr), shape=shape)

    def _wanted(self, before: Floats) -> Floats:
        request = self.request
        images = np.where(self.inside[:, None], before, request.sources)
        return np.where(request.by[:, None], request.goals, request.goals - images)

    def _judge(
        self,
        missed: Floats,
        wanted: Floats,
        causes: list[tuple[Bools, str]],
        amounts: Floats | None = None,
    ) -> tuple[str, ...]:
        """Raise an error about missed targets, or return it as a warning with least squares.

        It names each constraint with its residual and the first cause that applies.
        """
        request = self.request
        scale = max(self.size, float(np.abs(wanted).max(initial=0.0)))
        bad = np.flatnonzero(missed > _MET * scale)
        if not len(bad):
            return ()
        worst = bad[np.argsort(-missed[bad], kind="stable")]
        missing = []
        for q in worst[:_NAMED].tolist():
            cause = next(
                (text for holds, text in causes if holds[q]),
                "it nearly depends on other constraints",
            )
            if amounts is not None:
                cause = cause.format(f"{amounts[q]:.3g}")
            missing.append(f"{request.label(q)} by {missed[q]:.3g} ({cause})")
        more = f", and {len(bad) - _NAMED} more" if len(bad) > _NAMED else ""
        text = f"{', '.join(missing)}{more}"
        if request.on_conflict == "least_squares":
            rms, met = float(np.sqrt(np.mean(missed**2))), 1 - len(bad) / len(missed)
            return (f"targets are missed: {text}; rms {rms:.3g}, {met:.1%} are met",)
        raise request.source.error(
            request.path(int(bad.min())), f"cannot meet all targets: {text}", self._hint(bad)
        )

    def _hint(self, bad: Ints) -> str:
        if not self.inside[bad].all():
            return "enlarge the `box`, or choose points inside it"
        if self.request.vary == "weights":
            return "choose nearer targets, or use `vary: points`"
        return "ask for less, use more `points`, or say `on_conflict: least_squares`"
