"""Work done in a forked copy of this process."""

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

from ffdcli.errors import lacks_memory

_PR_SET_PDEATHSIG = 1

T = TypeVar("T")


def run_in_fork(work: Callable[[], T]) -> Callable[[], T]:
    """Start work in a forked copy of this process.

    Only for processes with a single thread that run nothing but this program. If forking is not
    possible, the work is done when its result is requested.

    Parameters
    ----------
    work : callable
        Its result must be picklable.

    Returns
    -------
    callable
        Waits for the result and returns it; may be called once.

    Raises
    ------
    MemoryError, RuntimeError
        While waiting: the work failed, or its process ended.
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
            answer = {"error": "RuntimeError", "message": "it ended without a result"}
        os.waitpid(child, 0)
        if "value" in answer:
            value: T = answer["value"]
            return value
        if answer["error"] == "MemoryError":
            raise MemoryError(answer["message"])
        raise RuntimeError(f"in a copy of the process: {answer['message']}")

    return result


def end_with(parent: int) -> None:
    """Ask Linux to end this process with its parent; no effect on other systems."""
    if sys.platform != "linux":
        return
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(0)


def _work(work: Callable[[], object], parent: int, sender: int) -> None:
    """Do the work in the copy and exit; never returns."""
    try:
        end_with(parent)
        answer: dict[str, object]
        try:
            answer = {"value": work()}
        except BaseException as error:
            name = "MemoryError" if lacks_memory(error) else type(error).__name__
            answer = {"error": name, "message": traceback.format_exc()}
        with os.fdopen(sender, "wb") as answers:
            pickle.dump(answer, answers)
    finally:
        # Skip exit handlers and buffers that belong to the first process.
        os._exit(0)
