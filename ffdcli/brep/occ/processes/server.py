"""Main program of the OpenCascade process: pickled requests on stdin, answers on stdout.

It ends with stdin, or with its parent process.
"""

from __future__ import annotations

import importlib
import os
import pickle
import sys
import traceback
from collections.abc import Callable
from contextlib import ExitStack, suppress
from io import BytesIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from ffdcli.brep.occ.fork import end_with, run_in_fork
from ffdcli.brep.occ.processes.process import FIELDS
from ffdcli.errors import FfdError, lacks_memory
from ffdcli.threads import processors

if TYPE_CHECKING:
    from ffdcli.brep.occ.check import KernelVerdict

# More processes do not help: the longest part of the work is serial.
_MOST_PROCESSES = 4


def main() -> None:
    """Answer requests until stdin ends."""
    end_with(os.getppid())
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    # Other output to stdout must not mix with the answers.
    os.dup2(2, 1)
    server = _Server(requests)
    server.load()
    with suppress(EOFError, BrokenPipeError):
        while True:
            name, arguments = pickle.load(requests)
            pickle.dump(_answer(server, name, arguments), answers)
            answers.flush()
    # Skip the slow destruction of shapes.
    os._exit(0)


class _Server:
    """State: the shape, its check, and the file that is written but not renamed."""

    def __init__(self, requests: IO[bytes]) -> None:
        self._requests = requests
        self._shape: Any = None
        self._verdict: Callable[[], KernelVerdict] | None = None
        self._file = ExitStack()

    def load(self) -> None:
        """Import OpenCascade and the modules that later requests need."""
        for module in ("OCP", "ffdcli.brep.occ.building.build", "ffdcli.brep.occ.writing.write"):
            importlib.import_module(module)

    def build(self) -> None:
        """Make the shape from the binary stream that follows the request."""
        from ffdcli.brep.occ.building.build import shape_of_stream

        self._verdict = None
        self._shape = shape_of_stream(_receive(self._requests))

    def begin_check(self) -> None:
        """Start to check the shape in parallel."""
        from ffdcli.brep.occ.check import kernel_check

        shape = self._shape
        self._verdict = run_in_fork(lambda: kernel_check(shape))

    def verdict(self) -> KernelVerdict:
        """Wait for the result of the check."""
        if self._verdict is None:
            self.begin_check()
        assert self._verdict is not None
        verdict, self._verdict = self._verdict(), None
        return verdict

    def write(self, path: str | Path, how: dict[str, Any]) -> int:
        """Write a file under a temporary name."""
        from ffdcli.brep.occ.writing.write import begin_cad

        processes = min(_MOST_PROCESSES, processors())
        writing = begin_cad(self._shape, path, processes=processes, **how)
        return self._file.enter_context(writing)

    def place(self) -> None:
        """Rename the file into place."""
        self._file.close()


def _answer(server: _Server, name: str, arguments: tuple[Any, ...]) -> dict[str, Any]:
    try:
        return {"value": getattr(server, name)(*arguments)}
    except Exception as error:
        trace = traceback.format_exc()
        fields = {field: getattr(error, field, None) for field in FIELDS}
        if not isinstance(error, FfdError):
            fields["message"] = str(error)
        kind = "MemoryError" if lacks_memory(error) else type(error).__name__
        return {"error": kind, "trace": trace, **fields}


def _receive(requests: IO[bytes]) -> BytesIO:
    """Read pieces that follow their lengths, up to an empty piece."""
    stream = BytesIO()
    while size := int.from_bytes(requests.read(8), "little"):
        stream.write(requests.read(size))
    stream.seek(0)
    return stream


if __name__ == "__main__":
    main()
