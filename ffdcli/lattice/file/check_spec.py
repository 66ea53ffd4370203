"""Conditions that several keys of a lattice file must satisfy together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ffdcli.arrays import Floats
from ffdcli.lattice.file.check_edits import edit_problems
from ffdcli.lattice.file.model_base import Corners, Vector
from ffdcli.lattice.file.problems import AXES, Problem, interior_problems
from ffdcli.lattice.file.source import KeyPath, Source
from ffdcli.lattice.file.spec import LatticeSpec, OctreeSpec, OrientedBox

MAX_DEGREE_SUM = 25
MAX_POINTS = 10_000_000

# Largest deviation of given axes from orthonormal, as rounding to ten decimals causes.
_AXES_TOLERANCE = 1e-9

# Edits that only control points in rows can have.
NEED_ROWS = ("twist", "taper", "bend", "move_knots")


def check_spec(spec: LatticeSpec, source: Source) -> None:
    """Reject a model whose keys contradict each other.

    Raises
    ------
    LatticeError
        The first problem, in the order degree, points, knots, box, edits.
    """
    for path, message, hint in _problems(spec):
        raise source.error(path, message, hint)


def nearest_axes(axes: tuple[Vector, Vector, Vector]) -> Floats:
    """Orthonormal axes (3, 3) nearest to given ones, by polar decomposition."""
    left, _, right = np.linalg.svd(np.array(axes))
    return np.asarray(left @ right)


def _problems(spec: LatticeSpec) -> Iterator[Problem]:
    yield from _octree(spec) if spec.adaptive or spec.octree else _sizes(spec)
    for axis in range(3):
        if spec.knots is not None:
            yield from interior_problems(spec, axis, spec.knots[axis], ("knots", axis))
    yield from _box(spec)
    for index, edit in enumerate(spec.edits):
        path: KeyPath = ("edits", index)
        if spec.adaptive and edit.name in NEED_ROWS:
            message = f"`{edit.name}` needs control points in rows, which an octree has not"
            yield (*path, edit.name), message, "use move, transform or drag, or `volume: bspline`"
            return
        yield from edit_problems(spec, edit, path)


def _octree(spec: LatticeSpec) -> Iterator[Problem]:
    if not spec.adaptive:
        message = f"a {spec.volume} volume has no octree"
        yield ("octree",), message, "say `volume: tspline` or `volume: hierarchical`"
        return
    if spec.octree is None:
        message = f"a {spec.volume} volume needs an octree"
        yield ("volume",), message, "add `octree: {depth: 4}`"
        return
    # A hierarchical volume fades out beyond its box; a tspline joins with c2 anyway.
    for key in ("points", "knots", "ends", *["border"] * (spec.volume == "hierarchical")):
        if key in spec.model_fields_set:
            message = f"the control points of a {spec.volume} volume come from `octree`"
            yield (key,), message, "remove this key"
    if spec.volume == "tspline" and spec.degree != (3, 3, 3):
        yield ("degree",), "a tspline volume is cubic", "remove this key"
    yield from _degrees(spec)
    if spec.octree.embedding == "inverse" and spec.volume != "tspline":
        message = f"a {spec.volume} volume is the identity at rest and needs no inverse"
        yield ("octree", "embedding"), message, "remove this key, or say `volume: tspline`"
    if spec.octree.region != "auto" and spec.box != "auto":
        message = f"`region: {spec.octree.region}` computes the box, but `box` gives one"
        yield ("octree", "region"), message, "remove one of the two"
    yield from _automatic(spec, spec.octree)
    if spec.octree.cells is not None:
        if spec.volume != "tspline":
            message = "cells from a file make a T-lattice, but a hierarchical volume has levels"
            yield ("octree", "cells"), message, "say `volume: tspline`, or use `depth` and `also`"
        for key in ("depth", "also", "balance"):
            if key in spec.octree.model_fields_set:
                message = "`cells` already divides the box"
                yield ("octree", key), message, "remove one of the two"
    for index, part in enumerate(spec.octree.also):
        for axis in range(3):
            if not part.min[axis] < part.max[axis]:
                path: KeyPath = ("octree", "also", index, "max", axis)
                yield path, "must be greater than min", "swap them"


def _automatic(spec: LatticeSpec, octree: OctreeSpec) -> Iterator[Problem]:
    """Problems of an octree that a fit divides."""
    if octree.depth != "auto":
        for key in ("max_depth", "max_points"):
            if key in octree.model_fields_set:
                hint = f"say `depth: auto`, or remove `{key}`"
                yield ("octree", key), "limits an octree that a fit divides", hint
        return
    if spec.volume != "hierarchical":
        message = f"a fit divides no {spec.volume} volume"
        yield ("octree", "depth"), message, "say `volume: hierarchical`, or give a number"
    elif not spec.edits or spec.edits[0].name != "fit":
        message = "needs a `fit` as the first of the edits, which divides the cells"
        yield ("octree", "depth"), message, "give a number, or begin the edits with a `fit`"
    for key in ("balance", "refine"):
        if key in octree.model_fields_set and getattr(octree, key) not in (True, "surface"):
            message = "an octree that a fit divides follows the field, and is balanced"
            yield ("octree", key), message, "remove this key"


def _degrees(spec: LatticeSpec) -> Iterator[Problem]:
    total = sum(spec.degree)
    if total > MAX_DEGREE_SUM:
        yield (
            ("degree",),
            f"the degrees add up to {total}; edges would have this degree, and CAD kernels allow "
            f"at most {MAX_DEGREE_SUM}",
            f"lower them to at most {MAX_DEGREE_SUM} together",
        )


def _sizes(spec: LatticeSpec) -> Iterator[Problem]:
    yield from _degrees(spec)
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
        yield path, "the axes are linearly dependent", "give three perpendicular unit vectors"
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
        hint = "swap two rows, or negate one"
        yield path, "are left-handed; w must be u × v, not its opposite", hint
