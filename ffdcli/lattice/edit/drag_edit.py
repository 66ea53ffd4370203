"""Drags in model coordinates, by a lattice file or from Python, solved in the lattice frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ffdcli.arrays import Bools, Floats
from ffdcli.errors import LatticeError
from ffdcli.lattice.box_lattice import BoxLattice
from ffdcli.lattice.drag.holds import resolve_holds
from ffdcli.lattice.drag.solutions import Dragged, Request, drag
from ffdcli.lattice.edit.site import EditSite, choose, options_from_python
from ffdcli.lattice.file.check_edits import drag_problems
from ffdcli.lattice.file.definition import PairTable
from ffdcli.lattice.file.drag_models import Drag, DragOptions, HoldPoint
from ffdcli.lattice.file.source import KeyPath, Source
from ffdcli.volume.protocol import LatticeMap


def drag_by_file(lattice: BoxLattice, edit: Drag, site: EditSite) -> BoxLattice:
    """Apply a `drag` edit."""
    in_table = isinstance(edit.pairs, str)
    pairs = lattice.definition.pairs[site.number]
    done = solve_drag(
        lattice, pairs, edit, site.source, lambda q: ("pairs",) if in_table else ("pairs", q)
    )
    warnings = (f"edits[{site.number}].drag: {text}" for text in done.warnings)
    successions = {**lattice.successions}
    if done.succession is not None:
        successions[site.number] = done.succession
    return replace(
        lattice.with_points(done.points, done.weights),
        warnings=(*lattice.warnings, *warnings),
        successions=successions,
    )


def drag_by_python(lattice: BoxLattice, pairs: PairTable, options: Mapping[str, Any]) -> BoxLattice:
    """Apply a drag with the keyword arguments of :meth:`ffdcli.lattice.lattice.Lattice.drag`."""
    source, mask, checked = options_from_python(lattice, DragOptions, options)
    for path, message, hint in drag_problems(lattice.spec, checked, ()):
        raise source.error(path, message, hint)
    done = solve_drag(lattice, pairs, checked, source, lambda q: ("sources", q), mask)
    moved = lattice.with_points(done.points, done.weights)
    return replace(moved, warnings=(*lattice.warnings, *done.warnings))


def checked_pairs(
    sources: Any, targets: Any, by: bool, source: Source, weights: Any = None
) -> PairTable:
    """The pairs of a drag or a fit from Python.

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
        message = "a drag or fit takes as many targets as sources, (m, 3) finite numbers each"
        raise LatticeError(message, file=source.name)
    try:
        shares = np.ones(len(first)) if weights is None else np.asarray(weights, dtype=np.float64)
    except (ValueError, TypeError):
        shares = np.empty(0)
    if shares.shape != (len(first),) or not np.all((shares > 0) & (shares < np.inf)):
        message = f"weights here are ({len(first)},) finite numbers greater than 0"
        raise LatticeError(message, file=source.name)
    return PairTable(first, second, np.full(len(first), by), shares)


def solve_drag(
    lattice: BoxLattice,
    pairs: PairTable,
    options: DragOptions,
    source: Source,
    pair_key: Callable[[int], KeyPath],
    pinned: Bools | None = None,
) -> Dragged:
    """Work out control points or weights that take points of the object to their targets.

    Parameters
    ----------
    source : Source
        For messages; key paths count from the drag.
    pair_key : callable
        Key of a pair, by its number.
    pinned : (nu, nv, nw) bool, optional
        Control points that stay besides those of ``options.pin``.
    """
    volume, points, weights = lattice.map, lattice.points, lattice.weights
    fixed = ~lattice.free if pinned is None else ~lattice.free | pinned
    for number, selector in enumerate(options.pin):
        fixed = fixed | choose(lattice, selector, source, ("pin", number))
    request = _request(lattice, pairs, options, source, pair_key, fixed)
    with np.errstate(over="ignore", invalid="ignore"):
        if volume.net_kind.displaces:
            done = _drag_by_moves(volume, points, weights, request)
        else:
            done = drag(volume, points, weights, request)
    return replace(done, warnings=(*request.held.warnings, *done.warnings))


def _drag_by_moves(
    volume: LatticeMap, points: Floats, weights: Floats, request: Request
) -> Dragged:
    """The same where control points displace places: all goals as displacements from the images.

    With weights, an image moves by the quotient of the moves of the control points.
    """
    before = volume.evaluate(request.sources)
    goals = np.where(request.by[:, None], request.goals, request.goals - before)
    moves = replace(request, goals=goals, by=np.ones(len(goals), dtype=bool))
    done = drag(volume, points, weights, moves)
    succession = done.succession and replace(done.succession, images=before)
    return replace(done, succession=succession)


def _request(
    lattice: BoxLattice,
    pairs: PairTable,
    options: DragOptions,
    source: Source,
    pair_key: Callable[[int], KeyPath],
    pinned: Bools,
) -> Request:
    """The drag in the lattice frame; held points are constraints with no displacement."""
    volume = lattice.map
    held = resolve_holds(options.hold, volume, lattice.points, pinned, lattice.groups, source)
    count = len(pairs.sources)
    points = [(n, hold.point) for n, hold in enumerate(options.hold) if isinstance(hold, HoldPoint)]
    still = np.array([point for _, point in points]).reshape(-1, 3)
    sources = np.concatenate([pairs.sources, still])
    goals = np.concatenate([pairs.goals, np.zeros_like(still)])
    by = np.concatenate([pairs.by, np.ones(len(still), dtype=bool)])

    def path(q: int) -> KeyPath:
        return pair_key(q) if q < count else ("hold", points[q - count][0])

    frame = volume.frame
    local = frame.to_local(sources)
    lost = ~volume.has_parameters(local)
    if lost.any():
        message = "the point has no parameters in the volume at rest"
        raise source.error(path(int(np.argmax(lost))), message, "choose points of the mesh")
    factor = options.level_cost
    vectors = goals if frame.aligned else goals @ frame.axes.T
    return Request(
        sources=local,
        goals=np.where(by[:, None], vectors, frame.to_local(goals)),
        by=by,
        pinned=pinned,
        held=held,
        vary=options.vary,
        on_conflict=options.on_conflict,
        cost=None if factor == 1 else np.asarray(factor ** volume.levels.astype(np.float64)),
        path=path,
        source=source,
    )
