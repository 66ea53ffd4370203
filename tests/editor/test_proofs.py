"""Folds: marked where the model folds, and edits that stop before they are not excluded."""

import numpy as np
import pytest

from support.editor_models import KINDS, SEVERAL, session_of


@pytest.mark.parametrize("kind", list(KINDS))
def test_an_edit_stops_at_a_position_that_is_proved(tmp_path, kind):
    with session_of(tmp_path, KINDS[kind]) as session:
        far = session.drag([[3, 1.5, 2]], by=[[0, 0, -9]])
        stop = session.last_proved(*far)
        assert 0 < stop.share < 1
        assert stop.message
        session.append(*stop.edits)
        (pair,) = stop.edits[0]["drag"]["pairs"]
        assert abs(pair["by"][2] + 9 * stop.share) < 1e-5
        if kind != "inverse":
            assert session.folds.verdict == "yes"
        session.undo()
        near = session.drag([[3, 1.5, 2]], by=[[0, 0, 0.01]])
        assert session.last_proved(*near).share == 1
        assert session.last_proved(*near).edits == near


def test_twice_the_share_at_which_it_stops_folds_the_model(tmp_path):
    with session_of(tmp_path) as session:
        edits = session.move(session.slice_mask("w", -1), [0, 0, -6])
        stop = session.last_proved(*edits)
        by = stop.edits[0]["move"]["by"][2]
        session.append(*session.move(session.slice_mask("w", -1), [0, 0, 2 * by]))
        folds = session.folds
        assert folds.verdict == "no"
        assert len(folds.points) == len(folds.rest) > 0
        assert "folds" in folds.message
        assert np.abs(session.image(folds.rest) - folds.points).max() < 1e-9
        again = session.last_proved(*session.drag([[3, 1.5, 0]], by=[[0, 0, 0.01]]))
        assert again.share == 0
        assert again.edits == []


@pytest.mark.parametrize(
    "edit",
    [
        {"transform": {"at": [":", ":", -1], "rotate": {"axis": "u", "angle": 175}}},
        {"transform": {"at": [":", ":", -1], "translate": [0, 0, -6]}},
        {"bend": {"axis": "u", "toward": "w", "angle": 1500}},
        {"move": {"at": [3, 3, -1], "by": [0, 0, -60]}},
    ],
    ids=lambda edit: next(iter(edit)),
)
def test_all_edits_that_have_a_share_stop(tmp_path, edit):
    with session_of(tmp_path) as session:
        stop = session.last_proved(edit)
        assert 0 < stop.share < 1
        session.append(*stop.edits)
        assert session.folds.verdict == "yes"


def test_each_of_several_lattices_is_proved_by_itself(tmp_path):
    with session_of(tmp_path, SEVERAL) as session:
        for number, point in ((0, [1, 1.5, 2]), (1, [3, 1.5, 2])):
            edits = session.drag([point], by=[[0, 0, -30]])
            stop = session.last_proved(*edits, n=number)
            assert 0 < stop.share < 1
            session.append(*stop.edits, n=number)
            assert session.folds.verdict == "yes"


def test_a_model_that_is_mirrored_as_a_whole_is_edited_on(tmp_path):
    with session_of(tmp_path) as session:
        everything = {"at": [":", ":", ":"], "scale": [1, 1, -1]}
        # On the way it would be flat.
        assert abs(session.last_proved({"transform": everything}).share - 0.5) < 0.01
        session.append({"transform": everything})
        assert session.folds.verdict == "yes"
        near = session.drag([[3, 1.5, 2]], by=[[0, 0, 0.01]])
        assert session.last_proved(*near).share == 1
        far = session.drag([[3, 1.5, 2]], by=[[0, 0, 9]])
        assert 0 < session.last_proved(*far).share < 1


def test_an_edit_without_shares_is_made_or_not(tmp_path):
    with session_of(tmp_path, "version: 1\npoints: [4, 4, 4]\n") as session:
        points = session.nets[0].rest.reshape(4, 4, 4, 3)
        assert session.last_proved({"net": points.tolist()}).share == 1
        stop = session.last_proved({"net": points[::-1, :, ::-1][:, ::-1].tolist()})
        assert stop.share in (0, 1)
        folded = points.copy()
        folded[:, :, -1, 2] = -5
        assert session.last_proved({"net": folded.tolist()}).edits == []
