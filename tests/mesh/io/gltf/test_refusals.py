"""glTF files that are damaged, hostile, or need what is not known: refused in one sentence."""

import base64
import os
import tracemalloc

import numpy as np
import pytest

from ffdcli.errors import FileError
from ffdcli.mesh import inspect, read_mesh
from support.gltf_models import VOLUME, GltfModel, pack_glb, plain_model

MOST_BYTES = 2**28


def volumes(mesh):
    return sorted(inspect(mesh).volumes)


def refuse(path, words):
    """The file is refused with these words, a hint, and little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(FileError, match=words) as caught:
            read_mesh(path)
        assert tracemalloc.get_traced_memory()[1] < MOST_BYTES
    finally:
        tracemalloc.stop()
    assert caught.value.file == str(path)
    assert caught.value.hint
    assert len(str(caught.value)) < 500
    assert str(caught.value).isprintable()


@pytest.fixture
def refused(tmp_path):
    """Write a file and see it refused."""

    def write_and_refuse(content, words, name="a.glb"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        refuse(path, words)

    return write_and_refuse


GLB = plain_model().glb()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "neither binary glTF nor JSON"),
        (b"glTF", "cut short: it has 4 bytes"),
        (GLB[:-9], "cut short: the header promises"),
        (GLB[:4] + b"\1" + GLB[5:], "binary glTF of version 1"),
        (GLB[:4] + b"\3" + GLB[5:], "binary glTF of version 3"),
        (GLB[:12] + b"\xff\xff\xff\x7f" + GLB[16:], "promises 2147483647 bytes, but only"),
        (GLB[:12] + b"\1\0\0\0" + GLB[16:], "promises [0-9]+ bytes, but only"),
        (GLB[:16] + b"BIN\0" + GLB[20:], "its first part is not JSON"),
        (pack_glb(b"[]", b""), "neither binary glTF nor JSON"),
        (pack_glb(b"{", b""), "JSON is damaged"),
        (pack_glb(b'{"a":NaN}', b""), "NaN is not a number of JSON"),
        (pack_glb(b'{"a":"\xff"}', b""), "not in UTF-8"),
        (pack_glb(b'{"a":' + b"[" * 200_000, b""), "nested too deeply"),
        (pack_glb(b'{"a":' + b"[" * 200_000 + b"]" * 200_000 + b"}", b""), "nested too deeply"),
        (pack_glb(b'{"a":' + b"9" * 5000 + b"}", b""), "JSON is damaged"),
        (pack_glb(b'{"a":[' + b"[]," * 4_000_000 + b"[]]}", b""), "holds 8000003 values"),
        (pack_glb(b'{"asset":{"version":"1.0"}}', b""), "glTF of version '1.0'"),
        (pack_glb(b'{"asset":{"version":"2.1","minVersion":"2.1"}}', b""), "version '2.1'"),
        (pack_glb(b'{"asset":{"version":[]}}', b""), "not a version"),
        (pack_glb(b"{}", b""), "no node of its scene has a mesh"),
    ],
)
def test_damaged_containers(refused, content, words):
    refused(content, words)


def test_text_in_either_extension(tmp_path):
    data = "data:;base64," + base64.b64encode(plain_model().data).decode()
    for name, content in (
        ("a.glb", plain_model().gltf(data).encode()),
        ("a.gltf", b"\xef\xbb\xbf" + plain_model().gltf(data).encode()),
        ("b.gltf", GLB),
    ):
        (tmp_path / name).write_bytes(content)
        assert volumes(read_mesh(tmp_path / name)) == [VOLUME]


HUGE = 300_000_000


def change(model, *path, value):
    """Put a value into the JSON of a model, or take it out with None."""
    *above, last = path
    place = model.tree
    for key in above:
        place = place[key]
    if value is None:
        del place[last]
    else:
        place[last] = value
    return model


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("accessors", 0, "count"), HUGE, "promises 300000000 values of 12 bytes"),
        (("accessors", 1, "count"), HUGE, "promises 300000000 values of 2 bytes"),
        (("accessors", 0, "count"), 7, "refer to vertex 7"),
        (("accessors", 1, "count"), 35, "has 35 corners, not three by three"),
        (("accessors", 0, "count"), -1, "not a whole number"),
        (("accessors", 0, "count"), 1e300, "not a whole number"),
        (("accessors", 0, "count"), "8", "is '8', not a whole number"),
        (("accessors", 0, "byteOffset"), 1, "from byte 1 on, but the bytes are 96"),
        (("accessors", 0, "type"), "VEC4", "is 'VEC4', not VEC3"),
        (("accessors", 0, "type"), ["VEC3"], "is a list of 1, not VEC3"),
        (("accessors", 0, "componentType"), 5130, "componentType is 5130"),
        (("accessors", 1, "componentType"), 5122, "not whole numbers from 0 on"),
        (("accessors", 0, "bufferView"), 9, "is 9, but the file has only 2"),
        (("accessors", 0, "bufferView"), None, "positions that are stored nowhere"),
        (("accessors", 1, "bufferView"), None, "indices are stored nowhere"),
        (("accessors", 0, "sparse"), {"count": 9}, "is 9, not a whole number from 0 to 8"),
        (("accessors", 0, "sparse"), {"count": 1, "indices": {"bufferView": 1,
         "componentType": 5123, "byteOffset": 2}, "values": {"bufferView": 0, "byteOffset": 90}},
         "promises 1 values of 12 bytes"),
        (("accessors", 0, "sparse"), {"count": 3, "indices": {"bufferView": 1,
         "componentType": 5123, "byteOffset": 10}, "values": {"bufferView": 0}},
         "not rising numbers below 8"),
        (("bufferViews", 0, "byteLength"), HUGE, "takes bytes 0 to 300000000 of a buffer of"),
        (("bufferViews", 0, "byteStride"), 4, "a stride of 4 is less than 12"),
        (("bufferViews", 0, "byteStride"), 252, "promises 8 values"),
        (("bufferViews", 0, "buffer"), 1, "is 1, but the file has only 1"),
        (("buffers", 0, "byteLength"), HUGE, "promises 300000000 bytes, but has only"),
        (("bufferViews", 0, "byteLength"), None, "byteLength is missing"),
        (("meshes", 0, "primitives", 0, "mode"), 7, "is 7, not a whole number from 0 to 6"),
        (("meshes", 0, "primitives", 0, "material"), 2**31, "material is 2147483648, but the file"),
        (("meshes", 0, "primitives", 0, "attributes"), [], "is a list of 0, not an object"),
        (("meshes", 0, "primitives", 0, "indices"), 0, "is 'VEC3', not SCALAR"),
        (("meshes", 0, "primitives"), {}, "is an object, not a list"),
        (("meshes", 0, "primitives", 0, "targets"), [{"POSITION": 77}], "is 77, but the file"),
        (("meshes", 0, "weights"), [1], "0 targets, but 1 weights"),
        (("scene",), 3, "scene is 3, but the file has only 1"),
        (("scenes", 0, "nodes"), [0, 0], "names a node twice"),
        (("extensionsRequired",), ["EXT_\x1b[31mnew"], r"extension 'EXT_\\x1b\[31mnew'"),
        (("extensionsRequired",), "all", "not a list"),
        (("materials",), [[]], r"materials\[0\] is a list of 0, not an object"),
    ],
)  # fmt: skip
def test_damaged_values(refused, path, value, words):
    model = plain_model()
    model.tree["meshes"][0]["weights"] = []
    if "targets" in path:
        model.tree["meshes"][0]["weights"] = [1.0]
    refused(change(model, *path, value=value).glb(), words)


def test_values_without_data_are_bounded(refused):
    """Zeros of a count alone, and many arrays of one view."""
    model = plain_model()
    model.tree["accessors"][0] |= {"count": HUGE, "sparse": {"count": 0}}
    del model.tree["accessors"][0]["bufferView"]
    refused(model.glb(), "promises 300000000 values, but does not say where")
    model = GltfModel()
    view = model.view(np.zeros(200_000, "u1").tobytes())
    bodies = []
    for offset in range(3000):
        entry = {"bufferView": view, "byteOffset": offset, "componentType": 5120, "type": "VEC3"}
        position = model.add("accessors", entry | {"count": 60_000})
        bodies.append({"attributes": {"POSITION": position}})
    model.node(mesh=model.mesh(*bodies))
    refused(model.glb(), "arrays of [0-9]+ bytes are promised, but the file stores 200000")


def test_required_extensions(tmp_path, refused):
    model = plain_model()
    model.require("KHR_materials_unlit", "KHR_lights_punctual", "KHR_mesh_quantization")
    (tmp_path / "a.glb").write_bytes(model.glb())
    assert volumes(read_mesh(tmp_path / "a.glb")) == [VOLUME]
    model.require("KHR_materials_unlit", "ACME_shape")
    refused(model.glb(), "requires the extension 'ACME_shape', which is not known here")
    # What is only used changes nothing that is required.
    del model.tree["extensionsRequired"]
    (tmp_path / "a.glb").write_bytes(model.glb())
    assert volumes(read_mesh(tmp_path / "a.glb")) == [VOLUME]


@pytest.mark.parametrize(
    "uri", ["part one.bin", "part%20one.bin", "%70art%20one.bin", "deep/part%C3%BC.bin", "./a.bin"]
)
def test_files_beside(tmp_path, uri):
    model = plain_model()
    (tmp_path / "deep").mkdir()
    for name in ("part one.bin", "deep/part\u00fc.bin", "a.bin"):
        (tmp_path / name).write_bytes(model.data)
    (tmp_path / "a.gltf").write_text(model.gltf(uri))
    assert volumes(read_mesh(tmp_path / "a.gltf")) == [VOLUME]


@pytest.mark.parametrize(
    ("uri", "words"),
    [
        ("../out.bin", "not in the folder"),
        ("%2e%2e/out.bin", "not in the folder"),
        ("x/..%5C..%5Cout.bin", "not in the folder"),
        ("/etc/passwd", "not in the folder"),
        ("%2Fetc%2Fpasswd", "not in the folder"),
        ("\\\\host\\share", "not in the folder"),
        ("C:/out.bin", "nothing is fetched"),
        ("http://127.0.0.1:9/a.bin", "nothing is fetched"),
        ("file:///etc/passwd", "nothing is fetched"),
        ("a%00.bin", "not in the folder"),
        ("gone\x1b[2J.bin", "no such file"),
        ("x" * 300, "file name too long"),
        ("", "not a regular file"),
        ("pipe", "not a regular file"),
        ("deep", "not a regular file"),
        ("link.bin", "a link out of the folder"),
        ("loop", "cannot be read|link"),
        ("short.bin", "promises .* bytes, but has only 3"),
        ("data:;base64,!!!", "no base64"),
        ("data:;base64", "no comma"),
        ("data:,abc", "promises .* bytes, but has only 3"),
        (5, "is 5, not a text"),
    ],
)
def test_files_elsewhere_and_none(tmp_path, uri, words):
    home = tmp_path / "home"
    (home / "deep").mkdir(parents=True)
    model = plain_model()
    (tmp_path / "out.bin").write_bytes(model.data)
    (home / "link.bin").symlink_to(tmp_path / "out.bin")
    (home / "loop").symlink_to(home / "loop")
    (home / "short.bin").write_bytes(b"abc")
    os.mkfifo(home / "pipe")
    (home / "a.gltf").write_text(model.gltf(uri))
    refuse(home / "a.gltf", words)


def test_a_difference_of_counts_is_an_error(tmp_path, monkeypatch):
    """A reader that loses a body is found out by the counts of the file."""
    from ffdcli.mesh.io.gltf import meshes

    model = plain_model()
    model.node(mesh=model.mesh(model.box((50, 0, 0))))
    (tmp_path / "a.glb").write_bytes(model.glb())
    whole = meshes.Meshes.read
    monkeypatch.setattr(
        meshes.Meshes, "read", lambda self, number, *rest: whole(self, number, *rest)[number:]
    )
    with pytest.raises(
        FileError, match="promises 24 triangles of 2 placed meshes, but holds 12 of 1"
    ):
        read_mesh(tmp_path / "a.glb")
