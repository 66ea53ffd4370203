"""Sound and faulty meshes, from file to STEP file: a valid result, or an error that says why."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from ffdcli.brep.occ.check import kernel_check
from ffdcli.brep.occ.reading.step import read_step
from support.commands import ffd
from support.jobs import obj
from support.mesh_models import CORNERS, QUADS, ascii_stl, binary_stl, cube_triangles, off, ply

TWIST = """\
version: 1
degree: [2, 2, 2]
points: [4, 4, 4]
edits:
  - twist: {axis: w, angle: 20}
  - taper: {axis: u, factor: 0.8}
"""
SECOND = [[vertex + 8 for vertex in loop] for loop in QUADS]


def scene(kind, *transforms):
    """A file of boxes of size 1, in a format that holds scenes."""
    import trimesh

    made = trimesh.Scene()
    for transform in transforms:
        made.add_geometry(trimesh.creation.box(), transform=transform)
    made.units = "millimeter"
    return made.export(file_type=kind)


def prism(outline, height=1.0):
    """Vertices and polygons of a prism on an outline counter-clockwise in x and y."""
    count = len(outline)
    flat = np.asarray(outline, dtype=float)
    vertices = np.concatenate([np.column_stack([flat, np.full(count, z)]) for z in (0, height)])
    round_about = [(n, (n + 1) % count) for n in range(count)]
    walls = [[a, b, b + count, a + count] for a, b in round_about]
    return vertices, [list(range(count))[::-1], list(range(count, 2 * count)), *walls]


def keyhole():
    """A square tube whose ends run to the hole and back along one edge."""
    outer, inner = (
        np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float) * half for half in (2, 1)
    )
    vertices, polygons = prism(outer)
    hole, walls = prism(inner)
    top = [4, 5, 6, 7, 4, 12, 15, 14, 13, 12]
    inside = [[vertex + 8 for vertex in reversed(loop)] for loop in walls[2:]]
    return np.concatenate([vertices, hole]), [
        [vertex - 4 for vertex in reversed(top)],
        top,
        *polygons[2:],
        *inside,
    ]


def on_a_diagonal():
    """A cube, and a tetrahedron whose lowest edge runs along the diagonal that splits its top."""
    above = np.array([[0.3, 0.7, 1.5], [0.7, 0.3, 1.5]])
    return np.concatenate([CORNERS, above]), [*QUADS, [4, 7, 9], [7, 4, 8], [4, 9, 8], [7, 8, 9]]


def pit_at_a_corner():
    """A plate with a pit whose narrow mouth touches a corner of the plate: both at vertex 2."""
    outline = [[0, 0], [10, 0], [10, 10], [0, 10], [4, 3], [3, 4]]
    top = [[x, y, 1] for x, y in outline]
    points = [*top, *([x, y, 0] for x, y in outline[:4]), [5.6, 5.6, 0.5]]
    sheet = [[0, 1, 4], [1, 2, 4], [0, 4, 5], [0, 5, 3], [5, 2, 3]]
    pit = [[4, 2, 10], [5, 4, 10], [2, 5, 10]]
    sides = [[6 + i, 6 + (i + 1) % 4, (i + 1) % 4, i] for i in range(4)]
    return obj(points, [*sheet, *pit, *sides, [9, 8, 7, 6]])


def far(step):
    return CORNERS + step


MOVED = np.eye(4) + np.outer([3, 0, 0, 0], [0, 0, 0, 1])
MIRRORED = np.diag([-1.0, 1, 1, 1])
# Content, then solids and faces of the result.
SOUND = {
    "ascii.stl": (ascii_stl(cube_triangles()), 1, 6),
    "binary.STL": (binary_stl(cube_triangles()), 1, 6),
    "solid-in-the-header.stl": (b"solid" + binary_stl(cube_triangles())[5:], 1, 6),
    "single-precision.stl": (binary_stl(cube_triangles() * 0.1 + 7.3), 1, 6),
    "quads.obj": (obj(CORNERS, QUADS), 1, 6),
    "negative.obj": (
        "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
        + "".join("f " + " ".join(f"{i - 8}//1" for i in q[:2]) + " \\\n "
                  + " ".join(f"{i - 8}" for i in q[2:]) + "\n" for q in QUADS), 1, 6),
    "groups.Obj": ("mtllib no.mtl\no box\ng a b\nusemtl red\ns off\n" + obj(CORNERS, QUADS), 1, 6),
    "concave.obj": (obj(*prism([[0, 0], [4, 0], [4, 3], [2, 1], [1, 1], [0, 3], [0, 1]])), 1, 8),
    "straight-corners.off": (off(*prism([[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [0, 1]])), 1, 6),
    "keyhole.obj": (obj(*keyhole()), 1, 10),
    "quads.off": (off(CORNERS, QUADS), 1, 6),
    "ascii.ply": (ply(CORNERS, QUADS), 1, 6),
    "mixed.ply": (ply(CORNERS, [*QUADS[:5], [1, 3, 7], [1, 7, 5]], "binary_little_endian"), 1, 6),
    "big-endian.ply": (ply(CORNERS, QUADS, "binary_big_endian", "float"), 1, 6),
    "scene.glb": (scene("glb", np.eye(4), MOVED), 2, 12),
    "mirrored-part.glb": (scene("glb", MIRRORED), 1, 6),
    "touching-parts.glb": (scene("glb", np.eye(4), np.eye(4) + (MOVED - np.eye(4)) / 3), 2, 12),
    "scene.3mf": (scene("3mf", np.eye(4), MOVED), 2, 12),
    "cavity.obj": (obj(np.concatenate([CORNERS * 4, CORNERS + 1]),
                       QUADS + [loop[::-1] for loop in SECOND]), 1, 12),
    "bodies.obj": (obj(np.concatenate([CORNERS, CORNERS + 2]), QUADS + SECOND), 2, 12),
    "pit-at-a-corner.obj": (pit_at_a_corner(), 1, 10),
    "touching.obj": (obj(np.concatenate([CORNERS, far([1, 0, 0])]), QUADS + SECOND), 2, 12),
    "touching-in-a-point.stl": (
        binary_stl(np.concatenate([cube_triangles(), cube_triangles() + 1])), 2, 12),
    "touching-on-a-diagonal.obj": (obj(*on_a_diagonal()), 2, 10),
    "overlapping.obj": (obj(np.concatenate([CORNERS, CORNERS + 0.5]), QUADS + SECOND), 2, 12),
    "far.obj": (obj(far([1e6, -2e6, 3e6]), QUADS), 1, 6),
    "tiny.obj": (obj(CORNERS * 1e-4, QUADS), 1, 6),
    "huge.obj": (obj(CORNERS * 1e6, QUADS), 1, 6),
    "open.obj": (obj(CORNERS, QUADS[:-1]), 0, 5),
    "sheet.obj": (obj(CORNERS[:4], [[0, 1, 3, 2]]), 0, 1),
    "stray.obj": (obj([*CORNERS, [50, 50, 50]], QUADS), 1, 6),
}  # fmt: skip

MIDDLE = [[0.5, 0, 1]]
NEAR = np.nextafter(cube_triangles().astype(np.float32) + 3, np.float32(9))
# Content, and what is said without --repair: part of the refusal, or of a warning; then solids and
# faces with it, or None where it is refused all the same.
FAULTY = {
    "wall.obj": (obj(CORNERS, [*QUADS, [0, 1, 7, 6]]), "2 edges are shared by more than two", None),
    "edge.stl": (binary_stl(np.concatenate([cube_triangles(), cube_triangles() + [1, 0, 1]])),
                 "1 edge is shared by more than two polygons, near (1, 0.5, 1)", (2, 12)),
    "face.stl": (binary_stl(np.concatenate([cube_triangles(), cube_triangles() + [1, 0, 0]])),
                 "5 edges are shared by more than two polygons", (2, 12)),
    "twice.obj": (obj(CORNERS, [*QUADS, QUADS[0]]), "1 polygon lies on the same vertices", (1, 6)),
    "turned.obj": (obj(CORNERS, [*QUADS[1:], QUADS[0][::-1]]), "4 edges join polygons wound",
                   (1, 6)),
    "mirrored.obj": (obj(CORNERS * [1, 1, -1], QUADS), "1 closed body is inside out", (1, 6)),
    "no-area.obj": (obj(CORNERS, [*QUADS, [0, 1, 1]]), "1 polygon has no area", (1, 6)),
    "cap.obj": (obj([*CORNERS, *MIDDLE], [QUADS[0], [4, 8, 5, 7, 6], [4, 5, 8], *QUADS[2:]]),
                "1 polygon has no area, near (0.5, 0, 1)", (1, 6)),
    "t-junction.obj": (obj([*CORNERS, *MIDDLE], [QUADS[0], [4, 8, 5, 7, 6], *QUADS[2:]]),
                       "1 vertex lies in the middle of another polygon's open edge", (1, 6)),
    "unwelded.stl": (
        binary_stl(np.concatenate([cube_triangles()[:6] + 3, NEAR[6:]])),
        "vertices at open edges lie within rounding of others", (1, 6)),
    "crossing.obj": (obj(CORNERS, [[0, 2, 1, 3], *QUADS[1:]]), "1 polygon crosses itself", None),
    "star.obj": (obj([[np.cos(t), np.sin(t), 0] for t in np.arange(5) * 0.8 * np.pi],
                     [[0, 1, 2, 3, 4]]), "1 polygon crosses itself", None),
    "spike.obj": (obj(CORNERS, [[0, 2, 3, 1, 5, 1], *QUADS[1:]]), "1 polygon crosses itself",
                  (1, 6)),
    "double-sided.obj": (obj(CORNERS[:4], [[0, 1, 3, 2], [2, 3, 1, 0]]),
                         "1 polygon lies on the same vertices as another", (0, 1)),
    "nan.obj": (obj([*CORNERS[:7], ["nan", 1, 1]], QUADS), "coordinate that is not a number", None),
    "infinite.off": (off([*CORNERS[:7], ["inf", 1, 1]], QUADS),
                     "vertex 7 of polygon 1 (counted from 0)", None),
    "beyond.obj": (obj([*CORNERS[:7], ["1e99", 1, 1]], QUADS), "beyond 1e+50", None),
    "coarse.stl": (binary_stl(cube_triangles() + 1e6), "too coarse for a model of size 1.73", None),
    "empty.obj": ("", "no polygons", None),
    "empty.stl": ("solid nothing\nendsolid nothing\n", "no facets", None),
    "points.ply": (ply(CORNERS, []), "no polygons", None),
    "index.off": (off(CORNERS, [[0, 1, 8]]), "polygon 0 (counted from 0) refers to a vertex", None),
    "cut-short.ply": (ply(CORNERS, QUADS, "binary_little_endian")[:-9],
                      "promises 6 of element face", None),
    "cut-short.stl": (binary_stl(cube_triangles())[:-7], "677 bytes hold 11", None),
    "cut-short.off": (off(CORNERS, QUADS)[:-20], "the header promises", None),
    "cut-short.glb": (scene("glb", np.eye(4))[:-9], "cannot be read as .glb", None),
    "cut-short.3mf": (scene("3mf", np.eye(4))[:-9], "cannot be read as .3mf", None),
    "text.glb": ("hello", "cannot be read as .glb", None),
    "all-in-one-point.obj": (obj(CORNERS * 0 + 1, QUADS), "lie in one point, (1, 1, 1)", None),
    "line.obj": (obj(CORNERS * [1, 0, 0], QUADS), "6 polygons have no area", None),
}  # fmt: skip


@pytest.fixture
def deformed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("lattice.yaml").write_text(TWIST)

    def run(content, name, *options):
        Path(name).write_bytes(content if isinstance(content, bytes) else content.encode())
        words = ["deform", name, "lattice.yaml", "-o", "out.step", "--json", *options]
        result = ffd(*words, status=None)
        return result.exit_code, json.loads(result.stdout), result.stderr

    return run


def require_valid(report, solids, faces):
    """The file holds what was asked for, by OpenCascade's reading."""
    assert (report["solids"], report["faces"]) == (solids, faces), report
    verdict = kernel_check(read_step("out.step").shape)
    assert verdict.valid, verdict.faults
    assert verdict.closed == (solids > 0)
    assert report["watertight"] == (solids > 0)


@pytest.mark.parametrize("name", SOUND)
def test_sound_inputs(deformed, name):
    content, solids, faces = SOUND[name]
    lattice = Path("lattice.yaml")
    # One knot plane or none cuts polygons that slope: count the faces of the model itself.
    lattice.write_text(TWIST.replace("[4, 4, 4]", "[3, 3, 3]"))
    status, report, _ = deformed(content, name)
    assert status == 0, report
    require_valid(report, solids, faces)


@pytest.mark.parametrize(
    "name",
    [
        "touching.obj",
        "sheet.obj",
        "keyhole.obj",
        "touching-on-a-diagonal.obj",
        "pit-at-a-corner.obj",
    ],
)
def test_results_of_odd_inputs_verify(deformed, name):
    assert deformed(SOUND[name][0], name)[0] == 0
    ffd("verify", "out.step", name, "lattice.yaml")


@pytest.mark.parametrize("name", FAULTY)
def test_faulty_inputs(deformed, name):
    content, said, mended = FAULTY[name]
    Path("lattice.yaml").write_text(TWIST.replace("[4, 4, 4]", "[3, 3, 3]"))
    status, report, stderr = deformed(content, name)
    if status == 0:
        assert said in stderr
        assert kernel_check(read_step("out.step").shape).valid
    else:
        assert status == 1
        assert said in report["error"]["message"]
        assert report["error"]["file"] == name
        assert ("run again with --repair" in (report["error"]["hint"] or "")) == bool(mended)
        assert not Path("out.step").exists()
    status, report, stderr = deformed(content, name, "--repair")
    if mended is None:
        assert status == 1
        assert "run again with --repair" not in (report["error"]["hint"] or "")
        return
    assert status == 0, report
    require_valid(report, *mended)
    assert "warning: repaired: " in stderr
    ffd("verify", "out.step", name, "lattice.yaml", "--repair", "--quiet")


@pytest.mark.parametrize("name", FAULTY)
def test_info_tells_of_faults(deformed, name, tmp_path):
    content, said, mended = FAULTY[name]
    Path(name).write_bytes(content if isinstance(content, bytes) else content.encode())
    result = ffd("info", name, "--json", status=None)
    facts = json.loads(result.stdout)
    if result.exit_code:
        assert said in facts["error"]["message"]
        return
    assert facts["usable"] in {"no": None, "with --repair": mended, "yes": mended}
    assert any(said in warning for warning in facts["warnings"]) or facts["usable"] == "no"
    mending = ffd("info", name, "--json", "--repair", status=None)
    assert json.loads(mending.stdout)["usable"] == ("no" if mended is None else "yes")


def plate():
    """A plate with 20 drilled holes, as a CAD program triangulates it, and its facets per hole."""
    import cadquery

    rows = cadquery.Workplane().box(100, 80, 5).faces(">Z").workplane()
    solid = rows.rarray(19, 19, 5, 4).hole(7.3).val()
    points, triangles = solid.tessellate(0.1, 0.8)
    points = np.array([point.toTuple() for point in points])
    corners = points[np.array(triangles)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # What is neither top nor bottom nor one of the four sides.
    drilled = np.count_nonzero(np.abs(normals[:, 2]) < 1e-9 * np.abs(normals).max(axis=1)) - 8
    return corners, drilled // 2


TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
TURN = TURN * np.sign(np.linalg.det(TURN))


@pytest.mark.parametrize(("kind", "turned"), [("stl", True), ("ply", False)])
def test_a_plate_with_20_holes_comes_back_as_the_faces_it_had(deformed, kind, turned):
    corners, facets = plate()
    axes = TURN.T if turned else np.eye(3)
    corners = corners @ axes + [130, 70, 40]
    triangles = np.arange(3 * len(corners)).reshape(-1, 3)
    content = (
        binary_stl(corners)
        if kind == "stl"
        else ply(corners.reshape(-1, 3), triangles, "binary_little_endian")
    )
    # Knot planes run through top, bottom, sides and holes; one lies in the middle of a facet row.
    Path("lattice.yaml").write_text(
        "version: 1\ndegree: [2, 2, 2]\npoints: [5, 4, 3]\n"
        f"box: {{center: [130, 70, 40], size: [110, 90, 7], axes: {axes.tolist()}}}\n"
        "edits:\n  - bend: {axis: u, toward: w, angle: 40}\n"
    )
    status, report, _ = deformed(content, f"plate.{kind}")
    assert status == 0, report
    require_valid(report, 1, 6 + facets)
    # Each facet has two edges on circles and shares two along the hole; nothing else is left.
    assert report["edges"] == 12 + 3 * facets
    assert report["vertices"] == 8 + 2 * facets
    rounding = 4 * np.spacing(np.float32(200)) if kind == "stl" else 1e-9 * 200
    assert report["epsilon"] <= rounding


def test_a_noisy_plate_where_the_bound_of_gaps_is_attained(deformed):
    corners, _ = plate()
    # At degree 1 curves and surfaces part by just what the vertices are off the planes.
    Path("lattice.yaml").write_text(
        "version: 1\ndegree: [1, 1, 1]\npoints: [5, 4, 3]\n"
        f"box: {{center: [130, 70, 40], size: [110, 90, 7], axes: {TURN.T.tolist()}}}\n"
        "edits:\n  - bend: {axis: u, toward: w, angle: 40}\n"
    )
    status, report, _ = deformed(binary_stl(corners @ TURN.T + [130, 70, 40]), "plate.stl")
    assert status == 0, report
    require_valid(report, 1, report["faces"])


def test_binary_stl_attributes_do_not_matter(deformed):
    data = bytearray(binary_stl(cube_triangles()))
    data[84 + 48 : 84 + 50] = struct.pack("<H", 0xFFFF)
    status, report, _ = deformed(bytes(data), "coloured.stl")
    assert (status, report["solids"]) == (0, 1)
