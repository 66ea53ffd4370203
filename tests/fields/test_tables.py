"""Fields in .csv and .npz files."""

import io
import zipfile

import numpy as np
import pytest

from ffdcli.errors import FileError
from ffdcli.fields.formats import FIELD_SUFFIXES
from ffdcli.fields.read import read_field
from support.field_files import npz

POINTS = np.array([[1, 2, 3], [4, 5, 6.5]])
GOALS = np.array([[0, 0, 0.5], [1e-3, -2, 7]])


def write(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def refusal(path, **how):
    with pytest.raises(FileError) as caught:
        read_field(path, **how)
    assert caught.value.file == str(path)
    assert caught.value.hint
    return caught.value.message


@pytest.mark.parametrize(("columns", "by"), [("dx,dy,dz", True), ("tx,ty,tz", False)])
@pytest.mark.parametrize("weights", [None, [2, 0.25]])
def test_a_table_has_displacements_or_targets_and_weights(tmp_path, columns, by, weights):
    header = f"x,y,z,{columns}" + (",weight" if weights else "")
    rows = np.column_stack([POINTS, GOALS, *([weights] if weights else [])])
    text = "\n".join([header, *(",".join(map(repr, row)) for row in rows.tolist())])
    field = read_field(write(tmp_path, "f.csv", text))
    np.testing.assert_array_equal(field.sources, POINTS)
    np.testing.assert_array_equal(field.goals, GOALS)
    np.testing.assert_array_equal(field.displacements, GOALS if by else GOALS - POINTS)
    np.testing.assert_array_equal(field.weights, weights or [1, 1])
    assert field.by == by


@pytest.mark.parametrize("goals", ["displacements", "targets"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_have_the_same(tmp_path, goals, order):
    arrays = {"points": POINTS.copy(order), goals: GOALS.copy(order), "weights": np.array([1, 3])}
    field = read_field(write(tmp_path, "f.npz", npz(**arrays)))
    np.testing.assert_array_equal(field.sources, POINTS)
    np.testing.assert_array_equal(field.goals, GOALS)
    np.testing.assert_array_equal(field.weights, [1, 3])
    assert field.by == (goals == "displacements")


HEAD = "x,y,z,dx,dy,dz\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "holds no pairs"),
        (HEAD, "holds no pairs"),
        ("1,2,3,4,5,6\n", "row 1 should be the header"),
        ("x,y,z,dx,dy,dz,mass\n1,2,3,4,5,6,7\n", "row 1 should be the header"),
        (HEAD + "1,2,3,4,5,6,7\n", "row 2 is not six numbers"),
        ("x,y,z,tx,ty,tz,weight\n1,2,3,4,5,6\n", "row 2 is not seven numbers"),
        (HEAD + "1,2,3,0,0,0\n1,2,3,4,5,nan\n1,2,inf,4,5,6\n", "pair 2 holds a number that is not"),
        (HEAD + "1,2,3,4,5,1e31\n", "larger than 1e+30"),
        ("x,y,z,tx,ty,tz,weight\n1,2,3,4,5,6,-1\n", "pair 1 has the weight -1"),
        ("x,y,z,tx,ty,tz,weight\n1,2,3,4,5,6,0\n", "all weights are 0"),
    ],
)
def test_wrong_tables_are_refused(tmp_path, text, words):
    assert words in refusal(write(tmp_path, "f.csv", text))


def test_the_bad_rows_are_counted(tmp_path):
    text = HEAD + "1,2,3,0,0,0\n" + "1,2,3,4,5,nan\n" * 3
    assert refusal(write(tmp_path, "f.csv", text)).endswith(", and so do 2 others")


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"points": POINTS}, "neither is given"),
        ({"points": POINTS, "targets": GOALS, "displacements": GOALS}, "both"),
        ({"targets": GOALS}, "`points` is missing"),
        ({"points": POINTS, "targets": GOALS, "weigths": [1, 1]}, "'weigths' is not known"),
        ({"points": POINTS, "targets": GOALS[:1]}, "`targets` has the shape (1, 3), not (2, 3)"),
        ({"points": POINTS[:, :2], "targets": GOALS}, "`points` has the shape (2, 2)"),
        ({"points": POINTS, "targets": GOALS, "weights": np.ones((2, 1))}, "not (2,)"),
        ({"points": POINTS, "targets": GOALS.astype(complex)}, "complex128, not real numbers"),
        ({"points": POINTS, "targets": GOALS.astype(object)}, "object, not real numbers"),
        ({"points": np.zeros((0, 3)), "targets": np.zeros((0, 3))}, "holds no points"),
        ({"points": POINTS, "targets": GOALS * np.nan}, "point 1 holds a number that is not"),
    ],
)
def test_wrong_arrays_are_refused(tmp_path, arrays, words):
    assert words in refusal(write(tmp_path, "f.npz", npz(**arrays)))


def test_an_array_that_claims_more_than_it_holds_is_refused_without_taking_memory(tmp_path):
    header = b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f8', 'fortran_order': False, "
    header += b"'shape': (99999999999, 3), }"
    member = header.ljust(127) + b"\n" + bytes(48)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("points.npy", member)
    assert "should have the shape" in refusal(write(tmp_path, "f.npz", stream.getvalue()))


def test_an_array_that_unpacks_to_too_much_is_refused(tmp_path):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("points.npy", bytes(60_000_000))
    path = write(tmp_path, "f.npz", stream.getvalue())
    assert "too many for 1,000,000 points" in refusal(path)


def test_too_many_points_are_refused(tmp_path):
    text = HEAD + "1,2,3,0,0,0\n" * 3
    assert "more than 2 rows" in refusal(write(tmp_path, "f.csv", text), most=2)
    path = write(tmp_path, "f.npz", npz(points=np.ones((3, 3)), targets=np.ones((3, 3))))
    assert "more than the 2 that are allowed" in refusal(path, most=2)


def test_the_format_is_told_by_the_extension(tmp_path):
    path = write(tmp_path, "f.xlsx", "")
    assert "'.xlsx' is not that of a field" in refusal(path)
    with pytest.raises(FileError, match=r"\.csv, \.npz, \.vtu") as caught:
        read_field(path)
    assert all(suffix in caught.value.hint for suffix in FIELD_SUFFIXES)
    assert "there is no such file" in refusal(tmp_path / "missing.csv")
    assert "there is no such file" in refusal(tmp_path / "missing.npz")
    assert "there is no such file" in refusal(tmp_path / "missing.vtu")
    assert "folder" in refusal((tmp_path / "f.npz").mkdir() or tmp_path / "f.npz")


@pytest.mark.parametrize("how", [{"name": "U"}, {"targets": "g.csv"}])
def test_names_of_fields_are_for_mesh_files(tmp_path, how):
    assert "a .csv file has its own" in refusal(write(tmp_path, "f.csv", HEAD), **how)
