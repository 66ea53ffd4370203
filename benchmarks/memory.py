"""Measure the table of rates in ffdcli/forecast/rates.py: `python benchmarks/memory.py`.

Many models are deformed in processes of their own. The table printed is that of least relative
squares, made larger where forecasts would be too low; the ratios of all runs to the table in use
stand below it. Other programs that use the same libraries meanwhile make the start look smaller.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import cases
import numpy as np
from measure import FFD
from scipy.optimize import nnls

from ffdcli.forecast.counts import Counts, count_planned
from ffdcli.forecast.rates import KERNEL_STAGES, Work, amounts_of, memory_of
from ffdcli.forecast.sample import sample_counts
from ffdcli.mesh import read_mesh
from ffdcli.pipeline import prepare, read_lattice

# Stages of `--profile` that each row of the table is of.
STAGES = {
    "plan": ("read", "check mesh", "planes", "cut", "outlines", "plan"),
    "folds": ("jacobian",),
    "surfaces": ("surfaces",),
    "reduce": ("reduce",),
    "check": ("check",),
    "direct": ("write",),
}
# Options of a run, its extension, and the row that its whole peak is of, if it is of one.
WAYS = {
    "direct": (["--writer", "direct"], ".step", None),
    "direct, reduced": (["--writer", "direct", "--tolerance"], ".step", None),
    "direct, judged": (["--writer", "direct", "--check", "kernel"], ".step", "verdict"),
    "kernel": ([], ".step", "STEP"),
    "kernel, reduced": (["--tolerance"], ".step", "STEP"),
    "IGES": ([], ".igs", "IGES"),
    "BREP": ([], ".brep", "BREP"),
}
# Ways for some lattices only.
FEW = ("IGES", "BREP", "direct, judged")
_TWIST = "edits:\n- twist: {axis: w, angle: 40}\n"
LATTICES = {
    "linear": f"version: 1\ndegree: [1, 1, 1]\npoints: [6, 6, 6]\n{_TWIST}",
    "quadratic": f"version: 1\ndegree: [2, 2, 2]\npoints: [6, 6, 6]\n{_TWIST}",
    "cubic": f"version: 1\ndegree: [3, 3, 3]\npoints: [6, 6, 6]\n{_TWIST}",
    "rational": f"version: 1\nvolume: nurbs\ndegree: [2, 2, 2]\npoints: [6, 6, 6]\n{_TWIST}"
    "- weight: {at: [2, 2, 2], value: 1.5}\n",
    "local": "version: 1\ndegree: [2, 2, 2]\npoints: [12, 12, 12]\nedits:\n"
    "- move: {at: [6, 6, 11], by: [0, 0, 0.1]}\n",
}
MANY_KNOTS = f"version: 1\ndegree: [2, 2, 2]\npoints: [40, 40, 40]\n{_TWIST}"
# A forecast is at least this much of what is measured.
LEAST = 0.97
# Tolerance relative to the size.
TOLERANCE = 1e-6


@dataclass(frozen=True)
class Model:
    """A model, and what it is made into.

    Parameters
    ----------
    name : str
    mesh, lattice : Path
    exact, made : Counts
        Without a tolerance and with one.
    tolerance : float, model length
    """

    name: str
    mesh: Path
    lattice: Path
    exact: Counts
    made: Counts
    tolerance: float


@dataclass(frozen=True)
class Peak:
    """Most memory in a run.

    Parameters
    ----------
    total : int, bytes
        Of all processes together, shared pages counted once.
    stages : dict of str to int, bytes
        Of the first process in each stage.
    """

    total: int
    stages: dict[str, int]


def main() -> None:
    """Measure, and print the table and the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=20_000, help="largest number of facets")
    parser.add_argument("--only", action="append", choices=list(WAYS), help="only these ways")
    options = parser.parse_args()
    rows: dict[str, list[tuple[Counts, float]]] = {}
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        start, kernel_start = starts(Path(folder))
        print(f"START, KERNEL_START = {start:.4g}, {kernel_start:.4g}", flush=True)
        for model in models(Path(folder), options.largest):
            for way, (_, _, row) in WAYS.items():
                if options.only and way not in options.only:
                    continue
                if way in FEW and "quadratic" not in model.name and "cubic" not in model.name:
                    continue
                peak = measure(model, way)
                made = model.made if "reduced" in way else model.exact
                runs.append((model, way, peak.total))
                print(f"{model.name}, {way}: {peak.total / 1e6:.0f} MB", file=sys.stderr)
                if row is not None:
                    rows.setdefault(row, []).append((made, peak.total - start - kernel_start))
                    continue
                for name, stages in STAGES.items():
                    found = [peak.stages[stage] for stage in stages if stage in peak.stages]
                    counts = (
                        model.exact if name in ("plan", "folds", "surfaces", "reduce") else made
                    )
                    if found:
                        rows.setdefault(name, []).append((counts, max(found) - start))
    for name, found in rows.items():
        rates, most = fit(found, start + kernel_start * (name in KERNEL_STAGES))
        text = ", ".join(f"{rate:.0f}.0" for rate in rates)
        print(f'    "{name}": ({text}),  # forecasts are at most {most:.2f} of what was measured')
    print("\nforecast by the table in use, over what was measured:")
    for model, way, total in runs:
        told = memory_of(
            work_of(model, way), model.exact, model.made if "reduced" in way else model.exact
        )
        print(f"{told / total:5.2f}  {model.name}, {way}: {total / 1e6:.0f} MB")


def work_of(model: Model, way: str) -> Work:
    """The work of a run."""
    return Work(
        kind=way if way in ("IGES", "BREP") else "STEP",
        writer="direct" if "direct" in way else "kernel",
        judged="direct" not in way or "judged" in way,
        tolerance=model.tolerance if "reduced" in way else None,
    )


def fit(found: list[tuple[Counts, float]], start: float) -> tuple[np.ndarray, float]:
    """Rates with which no run takes more than ``LEAST`` of its forecast; the largest ratio.

    Parameters
    ----------
    found : list of (Counts, float)
        Bytes beyond those of the start.
    start : float, bytes
    """
    amounts = np.array([amounts_of(counts) for counts, _ in found])
    taken = np.array([each for _, each in found])
    whole = start + taken
    rates, _ = nnls(amounts / whole[:, None], taken / whole)
    told = amounts @ rates
    larger = max(1.0, float(((LEAST * whole - start) / np.maximum(told, 1e6)).max()))
    return larger * rates, float(((start + larger * told) / whole).max())


def starts(folder: Path) -> tuple[int, int]:
    """Memory of the processes with next to no work."""
    mesh = cases.write_obj(folder / "cube.obj", *cases.box_mesh())
    lattice = cases.write_lattice(folder / "cube.yaml", [1, 1, 1], [2, 2, 2], cases.BOX)
    zero = Counts(0, 0, 0, 0, 0, 0, 0)
    cube = Model("cube", mesh, lattice, zero, zero, 1e-4)
    alone, both = measure(cube, "direct").total, measure(cube, "kernel").total
    return alone, both - alone


def models(folder: Path, largest: int) -> Iterator[Model]:
    """Models of many kinds, each with its counts."""
    for frequency in (16, 32, 64):
        if 20 * frequency**2 > 1.1 * largest:
            continue
        points, faces = cases.geodesic_sphere(frequency)
        mesh = cases.write_obj(folder / f"sphere-{frequency}.obj", points, faces)
        for name, text in LATTICES.items():
            lattice = folder / f"{name}.yaml"
            lattice.write_text(text)
            yield model(f"sphere of {len(faces):,}, {name}", mesh, lattice)
    mesh = cases.write_obj(folder / "grid.obj", *gridded_box(100))
    for name, text in {"quadratic": LATTICES["quadratic"], "many knots": MANY_KNOTS}.items():
        lattice = folder / f"{name}.yaml"
        lattice.write_text(text)
        yield model(f"box of {12 * 100**2:,}, {name}", mesh, lattice)
    mesh = cases.write_obj(folder / "prism.obj", *cases.prism(400))
    (folder / "prism.yaml").write_text(MANY_KNOTS)
    yield model("prism of 400, many knots", mesh, folder / "prism.yaml")


def model(name: str, mesh_file: Path, lattice_file: Path) -> Model:
    """A model with its counts."""
    mesh = read_mesh(mesh_file)
    lattice = read_lattice(lattice_file, mesh)
    plan = prepare(mesh, lattice, once=True)
    exact = count_planned(plan.geometry, lattice.volumes, len(plan.origin.checked.triangles))
    tolerance = TOLERANCE * mesh.size
    facets = plan.geometry.parts.facets
    work = Work("STEP", tolerance=tolerance)
    made = exact.reduced_as(*sample_counts(plan.origin.checked, facets, work, spare_planes=True))
    return Model(name, mesh_file, lattice_file, exact, made, tolerance)


def gridded_box(count: int) -> tuple[np.ndarray, np.ndarray]:
    """A box whose sides are grids of 2 ``count``² triangles each."""
    ticks = np.linspace(0.0, 1.0, count + 1)
    across, along = (each.ravel() for each in np.meshgrid(ticks, ticks, indexing="ij"))
    corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)[None, :]).ravel()
    square = np.column_stack([corner, corner + count + 1, corner + count + 2, corner + 1])
    points, faces = [], []
    for axis in range(3):
        for level in (0.0, 1.0):
            side = np.empty((len(across), 3))
            side[:, axis], side[:, (axis + 1) % 3], side[:, (axis + 2) % 3] = level, across, along
            turned = square if level else square[:, ::-1]
            both = np.concatenate([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]])
            faces.append(both + sum(map(len, points)))
            points.append(side)
    places, number = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    return places * cases.BOX, number.ravel()[np.concatenate(faces)]


def measure(model: Model, way: str) -> Peak:
    """Deform a model in a process of its own, and watch its memory and that of its children."""
    options, extension, _ = WAYS[way]
    if options and options[-1] == "--tolerance":
        options = [*options, repr(model.tolerance)]
    report = model.mesh.with_suffix(".json")
    command = [*FFD, "deform", model.mesh, model.lattice, "-o", model.mesh.with_suffix(extension)]
    command += [*options, "--quiet", "--profile", "--report", report, "--memory", "none"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with subprocess.Popen(
        [sys.executable, *map(str, command)],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as process:
        total = peak_of_tree(process.pid, lambda: process.poll() is None)
    if process.returncode:
        sys.exit(f"failed: {' '.join(map(str, command))}")
    stages = {
        stage["stage"]: stage["peak_bytes"] for stage in json.loads(report.read_text())["profile"]
    }
    return Peak(max(total, *stages.values()), stages)


def peak_of_tree(root: int, alive: Callable[[], bool]) -> int:
    """Most memory of a process and its children together while it lives, shared pages once."""
    most = 0
    while alive():
        begun = time.perf_counter()
        most = max(most, sum(map(proportional, tree(root))))
        # To look at large processes takes time that they cannot use.
        time.sleep(max(0.03, 4 * (time.perf_counter() - begun)))
    return most


def tree(root: int) -> Iterator[int]:
    """A process and all its children."""
    yield root
    with suppress(OSError):
        for task in Path(f"/proc/{root}/task").iterdir():
            for child in (task / "children").read_text().split():
                yield from tree(int(child))


def proportional(process: int) -> int:
    """Memory of a process; of pages shared with others its part. 0 if it has ended."""
    with suppress(OSError):
        for line in Path(f"/proc/{process}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return 1024 * int(line.split()[1])
    return 0


if __name__ == "__main__":
    main()
