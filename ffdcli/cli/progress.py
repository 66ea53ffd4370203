"""Progress of a single run on stderr: one live line on a terminal, otherwise nothing.

Nothing is shown if `NO_COLOR` is set.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ffdcli.messages import printable

# Shorter runs show no line.
_DELAY_SECONDS = 1.0


@contextmanager
def show_stages(title: str, *, quiet: bool) -> Iterator[Callable[[str], None]]:
    """Yield a function to call with the name of each stage as it begins.

    The line appears after a second, and disappears when the block ends.
    """
    # `sys.stderr` is None if it was closed.
    on_terminal = sys.stderr is not None and sys.stderr.isatty()
    if quiet or "NO_COLOR" in os.environ or not on_terminal:
        yield lambda _stage: None
        return
    # Imported only on a terminal: rich is slow to load.
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    title = printable(title)
    live = Progress(*columns, console=Console(stderr=True), transient=True)
    task = live.add_task(title)
    # A thread draws the line, so that it also appears during a long stage.
    timer = threading.Timer(_DELAY_SECONDS, live.start)
    timer.daemon = True
    timer.start()
    try:
        yield lambda stage: live.update(task, description=f"{title}: {stage}")
    finally:
        timer.cancel()
        timer.join()
        live.stop()
