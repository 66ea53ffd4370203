"""OpenCascade in a separate process.

The process imports it while the geometry is computed here. Ctrl-C works here at any time, although
OpenCascade holds the interpreter lock of its process while it works.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, cast

from ffdcli import errors
from ffdcli.errors import FfdError, KernelError
from ffdcli.files import remove_remnants

if TYPE_CHECKING:
    from ffdcli.brep.occ.check import KernelVerdict
    from ffdcli.brep.occ.processes.kernel import Agree
    from ffdcli.brep.record import Brep

FIELDS = ("message", "file", "line", "key", "hint")


class KernelProcess:
    """A :class:`.Kernel` in another process, which ends with the ``with`` block."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            # -P: do not import modules from the current folder.
            [sys.executable, "-P", "-m", "ffdcli.brep.occ.processes.server"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # The stderr of this process may be closed.
            stderr=subprocess.DEVNULL if sys.stderr is None else None,
            # Ctrl-C goes to this process, which ends the other.
            process_group=0,
        )
        self._requests = cast(IO[bytes], self._process.stdin)
        self._answers = cast(IO[bytes], self._process.stdout)

    @property
    def number(self) -> int:
        """Process id."""
        return self._process.pid

    def __enter__(self) -> KernelProcess:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._end()
        for pipe in (self._requests, self._answers):
            # Unsent bytes have no reader any more.
            with suppress(OSError):
                pipe.close()

    def load(self) -> None:
        """Wait until OpenCascade is imported."""
        self._ask("load")

    def build(self, brep: Brep) -> None:
        """Make the shape."""
        from ffdcli.brep.occ.building.stream import write_stream

        self._request("build", then=lambda: self._send(lambda file: write_stream(brep, file)))
        self._answer("build")

    def begin_check(self) -> None:
        """Start to check the shape in parallel."""
        self._ask("begin_check")

    def verdict(self) -> KernelVerdict:
        """Wait for the result of the check."""
        verdict: KernelVerdict = self._ask("verdict")
        return verdict

    def write(self, path: str | Path, *, agree: Agree | None = None, **how: Any) -> int:
        """Write the shape; the file is renamed into place if ``agree`` accepts the check."""
        try:
            size: int = self._ask("write", str(path), how)
            if agree is not None:
                agree(self.verdict())
            self._ask("place")
        except BaseException:
            self._end()
            remove_remnants([path], process=self.number)
            raise
        return size

    def _ask(self, name: str, *arguments: object) -> Any:
        self._request(name, *arguments)
        return self._answer(name)

    def _request(
        self, name: str, *arguments: object, then: Callable[[], None] | None = None
    ) -> None:
        with self._alive(name):
            pickle.dump((name, arguments), self._requests)
            if then is not None:
                then()
            self._requests.flush()

    def _answer(self, name: str) -> Any:
        with self._alive(name):
            answer = pickle.load(self._answers)
        if "value" in answer:
            return answer["value"]
        raise _error(answer)

    @contextmanager
    def _alive(self, name: str) -> Iterator[None]:
        """Raise a KernelError if the process ends."""
        try:
            yield
        except (OSError, EOFError, pickle.UnpicklingError) as error:
            self._end()
            raise KernelError(
                f"OpenCascade's process ended ({_reason(self._process.returncode)}) while it was "
                f"asked to {name}",
                hint="there may be too little memory for this model",
            ) from error

    def _send(self, write: Callable[[Any], None]) -> None:
        """Send what a function writes, in pieces after their lengths; an empty piece ends it."""
        write(_Pieces(self._requests))
        self._requests.write(bytes(8))

    def _end(self) -> None:
        self._process.kill()
        self._process.wait()


class _Pieces:
    """A file that sends each piece after its length."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream

    def write(self, piece: bytes | memoryview) -> None:
        size = memoryview(piece).nbytes
        if size:
            self._stream.write(size.to_bytes(8, "little"))
            self._stream.write(piece)


def _reason(status: int | None) -> str:
    return f"signal {-status}" if status is not None and status < 0 else f"status {status}"


def _error(answer: dict[str, Any]) -> Exception:
    """The exception that another process reports."""
    kind = getattr(errors, answer["error"], None)
    if kind is not None:
        error: FfdError = kind(answer["message"], **{name: answer[name] for name in FIELDS[1:]})
        return error
    if answer["error"] == "MemoryError":
        return MemoryError(answer["message"])
    return RuntimeError(f"{answer['error']}: {answer['message']}\n{answer['trace']}")
