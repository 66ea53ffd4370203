"""Journals: nothing is lost when a session is killed, and nothing is applied to another file."""

import os
import signal
import subprocess
import sys

import pytest

from ffdcli.editor import Session
from ffdcli.editor.journal import apply_step, journal_path, read_journal, step_between
from ffdcli.errors import FileError
from support.editor_models import box_file, session_of

UP = {"move": {"at": [":", ":", -1], "by": [0, 0, 0.5]}}
TWIST = {"twist": {"axis": "w", "angle": 20}}
TAPER = {"taper": {"axis": "w", "factor": 0.8}}

KILLED = """
import os, signal, sys
from ffdcli.editor import Session
session = Session.open(*sys.argv[1:])
session.append({"move": {"at": [":", ":", -1], "by": [0, 0, 0.5]}})
session.append({"twist": {"axis": "w", "angle": 20}})
session.append({"taper": {"axis": "w", "factor": 0.8}})
session.remove(1)
print("ready", flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def run_killed(*paths):
    command = [sys.executable, "-c", KILLED, *map(str, paths)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout == "ready\n", done.stderr
    assert done.returncode == -signal.SIGKILL


def test_a_killed_session_comes_back_with_its_steps(tmp_path):
    lattice = tmp_path / "l.yaml"
    lattice.write_text("version: 1\n# mine\n")
    run_killed(box_file(tmp_path), lattice)
    assert lattice.read_text() == "version: 1\n# mine\n"
    with Session.open(box_file(tmp_path), lattice) as session:
        assert session.edits() == (UP, TAPER)
        assert session.unsaved
        assert any("4 steps" in each for each in session.notices)
        assert session.undo()
        assert session.edits() == (UP, TWIST, TAPER)
        assert session.redo()
        session.save()
    assert not journal_path(lattice).exists()
    assert lattice.read_text().startswith("version: 1\nedits:\n  - move:")
    assert lattice.read_text().endswith("# mine\n")


def test_a_session_killed_before_its_first_save_comes_back(tmp_path):
    run_killed(box_file(tmp_path))
    # Another kind of volume asked for now does not change what was begun.
    with Session.open(box_file(tmp_path), volume="hierarchical") as session:
        assert session.member().spec.volume == "bspline"
        assert session.edits() == (UP, TAPER)


def test_the_journal_of_another_version_is_named_and_kept(tmp_path):
    lattice = tmp_path / "l.yaml"
    lattice.write_text("version: 1\n")
    run_killed(box_file(tmp_path), lattice)
    lattice.write_text("version: 1\nedits:\n  - twist: {axis: u, angle: 5}\n")
    with Session.open(box_file(tmp_path), lattice) as session:
        assert session.edits() == ({"twist": {"axis": "u", "angle": 5}},)
        assert not session.unsaved
        assert session.found_journal is not None
        assert any(session.found_journal.name in each for each in session.notices)
        session.replay(session.found_journal)
        assert session.edits() == ({"twist": {"axis": "u", "angle": 5}}, UP, TAPER)
        assert session.found_journal is None
        assert list(tmp_path.glob(".l.yaml.edits.jsonl.*")) == []


def test_the_journal_of_another_model_is_not_applied(tmp_path):
    lattice = tmp_path / "l.yaml"
    lattice.write_text("version: 1\n")
    run_killed(box_file(tmp_path), lattice)
    other = tmp_path / "other.off"
    other.write_bytes(box_file(tmp_path).read_bytes())
    with Session.open(other, lattice) as session:
        assert session.edits() == ()
        assert any("box.off" in each for each in session.notices)
        session.discard(session.found_journal)
        assert session.found_journal is None
        assert session.notices == ()


def test_a_session_killed_while_it_saves_has_saved_or_has_not(tmp_path, monkeypatch):
    def die(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("ffdcli.editor.keeping.write_whole", die)
    with session_of(tmp_path) as session:
        session.append(UP)
        with pytest.raises(KeyboardInterrupt):
            session.save()
    with session_of(tmp_path) as session:
        assert session.edits() == (UP,)
        assert session.unsaved
        session.append(TWIST)
        text = session.text
        with pytest.raises(KeyboardInterrupt):
            session.save()
    # Killed after the file was written, before the journal was ended.
    session.path.write_text(text)
    with session_of(tmp_path) as session:
        assert session.edits() == (UP, TWIST)
        assert not session.unsaved
        assert session.notices == ()


def test_a_line_that_was_cut_off_is_left_out(tmp_path):
    with session_of(tmp_path) as session:
        session.append(UP)
        session.append(TWIST)
    place = journal_path(session.path)
    place.write_bytes(place.read_bytes()[:-7])
    with session_of(tmp_path) as session:
        assert session.edits() == (UP,)
        session.append(TAPER)
    with session_of(tmp_path) as session:
        assert session.edits() == (UP, TAPER)


@pytest.mark.parametrize("content", [b"", b"\0" * 40, b'{"journal": 1, "dig'])
def test_a_journal_without_a_step_is_nothing(tmp_path, content):
    lattice = tmp_path / "lattice.yaml"
    lattice.write_text("version: 1\n")
    journal_path(lattice).write_bytes(content)
    with session_of(tmp_path) as session:
        assert session.edits() == ()
        session.append(UP)
    with session_of(tmp_path) as session:
        assert session.edits() == (UP,)


def test_what_is_no_journal_is_named(tmp_path):
    lattice = tmp_path / "lattice.yaml"
    lattice.write_text("version: 1\n")
    journal_path(lattice).write_text("shopping\nlist\n")
    with pytest.raises(FileError, match="no journal"):
        session_of(tmp_path)
    assert journal_path(lattice).read_text() == "shopping\nlist\n"


def test_steps_that_fit_no_entries_are_set_aside(tmp_path):
    with session_of(tmp_path) as session:
        session.append(UP)
    place = journal_path(session.path)
    head = place.read_text().splitlines()[0]
    place.write_text(f"{head}\n[[0, 5, [], []]]\n")
    with session_of(tmp_path) as session:
        assert session.edits() == ()
        assert session.found_journal is not None


def test_two_sessions_do_not_edit_one_file(tmp_path):
    with session_of(tmp_path) as session:
        session.append(UP)
        with pytest.raises(FileError, match="another `ffd edit`"):
            session_of(tmp_path)
    with session_of(tmp_path) as session:
        assert session.edits() == (UP,)


def test_a_saved_session_leaves_no_journal(tmp_path):
    with session_of(tmp_path) as session:
        session.append(UP)
        assert read_journal(journal_path(session.path)).steps
        session.save()
        assert read_journal(journal_path(session.path)) is None
        session.undo()
    with session_of(tmp_path) as session:
        assert session.edits() == ()
    assert sorted(os.listdir(tmp_path)) == [".lattice.yaml.edits.jsonl", "box.off", "lattice.yaml"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_folder_that_cannot_be_written_to_is_named(tmp_path):
    box, lattice = box_file(tmp_path), tmp_path / "lattice.yaml"
    lattice.write_text("version: 1\n")
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(FileError, match="journal"):
            Session.open(box, lattice)
    finally:
        tmp_path.chmod(0o700)


def test_steps_hold_what_changed_alone():
    old, new = ((UP, TWIST, TAPER), (UP,)), ((UP, TAPER, TAPER), (UP,))
    assert step_between(old, new) == [[0, 1, [TWIST], [TAPER]]]
    assert step_between(new, (new[0], (UP, TWIST))) == [[1, None, [], [TWIST]]]
    assert apply_step(old, step_between(old, new)) == new
    assert step_between(old, old) == []
    longer = ((UP, UP, UP), ())
    assert apply_step(old, step_between(old, longer)) == longer
    assert apply_step(longer, step_between(longer, old)) == old
    with pytest.raises(ValueError, match="other entries"):
        apply_step(((UP,), ()), step_between(old, new))
