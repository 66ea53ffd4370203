"""What a run will make and take, before the work: counts, and memory."""

from ffdcli.forecast.counts import count_made, count_planned
from ffdcli.forecast.rates import Work
from ffdcli.forecast.require import Memory, require_memory
from ffdcli.forecast.sample import MANY, sample_counts

__all__ = [
    "MANY",
    "Memory",
    "Work",
    "count_made",
    "count_planned",
    "require_memory",
    "sample_counts",
]
