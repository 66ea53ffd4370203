"""The entries of all lattices with what was undone: a history without limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from ffdcli.editor.document import Edits


@dataclass(frozen=True, eq=False)
class History:
    """Steps that were made and undone.

    Parameters
    ----------
    now : Edits
        The entries as they are.
    past, future : tuple of Edits
        The entries before each step, the last one last; and what was undone, the next one last.
    """

    now: Edits
    past: tuple[Edits, ...] = ()
    future: tuple[Edits, ...] = ()

    def step(self, now: Edits) -> History:
        """The history with one more step; what was undone is forgotten."""
        return History(now, (*self.past, self.now))

    def undone(self, lattice: int) -> History | None:
        """The history without its last step; None where there is nothing to undo.

        Beyond the steps made here, the last entry of a lattice is taken away.
        """
        if self.past:
            *past, now = self.past
            return History(now, tuple(past), (*self.future, self.now))
        if not self.now[lattice]:
            return None
        shorter = changed(self.now, lattice, lambda entries: entries[:-1])
        return History(shorter, (), (*self.future, self.now))

    def redone(self) -> History | None:
        """The history with the step that was undone last; None where there is none."""
        if not self.future:
            return None
        *future, now = self.future
        return replace(self.step(now), future=tuple(future))


def changed(
    edits: Edits,
    lattice: int,
    change: Callable[[tuple[dict[str, Any], ...]], tuple[dict[str, Any], ...]],
) -> Edits:
    """The entries of all lattices, those of one changed."""
    return tuple(change(each) if n == lattice else each for n, each in enumerate(edits))
