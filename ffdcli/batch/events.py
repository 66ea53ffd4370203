"""What executors tell while they work, and how they are told to stop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ffdcli.batch.jobs import Job


@dataclass(frozen=True)
class Began:
    """A job, or a stage of it, begins in a process of this machine (None: of a cluster)."""

    job: Job
    stage: str
    process: int | None = None


@dataclass(frozen=True)
class Ended:
    """A job has ended; its record says how."""

    job: Job
    record: dict[str, Any]


Event = Began | Ended


@dataclass
class Brake:
    """Stops a batch: 0 go on, 1 finish the jobs under way, 2 give them up too.

    May be set from a signal handler or another thread.
    """

    level: int = 0

    def pull(self) -> int:
        """Brake harder, and say how hard."""
        self.level = min(2, self.level + 1)
        return self.level
