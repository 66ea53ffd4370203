"""The process OpenCascade has for itself: requests come in on stdin, answers go out, pickled.

When stdin ends, or the process that asks is no more, it ends.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import sys
import traceback
from contextlib import suppress
from io import BytesIO
from typing import IO, Any

from ffdcli.brep.occ.kernel import LocalKernel
from ffdcli.brep.occ.process import FIELDS
from ffdcli.errors import FfdError

_PR_SET_PDEATHSIG = 1


def main() -> None:
    """Answer requests until stdin ends."""
    parent = os.getppid()
    _end_with_parent(parent)
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    # Whatever prints to stdout must not come between the answers.
    os.dup2(2, 1)
    kernel = LocalKernel()
    kernel.load()
    with suppress(EOFError, BrokenPipeError):
        while True:
            name, arguments = pickle.load(requests)
            pickle.dump(_answer(kernel, name, arguments, requests), answers)
            answers.flush()
    # Nothing needs to be taken apart first.
    os._exit(0)


def _end_with_parent(parent: int) -> None:
    """Have Linux end this process with its parent; elsewhere it ends when it next reads stdin."""
    if sys.platform != "linux":
        return
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(0)


def _answer(
    kernel: LocalKernel, name: str, arguments: tuple[Any, ...], requests: IO[bytes]
) -> dict[str, Any]:
    try:
        if name == "build":
            kernel.read(_receive(requests))
        elif name == "check":
            return {"value": kernel.begin_check()()}
        elif name == "write":
            path, how = arguments
            return {"value": kernel.write(path, **how)}
    except Exception as error:
        trace = traceback.format_exc()
        fields = {field: getattr(error, field, None) for field in FIELDS}
        if not isinstance(error, FfdError):
            fields["message"] = str(error)
        return {"error": type(error).__name__, "trace": trace, **fields}
    return {"value": None}


def _receive(requests: IO[bytes]) -> BytesIO:
    """Read pieces with their lengths before them, up to an empty one."""
    stream = BytesIO()
    while size := int.from_bytes(requests.read(8), "little"):
        stream.write(requests.read(size))
    stream.seek(0)
    return stream


if __name__ == "__main__":
    main()
