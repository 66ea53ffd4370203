"""What the scene of a glTF file places, and where: nodes, copies, skins, morph targets, units."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ffdcli.errors import FileError
from ffdcli.mesh import read_mesh
from support.gltf_models import BOX, SIZE, TRIANGLES, VOLUME, GltfModel, plain_model, volumes


def test_translation_rotation_and_scale_under_a_matrix(read):
    turn = Rotation.from_rotvec([0.3, -0.4, 0.5])
    outer = np.eye(4)
    outer[:3] = [[0, -2, 0, 7], [2, 0, 0, -8], [0, 0, -2, 9]]
    model = GltfModel()
    inner = model.node(
        root=False,
        mesh=model.mesh(model.box()),
        translation=[1, 2, 3],
        rotation=turn.as_quat().tolist(),
        scale=[1, 2, 0.5],
    )
    model.node(matrix=outer.T.ravel().tolist(), children=[inner])
    mesh = read(model)
    moved = turn.apply(BOX * [1, 2, 0.5]) + [1, 2, 3]
    expected = moved @ outer[:3, :3].T + outer[:3, 3]
    np.testing.assert_allclose(mesh.vertices, expected, rtol=1e-14, atol=1e-13)
    assert volumes(mesh) == pytest.approx([VOLUME * 8], rel=1e-12)


def test_one_mesh_in_several_nodes_and_beside_a_camera(read):
    model = plain_model()
    model.add("cameras", {"type": "perspective", "perspective": {"yfov": 1, "znear": 1}})
    model.node(mesh=0, camera=0, translation=[40, 0, 0], name="Shot")
    child = model.node(root=False, mesh=0, translation=[0, 50, 0])
    model.node(camera=0, children=[child], translation=[80, 0, 0])
    mesh = read(model)
    assert volumes(mesh) == [VOLUME] * 3
    assert mesh.bounds.tolist() == [[0, 0, 0], [90, 70, 30]]
    assert set(mesh.groups) == {"Box", "Shot", "2"}


def test_copies_by_instancing(read):
    moves = np.array([[0, 0, 0], [40, 0, 0], [80, 0, 0]], "<f4")
    model = GltfModel()
    turns = (
        Rotation.from_rotvec([[0, 0, 0], [0, 0, np.pi / 2], [0, 0, 0]]).as_quat() * 32767
    ).round()
    attributes = {
        "TRANSLATION": model.accessor(moves, "VEC3"),
        "ROTATION": model.accessor(turns.astype("<i2"), "VEC4", normalized=True),
        "SCALE": model.accessor(np.array([[1, 1, 1], [1, 1, 2], [-1, 1, 1]], "<f4"), "VEC3"),
    }
    stated = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    model.node(mesh=model.mesh(model.box()), scale=[2, 2, 2], extensions=stated)
    model.require("EXT_mesh_gpu_instancing")
    mesh = read(model)
    assert volumes(mesh) == pytest.approx([8 * VOLUME, 8 * VOLUME, 16 * VOLUME], rel=1e-9)
    # The second is turned by 90 degrees, to x from 40 to 80; the third mirrored, to 140 to 160.
    np.testing.assert_allclose(mesh.bounds, [[0, 0, 0], [160, 40, 120]], atol=1e-12)
    attributes["SCALE"] = model.points(moves[:2])
    with pytest.raises(FileError, match=r"attributes of \[2, 3\] copies"):
        read(model)


def skinned(weights, matrices, joints=None, kind="<f4"):
    """A box whose vertices follow two joints; the second is moved by (0, 0, 5)."""
    model = GltfModel()
    body = model.box()
    places = np.zeros((8, 4), "<u2") if joints is None else np.asarray(joints, "<u2")
    body["attributes"]["JOINTS_0"] = model.accessor(places, "VEC4")
    shares = np.asarray(weights, kind)
    body["attributes"]["WEIGHTS_0"] = model.accessor(shares, "VEC4", normalized=kind != "<f4")
    rest = np.asarray(matrices, "<f4").swapaxes(1, 2).reshape(-1, 16)
    second = model.node(root=False, translation=[0, 0, 5])
    first = model.node(root=False, children=[second])
    skin = {"joints": [first, second], "inverseBindMatrices": model.accessor(rest, "MAT4")}
    mesh = model.mesh(body)
    body_node = model.node(root=False, mesh=mesh, skin=model.add("skins", skin), name="body",
                           translation=[1e3, 0, 0])  # fmt: skip
    model.node(children=[first, body_node], scale=[0.01] * 3)
    return model


def test_joints_move_the_mesh_and_its_own_node_does_not(read):
    weights = np.zeros((8, 4))
    weights[:, 0] = 1
    model = skinned(weights, [np.diag([100, 100, 100, 1])] * 2)
    mesh = read(model)
    assert volumes(mesh) == pytest.approx([VOLUME], rel=1e-12)
    assert mesh.bounds.tolist() == [[0, 0, 0], SIZE.tolist()]
    mirrored = skinned(weights, [np.diag([-100, 100, 100, 1])] * 2)
    assert volumes(read(mirrored)) == pytest.approx([VOLUME], rel=1e-12)


@pytest.mark.parametrize("kind", ["<f4", "u1", "<u2"])
def test_shares_of_joints(read, kind):
    """The upper vertices follow the first joint by a fifth, the second by four fifths."""
    top, whole = BOX[:, 2] > 0, 1 if kind == "<f4" else np.iinfo(kind).max
    weights, joints = np.zeros((8, 4)), np.zeros((8, 4))
    weights[:, 0], joints[:, 1] = np.where(top, whole / 5, whole), 1
    weights[top, 1] = whole * 4 / 5
    model = skinned(weights, [np.diag([100, 100, 100, 1])] * 2, joints, kind)
    mesh = read(model)
    assert mesh.notes == ()
    # The second joint is 0.05 higher in the world.
    assert mesh.bounds[1, 2] == pytest.approx(30 + 0.8 * 0.05, rel=1e-7)
    assert mesh.bounds[0, 2] == 0
    model = skinned(weights / 2, [np.diag([100, 100, 100, 1])] * 2, joints, kind)
    halved = read(model)
    np.testing.assert_allclose(halved.vertices, mesh.vertices, rtol=0.01)
    assert "8 vertices are moved by shares of joints that do not add up to 1" in halved.notes[0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"weights": np.full((8, 4), np.nan)}, "weight that is no share"),
        ({"weights": np.full((8, 4), -1.0)}, "weight that is no share"),
        ({"weights": np.zeros((8, 4))}, "has no weights"),
        ({"joints": np.full((8, 4), 9)}, "joint 9 of skins\\[0\\]"),
        ({"matrices": [np.full((4, 4), np.nan)] * 2}, "not finite"),
        ({"matrices": [np.ones((4, 4))] * 2}, "not the matrix of a place"),
        ({"matrices": [np.eye(4)]}, "2 joints, but 1 matrices"),
    ],
)
def test_bad_skins_are_refused(read, change, words):
    given = {"weights": np.tile([1, 0, 0, 0], (8, 1)), "matrices": [np.eye(4)] * 2} | change
    with pytest.raises(FileError, match=words):
        read(skinned(**given))


@pytest.mark.parametrize("owner", ["mesh", "node"])
def test_morph_targets(read, owner):
    """Shares of the node count before those of the mesh; targets may be sparse."""
    model = GltfModel()
    body = model.box()
    up = np.where(BOX[:, 2:] > 0, [0, 0, 10.0], 0)
    out = np.where(BOX[:, :1] > 0, [4.0, 0, 0], 0)
    rows = np.flatnonzero(out.any(axis=1))
    thin = model.add("accessors", {"componentType": 5126, "count": 8, "type": "VEC3"})
    model.tree["accessors"][thin]["sparse"] = {
        "count": len(rows),
        "indices": {"bufferView": model.view(rows.astype("u1").tobytes()), "componentType": 5121},
        "values": {"bufferView": model.view(out[rows].astype("<f4").tobytes())},
    }
    body["targets"] = [{"POSITION": model.points(up)}, {"POSITION": thin}]
    mesh = model.mesh(body, weights=[0.5, 0.25] if owner == "mesh" else [9, 9])
    model.node(mesh=mesh, **({} if owner == "mesh" else {"weights": [0.5, 0.25]}))
    assert volumes(read(model)) == [(10 + 1) * 20 * (30 + 5)]
    model.tree["nodes"][0]["weights"] = [1, 2, 3]
    with pytest.raises(FileError, match="2 targets, but 3 weights"):
        read(model)


def test_scenes(read):
    """The default scene, else the first; the rest is said."""
    model = plain_model()
    other = model.node(root=False, mesh=model.mesh(model.box(points=BOX * 2), name="Spare"))
    model.tree["scenes"].append({"nodes": [other]})
    mesh = read(model)
    assert volumes(mesh) == [VOLUME]
    assert mesh.notes == (
        "the file has 2 scenes: only its default or first one is read",
        "1 mesh is in no node of the scene: left out, the first is 'Spare'",
    )
    model.tree["scene"] = 1
    assert volumes(read(model)) == [8 * VOLUME]
    del model.tree["scene"], model.tree["scenes"]
    assert volumes(read(model)) == [VOLUME, 8 * VOLUME]


def test_a_chain_of_many_nodes(read):
    model = GltfModel()
    last = model.node(root=False, mesh=model.mesh(model.box()))
    for _ in range(20000):
        last = model.node(root=False, children=[last], translation=[0.5, 0, 0])
    model.tree["scenes"][0]["nodes"] = [last]
    assert read(model).bounds.tolist() == [[10000, 0, 0], [10010, 20, 30]]


@pytest.mark.parametrize(
    ("nodes", "words"),
    [
        ([{"mesh": 0, "children": [1]}, {"children": [0]}], "nodes\\[0\\] is below itself"),
        ([{"mesh": 0, "children": [0]}], "below itself"),
        ([{"children": [2]}, {"children": [2]}, {"mesh": 0}], "nodes\\[2\\] is below nodes\\[0\\]"),
        ([{"children": [7]}, {"mesh": 0}], "is 7, not one of 2"),
        ([{"children": "all"}, {"mesh": 0}], "is 'all', not a list"),
        ([{"mesh": 0, "matrix": [1] * 15}], "not a list of 16 numbers"),
        ([{"mesh": 0, "matrix": [1] * 16}], "not the matrix of a place"),
        ([{"mesh": 0, "matrix": [1, *[0] * 14, 1], "scale": [1, 1, 1]}], "both a matrix and"),
        ([{"mesh": 0, "scale": [1, 1, "x"]}], "not a list of 3 numbers that are finite"),
        ([{"mesh": 0, "translation": [10**400, 0, 0]}], "not a list of 3 numbers that are finite"),
        ([{"mesh": 0, "rotation": [0, 0, 0, 0]}], "rotation of length 0"),
        ([{"mesh": 0, "scale": [1e300] * 3, "children": [1]}, {"mesh": 0, "scale": [1e300] * 3}],
         "not finite"),
        ([{"mesh": 5}], "nodes\\[0\\].mesh is 5, but the file has only 1"),
        ([{"mesh": -1}], "is -1, not a whole number"),
        ([{}], "no node of its scene has a mesh"),
    ],
)  # fmt: skip
def test_bad_nodes_are_refused(read, nodes, words):
    model = plain_model()
    model.tree["nodes"] = nodes
    with pytest.raises(FileError, match=words) as caught:
        read(model)
    assert caught.value.hint


WORDS = {
    "m": "m", "cm": "cm", "in": "inch", "mm": "mm", "millimeters": "mm", "'": "ft", '"': "inch",
    "Inches": "inch", "microns": "um", "feet": "ft", "kilometers": "km", "miles": "mile",
}  # fmt: skip


@pytest.mark.parametrize("place", ["meshes", "nodes", "scenes", "asset"])
def test_units(read, place):
    model = plain_model()
    owner = model.tree[place] if place == "asset" else model.tree[place][0]
    for word, unit in WORDS.items():
        owner["extras"] = {"units": word}
        mesh = read(model)
        assert (mesh.unit, mesh.notes) == (unit, ())


def test_units_not_stated_unknown_or_several(read):
    model = plain_model()
    assert read(model).unit == "m"
    model.tree["meshes"][0]["extras"] = {"units": "parsecs"}
    mesh = read(model)
    assert mesh.unit is None
    assert mesh.notes == (
        "the unit 'parsecs' that the file states is not known here: it is left out",
    )
    model.node(mesh=model.mesh(model.box((50, 0, 0))))
    with pytest.raises(FileError, match="several units: 'm', 'parsecs'"):
        read(model)
    model.tree["meshes"][0]["extras"] = {"units": "meter"}
    assert read(model).unit == "m"
    model.tree["meshes"][1]["extras"] = {"units": "mm"}
    with pytest.raises(FileError, match="several units: 'm', 'mm'"):
        read(model)
    # A mesh that is nowhere placed does not count.
    model.tree["scenes"][0]["nodes"].pop()
    assert read(model).unit == "m"


def test_trimesh_units_come_back(tmp_path):
    """What trimesh writes for each of its own names."""
    import trimesh

    for word, unit in (("in", "inch"), ("cm", "cm"), ("mm", "mm"), ("meter", "m"), ("m", "m")):
        scene = trimesh.Scene(trimesh.creation.box())
        scene.units = word
        scene.export(tmp_path / "a.glb")
        assert read_mesh(tmp_path / "a.glb").unit == unit


def test_notes_on_motion_and_hidden_nodes(read):
    model = plain_model()
    model.tree["animations"] = [{"channels": [], "samplers": []}]
    model.tree["nodes"][0]["extensions"] = {"KHR_node_visibility": {"visible": False}}
    assert read(model).notes == (
        "1 node is hidden, but read",
        "animations are left out: the rest pose is read",
    )


def test_triangles_of_copies_are_bounded(read):
    """A small file that stands for a thousand million triangles."""
    model = GltfModel()
    many = 10_000
    corners = model.indices(np.tile(TRIANGLES, (many // 12, 1)))
    body = {"attributes": {"POSITION": model.points(BOX)}, "indices": corners}
    zeros = model.add("accessors", {"componentType": 5126, "count": 100_000, "type": "VEC3"})
    stated = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": zeros}}}
    model.node(mesh=model.mesh(body), extensions=stated)
    with pytest.raises(FileError, match="places copies of them, 999600000 in all"):
        read(model)
