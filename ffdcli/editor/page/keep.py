"""Panel that saves the lattice file, writes CAD files and verifies them."""

from __future__ import annotations

import html
import threading
from collections.abc import Callable
from typing import Any

import viser

from ffdcli.editor.page.desk import Desk, plain
from ffdcli.errors import FfdError
from ffdcli.messages import printable_lines

Report = dict[str, Any]
Task = Callable[[Callable[[str], None]], Report]


class KeepPanel:
    """Files of the session. Their names were given in the terminal; the page changes none."""

    def __init__(self, desk: Desk, told: Callable[[Report], str]) -> None:
        self._desk, self._lines = desk, told
        self._running = threading.Lock()
        gui, session = desk.server.gui, desk.session
        gui.add_markdown(f"Lattice file: {plain(session.path.name)}")
        save = gui.add_button("Save", icon=viser.Icon.DEVICE_FLOPPY, hint="Ctrl+S")
        self._changed = gui.add_markdown(
            "**The file has changed on disk** since it was read or saved here.", visible=False
        )
        self._choice = gui.add_button_group(
            "Keep", ("My edits", "The file"), visible=False, hint="What the other has is lost"
        )
        gui.add_markdown(f"CAD file: {plain(session.output.name)}")
        write = gui.add_button("Save and write the CAD file", icon=viser.Icon.FILE_EXPORT)
        verify = gui.add_button("Verify the CAD file", icon=viser.Icon.CHECKS)
        self._bar = gui.add_progress_bar(100, animated=True, visible=False)
        self._told = gui.add_html("")
        self._journal = gui.add_button_group(
            "Found edits", ("Restore", "Discard"), visible=session.found_journal is not None
        )
        desk.press(save, self.save)
        desk.choose(self._choice, {"My edits": self._overwrite, "The file": self._reload})
        desk.choose(self._journal, {"Restore": self._replay, "Discard": self._discard})
        desk.press(write, lambda: self._start("Writing", self._write))
        desk.press(verify, lambda: self._start("Verifying", session.verify))

    def save(self) -> None:
        """Save the lattice file; if it changed on disk, ask what to keep."""
        if self.look():
            raise FfdError(
                "the file has changed on disk", hint="choose under Files whose edits to keep"
            )
        self._desk.say(f"Saved {plain(self._desk.session.save().name)}.")
        self._desk.redraw()

    def look(self) -> bool:
        """Whether the file has changed on disk; shows the choice if so."""
        changed = self._desk.session.changed_on_disk
        self._changed.visible = self._choice.visible = changed
        return changed

    def _overwrite(self) -> None:
        self._desk.session.save(overwrite=True)
        self._desk.say("Saved over the changed file.")
        self.look()
        self._desk.redraw()

    def _reload(self) -> None:
        self._desk.session.reload()
        self._desk.say("Read the file again. Undo brings your edits back.")
        self.look()
        self._desk.redraw()

    def _replay(self) -> None:
        found = self._desk.session.found_journal
        if found is not None:
            self._desk.session.replay(found)
            self._desk.say("The edits are restored.")
        self._journal.visible = False
        self._desk.redraw()

    def _discard(self) -> None:
        found = self._desk.session.found_journal
        if found is not None:
            self._desk.session.discard(found)
            self._desk.say("The edits are discarded.")
        self._journal.visible = False

    def _tell(self, text: str) -> None:
        style = "white-space: pre-wrap; font-size: 0.85em; padding: 0 0.5em"
        self._told.content = f'<div style="{style}">{html.escape(printable_lines(text))}</div>'

    # Slow tasks, beside the worker.

    def _write(self, progress: Callable[[str], None]) -> Report:
        if self.look():
            raise FfdError("the file has changed on disk", hint="choose above whose edits to keep")
        return self._desk.session.write_cad(progress)

    def _start(self, doing: str, task: Task) -> None:
        if not self._running.acquire(blocking=False):
            raise FfdError("a file is being written or verified", hint="wait until it is done")
        self._bar.visible = True
        threading.Thread(target=self._run, args=(doing, task), daemon=True).start()

    def _run(self, doing: str, task: Task) -> None:
        name = self._desk.session.output.name

        def progress(stage: str) -> None:
            self._tell(f"{doing} {name}: {stage}")

        progress("starts")
        try:
            self._tell(self._lines(task(progress)))
        except Exception as error:
            self._tell("")
            self._desk.complain(error)
        finally:
            self._bar.visible = False
            self._running.release()
        self._desk.worker.do(self._desk.redraw)
