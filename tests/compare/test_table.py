"""The previous methods against the exact map, ours, and the paper's Table 2."""

from __future__ import annotations

import numpy as np
import pytest

from ffdcli.brep.evaluate.lookup import model_of_brep
from ffdcli.compare.subdivide import cut_into_triangles, cut_mesh
from ffdcli.compare.table import compare_schemes
from ffdcli.compare.triangular import interpolate_triangles, lattice_indices
from ffdcli.pipeline import prepare
from ffdcli.volume.weights import cartesian, homogeneous
from support.surface_models import box_mesh, evaluate_spline, make_volume, run, turn, zoo

DEGREES = [((2, 2, 2), (4, 4, 4)), ((1, 2, 3), (3, 4, 5)), ((3, 3, 3), (5, 5, 5))]


def weighted(volume, seed=1):
    """The same with weights between 0.5 and 2."""
    shape = volume.net.shape[:3]
    weights = 2 ** np.random.default_rng(seed).uniform(-1, 1, shape)
    return volume.with_net(homogeneous(volume.net, weights))


@pytest.fixture(params=["plain", "weighted"])
def dressed(request):
    return weighted if request.param == "weighted" else lambda volume: volume


@pytest.mark.parametrize(("degrees", "counts"), DEGREES)
def test_triangular_patches_are_the_deformation(degrees, counts, dressed):
    volume = dressed(make_volume(-0.6, 0.6, degrees, counts))
    vertices, triangles = box_mesh(0.66, turn([0.3, -0.5, 0.8], 0.83))
    pieces, origin = cut_into_triangles(vertices[triangles], volume, 1e-9)
    assert set(origin) == set(range(12))
    area = np.linalg.norm(
        np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]), axis=1
    )
    np.testing.assert_allclose(np.bincount(origin, weights=area), 0.66**2, rtol=1e-13)
    patches = interpolate_triangles(volume, pieces)
    assert patches.degree == sum(degrees)
    places = np.random.default_rng(0).dirichlet(np.ones(3), 30)
    exact = volume.evaluate((places @ pieces).reshape(-1, 3)).reshape(len(pieces), 30, 3)
    assert np.abs(patches.evaluate(places) - exact).max() < 1e-13


@pytest.mark.parametrize(("degrees", "counts"), DEGREES)
def test_the_papers_tensor_patches_are_the_deformation(degrees, counts, dressed):
    volume = dressed(make_volume(-0.7, 0.7, degrees, counts))
    stages = run(*zoo(), volume, patches="paper")
    assert sum(len(batch.patches) for batch in stages.patches) == stages.parts.inside.sum()
    assert worst_at_corners(stages.parts, stages.patches, volume) < 1e-13
    axes = stages.parts.rectangles.axes
    assert np.abs(axes @ axes.swapaxes(1, 2) - np.eye(2)).max() < 1e-15
    k = degrees
    general = {(sum(k) - max(k), sum(k))}
    assert general <= {batch.degrees for batch in stages.patches}
    assert all(s + t <= 2 * sum(k) - max(k) for s, t in (batch.degrees for batch in stages.patches))


def worst_at_corners(parts, batches, volume):
    """Largest distance of patches from the deformation at the corners of their pieces."""
    patch = parts.patch[parts.region[parts.pieces.owner]]
    worst = 0.0
    for batch in batches:
        poles = batch.control_points(volume.net, np.arange(batch.count))
        for i, number in enumerate(batch.patches):
            points = parts.pieces.vertices[parts.pieces.corners[patch == number], 0]
            at = parts.rectangles.parameters(points[None], np.array([number]))[0]
            found = cartesian(evaluate_spline(batch, i, poles[i], at))
            worst = max(worst, float(np.abs(found - volume.evaluate(points)).max()))
    return worst


OCTREES = {
    "hierarchical": ("volume: hierarchical\ndegree: [2, 1, 2]", "move", (5, (3, 5))),
    "tspline": ("volume: tspline", "move", (10, (7, 10))),
    "tspline-weights": ("volume: tspline", "weight", (19, (13, 19))),
}
OCTREE_EDITS = {
    "move": "  - move: {at: {near: [0.3, 0.3, 0.3]}, by: [0.1, -0.2, 0.15]}\n",
    "weight": "  - move: {at: {near: [0.3, 0.3, 0.3]}, by: [0.1, -0.2, 0.15]}\n"
    "  - weight: {at: {near: [0.3, 0.3, 0.3]}, value: 40}\n",
}


@pytest.mark.parametrize("name", OCTREES)
def test_the_cells_of_an_octree_take_the_place_of_knot_boxes(job, name):
    """Both earlier methods are the deformation itself, at the degrees that the volume implies."""
    head, edit, (triangular, tensor) = OCTREES[name]
    octree = "octree: {depth: 2, also: [{min: [0, 0, 0], max: [0.5, 0.5, 0.5], depth: 3}]}"
    vertices, triangles = box_mesh(1.0, turn([0.3, -0.5, 0.8], 0.83))
    mesh, lattice = job(f"{head}\n{octree}\nedits:\n{OCTREE_EDITS[edit]}", vertices, triangles)
    volume = lattice.volume
    pieces, inside = cut_mesh(mesh, volume)
    assert inside.all()
    # No piece crosses a side of a cell: the nearest places to its corners share one cell.
    near = 1e-6 * pieces.mean(axis=1, keepdims=True) + (1 - 1e-6) * pieces
    cells = volume.cells(near.reshape(-1, 3)).reshape(-1, 3, 3)
    assert (cells == cells[:, :1]).all()
    assert (
        len(
            np.unique(volume.cell_bounds(cells[:, 0])[:, 1] - volume.cell_bounds(cells[:, 0])[:, 0])
        )
        > 1
    )
    triangles_made = interpolate_triangles(volume, pieces)
    assert triangles_made.degree == triangular
    places = np.random.default_rng(0).dirichlet(np.ones(3), 10)
    exact = volume.evaluate((places @ pieces).reshape(-1, 3)).reshape(len(pieces), 10, 3)
    assert np.abs(triangles_made.evaluate(places) - exact).max() < 1e-11

    geometry = prepare(mesh, lattice, patches="paper").geometry
    assert {batch.degrees for batch in geometry.patches} == {tensor}
    assert worst_at_corners(geometry.parts, geometry.patches, volume) < 1e-11


def test_triangular_and_our_tensor_patches_agree(job):
    """The same random points by both: to 1e-12 of the size."""
    vertices, triangles = box_mesh(2.0, turn([0.3, -0.5, 0.8], 0.83))
    lattice = (
        "degree: [3, 3, 3]\npoints: [6, 5, 5]\nedits:\n"
        "  - twist: {axis: w, angle: 50}\n  - move: {at: [-1, 1, 2], by: [0.3, -0.2, 0.5]}\n"
    )
    mesh, lattice = job(lattice, vertices, triangles)
    volume = lattice.volume
    plan = prepare(mesh, lattice, patches="bezier")
    model = model_of_brep(plan.deform(lattice).brep)
    parts = plan.geometry.parts

    local = volume.frame.to_local(mesh.vertices)[mesh.corners.reshape(-1, 3)]
    pieces, origin = cut_into_triangles(local, volume, mesh.delta)
    patches = interpolate_triangles(volume, pieces)
    places = np.random.default_rng(5).dirichlet(np.ones(3), 10)
    found = volume.frame.to_model(patches.evaluate(places))
    points = places @ pieces
    # The face of each piece: the one of its plane in its knot box.
    middle = pieces.mean(axis=1)
    cell_of_patch = volume.cells((parts.low + parts.high) / 2)
    group = parts.group
    piece_group = np.empty(12, dtype=int)
    piece_group[parts.pieces.triangle] = group[parts.patch[parts.region]]
    worst = 0.0
    for n in range(len(pieces)):
        same = (cell_of_patch == volume.cells(middle[n : n + 1])).all(axis=1)
        patch = np.flatnonzero(same & (group == piece_group[origin[n]]))
        assert len(patch) >= 1
        face = np.flatnonzero(np.isin(parts.patch, patch))[:1]
        flat = parts.graphs.axes[patch[0], 1:]
        uv = points[n][:, flat]
        there, _ = model.on_faces(np.repeat(face, len(uv)), uv)
        worst = max(worst, np.abs(there - found[n]).max())
    assert worst <= 1e-12 * mesh.size


def test_the_papers_cube(job):
    """Table 2, Fig. 7: 60 sub-polygons and patches against 36 and 24."""
    vertices, triangles = box_mesh()
    lattice = (
        "degree: [2, 2, 2]\npoints: [4, 4, 4]\nedits:\n"
        "  - twist: {axis: w, angle: 30}\n  - move: {at: [0, 0, 0], by: [0.1, 0.2, 0]}\n"
        "  - move: {at: [3, 3, 3], by: [0.1, 0.2, 0.3]}\n  - move: {at: [1, 2, 0], by: [0, 0, 1]}\n"
        "  - move: {at: [1, 2, 3], by: [0, 0, 1]}\n"
    )
    mesh, lattice = job(lattice, vertices, triangles)
    rows = {row.scheme: row for row in compare_schemes(mesh, lattice)}
    counts = {
        name: (row.sub_polygons, row.patches, row.control_points) for name, row in rows.items()
    }
    assert counts == {
        "triangular": (60, 60, 60 * 28),
        "paper": (36, 24, 24 * 9),
        "bezier": (36, 24, 24 * 9),
        "merged": (12, 6, 6 * 16),
    }
    assert all(row.seconds > 0 for row in rows.values())


def test_lattice_indices():
    for degree in range(1, 8):
        index = lattice_indices(degree)
        assert len(index) == (degree + 1) * (degree + 2) // 2
        assert (index.sum(axis=1) == degree).all()
        assert len(np.unique(index, axis=0)) == len(index)
