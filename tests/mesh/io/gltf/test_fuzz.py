"""Any change of a good glTF file: read, or refused in one sentence."""

import copy
import json

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.mesh import inspect, read_mesh
from support.damage import damage, require_read_or_refused
from support.gltf_models import BOX, RINGS, VOLUME, GltfModel, pack_glb


def rich_model():
    """Three boxes with most of what a file can hold."""
    model = GltfModel()
    body = model.box()
    first = np.tile([1.0, 0, 0, 0], (8, 1)).astype("<f4")
    body["attributes"] |= {
        "TEXCOORD_0": model.accessor(np.zeros((8, 2), "u1"), "VEC2", normalized=True),
        "JOINTS_0": model.accessor(np.zeros((8, 4), "u1"), "VEC4"),
        "WEIGHTS_0": model.accessor(first, "VEC4"),
    }
    body["targets"] = [{"POSITION": model.points(BOX)}]
    rows = np.array([1, 3], "u1")
    model.tree["accessors"][body["attributes"]["POSITION"]]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": model.view(rows.tobytes()), "componentType": 5121},
        "values": {"bufferView": model.view(BOX[rows].astype("<f4").tobytes())},
    }
    look = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [1, 2], "texCoord": 0}}}
    paint = {"baseColorFactor": [1, 0, 0, 1], "baseColorTexture": look}
    body["material"] = model.add("materials", {"name": "red", "pbrMetallicRoughness": paint})
    mesh = model.mesh(body, weights=[1.0], extras={"units": "cm"})
    joint = model.node(translation=[1, 2, 3], rotation=[0, 0, 0, 1])
    rest = model.accessor(np.eye(4, dtype="<f4").reshape(1, 16), "MAT4")
    skin = model.add("skins", {"joints": [joint], "inverseBindMatrices": rest})
    model.node(mesh=mesh, skin=skin, name="one")
    fan = {"attributes": {"POSITION": model.points(BOX)}, "mode": 6}
    fans = [fan | {"indices": model.indices(ring)} for ring in RINGS]
    moves = model.points([[50, 0, 0], [90, 0, 0]])
    copies = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves}}}
    child = model.node(
        root=False, mesh=model.mesh(*fans, extras={"units": "cm"}), extensions=copies
    )
    model.node(children=[child], matrix=np.eye(4).ravel().tolist())
    model.require("KHR_mesh_quantization", "EXT_mesh_gpu_instancing")
    return model


def places_of(value, above=()):
    """Paths to all values of a JSON tree."""
    yield above
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, child in items:
            yield from places_of(child, (*above, key))


RICH = rich_model()
GLB = RICH.glb()
PLACES = [path for path in places_of(RICH.tree) if path]
ODD = [None, 0, 1, 2, 7, -1, 0.5, 1e300, 2**31, 2**70, 300_000_000, True, "", "\x1b[31m\ud800",
       "VEC3", "SCALAR", [], [0], [[[]]], {}, {"POSITION": 0}, 5121, 5125, 5126]  # fmt: skip
CHANGES = st.lists(st.tuples(st.sampled_from(PLACES), st.sampled_from(ODD)), min_size=1, max_size=3)


def test_the_good_file(tmp_path):
    (tmp_path / "a.glb").write_bytes(GLB)
    mesh = read_mesh(tmp_path / "a.glb")
    assert (mesh.unit, mesh.notes) == ("cm", ())
    # The morph target doubles the first box.
    assert sorted(inspect(mesh).volumes) == [VOLUME, VOLUME, 8 * VOLUME]


@settings(max_examples=300)
@given(changes=CHANGES)
def test_any_value_of_the_json(tmp_path_factory, changes):
    model = copy.deepcopy(RICH)
    for path, value in changes:
        place = model.tree
        try:
            for key in path[:-1]:
                place = place[key]
            if value is None:
                del place[path[-1]]
            else:
                place[path[-1]] = copy.deepcopy(value)
        except (KeyError, IndexError, TypeError):
            continue  # an earlier change took the place away
    path = tmp_path_factory.getbasetemp() / "json.glb"
    path.write_bytes(pack_glb(json.dumps(model.tree).encode(), model.data))
    require_read_or_refused(path)


@settings(max_examples=200)
@given(data=st.data())
def test_any_bytes(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "bytes.glb"
    path.write_bytes(damage(GLB, data))
    require_read_or_refused(path)
