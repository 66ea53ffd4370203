"""Panel of the history: the list `edits:` as text, each entry removable and editable."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ffdcli.editor.entry_text import entry_of_text
from ffdcli.editor.page.desk import Desk
from ffdcli.errors import LatticeError

# Entries shown at a time, the newest first.
_ROWS = 8


class HistoryPanel:
    """Entries of the active lattice."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        gui = desk.server.gui
        gui.add_markdown(
            "The entries of `edits:`, newest first. Change the text of one and press *Replace*."
        )
        self._last = gui.add_slider("Newest shown", 1, 2, 1, 2, visible=False)
        self._rows = [_Row(desk, row) for row in range(_ROWS)]
        self._follows = True
        desk.change(self._last, self._turned)
        desk.redrawn.append(self._redrawn)

    def _number(self, row: int) -> int:
        """Number of the entry in a row, from 0; negative below the first."""
        count = len(self._desk.session.edit_texts())
        return (self._last.value if count > _ROWS else count) - 1 - row

    def _turned(self) -> None:
        self._follows = self._last.value >= self._last.max
        self._redrawn()

    def _redrawn(self) -> None:
        texts = self._desk.session.edit_texts()
        self._last.visible = len(texts) > _ROWS
        self._last.max = max(len(texts), 2)
        if self._follows or self._last.value > self._last.max:
            self._last.value = self._last.max
        for row, shown in enumerate(self._rows):
            number = self._number(row)
            shown.set(number, texts[number] if number >= 0 else None)


def files_named(edit: Mapping[str, Any]) -> set[str]:
    """Names of the files that an edit reads: control nets, weights, tables of pairs."""
    found = set()
    for value in edit.values():
        inside = (
            [value.get("points"), value.get("pairs")] if isinstance(value, Mapping) else [value]
        )
        found |= {each for each in inside if isinstance(each, str)}
    return found


class _Row:
    """Text and buttons of one entry."""

    def __init__(self, desk: Desk, row: int) -> None:
        gui = desk.server.gui
        self._desk, self._entry = desk, 0
        self._written: tuple[int, str | None] = (-1, None)
        self.folder = gui.add_folder(f"Entry {row}", visible=False)
        with self.folder:
            self._text = gui.add_text("", "", multiline=True)
            buttons = gui.add_button_group("", ("Replace", "Remove"))
        desk.choose(buttons, {"Replace": self._replace, "Remove": self._remove})

    def set(self, number: int, text: str | None) -> None:
        """Show an entry; None shows none. What the user types stays until the entry changes."""
        if (number, text) == self._written:
            return
        self._entry, self._written = number, (number, text)
        self.folder.visible = text is not None
        if text is not None:
            self.folder.label = f"{number + 1}. {text.split(':')[0]}"
            self._text.value = text

    def _replace(self) -> None:
        session = self._desk.session
        edit = entry_of_text(self._text.value)
        new = files_named(edit) - files_named(session.edits()[self._entry])
        if new:
            raise LatticeError(
                f"the page reads no other files, and this entry names {', '.join(sorted(new))}",
                hint="write that into the lattice file in an editor",
            )
        session.replace(self._entry, edit)
        self._desk.say(f"Entry {self._entry + 1} is replaced.")
        self._desk.redraw()

    def _remove(self) -> None:
        self._desk.session.remove(self._entry)
        self._desk.say(f"Entry {self._entry + 1} is removed. Undo brings it back.")
        self._desk.redraw()
