"""The lattice settled by a mesh: box, edits in the right coordinates, locked control points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ffdcli.errors import LatticeError
from ffdcli.lattice import load_lattice, save_lattice
from support.lattice_models import DOWN, FAR, HIGH, LOW, SMALLER, box_triangles, lattice_of, settled


def test_automatic_box_is_the_bounding_box_and_rests():
    lattice = settled(degree=[2, 3, 4])
    assert np.array_equal(lattice.volume.box, [LOW, HIGH])
    assert lattice.volume.shape == (5, 6, 7)
    assert np.array_equal(lattice.volume.net, lattice.volume.rest_points)
    assert lattice.crossed == ()
    assert not lattice.locked.any()


def test_flat_mesh_gets_a_thickness():
    triangles = box_triangles(LOW, [3.0, 2.0, 0.0])[:2]
    bounds = np.array([[0.0, 0, 0], [4.0, 3.0, 0.0]])
    lattice = lattice_of().settle(bounds=bounds, triangles=triangles, delta=1e-9)
    np.testing.assert_allclose(lattice.volume.box, [[0, 0, -0.25], [4, 3, 0.25]])


def test_a_mesh_without_extent_is_refused():
    with pytest.raises(LatticeError, match="no usable extent") as caught:
        settled(high=LOW)
    assert caught.value.key == "box"


def test_a_box_too_thin_for_numbers_is_refused():
    with pytest.raises(LatticeError, match="no usable extent along u"):
        settled(box={"min": [0, 0, 0], "max": [5e-324, 1, 1]})


@pytest.mark.parametrize(
    ("keys", "words"),
    [({}, "automatic"), ({"box": {"min": [0, 0, 0], "max": [1, 1, 1]}}, "borders")],
)
def test_unsettled_lattice_raises_when_used(keys, words):
    lattice = lattice_of(**keys)
    for use in (lambda: lattice.volume, lambda: lattice.locked, lambda: lattice.scaled(0.5)):
        with pytest.raises(LatticeError, match=f"needs a mesh.*{words}"):
            use()


def test_edits_of_aligned_boxes_are_written_in_model_coordinates():
    edits = [
        {"move": {"at": {"near": list(FAR)}, "to": list(FAR - DOWN)}},
        {"transform": {"at": [-1, -1, -1], "scale": [2, 2, 2], "center": list(FAR + HIGH - 1)}},
    ]
    lattice = settled(low=FAR, high=FAR + HIGH, edits=edits)
    frame = lattice.volume.frame
    assert np.any(frame.origin != 0)
    placed = frame.to_model(lattice.volume.net)
    np.testing.assert_allclose(placed[0, 0, 0], FAR - DOWN, rtol=1e-15)
    np.testing.assert_allclose(placed[-1, -1, -1], FAR + HIGH + 1, rtol=1e-15)


def test_edits_of_turned_boxes_count_from_the_centre_along_the_axes():
    axes = Rotation.from_euler("zyx", [30, 40, 50], degrees=True).as_matrix()
    centre = np.array([5.0, 6.0, 7.0])
    box = {"center": centre.tolist(), "size": [2, 4, 6], "axes": axes.tolist()}
    far_away = np.array([[100.0, 0, 0], [101.0, 1, 1]])
    lattice = lattice_of(
        box=box,
        edits=[
            {"move": {"at": {"near": [-1, -2, -3]}, "by": [0.5, 0, 0]}},
            {"transform": {"at": [-1, -1, -1], "scale": [2, 2, 2]}},
        ],
    ).settle(bounds=far_away, triangles=box_triangles(*far_away), delta=1e-9)
    volume = lattice.volume
    np.testing.assert_allclose(volume.net[0, 0, 0], [-0.5, -2, -3], atol=1e-12)
    np.testing.assert_allclose(volume.net[-1, -1, -1], [2, 4, 6], atol=1e-12)
    np.testing.assert_allclose(
        volume.frame.to_model(volume.net[0, 0, 0]), centre + axes.T @ [-0.5, -2, -3]
    )
    assert "nothing is deformed" in lattice.warnings[0]


def test_box_by_centre_without_axes_is_aligned():
    lattice = settled(box={"center": [1.5, 1, 3], "size": [3, 2, 6]})
    assert lattice.volume.frame.aligned
    assert np.array_equal(lattice.volume.box, [LOW, HIGH])


def test_edits_follow_one_another():
    move = {"move": {"at": [":", ":", -1], "by": [1, 0, 0]}}
    twist = {"twist": {"axis": "w", "angle": 90}}
    one = settled(edits=[move, twist]).volume.net[0, 0, -1]
    other = settled(edits=[twist, move]).volume.net[0, 0, -1]
    # The corner (0, 0) is (-1.5, -1) from the centre line; a quarter turn makes it (1, -1.5).
    np.testing.assert_allclose(one, [1.5 + 1, 1 - 0.5, 6], atol=1e-12)
    np.testing.assert_allclose(other, [1.5 + 1 + 1, 1 - 1.5, 6], atol=1e-12)


def test_places_of_selectors_are_those_before_any_edit():
    edits = [
        {"move": {"at": [0, 0, 0], "by": [-9, 0, 0]}},
        {"move": {"at": {"near": [0, 0, 0]}, "by": [0, 0, -1]}},
    ]
    assert settled(edits=edits).volume.net[0, 0, 0].tolist() == [-9, 0, -1]


def test_selector_that_holds_nothing_is_refused():
    inside = {"inside": {"min": [7, 7, 7], "max": [8, 8, 8]}}
    with pytest.raises(LatticeError, match="selects no control point") as caught:
        settled(edits=[{"move": {"at": inside, "by": [0, 0, 1]}}])
    assert caught.value.key == "edits[0].move.at"


def test_to_for_several_found_inside_is_refused():
    inside = {"inside": {"min": [0, 0, 0], "max": [3, 2, 0]}}
    with pytest.raises(LatticeError, match="selects 36") as caught:
        settled(edits=[{"move": {"at": inside, "to": [0, 0, 1]}}])
    assert caught.value.key == "edits[0].move.to"


def test_overflow_is_refused():
    edit = {"move": {"at": [0, 0, 0], "by": [1.7e308, 0, 0]}}
    with pytest.raises(LatticeError, match="too large"):
        settled(edits=[edit, edit])


def test_move_knots_keeps_control_points_and_moves_the_map():
    lattice = settled(edits=[{"move_knots": {"axis": "u", "values": [0.2, 0.3]}}])
    rest = settled()
    assert np.array_equal(lattice.volume.net, rest.volume.net)
    np.testing.assert_allclose(lattice.volume.knots[0][4:6], [0.6, 0.9])
    points = np.array([[1.0, 1.0, 1.0]])
    assert np.abs(lattice.volume.evaluate(points) - points).max() > 1e-3
    # Part of the way runs from the rest of the knots as they are after the edit.
    at_rest = lattice.scaled(0)
    assert np.array_equal(at_rest.volume.net, at_rest.volume.rest_points)
    np.testing.assert_allclose(at_rest.volume.evaluate(points), points, atol=1e-14)


def test_locked_layers_are_at_the_crossed_side():
    lattice = settled(**SMALLER)
    assert lattice.crossed == ("w_min",)
    assert lattice.locked[:, :, :2].all()
    assert not lattice.locked[:, :, 2:].any()


@pytest.mark.parametrize(
    "edit",
    [
        {"move": {"at": [0, 3, 1], "by": [0, 0, 0.1]}},
        {"move": {"at": [0, 3, 0], "to": [0, 1, 3.1]}},
        {"transform": {"at": [0, 3, ":"], "scale": [1.1, 1, 1]}},
    ],
)
def test_edit_that_displaces_a_locked_point_is_refused_by_name(edit):
    with pytest.raises(LatticeError, match=r"\[0, 3, [01]\].*locked.*w_min.*border") as caught:
        settled(**SMALLER, edits=[{"twist": {"axis": "w", "angle": 9}}, edit])
    assert caught.value.key == f"edits[1].{next(iter(edit))}.at"


def test_net_that_displaces_locked_points_is_refused():
    net = settled(**SMALLER).volume.net.copy()
    net[:, :, 1:] += [0, 0, 0.25]
    with pytest.raises(
        LatticeError, match=r"\[0, 0, 1\].* and 33 more, which are locked"
    ) as caught:
        settled(**SMALLER, edits=[{"net": net.tolist()}])
    assert caught.value.key == "edits[0].net"


def test_locked_points_may_be_named_if_they_stay():
    edits = [
        {"move": {"at": [":", ":", ":"], "by": [0, 0, 0]}},
        {"transform": {"at": [":", ":", ":"], "rotate": {"axis": "w", "angle": 360}}},
    ]
    lattice = settled(**SMALLER, edits=edits)
    assert np.array_equal(lattice.volume.net, lattice.volume.rest_points)


@pytest.mark.parametrize("edit", ["twist", "taper", "bend"])
def test_edits_without_at_leave_locked_points_and_say_so(edit):
    values = {
        "twist": {"axis": "u", "angle": 20},
        "taper": {"axis": "u", "factor": 0.5},
        "bend": {"axis": "u", "toward": "w", "angle": 20},
    }
    lattice = settled(**SMALLER, edits=[{edit: values[edit]}])
    locked = lattice.locked
    assert np.array_equal(lattice.volume.net[locked], lattice.volume.rest_points[locked])
    assert np.any(lattice.volume.net[~locked] != lattice.volume.rest_points[~locked])
    (warning,) = lattice.warnings
    assert warning.startswith(f"edits[0].{edit} leaves")
    assert "w_min" in warning


def test_everything_locked_is_said():
    lattice = settled(box={"min": [1, 0.5, 3], "max": [2, 1.5, 4]}, points=[4, 4, 4], edits=[])
    assert lattice.crossed == ()  # the box is wholly inside the solid: no polygon meets it
    low, high = [0.5, 0, 0], [2.5, 1, 4]
    edits = [{"twist": {"axis": "w", "angle": 9}}]
    box = {"min": [1, 0.5, 3], "max": [2, 1.5, 5]}
    through = np.concatenate([box_triangles(low, high), box_triangles([0, 0.2, 0], [2, 2, 8])])
    lattice = lattice_of(box=box, points=[4, 4, 4], border="c2", edits=edits).settle(
        bounds=np.array([LOW, [3, 2, 8]]), triangles=through, delta=1e-9
    )
    assert lattice.locked.all()
    assert "all control points are locked" in lattice.warnings[0]
    edits = [{"move": {"at": [1, 1, 1], "by": [0, 0, 1]}}]
    with pytest.raises(LatticeError, match="locked like all others"):
        lattice_of(box=box, points=[4, 4, 4], border="c2", edits=edits).settle(
            bounds=np.array([LOW, [3, 2, 8]]), triangles=through, delta=1e-9
        )


def test_move_knots_may_not_touch_the_rest_of_locked_points():
    across = {"move_knots": {"axis": "u", "values": [0.2, 0.7]}}
    along = {"move_knots": {"axis": "w", "values": [0.2, 0.7]}}
    for edit in (across, along):
        with pytest.raises(LatticeError, match="place at rest of control points") as caught:
            settled(**SMALLER, edits=[edit])
        assert caught.value.key == "edits[0].move_knots"
    # With C0 the side itself is all that is locked, and the first knot span does not move it.
    settled(**SMALLER, border="c0", edits=[along])
    # C1: two layers rest on the first interior knot; the second may move.
    edit = {"move_knots": {"axis": "w", "values": [1 / 3, 0.7]}}
    lattice = settled(**SMALLER, edits=[edit])
    side = np.array([[1.1, 0.7, 3.0]])
    np.testing.assert_allclose(lattice.volume.evaluate(side), side, atol=1e-14)
    np.testing.assert_allclose(lattice.volume.jacobian(side)[0], np.eye(3), atol=1e-13)


@settings(max_examples=25)
@given(
    st.sampled_from(["clamped", "unclamped"]),
    st.sampled_from(["c0", "c1", "c2"]),
    st.tuples(*[st.integers(1, 4)] * 3),
    st.integers(0, 2**32 - 1),
)
def test_any_net_joins_as_smoothly_as_asked(ends, border, degree, seed):
    counts = [k + 6 for k in degree]
    lattice = settled(
        box={"min": [-1, -1, 3], "max": [2, 3, 7]},
        ends=ends,
        border=border,
        degree=list(degree),
        points=counts,
    )
    assert lattice.crossed == ("u_max", "w_min")
    rng = np.random.default_rng(seed)
    free = ~lattice.locked[..., None]
    volume = lattice.with_net(lattice.volume.net + free * rng.normal(size=(*counts, 3))).volume
    side = np.column_stack([rng.uniform(-1, 2, 9), rng.uniform(-1, 3, 9), np.full(9, 3.0)])
    np.testing.assert_allclose(volume.evaluate(side), side, atol=1e-12)
    if border != "c0":
        np.testing.assert_allclose(
            volume.jacobian(side), np.broadcast_to(np.eye(3), (9, 3, 3)), atol=1e-10
        )


def test_scaled_runs_from_rest_to_the_edits():
    lattice = settled(edits=[{"bend": {"axis": "w", "toward": "v", "angle": 50}}])
    rest, full = lattice.volume.rest_points, lattice.volume.net
    assert np.array_equal(lattice.scaled(0).volume.net, rest)
    assert np.array_equal(lattice.scaled(1).volume.net, full)
    np.testing.assert_allclose(lattice.scaled(0.25).volume.net, 0.75 * rest + 0.25 * full)
    assert np.array_equal(lattice.volume.net, full)
    with pytest.raises(LatticeError, match="nan"):
        lattice.scaled(float("nan"))


def test_with_net_refuses_wrong_nets():
    lattice = settled(**SMALLER)
    net = lattice.volume.net
    for wrong in (net[1:], np.where(net == net[5, 5, 5], np.inf, net)):
        with pytest.raises(LatticeError, match="a control net here is"):
            lattice.with_net(wrong)
    with pytest.raises(LatticeError, match="locked"):
        lattice.with_net(net + 1)


EDITED = {
    "aligned": {"edits": [{"bend": {"axis": "w", "toward": "u", "angle": 33}}], "unit": "inch"},
    "far": {"edits": [{"twist": {"axis": "w", "angle": 33}}]},
    "knots": {
        "degree": [2, 3, 1],
        "points": [6, 5, 4],
        "knots": [[0.1, 0.1, 1 / 3], [0.5], [0.2, 0.9]],
        "edits": [
            {"move_knots": {"axis": "v", "values": [0.7]}},
            {"move": {"at": [1, 1, 1], "by": [0.1, 0.2, 1e-9]}},
        ],
    },
    "unclamped": {"ends": "unclamped", "edits": [{"taper": {"axis": "v", "factor": 0.3}}]},
    "locked": {
        **SMALLER,
        "border": {"w_min": "c2"},
        "edits": [{"twist": {"axis": "w", "angle": 33}}],
    },
    "turned": {
        "box": {
            "center": [1, 1, 1],
            "size": [9, 9, 13],
            "axes": Rotation.from_euler("zyx", [3, 4, 5], degrees=True).as_matrix().tolist(),
        },
        "edits": [{"twist": {"axis": "w", "angle": 33}}],
    },
    "large": {"points": [11, 11, 11], "edits": [{"twist": {"axis": "w", "angle": 33}}]},
    "large far": {"points": [11, 11, 11], "edits": [{"twist": {"axis": "w", "angle": 33}}]},
}


@pytest.mark.parametrize("name", EDITED)
def test_saved_lattice_reads_back_to_the_last_bit(name, tmp_path):
    shift = FAR if "far" in name else 0
    low, high = LOW + shift + 0.1, HIGH + shift + 1 / 3
    lattice = settled(low=low, high=high, **EDITED[name])
    files = save_lattice(lattice, tmp_path / "solved.yaml")
    assert [path.name for path in tmp_path.iterdir() if path not in files] == []
    assert len(files) == (2 if "large" in name else 1)
    again = load_lattice(tmp_path / "solved.yaml").settle(
        bounds=np.array([low, high]), triangles=box_triangles(low, high), delta=1e-9
    )
    assert again.volume.same_basis(lattice.volume)
    assert np.array_equal(again.volume.net, lattice.volume.net)
    assert np.array_equal(again.locked, lattice.locked)
    assert again.unit == lattice.unit
    assert [type(edit).__name__ for edit in again.member.spec.edits] == ["NetEdit"]


def test_unsettled_lattice_is_not_saved(tmp_path):
    with pytest.raises(LatticeError):
        save_lattice(lattice_of(), tmp_path / "out.yaml")
    assert list(tmp_path.iterdir()) == []
