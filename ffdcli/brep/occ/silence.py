"""Keep OpenCascade's chatter off stdout and stderr."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def silent_kernel() -> Iterator[None]:
    """Take OpenCascade's message printers away for the length of a block.

    All the kernel says goes through its default messenger, so no file descriptor needs to be
    touched: Python's own output passes, and closed or piped streams make no difference. The
    printers that were there, ours or another library's, come back afterwards.
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
