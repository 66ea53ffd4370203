"""Drags as users ask for them, in model coordinates: by a lattice file's edit or from Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from pydantic import TypeAdapter, ValidationError

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.drag.holds import Groups, Held, resolve_holds
from ffdcli.lattice.drag.solutions import Dragged, Request, drag
from ffdcli.lattice.file.drag_models import Drag, Hold, HoldPoint, Holds, Pins
from ffdcli.lattice.file.pairs import PairTable
from ffdcli.lattice.file.problems import selector_problems
from ffdcli.lattice.file.selectors import select
from ffdcli.lattice.file.source import KeyPath, Source, key_text
from ffdcli.volume.protocol import LatticeMap

# The error about a place within the drag: path below it, message, hint.
PlaceFault = Callable[[KeyPath, str, str | None], LatticeError]


def drag_by_edit(
    volume: LatticeMap,
    points: Floats,
    weights: Floats,
    edit: Drag,
    table: PairTable,
    pinned: Bools,
    groups: Groups | None,
    fault: PlaceFault,
) -> Dragged:
    """Apply a `drag` edit.

    Parameters
    ----------
    volume : LatticeMap
        For its knots.
    points, weights : (nu, nv, nw, 3), (nu, nv, nw) float64
    edit : Drag
    table : PairTable
        Its pairs.
    pinned : (nu, nv, nw) bool
        Control points locked or pinned.
    groups : mapping of str to (T, 3, 3) float64, or None
    fault : callable

    Raises
    ------
    LatticeError
    """
    request = _request(
        volume,
        points,
        table,
        edit.hold,
        pinned,
        groups,
        lambda q: ("pairs",) if isinstance(edit.pairs, str) else ("pairs", q),
        fault,
    )
    request = replace(
        request,
        vary=edit.vary,
        on_conflict=edit.on_conflict,
        cost=level_costs(volume, edit.level_cost),
    )
    return _run(volume, points, weights, request)


@dataclass(frozen=True)
class DragOptions:
    """What may be asked of a drag from Python; the fields mean what the keys of a file mean.

    Parameters
    ----------
    pin : (nu, nv, nw) bool, or sequence of selectors as in a lattice file
        Control points that stay.
    hold : sequence of mappings, as in a lattice file
        ``{"point": [x, y, z]}``, ``{"inside": {"min": .., "max": ..}}`` or ``{"group": name}``, the
        last two with ``"rigid": True`` to move as one.
    vary : {"points", "weights"}
        Weights take ``volume: nurbs`` or ``tspline``.
    on_conflict : {"error", "least_squares"}
    level_cost : float
        ``volume: hierarchical``: how much more a move counts on each finer level.
    """

    pin: Bools | Sequence[Any] | None = None
    hold: Sequence[Any] = ()
    vary: Literal["points", "weights"] = "points"
    on_conflict: Literal["error", "least_squares"] = "error"
    level_cost: float = 1.0


def drag_points(
    volume: LatticeMap,
    points: Floats,
    weights: Floats,
    table: PairTable,
    options: DragOptions,
    *,
    places: Callable[[], Floats],
    locked: Bools,
    groups: Groups | None,
    rational: bool,
    source: Source,
) -> Dragged:
    """Apply a drag asked for from Python; see :meth:`ffdcli.lattice.lattice.Lattice.drag`.

    Parameters
    ----------
    places : callable
        Where control points rest, (nu, nv, nw, 3), in the coordinates of selectors.
    rational : bool
        Whether the volume may have weights.
    """
    vary, on_conflict = options.vary, options.on_conflict

    def fault(path: KeyPath, message: str, hint: str | None) -> LatticeError:
        return LatticeError(message, file=source.name, key=source.key(path), hint=hint)

    if vary not in ("points", "weights") or on_conflict not in ("error", "least_squares"):
        message = f"there is no drag with vary={vary!r} and on_conflict={on_conflict!r}"
        raise fault((), message, "vary: points or weights; on_conflict: error or least_squares")
    if vary == "weights" and not rational:
        hint = "say `volume: nurbs`, or `volume: tspline` on an octree"
        raise fault(("vary",), "this volume has no weights", hint)
    if vary == "weights" and on_conflict == "least_squares":
        message = "least squares needs `vary: points`: weights meet all targets or none"
        raise fault(("on_conflict",), message, None)
    holds: tuple[Hold, ...] = (
        _parsed(Holds, options.hold, "hold", fault) if len(options.hold) else ()
    )
    pinned = _pinned(options.pin, volume, locked, places, fault)
    rigid = any(not isinstance(hold, HoldPoint) and hold.rigid for hold in holds)
    if rigid and vary == "weights":
        message = "weights cannot move a piece as a rigid body"
        raise fault(("hold",), message, "use `vary: points`")
    if rigid and options.level_cost != 1:
        message = "with a rigid piece all levels cost the same"
        raise fault(("level_cost",), message, "remove it, or leave `rigid` out")
    request = _request(
        volume, points, table, holds, pinned, groups, lambda q: ("sources", q), fault
    )
    cost = level_costs(volume, options.level_cost)
    request = replace(request, vary=vary, on_conflict=on_conflict, cost=cost)
    return _run(volume, points, weights, request)


def checked_pairs(sources: Any, targets: Any, by: bool, source: Source) -> PairTable:
    """Pairs given from Python.

    Raises
    ------
    LatticeError
        They are not two arrays (m, 3) of finite numbers.
    """
    try:
        first = np.asarray(sources, dtype=np.float64).reshape(-1, 3)
        second = np.asarray(targets, dtype=np.float64).reshape(-1, 3)
    except (ValueError, TypeError):
        first, second = np.empty((0, 3)), np.empty((0, 3))
    good = len(first) == len(second) > 0
    if not good or not np.isfinite(first).all() or not np.isfinite(second).all():
        message = "a drag takes as many targets as sources, (m, 3) finite numbers each"
        raise LatticeError(message, file=source.name)
    return PairTable(first, second, np.full(len(first), by))


def level_costs(volume: LatticeMap, factor: float) -> Floats | None:
    """(...) what moves count by where each finer level counts ``factor`` times more."""
    if factor == 1:
        return None
    return np.asarray(factor ** volume.levels.astype(np.float64))


def _run(volume: LatticeMap, points: Floats, weights: Floats, request: Request) -> Dragged:
    if volume.needs_fit and request.vary == "weights":
        message = "weights cannot be dragged with `embedding: inverse`"
        raise request.fault(None, message, "use `vary: points`, or `embedding: displacement`")
    with np.errstate(over="ignore", invalid="ignore"):
        if volume.net_kind.displaces:
            done = _run_by_moves(volume, points, weights, request)
        else:
            done = drag(volume, points, weights, request)
    return replace(done, warnings=(*request.held.warnings, *done.warnings))


def _run_by_moves(volume: LatticeMap, points: Floats, weights: Floats, request: Request) -> Dragged:
    """The same where control points displace places: everything counts from where it is now.

    With weights, images move by what the quotient of the control points, as they are, moves by.
    """
    before = volume.with_control(points, weights).evaluate(request.sources)
    goals = np.where(request.by[:, None], request.goals, request.goals - before)
    moves = replace(request, goals=goals, by=np.ones(len(goals), dtype=bool))
    done = drag(volume, points, weights, moves)
    succession = done.succession and replace(done.succession, images=before)
    return replace(done, succession=succession)


def _request(
    volume: LatticeMap,
    points: Floats,
    table: PairTable,
    holds: Sequence[Hold],
    pinned: Bools,
    groups: Groups | None,
    pair_path: Callable[[int], KeyPath],
    fault: PlaceFault,
) -> Request:
    """The drag in the lattice frame, held points as constraints of their own."""
    held = Held(np.zeros(volume.shape, dtype=bool))
    still: list[int] = []
    sources, goals, by = table.sources, table.goals, table.by
    count = len(sources)
    if holds:
        held = resolve_holds(
            holds,
            volume,
            points,
            pinned,
            groups,
            lambda number, message, hint: fault(("hold", number), message, hint),
        )
        still = [n for n, hold in enumerate(holds) if isinstance(hold, HoldPoint)]
        places = [hold.point for hold in holds if isinstance(hold, HoldPoint)]
        sources = np.concatenate([sources, np.array(places).reshape(-1, 3)])
        goals = np.concatenate([goals, np.zeros((len(still), 3))])
        by = np.concatenate([by, np.ones(len(still), dtype=bool)])

    def path(q: int) -> KeyPath:
        return pair_path(q) if q < count else ("hold", still[q - count])

    def label(q: int) -> str:
        here = path(q)
        return key_text(here) if len(here) > 1 else f"pair {q + 1}"

    frame = volume.frame
    _require_parameters(volume, sources, holds, path, fault)
    vectors = goals if frame.aligned else goals @ frame.axes.T
    return Request(
        sources=frame.to_local(sources),
        goals=np.where(by[:, None], vectors, frame.to_local(goals)),
        by=by,
        pinned=pinned,
        held=held,
        vary="points",
        on_conflict="error",
        cost=None,
        label=label,
        fault=lambda q, message, hint: fault(() if q is None else path(q), message, hint),
    )


def _require_parameters(
    volume: LatticeMap,
    sources: Floats,
    holds: Sequence[Hold],
    path: Callable[[int], KeyPath],
    fault: PlaceFault,
) -> None:
    """Reject points without parameters, and holds that parameters other than places rule out."""
    for number, hold in enumerate(holds):
        if volume.needs_fit and not isinstance(hold, HoldPoint):
            message = "boxes and groups cannot be held with `embedding: inverse`"
            raise fault(("hold", number), message, "hold points, or say `embedding: displacement`")
    lost = ~volume.has_parameters(volume.frame.to_local(sources))
    if lost.any():
        message = "the point has no parameters in the volume at rest"
        raise fault(path(int(np.argmax(lost))), message, "choose points of the mesh")


def _pinned(
    pin: Bools | Sequence[Any] | None,
    volume: LatticeMap,
    locked: Bools,
    places: Callable[[], Floats],
    fault: PlaceFault,
) -> Bools:
    if pin is None or len(pin) == 0:
        return locked
    if isinstance(pin, np.ndarray):
        if pin.shape != locked.shape or pin.dtype != bool:
            raise fault(("pin",), f"must be {locked.shape} booleans, or selectors", None)
        return locked | pin
    rest = places()
    chosen = locked.copy()
    for number, selector in enumerate(_parsed(Pins, pin, "pin", fault)):
        for path, message, hint in selector_problems(rest.shape[:-1], selector, ("pin", number)):
            raise fault(path, message, hint)
        found = select(selector, rest, volume)
        if not found.any():
            raise fault(("pin", number), "selects no control point", None)
        chosen |= found
    return chosen


def _parsed(model: Any, value: Sequence[Any], key: str, fault: PlaceFault) -> Any:
    try:
        return TypeAdapter(model).validate_python(list(value))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = tuple(part for part in first["loc"] if isinstance(part, int))[:1]
        raise fault((key, *place), f"is not as in a lattice file: {first['msg']}", None) from None
