"""Work that a copy of this process does while this one goes on."""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

_PR_SET_PDEATHSIG = 1

T = TypeVar("T")


def run_in_fork(work: Callable[[], T]) -> Callable[[], T]:
    """Begin work in a copy of this process, which has all that is in memory.

    Only for a process that is ours alone and has one thread. Where no such copies can be made the
    work is done when it is asked for.

    Parameters
    ----------
    work : callable
        What it returns has to be picklable.

    Returns
    -------
    callable
        Waits for what came of the work; to be called once.

    Raises
    ------
    MemoryError, RuntimeError
        On waiting: the work failed, or its process came to its end.
    """
    if sys.platform != "linux":
        return work
    parent = os.getpid()
    receiver, sender = os.pipe()
    try:
        child = os.fork()
    except OSError:
        # Too little memory, or too many processes, for a copy.
        os.close(receiver)
        os.close(sender)
        return work
    if child == 0:
        _work(work, parent, sender)
    os.close(sender)

    def result() -> T:
        try:
            with os.fdopen(receiver, "rb") as answers:
                answer = pickle.load(answers)
        except (EOFError, pickle.UnpicklingError):
            answer = {"error": "RuntimeError", "message": "it came to its end"}
        os.waitpid(child, 0)
        if "value" in answer:
            value: T = answer["value"]
            return value
        if answer["error"] == "MemoryError":
            raise MemoryError(answer["message"])
        raise RuntimeError(f"in a copy of the process: {answer['message']}")

    return result


def end_with(parent: int) -> None:
    """Have Linux end this process with its parent; elsewhere it has to see to that itself."""
    if sys.platform != "linux":
        return
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(0)


def _work(work: Callable[[], object], parent: int, sender: int) -> None:
    """What the copy does; it never returns."""
    try:
        end_with(parent)
        answer: dict[str, object]
        try:
            answer = {"value": work()}
        except BaseException as error:
            answer = {"error": type(error).__name__, "message": traceback.format_exc()}
        with os.fdopen(sender, "wb") as answers:
            pickle.dump(answer, answers)
    finally:
        # Nothing of the first process's is taken apart, flushed or handled twice.
        os._exit(0)
