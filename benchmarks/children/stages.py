"""Seconds and peak memory of our own stages, and of OpenCascade's, for one mesh."""

import json
import os
import sys
import time

from ffdcli.brep.evaluate.own_check import check_brep
from ffdcli.brep.occ.building.stream import write_stream
from ffdcli.brep.occ.processes.kernel import LocalKernel
from ffdcli.mesh import read_mesh
from ffdcli.pipeline import prepare, read_lattice


def resident(field):
    """Bytes of memory: VmRSS now, or VmHWM at most so far."""
    with open("/proc/self/status") as lines:
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(field))


def measure(work):
    """Processor seconds, the most memory that was taken beyond what is held, and the result."""
    before = resident("VmRSS")
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")
    begun = time.process_time()
    result = work()
    return time.process_time() - begun, resident("VmHWM") - before, result


def own():
    """All that is ours, down to the stream that OpenCascade reads."""
    result = prepare(mesh, lattice).deform(lattice, check=False)
    check_brep(result.brep)
    with open(os.devnull, "wb") as nowhere:
        write_stream(result.brep, nowhere)
    return result.brep


def theirs():
    """Shape and file."""
    kernel.build(brep)
    kernel.write(target)


mesh_file, lattice_file, target, with_kernel = sys.argv[1:]
mesh = read_mesh(mesh_file)
lattice = read_lattice(lattice_file, mesh)
seconds, peak, brep = measure(own)
found = {"seconds": seconds, "peak": peak}
if with_kernel == "yes":
    kernel = LocalKernel()
    kernel.load()
    found["kernel_seconds"], found["kernel_peak"], _ = measure(theirs)
print(json.dumps(found))
