"""Drags in lattice files: pairs from CSV, holds, groups, and what is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ffdcli.errors import LatticeError
from ffdcli.lattice import load_lattice
from ffdcli.lattice.drag.holds import reaching_box, reaching_triangles
from support.lattice_models import HIGH, LOW, SMALLER, box_triangles, lattice_of, settled

HEAD = "version: 1\npoints: [7, 7, 9]\nedits:\n"
DRAG = HEAD + "  - drag: {pairs: pairs.csv%s}\n"
BOUNDS = np.array([LOW, HIGH])


def load(tmp_path, text, table=None):
    if table is not None:
        (tmp_path / "pairs.csv").write_text(table)
    (tmp_path / "l.yaml").write_text(text)
    return load_lattice(tmp_path / "l.yaml").settle(
        bounds=BOUNDS, triangles=box_triangles(LOW, HIGH), delta=1e-9
    )


def images(lattice, sources):
    frame = lattice.volume.frame
    local = frame.to_local(np.atleast_2d(np.asarray(sources, dtype=float)))
    return frame.to_model(lattice.volume.evaluate(local))


def edit(**keys):
    return {"drag": {"pairs": [{"from": [1, 1, 5], "to": [1.2, 1, 5.5]}], **keys}}


def test_the_header_says_targets_or_displacements(tmp_path):
    sources, goals = [[1, 1, 3], [2, 1, 5]], np.array([[1, 1, 3.5], [2, 1.5, 5]])
    rows = "1,1,3,1,1,3.5\n\n2,1,5,2,1.5,5\n"
    to = load(tmp_path, DRAG % "", "x,y,z,tx,ty,tz\n" + rows)
    np.testing.assert_allclose(images(to, sources), goals, atol=1e-13)
    by = load(tmp_path, DRAG % "", " X, Y, Z, dx, dy, dz\n1,1,3,0,0,0.5\n2,1,5,0,.5,0\n")
    np.testing.assert_allclose(images(by, sources), goals, atol=1e-13)
    np.testing.assert_allclose(by.points, to.points, atol=1e-13)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("1,1,3,1,1,4\n", "row 1 should be the header.*x,y,z,tx,ty,tz or x,y,z,dx,dy,dz"),
        ("x,y,z\n1,1,3\n", "row 1 should be the header"),
        ("", "holds no pairs"),
        ("x,y,z,dx,dy,dz\n", "holds no pairs"),
        ("x,y,z,dx,dy,dz\n1,1,3,0,0,1\n1,1,3\n", "row 3 is not six numbers: '1,1,3'"),
        ("x,y,z,dx,dy,dz\n1,1,3,0,0,up\n", "row 2 is not six numbers"),
        ("x,y,z,dx,dy,dz\n1,1,3,0,0,nan\n", "pair 1 holds .*not finite"),
        ("x,y,z,tx,ty,tz\n1,1,3,1,1,4\n1,1,9,1,1,8\n", r"targets: pair 2 by 1 \(it lies outside"),
    ],
)
def test_wrong_tables_are_refused(tmp_path, table, words):
    with pytest.raises(LatticeError, match=words) as caught:
        load(tmp_path, DRAG % "", table)
    assert (caught.value.line, caught.value.key) == (4, "edits[0].drag.pairs")


def test_conflicts_name_the_line_of_the_pair(tmp_path):
    text = (
        HEAD
        + "  - drag:\n      pairs:\n        - {from: [1, 1, 3], by: [0, 0, 1]}\n"
        + "        - {from: [1, 1, 9], to: [1, 1, 8]}\n      hold:\n        - point: [1, 1, 3]\n"
    )
    with pytest.raises(LatticeError, match=r"pairs\[1\] by 1 .*outside") as caught:
        load(tmp_path, text)
    assert caught.value.line == 6
    both = text.replace("9], to: [1, 1, 8]", "5], by: [0, 0, 0]")
    with pytest.raises(LatticeError, match=r"pairs\[0\] by 0.5 .*hold\[0\] by 0.5") as caught:
        load(tmp_path, both)
    assert caught.value.line == 6
    on = "on_conflict: least_squares\n"
    lattice = load(tmp_path, both + "      " + on)
    (warning,) = lattice.warnings
    assert warning.startswith("edits[0].drag: targets are missed: ")


def test_drags_follow_earlier_edits_and_weights():
    weights = np.random.default_rng(2).uniform(0.5, 2, size=(6, 6, 6)).tolist()
    edits = [
        {"twist": {"axis": "w", "angle": 30}},
        {"weights": weights},
        {"move_knots": {"axis": "u", "values": [0.2, 0.5]}},
        edit(),
        {"drag": {"pairs": [{"from": [1, 1, 5], "by": [0, 0.25, 0]}]}},
    ]
    lattice = settled(volume="nurbs", edits=edits)
    np.testing.assert_allclose(images(lattice, [1, 1, 5]), [[1.2, 1.25, 5.5]], atol=1e-13)


def test_turned_lattices_take_model_coordinates():
    axes = Rotation.from_euler("zyx", [30, 40, 50], degrees=True).as_matrix()
    box = {"center": [1.5, 1, 3], "size": [9, 9, 9], "axes": axes.tolist()}
    held = {"min": [0, 0, 0], "max": [3, 2, 1]}
    lattice = settled(
        box=box, points=[14, 14, 14], edits=[edit(hold=[{"inside": held}], pin=[[0, ":", ":"]])]
    )
    np.testing.assert_allclose(images(lattice, [1, 1, 5]), [[1.2, 1, 5.5]], atol=1e-13)
    places = np.random.default_rng(1).uniform(held["min"], held["max"], size=(200, 3))
    np.testing.assert_allclose(images(lattice, places), places, atol=1e-13)


def test_a_box_held_fixed_stays_to_the_last_bit_of_its_control_points():
    held = {"min": [0, 0, 0], "max": [3, 2, 2]}
    lattice = settled(points=[6, 6, 12], edits=[edit(hold=[{"inside": held}])])
    places = np.random.default_rng(1).uniform(held["min"], held["max"], size=(200, 3))
    reached = lattice.volume.basis_matrix(places).toarray().any(axis=0).reshape(6, 6, 12)
    assert np.array_equal(lattice.points[reached], lattice.volume.rest_points[reached])
    assert np.array_equal(reaching_box(lattice.volume, LOW, np.array([3, 2, 2])), reached)


def rigid_fit(before, after):
    turn, _ = Rotation.align_vectors(after - after.mean(axis=0), before - before.mean(axis=0))
    moved = turn.apply(before - before.mean(axis=0)) + after.mean(axis=0)
    return np.abs(moved - after).max(), turn.magnitude()


def test_a_rigid_box_moves_as_one_and_the_targets_are_met():
    held = {"min": [0, 0, 4.5], "max": [3, 2, 6]}
    pairs = [{"from": [0, 1, 6], "to": [0.2, 1, 6.5]}, {"from": [3, 1, 2], "to": [3.3, 1, 2]}]
    edits = [{"drag": {"pairs": pairs, "hold": [{"inside": held, "rigid": True}]}}]
    lattice = settled(points=[6, 6, 12], edits=edits)
    np.testing.assert_allclose(
        images(lattice, [[0, 1, 6], [3, 1, 2]]), [[0.2, 1, 6.5], [3.3, 1, 2]], atol=1e-12
    )
    places = np.random.default_rng(1).uniform(held["min"], held["max"], size=(300, 3))
    off, turned = rigid_fit(places, images(lattice, places))
    assert off < 1e-12
    assert turned > 0.01
    assert np.abs(images(lattice, places) - places).max() > 0.3


def test_rigid_pieces_that_share_control_points_move_together():
    holds = [
        {"inside": {"min": [0, 0, 5.5], "max": [1, 2, 6]}, "rigid": True},
        {"inside": {"min": [2, 0, 5.5], "max": [3, 2, 6]}, "rigid": True},
    ]
    drag = {"drag": {"pairs": [{"from": [0, 1, 6], "to": [0.2, 1, 6.5]}], "hold": holds}}
    lattice = settled(points=[6, 6, 12], edits=[drag])
    assert "hold[0] and hold[1] share control points and move together" in lattice.warnings[0]
    lattice = settled(points=[16, 6, 12], edits=[drag])
    assert lattice.warnings == ()


@pytest.mark.parametrize(
    ("keys", "hold", "words"),
    [
        (SMALLER, {"min": [0, 0, 3], "max": [3, 2, 4]}, "are locked or pinned, such as"),
        ({}, {"min": [5, 5, 5], "max": [6, 6, 6]}, "outside the lattice box"),
    ],
)
def test_pieces_that_cannot_move_as_one_are_refused(keys, hold, words):
    drag = edit(hold=[{"inside": hold, "rigid": True}])
    with pytest.raises(LatticeError, match=words) as caught:
        settled(**keys, points=[6, 6, 9], edits=[drag])
    assert caught.value.key == "edits[0].drag.hold[0]"


def test_a_rigid_piece_beside_a_fixed_one_is_refused():
    holds = [
        {"inside": {"min": [0, 0, 0], "max": [3, 2, 1]}},
        {"inside": {"min": [0, 0, 1.1], "max": [3, 2, 2]}, "rigid": True},
    ]
    with pytest.raises(LatticeError, match="belong to a part that is held fixed") as caught:
        settled(points=[6, 6, 9], edits=[edit(hold=holds)])
    assert caught.value.key == "edits[0].drag.hold[1]"


def test_a_rigid_piece_cannot_be_stretched():
    held = {"min": [0, 0, 4.5], "max": [3, 2, 6]}
    pairs = [{"from": [0, 1, 6], "to": [0, 1, 6]}, {"from": [3, 1, 6], "to": [3.5, 1, 6]}]
    drag = {"pairs": pairs, "hold": [{"inside": held, "rigid": True}]}
    with pytest.raises(LatticeError, match=r"pairs\[0\] by 0.25 \(its rigid part"):
        settled(points=[6, 6, 12], edits=[{"drag": drag}])
    lattice = settled(points=[6, 6, 12], edits=[{"drag": {**drag, "on_conflict": "least_squares"}}])
    np.testing.assert_allclose(
        images(lattice, [[0, 1, 6], [3, 1, 6]]), [[0.25, 1, 6], [3.25, 1, 6]], atol=1e-7
    )


def test_a_hold_where_nothing_moves_is_said():
    outside = {"inside": {"min": [5, 5, 5], "max": [6, 6, 6]}}
    lattice = settled(edits=[edit(hold=[outside])])
    assert lattice.warnings == (
        "edits[0].drag: hold[0] lies outside the lattice box, where nothing moves",
    )


def test_groups_are_asked_of_the_mesh():
    rim = box_triangles([0, 0, 0], [3, 2, 1])
    keys = {"points": [6, 6, 12], "edits": [edit(hold=[{"group": "rim"}])]}
    facts = {"bounds": BOUNDS, "triangles": box_triangles(LOW, HIGH), "delta": 1e-9}
    with pytest.raises(LatticeError, match="groups of the model are not available"):
        lattice_of(**keys).settle(**facts)
    with pytest.raises(LatticeError, match=r"no group `rim` \(its groups: base, top\)"):
        lattice_of(**keys).settle(**facts, groups={"top": rim, "base": rim})
    lattice = lattice_of(**keys).settle(**facts, groups={"rim": rim})
    places = np.random.default_rng(0).dirichlet([1, 1, 1], size=len(rim))
    on_rim = np.einsum("tc,tcx->tx", places, rim)
    np.testing.assert_allclose(images(lattice, on_rim), on_rim, atol=1e-13)
    moved = lattice.drag([(1, 1, 4)], [(1, 1, 4.5)], hold=[{"group": "rim", "rigid": True}])
    off, _ = rigid_fit(on_rim, images(moved, on_rim))
    assert off < 1e-12


def test_reach_of_triangles_knows_where_basis_functions_vanish():
    volume = settled(degree=[2, 3, 1], points=[9, 8, 7]).volume
    rng = np.random.default_rng(5)
    for _ in range(20):
        triangle = rng.uniform(LOW - 1, HIGH + 1, size=(1, 3, 3))
        shares = rng.dirichlet([1, 1, 1], size=20000)
        places = (shares @ triangle[0])[:, :]
        inside = places[volume.contains(places)]
        met = volume.basis_matrix(inside).toarray().max(axis=0, initial=0) > 0
        found = reaching_triangles(volume, triangle).ravel()
        assert not (met & ~found).any()
        # Sampling misses corners only.
        assert (found & ~met).sum() <= 0.1 * max(found.sum(), 30)
    # A triangle in a knot plane does not reach functions that begin there.
    knot = volume.knots[1][4]
    flat = np.array([[[0, knot, 0], [3, knot, 0], [3, knot, 6]]])
    along = reaching_triangles(volume, flat).any(axis=(0, 2))
    assert np.flatnonzero(along).tolist() == [1, 2, 3]
    side = np.array([[[0, 0, 0], [3, 0, 0], [3, 0, 6]]], dtype=float)
    assert np.flatnonzero(reaching_triangles(volume, side).any(axis=(0, 2))).tolist() == [0]
