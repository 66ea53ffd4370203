"""A plan with matrices gives the same results as one without, to rounding."""

from dataclasses import replace

import numpy as np
import pytest

from ffdcli import prepare, read_lattice, read_mesh
from ffdcli.errors import LatticeError
from support.places import SAMPLES

EDITS = """
edits:
  - move: {at: [0, 0, 0], by: [-0.2, 0.1, 0.05]}
  - move: {at: [-1, 1, 2], by: [0.1, -0.05, 0.2]}
  - twist: {axis: w, angle: 30}
"""
WEIGHTS = "  - weight: {at: [1, 1, 1], value: 2.5}\n  - weight: {at: [2, 1, 2], value: 0.6}\n"
# Sides that slope along none, one and both of the other axes.
WEDGE = """\
v 0.1 0.2 0.1
v 1.9 0.1 0.2
v 1.8 1.7 0.1
v 0.2 1.9 0.3
v 0.9 0.8 1.9
f 4 3 1
f 3 2 1
f 1 2 5
f 2 3 5
f 3 4 5
f 4 1 5
"""
BOX = "box: {min: [-0.1, -0.1, -0.1], max: [2.1, 2.1, 2.1]}\n"
KINDS = {
    "cubic": f"volume: bspline\ndegree: [3, 3, 3]\npoints: [6, 5, 5]\n{BOX}{EDITS}",
    "mixed": f"volume: bspline\ndegree: [1, 3, 2]\npoints: [5, 6, 4]\n{BOX}{EDITS}",
    "weights": (f"volume: nurbs\ndegree: [2, 2, 3]\npoints: [5, 4, 5]\n{BOX}{EDITS}{WEIGHTS}"),
}


def differences(first, second):
    """The largest difference of anything that control nets have a part in."""
    assert np.array_equal(first.edges, second.edges)
    found = [np.abs(first.points - second.points).max()]
    for name in ("curves", "surfaces"):
        pairs = list(zip(getattr(first, name), getattr(second, name), strict=True))
        assert all(a.poles.shape == b.poles.shape for a, b in pairs)
        found += [np.abs(a.poles - b.poles).max(initial=0) for a, b in pairs]
    return max(found)


@pytest.mark.parametrize("patches", ["merged", "bezier"])
@pytest.mark.parametrize("kind", list(KINDS))
def test_matrices_give_what_composition_gives(job, kind, patches):
    mesh, lattice = job(KINDS[kind], mesh=WEDGE)
    plan = prepare(mesh, lattice, patches=patches)
    kept = plan.with_matrices()
    assert plan.matrix_bytes == 0
    points = sum(
        batch.sums.matrix.shape[0] for batch in (*kept.geometry.patches, *kept.geometry.curves)
    )
    size = 8 * np.prod([k + 1 for k in lattice.volume.degrees])
    assert kept.matrix_bytes > points * size
    for scale in (1.0, 0.25) if kind != "weights" else (1.0,):
        slow = plan.deform(lattice.scaled(scale))
        fast = kept.deform(lattice.scaled(scale))
        assert slow.brep.surfaces
        assert differences(slow.brep, fast.brep) <= 4e-15 * mesh.size
        assert fast.injectivity.locally_injective == slow.injectivity.locally_injective
        assert fast.injectivity.bound == pytest.approx(slow.injectivity.bound, rel=1e-12)
        assert fast.deviation == slow.deviation


def test_matrices_are_used(job):
    """Sums that are spoilt spoil the result: it does come from them."""
    mesh, lattice = job(KINDS["cubic"], mesh=WEDGE)
    kept = prepare(mesh, lattice).with_matrices()
    geometry = kept.geometry
    batch = geometry.patches[0]
    spoilt = replace(batch, sums=replace(batch.sums, matrix=batch.sums.matrix * 2))
    wrong = replace(kept, geometry=replace(geometry, patches=(spoilt, *geometry.patches[1:])))
    right = kept.deform(lattice, check=False).brep
    assert differences(right, wrong.deform(lattice, check=False).brep) > 0.1


def test_planes_and_other_knots_are_told_apart_as_without(job):
    mesh, lattice = job(KINDS["cubic"], mesh=WEDGE)
    kept = prepare(mesh, lattice).with_matrices()
    assert kept.deform(lattice.scaled(0)).report["degrees"].keys() == {"plane"}
    _, other = job(KINDS["mixed"], mesh=WEDGE)
    with pytest.raises(LatticeError, match="other degrees, knots"):
        kept.deform(other)


def test_a_plan_for_weights_of_one_serves_others(job):
    mesh, weighted = job(KINDS["weights"], mesh=WEDGE)
    lattices = [job(KINDS["weights"].replace(WEIGHTS, ""), mesh=WEDGE)[1], weighted]
    assert [each.volume.net.shape[-1] for each in lattices] == [3, 4]
    for first, second in (lattices, lattices[::-1]):
        plan = prepare(mesh, first)
        slow, fast = plan.deform(second), plan.with_matrices().deform(second)
        assert differences(slow.brep, fast.brep) <= 4e-15 * mesh.size
        assert fast.injectivity.bound == pytest.approx(slow.injectivity.bound, rel=1e-12)


NEAR = "{volume: bspline, degree: [3, 3, 3], points: [6, 5, 5], box: %s, edits: [%s]}"
BESIDE = NEAR % ("{min: [10, 10, 10], max: [12, 12, 12]}", "{move: {at: [2, 2, 2], by: [1, 0, 0]}}")
AROUND = NEAR % (BOX[5:].strip(), "{move: {at: [2, 2, 2], by: [0.1, 0.2, 0]}}")


@pytest.mark.parametrize("patches", ["merged", "bezier"])
@pytest.mark.parametrize("members", [[BESIDE], [BESIDE, AROUND], [AROUND, BESIDE]])
def test_lattices_beside_the_mesh(tmp_path, members, patches):
    """They hold no samples, no patches, no curves, and have no part in the matrices."""
    (tmp_path / "mesh.obj").write_text(WEDGE)
    mesh = read_mesh(tmp_path / "mesh.obj")
    listed = "".join(f"  - {member}\n" for member in members)
    (tmp_path / "lattice.yaml").write_text(f"version: 1\nlattices:\n{listed}")
    lattice = read_lattice(tmp_path / "lattice.yaml", mesh)
    plan = prepare(mesh, lattice, patches=patches)
    kept = plan.with_matrices()
    slow, fast = plan.deform(lattice), kept.deform(lattice)
    assert differences(slow.brep, fast.brep) <= 4e-15 * mesh.size
    assert fast.warnings == slow.warnings
    if members == [BESIDE]:
        assert kept.matrix_bytes == 0
        assert np.array_equal(fast.brep.points, mesh.vertices)


def test_several_lattices_and_seams(tmp_path):
    mesh = read_mesh(SAMPLES / "bracket.obj")
    lattice = read_lattice(SAMPLES / "bracket.yaml", mesh)
    plan = prepare(mesh, lattice)
    slow, fast = plan.deform(lattice), plan.with_matrices().deform(lattice)
    assert differences(slow.brep, fast.brep) <= 4e-15 * mesh.size
    still = np.all(slow.brep.points == slow.undeformed.rest, axis=1)
    assert still.any()
    assert np.array_equal(fast.brep.points[still], slow.brep.points[still])


@pytest.mark.parametrize("kind", ["tspline", "hierarchical"])
def test_lattices_that_are_no_tensor_products_have_no_matrices(job, kind):
    octree = f"volume: {kind}\noctree: {{depth: 2}}\nedits:\n"
    move = "  - move: {at: {near: [0.9, 0.8, 1.9]}, by: [0, 0.1, 0.2]}\n"
    mesh, lattice = job(octree + move, mesh=WEDGE)
    plan = prepare(mesh, lattice)
    kept = plan.with_matrices()
    assert kept.matrix_bytes == 0
    first, second = plan.deform(lattice, check=False), kept.deform(lattice, check=False)
    assert differences(first.brep, second.brep) == 0
