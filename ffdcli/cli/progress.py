"""Stages of a long run, on stderr: on a terminal one live line, elsewhere nothing.

No animation where `NO_COLOR` is set.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

# Short runs end before anyone would read the line.
_PATIENCE = 1.0


@contextmanager
def show_stages(title: str, *, quiet: bool) -> Iterator[Callable[[str], None]]:
    """Hand out a function to be told each stage as it begins.

    The line appears once the run has lasted a second, and goes when it ends.
    """
    # There is no stderr where it was closed.
    on_terminal = sys.stderr is not None and sys.stderr.isatty()
    if quiet or "NO_COLOR" in os.environ or not on_terminal:
        yield lambda _stage: None
        return
    # Only a run on a terminal pays for rich.
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    live = Progress(*columns, console=Console(stderr=True), transient=True)
    task = live.add_task(title)
    # The line is drawn by a thread of its own, so a stage that has begun before is shown too.
    timer = threading.Timer(_PATIENCE, live.start)
    timer.daemon = True
    timer.start()
    try:
        yield lambda stage: live.update(task, description=f"{title}: {stage}")
    finally:
        timer.cancel()
        timer.join()
        live.stop()
