"""Suppress OpenCascade's messages on stdout and stderr."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def silent_kernel() -> Iterator[None]:
    """Remove OpenCascade's message printers within the block.

    All messages go through its default messenger, so file descriptors stay untouched and Python's
    own output passes. The printers are restored afterwards.
    """
    from OCP.Message import Message

    messenger = Message.DefaultMessenger_s()
    printers = messenger.ChangePrinters()
    kept = [printers.Value(i) for i in range(1, printers.Size() + 1)]
    printers.Clear()
    try:
        yield
    finally:
        for printer in kept:
            messenger.AddPrinter(printer)
