"""Memory available, memory that a job is expected to need, and the number of workers that fits."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from ffdcli.batch.jobs import Job
from ffdcli.batch.places import absolute, is_url

# A worker that has loaded all libraries and run a small job.
WORKER_BYTES = 400_000_000
# Additional peak per byte of the mesh file: a triangle has 20 to 50 bytes there, and about 100 kB
# as a face of degree 4 to 6.
BYTES_PER_MESH_BYTE = 4000
# A worker that holds more than this after a job is replaced.
RETIRE_BYTES = 2_000_000_000


def available_bytes() -> int:
    """Free memory of the machine, or of the container if that is less."""
    import psutil

    free = int(psutil.virtual_memory().available)
    group = Path("/sys/fs/cgroup")
    with suppress(OSError, ValueError):
        limit = int((group / "memory.max").read_text())
        used = int((group / "memory.current").read_text())
        cache = 0
        for line in (group / "memory.stat").read_text().splitlines():
            if line.startswith("inactive_file "):
                cache = int(line.split()[1])
        free = min(free, max(0, limit - used + cache))
    return free


def resident_bytes(process: int) -> int:
    """Resident memory of a process; 0 if it has ended."""
    import psutil

    with suppress(psutil.Error):
        return int(psutil.Process(process).memory_info().rss)
    return 0


def needed_bytes(job: Job) -> int:
    """Estimate of a job's peak memory beyond that of an idle worker, from the mesh file's size."""
    if is_url(job.mesh):
        return 0
    with suppress(OSError):
        return BYTES_PER_MESH_BYTE * os.stat(absolute(job.folder, job.mesh)).st_size
    return 0


def default_workers() -> int:
    """Default number of processes: one per core, fewer if memory is short."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(cores or 1, available_bytes() // WORKER_BYTES))
