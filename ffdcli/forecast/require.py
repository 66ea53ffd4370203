"""Refuse work that would take more memory than can be had, before it is done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isinf
from typing import Any

from ffdcli.errors import MemoryLimitError
from ffdcli.forecast.counts import Counts
from ffdcli.forecast.rates import Work, memory_held, memory_of
from ffdcli.memory import LIMIT, available_bytes, held_bytes, memory_limit
from ffdcli.messages import amount_text


@dataclass(frozen=True)
class Memory:
    """Memory that a run takes, and that it can have.

    Parameters
    ----------
    needed : int, bytes
        At most, in all processes together; a forecast.
    room : float, bytes
        What the run holds already and what is free, or the limit that was set.
    """

    needed: int
    room: float

    @property
    def fits(self) -> bool:
        """Whether there is enough."""
        return self.needed <= self.room

    @property
    def text(self) -> str:
        """``about 1.9 GB of memory``."""
        return f"about {amount_text(self.needed)} of memory"

    @property
    def report(self) -> dict[str, Any]:
        """The section of reports."""
        return {"needed": self.needed, "available": None if isinf(self.room) else int(self.room)}


def foresee(work: Work, exact: Counts, made: Counts) -> Memory:
    """The memory that work takes, and what can be had; see :func:`memory_of`.

    What the run holds already can be had too. A limit that was set counts instead of what is free.
    """
    room = memory_limit()
    if room is None:
        # Not what else this process holds, whose pages stay where they are.
        room = available_bytes() + min(memory_held(exact), held_bytes())
    return Memory(memory_of(work, exact, made), room)


def require_memory(work: Work, exact: Counts, made: Callable[[], Counts] | None = None) -> Memory:
    """The memory that work takes; refused where that is more than can be had.

    Parameters
    ----------
    work : Work
    exact : Counts
        Of the exact result.
    made : callable, optional
        Gives those of what the tolerance leaves of it; called only where that decides.

    Raises
    ------
    MemoryLimitError
    """
    found, counts = foresee(work, exact, exact), exact
    if made is not None and not found.fits:
        counts = made()
        found = foresee(work, exact, counts)
    if not found.fits:
        raise MemoryLimitError(
            f"this takes about {amount_text(found.needed)} of memory, and "
            f"{amount_text(found.room)} can be had",
            hint=_advice(work, exact, counts, found.room),
        )
    return found


def _advice(work: Work, exact: Counts, made: Counts, room: float) -> str:
    """What to do instead."""
    ways = []
    if work.kind is not None and (work.writer == "kernel" or work.judged):
        direct = replace(work, kind="STEP", writer="direct", judged=False)
        needed = memory_of(direct, exact, made)
        name = "`--writer direct`" if work.kind == "STEP" else "a .step file by `--writer direct`"
        enough = "" if needed <= room else ", still too much"
        ways.append(f"{name} takes about {amount_text(needed)}{enough}")
    if work.tolerance is None:
        ways.append("`--tolerance` writes fewer control points")
    ways.append(f"`--memory none`, or {LIMIT}=none, goes on anyway")
    return "; ".join(ways)
