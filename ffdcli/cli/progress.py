"""Stages of a long run, on stderr: on a terminal one live line, elsewhere nothing.

No animation where `NO_COLOR` is set.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

# Short runs end before anyone would read the line.
_PATIENCE = 1.0


@contextmanager
def show_stages(title: str, *, quiet: bool) -> Iterator[Callable[[str], None]]:
    """Hand out a function to be told each stage as it begins.

    The line appears once the run has lasted a second, and goes when it ends.
    """
    if quiet or "NO_COLOR" in os.environ or not sys.stderr.isatty():
        yield lambda _stage: None
        return
    # Only a run on a terminal pays for rich.
    from rich.console import Console
    from rich.status import Status

    began = time.monotonic()
    status = Status(title, console=Console(stderr=True))
    shown = False

    def begin(stage: str) -> None:
        nonlocal shown
        status.update(f"{title}: {stage}")
        if not shown and time.monotonic() - began >= _PATIENCE:
            shown = True
            status.start()

    try:
        yield begin
    finally:
        if shown:
            status.stop()
