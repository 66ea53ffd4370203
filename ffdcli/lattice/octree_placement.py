"""Octrees and T-lattices of tspline and hierarchical lattices, placed and refined for a mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ffdcli.arrays import Bools, Floats, Ints
from ffdcli.lattice.file.cells import PATH
from ffdcli.lattice.file.definition import Definition
from ffdcli.lattice.file.source import KeyPath, Source
from ffdcli.lattice.file.spec import OctreeSpec
from ffdcli.lattice.layout import Layout, automatic_box
from ffdcli.messages import place_text
from ffdcli.volume.adaptive.hierarchical import hierarchical_volume
from ffdcli.volume.adaptive.inverse_map import AnyMap, InverseMap
from ffdcli.volume.adaptive.octree import Cells, ModelTree, Octree
from ffdcli.volume.adaptive.octree_growth import MAX_CELLS, Region, TooManyCells, grow
from ffdcli.volume.adaptive.parameters import Preimages
from ffdcli.volume.adaptive.polynomial_cells import TooManyPieces
from ffdcli.volume.adaptive.tspline import MAX_PIECES, thin_place, tspline_volume
from ffdcli.volume.adaptive.volume import AdaptiveVolume
from ffdcli.volume.frame import Frame


def oriented_layout(definition: Definition, points: Floats, axes: Floats, delta: float) -> Layout:
    """The box round points (m, 3) along unit axes (3, 3), for `region: oriented` or `minimum`.

    ``delta`` is as for :func:`ffdcli.lattice.layout.automatic_corners`.
    """
    local = points @ axes.T
    bounds = np.stack([local.min(axis=0), local.max(axis=0)])
    corners = automatic_box(definition, bounds, delta)
    half = (corners[1] - corners[0]) / 2
    box = np.stack([-half, half])
    frame = Frame(corners.mean(axis=0) @ axes, axes)
    return Layout(frame, box, box, np.zeros(3))


def principal_axes(triangles: Floats) -> Floats:
    """Right-handed principal axes (3, 3) of a surface (T, 3, 3), the longest extent first."""
    sides = triangles[:, 1:] - triangles[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    share = area / area.sum() if area.sum() > 0 else np.full(len(area), 1 / len(area))
    middle = np.einsum("t,tpi->i", share, triangles) / 3
    arms = triangles - middle
    # Mean of x x^T over each triangle, from its corners and its centre.
    centre = arms.mean(axis=1)
    spread = np.einsum("t,tpi,tpj->ij", share, arms, arms) / 12
    spread += 0.75 * np.einsum("t,ti,tj->ij", share, centre, centre)
    axes = np.linalg.eigh(spread)[1].T[::-1]
    # The largest component of each axis is positive; the last axis makes them right-handed.
    axes = axes * np.sign(axes[np.arange(3), np.abs(axes).argmax(axis=1)])[:, None]
    axes[2] = np.cross(axes[0], axes[1])
    return np.asarray(axes)


def octree_at_rest(
    definition: Definition, layout: Layout, triangles: Floats, divided: Sequence[Ints] = ()
) -> tuple[AnyMap, ModelTree[Cells]]:
    """The map at rest on an octree refined round a mesh or on given cells, and these cells.

    ``triangles`` (T, 3, 3) are those of the mesh in the lattice frame; ``divided`` are codes of
    cells that are divided in any case, per level.

    Raises
    ------
    LatticeError
        A box of `also` lies outside the octree, the octree has too many cells, or a cell is
        reached by too few control points.
    """
    spec = definition.spec
    assert spec.octree is not None
    share = (triangles - layout.box[0]) / (layout.box[1] - layout.box[0])
    cells: ModelTree[Cells]
    if definition.cells is not None:
        surface = spec.octree.refine == "surface"
        points = share.reshape(-1, 3)
        full = definition.cells.touching_triangles if surface else definition.cells.holding_points
        cells = ModelTree(definition.cells, full(share if surface else points))
    else:
        model = _grown(definition, spec.octree, layout, share, divided)
        cells = ModelTree(model.tree, model.full)
        if spec.volume == "hierarchical":
            return hierarchical_volume(model.tree, layout.box, spec.degree, layout.frame), cells
    try:
        volume = tspline_volume(cells, layout.box, spec.octree.weights, layout.frame)
    except TooManyPieces as many:
        message = (
            f"the functions of the cells in `{spec.octree.cells}` have {many.least:,} or more "
        )
        message += f"polynomial pieces, which halving finds; {MAX_PIECES:,} are allowed"
        hint = "use fewer cells or units, or cells that halving the box gives"
        raise definition.source.error(PATH, message, hint) from None
    # In a balanced octree functions reach every place; elsewhere that depends on the cells.
    if definition.cells is not None or not spec.octree.balance:
        _require_positive_sum(definition, spec.octree, volume)
    return InverseMap.of(volume) if spec.inverted else volume, cells


def _grown(
    definition: Definition,
    octree: OctreeSpec,
    layout: Layout,
    share: Floats,
    divided: Sequence[Ints],
) -> ModelTree[Octree]:
    """The octree refined round a mesh, whose triangles (T, 3, 3) are fractions of the box."""
    regions = []
    for number, part in enumerate(octree.also):
        corners = np.array([part.min, part.max]) - layout.written_origin
        low, high = (corners - layout.box[0]) / (layout.box[1] - layout.box[0])
        if np.any(high <= 0) or np.any(low >= 1):
            box = layout.written_box.tolist()
            message = "this part lies outside the lattice box"
            hint = f"the box goes from {box[0]} to {box[1]}"
            raise definition.source.error(("octree", "also", number), message, hint)
        regions.append(Region(low, high, part.depth))
    surface = octree.refine == "surface"
    try:
        return grow(
            share if surface else None,
            None if surface else share.reshape(-1, 3),
            0 if octree.depth == "auto" else octree.depth,
            regions,
            octree.balance,
            divided,
        )
    except TooManyCells as many:
        message = f"this octree would have at least {many.least:,} cells; {MAX_CELLS:,} are allowed"
        hint = "choose a smaller `depth`, or smaller boxes of `also`"
        path: KeyPath = ("octree", "depth")
        if many.region is not None:
            path, hint = (
                ("octree", "also", many.region),
                "make this box smaller, or lower its depth",
            )
        raise definition.source.error(path, message, hint) from None


def _require_positive_sum(
    definition: Definition, octree: OctreeSpec, volume: AdaptiveVolume
) -> None:
    """Reject a T-spline whose weighted functions may add up to nothing at some place."""
    thin = thin_place(volume)
    if thin is None:
        return
    need = "the functions of a T-spline must add up to more than 0 everywhere"
    if octree.cells is None:
        low, high = volume.frame.to_model(thin)
        where = f"the place from {place_text(low)} to {place_text(high)}"
        message = f"without balance too few control points reach {where}: {need}"
        raise definition.source.error(("octree", "balance"), message, "say `balance: true`")
    units = (thin - volume.origin) / volume.unit
    place = " to ".join(str(np.rint(corner).astype(int).tolist()) for corner in units)
    message = f"too few control points reach {place} of the cells in `{octree.cells}`: {need}"
    raise definition.source.error(
        PATH, message, "divide the cells there more like their neighbours"
    )


def require_preimages(volume: InverseMap, found: Preimages, points: Floats, source: Source) -> None:
    """Reject points of the mesh at which the volume is torn, or folds over at rest.

    ``points`` (m, 3), lattice frame, are those that were inverted.

    Raises
    ------
    LatticeError
        States the number of such points, the first of them, and the side of the box beside it.
    """
    here = ("octree", "embedding")
    torn = volume.torn(found)
    if torn.any():
        place = found.parameters[np.argmax(torn)]
        sides = [*(place <= volume.box[0]), *(place >= volume.box[1])]
        beside = [f"{'uvw'[n % 3]}_{('min', 'max')[n // 3]}" for n in np.flatnonzero(sides)]
        message = f"{_count(torn)} no parameters in the volume at rest"
        hint = "use `box: auto`, enlarge the box, or say `embedding: displacement`"
        if beside:
            message += f", but control points of the side {beside[0]} beside them move"
            hint = f"leave the control points of {beside[0]} at rest, {hint}"
        raise source.error(here, f"{message}, {_first(points, torn, volume.frame)}", hint)
    folded = found.folded & found.solved
    if folded.any():
        message = f"{_count(folded)} parameters where the volume at rest folds over"
        hint = "choose closer `weights`, such as [10, 1], change `depth`, or say "
        hint += "`embedding: displacement`"
        raise source.error(here, f"{message}, {_first(points, folded, volume.frame)}", hint)


def _count(which: Bools) -> str:
    number = int(which.sum())
    have = "has" if number == 1 else "have"
    return f"{number:,} of {len(which):,} sampled points of the mesh {have}"


def _first(points: Floats, which: Bools, frame: Frame) -> str:
    place = frame.to_model(points[np.argmax(which)][None])[0]
    return f"the first at ({', '.join(f'{value:.6g}' for value in place)})"
