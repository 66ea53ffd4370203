"""Whole runs with several lattices on one mesh, and how boxes join what lies around them."""

import numpy as np
import pytest
from scipy.interpolate import NdBSpline

from ffdcli import deform, prepare
from ffdcli.errors import LatticeError
from support.jobs import CUBE, CUBE_FACES, turn, written

BAR = CUBE * [6, 1, 1]
FIRST = """
  - degree: [3, 3, 3]
    points: [7, 5, 5]
    box: {min: [0.5, -0.2, -0.2], max: [2.5, 1.2, 1.2]}
    edits:
      - move: {at: [3, ":", ":"], by: [0, 0, 0.4]}
      - move: {at: [3, 2, 2], by: [0.1, 0.3, 0]}
"""
TURNED = """
  - degree: [2, 2, 3]
    points: [8, 7, 5]
    box: {center: [4.2, 0.5, 0.5], size: [2.4, 2.4, 2],
          axes: [[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]]}
    edits:
      - move: {at: [4, 3, 2], by: [0, 0.3, 0.3]}
"""
TOUCHING = """
  - degree: [2, 3, 3]
    points: [8, 4, 4]
    box: {min: [2.5, -0.2, -0.2], max: [4.5, 1.2, 1.2]}
    edits:
      - move: {at: [4, ":", ":"], by: [0, 0.2, 0.2]}
"""


@pytest.fixture
def job(job):
    """As the ``job`` of all tests, in centimetres, for a bar."""

    def make(lattice, points=BAR, faces=CUBE_FACES):
        return job(f"unit: cm\n{lattice}", points, faces)

    return make


@pytest.mark.parametrize("patches", ["merged", "bezier"])
@pytest.mark.parametrize("second", [TURNED, TOUCHING], ids=["turned", "touching"])
def test_two_boxes_make_one_solid(job, tmp_path, second, patches):
    mesh, lattices = job("lattices:" + FIRST + second)
    result = deform(mesh, lattices, patches=patches)
    report = result.report
    assert (report["solids"], report["watertight"], report["unit"]) == (1, True, "cm")
    assert report["plane_deviation"] < 1e-14
    verdict = written(result, tmp_path / "a.step", mesh, lattices)
    assert verdict.max_deviation < 1e-11
    assert verdict.volume == pytest.approx(verdict.expected_volume, rel=1e-12)
    kept = {tuple(point) for point in result.brep.points.tolist()}
    assert kept.issuperset(map(tuple, BAR.tolist()))


def test_far_from_the_origin_and_in_another_order(job, tmp_path):
    """Frames of their own near each box: the offset costs no more digits than the numbers have."""
    far = np.array([1e6, -2e6, 3e5])
    text = "lattices:" + TURNED + FIRST
    text = text.replace("center: [4.2, 0.5, 0.5]", f"center: {(far + [4.2, 0.5, 0.5]).tolist()}")
    for corner in ([0.5, -0.2, -0.2], [2.5, 1.2, 1.2]):
        text = text.replace(f"{corner}", f"{(far + corner).tolist()}")
    mesh, lattices = job(text, BAR + far)
    verdict = written(deform(mesh, lattices), tmp_path / "a.step", mesh, lattices)
    assert verdict.max_deviation < 16 * np.spacing(2e6)


def test_each_box_holds_what_its_lattice_alone_would_make(job):
    mesh, both = job("lattices:" + FIRST + TURNED)
    together = sorted(_poles(deform(mesh, both).brep))
    alone = []
    for text in (FIRST, TURNED):
        mesh, one = job("lattices:" + text)
        alone += _poles(deform(mesh, one).brep)
    assert [name for name, _ in together] == [name for name, _ in sorted(alone)]
    for (_, poles), (_, expected) in zip(together, sorted(alone), strict=True):
        assert np.abs(np.array(poles) - np.array(expected)).max() <= 1e-14


def _poles(brep):
    """(name, control points) of every surface; the name is its size and its rounded first pole."""
    return [
        ((poles.shape, tuple(np.round(poles[0, 0], 6).tolist())), poles.tolist())
        for batch in brep.surfaces
        for poles in batch.poles
    ]


def test_one_lattice_in_a_list_is_that_lattice(job):
    mesh, listed = job("lattices:" + FIRST)
    _, plain = job("\n".join(line[4:] for line in FIRST.splitlines()))
    assert (listed.listed, plain.listed) == (True, False)
    one, other = deform(mesh, listed).brep, deform(mesh, plain).brep
    assert np.array_equal(one.points, other.points)
    for a, b in zip(one.surfaces, other.surfaces, strict=True):
        assert np.array_equal(a.poles, b.poles)


def test_what_is_about_one_box_counts_them(job):
    _, lattices = job("lattices:" + FIRST + TURNED)
    for use in (lambda: lattices.volume, lambda: lattices.with_net(lattices.volumes[0].net)):
        with pytest.raises(LatticeError, match="the file has 2"):
            use()


def test_a_plan_serves_all_nets_on_the_same_knots(job):
    mesh, lattices = job("lattices:" + FIRST + TURNED)
    plan = prepare(mesh, lattices)
    rest = plan.deform(lattices.scaled(0))
    assert set(rest.report["degrees"]) == {"plane"}
    half = plan.deform(lattices.scaled(0.5)).brep
    for batch, expected in zip(
        half.surfaces, deform(mesh, lattices.scaled(0.5)).brep.surfaces, strict=True
    ):
        assert np.array_equal(batch.poles, expected.poles)
    _, other = job("lattices:" + FIRST)
    with pytest.raises(LatticeError, match="another box"):
        plan.deform(other)


def test_drags_go_to_the_box_that_holds_the_point(job):
    _, lattices = job("lattices:" + FIRST + TURNED)
    sources = np.array([[1.5, 0.5, 1.0], [4.2, 0.4, 1.0]])
    targets = sources + [[0, 0.1, 0.2], [0.05, 0, -0.1]]
    dragged = lattices.drag(sources, targets)
    for member, volume, source, target in zip(
        lattices.members, dragged.volumes, sources, targets, strict=True
    ):
        image = volume.evaluate(volume.frame.to_local(source[None]))
        assert np.abs(volume.frame.to_model(image)[0] - target).max() < 1e-12
        assert not np.array_equal(member.volume.net, volume.net)
    with pytest.raises(LatticeError, match=r"\(0.1, 0.5, 0.5\) lies in none of the lattice boxes"):
        lattices.drag([[0.1, 0.5, 0.5]], [[0.1, 0.5, 0.6]])
    with pytest.raises(LatticeError, match=r"\(m, 3\)"):
        lattices.drag([[0.1, 0.5]], [[0.1, 0.5]])


def test_an_unused_box_is_named(job):
    inner = "  - {points: [4, 4, 4], box: {min: [5, 0.3, 0.3], max: [5.5, 0.6, 0.6]}}\n"
    mesh, lattices = job("lattices:" + FIRST + inner)
    (warning,) = deform(mesh, lattices).report["warnings"]
    assert warning.startswith("lattices[1]: ")
    assert "nothing is deformed" in warning


def test_mirroring_edits_in_one_box_of_two_bodies(job, tmp_path):
    points = np.concatenate([CUBE, CUBE + [3, 0, 0]])
    faces = np.concatenate([CUBE_FACES, CUBE_FACES + 8])
    box = "{min: [%s, -0.1, -0.1], max: [%s, 1.1, 1.1]}"
    mirrored = f"""
  - points: [5, 5, 5]
    box: {box % (2.9, 4.1)}
    edits: [{{transform: {{at: [":", ":", ":"], scale: [-1, 1, 1]}}}}]
"""
    bent = f"""
  - points: [5, 5, 5]
    box: {box % (-0.1, 1.1)}
    edits: [{{move: {{at: [2, 2, 2], by: [0.1, 0.2, 0]}}}}]
"""
    mesh, lattices = job("lattices:" + bent + mirrored, points, faces)
    result = deform(mesh, lattices)
    assert result.brep.face_reversed.sum() == 6
    assert written(result, tmp_path / "a.step", mesh, lattices).solids == 2


def seam_angles(brep, place):
    """Largest sine between the normals on both sides of each edge in the plane x = place."""
    surfaces = {}
    for batch in brep.surfaces:
        for row, number in enumerate(batch.surfaces.tolist()):
            u = np.repeat(batch.u_knots[row], batch.u_mults)
            v = np.repeat(batch.v_knots[row], batch.v_mults)
            surfaces[number] = NdBSpline((u, v), batch.poles[row], batch.degrees)
    planes = dict(
        zip(
            brep.planes.surfaces.tolist(),
            np.cross(brep.planes.x_axis, brep.planes.y_axis),
            strict=True,
        )
    )
    share = np.linspace(0.05, 0.95, 7)[:, None]
    sides = {}
    for face, number in enumerate(brep.face_surface.tolist()):
        first, last = brep.loop_coedges[brep.face_loops[face : face + 2]]
        for coedge in range(first, last):
            edge = int(brep.coedge_edge[coedge])
            if np.abs(brep.points[brep.edges[edge], 0] - place).max() > 1e-12:
                continue
            start, end = brep.pcurves[coedge]
            at = start + share * (end - start)
            if number in planes:
                normal = np.tile(planes[number], (len(at), 1))
            else:
                along = [surfaces[number](at, nu=order) for order in ((1, 0), (0, 1))]
                normal = np.cross(*along)
            normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
            sides.setdefault(edge, []).append(normal)
    pairs = [normals for normals in sides.values() if len(normals) == 2]
    assert pairs
    return max(float(np.linalg.norm(np.cross(a, b), axis=1).max()) for a, b in pairs)


def test_each_side_joins_as_its_border_says(job):
    """Tangent planes agree across a c1 side, and break across a c0 side of the same box."""
    text = FIRST.replace("    edits:", "    border: {u_min: c0}\n    edits:")
    text += '      - move: {at: [1, ":", ":"], by: [0, 0.1, 0.2]}\n'
    mesh, lattices = job("lattices:" + text + TOUCHING)
    brep = deform(mesh, lattices).brep
    assert seam_angles(brep, 0.5) > 0.1
    assert seam_angles(brep, 2.5) < 1e-13
    assert seam_angles(brep, 4.5) < 1e-13


def test_points_on_the_box_move(job, tmp_path):
    """A side that the mesh reaches but does not pass is free; all that lies on it moves."""
    text = "degree: [2, 3, 2]\npoints: [4, 4, 4]\nbox: {min: [-1, 0, 0], max: [6, 1, 1]}\n"
    text += 'edits: [{move: {at: [":", ":", -1], by: [0, 0, 0.25]}}]\n'
    mesh, lattice = job(text)
    assert lattice.crossed == ()
    result = deform(mesh, lattice)
    expected = BAR + BAR[:, 2:] * [0, 0, 0.25]
    places = np.abs(result.brep.points[:, None] - expected).max(axis=2)
    assert places.min(axis=0).max() <= 4 * np.finfo(float).eps
    written(result, tmp_path / "a.step", mesh, lattice)


def test_points_on_a_turned_box_move(job, tmp_path):
    """They lie on its sides but for rounding."""
    axes = turn([0.4, 1.1, 2.3])
    points = (CUBE - 0.5) * [6, 2, 1] @ axes + [10, 20, 30]
    box = f"{{center: [10, 20, 30], size: [6, 2, 1], axes: {axes.tolist()}}}"
    edit = 'edits: [{move: {at: [":", ":", ":"], by: [0.5, 0, 0]}}]\n'
    mesh, lattice = job(f"degree: [3, 2, 2]\npoints: [5, 4, 4]\nbox: {box}\n{edit}", points)
    assert lattice.crossed == ()
    result = deform(mesh, lattice)
    moved = np.abs(result.brep.points[:, None] - (points + 0.5 * axes[0])).max(axis=2)
    assert moved.min(axis=0).max() <= 4 * np.spacing(32)
    assert result.report["degrees"] == {"plane": 6}
    written(result, tmp_path / "a.step", mesh, lattice)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e6])
def test_a_turned_box_partly_outside_the_mesh_at_all_sizes(job, tmp_path, scale):
    axes = turn([0.2, 0.3, 0.5])
    centre, size = (np.array([6, 0.5, 0.5]) * scale).tolist(), [4 * scale] * 3
    text = f"points: [9, 9, 9]\nbox: {{center: {centre}, size: {size}, axes: {axes.tolist()}}}\n"
    text += f"edits: [{{move: {{at: [5, 4, 4], by: [0, {0.4 * scale}, {0.3 * scale}]}}}}]\n"
    mesh, lattice = job(text, BAR * scale)
    assert lattice.crossed
    result = deform(mesh, lattice)
    assert result.report["watertight"]
    verdict = written(result, tmp_path / "a.step", mesh, lattice)
    assert verdict.max_deviation < 2e-12 * mesh.size


@pytest.mark.parametrize(("scale", "far"), [(1e-4, 10.0), (1.0, 1e6), (1e6, 1e9)])
def test_a_flat_sheet_far_from_the_origin(job, tmp_path, scale, far):
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]) * scale + far
    edits = 'edits: [{move: {at: [2, 2, ":"], by: [0, 0, %r]}}]\n' % (0.3 * scale)
    mesh, lattice = job("points: [5, 5, 5]\n" + edits, points, [[0, 1, 2, 3]])
    result = deform(mesh, lattice)
    report = result.report
    assert (report["solids"], report["faces"], report["watertight"]) == (0, 1, False)
    assert report["degrees"] == {"3x3": 1}
    written(result, tmp_path / "a.step", mesh, lattice)
