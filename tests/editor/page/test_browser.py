"""The page of `ffd edit` in a real browser, from an STL file to a verified STEP file."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

pytest.importorskip("viser")

from ffdcli.editor import Session
from support.browser import chromium
from support.commands import ffd
from support.editor_page import Tab, editing

LOW, HIGH = np.array([0.0, 0.0, 0.0]), np.array([40.0, 20.0, 10.0])
BOUNDS = np.stack([LOW, HIGH])


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture
def folder(tmp_path):
    """A folder with an STL file of a box."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * HIGH
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    lines = ["solid box"]
    for a, b, c, d in quads:
        for triangle in ((a, b, c), (a, c, d)):
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += ["vertex {} {} {}".format(*corners[each]) for each in triangle]
            lines += ["endloop", "endfacet"]
    (tmp_path / "box.stl").write_text("\n".join([*lines, "endsolid", ""]))
    return tmp_path


def top_face(session):
    """Colour of the top face, and its vertices' numbers."""
    drawn = session.drawn
    high = np.all(drawn.rest[drawn.triangles][:, :, 2] == HIGH[2], axis=1)
    colour = drawn.colours[drawn.triangles[np.flatnonzero(high)[0], 0]]
    return colour, np.flatnonzero((drawn.colours == colour).all(axis=1))


def middle_of_last_layer(folder, edits):
    """Mean of the control points of the last layer along w, after some edits."""
    with Session.open(folder / "box.stl", folder / "aside.yaml") as session:
        session.append(*edits)
        place = session.nets[0].points[session.slice_mask("w", -1)].mean(axis=0)
    for left in folder.glob(".aside*"):
        left.unlink()
    return place


def without_exact_faces(tab):
    """Keep the triangles of the session on the screen."""
    tab.open("View")
    tab.page.get_by_label("Exact faces, when the model rests").click()
    tab.open("Edit")


def entries(tab, count):
    """Entries of the history, as the page shows them, the first one first."""
    tab.open("History")
    boxes = [tab.page.locator("textarea:visible").nth(row) for row in range(count)]
    return [yaml.safe_load(box.input_value()) for box in reversed(boxes)]


@pytest.mark.sweep
def test_from_an_stl_file_to_a_verified_step_file(browser, folder):
    with Session.open(folder / "box.stl") as session:
        rest = session.drawn.rest
        colour, numbers = top_face(session)
    point = np.array([28.0, 8.0, 10.0])
    with editing(folder, "box.stl") as running:
        tab = Tab(browser, running.address, BOUNDS)
        tab.says("0 edits")
        without_exact_faces(tab)
        tab.wait_for(colour, rest[numbers])
        # A point of the model is pulled with the mouse.
        tab.drag(point, point + [0, 0, 6], colour)
        tab.says("1 edit ")
        pulled = tab.drawn(colour)
        # Undo and redo, by a button and by a key.
        tab.press("Undo")
        tab.says("0 edits")
        tab.wait_for(colour, rest[numbers])
        assert np.abs(tab.drawn(colour) - rest[numbers]).max() < 1e-6 * tab.size
        tab.page.keyboard.press("Control+Shift+Z")
        tab.says("1 edit ")
        tab.wait_for(colour, pulled)
        # A slice is moved with the handle.
        first = entries(tab, 1)
        tab.open("Edit")
        tab.press("Points")
        tab.page.get_by_label("Layers along").click()
        tab.page.get_by_role("option", name="w").click()
        tab.page.get_by_label("Layer", exact=True).fill("-1")
        tab.press("Layer")
        tab.says("36 of 216 control points are selected")
        arrow = middle_of_last_layer(folder, first) + [0, 0, 0.14 * tab.size]
        tab.drag(arrow, arrow + [0, 0, 5], colour)
        tab.says("2 edits")
        shown, moved = entries(tab, 2), tab.drawn(colour)
        # Another tab shows the same session.
        other = Tab(browser, running.address, BOUNDS, width=300, height=200)
        other.says("2 edits")
        other.page.close()
        # Saved: the file has the numbers of the page.
        tab.page.keyboard.press("Control+s")
        tab.says("Saved")
        edits = yaml.safe_load((folder / "box.yaml").read_text())["edits"]
        assert edits == shown
        assert [next(iter(edit)) for edit in edits] == ["drag", "move"]
        assert edits[1]["move"]["at"] == [":", ":", -1]
        assert edits[1]["move"]["by"][:2] == [0, 0]
        # A STEP file is written and verified by buttons.
        tab.open("Files")
        tab.press("Save and write the CAD file")
        tab.says("solid")
        tab.press("Verify the CAD file")
        tab.says("passed: largest deviation")
        assert tab.complaints == []
        tab.page.close()
        assert running.wait() == 0
        assert {"the page was closed\n", "all edits are saved\n"} <= set(running.lines)
    # The deformation of the file is what was on the screen.
    with Session.open(folder / "box.stl") as session:
        assert np.abs(session.vertices[numbers] - moved).max() < 1e-6 * session.size
    ffd("verify", folder / "box.step", folder / "box.stl", folder / "box.yaml")


def test_nothing_is_lost_when_the_process_is_killed(browser, folder):
    with Session.open(folder / "box.stl") as session:
        rest = session.drawn.rest
        colour, numbers = top_face(session)
    point = np.array([12.0, 12.0, 10.0])
    with editing(folder, "box.stl") as running:
        tab = Tab(browser, running.address, BOUNDS)
        tab.says("0 edits")
        without_exact_faces(tab)
        tab.wait_for(colour, rest[numbers])
        tab.drag(point, point + [0, 0, 4], colour)
        tab.says("1 edit ")
        before, shown = tab.drawn(colour), entries(tab, 1)
        running.kill()
        tab.page.close()
    assert not (folder / "box.yaml").exists()
    with editing(folder, "box.stl") as running:
        tab = Tab(browser, running.address, BOUNDS, width=300, height=200)
        tab.says("1 edit ")
        without_exact_faces(tab)
        tab.wait_for(colour, before)
        assert np.array_equal(tab.drawn(colour), before)
        assert entries(tab, 1) == shown
        # The page asks before it is left with edits that are not saved.
        with tab.page.expect_event("dialog") as asked:
            tab.page.close(run_before_unload=True)
        assert asked.value.type == "beforeunload"
        asked.value.accept()
        assert running.wait() == 0
    with Session.open(folder / "box.stl") as session:
        assert list(session.edits()) == shown
        assert np.abs(session.vertices[numbers] - before).max() < 1e-6 * session.size
