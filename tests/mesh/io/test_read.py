"""Reading: every polygon and digit kept, nothing changed silently, every bad file named."""

import re

import numpy as np
import pytest

from ffdcli.errors import FileError, MeshError
from ffdcli.mesh import inspect, read_mesh, triangles
from ffdcli.mesh.io.text_numbers import count_decimals
from support.jobs import obj
from support.mesh_models import CORNERS, QUADS, ascii_stl, binary_stl, cube_triangles, off, ply
from support.places import REAL_MESHES


@pytest.fixture
def read(tmp_path):
    def read_text(content, name):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_mesh(path)

    return read_text


@pytest.mark.parametrize(
    ("content", "name"),
    [
        (obj(CORNERS, QUADS), "cube.obj"),
        (off(CORNERS, QUADS), "cube.off"),
        (ply(CORNERS, QUADS), "cube.ply"),
        (ply(CORNERS, QUADS, "binary_little_endian"), "cube.PLY"),
    ],
)
def test_quads_are_kept(read, content, name):
    mesh = read(content, name)
    assert np.array_equal(np.diff(mesh.starts), [4] * 6)
    assert mesh.notes == ()
    soundness = inspect(mesh)
    assert soundness.closed
    assert soundness.volumes == pytest.approx([1.0], abs=1e-15)


@pytest.mark.parametrize(
    ("content", "name"),
    [(ascii_stl(cube_triangles()), "a.stl"), (binary_stl(cube_triangles()), "b.STL")],
)
def test_stl_is_welded(read, content, name):
    mesh = read(content, name)
    assert (len(mesh.vertices), mesh.polygon_count) == (8, 12)
    assert inspect(mesh).closed


def test_stl_of_several_solids_is_not_welded_at_a_tolerance(read):
    thin = cube_triangles() * [1, 1, 1e-9]
    mesh = read(ascii_stl(thin) + ascii_stl(cube_triangles() + 3), "two.stl")
    assert len(mesh.vertices) == 16
    assert inspect(mesh).bodies == 2


def test_obj_statements(read):
    text = (
        "# v 9 9 9\r\nmtllib no.mtl\nv 0 0 0 1.0 0.5 0.5 # coloured\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
        "vt 0 0\nvn 0 0 1\ng a\nusemtl red\nf 1/1/1 2/1/1 \\\n 3/1/1\ng b\nusemtl blue\n"
        "f -4//1 -2//1 -1//1\nv 5 5 5\nl 1 2\n"
    )
    mesh = read(text, "a.obj")
    assert mesh.corners.tolist() == [0, 1, 2, 0, 2, 3]
    assert mesh.notes == (
        "1 line that is no statement of polygons left out: 1 l",
        "the colours of the material file no.mtl are left out: there is no such file",
        "1 vertex without a polygon left out, the first at (5, 5, 5)",
    )


def test_numbers_are_the_nearest_doubles_and_welding_is_exact(read):
    x = 1.2345678901234567
    above = np.nextafter(x, 2)
    rows = [[x, 0, "-0.0"], [2, 0, 0], [2, 1, 0], [x, 0, 0], [above, 1, 0], [2, 1, 0]]
    mesh = read(obj(rows, [[0, 1, 2], [3, 4, 5]]), "a.obj")
    assert mesh.vertices[:, 0].tolist() == [x, 2.0, 2.0, above]
    assert mesh.corners.tolist() == [0, 1, 2, 0, 3, 2]


@pytest.mark.parametrize("write", [obj, off, ply])
def test_concave_polygon_is_kept_and_triangulated_right(read, write):
    outline = [[0, 0, 2], [4, 0, 2], [4, 3, 2], [2, 1, 2], [1, 1, 2], [0, 3, 2], [0, 1.5, 2]]
    mesh = read(write(outline, [[0, 1, 2, 3, 4, 5, 6]]), "a." + write.__name__)
    corners, polygon = triangles(mesh)
    assert np.array_equal(np.diff(mesh.starts), [7])
    assert polygon.tolist() == [0] * 5
    a, b, c = np.moveaxis(mesh.vertices[corners], 1, 0)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert np.all(areas > 0)
    x, y = np.array(outline)[:, 0], np.array(outline)[:, 1]
    assert areas.sum() == pytest.approx(0.5 * abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)))


def test_bent_quad_is_split_along_the_shorter_diagonal(read):
    mesh = read(obj([[0, 0, 0], [3, 0, 0], [2, 2, 0.5], [0, 3, 0]], [[0, 1, 2, 3]]), "a.obj")
    assert sorted(map(sorted, mesh.corners.reshape(-1, 3).tolist())) == [[0, 1, 2], [0, 2, 3]]
    assert "1 polygon that is not flat" in mesh.notes[0]


def test_bent_concave_quad_is_split_inside(read):
    # The reflex corner 2 is near; the shorter diagonal 1-3 runs outside.
    rows = [[0, 0, 0], [2, -1, 0], [1.5, 0, 0.1], [2, 1, 0]]
    mesh = read(obj(rows, [[0, 1, 2, 3]]), "a.obj")
    assert sorted(map(sorted, mesh.corners.reshape(-1, 3).tolist())) == [[0, 1, 2], [0, 2, 3]]


def test_order_survives_splitting(read):
    rows = [[0, 0, 0], [1, 0, 0], [1, 1, 0.3], [0, 1, 0], [5, 0, 0], [5, 1, 0]]
    mesh = read(obj(rows, [[0, 1, 4], [0, 1, 2, 3], [1, 4, 5, 2], [3, 4, 5]]), "a.obj")
    assert mesh.corners[:3].tolist() == [0, 1, 4]
    assert mesh.corners[-3:].tolist() == [3, 4, 5]
    assert np.array_equal(np.diff(mesh.starts), [3] * 6)


def test_self_crossing_polygon_is_named(read):
    star = [[np.cos(t), np.sin(t), 0] for t in np.arange(5) * 4 * np.pi / 5]
    mesh = read(obj([*star, [0, 0, 5]], [[0, 1, 2, 3, 4]]), "a.obj")
    assert mesh.polygon_count == 1
    with pytest.raises(MeshError, match=r"polygon 0 .* crosses itself or doubles back"):
        triangles(mesh)


@pytest.mark.parametrize(
    ("tokens", "decimals"),
    [
        ([b"1.5e-3", b"2"], 4),
        ([b"1.25", b"-0.5"], 2),
        ([b"2E3", b"1e3"], -3),
        ([b"0.000000", b"1.5E+01"], 6),
        ([b"7"], 0),
    ],
)
def test_decimals(tokens, decimals):
    assert count_decimals(np.array(tokens)) == decimals


def test_resolution_of_text_and_binary(read):
    printed = [[f"{x:.6f}" for x in v * 7.3] for v in CORNERS]
    assert read(obj(printed, QUADS), "a.obj").resolution == 0.5e-6
    assert read(ply(printed, QUADS, "ascii"), "a.ply").resolution == 0.5e-6
    single = 4 * float(np.spacing(np.float32(100)))
    assert read(binary_stl(cube_triangles() * 100), "a.stl").resolution == single
    scaled = CORNERS * 100
    binary = "binary_little_endian"
    assert read(ply(scaled, QUADS, binary, "float"), "b.ply").resolution == single
    assert read(ply(scaled, QUADS, binary), "c.ply").resolution == 4 * np.spacing(100.0)
    assert read(ply(scaled, QUADS, "ascii", "float"), "d.ply").resolution == single


def test_3mf_digits_are_those_of_the_xml(tmp_path):
    import zipfile

    import trimesh

    trimesh.creation.box(extents=[10, 10, 10]).export(tmp_path / "a.3mf")
    with (
        zipfile.ZipFile(tmp_path / "a.3mf") as old,
        zipfile.ZipFile(tmp_path / "b.3mf", "w") as new,
    ):
        for name in old.namelist():
            text = old.read(name)
            if name.endswith(".model"):
                text = re.sub(rb'\b([xyz])="(-?5)[^"]*"', rb'\1="\g<2>.00000"', text)
            new.writestr(name, text)
    assert read_mesh(tmp_path / "b.3mf").resolution == pytest.approx(0.5e-5, rel=1e-12)


def test_mixed_polygons_of_ascii_ply(read):
    mesh = read(ply(CORNERS, [*QUADS[:5], QUADS[5][:3], [1, 7, 5]]), "a.ply")
    assert np.diff(mesh.starts).tolist() == [4, 4, 4, 4, 4, 3, 3]


def test_short_numbers_are_exact(read):
    assert read(obj(CORNERS.astype(int), QUADS), "a.obj").resolution == 4 * np.spacing(1.0)


def test_scene_transforms_and_units(tmp_path):
    import trimesh

    box = trimesh.creation.box()
    scene = trimesh.Scene()
    scene.add_geometry(box, transform=np.diag([2, -1, 1, 1.0]))
    scene.add_geometry(box, transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    for name, unit in (("a.glb", "m"), ("a.3mf", "mm")):
        scene.units = {"m": "meter", "mm": "millimeter"}[unit]
        scene.export(tmp_path / name)
        mesh = read_mesh(tmp_path / name)
        soundness = inspect(mesh)
        assert mesh.unit == unit
        assert soundness.closed
        assert sorted(soundness.volumes) == pytest.approx([1.0, 2.0])
        assert mesh.bounds.tolist() == [[-1, -0.5, -0.5], [5.5, 0.5, 0.5]]


@pytest.mark.parametrize(
    ("content", "name", "kind", "words"),
    [
        ("v 0 0 0\n", "a.obj", MeshError, "no polygons"),
        ("", "a.obj", MeshError, "no polygons"),
        ("hello", "a.off", FileError, "not an OFF"),
        ("hello" * 50, "a.stl", FileError, "not an STL"),
        ("", "a.stl", FileError, "not an STL"),
        ("hello", "a.ply", FileError, "not that of a PLY file"),
        ("hello", "a.glb", FileError, "cannot be read as .glb"),
        ("hello", "a.3mf", FileError, "cannot be read as .3mf"),
        ("hello", "a.xyz", FileError, "mesh format"),
        ("hello", "a", FileError, "no extension"),
        (obj(CORNERS, [[0, 1, 8]]), "a.obj", MeshError, "polygon 0"),
        (off(CORNERS, [[0, 1, 2], [0, 1, 8]]), "a.off", MeshError, "polygon 1"),
        (ply(CORNERS, [[0, 1, 2], [0, 1, -1]]), "a.ply", MeshError, "polygon 1"),
        (obj(CORNERS, [[0, 1, -1]]), "a.obj", FileError, "counts from 1"),
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nf -4 -2 -1\n", "a.obj", MeshError, "polygon 0"),
        (obj(CORNERS, [[0, 1]]), "a.obj", MeshError, "2 corners"),
        ("v 0 0 0\nv 1 nan 0\nv 1 1 0\nf 1 2 3\n", "a.obj", MeshError, "vertex 1"),
        ("v 0 0 0\nv 1 x 0\nv 1 1 0\nf 1 2 3\n", "a.obj", FileError, "not a number: x"),
        ("v 0 0 0\nv 1 0\nv 1 1 0\nf 1 2 3\n", "a.obj", FileError, "vertex 1"),
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 c\n", "a.obj", FileError, "whole number"),
        (off(CORNERS, QUADS)[:-12], "a.off", FileError, "promises"),
        (off(CORNERS, QUADS)[:-3], "a.off", FileError, "polygon 5"),
        (ply(CORNERS, QUADS)[:-10], "a.ply", FileError, "promises"),
        (ply([*CORNERS[:7], [0, np.inf, 0]], QUADS), "a.ply", MeshError, "vertex 7"),
        (binary_stl(cube_triangles() * [1, np.nan, 1]), "a.stl", MeshError, "vertex 0"),
        (binary_stl(cube_triangles())[:-1], "a.stl", FileError, "counts 12"),
        (ascii_stl(cube_triangles())[:-60], "a.stl", FileError, "instead of three each"),
    ],
)
def test_bad_files_are_named(read, tmp_path, content, name, kind, words):
    with pytest.raises(kind) as caught:
        read(content, name)
    assert words in str(caught.value)
    assert caught.value.file == str(tmp_path / name)
    assert caught.value.hint


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        read_mesh(tmp_path / "a.obj")
    (tmp_path / "b.obj").mkdir()
    with pytest.raises(FileError, match="folder"):
        read_mesh(tmp_path / "b.obj")


@pytest.mark.parametrize("name", ["fandisk.off", "nut.ply", "bunny.obj", "shuttle.obj", "cow.obj"])
def test_real_meshes_are_closed(name):
    path = REAL_MESHES / name
    if not path.exists():
        pytest.skip(f"{name} is not here")
    soundness = inspect(read_mesh(path))
    assert soundness.closed
    assert soundness.bodies == 1
    assert soundness.volumes[0] > 0


def test_obj_groups_and_objects_name_their_polygons(tmp_path):
    path = tmp_path / "two.obj"
    corners = [f"v {x} {y} {z}" for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    faces = [
        "o box",
        "g base walls",
        "f 1 3 4 2",
        "g walls",
        "f 1 2 6 5",
        "f 3 7 8 4",
        "g",
        "f 5 6 8 7",
    ]
    path.write_text("\n".join([*corners, *faces, ""]))
    groups = read_mesh(path).groups
    assert {name: polygons.tolist() for name, polygons in groups.items()} == {
        "box": [0, 1, 2, 3],
        "base": [0],
        "walls": [0, 1, 2],
    }


def test_groups_follow_polygons_that_are_split(tmp_path):
    path = tmp_path / "bent.obj"
    corners = ["v 0 0 0", "v 1 0 0", "v 1 1 0.2", "v 0 1 0", "v 2 0 0", "v 2 1 0"]
    path.write_text(
        "\n".join([*corners, "g bent", "f 1 2 3 4", "g rest", "f 2 5 3", "f 5 6 3", ""])
    )
    mesh = read_mesh(path)
    assert mesh.polygon_count == 4
    assert {name: polygons.tolist() for name, polygons in mesh.groups.items()} == {
        "bent": [0, 1],
        "rest": [2, 3],
    }
