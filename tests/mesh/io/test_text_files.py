"""OBJ, STL, PLY and OFF as programs write them: names, line ends, strips, and what is left out."""

import struct
from pathlib import Path

import numpy as np
import pytest

from ffdcli.errors import FileError, MeshError
from ffdcli.mesh import read_mesh
from ffdcli.mesh.io.ply import decode_ply
from support.mesh_models import CORNERS, QUADS, ascii_stl, binary_stl, cube_triangles, off, ply

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
FACES = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@pytest.fixture
def read(tmp_path):
    def read_content(content, name):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_mesh(path)

    return read_content


@pytest.mark.parametrize(
    "line",
    [
        "# old\\new\\",
        "# old\\new\\  ",
        "usemtl lib\\steel\\",
        "g a\\",
        "o a\\ \t",
        "mtllib b\\ #\\",
    ],
)
def test_comments_and_names_in_obj_may_end_in_a_backslash(read, line):
    assert read(f"{TETRAHEDRON}{line}\n{FACES}", "a.obj").polygon_count == 4


def test_obj_names_keep_their_backslash(read):
    mesh = read(f"{TETRAHEDRON}usemtl lib\\steel\\\n{FACES}", "a.obj")
    assert [each.name for each in mesh.labels.materials] == ["lib\\steel\\"]


@pytest.mark.parametrize("end", ["\\\n", "\\  \n", "\\\t\r\n", "\\\n \\\n"])
def test_numbers_in_obj_continue_after_a_backslash(read, end):
    faces = f"f 1 3 {end} 2 # a comment \\\nf 1 {end}2 4\n" + "".join(FACES.splitlines(True)[2:])
    mesh = read(f"v 0 0 {end} 0\n" + TETRAHEDRON[8:] + faces, "a.obj")
    assert mesh.corners.tolist() == [0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_byte_order_mark_is_no_part_of_the_first_statement(read, encoding):
    assert list(read(f"o naïve\n{TETRAHEDRON}{FACES}".encode(encoding), "a.obj").groups) == [
        "naïve"
    ]
    assert read(off(CORNERS, QUADS).encode(encoding), "a.off").polygon_count == 6
    assert read(ascii_stl(cube_triangles()).encode(encoding), "a.stl").polygon_count == 12


def test_statements_of_obj_that_are_not_read_are_counted(read):
    other = "surf 0 1 0 1 1 2\ncall more.obj\ncsh -ls\nvp 1 2\nsurf 0 1 0 1 1 2\nfree words\n"
    mesh = read(f"{TETRAHEDRON}vn 0 0 1\ns off\n{other}{FACES}", "a.obj")
    assert mesh.notes == (
        "6 lines that are no statement of polygons left out: 2 surf, 1 call, 1 csh, 1 vp, 1 free",
    )


@pytest.mark.parametrize(
    "name", ["facet plate", "a facet normal 0 0 1", "vertex 1 2 3", "FACET", "endfacet", "solid"]
)
def test_names_of_stl_solids_may_hold_its_words(read, name):
    one = ascii_stl(cube_triangles()).splitlines()
    text = "\n".join([f"solid {name}", *one[1:-1], f"endsolid {name}", ""])
    assert read(text + text.replace(" 1.0", " 2.0"), "a.stl").polygon_count == 24


def test_stl_on_one_line(read):
    text = ascii_stl(cube_triangles())
    assert read(" ".join(text.split()), "a.stl").polygon_count == 12


def test_bytes_after_the_last_triangle_of_stl_are_noted(read):
    mesh = read(binary_stl(cube_triangles()) + b"made by", "a.stl")
    assert mesh.polygon_count == 12
    assert mesh.notes == ("7 bytes after the last triangle left out: the header counts 12",)
    mesh = read(ascii_stl(cube_triangles()) + "made by", "a.stl")
    assert mesh.notes == ("7 bytes after the last solid left out",)


def test_binary_stl_may_begin_like_text(read):
    data = binary_stl(cube_triangles())
    assert read(b"solid facet".ljust(80) + data[80:], "a.stl").polygon_count == 12
    assert read(b"solid facet".ljust(80) + data[80:] + b"12345", "a.stl").polygon_count == 12


def test_facets_of_stl_with_other_than_three_vertices(read):
    lines = ascii_stl(cube_triangles()).splitlines(True)
    vertices = [n for n, line in enumerate(lines) if "vertex" in line]
    moved = lines[vertices[5]]
    swapped = [line for n, line in enumerate(lines) if n != vertices[5]]
    swapped.insert(vertices[0], moved)
    with pytest.raises(FileError, match=r"36 vertices .* facet 0 .* has 4"):
        read("".join(swapped), "a.stl")
    last = len(lines) - 1 - next(n for n, line in enumerate(lines[::-1]) if "endfacet" in line)
    mesh = read("".join(lines[: last + 1]), "a.stl")
    assert mesh.notes == ("the last solid has no end: the file may be cut short",)


def strips(lists, encoding="ascii", extra=""):
    """A PLY file of the corners of a cube with strips of triangles."""
    head = (
        f"ply\nformat {encoding} 1.0\nelement vertex 8\nproperty float x\nproperty float y\n"
        f"property float z\n{extra}element tristrips {len(lists)}\n"
        "property list int int vertex_indices\nend_header\n"
    )
    if encoding == "ascii":
        rows = [*CORNERS.tolist(), *([len(each), *each] for each in lists)]
        return head + "".join(" ".join(map(str, row)) + "\n" for row in rows)
    body = CORNERS.astype(">f4").tobytes()
    return (
        head.encode()
        + body
        + b"".join(struct.pack(f">{len(each) + 1}i", len(each), *each) for each in lists)
    )


# Two halves of the cube's surface, joined in one list; the corners of each triangle by hand.
STRIPS = [[0, 2, 1, 3, 5, 7, 4, 6, -1, 0, 1, 4, 5], [], [2, 6, 3, 7], [0, 4, 2, 6]]
TRIANGLES = [
    [0, 2, 1],
    [1, 2, 3],
    [1, 3, 5],
    [5, 3, 7],
    [5, 7, 4],
    [4, 7, 6],
    [0, 1, 4],
    [4, 1, 5],
] + [[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6]]


@pytest.mark.parametrize("encoding", ["ascii", "binary_big_endian"])
def test_strips_in_ply(read, encoding):
    mesh = read(strips(STRIPS, encoding), "a.ply")
    found = {tuple(np.roll(t, -int(np.argmin(t)))) for t in mesh.corners.reshape(-1, 3)}
    assert found == {tuple(np.roll(t, -int(np.argmin(t)))) for t in TRIANGLES}


def test_triangles_that_join_strips_are_counted(read):
    mesh = read(strips([[0, 2, 1, 3, 3, 5, 5, 1]]), "a.ply")
    assert mesh.corners.tolist() == [0, 2, 1, 1, 2, 3]
    assert mesh.notes[0].startswith("4 triangles with a vertex twice")


def test_unused_vertices_may_be_no_numbers(read):
    for write, name in ((off, "a.off"), (ply, "a.ply")):
        for bad in (np.nan, np.inf, 1e60):
            mesh = read(write([*CORNERS, [0, bad, 0]], QUADS), name)
            assert len(mesh.vertices) == 8
            assert "1 vertex without a polygon left out" in mesh.notes[0]
            with pytest.raises(MeshError, match=r"vertex 8 of polygon 6 .* not a number"):
                read(write([*CORNERS, [0, bad, 0]], [*QUADS, [8, 0, 1]]), name)


def test_unused_vertices_do_not_hide_the_printed_precision(read):
    rows = CORNERS * 1.2345678
    exact = read(off(rows, QUADS), "a.off").resolution
    assert exact == pytest.approx(0.5e-7, rel=1e-9)
    assert read(off([*rows, [np.nan] * 3], QUADS), "a.off").resolution == exact


@pytest.mark.parametrize("count", ["9" * 20, "4000000000", "9" * 5000], ids=len)
def test_lists_of_ply_longer_than_the_file(read, count):
    with pytest.raises(FileError, match=r"ends before|does not begin"):
        read(ply(CORNERS, [*QUADS, [0, 1, 2]]).replace("3 0 1 2", f"{count} 0 1 2"), "a.ply")


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_ply_counts_are_compared_with_the_size_first(read, encoding):
    data = ply(CORNERS, QUADS, encoding)
    data = data.encode() if isinstance(data, str) else data
    data = data.replace(b"element face 6", b"element face 100000000")
    with pytest.raises(FileError, match=r"100000000 of element face.* cannot hold so many"):
        read(data, "a.ply")
    # A hundred million lists without an entry.
    junk = b"element junk 100000000\nproperty list uchar int a\nelement vertex"
    with pytest.raises(FileError, match="100000000 of element junk"):
        read(data.replace(b"element vertex", junk), "a.ply")


@pytest.mark.parametrize("seed", range(3))
def test_binary_lists_of_any_lengths(seed):
    rng = np.random.default_rng(seed)
    counts = np.repeat(rng.integers(3, 6, 400), rng.integers(1, 40, 400))
    faces = [rng.integers(0, 8, count).tolist() for count in counts]
    head, _, body = ply(CORNERS, [[0, 1, 2]], "binary_little_endian").partition(b"end_header\n")
    head = head.replace(b"element face 1\n", b"element face %d\n" % len(faces))
    count_kind, kind = head.split(b"property list ")[1].split()[:2]
    codes = {b"uchar": "B", b"int": "i", b"uint": "I"}
    rows = b"".join(
        struct.pack(f"<{codes[count_kind]}{len(face)}{codes[kind]}", len(face), *face)
        for face in faces
    )
    mesh = decode_ply(head + b"end_header\n" + body[: 8 * 24] + rows, Path("a.ply"))
    assert np.array_equal(np.diff(mesh.starts), counts)
    assert mesh.corners.tolist() == [corner for face in faces for corner in face]


def test_one_long_number_does_not_cost_memory_for_all(read):
    x = "1." + "0" * 100_000
    mesh = read(TETRAHEDRON.replace("v 1 ", f"v {x} ") + FACES + "v 1 1 1\n" * 20_000, "a.obj")
    assert mesh.bounds.tolist() == [[0, 0, 0], [1, 1, 1]]


def test_kinds_of_off(read):
    assert read(off(CORNERS, QUADS).replace("OFF", "STCNOFF", 1), "a.off").polygon_count == 6
    # The counts may follow at once, after blanks, and before a remark.
    cube = off(CORNERS, QUADS).replace("OFF\n", "\t  OFF", 1).replace("\n", " # or not\n", 1)
    assert read(cube, "a.off").polygon_count == 6
    for kind in ("4OFF", "nOFF", "C4nOFF", "OFF BINARY"):
        with pytest.raises(FileError, match=f"not with {kind}"):
            read(off(CORNERS, QUADS).replace("OFF", kind, 1), "a.off")
    assert read(off(CORNERS, QUADS) + "3 0 1 2\n", "a.off").notes == (
        "1 line after the last polygon left out",
    )


def test_collada_names_the_package_that_it_needs(read, monkeypatch):
    monkeypatch.setattr("ffdcli.mesh.io.scenes.find_spec", lambda _name: None)
    with pytest.raises(FileError, match=r"pycollada.*ffdcli\[dae\]"):
        read("<COLLADA/>", "a.dae")


def test_many_groups_in_obj(read):
    faces = "".join(f"g a{n} b{n % 3}\n{FACES.splitlines()[n % 4]}\n" for n in range(20_000))
    mesh = read(TETRAHEDRON + faces, "a.obj")
    assert len(mesh.groups) == 20_003
    assert mesh.groups["a19999"].tolist() == [19_999]
    fewer = mesh.without(np.arange(20_000) % 2 == 0)
    assert fewer.groups["a19999"].tolist() == [9_999]
    assert fewer.groups["a0"].tolist() == []
    kept = np.arange(1, 20_000, 2)
    assert np.array_equal(kept[fewer.groups["b1"]], np.arange(1, 20_000, 6))


def test_polygons_in_too_many_groups(read, monkeypatch):
    monkeypatch.setattr("ffdcli.mesh.io.obj.MOST_MEMBERS", 100)
    names = " ".join(f"a{n}" for n in range(30))
    mesh = read(f"{TETRAHEDRON}g {names}\n{FACES}", "a.obj")
    assert mesh.groups == {}
    assert mesh.notes == (
        "4 polygons in up to 31 groups each are more than 100 members: the groups are left out",
    )


@pytest.mark.parametrize("polygon", ["1 " * 30_000, "1 2 3 " * 10_000])
def test_polygons_of_repeated_vertices(read, polygon):
    mesh = read(f"{TETRAHEDRON}{FACES}f {polygon}\n", "a.obj")
    assert mesh.polygon_count >= 5
    assert np.diff(mesh.starts)[:4].tolist() == [3, 3, 3, 3]
