"""Closed bodies on one another are found in every format, and what only touches is not."""

import numpy as np
import pytest
import trimesh

from ffdcli.mesh import describe_remarks, inspect, read_mesh, repair
from ffdcli.mesh.io.painted_mesh import PaintedMesh
from ffdcli.mesh.io.write import write_mesh
from support.mesh_models import CORNERS, QUADS, binary_stl, cube_triangles, make, off, ply
from support.threemf_files import matrix, model, save, thing

TURNED = [loop[::-1] for loop in QUADS]
TRIANGLES = [[a, b, c] for a, b, c, _ in QUADS] + [[a, c, d] for a, _, c, d in QUADS]


def joined(*bodies):
    """A mesh of bodies, each of its corners and polygons, that share no vertex."""
    first = np.cumsum([0] + [len(corners) for corners, _ in bodies])
    return make(
        np.concatenate([corners for corners, _ in bodies]),
        [
            [at + n for n in loop]
            for (_, loops), at in zip(bodies, first.tolist(), strict=False)
            for loop in loops
        ],
    )


def permuted(polygons, seed):
    """Corners and polygons of the cube in another order."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(8)
    place = np.argsort(order)
    loops = [np.roll(place[list(loop)], rng.integers(4)).tolist() for loop in polygons]
    return CORNERS[order], [loops[n] for n in rng.permutation(len(loops))]


@pytest.mark.parametrize("second", [QUADS, TURNED, TRIANGLES])
@pytest.mark.parametrize("seed", range(3))
def test_however_they_are_stored(second, seed):
    mesh = joined((CORNERS, QUADS), permuted(second, seed))
    found = inspect(mesh)
    assert found.coincident.count == 1
    assert (found.coincident.place >= 0).all()
    assert (found.coincident.place <= 1).all()
    remark = describe_remarks(mesh, found)[-1]
    assert "closed body has the vertices and volume of another, body 1 those of body 0" in remark


def test_many_at_one_place_and_others_beside():
    far = [(CORNERS + [5 * n, 0, 0], QUADS) for n in range(1, 4)]
    mesh = joined((CORNERS, QUADS), *far, (CORNERS, QUADS), far[1], (CORNERS, QUADS))
    found = inspect(mesh)
    assert found.coincident.count == 3
    assert (
        "3 closed bodies have the vertices and volume of others"
        in describe_remarks(mesh, found)[-1]
    )


@pytest.mark.parametrize(
    "other",
    [
        (CORNERS + [1, 0, 0], QUADS),
        (CORNERS * 0.5, QUADS),
        (np.nextafter(CORNERS, 9), QUADS),
    ],
)
def test_what_does_not_lie_on_another(other):
    mesh = joined((CORNERS, QUADS), other)
    assert inspect(mesh).coincident.count == 0


def test_bodies_of_other_volume_on_the_same_vertices():
    """Quadrangles that are not flat, split along one diagonal or the other."""
    corners = CORNERS.copy()
    corners[7] = 2
    other = [[b, c, d] for _, b, c, d in QUADS] + [[a, b, d] for a, b, _, d in QUADS]
    mesh = joined((corners, TRIANGLES), (corners, other))
    found = inspect(mesh)
    assert found.closed
    assert np.ptp(found.volumes) > 0.1
    assert found.coincident.count == 0


def test_an_open_body_does_not_count():
    mesh = joined((CORNERS, QUADS), (CORNERS, QUADS[1:]))
    assert inspect(mesh).coincident.count == 0
    # Once repair has joined what kept it open it does: a corner in the middle of an edge.
    cut = [[*QUADS[0]], [4, 8, 5, 7, 6], *QUADS[2:]]
    corners = np.vstack([CORNERS, [[0.5, 0, 1]]])
    mesh = joined(
        (corners, [[4, 8, 5, 7, 6], [0, 1, 5, 8, 4], QUADS[0], *QUADS[3:]]), (corners, cut)
    )
    assert inspect(mesh).coincident.count == 0
    mended, done = repair(mesh)
    assert done
    assert inspect(mended).coincident.count == 1


TWICE = np.concatenate([CORNERS, CORNERS])
LOOPS = QUADS + [[n + 8 for n in loop] for loop in QUADS]


def scene(kind):
    box = trimesh.Scene()
    for name in "AB":
        body = trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]])
        box.add_geometry(body, node_name=name, geom_name=name)
    return box.export(file_type=kind)


def write_obj(path):
    lines = ["o A", *("v {} {} {}".format(*p) for p in CORNERS)]
    lines += ["f " + " ".join(str(n + 1) for n in loop) for loop in QUADS]
    lines += ["o B", *("v {} {} {}".format(*p) for p in CORNERS)]
    lines += ["f " + " ".join(str(n + 9) for n in loop) for loop in QUADS]
    path.write_text("\n".join(lines) + "\n")


FILES = {
    "a.obj": write_obj,
    "a.off": lambda path: path.write_text(off(TWICE, LOOPS)),
    "a.ply": lambda path: path.write_text(ply(TWICE, LOOPS)),
    "b.ply": lambda path: path.write_bytes(ply(TWICE, LOOPS, "binary_little_endian")),
    "a.glb": lambda path: path.write_bytes(scene("glb")),
    "a.3mf": lambda path: save(
        path, model(thing(1, stated='name="A"'), 'objectid="1"', 'objectid="1" partnumber="B"')
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_in_files(tmp_path, name):
    path = tmp_path / name
    FILES[name](path)
    mesh = read_mesh(path)
    found = inspect(mesh)
    assert (found.bodies, found.coincident.count) == (2, 1)
    remark = describe_remarks(mesh, found)[-1]
    if name in ("a.obj", "a.3mf"):
        assert "'B' those of 'A', near (" in remark
    elif name == "a.glb":
        assert "'A'" in remark
        assert "'B'" in remark
    else:
        assert "body 1 those of body 0, near (" in remark


def test_in_stl_the_polygons_are_doubled(tmp_path):
    """STL has facets without bodies: the second body's are duplicates, which repair drops."""
    path = tmp_path / "a.stl"
    path.write_bytes(binary_stl(np.concatenate([cube_triangles(), cube_triangles()])))
    mesh = read_mesh(path)
    assert inspect(mesh).duplicates.count == 12
    mended, done = repair(mesh)
    assert inspect(mended).bodies == 1
    assert "12 polygons were dropped because others have the same vertices" in done[0]


def test_copies_written_by_ourselves(tmp_path):
    """Two groups on one another are two objects of 3MF."""
    solid = PaintedMesh(TWICE, np.array(TRIANGLES + [[n + 8 for n in t] for t in TRIANGLES]))
    path = write_file(tmp_path / "a.3mf", solid)
    assert inspect(read_mesh(path)).coincident.count == 1
    twin = model(thing(1), 'objectid="1"', f'objectid="1" {matrix(np.diag([-1, 1, 1]))}')
    assert inspect(read_mesh(save(path, twin))).coincident.count == 0


def write_file(path, mesh):
    write_mesh(path, mesh)
    return path
