"""Texture coordinates read from files, and kept by all that rebuilds a mesh."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
import trimesh

from ffdcli.mesh import read_mesh, repair
from support.mesh_models import CORNERS, QUADS

BOX_V = "".join("v {:g} {:g} {:g}\n".format(*row) for row in CORNERS)


def place(point):
    """The texture coordinates that a point has in most tests here: affine."""
    x, y, z = np.moveaxis(np.asarray(point, dtype=float), -1, 0)
    return np.stack([0.5 + 0.25 * x - 0.125 * y, 1.5 * z + 0.5 * x - 0.25 * y], axis=-1)


def follows(mesh):
    """Whether every corner has the place of its vertex."""
    return np.allclose(mesh.uv, place(mesh.vertices[mesh.corners]), atol=1e-12)


def obj_faces(loops):
    """Faces with a `vt` of their own at each corner, and these: they must not be mixed up."""
    lines, count = [], 0
    for loop in loops:
        lines += ["vt {!r} {!r}".format(*row) for row in place(CORNERS[loop]).tolist()]
        lines.append("f " + " ".join(f"{v + 1}/{count + k + 1}/1" for k, v in enumerate(loop)))
        count += len(loop)
    return "\n".join([*lines, ""])


def read(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_mesh(path)


def test_obj_corners(tmp_path):
    mesh = read(tmp_path / "a.obj", BOX_V + obj_faces(QUADS))
    assert mesh.uv.shape == (24, 2)
    assert follows(mesh)
    assert mesh.notes == ()


def test_obj_without_a_word_of_it(tmp_path):
    faces = "".join("f " + " ".join(f"{v + 1}//1" for v in loop) + "\n" for loop in QUADS)
    assert read(tmp_path / "a.obj", BOX_V + faces).uv is None
    # Places that no face uses are none.
    assert read(tmp_path / "a.obj", BOX_V + "vt 0 1\n" + faces).uv is None


def test_obj_counts_back_and_seams(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0.1\nvt 0.2 0.3\nvt 0.4 0.5 0.6\nf -3/-3 -2/-2 -1/-1\n"
    text += "v 0 1 0\nvt 7 8\nf -4/1 -2/-1 -1/4\n"
    mesh = read(tmp_path / "a.obj", text)
    assert mesh.uv.tolist() == [[0.1, 0], [0.2, 0.3], [0.4, 0.5], [0.1, 0], [7, 8], [7, 8]]
    assert mesh.corners.tolist() == [0, 1, 2, 0, 2, 3]


@pytest.mark.parametrize("bad", ["3/9", "3/0", "3", "3/-9", "3/4"])
def test_obj_polygons_that_miss_some(tmp_path, bad):
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt a b\n"
    mesh = read(tmp_path / "a.obj", f"{text}f 1/1 2/2 {bad}\nf 1/1 3/3 4/2\n")
    assert np.isnan(mesh.uv[:3]).all()
    assert mesh.uv[3:].tolist() == [[0, 0], [1, 1], [1, 0]]
    assert any("texture coordinates of 1 polygon" in note for note in mesh.notes)


def ply_of(rows, names, faces, order="ascii"):
    head = f"ply\nformat {order} 1.0\nelement vertex {len(rows)}\n"
    head += "".join(f"property float {name}\n" for name in ("x", "y", "z", *names))
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
    uv = "property list uchar float texcoord\n" if len(faces[0]) == 2 else ""
    head = (head + uv + "end_header\n").encode()
    if order == "ascii":
        lines = [" ".join(map(repr, row)) for row in rows]
        for lists in faces:
            lines.append(" ".join(f"{len(each)} " + " ".join(map(str, each)) for each in lists))
        return head + "\n".join([*lines, ""]).encode()
    mark = "<" if "little" in order else ">"
    body = b"".join(struct.pack(f"{mark}{len(row)}f", *row) for row in rows)
    for lists in faces:
        for each, kind in zip(lists, "if", strict=False):
            body += struct.pack(f"{mark}B{len(each)}{kind}", len(each), *each)
    return head + body


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("names", [("s", "t"), ("texture_u", "texture_v"), ("u", "v")])
def test_ply_of_vertices(tmp_path, order, names):
    rows = np.column_stack([CORNERS, place(CORNERS)]).tolist()
    assert follows(read(tmp_path / "a.ply", ply_of(rows, names, [(q,) for q in QUADS], order)))


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian"])
def test_ply_of_faces(tmp_path, order):
    faces = [(loop, place(CORNERS[loop]).ravel().tolist()) for loop in QUADS]
    assert follows(read(tmp_path / "a.ply", ply_of(CORNERS.tolist(), (), faces, order)))
    faces[2] = (faces[2][0], [])
    mesh = read(tmp_path / "a.ply", ply_of(CORNERS.tolist(), (), faces, order))
    assert np.isnan(mesh.uv).all(axis=1).tolist() == [8 <= n < 12 for n in range(24)]


def gltf_scene(mirrored=False):
    box = trimesh.creation.box().apply_translation([0.5, 0.5, 0.5])
    corners = np.array(box.vertices)[np.array(box.faces).ravel()]
    body = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    uv = place(corners * [-1, 1, 1] if mirrored else corners)
    look = trimesh.visual.material.PBRMaterial(name="paper")
    body.visual = trimesh.visual.TextureVisuals(uv=uv, material=look)
    scene = trimesh.Scene()
    turn = np.diag([-1.0, 1, 1, 1]) if mirrored else np.eye(4)
    scene.add_geometry(body, node_name="Box", geom_name="Box", transform=turn)
    return scene


@pytest.mark.parametrize("mirrored", [False, True])
def test_glb_turns_v_and_mirrored_parts(tmp_path, mirrored):
    """The file counts v downwards; a mirrored part's corners are turned round, places with them."""
    mesh = read(tmp_path / "a.glb", gltf_scene(mirrored).export(file_type="glb"))
    assert len(mesh.vertices) == 8
    np.testing.assert_allclose(mesh.uv, place(mesh.vertices[mesh.corners]), atol=1e-6)


@pytest.mark.parametrize("kind", ["ubyte", "ushort", "interleaved"])
def test_gltf_numbers_and_strides(tmp_path, kind):
    corners = CORNERS[[0, 1, 3]].astype("<f4")
    uv = np.array([[0, 0], [1, 0], [1, 51 / 255]])
    code, scale = {"ubyte": ("u1", 255), "ushort": ("<u2", 65535), "interleaved": ("<f4", 1)}[kind]
    stored = np.round(uv * scale).astype(code) if scale > 1 else uv.astype(code)
    # Places stand four bytes, or sixteen, from one another.
    table = np.zeros((3, 16 if scale == 1 else 4), np.uint8)
    table[:, : stored.itemsize * 2] = stored.view(np.uint8).reshape(3, -1)
    data = corners.tobytes() + table.tobytes()
    component = {"u1": 5121, "<u2": 5123, "<f4": 5126}[code]
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}}]}],
        "buffers": [{"byteLength": len(data), "uri": "data.bin"}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": table.size, "byteStride": len(table[0])},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": component, "count": 3, "type": "VEC2",
             "normalized": scale > 1},
        ],
    }  # fmt: skip
    (tmp_path / "data.bin").write_bytes(data)
    mesh = read(tmp_path / "a.gltf", json.dumps(tree))
    expected = np.column_stack([uv[:, 0], 1 - uv[:, 1]])
    np.testing.assert_allclose(mesh.uv, expected, atol=1e-6 if scale == 1 else 1e-15)


def test_bent_polygons_take_theirs_along(tmp_path):
    heights = [0.0, 0.1, 0.3, 0.0, 0.2]
    angle = 2 * np.pi * np.arange(5) / 5
    points = np.column_stack([np.cos(angle), np.sin(angle), heights])
    text = "".join("v {!r} {!r} {!r}\n".format(*row) for row in points.tolist())
    text += "v 3 0 0\nv 3 1 0\n"
    text += "".join("vt {!r} {!r}\n".format(*row) for row in place(points).tolist())
    text += "vt {!r} {!r}\nvt {!r} {!r}\n".format(
        *place([3, 0, 0]).tolist(), *place([3, 1, 0]).tolist()
    )
    mesh = read(tmp_path / "a.obj", text + "f 1/1 6/6 7/7 2/2\nf 1/1 2/2 3/3 4/4 5/5\n")
    assert mesh.polygon_count == 5
    assert follows(mesh)


def test_repair_keeps_every_corner_s_own(tmp_path):
    """Turned, dropped, cut, welded, with vertices put in: corners keep what they had."""
    loops = [list(loop) for loop in QUADS]
    loops[1] = loops[1][::-1]
    loops[3] = [*loops[3], loops[3][-2], loops[3][-1]]
    loops.append(loops[0])
    # The last side as two polygons whose border hangs in the middle of two others' edges.
    split = loops.pop(5)
    lines = BOX_V + "v 1 0.5 0\nv 1 0.5 1\n"
    extra = "".join("vt {!r} {!r}\n".format(*place(p).tolist()) for p in ([1, 0.5, 0], [1, 0.5, 1]))
    count = sum(map(len, loops))
    a, b, c, d = split
    own = "".join("vt {!r} {!r}\n".format(*row) for row in place(CORNERS[split]).tolist())
    first, second = count + 1, count + 2
    at = [count + 3 + n for n in range(4)]
    halves = (
        f"f {a + 1}/{at[0]} 9/{first} 10/{second} {d + 1}/{at[3]}\n"
        f"f 9/{first} {b + 1}/{at[1]} {c + 1}/{at[2]} 10/{second}\n"
    )
    mesh = read(tmp_path / "a.obj", lines + obj_faces(loops) + extra + own + halves)
    assert follows(mesh)
    mended, done = repair(mesh)
    said = " ".join(done)
    assert "flipped to match" in said
    assert "inserted into open edges" in said
    assert "dropped" in said
    assert "spike" in said
    assert follows(mended)
    assert mended.uv.shape == (len(mended.corners), 2)


def test_materials_name_their_images(tmp_path):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "m.mtl").write_text(
        "newmtl wood\nKd 1 0 0\nmap_Kd oak\\fine grain.png # new\nnewmtl odd\nmap_Kd -s 2 2 x.png\n"
    )
    text = "mtllib maps/m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nusemtl wood\nf 1 2 3\n"
    mesh = read(tmp_path / "a.obj", text + "usemtl odd\nf 2 4 3\n")
    wood, odd = mesh.labels.materials
    assert wood.image == str(tmp_path / "maps" / "oak" / "fine grain.png")
    assert wood.colour == (1, 0, 0)
    assert odd.image is None
    assert mesh.notes == ("the image of material odd has options: it is left out",)
