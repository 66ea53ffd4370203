"""Shapes of glTF files: how numbers are stored, and what primitives stand for."""

import numpy as np
import pytest

from ffdcli.errors import FileError
from support.gltf_models import BOX, RINGS, SIZE, TRIANGLES, VOLUME, GltfModel, volumes


@pytest.mark.parametrize("kind", ["i1", "u1", "<i2", "<u2"])
@pytest.mark.parametrize("normalized", [False, True])
def test_quantised_positions(read, kind, normalized):
    """Whole numbers, or shares of the largest one; the node's scale makes lengths of them."""
    whole = np.iinfo(kind).max
    # Levels of a box whose numbers are exact: 0 and (1, 2, 3) * 42.
    levels = (BOX / 10 * 42).astype(kind)
    padded = np.zeros((8, 4), kind)
    padded[:, :3] = levels
    model = GltfModel()
    view = model.view(padded.tobytes(), byteStride=padded.strides[0])
    component = {"i1": 5120, "u1": 5121, "<i2": 5122, "<u2": 5123}[kind]
    position = model.add(
        "accessors",
        {
            "bufferView": view,
            "componentType": component,
            "count": 8,
            "type": "VEC3",
            "normalized": normalized,
        },
    )
    body = {"attributes": {"POSITION": position}, "indices": model.indices(TRIANGLES)}
    scale = (whole if normalized else 1) / 42 * 10
    model.node(mesh=model.mesh(body), scale=[scale] * 3)
    model.require("KHR_mesh_quantization")
    mesh = read(model)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), SIZE, rtol=1e-14)
    assert volumes(mesh) == pytest.approx([VOLUME], rel=1e-13)


def test_the_least_integer_is_minus_one(read):
    """-128 and -127 both stand for -1."""
    levels = np.array([[-128, 0, 0], [-127, 127, 0], [127, 0, 0]], "i1")
    model = GltfModel()
    position = model.accessor(levels, "VEC3", normalized=True)
    model.node(mesh=model.mesh({"attributes": {"POSITION": position}}))
    assert read(model).vertices.tolist() == [[-1, 0, 0], [-1, 1, 0], [1, 0, 0]]


def sparse(model, rows, values, kind="<u2"):
    return {
        "count": len(rows),
        "indices": {
            "bufferView": model.view(np.asarray(rows).astype(kind).tobytes()),
            "componentType": {"u1": 5121, "<u2": 5123, "<u4": 5125}[kind],
        },
        "values": {"bufferView": model.view(np.ascontiguousarray(values).tobytes())},
    }


@pytest.mark.parametrize("kind", ["u1", "<u2", "<u4"])
@pytest.mark.parametrize("base", [False, True])
def test_sparse_positions(read, base, kind):
    """Values stand in for those of the base, or for zeros."""
    model = GltfModel()
    flat = np.where(BOX[:, 2:] > 0, [1.0, 1.0, 1 / 30], 1.0) * BOX
    if base:
        position, rows = model.points(flat), np.flatnonzero(BOX[:, 2] > 0)
    else:
        position = model.add("accessors", {"componentType": 5126, "count": 8, "type": "VEC3"})
        rows = np.flatnonzero(BOX.any(axis=1))
    stored = BOX[rows].astype("<f4")
    model.tree["accessors"][position]["sparse"] = sparse(model, rows, stored, kind)
    body = {"attributes": {"POSITION": position}, "indices": model.indices(TRIANGLES)}
    model.node(mesh=model.mesh(body))
    assert volumes(read(model)) == [VOLUME]


def test_sparse_corners(read):
    model = GltfModel()
    numbers = TRIANGLES.ravel().astype("<u2")
    body = {"attributes": {"POSITION": model.points(BOX)}}
    body["indices"] = model.indices(np.where(np.arange(36) % 7 == 0, 0, numbers))
    rows = np.arange(0, 36, 7)
    model.tree["accessors"][body["indices"]]["sparse"] = sparse(model, rows, numbers[rows])
    model.node(mesh=model.mesh(body))
    assert volumes(read(model)) == [VOLUME]


@pytest.mark.parametrize("kind", ["u1", "<u2", "<u4"])
def test_numbers_of_corners(read, kind):
    model = GltfModel()
    body = {"attributes": {"POSITION": model.points(BOX)}}
    body["indices"] = model.indices(TRIANGLES, kind)
    model.node(mesh=model.mesh(body))
    assert volumes(read(model)) == [VOLUME]
    model = GltfModel()
    body["attributes"]["POSITION"] = model.points(BOX)
    # The largest number ends a primitive in some programs; the standard forbids it.
    body["indices"] = model.indices(np.where(TRIANGLES == 7, np.iinfo(kind).max, TRIANGLES), kind)
    model.node(mesh=model.mesh(body))
    with pytest.raises(FileError, match=f"hold {np.iinfo(kind).max}, which stands for no vertex"):
        read(model)


def strip(rings):
    """One strip through quads: each is four vertices; two repeated ones join it to the next."""
    run = []
    for a, b, c, d in rings:
        quad = [a, b, d, c]
        run += [*run[-1:], *quad[:1], *quad] if run else quad
    return run


@pytest.mark.parametrize(
    ("mode", "indexed"),
    [("triangles", True), ("triangles", False), ("strip", True), ("strips", True),
     ("strips", False), ("fans", True), ("fans", False)],
)  # fmt: skip
def test_modes(read, mode, indexed):
    model = GltfModel()
    runs, number = {
        "triangles": ([TRIANGLES.ravel()], 4),
        "strip": ([strip(RINGS)], 5),
        "strips": ([strip([ring]) for ring in RINGS], 5),
        "fans": (RINGS, 6),
    }[mode]
    shared = model.points(BOX)
    bodies = []
    for run in runs:
        position = shared if indexed else model.points(BOX[np.asarray(run)])
        body = {"attributes": {"POSITION": position}, "mode": number}
        bodies.append(body | ({"indices": model.indices(run)} if indexed else {}))
    model.node(mesh=model.mesh(model.box((50, 0, 0))), name="A")
    model.node(mesh=model.mesh(*bodies), name="B")
    mesh = read(model)
    assert mesh.notes == ()
    assert mesh.polygon_count == 24
    assert volumes(mesh) == [VOLUME, VOLUME]
    assert mesh.labels.bodies == ("A", "B")


def test_points_and_lines_are_said(read):
    model = GltfModel()
    lines = {"attributes": {"POSITION": model.points(BOX)}, "mode": 1}
    model.node(mesh=model.mesh(model.box(), lines, lines | {"mode": 0}))
    mesh = read(model)
    assert volumes(mesh) == [VOLUME]
    assert mesh.notes == ("2 primitives of points or lines are left out",)


def test_meshes_that_share_vertices_have_their_own(read):
    """A body each of one array of positions: no vertex of the others is called stray."""
    model = GltfModel()
    position = model.points(np.concatenate([BOX, BOX + [50, 0, 0], [[99, 99, 99]]]))
    for first in (0, 8):
        corners = model.indices(TRIANGLES + first)
        body = {"attributes": {"POSITION": position}, "indices": corners}
        model.node(mesh=model.mesh(body))
    mesh = read(model)
    assert volumes(mesh) == [VOLUME, VOLUME]
    assert mesh.notes == ()
    assert len(mesh.vertices) == 16


def test_primitives_of_one_node_are_welded_before_others(read):
    """Two boxes on one another, each of six primitives: both are closed, and neither joins."""
    model = GltfModel()
    for move in ((0, 0, 0), (10, 0, 0)):
        bodies = [
            {"attributes": {"POSITION": model.points(BOX[ring] + move)}, "mode": 6}
            for ring in RINGS
        ]
        model.node(mesh=model.mesh(*bodies))
    assert volumes(read(model)) == [VOLUME, VOLUME]


def test_texture_transform(read):
    """Scale and offset are applied; another set of coordinates may be named."""
    model = GltfModel()
    uv = np.array([[0, 0], [1, 0], [0, 1]], "<f4")
    attributes = {"POSITION": model.points(BOX[:3]), "TEXCOORD_0": model.points(BOX[:3] * 0)}
    attributes["TEXCOORD_0"] = model.accessor(uv * 0, "VEC2")
    attributes["TEXCOORD_1"] = model.accessor(uv, "VEC2")
    moved = {"scale": [0.5, 0.25], "offset": [0.125, 0.5], "texCoord": 1}
    look = {"index": 0, "extensions": {"KHR_texture_transform": moved}}
    paint = model.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": look}})
    model.node(mesh=model.mesh({"attributes": attributes, "material": paint}))
    model.require("KHR_texture_transform")
    mesh = read(model)
    expected = uv * [0.5, 0.25] + [0.125, 0.5]
    assert mesh.uv.tolist() == np.column_stack([expected[:, 0], 1 - expected[:, 1]]).tolist()
    moved["rotation"] = 0.5
    mesh = read(model)
    assert mesh.uv is None
    assert "texture coordinates there are left out" in mesh.notes[0]
