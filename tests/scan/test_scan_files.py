"""Scans as files give them: meshes, tables, arrays, PLY files without faces."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.errors import FileError
from ffdcli.scan.read import is_scan, read_scan
from support.damage import damage

POINTS = np.random.default_rng(3).normal(size=(40, 3))
NORMALS = np.random.default_rng(4).normal(size=(40, 3))
ROWS = np.column_stack([POINTS, NORMALS])


def ply(values, names, form="ascii", body=None):
    head = [f"ply\nformat {form} 1.0\nelement vertex {len(values)}"]
    head += [f"property double {name}" for name in names]
    text = "\n".join([*head, "end_header\n"]).encode()
    if body is None:
        body = "".join(" ".join(map(repr, row)) + "\n" for row in values.tolist()).encode()
    return text + body


def table(values, separator=" ", head=""):
    return (head + "\n".join(separator.join(map(repr, row)) for row in values.tolist())).encode()


def npz(file, **arrays):
    np.savez(file, **arrays)
    return file.read_bytes()


AXES = ["x", "y", "z", "nx", "ny", "nz"]
CLOUDS = {
    "binary.ply": ply(ROWS, AXES, "binary_little_endian", ROWS.astype("<f8").tobytes()),
    "text.ply": ply(ROWS, AXES),
    "plain.ply": ply(POINTS, AXES[:3]),
    "plain.xyz": b"# from a scanner\n\n" + table(POINTS),
    "more.xyz": table(np.column_stack([POINTS, np.arange(40)])),
    "named.csv": table(ROWS, ",", "x,y,z,nx,ny,nz\n"),
    "german.csv": table(POINTS, ";", "X;Y;Z\n"),
}


@pytest.mark.parametrize("name", CLOUDS)
def test_points_are_read_exactly(tmp_path, name):
    (tmp_path / name).write_bytes(CLOUDS[name])
    scan = read_scan(tmp_path / name)
    np.testing.assert_array_equal(scan.points, POINTS)
    assert len(scan.triangles) == 0
    if name in ("binary.ply", "text.ply", "named.csv"):
        np.testing.assert_array_equal(scan.normals, NORMALS)
    else:
        assert scan.normals is None
    assert is_scan(tmp_path / name)


def test_arrays_are_read_and_told_from_a_field(tmp_path):
    file = tmp_path / "a.npz"
    npz(file, points=POINTS, normals=NORMALS)
    assert is_scan(file)
    np.testing.assert_array_equal(read_scan(file).normals, NORMALS)
    npz(file, points=POINTS, displacements=POINTS)
    assert not is_scan(file)
    (tmp_path / "f.csv").write_text("x,y,z,dx,dy,dz\n1,2,3,0,0,0\n")
    assert not is_scan(tmp_path / "f.csv")


def test_a_mesh_is_one_of_triangles(tmp_path):
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
    (tmp_path / "s.obj").write_text(square)
    scan = read_scan(tmp_path / "s.obj")
    corners = scan.points[scan.triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(area.sum(axis=0) / 2, [0, 0, 1])


LONG = "1 2 3\n" * 30
BAD = {
    "empty.xyz": (b"", "holds no points"),
    "one.xyz": (b"1 2 3\n", "holds 1 point, and a scan needs at least 20"),
    "nan.xyz": (b"1 2 3\n4 5 nan\n" * 20, "point 2 holds a number that is not finite"),
    "huge.xyz": (b"1 2 3\n4 5 1e200\n" * 20, "point 2 holds a number larger"),
    "short.xyz": (b"1 2 3\n4 5\n" * 20, "a row is no point"),
    "words.xyz": (b"1 2 3\nfour 5 6\n" * 20, "a row is no point"),
    "same.xyz": (b"1 2 3\n" * 30, "all points are in one place"),
    "bytes.xyz": (b"\xff\xfe\x00\x01" * 30, "no plain text"),
    "flat.ply": (ply(POINTS[:, :2], ["x", "y"]), "no element vertex with properties x, y and z"),
    "cut.ply": (CLOUDS["binary.ply"][:-100], "cut.ply"),
    "word.ply": (ply(POINTS, AXES[:3], body=b"a b c\n" * 40), "a vertex has no number"),
    "no.npz": (b"PK", "no .npz file"),
    "nan.obj": (b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "nan.obj"),
    "empty.stl": (b"solid a\nendsolid a\n", "empty.stl"),
    "what.doc": (LONG.encode(), "cannot tell the format"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_scan_is_refused_by_name(tmp_path, name):
    content, words = BAD[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError) as caught:
        read_scan(tmp_path / name)
    assert words in str(caught.value)
    assert name in str(caught.value)


def test_arrays_of_another_shape_are_refused(tmp_path):
    npz(tmp_path / "a.npz", points=POINTS[:, :2])
    with pytest.raises(FileError, match=r"`points` has the shape \(40, 2\)"):
        read_scan(tmp_path / "a.npz")
    npz(tmp_path / "a.npz", normals=NORMALS)
    with pytest.raises(FileError, match="`points` is missing"):
        read_scan(tmp_path / "a.npz")


def arrays():
    content = io.BytesIO()
    np.savez(content, points=POINTS, normals=NORMALS)
    return content.getvalue()


@pytest.mark.parametrize("name", [*CLOUDS, "arrays.npz"])
@settings(max_examples=25, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_damaged_files_are_read_or_refused(tmp_path_factory, name, data):
    file = tmp_path_factory.getbasetemp() / name
    file.write_bytes(damage(CLOUDS.get(name) or arrays(), data))
    try:
        scan = read_scan(file) if is_scan(file) else None
    except FileError:
        return
    if scan is not None:
        assert np.isfinite(scan.points).all()
        assert scan.points.shape[1] == 3
