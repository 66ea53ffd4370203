"""Previews are what the lattice itself gives, for every kind of volume and of edit."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from ffdcli.errors import LatticeError
from support.editor_models import KINDS, SEVERAL, session_of

# Of so many drawn vertices one is evaluated by the lattice itself.
SOME = 3
POINT = [3.0, 1.25, 2.0]
DRAG = {"drag": {"pairs": [{"from": POINT, "by": [0.3, -0.2, 0.5]}]}}
FOR_ROWS = [
    {"move": {"at": [":", ":", -1], "by": [0, 0.1, 0.4]}},
    {"move": {"at": [3, 3, -1], "to": [2, 1, 3]}},
    {"transform": {"at": [":", "1:3", -1], "rotate": {"axis": "w", "angle": 20}}},
    {"transform": {"at": [0, ":", ":"], "scale": [1.2, 0.9, 1], "translate": [0.1, 0, 0.2]}},
    {"transform": {"at": [0, ":", ":"], "scale": [2, 2, 2], "center": [1, 2, 3]}},
    {"twist": {"axis": "w", "angle": 30}},
    {"taper": {"axis": "w", "factor": 0.7}},
    {"bend": {"axis": "u", "toward": "w", "angle": 40}},
    {"move_knots": {"axis": "u", "values": [0.2, 0.7]}},
]
FOR_OCTREES = [
    {"move": {"at": {"inside": {"min": [-9, -9, 1], "max": [9, 9, 9]}}, "by": [0, 0.1, 0.4]}},
    {"transform": {"at": {"near": POINT}, "scale": [1.1, 0.9, 1], "translate": [0.1, 0, 0.2]}},
]
FOR_ALL = [
    DRAG,
    {"drag": {"pairs": [{"from": POINT, "to": [3.1, 1.3, 2.5]}]}},
    {"drag": {"pairs": [{"from": POINT, "by": [0, 0, 0.5]}, {"from": [1, 1, 2], "to": [1, 1, 2]}]}},
    {"drag": {"pairs": [{"from": POINT, "by": [0, 0, 0.3]}], "hold": [{"point": [1, 1, 2]}]}},
    {"drag": {"pairs": [{"from": [0.2 * n, 1, 2], "by": [0, 0, 0.1]} for n in range(1, 19)],
              "on_conflict": "least_squares"}},
    {"hammer": {"point": POINT, "height": 0.4}},
]  # fmt: skip
WEIGHTED = [
    {"crimp": {"point": POINT, "sharpness": 2}},
    {"drag": {"pairs": [{"from": POINT, "by": [0, 0, 0.01]}], "vary": "weights"}},
]
BEFORE = {"drag": {"pairs": [{"from": POINT, "by": [0.1, 0.2, 0.6]}]}}


def cases():
    for kind in KINDS:
        edits = list(FOR_ALL) if kind != "turned" else [DRAG]
        rows = kind in ("bspline", "turned", "nurbs", "unclamped")
        edits += FOR_ROWS if rows else FOR_OCTREES
        edits += WEIGHTED if kind in ("nurbs", "tspline", "inverse") else []
        for edit in edits:
            if kind == "unclamped" and "move_knots" in edit:
                continue
            if kind == "inverse" and "vary" in edit.get("drag", {}):
                continue
            yield pytest.param(kind, edit, id=f"{kind}-{next(iter(edit))}")


@pytest.fixture(scope="module")
def sessions(tmp_path_factory):
    made = {}
    for kind, text in KINDS.items():
        made[kind] = session_of(tmp_path_factory.mktemp(kind), text)
        made[kind].append(BEFORE)
    yield made
    for each in made.values():
        each.close()


@pytest.mark.parametrize(("kind", "edit"), list(cases()))
def test_a_preview_is_the_lattices_own_evaluation(sessions, kind, edit):
    session = sessions[kind]
    seen = session.preview(edit)
    before, nets = session.vertices.copy(), session.nets[0].points.copy()
    weighted = not np.array_equal(seen.vertices, before)
    session.append(edit)
    wanted = session.image(session.drawn.rest[::SOME])
    assert np.abs(seen.vertices[::SOME] - wanted).max() <= 1e-12 * session.size
    assert np.abs(seen.vertices - session.vertices).max() <= 1e-12 * session.size
    assert np.abs(seen.nets[0] - session.nets[0].points).max() <= 1e-12 * session.size
    assert np.abs(seen.nets[0] - nets).max() > 1e-3 * session.size or weighted
    session.undo()
    assert np.array_equal(session.vertices, before)


def test_a_polynomial_preview_is_that_of_scipy(tmp_path):
    with session_of(tmp_path, "version: 1\npoints: [7, 5, 6]\n") as session:
        edits = [DRAG, {"drag": {"pairs": [{"from": POINT, "by": [-1, 0.5, 2.5]}]}}]
        for edit in edits:
            seen = session.preview(edit)
        net, (map_,) = seen.nets[0].reshape(7, 5, 6, 3), session.lattice.maps
        u, v, w = (
            BSpline.design_matrix(session.drawn.rest[:, axis], map_.knots[axis], 3).toarray()
            for axis in range(3)
        )
        wanted = np.einsum("mi,mj,mk,ijkc->mc", u, v, w, net)
        assert np.abs(seen.vertices - wanted).max() <= 1e-12 * session.size
        image = session.image([POINT])[0]
        moved = np.abs(seen.vertices - session.vertices).max()
        assert np.allclose(image, POINT)
        assert moved > 1


def test_a_mouse_that_moves_gives_previews_of_each_place(tmp_path, sessions):
    for kind in ("bspline", "turned", "nurbs", "tspline", "inverse", "hierarchical"):
        session = sessions[kind]
        for share in (0.1, 0.5, 1.0, 0.2):
            by = (share * np.array([0.3, -0.2, 0.5])).tolist()
            edit = {"drag": {"pairs": [{"from": POINT, "by": by}]}}
            seen = session.preview(edit)
            wanted = session.shown.stages.extended(0, session.lattice.members[0], [edit])
            net = wanted.map.frame.to_model(wanted.points.reshape(-1, 3))
            assert np.abs(seen.nets[0] - net).max() <= 1e-12 * session.size


def test_edits_together_are_previewed_together(sessions):
    session = sessions["bspline"]
    edits = [FOR_ROWS[0], {"move": {"at": [0, ":", ":"], "by": [0.2, 0, 0]}}, FOR_ROWS[2]]
    for some in (edits[:2], edits, [DRAG, FOR_ALL[1]], [DRAG, DRAG]):
        seen = session.preview(*some)
        session.append(*some)
        assert np.abs(seen.vertices - session.vertices).max() <= 1e-12 * session.size
        session.undo()


def test_an_edit_that_cannot_be_made_is_refused_as_when_it_is_made(sessions):
    session = sessions["bspline"]
    for edit in (
        {"drag": {"pairs": [{"from": [30, 0, 0], "by": [0, 0, 1]}]}},
        {"move": {"at": [9, 0, 0], "by": [0, 0, 1]}},
        {"move": {"at": [0, 0, 0], "by": [0, 0]}},
        {"twist": {"axis": "q", "angle": 3}},
        {"weight": {"at": [0, 0, 0], "value": 2}},
        {"nothing": 3},
    ):
        with pytest.raises(LatticeError) as seen:
            session.preview(edit)
        with pytest.raises(LatticeError) as made:
            session.append(edit)
        assert str(seen.value) == str(made.value)
    assert session.edits() == (BEFORE,)


def test_locked_control_points_are_refused_with_the_first_numbers_that_displace_them(tmp_path):
    text = "version: 1\nbox: {min: [1, -1, -1], max: [3, 4, 3]}\n"
    with session_of(tmp_path, text) as session:
        at = [0, ":", ":"]
        for still, edit in (
            ({"move": {"at": at, "by": [0, 0, 0]}}, {"move": {"at": at, "by": np.ones(3)}}),
            (
                {"transform": {"at": at, "scale": [1, 1, 1]}},
                {"transform": {"at": at, "scale": [2, 1, 2]}},
            ),
        ):
            assert np.array_equal(session.preview(still).vertices, session.vertices)
            with pytest.raises(LatticeError, match="displaces"):
                session.preview(edit)
        half = session.drag([[2, 1.5, 2]], by=[[0, 0, 0.2]])
        seen = session.preview(*half)
        session.append(*half)
        assert np.abs(seen.vertices - session.vertices).max() <= 1e-12 * session.size
        outside = (session.drawn.rest[:, 0] < 1) | (session.drawn.rest[:, 0] > 3)
        assert np.array_equal(session.vertices[outside], session.drawn.rest[outside])


def test_each_of_several_lattices_has_previews(tmp_path):
    with session_of(tmp_path, SEVERAL) as session:
        for number, point in ((0, [1, 1.5, 2.0]), (1, [3, 1.5, 2.0])):
            edit = {"drag": {"pairs": [{"from": point, "by": [0, 0, 0.4]}]}}
            seen, before = session.preview(edit, n=number), session.vertices.copy()
            (start,) = session.image([point])
            session.append(edit, n=number)
            assert np.abs(seen.vertices - session.vertices).max() <= 1e-12 * session.size
            wanted = session.image(session.drawn.rest)
            assert np.abs(session.vertices - wanted).max() <= 1e-12 * session.size
            other = session.drawn.rest[:, 0] > 2 if number == 0 else session.drawn.rest[:, 0] < 2
            assert np.array_equal(session.vertices[other], before[other])
            moved = session.image([point])[0] - start
            assert np.abs(moved - [0, 0, 0.4]).max() < 1e-12


def test_the_slider_is_the_scaled_lattice(sessions):
    for session in sessions.values():
        for share in (0.0, 0.25, 1.0):
            found = session.vertices_at(share)[::SOME]
            wanted = session.image(session.drawn.rest[::SOME], share)
            assert np.abs(found - wanted).max() <= 1e-12 * session.size
        assert np.abs(session.vertices_at(0.0) - session.drawn.rest).max() < 1e-12 or (
            session.member().spec.volume == "nurbs"
        )
        (net,) = session.nets_at(0.0)
        assert np.abs(net - session.nets[0].rest).max() <= 1e-12 * session.size


def test_points_that_rounding_carries_off_the_box_follow_its_side(tmp_path):
    text = "version: 1\nbox: {min: [0, 0, 0], max: [4, 3, 1.999999999]}\n"
    with session_of(tmp_path, text) as session:
        (functions,) = session.shown.functions
        assert len(functions.off) > 0
        (drag,) = session.drag([POINT], by=[[0.3, -0.2, 0.5]])
        for edit in (drag, FOR_ROWS[0], FOR_ROWS[1], FOR_ROWS[5]):
            seen = session.preview(edit)
            session.append(edit)
            wanted = session.image(session.drawn.rest)
            assert np.abs(seen.vertices - wanted).max() <= 1e-12 * session.size
            assert np.abs(session.vertices - wanted).max() <= 1e-12 * session.size
