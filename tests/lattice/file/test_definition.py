"""Arrays of a lattice file: from .csv, .npy and nested lists."""

import numpy as np
import pytest

from ffdcli.errors import LatticeError
from ffdcli.lattice import load_lattice, parse_lattice
from ffdcli.lattice.file.source import parse_yaml

TEXT = "version: 1\ndegree: [1, 1, 1]\npoints: [2, 3, 4]\nedits:\n  - net: {}\n"
NET = np.arange(72.0).reshape(2, 3, 4, 3) / 7
ROWS = [",".join(map(repr, row)) for row in NET.reshape(-1, 3).tolist()]


def load(tmp_path, net):
    path = tmp_path / "lattice.yaml"
    path.write_text(TEXT.format(net))
    return load_lattice(path).definitions[0].nets[0]


@pytest.mark.parametrize("header", ["", "x,y,z\n", "X, Y, Z\n\n"])
def test_csv_has_w_fastest(tmp_path, header):
    (tmp_path / "net.csv").write_text(header + "\n".join(ROWS) + "\n")
    assert np.array_equal(load(tmp_path, "net.csv"), NET)


def test_npy_is_relative_to_the_lattice_file(tmp_path):
    (tmp_path / "sub").mkdir()
    np.save(tmp_path / "sub" / "net.npy", NET)
    assert np.array_equal(load(tmp_path, "sub/net.npy"), NET)


def test_nested_lists(tmp_path):
    assert np.array_equal(load(tmp_path, NET.tolist()), NET)


def refuse(tmp_path, words):
    name = next(p.name for p in tmp_path.iterdir() if p.name.startswith("net"))
    with pytest.raises(LatticeError, match=words) as caught:
        load(tmp_path, name)
    assert caught.value.line == 5
    assert caught.value.key == "edits[0].net"
    assert name in caught.value.message


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (NET[:, :, :3], "needed are"),
        (NET.reshape(-1, 3), "needed are"),
        (NET > 3, "bool"),
        (NET + 1j, "complex"),
        (
            np.where(NET[1, 0, 2, 1] == NET, np.nan, NET),
            r"not finite, at control point \[1, 0, 2\]",
        ),
    ],
)
def test_wrong_arrays_are_refused(tmp_path, array, words):
    np.save(tmp_path / "net.npy", array)
    refuse(tmp_path, words)


def test_pickled_arrays_are_refused(tmp_path):
    np.save(tmp_path / "net.npy", np.array([object()]), allow_pickle=True)
    refuse(tmp_path, "cannot be read")


def test_garbage_is_refused(tmp_path):
    (tmp_path / "net.npy").write_bytes(b"not numpy")
    refuse(tmp_path, "cannot be read")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("\n".join(ROWS[:-1]), "23 rows"),
        ("\n".join([*ROWS[:4], "1,2", *ROWS[5:]]), "row 5"),
        ("\n".join([*ROWS[:4], "1,2,three", *ROWS[5:]]), "row 5"),
        ("\n".join([*ROWS[:4], "1,2,inf", *ROWS[5:]]), r"not finite, at control point \[0, 1, 0\]"),
        ("", "0 rows"),
    ],
)
def test_wrong_csv_is_refused(tmp_path, text, words):
    (tmp_path / "net.csv").write_text(text)
    refuse(tmp_path, words)


@pytest.mark.parametrize("volume", ["nurbs", "tspline"])
@pytest.mark.parametrize("edit", ["net", "weights"])
@pytest.mark.parametrize("lists", ["[]", "[[]]", "[[[]]]", "[[[[]]]]", "[[], [[1]]]"])
def test_empty_lists_are_refused(volume, edit, lists):
    octree = "octree: {depth: 1}\n" if volume == "tspline" else ""
    text = f"version: 1\nvolume: {volume}\n{octree}edits:\n- {edit}: {lists}\n"
    with pytest.raises(LatticeError) as caught:
        parse_lattice(*parse_yaml(text, "l.yaml"))
    assert caught.value.key.startswith(f"edits[0].{edit}")
