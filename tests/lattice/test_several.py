"""Files with a `lattices` list: reading, boxes that keep clear of one another, writing back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from ffdcli.errors import LatticeError
from ffdcli.lattice import json_schema, load_lattice, parse_lattice, save_lattice
from ffdcli.lattice.box_contacts import find_contact
from ffdcli.lattice.file.source import Source
from ffdcli.lattice.layout import lay_out
from support.lattice_models import box_triangles

LOW, HIGH = np.zeros(3), np.array([10.0, 1.0, 1.0])
LEFT = "  - box: {min: [1, -1, -1], max: [3, 2, 2]}\n"
EDIT = "    edits: [{move: {at: [%s], by: [0, 0, 0.5]}}]\n"


def read(folder, text):
    path = folder / "l.yaml"
    path.write_text("version: 1\nunit: inch\nlattices:\n" + text)
    return settle(load_lattice(path))


def settle(lattices):
    return lattices.settle(
        bounds=np.array([LOW, HIGH]), triangles=box_triangles(LOW, HIGH), delta=1e-8
    )


def layout(centre, size, axes):
    box = {"center": list(centre), "size": list(size), "axes": np.asarray(axes).tolist()}
    (definition,) = parse_lattice({"version": 1, "box": box}, Source()).definitions
    return lay_out(definition, None, 0.0)


def test_each_has_its_own_frame_degree_border_and_edits(tmp_path):
    turned = "  - degree: [2, 1, 3]\n    points: [5, 4, 4]\n    border: c0\n    box: {center: "
    turned += "[6, 0.5, 0.5], size: [2, 4, 4], axes: [[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]]}\n"
    lattices = read(tmp_path, LEFT + EDIT % "3, 3, 3" + turned)
    assert lattices.listed
    assert lattices.unit == "inch"
    assert [volume.degrees for volume in lattices.volumes] == [(3, 3, 3), (2, 1, 3)]
    first, second = lattices.members
    assert first.crossed == ("u_min", "u_max")
    assert (first.locked.sum(), second.locked.any()) == (4 * 36, True)
    assert np.count_nonzero(first.points != first.volume.rest_points) == 1
    assert np.array_equal(second.points, second.volume.rest_points)


@pytest.mark.parametrize(
    ("box", "words"),
    [
        ("{min: [2.5, -1, -1], max: [4, 2, 2]}", "overlap by 0.5"),
        ("{min: [3.000001, -1, -1], max: [4, 2, 2]}", "only 1e-06 apart"),
        (
            "{center: [4, 0, 0], size: [1.41421356237, 1.41421356237, 1], axes: [[0.70710678118, "
            "0.70710678119, 0], [-0.70710678119, 0.70710678118, 0], [0, 0, 1]]}",
            "apart, and do not touch",
        ),
        ("auto", "an automatic box spans the whole mesh"),
    ],
)
def test_boxes_in_each_others_way_are_named(tmp_path, box, words):
    with pytest.raises(LatticeError, match=words) as caught:
        read(tmp_path, LEFT + f"  - box: {box}\n")
    error = caught.value
    assert "lattices[0] and lattices[1]" in error.message
    assert (error.key, error.line) == ("lattices[1].box" if box != "auto" else "lattices[1]", 5)


def test_boxes_that_touch_lock_the_sides_they_share(tmp_path):
    """Also where the mesh does not pass from one to the other."""
    beyond = "  - box: {min: [10, -1, -1], max: [12, 2, 2]}\n"
    end = "  - box: {min: [8, -1, -1], max: [10, 2, 2]}\n"
    alone = read(tmp_path, end + EDIT % "-1, 3, 3")
    assert alone.members[0].crossed == ("u_min",)
    lattices = read(tmp_path, end + beyond)
    assert lattices.members[0].crossed == ("u_min", "u_max")
    assert "u_min" in lattices.members[1].crossed
    with pytest.raises(LatticeError, match="another lattice box lies on its side u_max") as caught:
        read(tmp_path, end + EDIT % "-1, 3, 3" + beyond)
    assert caught.value.key == "lattices[0].edits[0].move.at"


angles = st.tuples(*[st.floats(-3, 3)] * 3)
places = st.tuples(*[st.floats(-2, 2)] * 3)
sizes = st.tuples(*[st.floats(0.1, 3)] * 3)


@settings(max_examples=60)
@given(angles, angles, places, sizes, sizes)
def test_the_gap_agrees_with_linear_programming(first, second, place, size, other):
    """Boxes overlap where a point lies inside both by some margin: the largest there is."""
    one = layout(np.zeros(3), size, Rotation.from_euler("xyz", first).as_matrix())
    two = layout(place, other, Rotation.from_euler("xyz", second).as_matrix())
    normals = np.concatenate([one.frame.axes, -one.frame.axes, two.frame.axes, -two.frame.axes])
    half = np.concatenate([np.tile(size, 2), np.tile(other, 2)]) / 2
    origins = np.repeat([one.frame.origin, two.frame.origin], 6, axis=0)
    limits = half + (normals * origins).sum(axis=1)
    found = linprog(
        [0, 0, 0, -1],
        A_ub=np.column_stack([normals, np.ones(12)]),
        b_ub=limits,
        bounds=[(None, None)] * 4,
    )
    gap = find_contact(one, two, 1e-9).gap
    if abs(gap) > 1e-7 and abs(found.x[3]) > 1e-7:
        assert (gap < 0) == (found.x[3] > 0)
    assert gap == pytest.approx(find_contact(two, one, 1e-9).gap, abs=1e-12)


@settings(max_examples=40)
@given(angles, st.integers(0, 2), st.sampled_from([-1, 1]), sizes, sizes, st.floats(-0.9, 0.9))
def test_touching_sides_are_found_however_the_boxes_lie(turn, axis, way, size, other, slide):
    axes = Rotation.from_euler("xyz", turn).as_matrix()
    shift = np.full(3, slide) * (np.array(size) + other) / 2
    # The second box has its axes in another order: its v along the first's u, and so on.
    turned = axes[[2, 0, 1]]
    along = (axis + 1) % 3
    shift[axis] = way * (size[axis] + other[along]) / 2
    found = find_contact(
        layout(np.zeros(3), size, axes), layout(shift @ axes, other, turned), 1e-12
    )
    ends = ("max", "min") if way > 0 else ("min", "max")
    if found.sides != (f"{'uvw'[axis]}_{ends[0]}", f"{'uvw'[along]}_{ends[1]}"):
        # Thin boxes slid far touch along an edge, which lies in other sides too.
        assert found.gap > 1e-12


@pytest.mark.parametrize("points", [[4, 4, 4], [11, 11, 11]])
def test_saved_lattices_read_back_to_the_last_bit(tmp_path, points):
    first = LEFT + f"    points: {points}\n    edits: [{{twist: {{axis: u, angle: 20}}}}]\n"
    second = "  - volume: nurbs\n    box: {min: [5, -1, -1], max: [8, 2, 2]}\n"
    second += f"    points: {points}\n    degree: [2, 2, 2]\n    border: c0\n"
    second += "    edits: [{weight: {at: [2, 2, 2], value: 3}}, "
    second += "{move: {at: [2, 1, 1], by: [0, 0.1, 0]}}]\n"
    lattices = read(tmp_path, first + second)
    files = save_lattice(lattices, tmp_path / "solved.yaml")
    names = ["solved.0.net.npy", "solved.1.net.npy", "solved.1.weights.npy", "solved.yaml"]
    assert [file.name for file in files] == (names if points[0] > 10 else names[-1:])
    again = settle(load_lattice(tmp_path / "solved.yaml"))
    assert again.unit == "inch"
    for one, other in zip(lattices.volumes, again.volumes, strict=True):
        assert one.same_basis(other)
        assert np.array_equal(one.net, other.net)


def test_scaled_scales_all(tmp_path):
    lattices = read(tmp_path, LEFT + EDIT % "3, 3, 3")
    rest, half = lattices.scaled(0).volumes[0], lattices.scaled(0.5).volumes[0]
    assert np.array_equal(rest.net, rest.rest_points)
    assert half.net[3, 3, 3, 2] == pytest.approx(rest.net[3, 3, 3, 2] + 0.25)


def test_the_schema_has_the_list():
    schema = json_schema()
    entry = schema["properties"]["lattices"]["items"]
    assert set(schema["properties"]) - set(entry["properties"]) == {"version", "unit", "lattices"}
    assert entry["additionalProperties"] is False
    assert schema["dependentSchemas"]["lattices"]["properties"]["box"] is False
