"""What several keys of a lattice file must satisfy together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffdcli.lattice.drag_models import Drag, HoldInside, HoldPoint
from ffdcli.lattice.edit_models import (
    Bend,
    BendEdit,
    CrimpEdit,
    DragEdit,
    HammerEdit,
    MoveEdit,
    MoveKnotsEdit,
    NetEdit,
    ShiftedNet,
    TransformEdit,
    WeightEdit,
    WeightsEdit,
)
from ffdcli.lattice.holds import NO_RIGID_TSPLINE
from ffdcli.lattice.models import Corners, Vector
from ffdcli.lattice.selector_models import Entry, Inside, Numbered, Selector
from ffdcli.lattice.selectors import entry_indices
from ffdcli.lattice.source import KeyPath, Source
from ffdcli.lattice.spec import LatticeSpec, OrientedBox

Floats = NDArray[np.float64]

MAX_DEGREE_SUM = 25
MAX_POINTS = 10_000_000
# Knots nearer than this share of the box cannot be told apart from a double knot.
CLOSEST_KNOTS = 1e-6
AXES = ("u", "v", "w")

# How far given axes may be from orthonormal: what writing them with ten decimals costs.
_AXES_TOLERANCE = 1e-9

# Edits that need no rows of control points.
_ON_OCTREE = (
    MoveEdit,
    TransformEdit,
    WeightEdit,
    DragEdit,
    HammerEdit,
    CrimpEdit,
    NetEdit,
    WeightsEdit,
)

Problem = tuple[KeyPath, str, str | None]


def check_spec(spec: LatticeSpec, source: Source) -> None:
    """Refuse a file whose keys do not fit together.

    Raises
    ------
    LatticeError
        The first problem, in the order degree, points, knots, box, edits.
    """
    for path, message, hint in _problems(spec):
        raise source.error(path, message, hint)


def nearest_axes(axes: tuple[Vector, Vector, Vector]) -> Floats:
    """The orthonormal axes (3, 3) nearest to given ones, by the polar decomposition."""
    left, _, right = np.linalg.svd(np.array(axes))
    return np.asarray(left @ right)


def _problems(spec: LatticeSpec) -> Iterator[Problem]:
    yield from _octree(spec) if spec.adaptive or spec.octree else _sizes(spec)
    for axis in range(3):
        if spec.knots is not None:
            yield from _interior(spec, axis, spec.knots[axis], ("knots", axis))
    yield from _box(spec)
    for index, edit in enumerate(spec.edits):
        path: KeyPath = ("edits", index)
        if spec.adaptive and not isinstance(edit, _ON_OCTREE):
            name = next(iter(type(edit).model_fields))
            message = f"`{name}` needs a lattice with rows of control points"
            yield (*path, name), message, "use move, transform or drag, or `volume: bspline`"
            return
        if isinstance(edit, MoveEdit):
            yield from _move(spec, edit, (*path, "move"))
        elif isinstance(edit, TransformEdit):
            yield from _transform(spec, edit, (*path, "transform"))
        elif isinstance(edit, BendEdit):
            yield from _bend(edit.bend, (*path, "bend"))
        elif isinstance(edit, MoveKnotsEdit):
            axis = AXES.index(edit.move_knots.axis)
            yield from _interior(
                spec, axis, edit.move_knots.values, (*path, "move_knots", "values")
            )
        elif isinstance(edit, NetEdit):
            yield from _net(spec, edit, (*path, "net"))
        elif isinstance(edit, WeightEdit):
            yield from _rational(spec, (*path, "weight"))
            yield from selector_problems(_counts(spec), edit.weight.at, (*path, "weight", "at"))
        elif isinstance(edit, WeightsEdit):
            yield from _rational(spec, (*path, "weights"))
            if not isinstance(edit.weights, str):
                yield from _grid(spec, edit.weights, "weights", (*path, "weights"))
                yield from _positive(edit.weights, (*path, "weights"))
        elif isinstance(edit, CrimpEdit):
            yield from _rational(spec, (*path, "crimp"))
        elif isinstance(edit, DragEdit):
            yield from _drag(spec, edit.drag, (*path, "drag"))


def _octree(spec: LatticeSpec) -> Iterator[Problem]:
    if not spec.adaptive:
        message = f"a {spec.volume} volume has no octree"
        yield ("octree",), message, "say `volume: tspline` or `volume: hierarchical`"
        return
    if spec.octree is None:
        message = f"a {spec.volume} volume needs an octree"
        yield ("volume",), message, "add `octree: {depth: 4}`"
        return
    for key in ("points", "knots", "ends", "border"):
        if key in spec.model_fields_set:
            message = f"a {spec.volume} volume takes its control points from `octree`"
            yield (key,), message, "remove this key"
    total = sum(spec.degree)
    if spec.volume == "tspline" and spec.degree != (3, 3, 3):
        yield ("degree",), "a tspline volume is cubic", "remove this key"
    elif total > MAX_DEGREE_SUM:
        message = f"the degrees add up to {total}, and CAD kernels stop at {MAX_DEGREE_SUM}"
        yield ("degree",), message, f"lower them to at most {MAX_DEGREE_SUM} together"
    if spec.octree.embedding == "inverse" and spec.volume != "tspline":
        message = f"a {spec.volume} volume is the identity at rest: there is nothing to invert"
        yield ("octree", "embedding"), message, "remove this key, or say `volume: tspline`"
    if spec.octree.region != "auto" and spec.box != "auto":
        message = f"`region: {spec.octree.region}` finds a box of its own, but `box` gives one"
        yield ("octree", "region"), message, "remove one of the two"
    if spec.octree.cells is not None:
        if spec.volume != "tspline":
            message = "cells of a file make a T-lattice, but this volume has levels"
            yield ("octree", "cells"), message, "say `volume: tspline`, or use `depth` and `also`"
        for key in ("depth", "also"):
            if key in spec.octree.model_fields_set:
                message = "`cells` says how the box is divided"
                yield ("octree", key), message, "remove one of the two"
    for index, part in enumerate(spec.octree.also):
        for axis in range(3):
            if not part.min[axis] < part.max[axis]:
                path: KeyPath = ("octree", "also", index, "max", axis)
                yield path, "must be greater than min", "swap them"


def _sizes(spec: LatticeSpec) -> Iterator[Problem]:
    total = sum(spec.degree)
    if total > MAX_DEGREE_SUM:
        yield (
            ("degree",),
            f"the degrees add up to {total}; an edge would get that degree, and CAD kernels stop "
            f"at {MAX_DEGREE_SUM}",
            f"lower them to at most {MAX_DEGREE_SUM} together",
        )
    for axis, (count, degree) in enumerate(zip(spec.counts, spec.degree, strict=True)):
        if count <= degree:
            yield (
                ("points", axis),
                f"degree {degree} along {AXES[axis]} needs at least {degree + 1} control points, "
                f"not {count}",
                "raise `points` or lower `degree`",
            )
    if int(np.prod(spec.counts, dtype=object)) > MAX_POINTS:
        yield (
            ("points",),
            f"this lattice has more than {MAX_POINTS:,} control points",
            "use fewer; 4 to 20 along an axis are usual",
        )


def _interior(
    spec: LatticeSpec, axis: int, values: tuple[float, ...], path: KeyPath
) -> Iterator[Problem]:
    degree, name = spec.degree[axis], AXES[axis]
    needed = spec.counts[axis] - degree - 1
    if len(values) != needed:
        yield (
            path,
            f"{spec.counts[axis]} control points of degree {degree} along {name} have {needed} "
            f"interior knots, not {len(values)}",
            f"give {needed}" if needed else "give an empty list []",
        )
        return
    for index, value in enumerate(values):
        here = (*path, index)
        if not 0 < value < 1:
            hint = "interior knots are fractions of the box"
            yield here, f"must be between 0 and 1, both excluded, not {value:g}", hint
        if index and value < values[index - 1]:
            hint = "write the knots in rising order"
            yield here, f"is lower than the knot before it ({values[index - 1]:g})", hint
        if index and 0 < value - values[index - 1] < CLOSEST_KNOTS:
            hint = "write the same number twice for a sharper bend, or move them apart"
            yield here, f"is nearer than {CLOSEST_KNOTS:g} to the knot before it", hint
        if values.count(value) > degree:
            yield (
                here,
                f"occurs {values.count(value)} times; more than the degree ({degree}) would tear "
                "the volume",
                "repeat it less often",
            )


def _box(spec: LatticeSpec) -> Iterator[Problem]:
    if isinstance(spec.box, Corners):
        for axis in range(3):
            low, high = spec.box.min[axis], spec.box.max[axis]
            if not low < high:
                yield (
                    ("box", "max", axis),
                    f"must be greater than min, but {high:g} is not above {low:g}",
                    "swap them, or give the box a thickness",
                )
    if isinstance(spec.box, OrientedBox):
        for axis, length in enumerate(spec.box.size):
            if length <= 0:
                yield ("box", "size", axis), f"must be greater than 0, not {length:g}", None
        if spec.box.axes is not None:
            yield from _axes(spec.box.axes)


def _axes(given: tuple[Vector, Vector, Vector]) -> Iterator[Problem]:
    axes = np.array(given)
    path: KeyPath = ("box", "axes")
    if np.linalg.matrix_rank(axes) < 3:
        yield path, "the axes do not span space", "give three perpendicular unit vectors"
        return
    nearest = nearest_axes(given)
    written = [[float(number) for number in row] for row in nearest]
    if float(np.abs(axes @ axes.T - np.eye(3)).max()) > _AXES_TOLERANCE:
        yield (
            path,
            "must be perpendicular unit vectors to nine decimals",
            f"the nearest such axes are {written}",
        )
    elif np.linalg.det(axes) < 0:
        hint = "swap two rows or turn one round"
        yield path, "are left-handed; w must be u × v, not its opposite", hint


def _move(spec: LatticeSpec, edit: MoveEdit, path: KeyPath) -> Iterator[Problem]:
    move = edit.move
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


def _transform(spec: LatticeSpec, edit: TransformEdit, path: KeyPath) -> Iterator[Problem]:
    transform = edit.transform
    if transform.scale is None and transform.rotate is None and transform.translate is None:
        yield path, "does nothing", "give at least one of scale, rotate and translate"
    yield from selector_problems(_counts(spec), transform.at, (*path, "at"))


def _bend(bend: Bend, path: KeyPath) -> Iterator[Problem]:
    if bend.axis == bend.toward:
        message = f"an axis cannot bend toward itself ({bend.axis})"
        yield (*path, "toward"), message, "name one of the other two axes"


def selector_problems(
    counts: tuple[int, ...] | None, at: Selector, path: KeyPath
) -> Iterator[Problem]:
    """What is wrong with a selector for a lattice of so many control points along each axis.

    One count is that of an octree's control points, None stands for one not yet known.
    """
    rows = counts is not None and len(counts) == 3
    if rows and not isinstance(at, tuple):
        given = {"level": at.level is not None, "hidden": at.hidden}
        given["index"] = isinstance(at, Numbered)
        for key in (key for key, present in given.items() if present):
            message = "control points in rows have no such thing"
            yield (*path, key), message, "use it with `volume: tspline` or `hierarchical`"
    if not rows and isinstance(at, tuple):
        hint = "use {index: n}, {inside: {min, max}} or {near: [x, y, z]}"
        yield path, "control points of an octree have no rows", hint
    elif isinstance(at, Numbered):
        if counts is not None and not rows:
            yield from _entry(at.index, counts[0], None, (*path, "index"))
    elif isinstance(at, tuple):
        assert counts is not None
        for axis, (entry, count) in enumerate(zip(at, counts, strict=True)):
            yield from _entry(entry, count, axis, (*path, axis))
    elif isinstance(at, Inside):
        for axis in range(3):
            if at.inside.min[axis] > at.inside.max[axis]:
                yield (*path, "inside", "max", axis), "is below min", "swap them"


def _counts(spec: LatticeSpec) -> tuple[int, ...] | None:
    return None if spec.adaptive else spec.counts


def _entry(entry: Entry, count: int, axis: int | None, path: KeyPath) -> Iterator[Problem]:
    along = "" if axis is None else f" along {AXES[axis]}"
    span = f"0 to {count - 1}, or -{count} to -1 from the end"
    numbers = entry if isinstance(entry, tuple) else (entry,) if isinstance(entry, int) else ()
    for place, number in enumerate(numbers):
        if not -count <= number < count:
            here = (*path, place) if isinstance(entry, tuple) else path
            message = f"index {number} is out of range: there are {count}{along}"
            yield here, message, f"use {span}"
    if isinstance(entry, str) and len(entry_indices(entry, count)) == 0:
        message = f'the slice "{entry}" holds none of the {count}{along}'
        yield path, message, "stop is excluded"


def _net(spec: LatticeSpec, edit: NetEdit, path: KeyPath) -> Iterator[Problem]:
    net, here = edit.net, path
    if isinstance(net, ShiftedNet):
        net, here = net.points, (*path, "points")
    if isinstance(net, str):
        return
    yield from _grid(spec, net, "control points", here)


def _grid(spec: LatticeSpec, layers: Any, what: str, path: KeyPath) -> Iterator[Problem]:
    """Nested lists must have the shape of the lattice; on an octree a row of unknown length."""
    nested = isinstance(layers[0], Sequence) and isinstance(layers[0][0], Sequence)
    if what == "control points":
        nested = nested and isinstance(layers[0][0][0], Sequence)
    if spec.adaptive or not nested:
        if spec.adaptive == nested:
            hint = "give one entry per control point" if spec.adaptive else "nest them: u, v, w"
            yield path, f"these {what} are nested otherwise than the lattice's", hint
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


def _rational(spec: LatticeSpec, path: KeyPath) -> Iterator[Problem]:
    if not spec.weighted:
        message = f"a {spec.volume} volume has no weights"
        other = "tspline" if spec.adaptive else "nurbs"
        yield path, message, f"say `volume: {other}`, or remove this edit"


def _drag_on_octree(spec: LatticeSpec, drag: Drag, path: KeyPath) -> Iterator[Problem]:
    for index, hold in enumerate(drag.hold):
        if isinstance(hold, HoldPoint) or not hold.rigid:
            continue
        if spec.volume == "tspline":
            yield (*path, "hold", index, "rigid"), *NO_RIGID_TSPLINE
        if drag.level_cost != 1:
            message = "with a rigid piece all levels cost the same"
            yield (*path, "level_cost"), message, "remove it, or leave `rigid` out"


def _drag(spec: LatticeSpec, drag: Drag, path: KeyPath) -> Iterator[Problem]:
    for index, pair in enumerate(drag.pairs if isinstance(drag.pairs, tuple) else ()):
        if (pair.by is None) == (pair.to is None):
            message = "needs `to` or `by`" if pair.by is None else "has both `to` and `by`"
            yield (*path, "pairs", index), message, "give one of them"
    for index, selector in enumerate(drag.pin):
        yield from selector_problems(_counts(spec), selector, (*path, "pin", index))
    for index, hold in enumerate(drag.hold):
        here: KeyPath = (*path, "hold", index)
        if isinstance(hold, HoldInside):
            for axis in range(3):
                if hold.inside.min[axis] > hold.inside.max[axis]:
                    yield (*here, "inside", "max", axis), "is below min", "swap them"
        if drag.vary == "weights" and not isinstance(hold, HoldPoint) and hold.rigid:
            message = "weights cannot move a piece as a rigid body"
            yield (*here, "rigid"), message, "remove it, or use `vary: points`"
    if drag.level_cost != 1 and spec.volume != "hierarchical":
        message = f"a {spec.volume} volume has no levels to weigh against each other"
        yield (*path, "level_cost"), message, "remove it"
    if spec.adaptive:
        yield from _drag_on_octree(spec, drag, path)
    if drag.vary == "weights":
        yield from _rational(spec, (*path, "vary"))
        if drag.on_conflict == "least_squares":
            message = "least squares needs `vary: points`: weights meet all targets or none"
            yield (*path, "on_conflict"), message, "remove it, or use `vary: points`"
