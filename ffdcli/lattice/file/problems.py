"""Checks of interior knots and of selectors, which several keys of a lattice file have."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from ffdcli.lattice.file.selectors import Entry, Inside, Numbered, Selector, entry_indices
from ffdcli.lattice.file.source import KeyPath
from ffdcli.lattice.file.spec import LatticeSpec

AXES = ("u", "v", "w")
# Knots closer than this fraction of the box count as an inaccurate double knot.
CLOSEST_KNOTS = 1e-6

# Key, message, hint.
Problem = tuple[KeyPath, str, str | None]


def interior_problems(
    spec: LatticeSpec, axis: int, values: tuple[float, ...], path: KeyPath
) -> Iterator[Problem]:
    """Problems of interior knots along an axis."""
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
    times = Counter(values)
    for index, value in enumerate(values):
        here = (*path, index)
        if not 0 < value < 1:
            hint = "interior knots are fractions of the box"
            yield here, f"must be between 0 and 1, both excluded, not {value:g}", hint
        if index and value < values[index - 1]:
            hint = "write the knots in ascending order"
            yield here, f"is lower than the knot before it ({values[index - 1]:g})", hint
        if index and 0 < value - values[index - 1] < CLOSEST_KNOTS:
            hint = "write the same number twice for a double knot, or move them apart"
            yield here, f"is nearer than {CLOSEST_KNOTS:g} to the knot before it", hint
        if times[value] > degree:
            yield (
                here,
                f"occurs {times[value]} times; more than the degree ({degree}) makes the "
                "deformation discontinuous",
                "repeat it less often",
            )


def selector_problems(
    counts: tuple[int, ...] | None, at: Selector, path: KeyPath
) -> Iterator[Problem]:
    """Problems of a selector.

    ``counts`` are the numbers of control points along u, v and w, or a single number for an
    octree; None where the number is not known without a mesh.
    """
    rows = counts is not None and len(counts) == 3
    if rows and not isinstance(at, tuple):
        given = {"level": at.level is not None, "hidden": at.hidden}
        given["index"] = isinstance(at, Numbered)
        for key in (key for key, present in given.items() if present):
            message = f"control points in rows have no `{key}`"
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
        message = f'the slice "{entry}" selects none of the {count}{along}'
        yield path, message, "the index after the colon is excluded"
