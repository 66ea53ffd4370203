"""Sessions: edits made, replaced, removed, undone; saved, read again."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ffdcli.editor import Plane, Session
from ffdcli.errors import FfdError, FileError, LatticeError
from ffdcli.models import read_lattice, read_model
from support.editor_models import KINDS, SEVERAL, box_file, session_of
from support.mesh_models import off

UP = {"move": {"at": [":", ":", -1], "by": [0, 0, 0.5]}}
TWIST = {"twist": {"axis": "w", "angle": 20}}
TAPER = {"taper": {"axis": "w", "factor": 0.8}}
PULL = {"drag": {"pairs": [{"from": [3, 1.5, 2], "by": [0.1, 0, 0.4]}]}}
BAD = {"drag": {"pairs": [{"from": [30, 1.5, 2], "by": [0, 0, 0.4]}]}}


def net(session):
    return [member.points.copy() for member in session.lattice.members]


def same(one, other):
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_a_model_alone_begins_a_lattice_file(tmp_path):
    with Session.open(box_file(tmp_path)) as session:
        assert session.path == tmp_path / "box.yaml"
        assert session.output == tmp_path / "box.step"
        assert session.unsaved
        assert not session.path.exists()
        session.append(UP)
        session.save()
        assert not session.unsaved
        assert "# A lattice for deforming a mesh" in session.path.read_text()
    with Session.open(box_file(tmp_path)) as session:
        assert session.edits() == (UP,)
        assert not session.unsaved


@pytest.mark.parametrize("kind", ["bspline", "nurbs", "tspline", "hierarchical"])
def test_any_kind_of_volume_can_be_begun(tmp_path, kind):
    with Session.open(box_file(tmp_path), volume=kind) as session:
        assert session.member().spec.volume == kind
        assert session.weighted() == (kind in ("nurbs", "tspline"))
        session.append(*session.drag([[3, 1.5, 2]], by=[[0, 0, 0.3]]))
        session.save()
        settled = read_lattice(session.path, read_model(session.model_path))
        assert same(net(session), [settled.members[0].points])


def test_the_saved_file_gives_the_numbers_on_the_screen(tmp_path):
    with session_of(tmp_path) as session:
        session.append(UP)
        session.append(*session.drag([[3, 1.5, 2]], by=[[0.123456789, 0, 1 / 3]]))
        session.append(TWIST)
        session.save()
        settled = read_lattice(session.path, read_model(session.model_path))
        assert np.array_equal(settled.points, session.lattice.points)
        assert session.edits() == tuple(json.loads(json.dumps(session.edits())))


def test_a_bad_edit_changes_nothing(tmp_path):
    with session_of(tmp_path) as session:
        session.append(UP)
        before, revision = net(session), session.revision
        for attempt in (
            lambda: session.append(BAD),
            lambda: session.append(TWIST, BAD),
            lambda: session.replace(0, BAD),
            lambda: session.replace(0, "twist: {axis: w"),
            lambda: session.replace(5, TWIST),
            lambda: session.remove(5),
            lambda: session.append({"move": {"at": [0, 0, 0], "by": [float("nan"), 0, 0]}}),
        ):
            with pytest.raises(LatticeError):
                attempt()
            assert session.edits() == (UP,)
            assert same(net(session), before)
            assert session.revision == revision


def test_entries_are_shown_replaced_and_removed(tmp_path):
    with session_of(tmp_path) as session:
        session.append(UP, TWIST, PULL)
        assert session.edit_texts()[1] == "twist: {axis: w, angle: 20}"
        session.replace(1, "- taper: {axis: w, factor: 0.8}")
        assert session.edits() == (UP, TAPER, PULL)
        session.remove(0)
        assert session.edits() == (TAPER, PULL)
        undone = []
        while session.undo():
            undone.append(session.edits())
        assert undone == [(UP, TAPER, PULL), (UP, TWIST, PULL), ()]


def test_undo_goes_on_into_the_entries_of_the_file(tmp_path):
    text = (
        "version: 1\nedits:\n  - twist: {axis: w, angle: 20}\n  - taper: {axis: w, factor: 0.8}\n"
    )
    with session_of(tmp_path, text) as session:
        assert not session.unsaved
        assert session.undo()
        assert session.edits() == (TWIST,)
        assert session.unsaved
        assert session.undo()
        assert not session.undo()
        assert session.redo()
        assert session.redo()
        assert not session.redo()
        assert not session.unsaved
        assert session.text == text


EDITS = [UP, TWIST, TAPER, PULL, {"move": {"at": [0, 0, 0], "by": [0.1, 0, 0]}}]
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("append"), st.integers(0, 4)),
        st.tuples(st.just("remove"), st.integers(0, 5)),
        st.tuples(st.just("replace"), st.integers(0, 5)),
        st.just(("undo", 0)),
        st.just(("redo", 0)),
    ),
    max_size=14,
)


@settings(max_examples=25)
@given(steps=STEPS)
def test_undo_and_redo_are_a_list_of_states(tmp_path_factory, steps):
    folder = tmp_path_factory.mktemp("s")
    with session_of(folder) as session:
        states, at = [()], 0
        for what, number in steps:
            now = list(states[at])
            if what == "append":
                session.append(EDITS[number])
                new = [*now, EDITS[number]]
            elif what in ("remove", "replace"):
                if number >= len(now):
                    continue
                new = [*now[:number], *([TAPER] if what == "replace" else []), *now[number + 1 :]]
                if what == "remove":
                    session.remove(number)
                else:
                    session.replace(number, TAPER)
            else:
                possible = at > 0 if what == "undo" else at < len(states) - 1
                assert getattr(session, what)() == possible
                at += (-1 if what == "undo" else 1) * possible
                new = None
            if new is not None and tuple(new) != states[at]:
                states, at = [*states[: at + 1], tuple(new)], at + 1
            assert session.edits() == states[at]
        fresh = session.shown.stages.document.lattice_values(0) | {"edits": list(states[at])}
        from ffdcli.lattice import parse_lattice
        from ffdcli.models import settle_lattice

        wanted = settle_lattice(parse_lattice(fresh, session.lattice.source), session.model)
        assert np.array_equal(wanted.points, session.lattice.points)
    # Killed here, all would come back: the journal holds the same steps.
    with session_of(folder) as again:
        assert again.edits() == states[at]


def test_several_lattices_are_edited_one_by_one(tmp_path):
    with session_of(tmp_path, SEVERAL) as session:
        assert session.count == 2
        one = {"drag": {"pairs": [{"from": [1, 1.5, 2], "by": [0, 0, 0.3]}]}}
        other = {"drag": {"pairs": [{"from": [3, 1.5, 2], "by": [0, 0, 0.3]}]}}
        session.append(one)
        session.active = 1
        session.append(other)
        assert [len(session.edits(n)) for n in (0, 1)] == [1, 2]
        assert session.weighted()
        assert not session.weighted(0)
        with pytest.raises(LatticeError, match=r"lattices\[1\]\.edits\[2\]\.move"):
            session.append({"move": {"at": [9, 0, 0], "by": [0, 0, 1]}})
        with pytest.raises(LatticeError):
            session.active = 2
        session.save()
        settled = read_lattice(session.path, read_model(session.model_path))
        assert same(net(session), [member.points for member in settled.members])
        assert session.undo()
        assert session.edits(1) == session.edits(1)[:1]


def test_a_file_that_changed_on_disk_is_not_overwritten_unasked(tmp_path):
    with session_of(tmp_path) as session:
        session.append(UP)
        session.save()
        assert not session.changed_on_disk
        session.append(TWIST)
        theirs = session.path.read_text() + "# mine\n"
        session.path.write_text(theirs)
        assert session.changed_on_disk
        with pytest.raises(FileError, match="changed on disk"):
            session.save()
        assert session.path.read_text() == theirs
        session.reload()
        assert session.edits() == (UP,)
        assert session.undo()
        assert session.edits() == (UP, TWIST)
        session.save()
        assert session.path.read_text().endswith("# mine\n")
        session.path.unlink()
        assert session.changed_on_disk
        session.save(overwrite=True)
        assert session.path.exists()


def test_reading_a_file_with_other_keys_again_begins_anew(tmp_path):
    with session_of(tmp_path) as session:
        session.append(UP)
        session.path.write_text(
            "version: 1\npoints: [5, 5, 5]\nedits:\n- twist: {axis: w, angle: 9}\n"
        )
        session.reload()
        assert session.nets[0].shape == (5, 5, 5)
        assert session.edits() == ({"twist": {"axis": "w", "angle": 9}},)
        assert session.found_journal is not None
        session.replay(session.found_journal)
        assert session.edits()[-1] == UP or session.edits() == (UP,)
        session.path.write_text("version: 2\n")
        before = session.edits()
        with pytest.raises(FfdError):
            session.reload()
        assert session.edits() == before


def test_a_failed_save_leaves_the_file_and_the_edits(tmp_path, monkeypatch):
    with session_of(tmp_path) as session:
        session.append(UP)
        text = session.path.read_text()

        def full(*_):
            raise FileError("the disk is full", file=str(session.path))

        monkeypatch.setattr("ffdcli.editor.keeping.write_whole", full)
        with pytest.raises(FileError, match="full"):
            session.save()
        assert session.path.read_text() == text
        assert session.unsaved
    with session_of(tmp_path) as session:
        assert session.edits() == (UP,)


def test_every_change_is_another_revision(tmp_path):
    with session_of(tmp_path) as session:
        seen = {session.revision}
        for change in (lambda: session.append(UP), session.undo, session.redo, session.save):
            change()
            seen.add(session.revision)
        assert len(seen) == 5


def test_sentences_of_warnings_are_notices(tmp_path):
    text = "version: 1\nbox: {min: [1, -1, -1], max: [3, 4, 3]}\n"
    with session_of(tmp_path, text) as session:
        session.append(TWIST)
        assert any("locked control points" in each for each in session.notices)
        assert session.nets[0].locked.any()
        mask = session.nets[0].locked
        with pytest.raises(LatticeError, match="displaces"):
            session.append(*session.move(mask, [0, 0, 1]))


def test_points_of_the_screen_are_points_of_the_model(tmp_path):
    for kind, text in KINDS.items():
        folder = tmp_path / kind
        folder.mkdir()
        with session_of(folder, text) as session:
            session.append(*session.drag([[3, 1.5, 2]], by=[[0, 0, 0.3]]))
            found = session.hit([2.9, 1.4, 50], [0, 0, -1])
            assert np.abs(session.image([found.rest])[0] - found.point).max() < 2e-3 * session.size
            assert abs(found.rest[2] - 2) < 1e-12
            assert session.hit([2.9, 1.4, 50], [0, 0, 1]) is None


def test_planes_of_symmetry_are_those_through_the_middle(tmp_path):
    with session_of(tmp_path) as session:
        plane = Plane.of_axis("x", session.bounds)
        assert np.allclose(plane.points(np.array([[4.0, 1, 1]])), [[0, 1, 1]])
        session.append(*session.drag([[4, 1.5, 1]], by=[[0.5, 0.1, 0]], plane=plane))
        right, left = session.image([[4, 1.5, 1], [0, 1.5, 1]])
        assert np.allclose(right, [4.5, 1.6, 1])
        assert np.allclose(left, [-0.5, 1.6, 1])


def test_a_lattice_whose_first_edit_divides_its_cells(tmp_path):
    places = np.random.default_rng(0).uniform([0, 0, 0], [4, 3, 2], (200, 3))
    pairs = [{"from": p.tolist(), "by": [0, 0, 0.2 * float(np.sin(2 * p[0]))]} for p in places]
    text = "version: 1\nvolume: hierarchical\noctree: {depth: auto}\nedits:\n  - "
    text += json.dumps({"fit": {"pairs": pairs, "tolerance": 0.01}})[1:-1] + "\n"
    with session_of(tmp_path, text) as session:
        (count,) = session.nets[0].shape
        seen = session.preview(PULL)
        session.append(PULL)
        assert np.abs(seen.vertices - session.vertices).max() <= 1e-12 * session.size
        session.replace(0, {"fit": {"pairs": pairs[:50], "tolerance": 0.1}})
        (coarser,) = session.nets[0].shape
        assert coarser < count
        wanted = session.image(session.drawn.rest)
        assert np.abs(session.vertices - wanted).max() <= 1e-12 * session.size
        session.save()
        settled = read_lattice(session.path, read_model(session.model_path))
        assert np.array_equal(settled.points, session.lattice.points)
        session.undo()
        assert session.nets[0].shape == (count,)
        # Without the fit there would be no cells.
        with pytest.raises(LatticeError, match="fit"):
            session.remove(0)
        assert len(session.edits()) == 2


def test_edits_that_name_files_read_them(tmp_path):
    corners = [[0, 0, 2.2], [4, 0, 2.2], [4, 3, 2.2], [0, 3, 2.2]]
    (tmp_path / "scan.off").write_text(off(corners, [[0, 1, 2], [0, 2, 3]]))
    (tmp_path / "pairs.csv").write_text("x,y,z,dx,dy,dz\n3,1.5,2,0,0,0.1\n1,1,2,0,0,0.2\n")
    edits = [
        {"drag": {"pairs": "pairs.csv"}},
        {"fit": {"pairs": "pairs.csv"}},
        {"fit": {"target": "scan.off"}},
    ]
    with session_of(tmp_path, "version: 1\nvolume: hierarchical\noctree: {depth: 1}\n") as session:
        for edit in edits:
            seen = session.preview(edit)
            session.append(edit)
            assert np.abs(seen.vertices - session.vertices).max() <= 1e-12 * session.size
        session.save()
        settled = read_lattice(session.path, read_model(session.model_path))
        assert np.array_equal(settled.points, session.lattice.points)
        assert settled.warnings == session.lattice.warnings
        with pytest.raises(LatticeError, match=r"none\.csv"):
            session.append({"drag": {"pairs": "none.csv"}})
