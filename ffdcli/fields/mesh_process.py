"""Reads a mesh file with meshio in a process of its own, within bounds of memory and time.

The readers of meshio may print, exit, loop for ever or take any memory where a file is damaged. So
``python -m ffdcli.fields.mesh_process REQUEST`` does the work, and writes the arrays to stdout.
"""

from __future__ import annotations

import contextlib
import io
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from ffdcli.errors import FileError, lacks_memory
from ffdcli.fields.mesh_contents import Contents, read_contents

# Most characters of a message of meshio that are passed on.
_LONGEST = 160


def main() -> None:
    """Read the file that the first argument names, and write arrays and facts to stdout."""
    request = json.loads(sys.argv[1])
    _set_limits(request["memory"], request["seconds"])
    answers = sys.stdout.buffer
    answers.write(answer(request))
    answers.flush()


def answer(request: dict[str, Any]) -> bytes:
    """Arrays and facts of a file, or what is wrong with it, as an .npz file."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        header, arrays = _contents(request, said)
    text = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    content = io.BytesIO()
    np.savez(content, header=text, **arrays)
    return content.getvalue()


def _contents(request: dict[str, Any], said: io.StringIO) -> tuple[dict[str, Any], dict[str, Any]]:
    """Facts and arrays of a file, or the message and hint of what is wrong with it."""
    file, format_name = Path(request["file"]), request["format"]
    try:
        contents = read_contents(file, format_name, request["name"], request["most"])
    except FileError as error:
        return {"message": error.message, "hint": error.hint, "line": error.line}, {}
    # SystemExit is how meshio reports what it cannot read.
    except (Exception, SystemExit) as error:
        if lacks_memory(error):
            return {"message": "it needs more memory than is allowed", "hint": None}, {}
        reason = " ".join((said.getvalue() or f"{type(error).__name__} {error}").split())
        return {"message": f"meshio cannot read it: {reason[:_LONGEST]}", "hint": None}, {}
    return _facts(contents)


def _facts(contents: Contents) -> tuple[dict[str, Any], dict[str, Any]]:
    header = {"name": contents.name, "notes": contents.notes, "cells": contents.cells}
    arrays = {"points": contents.points, "ids": contents.ids}
    if contents.values is not None:
        arrays["values"] = contents.values
    return header, arrays


def _set_limits(memory: int, seconds: int) -> None:
    """Bound the address space (bytes) and the processor time of this process."""
    try:
        import resource
    except ImportError:
        # Windows has no such limits; there the waiting process alone bounds the time.
        return
    for kind, most in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, seconds)):
        # A system may refuse a limit.
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(kind, (most, most))


if __name__ == "__main__":
    main()
