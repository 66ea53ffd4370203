"""Throughput of `ffd batch` with one and with two processes.

    python benchmarks/batch_throughput.py [JOBS] [ROUNDS]

The jobs are a sweep over one sample, so that each process loads the kernel and cuts the mesh once.
Both ways run in turn, so that other load on the machine meets both. numpy gets one thread in either
case: with one process its threads would blur the comparison.
"""

import os
import resource
import sys
import tempfile
from pathlib import Path

SAMPLES = Path(__file__).parent.parent / "samples"
JOBS = """\
version: 1
jobs:
  - mesh: {samples}/bracket.obj
    lattice: {samples}/bracket.yaml
    scale: {scales}
    output: "{{number}}.step"
"""


def measure(jobs: int, rounds: int, *, tell: bool) -> dict[int, float]:
    """Best jobs per second with one and with two processes."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"
    from ffdcli.batch import list_jobs, run_batch

    best = {1: 0.0, 2: 0.0}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "jobs.yaml")
        scales = [(number + 1) / jobs for number in range(jobs)]
        path.write_text(JOBS.format(samples=SAMPLES.resolve(), scales=scales))
        listed = list_jobs(path)
        for _ in range(rounds):
            for workers in best:
                before = processor_seconds()
                outcome = run_batch(
                    listed, Path(folder, "manifest.jsonl"), workers=workers, fresh=True
                )
                if outcome.exit_status:
                    sys.exit(f"jobs failed: {outcome.counts}")
                rate = jobs / outcome.seconds
                spent = processor_seconds() - before
                best[workers] = max(best[workers], rate)
                if tell:
                    print(
                        f"{workers} process(es): {rate:.2f} jobs/s, "
                        f"{spent / jobs:.2f} s of processor per job "
                        f"(load {os.getloadavg()[0]:.1f})",
                        flush=True,
                    )
    return best


def main(jobs: int = 40, rounds: int = 2) -> None:
    """Measure and print."""
    best = measure(jobs, rounds, tell=True)
    print(f"best of {rounds}: {best[2] / best[1]:.2f} times the throughput with two processes")


def processor_seconds() -> float:
    """Time that ended child processes have had of the processors: what load does not change."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
