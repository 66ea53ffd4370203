"""Packed glTF files: unpacked where the library is installed, else refused by name."""

import sys

import numpy as np
import pytest

from ffdcli.errors import FileError
from ffdcli.mesh import inspect
from support.gltf_models import BOX, TRIANGLES, VOLUME, GltfModel

DRACO, MESHOPT = "KHR_draco_mesh_compression", "EXT_meshopt_compression"


def draco_model(content, *, count=8, corners=36, fallback=False, required=True):
    """A plain box, and one whose arrays are in ``content``."""
    model = GltfModel()
    model.node(mesh=model.mesh(model.box()), name="plain")
    if fallback:
        body = model.box((50, 0, 0))
    else:
        empty = ({"componentType": 5126, "count": count, "type": "VEC3"},
                 {"componentType": 5123, "count": corners, "type": "SCALAR"})  # fmt: skip
        position, indices = (model.add("accessors", entry) for entry in empty)
        body = {"attributes": {"POSITION": position}, "indices": indices}
    packed = {"bufferView": model.view(content), "attributes": {"POSITION": 0}}
    model.node(mesh=model.mesh(body | {"extensions": {DRACO: packed}}), name="packed")
    if required:
        model.require(DRACO)
    return model


def meshopt_model(attributes, indices, *, fallback=False):
    """A box; with ``fallback`` its arrays are there plain, too, and the extension not required."""
    model = GltfModel()
    positions, corners = BOX.astype("<f4").tobytes(), TRIANGLES.astype("<u2").tobytes()
    if not fallback:
        stated = {"extensions": {MESHOPT: {"fallback": True}}}
        model.add("buffers", {"byteLength": len(positions) + len(corners)} | stated)
        model.require(MESHOPT)
    views = []
    for content, plain, at, form in (
        (attributes, positions, 0, {"byteStride": 12, "count": 8, "mode": "ATTRIBUTES"}),
        (indices, corners, 96, {"byteStride": 2, "count": 36, "mode": "TRIANGLES"}),
    ):
        packed = {"extensions": {MESHOPT: model.place(content) | form}}
        absent = {"buffer": 1, "byteOffset": at, "byteLength": len(plain)}
        place = model.place(plain) if fallback else absent
        views.append(model.add("bufferViews", place | packed))
    forms = ((5126, 8, "VEC3"), (5123, 36, "SCALAR"))
    position, indices = (
        model.add("accessors", {"bufferView": v, "componentType": c, "count": n, "type": t})
        for v, (c, n, t) in zip(views, forms, strict=True)
    )
    model.node(mesh=model.mesh({"attributes": {"POSITION": position}, "indices": indices}))
    return model


@pytest.mark.parametrize(
    ("model", "extension", "package", "extra"),
    [
        (draco_model(b"DRACO"), DRACO, "DracoPy", "draco"),
        (meshopt_model(b"\xa1", b"\xe1"), MESHOPT, "meshoptimizer", "meshopt"),
    ],
)
def test_without_the_library(read, monkeypatch, model, extension, package, extra):
    """Nothing stands in for the body that cannot be unpacked."""
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(
        FileError, match=f"packed by {extension}, which {package} unpacks"
    ) as caught:
        read(model)
    assert f"ffdcli[{extra}]" in caught.value.hint


@pytest.mark.parametrize(
    "model",
    [
        draco_model(b"DRACO", fallback=True, required=False),
        meshopt_model(b"\xa1", b"\xe1", fallback=True),
    ],
)
def test_plain_arrays_beside_packed_ones(read, monkeypatch, model):
    """Where the extension is not required, what it packs is there plain as well."""
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    monkeypatch.setitem(sys.modules, "meshoptimizer", None)
    assert set(inspect(read(model)).volumes) == {VOLUME}


def test_draco(read):
    library = pytest.importorskip("DracoPy")
    moved = (BOX + [50, 0, 0]).astype(np.float32)
    content = library.encode(moved, TRIANGLES.astype(np.uint32), quantization_bits=0)
    mesh = read(draco_model(content))
    assert inspect(mesh).volumes.tolist() == [VOLUME, VOLUME]
    assert mesh.bounds.tolist() == [[0, 0, 0], [60, 20, 30]]
    with pytest.raises(
        FileError, match="promises 21 triangles of 2 placed meshes, but holds 24 of 2"
    ):
        read(draco_model(content, corners=27))
    with pytest.raises(
        FileError, match=r"\(8, 3\) numbers of POSITION, but the file promises \(7, 3\)"
    ):
        read(draco_model(content, count=7))
    flat = draco_model(content)
    flat.tree["accessors"][2]["type"] = "VEC2"
    with pytest.raises(FileError, match=r"but the file promises \(8, 2\)"):
        read(flat)
    for damaged in (content[:40], content[:20] + bytes(30), b"DRACO\2\2\1\1" + bytes(40)):
        with pytest.raises(FileError, match="is damaged"):
            read(draco_model(damaged))


def test_meshopt(read):
    library = pytest.importorskip("meshoptimizer")
    attributes = library.encode_vertex_buffer(BOX.astype(np.float32), 8, 12)
    indices = library.encode_index_buffer(TRIANGLES.ravel().astype(np.uint32), 36, 8)
    mesh = read(meshopt_model(bytes(attributes), bytes(indices)))
    assert inspect(mesh).volumes.tolist() == [VOLUME]
    for damaged in ((bytes(attributes)[:20], bytes(indices)), (bytes(attributes), b"\xe1" * 9)):
        with pytest.raises(FileError, match="is damaged"):
            read(meshopt_model(*damaged))
    many = meshopt_model(bytes(attributes), bytes(indices))
    many.tree["bufferViews"][0]["extensions"][MESHOPT]["count"] = 300_000_000
    with pytest.raises(FileError, match=r"arrays of 360000[0-9]+ bytes are promised"):
        read(many)
