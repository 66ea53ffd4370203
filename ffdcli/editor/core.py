"""The edits of a session: opened, changed step by step, journaled, undone."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import update_wrapper
from pathlib import Path
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

from ffdcli.editor import journal as journals
from ffdcli.editor.document import Document, Edits, digest_of, new_document, read_document
from ffdcli.editor.entry_text import entry_of_text, entry_text, plain_values
from ffdcli.editor.history import History, changed
from ffdcli.editor.stages import Stages
from ffdcli.editor.starting import starter
from ffdcli.errors import LatticeError
from ffdcli.files import require_place
from ffdcli.lattice import Lattice
from ffdcli.mesh import Mesh
from ffdcli.messages import printable
from ffdcli.models import as_mesh, read_model
from ffdcli.part.record import Part

_S = TypeVar("_S", bound="SessionCore")
_P = ParamSpec("_P")
_R = TypeVar("_R")


def locked(
    method: Callable[Concatenate[_S, _P], _R],
) -> Callable[Concatenate[_S, _P], _R]:
    """A method that runs alone: a page calls from several threads."""

    def alone(self: _S, /, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        with self.lock:
            return method(self, *args, **kwargs)

    return update_wrapper(alone, method)


class SessionCore:
    """One model and one lattice file.

    Parameters
    ----------
    model, lattice, output : Path
        Files; the lattice file need not exist, nor what is written.
    record : Mesh or Part
    document : Document
    """

    def __init__(
        self, model: Path, lattice: Path, output: Path, record: Mesh | Part, document: Document
    ) -> None:
        self.lock = threading.RLock()
        self.model_path, self.path, self.output = model, lattice, output
        self.model, self.mesh = record, as_mesh(record)
        self._model_digest = digest_of(model)
        self.found_journal: Path | None = None
        self.revision = 0
        self._active = 0
        self._said = [*record.notes]
        self._document = document
        self._stages = Stages(document, record)
        self._history = History(document.edits)
        self._lattice = self._stages.settle(document.edits)
        # What Save would not have to write.
        self._saved = document.edits if document.digest else None
        self._journal = journals.Journal(lattice)
        try:
            self._recover()
        except BaseException:
            self._journal.close()
            raise

    @classmethod
    def open(
        cls,
        model: str | Path,
        lattice: str | Path | None = None,
        *,
        output: str | Path | None = None,
        volume: str = "bspline",
    ) -> Self:
        """Open a model and its lattice file, or begin one.

        Parameters
        ----------
        model : str or Path
        lattice : str or Path, optional
            By default beside the model, with its name and the ending .yaml. A file that does not
            exist is begun as ``ffd new`` does, and written by the first save.
        output : str or Path, optional
            CAD file to write; by default beside the lattice file, with the ending .step.
        volume : {"bspline", "nurbs", "tspline", "hierarchical"}
            Of a lattice file that is begun.

        Raises
        ------
        FfdError
            A file cannot be read, does not fit, or is open in another session.
        """
        model = Path(model)
        place = Path(model.with_suffix(".yaml") if lattice is None else lattice)
        target = Path(place.with_suffix(".step") if output is None else output)
        if target.resolve() == model.resolve():
            target = target.with_name(f"{target.stem}-out{target.suffix}")
        require_place(place)
        require_place(target)
        record = read_model(model)
        if place.exists():
            document = read_document(place)
        else:
            left = journals.read_journal(journals.journal_path(place))
            begun = left.start if left is not None and left.model == model.name else ""
            document = new_document(place, begun or starter(model, place, record, volume))
        return cls(model, place, target, record, document)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release the lock on the file. Steps that are not saved stay in the journal."""
        self._journal.close()

    @property
    def notices(self) -> tuple[str, ...]:
        """Sentences about the model, the journal and the lattices, for the user."""
        return (*self._said, *self._lattice.warnings)

    @property
    def lattice(self) -> Lattice:
        """The lattices with all edits."""
        return self._lattice

    @property
    def count(self) -> int:
        """Number of lattices."""
        return len(self._lattice.members)

    @property
    def active(self) -> int:
        """Number of the lattice that edits go to."""
        return self._active

    @active.setter
    def active(self, number: int) -> None:
        if not 0 <= number < self.count:
            raise LatticeError(f"there is no lattice {number}", file=str(self.path))
        self._active = number

    def edits(self, n: int | None = None) -> tuple[dict[str, Any], ...]:
        """The entries of a lattice, as in a file."""
        return self._history.now[self._number(n)]

    def edit_texts(self, n: int | None = None) -> tuple[str, ...]:
        """The entries of a lattice, each as a line of a file without its dash."""
        return tuple(map(entry_text, self.edits(n)))

    @property
    def text(self) -> str:
        """The lattice file as a save would write it."""
        return self._document.with_edits(self._history.now).text

    @property
    def unsaved(self) -> bool:
        """Whether the file lacks edits, or does not exist."""
        return self._saved is None or self._saved != self._history.now

    @locked
    def append(self, *edits: dict[str, Any], n: int | None = None) -> None:
        """Make edits, as one step.

        Raises
        ------
        LatticeError
            An edit cannot be made; nothing is changed.
        """
        new = tuple(plain_values(edit) for edit in edits)
        self._step(changed(self._history.now, self._number(n), lambda known: (*known, *new)))

    @locked
    def replace(self, number: int, edit: str | dict[str, Any], n: int | None = None) -> None:
        """Put another edit in the place of one, given as text of a lattice file or as a mapping.

        Raises
        ------
        LatticeError
            The text is no edit, or the edits cannot be made; nothing is changed.
        """
        self._require_entry(number, n)
        new = entry_of_text(edit) if isinstance(edit, str) else plain_values(edit)
        entries = self._number(n)
        self._step(
            changed(
                self._history.now,
                entries,
                lambda known: (*known[:number], new, *known[number + 1 :]),
            )
        )

    @locked
    def remove(self, number: int, n: int | None = None) -> None:
        """Take an edit away.

        Raises
        ------
        LatticeError
            The others cannot be made without it; nothing is changed.
        """
        self._require_entry(number, n)
        self._step(
            changed(
                self._history.now,
                self._number(n),
                lambda known: (*known[:number], *known[number + 1 :]),
            )
        )

    @locked
    def undo(self) -> bool:
        """Take the last step back; beyond the first one, the last edit of the file."""
        history = self._history.undone(self._active)
        return history is not None and self._go(history)

    @locked
    def redo(self) -> bool:
        """Make the step again that was taken back last."""
        history = self._history.redone()
        return history is not None and self._go(history)

    def _number(self, n: int | None) -> int:
        return self._active if n is None else n

    def _require_entry(self, number: int, n: int | None) -> None:
        if not 0 <= number < len(self.edits(n)):
            raise LatticeError(f"there is no edit {number}", file=str(self.path))

    def _step(self, now: Edits) -> None:
        if now != self._history.now:
            self._go(self._history.step(now))

    def _go(self, history: History) -> bool:
        """Settle the edits of a history and journal the step; after an error nothing is changed."""
        lattice = self._stages.settle(history.now)
        step = journals.step_between(self._history.now, history.now)
        start = "" if self._document.digest else self._document.text
        self._journal.record(step, self._document.digest, self.model_path.name, start)
        self._history, self._lattice = history, lattice
        self.revision += 1
        return True

    def _recover(self) -> None:
        """Make the steps of a journal that was left; one of another version is set aside."""
        found = journals.read_journal(self._journal.path)
        if found is None:
            return
        if found.saved is not None and found.saved == self._document.digest:
            # It ended between the save and the end of the journal.
            self._journal.clear()
            return
        count = f"{len(found.steps)} step{'s' * (len(found.steps) > 1)}"
        if found.model != self.model_path.name:
            self._set_aside(f"are of the model {printable(found.model)}")
        elif found.digest != self._document.digest:
            self._set_aside("belong to another version of the file")
        else:
            try:
                history = self._history
                for now in journals.states_after(found, history.now):
                    history = history.step(now)
                self._lattice = self._stages.settle(history.now)
            except LatticeError as error:
                self._set_aside(f"cannot be made again ({error})")
                return
            self._history = history
            self._journal.continues()
            self._said.append(f"{count} that were not saved are restored from the journal")

    def _set_aside(self, why: str) -> None:
        place = self._journal.set_aside()
        self.found_journal = place
        self._said.append(f"edits that were not saved {why}; they are kept in {place.name}")
