"""From mesh to finished OpenCascade shape, its binary read by OpenCascade, and kept plans."""

import io
import json
import statistics
import sys
import time

from OCP.BinTools import BinTools
from OCP.TopoDS import TopoDS_Shape

from ffdcli.mesh import read_mesh
from ffdcli.pipeline import prepare, read_lattice

mesh_file, lattice_file, target, rounds = sys.argv[1:]
mesh = read_mesh(mesh_file)
lattice = read_lattice(lattice_file, mesh)
taken = {name: [] for name in ("ours", "read", "first", "again", "matrices", "kept")}
for _ in range(int(rounds)):
    begun = time.perf_counter()
    plan = prepare(mesh, lattice)
    planned = time.perf_counter()
    result = plan.deform(lattice, check=False)
    bent = time.perf_counter()
    shape = result.kernel_shape
    taken["ours"].append(time.perf_counter() - begun)
    taken["first"].append(bent - begun)
    taken["again"].append(bent - planned)
    stream = io.BytesIO()
    BinTools.Write_s(shape, stream)
    stream.seek(0)
    begun = time.perf_counter()
    BinTools.Read_s(TopoDS_Shape(), stream)
    taken["read"].append(time.perf_counter() - begun)
    begun = time.perf_counter()
    kept = plan.with_matrices()
    prepared = time.perf_counter()
    kept.deform(lattice, check=False)
    taken["kept"].append(time.perf_counter() - prepared)
    taken["matrices"].append(prepared - begun)
with open(target, "wb") as file:
    file.write(stream.getvalue())
medians = {name: statistics.median(times) for name, times in taken.items()}
print(json.dumps(medians | {"bytes": kept.matrix_bytes}))
