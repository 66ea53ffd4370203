"""Conditions that the keys of an edit must satisfy together, and with the rest of the lattice."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ffdcli.lattice.file import edit_models
from ffdcli.lattice.file.drag_models import (
    Drag,
    DragOptions,
    HoldGroup,
    HoldInside,
    HoldPoint,
    Pair,
)
from ffdcli.lattice.file.fit_models import Fit, FitOptions
from ffdcli.lattice.file.problems import AXES, Problem, interior_problems, selector_problems
from ffdcli.lattice.file.selectors import entry_indices
from ffdcli.lattice.file.source import KeyPath
from ffdcli.lattice.file.spec import LatticeSpec


def edit_problems(spec: LatticeSpec, edit: edit_models.Edit, path: KeyPath) -> Iterator[Problem]:
    """Problems of an edit of a lattice."""
    if edit.name in _CHECKS:
        yield from _CHECKS[edit.name](spec, edit.value, (*path, edit.name))


def _move(spec: LatticeSpec, move: edit_models.Move, path: KeyPath) -> Iterator[Problem]:
    if (move.by is None) == (move.to is None):
        message = "needs `by` or `to`" if move.by is None else "has both `by` and `to`"
        yield path, message, "give one of them"
    yield from selector_problems(_counts(spec), move.at, (*path, "at"))
    if move.to is not None and isinstance(move.at, tuple):
        chosen = [len(entry_indices(e, n)) for e, n in zip(move.at, spec.counts, strict=True)]
        count = int(np.prod(chosen))
        if count > 1:
            message = f"`to` places one control point, but `at` selects {count}"
            yield (*path, "to"), message, "select one, or use `by`"


def _transform(
    spec: LatticeSpec, transform: edit_models.Transform, path: KeyPath
) -> Iterator[Problem]:
    if transform.scale is None and transform.rotate is None and transform.translate is None:
        yield path, "does nothing", "give at least one of scale, rotate and translate"
    yield from selector_problems(_counts(spec), transform.at, (*path, "at"))


def _bend(_: LatticeSpec, bend: edit_models.Bend, path: KeyPath) -> Iterator[Problem]:
    if bend.axis == bend.toward:
        message = f"an axis cannot bend toward itself ({bend.axis})"
        yield (*path, "toward"), message, "name one of the other two axes"


def _move_knots(spec: LatticeSpec, edit: edit_models.MoveKnots, path: KeyPath) -> Iterator[Problem]:
    axis = AXES.index(edit.axis)
    yield from interior_problems(spec, axis, edit.values, (*path, "values"))


def _weight(spec: LatticeSpec, edit: edit_models.Weight, path: KeyPath) -> Iterator[Problem]:
    yield from _rational(spec, edit, path)
    yield from selector_problems(_counts(spec), edit.at, (*path, "at"))


def _weights(spec: LatticeSpec, weights: edit_models.Weights, path: KeyPath) -> Iterator[Problem]:
    yield from _rational(spec, weights, path)
    if not isinstance(weights, str):
        yield from _grid(spec, weights, "weights", path)
        yield from _positive(weights, path)


def _hammer(spec: LatticeSpec, hammer: edit_models.Hammer, path: KeyPath) -> Iterator[Problem]:
    if hammer.by == "weights":
        yield from _rational(spec, hammer, (*path, "by"))


def _counts(spec: LatticeSpec) -> tuple[int, ...] | None:
    return None if spec.adaptive else spec.counts


def _net(spec: LatticeSpec, net: edit_models.Net, path: KeyPath) -> Iterator[Problem]:
    if isinstance(net, edit_models.ShiftedNet):
        net, path = net.points, (*path, "points")
    if not isinstance(net, str):
        yield from _grid(spec, net, "control points", path)


def _grid(spec: LatticeSpec, layers: Any, what: str, path: KeyPath) -> Iterator[Problem]:
    """Problems of nested lists that differ from the shape of the lattice.

    The number of control points of an octree depends on the mesh, so here it is not checked.
    """
    # A control point is itself a list.
    depth = edit_models.list_depth(layers) - int(what == "control points")
    if depth != (1 if spec.adaptive else 3):
        hint = "give one entry per control point" if spec.adaptive else "nest lists along u, v, w"
        yield path, f"these {what} are not nested as those of the lattice", hint
        return
    if spec.adaptive:
        return
    nu, nv, nw = spec.counts
    hint = f"the lattice has {nu} × {nv} × {nw} control points"
    if len(layers) != nu:
        yield path, f"needs {nu} entries along u, not {len(layers)}", hint
    for i, layer in enumerate(layers):
        if len(layer) != nv:
            yield (*path, i), f"needs {nv} entries along v, not {len(layer)}", hint
        for j, row in enumerate(layer):
            if len(row) != nw:
                yield (*path, i, j), f"needs {nw} {what} along w, not {len(row)}", hint


def _positive(weights: Any, path: KeyPath) -> Iterator[Problem]:
    for index, value in enumerate(weights):
        here = (*path, index)
        if isinstance(value, tuple):
            yield from _positive(value, here)
        elif value <= 0:
            yield here, f"must be greater than 0, not {value:g}", "1 is the weight at rest"


def _rational(
    spec: LatticeSpec, _: Any, path: KeyPath, remedy: str = "remove this edit"
) -> Iterator[Problem]:
    if not spec.weighted:
        message = f"a {spec.volume} volume has no weights"
        other = "tspline" if spec.adaptive else "nurbs"
        yield path, message, f"say `volume: {other}`, or {remedy}"


def drag_problems(spec: LatticeSpec, drag: DragOptions, path: KeyPath) -> Iterator[Problem]:
    """Problems of the options of a drag."""
    for index, selector in enumerate(drag.pin):
        yield from selector_problems(_counts(spec), selector, (*path, "pin", index))
    for index, hold in enumerate(drag.hold):
        if not isinstance(hold, HoldPoint):
            yield from _held_part(spec, drag, hold, (*path, "hold", index))
    if drag.level_cost != 1 and spec.volume != "hierarchical":
        message = f"a {spec.volume} volume has no levels"
        yield (*path, "level_cost"), message, "remove it"
    elif drag.level_cost != 1 and any(getattr(hold, "rigid", False) for hold in drag.hold):
        message = "with a rigid part all levels must cost the same"
        yield (*path, "level_cost"), message, "remove it, or remove `rigid`"
    if drag.vary == "weights":
        yield from _rational(spec, drag, (*path, "vary"), "use `vary: points`")
        if spec.inverted:
            message = "weights cannot be dragged with `embedding: inverse`"
            hint = "use `vary: points`, or `embedding: displacement`"
            yield (*path, "vary"), message, hint
        if drag.on_conflict == "least_squares":
            message = "least squares needs `vary: points`: weights either meet all targets or fail"
            yield (*path, "on_conflict"), message, "remove it, or use `vary: points`"


def _held_part(
    spec: LatticeSpec, drag: DragOptions, hold: HoldInside | HoldGroup, path: KeyPath
) -> Iterator[Problem]:
    if isinstance(hold, HoldInside):
        yield from _corners(hold, path)
    if spec.inverted:
        message = "boxes and groups cannot be held with `embedding: inverse`"
        yield path, message, "hold points, or say `embedding: displacement`"
    if hold.rigid and drag.vary == "weights":
        message = "weights cannot move a part as a rigid body"
        yield (*path, "rigid"), message, "remove it, or use `vary: points`"
    if hold.rigid and spec.volume == "tspline":
        message = "a tspline volume cannot rotate a part rigidly: it has no linear precision"
        hint = "use `volume: hierarchical`, or remove `rigid`"
        yield (*path, "rigid"), message, hint


def _corners(hold: HoldInside, path: KeyPath) -> Iterator[Problem]:
    for axis in range(3):
        if hold.inside.min[axis] > hold.inside.max[axis]:
            yield (*path, "inside", "max", axis), "is below min", "swap them"


def _drag(spec: LatticeSpec, drag: Drag, path: KeyPath) -> Iterator[Problem]:
    yield from _pairs(drag.pairs, path)
    yield from drag_problems(spec, drag, path)


def _pairs(pairs: str | tuple[Pair, ...], path: KeyPath) -> Iterator[Problem]:
    for index, pair in enumerate(pairs if isinstance(pairs, tuple) else ()):
        if (pair.by is None) == (pair.to is None):
            message = "needs `to` or `by`" if pair.by is None else "has both `to` and `by`"
            yield (*path, "pairs", index), message, "give one of them"


def fit_problems(spec: LatticeSpec, fit: FitOptions, path: KeyPath) -> Iterator[Problem]:
    """Problems of the options of a fit."""
    if spec.volume == "tspline":
        message = "a tspline volume cannot be fitted: its functions are no polynomials"
        yield path, message, "say `volume: hierarchical`"
    if spec.volume == "hierarchical" and min(spec.degree) < 2:
        message = "a fit needs degree 2 or more here: bends of lower degrees have no energy"
        yield path, message, "raise `degree`"
    for index, selector in enumerate(fit.pin):
        yield from selector_problems(_counts(spec), selector, (*path, "pin", index))
    for index, hold in enumerate(fit.hold):
        here = (*path, "hold", index)
        if isinstance(hold, HoldInside):
            yield from _corners(hold, here)
        if getattr(hold, "rigid", False):
            message = "a fit cannot move a part as a rigid body"
            yield (*here, "rigid"), message, "remove it, or give pairs with that motion"


def _fit(spec: LatticeSpec, fit: Fit, path: KeyPath) -> Iterator[Problem]:
    if (fit.pairs is None) == (fit.target is None):
        message = (
            "needs `pairs` or a `target`" if fit.pairs is None else "has `pairs` and a `target`"
        )
        yield path, message, "give one of them"
    if fit.reach is not None and fit.target is None:
        yield (*path, "reach"), "is for a scan as `target`", "remove it"
    yield from _pairs(fit.pairs or (), path)
    if fit.scale == 0:
        yield (*path, "scale"), "must not be 0: nothing would move", "1 is the data as it is"
    if fit.unit is not None and spec.unit is None:
        message = "needs the unit of the lattice too"
        yield (*path, "unit"), message, "add the key `unit` to the lattice file"
    for key in ("field", "targets"):
        if getattr(fit, key) is not None and not isinstance(fit.pairs, str):
            yield (*path, key), "is for pairs in a mesh file", "remove it"
    yield from fit_problems(spec, fit, path)


# What checks each edit, by its key.
_CHECKS: dict[str, Callable[[LatticeSpec, Any, KeyPath], Iterator[Problem]]] = {
    "move": _move,
    "transform": _transform,
    "bend": _bend,
    "weight": _weight,
    "move_knots": _move_knots,
    "drag": _drag,
    "fit": _fit,
    "hammer": _hammer,
    "crimp": _rational,
    "net": _net,
    "weights": _weights,
}
