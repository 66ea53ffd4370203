"""Jobs on threads: order, failures, and results that do not depend on their number."""

import os
import subprocess
import sys
import threading
import time

import pytest

from ffdcli.threads import in_threads, processors


@pytest.mark.parametrize("count", [1, 2, 8])
def test_results_come_in_the_jobs_order(monkeypatch, count):
    monkeypatch.setattr("ffdcli.threads.processors", lambda: count)
    assert in_threads([]) == []
    begun = threading.Barrier(min(count, 4), timeout=300)

    def job(number):
        if number < min(count, 4):
            # Only met where so many run at once.
            begun.wait()
        time.sleep(0.001 * (7 - number))
        return number

    jobs = [lambda n=n: job(n) for n in range(7)]
    assert in_threads(jobs) == list(range(7))
    assert processors() >= 1


def test_failures_come_out(monkeypatch):
    monkeypatch.setattr("ffdcli.threads.processors", lambda: 2)
    with pytest.raises(ZeroDivisionError):
        in_threads([lambda: 1, lambda: 1 // 0])


# A sphere whose faces are many enough for several batches, cut by a lattice of degree 4.
DIGEST = """
import hashlib, sys
import numpy as np, trimesh
import ffdcli.threads
from ffdcli import prepare, read_lattice, read_mesh
ffdcli.threads.processors = lambda: int(sys.argv[1])
trimesh.creation.icosphere(subdivisions=3).export("ball.ply")
with open("lattice.yaml", "w") as file:
    file.write("version: 1\\nvolume: nurbs\\ndegree: [4, 3, 4]\\npoints: [6, 6, 6]\\nedits:\\n")
    file.write("  - move: {at: [-1, 3, 4], by: [0.5, 0.2, -0.1]}\\n")
    file.write("  - twist: {axis: v, angle: 30}\\n  - weight: {at: [3, 2, 3], value: 2}\\n")
mesh = read_mesh("ball.ply")
lattice = read_lattice("lattice.yaml", mesh)
plan = prepare(mesh, lattice)
for made in (plan, plan.with_matrices()):
    result = made.deform(lattice)
    digest = hashlib.sha256(repr(result.injectivity.bound).encode())
    for batch in (*result.brep.surfaces, *result.brep.curves):
        digest.update(np.ascontiguousarray(batch.poles))
    digest.update(result.brep.points)
    digest.update(np.array([[each.volume, each.area] for each in result.masses]))
    print(digest.hexdigest())
"""


def test_results_do_not_depend_on_the_number_of_threads(tmp_path):
    """Ours, and those of the library of linear algebra."""

    def digests(count):
        done = subprocess.run(
            [sys.executable, "-c", DIGEST, str(count)],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env={
                **os.environ,
                "OMP_NUM_THREADS": str(count),
                "OPENBLAS_NUM_THREADS": str(count),
            },
            check=True,
        )
        return done.stdout.split()

    alone = digests(1)
    assert len(alone) == 2
    assert digests(2) == alone
    assert digests(4) == alone
