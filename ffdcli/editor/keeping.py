"""The lattice file of a session: saved, read again, and what journals hold of it."""

from __future__ import annotations

import hashlib
from pathlib import Path

from ffdcli.editor import journal as journals
from ffdcli.editor.core import SessionCore, locked
from ffdcli.editor.document import digest_of, read_document
from ffdcli.editor.history import History
from ffdcli.editor.stages import Stages
from ffdcli.errors import FileError
from ffdcli.files import write_whole


class FileSession(SessionCore):
    """A session with its file."""

    @property
    def changed_on_disk(self) -> bool:
        """Whether the file is not as it was when it was read or saved."""
        return digest_of(self.path) != self._document.digest

    def require_same_model(self) -> None:
        """Raise a FileError if the model is not as it was when it was read."""
        if digest_of(self.model_path) != self._model_digest:
            raise FileError(
                "the model changed on disk since it was read",
                file=str(self.model_path),
                hint="open it again: what is shown is the old one",
            )

    @locked
    def save(self, *, overwrite: bool = False) -> Path:
        """Write the lattice file, whole or not at all; return its path.

        Raises
        ------
        FileError
            The file changed since it was read or saved, and ``overwrite`` is not given; or it
            cannot be written.
        """
        if not overwrite and self.changed_on_disk:
            raise FileError(
                "the file changed on disk since it was read",
                file=str(self.path),
                hint="read it again, or overwrite it",
            )
        content = self._document.with_edits(self._history.now).content
        self._journal.saving(hashlib.sha256(content).hexdigest())
        write_whole(self.path, content)
        self._document = read_document(self.path)
        self._saved = self._history.now
        self._journal.clear()
        self.revision += 1
        return self.path

    @locked
    def reload(self) -> None:
        """Read the file again, as a step that can be undone where the other keys are the same.

        Raises
        ------
        FfdError
            The file cannot be read, or does not fit the model; nothing is changed.
        """
        document = read_document(self.path)
        stages = Stages(document, self.model)
        lattice = stages.settle(document.edits)
        same = {**self._document.values, "edits": 0, "lattices": 0} == {
            **document.values, "edits": 0, "lattices": 0}  # fmt: skip
        same = same and len(document.edits) == self.count
        history = self._history.step(document.edits) if same else History(document.edits)
        if self.unsaved and not same:
            # Undo does not lead back to what other keys mean.
            self._set_aside("are of the file as it was before it was read again")
        else:
            self._journal.clear()
        self._document, self._stages, self._history = document, stages, history
        self._lattice, self._saved = lattice, document.edits
        self._active = min(self._active, self.count - 1)
        self.revision += 1

    @locked
    def replay(self, journal: str | Path) -> None:
        """Make the edits of a journal of another version of the file, as steps.

        Raises
        ------
        FfdError
            The journal cannot be read, or does not fit the file; nothing is changed.
        """
        found = journals.read_journal(Path(journal))
        if found is None:
            return
        for now in journals.states_after(found, self._history.now):
            self._step(now)
        self.discard(journal)

    @locked
    def discard(self, journal: str | Path) -> None:
        """Remove a journal of another version of the file."""
        Path(journal).unlink(missing_ok=True)
        self.found_journal = None
        self._said = [each for each in self._said if Path(journal).name not in each]
        self.revision += 1
