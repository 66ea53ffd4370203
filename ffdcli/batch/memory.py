"""Memory that jobs are expected to need, and the number of workers that fits."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress

from ffdcli.batch.jobs import Job
from ffdcli.batch.places import absolute, is_url
from ffdcli.memory import available_bytes, memory_limit, resident_bytes

# A worker that has loaded all libraries and run a small job.
WORKER_BYTES = 400_000_000
# Additional peak per byte of the mesh file with each writer: a triangle has 20 to 50 bytes there,
# and about 100 kB, or 12 kB, as a face of degree 4 to 6.
BYTES_PER_MESH_BYTE = {"kernel": 4000, "direct": 500}
# A worker that holds more than this after a job is replaced.
RETIRE_BYTES = 2_000_000_000


def free_bytes(workers: Iterable[int] = ()) -> float:
    """Memory that workers (process ids) may take beyond what they hold already."""
    limit = memory_limit()
    return available_bytes() if limit is None else limit - sum(map(resident_bytes, workers))


def needed_bytes(job: Job) -> int:
    """Estimate of a job's peak memory beyond that of an idle worker, from the mesh file's size."""
    if is_url(job.mesh):
        return 0
    each = BYTES_PER_MESH_BYTE[job.options.get("writer", "kernel")]
    with suppress(OSError):
        return each * os.stat(absolute(job.folder, job.mesh)).st_size
    return 0


def default_workers() -> int:
    """Default number of processes: one per core, fewer if memory is short."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return int(max(1, min(cores or 1, free_bytes() // WORKER_BYTES)))
