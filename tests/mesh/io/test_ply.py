"""PLY files: any number of corners, any type, byte order and further columns; none misread."""

import struct
from pathlib import Path

import numpy as np
import pytest

from ffdcli.errors import FileError
from ffdcli.mesh.io.ply import decode_ply
from ffdcli.mesh.io.raw_mesh import binary_resolution
from support.mesh_models import CORNERS, QUADS

MIXED = [*QUADS[:5], [1, 3, 7], [1, 7, 5]]
PATH = Path("a.ply")
TYPES = {"char": "b", "uint8": "B", "short": "h", "ushort": "H", "int32": "i", "uint": "I"}


def rich(order, count="uint8", index="int32"):
    """A file with colours, normals behind the faces' corners, and an element of edges first."""
    sign = {"binary_little_endian": "<", "binary_big_endian": ">"}[order]
    body = struct.pack(f"{sign}Bi", 9, 1)
    for n, (x, y, z) in enumerate(CORNERS):
        body += struct.pack(f"{sign}dBdd", z, n, x, y)
    for loop in MIXED:
        body += struct.pack(f"{sign}f", 0.5)
        body += struct.pack(f"{sign}{TYPES[count]}{len(loop)}{TYPES[index]}", len(loop), *loop)
        body += struct.pack(f"{sign}B2fB", 2, 0.25, 0.75, 7)
    return (
        f"ply\r\nformat {order} 1.0\r\ncomment made by hand\r\nelement edge 1\r\n"
        "property uchar a\r\nproperty int b\r\nelement vertex 8\r\nproperty double z\r\n"
        "property uchar red\r\nproperty double x\r\nproperty double y\r\nelement face 7\r\n"
        f"property float area\r\nproperty list {count} {index} vertex_indices\r\n"
        "property list uchar float texcoord\r\nproperty uchar flags\r\nend_header\r\n"
    ).encode() + body


@pytest.mark.parametrize("order", ["binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize(
    ("count", "index"), [("uint8", "int32"), ("ushort", "uint"), ("char", "uint8")]
)
def test_binary(order, count, index):
    found = decode_ply(rich(order, count, index), PATH)
    assert np.array_equal(found.vertices, CORNERS)
    assert found.resolution == binary_resolution(CORNERS, np.float64)
    loops = np.split(found.corners, found.starts[1:-1])
    assert [loop.tolist() for loop in loops] == MIXED


@pytest.mark.parametrize(
    ("small", "resolution"), [("1e-6", 5e-7), ("1e-9", 4 * np.spacing(np.float32(1)))]
)
def test_text_of_any_layout(small, resolution):
    numbers = " ".join(f"{x} {y}\n{z} 255" for x, y, z in [(0.125, 0, 0), (1, 0, 0), (1, small, 0)])
    header = (
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar red\nelement face 1\n"
        "property list uchar int vertex_index\n"
        "property uchar flags\nend_header\n"
    )
    found = decode_ply(f"{header}{numbers}\n3 0 1 2 9\n".encode(), PATH)
    assert found.vertices.tolist() == [[0.125, 0, 0], [1, 0, 0], [1, float(small), 0]]
    assert (found.corners.tolist(), found.starts.tolist()) == ([0, 1, 2], [0, 3])
    assert found.resolution == resolution


def test_remarks_without_their_word():
    """Blender 2.47 wrote its name before the elements without the word `comment`."""
    header = (
        "ply\nformat ascii 1.0\nCreated by Blender3D 247\nelement vertex 3\nproperty float x\n"
        "property float y\nproperty float z\nelement face 1\n"
        "property list uchar int vertex_index\nend_header\n"
    )
    body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    assert decode_ply(f"{header}{body}".encode(), PATH).corners.tolist() == [0, 1, 2]
    # After an element such a line may be a column that is misspelled.
    late = header.replace("property float z", "propety float z")
    with pytest.raises(FileError, match="propety"):
        decode_ply(f"{late}{body}".encode(), PATH)


def test_rows_longer_than_declared():
    header = (
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 2\nproperty list uchar int vertex_index\nend_header\n"
    )
    body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 0.5 0.5\n3 0 1 2 0.5 0.5\n"
    with pytest.raises(FileError, match="more entries than the header declares"):
        decode_ply(f"{header}{body}".encode(), PATH)


def test_every_cut_is_noticed():
    whole = rich("binary_little_endian")
    for length in range(len(whole)):
        with pytest.raises(FileError, match="header"):
            decode_ply(whole[:length], PATH)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"element face 7", b"element face 7000000000000"),
        (b"element face 7", b"element face -7"),
        (b"element face 7", b"element face many"),
        (b"property double x", b"property quad x"),
        (b"property double x", b"property"),
        (b"list uint8 int32", b"list float int32"),
        (b"format binary_little_endian", b"format binary"),
        (b"format binary_little_endian 1.0", b"comment"),
        (b"element vertex 8", b"element points 8"),
    ],
)
def test_bad_headers_are_named(old, new):
    whole = rich("binary_little_endian")
    assert old in whole
    with pytest.raises(FileError, match="header") as caught:
        decode_ply(whole.replace(old, new), PATH)
    assert caught.value.hint
