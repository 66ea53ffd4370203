"""`ffd deform` and `ffd verify` of the saved lattice file, in a process of their own.

OpenCascade holds the interpreter while it works. In another process it does not stop the page, and
a crash of it loses nothing.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

from ffdcli.errors import CheckError, FfdError, FileError, KernelError, LatticeError, MeshError
from ffdcli.stopwatch import Progress

_KINDS: dict[str, type[FfdError]] = {
    each.kind: each for each in (FileError, MeshError, LatticeError, KernelError, CheckError)
}


def run(
    task: Literal["deform", "verify"],
    output: Path,
    model: Path,
    lattice: Path,
    *,
    options: Mapping[str, Any],
    progress: Progress | None = None,
) -> dict[str, Any]:
    """The report of a task on files.

    Parameters
    ----------
    task : {"deform", "verify"}
        Deform the model into the output, or verify the output.
    output, model, lattice : Path
    options : mapping
        Keyword arguments of :func:`ffdcli.deform`, or of :func:`ffdcli.models.verify_model`.
    progress : callable, optional
        Called with the name of each stage as it begins.

    Raises
    ------
    FfdError
        As the task raises it.
    KernelError
        The process ended without a result.
    """
    paths = tuple(str(path.resolve()) for path in (output, model, lattice))
    order = json.dumps({"task": task, "paths": paths, "options": dict(options)})
    command = [sys.executable, "-c", "from ffdcli.editor.runs import work; work()"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdin is not None
            assert process.stdout is not None
            with suppress(BrokenPipeError):
                process.stdin.write(order.encode())
                process.stdin.close()
            for line in process.stdout:
                said = json.loads(line)
                if "stage" in said and progress is not None:
                    progress(said["stage"])
                elif "report" in said:
                    return dict(said["report"])
                elif "error" in said:
                    error = said["error"]
                    raise _KINDS.get(error.pop("kind"), FfdError)(**error)
            process.wait()
        finally:
            process.terminate()
    message = f"the process ended without a result (status {process.returncode})"
    raise KernelError(message, file=str(output), hint=f"try `ffd {task}` in a terminal")


def work() -> None:
    """Do the task that standard input tells; write its stages, and its report or error, as JSON."""
    order = json.load(sys.stdin)
    # What libraries print must not come between the lines.
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as out:
        os.dup2(2, 1)

        def say(what: str, value: Any) -> None:
            out.write(json.dumps({what: value}) + "\n")
            out.flush()

        try:
            report = _TASKS[order["task"]](
                *order["paths"], order["options"], lambda stage: say("stage", stage)
            )
            say("report", report)
        except FfdError as error:
            keys = ("message", "kind", "file", "line", "key", "hint")
            say("error", {key: getattr(error, key) for key in keys})
        except MemoryError:
            say("error", {"kind": "error", "message": "memory ran out"})


def _deform(
    output: str, model: str, lattice: str, options: dict[str, Any], stage: Progress
) -> dict[str, Any]:
    from ffdcli.models import read_model
    from ffdcli.pipeline import deform, read_lattice

    stage("read")
    record = read_model(model)
    settled = read_lattice(lattice, record)
    # `write` runs our own check while OpenCascade runs its check.
    result = deform(record, settled, check=False, progress=stage, **options)
    return result.write(output, progress=stage, check=True).report


def _verify(
    output: str, model: str, lattice: str, options: dict[str, Any], stage: Progress
) -> dict[str, Any]:
    from ffdcli.models import read_lattice, read_model, verify_model

    stage("read")
    record = read_model(model)
    settled = read_lattice(lattice, record)
    stage("verify")
    verdict = verify_model(output, record, settled, **options)
    # JSON has no infinity.
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in vars(verdict).items()
    }


_TASKS: dict[str, Callable[..., dict[str, Any]]] = {"deform": _deform, "verify": _verify}
