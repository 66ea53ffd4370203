"""Selectors of any set of control points, and sets picked on the screen."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ffdcli.editor.making import mask_of
from ffdcli.editor.picking import point_of_triangle
from support.editor_models import KINDS, session_of

OCTREE = "version: 1\nvolume: tspline\noctree: {depth: 3}\n"


def test_any_set_of_control_points_is_selected_exactly(tmp_path):
    with session_of(tmp_path, "version: 1\npoints: [4, 5, 6]\n") as session:

        @settings(max_examples=60)
        @given(arrays(bool, (4, 5, 6), elements=st.booleans()))
        def check(mask):
            selectors = session.selectors(mask.ravel())
            counts = [mask_of(session.member(), [at]) for at in selectors]
            if not mask.any():
                assert selectors == []
                return
            assert np.array_equal(np.sum(counts, axis=0), mask.ravel().astype(int))

        check()


def test_sets_are_written_shortly(tmp_path):
    with session_of(tmp_path, "version: 1\npoints: [4, 5, 6]\n") as session:

        def short(*part):
            mask = np.zeros((4, 5, 6), dtype=bool)
            mask[part] = True
            return session.selectors(mask.ravel())

        assert short(slice(None), slice(None), 5) == [[":", ":", -1]]
        assert short(slice(1, 3), 0, slice(2, None)) == [["1:3", 0, "2:"]]
        assert short([0, 3], 2, slice(0, 3)) == [[[0, 3], 2, ":3"]]
        assert np.array_equal(
            session.slice_mask("v", -1), mask_of(session.member(), [[":", -1, ":"]])
        )


def test_on_octrees_control_points_are_selected_by_number(tmp_path):
    with session_of(tmp_path, OCTREE) as session:
        net, rng = session.nets[0], np.random.default_rng(1)
        for mask in (rng.random(net.count) < 0.1, net.free, net.closed):
            assert np.array_equal(mask_of(session.member(), session.selectors(mask)), mask)
        (at,) = session.selectors(net.closed)
        assert at["hidden"]
        layer = session.slice_mask("w", int(np.flatnonzero(net.free)[0]))
        assert layer.sum() > 1
        assert np.ptp(net.rest[layer, 2]) < 1e-9
        assert not (layer & net.closed).any()


def test_rays_pick_points_where_they_are_now(tmp_path):
    for kind, text in KINDS.items():
        folder = tmp_path / kind
        folder.mkdir()
        with session_of(folder, text) as session:
            net = session.nets[0]
            target = int(np.flatnonzero(net.free)[0])
            session.append(*session.move(np.arange(net.count) == target, [0, 0, 7]))
            place = session.nets[0].points[target]
            found = session.near_mask(place + [0, 0, 5], [0, 0, -1], 1e-3)
            assert found.tolist().index(True) == target
            assert not session.near_mask(place + [0, 0, 5], [0, 0, 1], 1e-3).any()


def test_points_picked_on_a_side_of_the_box_can_be_dragged(tmp_path):
    rng = np.random.default_rng(7)
    for kind in ("bspline", "turned", "nurbs"):
        folder = tmp_path / kind
        folder.mkdir()
        text = KINDS[kind].replace("size: [6, 6, 6]", "size: [4.8, 5, 2]")
        with session_of(folder, text) as session:
            rest, triangles = session.drawn.rest, session.drawn.triangles
            top = np.flatnonzero(rest[triangles][:, :, 2].min(axis=1) == 2)
            for triangle in rng.choice(top, 30):
                point = point_of_triangle(rest, triangles[triangle], rng.dirichlet([1, 1, 1]))
                assert point[2] == 2
                assert session.lattice_at(point) == 0
                for near in (point, session.neat(point), point + [0, 0, 1e-15 * rng.integers(3)]):
                    session.preview(*session.drag([near], by=[[0, 0, 0.1]]))
            assert session.lattice_at([2, 1.5, 20]) is None
