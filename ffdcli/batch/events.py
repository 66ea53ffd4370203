"""Events that the executors of a batch report, and the signal that stops them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ffdcli.batch.jobs import Job


@dataclass(frozen=True)
class Began:
    """A job, or a stage of it, has begun.

    Parameters
    ----------
    job : Job
    stage : str
    process : int or None
        Id of the process on this machine; None on a cluster.
    """

    job: Job
    stage: str
    process: int | None = None


@dataclass(frozen=True)
class Ended:
    """A job has ended, with this record."""

    job: Job
    record: dict[str, Any]


Event = Began | Ended


@dataclass
class StopSignal:
    """Request to stop a batch.

    A signal handler or another thread may set it.

    Parameters
    ----------
    level : {0, 1, 2}
        0: continue; 1: finish the running jobs, start no others; 2: abandon the running jobs too.
    """

    level: int = 0

    def escalate(self) -> int:
        """Raise the level by one, to 2 at most; returns the new level."""
        self.level = min(2, self.level + 1)
        return self.level
